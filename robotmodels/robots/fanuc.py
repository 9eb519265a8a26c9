"""Robots of FANUC: the collaborative CRX-10iA and CRX-10iA/L, whose wrists are not spherical.

Signs and zeros are those of the URDF files of ROS-Industrial: at q = 0 the upper arm is upright
and the forearm points along x. FANUC's controllers show the third angle relative to the
horizontal: ``J3 (controller) = q3 - q2`` with these signs. R_0 is FANUC's world frame, which lies
at the height of the second axis, 0.245 m above the mounting face; the tool is the face plate
(tool0 of FANUC).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

from .. import se3
from ..geometry import DHTable
from ..model import RobotModel
from .assembly import columns


def _crx(name: str, arm: float, lower: Sequence[float], upper: Sequence[float]) -> RobotModel:
    table = DHTable.from_rows(
        columns(
            sigma=(0,) * 6,
            alpha=(0, -90, 180, -90, 90, -90),
            d=(0, 0, arm, 0, 0, 0),
            theta=(0, -90, 0, 0, 0, 0),
            r=(0, 0, 0, -0.54, 0.15, 0),
            lower=lower,
            upper=upper,
            velocity=(120, 120, 180, 180, 180, 180),
        ),
        degrees=True,
    )
    tool = se3.translation(0, 0, -0.16) @ se3.rotation("x", pi)
    return RobotModel.from_table(table, tool=tool, name=name)


def crx10ia() -> RobotModel:
    """FANUC CRX-10iA.

    Khalil-Kleinfinger table, metres and radians. Geometry, position and velocity limits:
    ``crx10ia.urdf.xacro`` of paolofrance/ros2_fanuc_interface (commit 65fc605). The forearm and
    wrist (0.540, 0.150, 0.160 m) agree with ROS-Industrial's file for the CRX-10iA/L. The lengths
    make a reach of sqrt((0.54 + 0.54 + 0.16)^2 + 0.15^2) = 1.249 m, FANUC's 1249 mm (quoted
    without the data sheet at hand). Neither file has inertia or torques.

    Source: P. Franceschi, ros2_fanuc_interface, package crx_description.
    """
    return _crx(
        "crx10ia",
        0.54,
        lower=(-190, -179.9, -71, -190, -179.9, -225),
        upper=(190, 179.9, 251, 190, 179.9, 225),
    )


def crx10ia_l() -> RobotModel:
    """FANUC CRX-10iA/L, the CRX-10iA with a longer upper arm.

    Khalil-Kleinfinger table, metres and radians. Geometry, position and velocity limits:
    ``crx10ial_macro.xacro`` of ros-industrial/fanuc (commit d9e4593), after FANUC's operator's
    manual B-84194EN/01. The lengths make a reach of
    sqrt((0.71 + 0.54 + 0.16)^2 + 0.15^2) = 1.418 m, FANUC's 1418 mm (quoted without the data sheet
    at hand). The file has no inertia or torques.

    Source: ROS-Industrial, fanuc, package fanuc_crx10ia_support.
    """
    return _crx(
        "crx10ia_l",
        0.71,
        lower=(-180, -180, -270, -190, -180, -190),
        upper=(180, 180, 270, 190, 180, 190),
    )
