"""Robots of Universal Robots: UR5 (third series) and the e-series.

All tables are the maker's: classical, metres and radians, in the maker's base frame (the frame
that the controller calls base; the ROS packages' ``base_link`` is turned by 180 degrees about z),
and the tool is the flange. Abbreviations used in the docstrings:

- *UR article*: Universal Robots, "DH parameters for calculations of kinematics and dynamics",
  universal-robots.com/articles (as of May 2025; before that, FAQ 45257): tables, masses, centres
  of mass.
- *ROS 2 description*: UniversalRobots/Universal_Robots_ROS2_Description on GitHub,
  ``config/<type>/physical_parameters.yaml`` at commit 3426d67 (masses and centres of mass, equal
  to the article's; inertia about the centres of mass in the axes of the article's frames) and
  ``joint_limits.yaml`` (after the user manuals, version 5.8, and the article "Max. joint
  torques"). Its elbow range of 180 degrees is half the maker's, which the arm cannot use.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

from ..geometry import DHTable
from ..inertia import InertialParameters
from ..model import RobotModel
from .assembly import Products, Vector, columns, symmetric

_NAMES = (
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
    "wrist_1_joint", "wrist_2_joint", "wrist_3_joint",
)  # fmt: skip

# State "up" of the SRDF of ur_moveit_config, without its rounding.
_UP = (0.0, -pi / 2, 0.0, -pi / 2, 0.0, 0.0)


def _ur(
    name: str,
    d: Sequence[float],
    a: Sequence[float],
    velocity: Sequence[float],
    effort: Sequence[float],
    mass: Sequence[float] = (),
    com: Sequence[Vector] = (),
    inertia: Sequence[Products] = (),
) -> RobotModel:
    d1, d4, d5, d6 = d
    a2, a3 = a
    rows = columns(
        name=_NAMES,
        d=(d1, 0, 0, d4, d5, d6),
        a=(0, a2, a3, 0, 0, 0),
        alpha=(90, 0, 0, 90, -90, 0),
        lower=(-360, -360, -180, -360, -360, -360),
        upper=(360, 360, 180, 360, 360, 360),
        velocity=velocity,
        effort=effort,
    )
    table, tool = DHTable.from_standard(rows, degrees=True)
    links = None
    if mass:
        links = InertialParameters.from_standard(rows, mass, com, symmetric(inertia), degrees=True)
    return RobotModel.from_table(
        table, inertia=links, tool=tool, name=name, configurations={"up": _UP}
    )


def ur5() -> RobotModel:
    """Universal Robots UR5 (CB series), third series of parameters.

    Metres, radians. Table: manual of the CB3 controller, appendix "Robot DH parameter", table for
    the UR5 serie 3; the complete sets of postures this package is tested against use the same,
    and ``erd:ur5`` is the same arm turned by 180 degrees about z. Limits: ``ur5_robot.urdf`` of
    example-robot-data 5.0.0, whose 3.15 and 3.2 rad/s stand for 180 degrees/s. No inertia is given
    by the maker for this arm; ``erd:ur5`` has one.

    Source: Universal Robots, CB3 manual, tables B.2 to B.4.
    """
    return _ur(
        "ur5",
        d=(0.089159, 0.10915, 0.09465, 0.0823),
        a=(-0.425, -0.39225),
        velocity=(180,) * 6,
        effort=(150, 150, 150, 28, 28, 28),
    )


def ur3e() -> RobotModel:
    """Universal Robots UR3e.

    Metres, radians, kilograms. Table, masses and centres of mass: UR article. Inertia and limits:
    ROS 2 description (limits at commit 8ef39b3).

    Source: See the module's docstring.
    """
    return _ur(
        "ur3e",
        d=(0.15185, 0.13105, 0.08535, 0.0921),
        a=(-0.24355, -0.2132),
        velocity=(180, 180, 180, 360, 360, 360),
        effort=(56, 56, 28, 12, 12, 12),
        mass=(1.98, 3.4445, 1.437, 0.871, 0.805, 0.261),
        com=(
            (0, -0.02, 0),
            (0.13, 0, 0.1157),
            (0.05, 0, 0.0238),
            (0, 0, 0.01),
            (0, 0, 0.01),
            (0, 0, -0.02),
        ),
        inertia=(
            (0.0027657, 0.0000096, -0.0000149, 0.0021501, 0.0001873, 0.0025626),
            (0.0042623, -0.0000409, -0.0014960, 0.0460284, -0.0000129, 0.0448947),
            (0.0010511, 0.0, -0.0000331, 0.0113396, 0.0000022, 0.0110895),
            (0.0008174, -0.0000005, 0.0000021, 0.0006844, 0.0000617, 0.0005497),
            (0.0006059, -0.0000006, -0.0000006, 0.0005837, -0.0000271, 0.0003831),
            (0.0001080, -0.0000001, -0.0000001, 0.0001086, -0.0000002, 0.0001371),
        ),
    )


def ur5e() -> RobotModel:
    """Universal Robots UR5e.

    Metres, radians, kilograms. Table, masses and centres of mass: UR article. Inertia and limits:
    ROS 2 description (limits at commit 1c32d8f).

    Source: See the module's docstring.
    """
    return _ur(
        "ur5e",
        d=(0.1625, 0.1333, 0.0997, 0.0996),
        a=(-0.425, -0.3922),
        velocity=(180,) * 6,
        effort=(150, 150, 150, 28, 28, 28),
        mass=(3.761, 8.058, 2.846, 1.37, 1.3, 0.365),
        com=(
            (0, -0.02561, 0.00193),
            (0.2125, 0, 0.11336),
            (0.15, 0, 0.0265),
            (0, -0.0018, 0.01634),
            (0, 0.0018, 0.01634),
            (0, 0, -0.001159),
        ),
        inertia=(
            (0.00700210, 0.00000073, -0.00001053, 0.00648091, 0.00049994, 0.00657286),
            (0.01505885, -0.00005400, 0.00000563, 0.33388086, -0.00000181, 0.33247207),
            (0.00399632, -0.00001365, 0.00137272, 0.07879254, -0.00000660, 0.07848510),
            (0.00165491, -0.00000282, -0.00000438, 0.00135962, 0.00010157, 0.00126279),
            (0.00135617, -0.00000274, 0.00000444, 0.00127827, -0.00005048, 0.00096614),
            (0.00018694, 0.00000006, -0.00000017, 0.00018908, -0.00000092, 0.00025756),
        ),
    )


def ur10e() -> RobotModel:
    """Universal Robots UR10e.

    Metres, radians, kilograms. Table, masses and centres of mass: UR article but for its last
    row, which was not at hand: d6 = 0.11655 m is that of several public copies of the table (an
    older description rounds it to 0.117), the last centre of mass that of the ROS 2 description.
    Inertia and limits: ROS 2 description (limits at commit 8ef39b3).

    Source: See the module's docstring.
    """
    return _ur(
        "ur10e",
        d=(0.1807, 0.17415, 0.11985, 0.11655),
        a=(-0.6127, -0.57155),
        velocity=(120, 120, 180, 180, 180, 180),
        effort=(330, 330, 150, 56, 56, 56),
        mass=(7.369, 13.051, 3.989, 2.1, 1.98, 0.615),
        com=(
            (0.021, 0, 0.027),
            (0.38, 0, 0.158),
            (0.24, 0, 0.068),
            (0, 0.007, 0.018),
            (0, 0.007, 0.018),
            (0, 0, -0.026),
        ),
        inertia=(
            (0.03408, 0.00002, -0.00425, 0.03529, 0.00008, 0.02156),
            (0.02814, 0.00005, -0.01561, 0.77068, 0.00002, 0.76943),
            (0.01014, 0.00008, 0.00916, 0.30928, 0.0, 0.30646),
            (0.00296, -0.00001, 0.0, 0.00222, -0.00024, 0.00258),
            (0.00296, -0.00001, 0.0, 0.00222, -0.00024, 0.00258),
            (0.00040, 0.0, 0.0, 0.00041, 0.0, 0.00034),
        ),
    )


def ur16e() -> RobotModel:
    """Universal Robots UR16e.

    Metres, radians, kilograms. Table: two independent public copies agree (a third has
    a = -0.505, -0.352); the article's own rows for this arm were not at hand. Masses, centres of
    mass, inertia and limits: ROS 2 description (limits at commit 8ecc89e); its centres of mass of
    the two long links are moved to the classical frames with these lengths.

    Source: See the module's docstring.
    """
    return _ur(
        "ur16e",
        d=(0.1807, 0.17415, 0.11985, 0.11655),
        a=(-0.4784, -0.36),
        velocity=(120, 120, 180, 180, 180, 180),
        effort=(330, 330, 150, 54, 54, 54),
        mass=(7.369, 10.450, 4.321, 2.180, 2.033, 0.907),
        com=(
            (0, -0.016, 0.030),
            (0.302, 0, 0.16),
            (0.194, 0, 0.065),
            (0, -0.009, 0.011),
            (0, 0.018, 0.012),
            (0, 0, -0.044),
        ),
        inertia=(
            (0.03351, 0.00002, -0.00001, 0.03374, 0.00374, 0.02100),
            (0.02796, -0.00010, -0.00720, 0.47558, 0.00003, 0.47635),
            (0.01091, 0.00006, 0.01012, 0.12060, 0.00001, 0.11714),
            (0.00609, -0.00001, 0.0, 0.00245, 0.00083, 0.00579),
            (0.00389, -0.00001, 0.0, 0.00219, -0.00045, 0.00363),
            (0.00117, 0.0, 0.0, 0.00118, 0.0, 0.00084),
        ),
    )
