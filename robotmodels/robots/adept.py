"""Adept (now Omron): a SCARA."""

from __future__ import annotations

from ..geometry import DHTable
from ..model import RobotModel
from .assembly import columns


def cobra_s600() -> RobotModel:
    """Adept Cobra s600, a SCARA: two parallel revolute joints, a vertical slide, a turning quill.

    Classical table, metres and radians; positive q3 lowers the quill, whose axis points down.
    Link lengths 0.325 and 0.275 m: model Cobra600 of the Robotics Toolbox for Python 1.5.0 and,
    independently, the ROS 2 description ytang19-glitch/OMRON-Cobra-S600-ROS2-URDF; their sum is
    the reach in the robot's name. Height 0.387 m: the toolbox. Ranges 105, 150 degrees, 0.21 m,
    360 degrees: the ROS 2 description (the toolbox has narrower ones for the first two). No
    speeds, torques or inertia are taken over.

    Source: P. Corke and J. Haviland, Robotics Toolbox for Python 1.5.0, ``models/DH/Cobra600.py``.
    """
    rows = columns(
        sigma=(0, 0, 1, 0),
        d=(0.387, 0, 0, 0),
        a=(0.325, 0.275, 0, 0),
        alpha=(0, 180, 0, 0),
        lower=(-105, -150, 0, -360),
        upper=(105, 150, 0.21, 360),
    )
    table, tool = DHTable.from_standard(rows, degrees=True)
    return RobotModel.from_table(table, tool=tool, name="cobra_s600")
