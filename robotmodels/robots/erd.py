"""Arms of the package example-robot-data by their name there, and arms cut out of mobile robots.

The package's own loaders take 0.7 s to import and build a Pinocchio model; this is the short way:
a table of file names, checked against the loaders by a test, and the installed data folder.
"""

from __future__ import annotations

import sys
import tomllib
import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np

from .._arrays import Array
from ..errors import MissingExtraError, RobotNotFoundError
from ..model import RobotModel

_FOLDER = Path("share", "example-robot-data", "robots")


@dataclass(frozen=True, slots=True)
class ErdArm:
    """File of a robot of example-robot-data, and its base and tip links."""

    urdf: str
    base_link: str | None = None
    tip_link: str | None = None
    srdf: str | None = None
    tool: str | None = None


ERD_ARMS: dict[str, ErdArm] = {
    name: ErdArm(**entry)
    for name, entry in tomllib.loads(
        (files(str(__package__)) / "erd.toml").read_text("utf-8")
    ).items()
}
"""Robots that ``erd:<name>`` loads."""


def load_erd(name: str) -> RobotModel:
    """Load an arm of example-robot-data from its URDF."""
    arm = ERD_ARMS.get(name)
    if arm is None:
        raise RobotNotFoundError(
            "robot in example-robot-data", name, ERD_ARMS,
            "For another file of the package use RobotModel.from_urdf(path, base_link, tip_link).",
        )  # fmt: skip
    folder = erd_folder()
    model = RobotModel.from_urdf(folder / arm.urdf, base_link=arm.base_link, tip_link=arm.tip_link)
    if arm.tool is not None:
        point = model.twin.frame(arm.tool)
        tool = np.eye(4)
        tool[:3, :3], tool[:3, 3] = point.rotation, point.position
        notes = tuple(note for note in model.notes if "the tool is link" not in note)  # void here
        model = replace(model.with_tool(tool, tip=point.parent), notes=notes)
    postures = _postures(folder / arm.srdf, model) if arm.srdf else {}
    return model.with_configurations(postures) if postures else model


def erd_folder() -> Path:
    """Folder of the robots of the installed example-robot-data."""
    # wheels built with cmeel keep their files in a prefix inside site-packages
    inside = (Path(entry, "cmeel.prefix") for entry in sys.path if entry)
    for prefix in (*inside, Path(sys.prefix), Path(sys.base_prefix)):
        folder = prefix / _FOLDER
        if folder.is_dir():
            return folder
    raise MissingExtraError(
        "Robots named erd:... are read from the package example-robot-data, which is not "
        "installed. Run: pip install example-robot-data"
    )


def _postures(srdf: Path, model: RobotModel) -> dict[str, Array]:
    if not srdf.is_file():
        return {}
    column = {name: i for i, name in enumerate(model.table.joint_names)}
    postures: dict[str, Array] = {}
    for state in ET.parse(srdf).getroot().iter("group_state"):
        given = {joint.get("name"): joint.get("value", "").split() for joint in state.iter("joint")}
        q = np.zeros(model.n)
        known = [name for name in given if name in column and len(given[name]) == 1]
        for name in known:
            q[column[name]] = float(given[name][0])
        if known:
            postures[state.get("name", "state")] = q
    return postures
