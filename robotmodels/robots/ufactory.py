"""Robots of UFACTORY: xArm 5 and xArm 6.

Signs and zeros are the maker's: at q = 0 the forearm hangs down in front of the column and the
flange looks down. R_0 is on the mounting face, the tool is the flange.

Geometry and limits: ``xarm5.urdf.xacro`` and ``xarm6.urdf.xacro`` of the maker's own repository
xArm-Developer/xarm_ros2 (commit 27be56d). Its axes 2, 3 (and 4) are at joint offsets of
(53.5, 284.5) and (77.5, 342.5) mm; lengths and angles are computed from these. Masses, centres
of mass and inertia: ``gen_link_inertial_params.py`` of the same repository (commit b7ebd6d), the
data sets "HT_BR2", with the signs of the products of inertia as that file writes them into URDF.
"""

from __future__ import annotations

from math import atan2, hypot, pi

import numpy as np

from .. import se3
from ..geometry import DHTable
from ..model import RobotModel
from .assembly import PublishedLink, columns, inertia_in_table_frames

_ARM = hypot(0.0535, 0.2845)
_ARM_ANGLE = np.rad2deg(atan2(0.2845, 0.0535))
_FOREARM = hypot(0.0775, 0.3425)
_FOREARM_ANGLE = np.rad2deg(atan2(0.3425, 0.0775))

_FLANGE_INERTIA = (9.3e-05, 0.0, 0.0, 5.87e-05, -3.6e-06, 1.32e-04)


def xarm5() -> RobotModel:
    """UFACTORY xArm 5: three parallel axes between a turning column and a turning flange.

    Khalil-Kleinfinger table, metres, radians, kilograms. Sources: the module's docstring (data
    set xarm5_type5_HT_BR2); speed 180 degrees/s and torques as in the URDF.

    Source: UFACTORY, xarm_ros2, package xarm_description.
    """
    table = DHTable.from_rows(
        columns(
            sigma=(0,) * 5,
            alpha=(0, -90, 0, 0, -90),
            d=(0, 0, _ARM, _FOREARM, 0.076),
            theta=(0, -_ARM_ANGLE, _ARM_ANGLE + _FOREARM_ANGLE, -_FOREARM_ANGLE, 0),
            r=(0.267, 0, 0, 0, 0),
            lower=(-360, -118, -225, -97, -360),
            upper=(360, 120, 11, 180, 360),
            velocity=(180,) * 5,
            effort=(50, 50, 30, 20, 20),
        ),
        degrees=True,
    )
    h = pi / 2
    links = (
        PublishedLink((0, 0, 0.267), (0, 0, 0), 2.3849, (0.00013, 0.0294, -0.01239),
                      (0.005705, 1.056e-05, -2.642e-05, 0.00489488, -0.000890795, 0.00334846)),
        PublishedLink((0, 0, 0), (-h, 0, 0), 2.164, (0.03788, -0.2254, 0.03447),
                      (0.0278053, 0.0048865, 0.000656695, 0.00551739, -0.00466808, 0.02692536)),
        PublishedLink((0.0535, -0.2845, 0), (0, 0, 0), 2.121, (0.06883, 0.22985, 0.00102),
                      (0.0373639, -0.00417385, 0.00143647, 0.0058447, 0.0075398, 0.0359236)),
        PublishedLink((0.0775, 0.3425, 0), (0, 0, 0), 1.3169, (0.06489, 0.03122, 0.00319),
                      (0.00144315, -0.000455133, 0.000291878, 0.0018275, 1.32545e-04, 0.00231563)),
        PublishedLink((0.076, 0.097, 0), (-h, 0, 0), 0.17, (0, -0.00677, -0.01098),
                      _FLANGE_INERTIA),
    )  # fmt: skip
    return RobotModel.from_table(
        table,
        inertia=inertia_in_table_frames(table, links),
        tool=se3.translation(0, 0, 0.097),
        name="xarm5",
    )


def xarm6() -> RobotModel:
    """UFACTORY xArm 6.

    Khalil-Kleinfinger table, metres, radians, kilograms. Sources: the module's docstring (data
    set xarm6_type6_HT_BR2); speed 180 degrees/s and torques as in the URDF.

    Source: UFACTORY, xarm_ros2, package xarm_description.
    """
    table = DHTable.from_rows(
        columns(
            sigma=(0,) * 6,
            alpha=(0, -90, 0, -90, 90, -90),
            d=(0, 0, _ARM, 0.0775, 0, 0.076),
            theta=(0, -_ARM_ANGLE, _ARM_ANGLE, 0, 0, 0),
            r=(0.267, 0, 0, 0.3425, 0, 0),
            lower=(-360, -118, -225, -360, -97, -360),
            upper=(360, 120, 11, 360, 180, 360),
            velocity=(180,) * 6,
            effort=(50, 50, 32, 32, 32, 20),
        ),
        degrees=True,
    )
    h = pi / 2
    links = (
        PublishedLink((0, 0, 0.267), (0, 0, 0), 2.3814, (0.00022, 0.02951, -0.0124),
                      (0.0058562, -1.79e-05, 3.55e-06, 0.0050316, -0.000888336, 0.003536652)),
        PublishedLink((0, 0, 0), (-h, 0, 0), 2.2675, (0.03881, -0.22783, 0.03496),
                      (0.028315776, 0.005, 0.00066546, 0.0058, -0.0045741, 0.0273447)),
        PublishedLink((0.0535, -0.2845, 0), (0, 0, 0), 1.875, (0.07041, 0.11631, 0.0107),
                      (0.0063483, -0.0015397, 0.00096858, 0.00379758, 0.00186567, 0.00595768)),
        PublishedLink((0.0775, 0.3425, 0), (-h, 0, 0), 1.3192, (-0.00018, 0.01798, -0.02291),
                      (0.004896, -6.925e-06, -1.418e-05, 0.00445694, -0.00023186, 0.00134332)),
        PublishedLink((0, 0, 0), (h, 0, 0), 1.33854, (0.0651, 0.03096, 0.00315),
                      (0.00146378, -0.000450624, 0.000284306, 0.00184192, 1.30866e-04,
                       0.002333524)),
        PublishedLink((0.076, 0.097, 0), (-h, 0, 0), 0.17, (0, -0.00677, -0.01098),
                      _FLANGE_INERTIA),
    )  # fmt: skip
    return RobotModel.from_table(
        table,
        inertia=inertia_in_table_frames(table, links),
        tool=se3.translation(0, 0, 0.097),
        name="xarm6",
    )
