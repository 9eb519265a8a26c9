"""``robotmodels info``: what a robot is made of."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from ..geometry import PRISMATIC
from ..model import RobotModel
from ..table_text import boxed, length_text
from .source import add_source, robot_of


def add_command(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : argparse subparsers
        Where to add it.

    Examples
    --------
    >>> add_command(argparse.ArgumentParser().add_subparsers())
    """
    parser = commands.add_parser(
        "info",
        help="print a robot's table, limits, inertia and frames",
        description="Print the geometric table of a robot, its base and tool, joint limits, "
        "inertial parameters with their physical consistency, frames and notes.",
    )
    add_source(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Print everything about one robot.

    Parameters
    ----------
    arguments : Namespace
        Parsed arguments.

    Examples
    --------
    >>> source = dict(robot="rx90", base_link=None, tip_link=None, package_dir=[])
    >>> run(argparse.Namespace(**source))  # doctest: +ELLIPSIS
    rx90: 6 joints, 6 frames...
    """
    model = robot_of(arguments)
    print(model)
    print("(angles in rad, lengths in m; R_0 and the tool below)")
    for label, pose in (("base Z", model.base), (f"tool E on frame {model.tip}", model.tool)):
        print(f"\n{label}:\n{pose_text(pose)}")
    print(f"\nJoints:\n{joint_table(model)}")
    if model.inertia.values.any():
        print(f"\nInertial parameters (about O_j, in R_j):\n{inertia_table(model)}")
        print(f"Total mass {model.inertia.mass.sum():.6g} kg. Physical consistency:")
        print(model.inertia.consistency())
    else:
        print("\nNo inertial parameters are known: the dynamic models see massless links.")
    print(f"\nFrames: {', '.join(model.frame_names)}")
    print(f"Configurations: {', '.join(model.configurations)}")
    for note in model.notes:
        print(f"Note: {note}")


def pose_text(pose: np.ndarray) -> str:
    """A pose as four lines of numbers.

    Parameters
    ----------
    pose : ndarray, shape (4, 4)
        The pose, metres.

    Returns
    -------
    str
        Four lines.

    Examples
    --------
    >>> print(pose_text(np.eye(4)).splitlines()[0])
      1.000000   0.000000   0.000000   0.000000
    """
    return "\n".join("  " + "   ".join(f"{v + 0.0:8.6f}" for v in row) for row in pose.round(9))


def joint_table(model: RobotModel) -> str:
    """Joint limits in a box.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.

    Returns
    -------
    str
        Text of n + 4 lines.

    Examples
    --------
    >>> from ..robots import load
    >>> len(joint_table(load("rx90")).splitlines())
    10
    """
    table = model.table
    units = ["m" if s == PRISMATIC else "rad" for s in table.sigma[table.joint_rows]]
    return boxed([
        ("joint", list(table.joint_names)),
        ("unit", units),
        ("lower", [length_text(v) for v in table.lower]),
        ("upper", [length_text(v) for v in table.upper]),
        ("velocity", [length_text(v) for v in table.velocity]),
        ("effort", [length_text(v) for v in table.effort]),
        ("Ia", [length_text(v) for v in model.drive.Ia]),
        ("Fv", [length_text(v) for v in model.drive.Fv]),
        ("Fc", [length_text(v) for v in model.drive.Fc]),
    ])  # fmt: skip


def inertia_table(model: RobotModel) -> str:
    """Inertial parameters in a box.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames.

    Returns
    -------
    str
        Text of f + 4 lines.

    Examples
    --------
    >>> from ..robots import load
    >>> "ZZ" in inertia_table(load("puma560"))
    True
    """
    from ..inertia import PARAMETERS

    values = model.inertia.values
    columns = [(p, [f"{v:.4g}" for v in values[:, i]]) for i, p in enumerate(PARAMETERS)]
    return boxed([("frame", list(model.table.names)), *columns])
