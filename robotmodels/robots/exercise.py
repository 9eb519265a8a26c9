"""The robots of the laboratory exercise on the inverse geometric model (the second seed document).

Their figures are not readable. Robot RR is given in full by its matrices; the two others are
taken as the exercise's text and poses define them, as each docstring says.
"""

from __future__ import annotations

from math import pi

from .. import se3
from ..geometry import DHTable
from ..model import RobotModel
from .assembly import columns

_RIGHT = pi / 2


def lab_rr() -> RobotModel:
    """Robot RR of the exercise, ``T = Rot(z, q1) Trans(z, l1) Rot(y, q2) Trans(x, l2)``.

    Metres, radians. ``l1 = 0.5``, ``l2 = 0.2``: the exercise leaves them as symbols; these are
    the values of its problems 1 and 2. No limits and no inertia are given.

    Source: The exercise, eq. (4.1) to (4.5).
    """
    table = DHTable.from_rows(
        columns(sigma=(0, 0), alpha=(0, -90), d=(0, 0), theta=(0, 0), r=(0.5, 0)), degrees=True
    )
    tool = se3.rotation("x", _RIGHT) @ se3.translation(0.2, 0, 0)
    return RobotModel.from_table(table, tool=tool, name="lab_rr")


def lab_rrt() -> RobotModel:
    """Robot RRT of the exercise's problem 1, ``Rot(z, q1) Trans(z, l1) Rot(y, q2) Trans(x, q3)``.

    Metres, radians. ``l1 = 0.5`` is given; its figure 4.3 is not readable, so the layout is that
    of robot RR with a sliding last link. No limits and no inertia are given.

    Source: The exercise, section 4.2, problem 1.
    """
    # z_3 is along x of the second link: x_2 turns to -z of that link, hence the 90 degrees
    table = DHTable.from_rows(
        columns(sigma=(0, 0, 1), alpha=(0, -90, 90), d=(0, 0, 0), theta=(0, 90, 0), r=(0.5, 0, 0)),
        degrees=True,
    )
    return RobotModel.from_table(table, tool=se3.rotation("y", -_RIGHT), name="lab_rrt")


def lab_trr() -> RobotModel:
    """Robot TRR of the exercise's problem 2: a carriage along y that carries a planar 2R arm.

    ``T = Trans(y, q1) Trans(z, l1) Rot(y, q2) Trans(x, l2) Rot(y, q3) Trans(x, l3)`` in metres
    and radians. ``l1 = 0.5``, ``l2 = l3 = 0.2``. Its figure 4.4 is not readable: this is the
    layout that reaches pose A of the exercise in full, at q = (-0.3 m, -45 deg, -45 deg); of
    pose B it reaches the position only, stretched out at q = (0.2, 0, 0). No limits and no
    inertia are given.

    Source: The exercise, section 4.2, problem 2 with poses A and B.
    """
    table = DHTable.from_rows(
        columns(
            sigma=(1, 0, 0), alpha=(-90, 0, 0), d=(0, 0.5, 0.2), theta=(-90, 90, 0), r=(0, 0, 0)
        ),
        degrees=True,
    )
    tool = se3.rotation("x", _RIGHT) @ se3.translation(0.2, 0, 0)
    postures = {"pose_a": (-0.3, -_RIGHT / 2, -_RIGHT / 2), "pose_b_position": (0.2, 0.0, 0.0)}
    return RobotModel.from_table(table, tool=tool, name="lab_trr", configurations=postures)
