"""Robots that are no product: the usual examples, with lengths that were chosen to be simple."""

from __future__ import annotations

from math import pi

from .. import se3
from ..geometry import DHTable
from ..model import RobotModel
from .assembly import columns


def planar_2r() -> RobotModel:
    """Planar arm with two revolute joints about z and links of 1 m, in the x-y plane.

    Lengths as in the model Planar2 of the Robotics Toolbox for Python 1.5.0 (a = 1, 1 m; metres
    and radians). It is no product: there are no limits and there is no inertia.

    Source: P. Corke and J. Haviland, Robotics Toolbox for Python 1.5.0, ``models/DH/Planar2.py``.
    """
    table, tool = DHTable.from_standard(columns(a=(1.0, 1.0)))
    return RobotModel.from_table(
        table, tool=tool, name="planar_2r", configurations={"bent": (0, pi / 2)}
    )


def planar_3r() -> RobotModel:
    """Planar arm with three revolute joints about z and links of 1 m, in the x-y plane.

    Lengths as in the model Planar3 of the Robotics Toolbox for Python 1.5.0 (a = 1, 1, 1 m;
    metres and radians). It is no product: there are no limits and there is no inertia.

    Source: P. Corke and J. Haviland, Robotics Toolbox for Python 1.5.0, ``models/DH/Planar3.py``.
    """
    table, tool = DHTable.from_standard(columns(a=(1.0, 1.0, 1.0)))
    return RobotModel.from_table(table, tool=tool, name="planar_3r")


def gantry() -> RobotModel:
    """Gantry with a spherical wrist: three prismatic joints along x, y and -z, then three revolute.

    It is no product: no lengths enter, and the strokes (3 m, 2 m, 1 m; metres and radians) are
    chosen for illustration. At q = 0 the tool points down; the wrist centre is at
    ``(q1, q2, -q3)``. There is no inertia.
    """
    table = DHTable.from_rows(
        columns(
            sigma=(1, 1, 1, 0, 0, 0),
            alpha=(0, -90, 90, 0, -90, 90),
            d=(0,) * 6,
            theta=(0, 90, 180, 0, 0, 0),
            r=(0,) * 6,
            lower=(0, 0, 0, -180, -180, -180),
            upper=(3, 2, 1, 180, 180, 180),
        ),
        degrees=True,
    )
    return RobotModel.from_table(table, base=se3.rotation("y", pi / 2), name="gantry")
