"""Robots of ABB: IRB 120-3/0.6, IRB 140-6/0.8, IRB 6640-185/2.8.

Signs and zeros are ABB's: at q = 0 the upper arm stands upright and the forearm points along x.
R_0 is ABB's base frame on the mounting face, the tool is ABB's tool0 on the flange, z outwards
and x down.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

from .. import se3
from ..geometry import DHTable
from ..model import RobotModel
from .assembly import PublishedLink, columns, inertia_in_table_frames


def _irb_table(
    height: float,
    shoulder: float,
    arm: float,
    elbow: float,
    forearm: float,
    **limits: Sequence[float],
) -> DHTable:
    return DHTable.from_rows(
        columns(
            sigma=(0,) * 6,
            alpha=(0, -90, 0, -90, 90, -90),
            d=(0, shoulder, arm, elbow, 0, 0),
            theta=(0, -90, 0, 0, 0, 0),
            r=(height, 0, 0, forearm, 0, 0),
            **limits,
        ),
        degrees=True,
    )


def irb120() -> RobotModel:
    """ABB IRB 120-3/0.6.

    Khalil-Kleinfinger table, metres and radians. Geometry, position and velocity limits, masses,
    centres of mass and inertia: ``irb120_3_58_macro.xacro`` of ros-industrial/abb (commit
    59e17fb). The lengths make the 0.58 m reach of the maker (to the wrist centre, shoulder at
    the pedestal's axis). ABB publishes no inertia: the numbers are those of that file's authors,
    and that of link 6 (0.001 kg m^2 on the diagonal) can only be a placeholder. No torques are
    published.

    Source: ROS-Industrial, abb, package abb_irb120_support.
    """
    table = _irb_table(
        0.29, 0.0, 0.27, 0.07, 0.302,
        lower=(-165, -110, -110, -160, -120, -400),
        upper=(165, 110, 70, 160, 120, 400),
        velocity=(250, 250, 250, 320, 320, 420),
    )  # fmt: skip
    flat = (0, 0, 0)
    links = (
        PublishedLink((0, 0, 0), flat, 3.067, (9.77e-05, -0.00012, 0.23841),
                      (0.0142175, -1.28579e-05, -2.31364e-05, 0.0144041, 1.93404e-05, 0.0104533)),
        PublishedLink((0, 0, 0.29), flat, 3.909, (0.00078, -0.00212, 0.10124),
                      (0.0603111, 9.83431e-06, 5.72407e-05, 0.041569, -0.00050497, 0.0259548)),
        PublishedLink((0, 0, 0.27), flat, 2.944, (0.02281, 0.00106, 0.05791),
                      (0.00835606, -8.01545e-05, 0.00142884, 0.016713, -0.000182227, 0.0126984)),
        PublishedLink((0, 0, 0.07), flat, 1.328, (0.2247, 0.00015, 0.00041),
                      (0.00284661, -2.12765e-05, -1.6435e-05, 0.00401346, 1.31336e-05, 0.0052535)),
        PublishedLink((0.302, 0, 0), flat, 0.546, (-0.00109, 3.68e-05, 6.22e-05),
                      (0.000404891, 1.61943e-06, 8.46805e-07, 0.000892825, -1.51792e-08,
                       0.000815468)),
        PublishedLink((0.072, 0, 0), flat, 0.137, (-0.00706, -0.00017, -1.32e-06),
                      (0.001, 0, 0, 0.001, 0, 0.001)),
    )  # fmt: skip
    return RobotModel.from_table(
        table,
        inertia=inertia_in_table_frames(table, links),
        tool=se3.translation(0, 0, 0.072) @ se3.rotation("z", pi),
        name="irb120",
    )


def irb140() -> RobotModel:
    """ABB IRB 140-6/0.8 (type T).

    Khalil-Kleinfinger table, metres and radians. Geometry, position and velocity limits:
    ``irb140t_6_81_macro.xacro`` of ros-industrial/abb_experimental (commit c400391). The lengths
    0.352, 0.070, 0.360, 0.380, 0.065 m agree with the model IRB140 of the Robotics Toolbox for
    Python 1.5.0 (after ABB's data sheet), and make the 0.81 m reach to the wrist centre. The
    inertial data of that toolbox mix millimetres and metres and cover three links only, so none
    are taken over; no torques are published.

    Source: ROS-Industrial, abb_experimental, package abb_irb140_support.
    """
    table = _irb_table(
        0.352, 0.07, 0.36, 0.0, 0.38,
        lower=(-180, -90, -230, -200, -115, -400),
        upper=(180, 110, 50, 200, 115, 400),
        velocity=(250, 250, 260, 360, 360, 450),
    )  # fmt: skip
    tool = se3.translation(0, 0, 0.065) @ se3.rotation("z", pi)
    return RobotModel.from_table(table, tool=tool, name="irb140")


def irb6640() -> RobotModel:
    """ABB IRB 6640-185/2.8.

    Khalil-Kleinfinger table, metres and radians. Geometry, position and velocity limits:
    ``irb6640_185_280_macro.xacro`` of ros-industrial/abb (commit d734892; its limits in radians,
    rounded there to three or four decimals, are written here in the whole degrees they stand
    for). The lengths make the 2.8 m reach of the name. No inertia or torques are published.

    Source: ROS-Industrial, abb, package abb_irb6640_support.
    """
    table = _irb_table(
        0.78, 0.32, 1.075, 0.2, 1.392,
        lower=(-170, -65, -180, -300, -120, -360),
        upper=(170, 85, 70, 300, 120, 360),
        velocity=(100, 90, 90, 170, 140, 190),
    )  # fmt: skip
    tool = se3.translation(0, 0, 0.2) @ se3.rotation("z", pi)
    return RobotModel.from_table(table, tool=tool, name="irb6640")
