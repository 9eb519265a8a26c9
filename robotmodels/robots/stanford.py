"""The Stanford arm of Victor Scheinman, 1969: two revolute joints, a prismatic one, a wrist."""

from __future__ import annotations

import numpy as np

from ..drive import DriveParameters
from ..geometry import DHTable
from ..model import RobotModel
from .assembly import columns


def stanford_arm() -> RobotModel:
    """Stanford arm (Scheinman), classical table.

    Metres, radians. Geometry: figure 2.3 of Stanford AIM-177, as in ``models/mdl_stanford.m`` of
    the Robotics Toolbox for MATLAB (commit 45e5a0b) and in its modified-convention twin; the
    Python toolbox 1.5.0 has a stray 0.0203 m on the prismatic joint. Rotor inertias, joint side:
    Paul 1981, table 6.6, same file. Limits: same file, revolute ones after Dobrotin and
    Scheinman 1973; those of the prismatic joint (12 to 50 inch) were estimated there from the
    length of the rack and a photograph.

    The inertial data of Paul's table 6.5 are left out: the copies at hand mix units in the
    centres of mass, so there is no trustworthy source. No speeds or torques are given.

    Source: R. P. Paul, "Modelling, trajectory calculation and servoing of a computer controlled
    arm", Stanford AIM-177, 1972; R. P. Paul, *Robot Manipulators*, MIT Press 1981, tables 6.5, 6.6.
    J. Dobrotin and V. Scheinman, "Design of a computer controlled manipulator for robot research",
    IJCAI 1973.
    """
    rows = columns(
        sigma=(0, 0, 1, 0, 0, 0),
        theta=(0, 0, -90, 0, 0, 0),
        d=(0.412, 0.154, 0, 0, 0, 0.263),
        alpha=(-90, 90, 0, -90, 90, 0),
        lower=(-170, -170, 12 * 0.0254, -170, -90, -170),
        upper=(170, 170, 50 * 0.0254, 170, 90, 170),
    )
    table, tool = DHTable.from_standard(rows, degrees=True)
    drive = DriveParameters(Ia=np.array([0.953, 2.193, 0.782, 0.106, 0.097, 0.020]))
    return RobotModel.from_table(table, drive=drive, tool=tool, name="stanford_arm")
