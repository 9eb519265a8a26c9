"""Robots as the command line names them: of the catalogue, or a file."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..errors import InvalidValueError
from ..model import RobotModel
from ..robots import load
from ..symoro import read_par


def add_source(parser: argparse.ArgumentParser, option: bool = False) -> None:
    """Add the argument that names a robot, and the options for URDF files."""
    text = "a name of the catalogue (rx90, erd:ur5), a .urdf or a SYMORO .par file"
    if option:
        parser.add_argument("--robot", required=True, help=text)
    else:
        parser.add_argument("robot", help=text)
    parser.add_argument("--base-link", help="URDF only: link whose frame is the world")
    parser.add_argument("--tip-link", help="URDF only: link whose frame is the tool")
    parser.add_argument(
        "--package-dir", action="append", default=[], metavar="FOLDER",
        help="URDF only: folder that holds packages with meshes; may be repeated",
    )  # fmt: skip
    parser.add_argument("--mimic", action="store_true",
                        help="URDF only: mimic joints follow their masters; without it they move "
                        "by themselves")  # fmt: skip


def robot_of(arguments: argparse.Namespace) -> RobotModel:
    """Load the robot of the command line."""
    name = arguments.robot
    suffix = Path(name).suffix.lower()
    if suffix != ".par" and Path(name).is_dir():
        raise InvalidValueError(f"{name!r} is a folder; give a robot's name or file.")
    if suffix == ".par":
        return read_par(name)
    if suffix in (".urdf", ".xml", ".xacro"):
        return RobotModel.from_urdf(
            name, arguments.base_link, arguments.tip_link, package_dirs=arguments.package_dir,
            mimic=arguments.mimic,
        )  # fmt: skip
    if arguments.base_link or arguments.tip_link or arguments.package_dir or arguments.mimic:
        raise InvalidValueError(
            f"--base-link, --tip-link, --package-dir and --mimic are for URDF files; {name!r} is a "
            "name of the catalogue."
        )
    if suffix and Path(name).exists():
        raise InvalidValueError(
            f"{name!r}: robots are read from files named .urdf, .xml, .xacro or .par; to see the "
            "names of the catalogue run robotmodels robots."
        )
    return load(name)
