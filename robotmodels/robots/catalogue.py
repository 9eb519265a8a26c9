"""Robots by name: the catalogue's own, and ``erd:<name>`` for the arms of example-robot-data.

Parameters
----------
name : str
    One of `robots`; an unknown one raises `RobotNotFoundError` with similar names.

Returns
-------
str or tuple of str
    A description, or names.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array
from ..drive import DriveParameters, Transmission
from ..errors import RobotNotFoundError
from ..geometry import DHTable, link_transforms
from ..inertia import InertialParameters
from ..model import RobotModel
from ..symoro import read_par
from .erd import ERD_ARMS, load_erd

ERD_PREFIX = "erd:"
"""Names with this prefix are those of the installed example-robot-data."""

CATALOGUE: tuple[str, ...] = (
    "lab_rr", "lab_rrt", "lab_trr", "planar_2r", "planar_3r", "gantry", "rx90", "tx40", "puma560",
    "stanford_arm", "cobra_s600", "ur5", "ur3e", "ur5e", "ur10e", "ur16e", "kr6_r900",
    "lwr4_plus", "iiwa14", "irb120", "irb140", "irb6640", "crx10ia", "crx10ia_l", "panda", "xarm5",
    "xarm6",
)  # fmt: skip
"""The robots that the package describes itself: simple ones first, then by maker."""

_FILES = (".urdf", ".xml", ".xacro", ".par")

Rows = list[dict[str, Any]]


def robots() -> tuple[str, ...]:
    """Names that `load` accepts: the catalogue's own, then those of example-robot-data.

    Examples
    --------
    >>> "rx90" in robots(), "erd:ur5" in robots()
    (True, True)
    """
    return (*CATALOGUE, *(ERD_PREFIX + arm for arm in ERD_ARMS))


def title(name: str) -> str:
    """One-line description of a robot."""
    if isinstance(name, str) and name.removeprefix(ERD_PREFIX) in ERD_ARMS and ":" in name:
        arm = ERD_ARMS[name.removeprefix(ERD_PREFIX)]
        part = f", from {arm.base_link} to {arm.tip_link}" if arm.base_link else ""
        return f"example-robot-data: {arm.urdf}{part}."
    return _data(name)["title"]


def source(name: str) -> str:
    """Title, conventions, source of every number and references of a robot of the catalogue.

    Examples
    --------
    >>> print(source("planar_3r").splitlines()[-1])
    Source: P. Corke and J. Haviland, Robotics Toolbox for Python 1.5.0, ``models/DH/Planar3.py``.
    """
    if isinstance(name, str) and name.startswith(ERD_PREFIX):
        return title(name)
    data = _data(name)
    return f"{data['title']}\n\n{data['text'].strip()}\n\nSource: {data['source']}"


def load(name: str | Path) -> RobotModel:
    """Load a robot by its name, or from a file.

    Parameters
    ----------
    name : str or Path
        One of `robots`, for example ``"rx90"``; ``"erd:<name>"`` for an arm of the package
        example-robot-data by its name there, for example ``"erd:ur5"``, or one of its arms on a
        mobile base, for example ``"erd:pr2_left_arm"``; or a file: a URDF (``.urdf``, ``.xml``) or
        SYMORO's ``.par``. `RobotModel.from_urdf` has the options of URDF files.

    Returns
    -------
    RobotModel
        The robot. `source` names the origin of the numbers of the catalogue.

    Raises
    ------
    RobotNotFoundError, MissingExtraError, UrdfError, InvalidValueError, FileNotFoundError
        The name is unknown; the data of example-robot-data are not installed; a file that cannot be
        read as a robot.

    Examples
    --------
    >>> load("rx90").n
    6
    """
    suffix = Path(name).suffix.lower() if isinstance(name, str | Path) else ""
    if isinstance(name, Path) or suffix in _FILES:
        return read_par(name) if suffix == ".par" else RobotModel.from_urdf(Path(name))
    if isinstance(name, str) and name.startswith(ERD_PREFIX):
        return load_erd(name.removeprefix(ERD_PREFIX))
    data = _data(name)
    columns = dict(data["table"])
    convention = columns.pop("convention", "khalil")
    degrees = columns.pop("degrees", False)
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    if convention == "classical":
        table, tool = DHTable.from_standard(rows, degrees=degrees)
    else:
        table, tool = DHTable.from_rows(rows, degrees=degrees), _pose(data.get("tool"))
    model = RobotModel.from_table(
        table,
        inertia=_inertia(table, rows, degrees, data["inertia"]) if "inertia" in data else None,
        drive=DriveParameters(**data["drive"]) if "drive" in data else None,
        base=_pose(data.get("base")),
        tool=tool,
        transmission=_transmission(**data["transmission"]) if "transmission" in data else None,
        configurations=data.get("configurations"),
        name=name,
    )
    return replace(model, notes=tuple(data["notes"])) if "notes" in data else model


def _data(name: str) -> dict[str, Any]:
    """The file of a robot."""
    if not isinstance(name, str) or name not in CATALOGUE:
        raise RobotNotFoundError(
            "robot",
            name,
            robots(),
            "All names: robots(). Files end in .urdf, .xml, .xacro or .par.",
        )
    return _parsed(name)


@cache
def _parsed(name: str) -> dict[str, Any]:
    """The file of a robot, parsed once."""
    return tomllib.loads((files(str(__package__)) / "data" / f"{name}.toml").read_text("utf-8"))


def _pose(motions: Sequence[Sequence[Any]] | None) -> Array | None:
    """Product of motions such as ``["translation", x, y, z]``, ``["rotation", axis, degrees]``."""
    if motions is None:
        return None
    pose = np.eye(4)
    for kind, *numbers in motions:
        if kind == "rotation":
            pose = pose @ se3.rotation(numbers[0], np.radians(numbers[1]))
        else:
            pose = pose @ se3.translation(*numbers)
    return pose


def _transmission(gears: ArrayLike, **friction: Any) -> Transmission:
    """Transmission from the matrix that gives motor angles from joint angles."""
    return Transmission(np.linalg.inv(np.asarray(gears, np.float64)), **friction)


def _inertia(table: DHTable, rows: Rows, degrees: bool, data: dict[str, Any]) -> InertialParameters:
    """Inertial parameters given in the frames of the table, in classical ones, or in a URDF's."""
    # six numbers of a tensor in the order of a URDF: xx, xy, xz, yy, yz, zz
    tensors = np.asarray(data["inertia"], dtype=float)[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    mass, com, frames = data["mass"], data["com"], data.get("frames", "table")
    if frames == "classical":
        return InertialParameters.from_standard(rows, mass, com, tensors, degrees=degrees)
    if frames == "table":
        return InertialParameters.from_com(mass, com, tensors)
    factors = link_transforms(table, data.get("q_zero", np.zeros(table.n)))
    ours = theirs = np.eye(4)
    moved = np.empty((table.f, 4, 4))
    yaws = data.get("yaw", [0.0] * table.f)
    for j, (xyz, rpy, yaw) in enumerate(zip(data["xyz"], data["rpy"], yaws, strict=True)):
        ours = ours @ factors[j]
        theirs = theirs @ se3.from_rpy(rpy, xyz)
        moved[j] = se3.inverse(ours) @ theirs
        turn = se3.rotation("z", yaw)[:3, :3]
        tensors[j] = turn @ tensors[j] @ turn.T
    return InertialParameters.from_com(mass, com, tensors).moved(moved)
