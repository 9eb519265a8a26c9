"""``robotmodels follow``: can a path of poses be followed, from which postures, where it breaks."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from .._arrays import Array
from ..csv_table import open_table
from ..errors import InvalidValueError
from ..performance import FeasiblePath, feasible_path
from .arguments import revolute, robot_of
from .igm import mask_of
from .output import Report

EXAMPLES = """\
examples:
  robotmodels follow rx90 poses.csv --degrees
  robotmodels follow crx10ia weld.csv --through-singular --motion joints.csv
  robotmodels follow lab_trr points.csv --no-limits --picture graph.png

Each row of the file is a pose in world axes: x y z; x y z roll pitch yaw; x y z and a unit
quaternion qx qy qz qw; or the 16 numbers of the 4x4 matrix. The first row may hold names."""
_WIDTHS = (3, 6, 7, 16)


DESCRIPTION = """\
Follow a path of poses from every posture of its first pose: postures that reach the end
without a jump, and the breaks of the others."""
OPTIONS = """\
@robot
poses [path] file with one pose in each row
@degrees
@no_limits
@mask
--through-singular [flag] allow motions through singular positions
--cost [length|conditioning =length] what the best motion minimises
--motion FILE [path] write the best joint motion as CSV
--picture FILE [path] draw the graph of all postures (.png, .pdf, .svg)
@json"""
NOT_REACHED = "no posture follows the path to its end"


def run(arguments: argparse.Namespace) -> Report:
    """Run the command: follow, write and print."""
    model = robot_of(arguments)
    poses = read_poses(arguments.poses, arguments.degrees)
    found = feasible_path(
        model, poses, not arguments.no_limits, mask_of(arguments.mask),
        arguments.through_singular, arguments.cost,
    )  # fmt: skip
    scale = np.where(revolute(model), 180.0 / np.pi, 1.0) if arguments.degrees else 1.0
    if arguments.motion is not None:
        head = ",".join(model.table.joint_names)
        np.savetxt(arguments.motion, found.q * scale, delimiter=",", header=head, comments="")
    if arguments.picture is not None:
        from ..viz import plot_feasible_path

        plot_feasible_path(found).savefig(arguments.picture)
    data = {
        "robot": model.name, "status": found.status.name, "reason": found.reason(),
        "reached": found.reached, "breaks": found.breaks, "q": found.q * scale,
        "start": found.postures[0] * scale if len(poses) else [],
    }  # fmt: skip
    return Report(as_text(found, scale), data, bool(found.reached.any()))


def as_text(found: FeasiblePath, scale: Array | float) -> str:
    """The outcome as text."""
    lines = [f"{len(found.q)} poses: {found.reason()}"]
    rows = found.postures[0] if len(found.q) else np.zeros((0, 0))
    starts = rows[~np.isnan(rows).any(axis=1)] * scale
    for q, last, good in zip(starts, found.breaks, found.reached, strict=True):
        numbers = " ".join(f"{v + 0.0:9.4f}" for v in q)
        text = "followed to the end" if good else f"breaks before pose {last} (from 0)"
        lines.append(f"  from q = [{numbers}]: {text}")
    return "\n".join(lines)


def read_poses(path: Path, degrees: bool) -> Array:
    """Poses (N, 4, 4) of a file."""
    from scipy.spatial.transform import Rotation

    table = open_table(path)
    if table.width not in _WIDTHS:
        raise InvalidValueError(
            f"{path}: expected rows of 3, 6, 7 or 16 numbers, got {table.width} columns; see "
            "robotmodels follow --help."
        )
    values = table.numbers(range(table.width))
    if table.width == 16:
        return values.reshape(-1, 4, 4)
    T = np.tile(np.eye(4), (len(values), 1, 1))
    T[:, :3, 3], turns = values[:, :3], values[:, 3:]
    if table.width == 7:
        lengths = np.linalg.norm(turns, axis=1)
        if np.abs(lengths - 1.0).max() > 1e-3:
            wrong = lengths[np.abs(lengths - 1.0).argmax()]
            raise InvalidValueError(
                f"expected unit quaternions qx qy qz qw, got one of {wrong:.4g}."
            )
        T[:, :3, :3] = Rotation.from_quat(turns).as_matrix()
    elif table.width == 6:  # roll, pitch, yaw about fixed axes
        T[:, :3, :3] = Rotation.from_euler("xyz", turns, degrees=degrees).as_matrix()
    return T
