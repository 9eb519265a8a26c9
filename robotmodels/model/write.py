"""A model as URDF, and warnings of properties that a URDF cannot hold."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from ..errors import UrdfError, UrdfWarning
from ..urdf import TOOL, urdf_text
from ..urdf.write import keeps_inertia
from .argument import check_model
from .robot_model import GRAVITY, RobotModel


def to_urdf(model: RobotModel) -> str:
    """URDF text of a model; also called export. The same model always gives the same text.

    Full-precision numbers, so that reading it back gives the same poses, Jacobians and torques.
    The tool is the link called ``tool``, which `RobotModel.from_urdf` takes for it again. A
    `UrdfWarning` lists properties that a URDF cannot hold: rotor inertia, torque offsets, gravity
    other than 9.81 m/s^2 downwards, inertia that no body has, passive joints, transmissions.

    Parameters
    ----------
    model : RobotModel
        The robot.

    Returns
    -------
    str
        The text.

    Raises
    ------
    UrdfError
        A transmission couples joints in a way that a URDF cannot express, so that the text
        would describe a robot with other poses.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> to_urdf(arm).splitlines()[1]
    '<robot name="robot">'
    """
    check_model(model)
    text = urdf_text(model.parts)
    lost = _lost_in_urdf(model)
    if lost:
        warnings.warn(
            f"A URDF has no place for {'; '.join(lost)}. Keep the model (pickle) to keep them.",
            UrdfWarning,
            stacklevel=2,
        )
    return text


def write_urdf(model: RobotModel, path: str | Path) -> None:
    """Write a model as a URDF file, see `to_urdf`.

    Parameters
    ----------
    model : RobotModel
        The robot.
    path : str or Path
        The file; its folder must exist.
    """
    text = to_urdf(model)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise UrdfError(f"cannot write {str(path)!r}: {error.strerror}.") from None


def _lost_in_urdf(model: RobotModel) -> list[str]:
    lost = []
    if model.drive.Ia.any():
        lost.append("the rotor inertias Ia")
    if (model.drive.Fv < 0).any() or (model.drive.Fc < 0).any():
        lost.append("negative friction")
    if model.drive.offset.any():
        lost.append("the torque offsets")
    if not np.array_equal(model.gravity, GRAVITY):
        lost.append(f"gravity {model.gravity.tolist()}")
    names = [
        name
        for name, row in zip(model.table.names, model.inertia.values, strict=True)
        if not (keeps_inertia(row))
    ]
    if names:
        lost.append(
            f"the inertia of {', '.join(names)} (mass negative, or too small for its moments)"
        )
    if (model.table.mu[model.table.joint_rows] == 0).any():
        lost.append("passive joints (mu = 0)")
    tool = model.twin.names.tool
    if tool != TOOL:
        lost.append(f"the tool's name, taken by a link: read it back with tip_link={tool!r}")
    K = model.transmission
    if K is not None and K.is_invertible:
        lost.append("the transmission (the text's joints are the table's, not the encoders)")
    return lost
