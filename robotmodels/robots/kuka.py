"""Robots of KUKA: KR 6 R900 sixx, LWR 4+, LBR iiwa 14 R820."""

from __future__ import annotations

from math import pi

from .. import se3
from ..geometry import DHTable
from ..model import RobotModel
from .assembly import PublishedLink, columns, inertia_in_table_frames


def kr6_r900() -> RobotModel:
    """KUKA KR 6 R900 sixx (Agilus).

    Khalil-Kleinfinger table, metres and radians; signs and zeros are KUKA's (A1, A4 and A6 turn
    about axes that point down or back; at q = 0 the arm is stretched out along x). R_0 is KUKA's
    $ROBROOT on the mounting face, the tool is $FLANGE. Geometry, position and velocity limits:
    ``kr6r900sixx_macro.xacro`` of ros-industrial/kuka_experimental (commit 2510a09). Its lengths
    make the reach of the name, 0.901 m to the wrist centre. Not to be mixed up with the later
    KR 6 R900-2, whose forearm offset and flange are 25 and 90 mm instead of 35 and 80 mm. No
    inertia or torques are published.

    Source: ROS-Industrial, kuka_experimental, package kuka_kr6_support.
    """
    table = DHTable.from_rows(
        columns(
            name=("joint_a1", "joint_a2", "joint_a3", "joint_a4", "joint_a5", "joint_a6"),
            sigma=(0,) * 6,
            alpha=(180, 90, 0, 90, -90, 90),
            d=(0, 0.025, 0.455, 0.035, 0, 0),
            theta=(0, 0, -90, 0, 0, 0),
            r=(-0.4, 0, 0, -0.42, 0, 0),
            lower=(-170, -190, -120, -185, -120, -350),
            upper=(170, 45, 156, 185, 120, 350),
            velocity=(360, 300, 360, 381, 388, 615),
        ),
        degrees=True,
    )
    tool = se3.translation(0, 0, -0.08) @ se3.rotation("y", pi)
    return RobotModel.from_table(table, tool=tool, name="kr6_r900")


def lwr4_plus() -> RobotModel:
    """KUKA LWR 4+, seven joints with torque sensors.

    Khalil-Kleinfinger table, metres and radians; upright at q = 0, the tool is the flange.
    Geometry, position, velocity and torque limits: ``kuka_lwr.urdf.xacro`` of
    CentroEPiaggio/kuka-lwr (commit 00915b5). The signs of the axes and the lengths 0.400 and
    0.390 m agree with the model LWR4 of the Robotics Toolbox for Python 1.5.0, after an exercise
    of A. De Luca, Sapienza University of Rome. The inertia in that file is a placeholder, so none
    is taken over.

    Source: Centro E. Piaggio, kuka-lwr, package lwr_description.
    """
    table = DHTable.from_rows(
        columns(
            sigma=(0,) * 7,
            alpha=(0, 90, -90, -90, 90, 90, -90),
            d=(0,) * 7,
            theta=(0,) * 7,
            r=(0.3105, 0, 0.4, 0, 0.39, 0, 0),
            lower=(-170, -120, -170, -120, -170, -120, -170),
            upper=(170, 120, 170, 120, 170, 120, 170),
            velocity=(110, 110, 128, 128, 204, 184, 184),
            effort=(176, 176, 100, 100, 100, 38, 38),
        ),
        degrees=True,
    )
    return RobotModel.from_table(table, tool=se3.translation(0, 0, 0.078), name="lwr4_plus")


def iiwa14() -> RobotModel:
    """KUKA LBR iiwa 14 R820.

    Khalil-Kleinfinger table, metres and radians; upright at q = 0, the tool is the flange
    (0.126 m from the wrist centre). Geometry: ``iiwa14.xacro`` of IFL-CAMP/iiwa_stack (commit
    052aa68); the lengths 0.36, 0.42, 0.40, 0.126 m and the signs of the axes agree with
    lbr-stack/lbr_fri_ros2_stack (commit 122a16a), and 0.42 + 0.40 is the R820 of the name.
    Position and velocity limits: ``joint_limits.yaml`` of the latter (commit 769ae8e); it gives
    the same 200 N m for all joints, which is no maker's number and is left out. Masses, centres
    of mass and inertia: ``iiwa14_description.xacro`` of the latter, which its authors exported
    from CAD (fusion2urdf; base and links weigh 29.9 kg together). KUKA publishes none.

    Source: M. Huber et al., "LBR-Stack: ROS 2 and Python integration of KUKA FRI for Med and IIWA
    robots", Journal of Open Source Software 9(103), 2024.
    """
    table = DHTable.from_rows(
        columns(
            sigma=(0,) * 7,
            alpha=(0, -90, 90, 90, -90, -90, 90),
            d=(0,) * 7,
            theta=(0,) * 7,
            r=(0.36, 0, 0.42, 0, 0.4, 0, 0),
            lower=(-170, -120, -170, -120, -170, -120, -175),
            upper=(170, 120, 170, 120, 170, 120, 175),
            velocity=(85, 85, 100, 75, 130, 135, 135),
        ),
        degrees=True,
    )
    flat = (0, 0, 0)
    links = (
        PublishedLink((0, 0, 0.1475), flat, 5.289529, (0, -0.033795, 0.132404),
                      (0.042462, 0, 0, 0.042838, 0.006341, 0.01587)),
        PublishedLink((0, -0.01, 0.2125), flat, 5.688888, (0.000136, 0.047548, 0.076322),
                      (0.055182, -3.3e-05, 5.6e-05, 0.053983, 0.010034, 0.016523)),
        PublishedLink((0, 0.01, 0.228), flat, 3.461245, (0, 0.034913, 0.123108),
                      (0.02172, 0, 0, 0.02073, -0.003845, 0.007701)),
        PublishedLink((0, 0.0105, 0.192), flat, 4.122995, (0, -0.039793, 0.086944),
                      (0.03241, 0, 0, 0.030758, -0.006022, 0.009883)),
        PublishedLink((0, -0.0105, 0.2075), flat, 1.563756, (0, -0.029824, 0.076267),
                      (0.008677, 0, 0, 0.007297, 0.002869, 0.003935)),
        PublishedLink((0, -0.0707, 0.1925), flat, 2.457878, (0, 0.07102, 0.00495),
                      (0.007227, 0, 0, 0.006958, 0.000318, 0.004734)),
        PublishedLink((0, 0.0707, 0.091), flat, 0.265331, (3e-06, -2e-06, 1.3782e-02),
                      (0.000175, 0, 0, 0.000175, 0, 0.000306)),
    )  # fmt: skip
    return RobotModel.from_table(
        table,
        inertia=inertia_in_table_frames(table, links),
        tool=se3.translation(0, 0, 0.126),
        name="iiwa14",
    )
