"""``robotmodels info``: the parts of a robot."""

from __future__ import annotations

import argparse
import re
import textwrap
from typing import Any

import numpy as np

from ..geometry import PRISMATIC
from ..inertia import PARAMETERS
from ..model import RobotModel
from ..table_text import boxed, length_text
from .arguments import robot_of
from .output import print_json

_WIDTH = 80  # columns
_LIMITS, _DRIVES = ("lower", "upper", "velocity", "effort"), ("Ia", "Fv", "Fc", "offset")
EXAMPLES = """\
examples:
  robotmodels info rx90
  robotmodels info erd:ur5 --json
  robotmodels info arm.urdf --tip-link link_5"""
DESCRIPTION = """\
Print the geometric table of a robot, its base and tool, joint limits, inertial parameters with
their physical consistency, frames and notes."""
OPTIONS = """\
@robot
@json"""


def run(arguments: argparse.Namespace) -> None:
    """Print everything about one robot."""
    model = robot_of(arguments)
    if arguments.json:
        print_json(as_json(model))
        return
    print(model)
    print("(angles in rad, lengths in m; R_0 and the tool below)")
    for label, pose in (("base Z", model.base), (f"tool E on frame {model.tip}", model.tool)):
        print(f"\n{label}:\n{pose_text(pose)}")
    print(f"\ngravity (m/s^2): {' '.join(f'{g:g}' for g in model.gravity)}")
    print(f"\nJoints (rad, N m; slides m, N; seconds):\n{joint_table(model)}")
    if model.transmission is not None:
        K, q_0 = model.transmission.matrix, model.transmission.offset
        print("\nTransmission, q = K q_motor + q_0 (rows of K, then q_0):")
        for row, value in zip(K, q_0, strict=True):
            print("  " + " ".join(f"{v:10.6g}" for v in row) + f"  | {value:g}")
    if model.inertia.values.any():
        print(f"\nInertial parameters (kg m^2, kg m, kg; about O_j, in R_j):\n"
              f"{inertia_table(model)}")  # fmt: skip
        print(f"Total mass {model.inertia.mass.sum():.6g} kg.")
        if model.inertia.is_physical.all():
            print("Every link is a body that can exist (physically consistent).")
        else:
            print(f"Physical consistency:\n{model.inertia.consistency()}")
    else:
        print("\nNo inertial parameters are known: the dynamic models see massless links.")
    for label, names in (("Frames", model.frame_names), ("Configurations", model.configurations)):
        print(narrow(f"{label}: {', '.join(names)}"))
    for note in model.notes:
        print(narrow(f"Note: {note}"))


def as_json(model: RobotModel) -> dict[str, Any]:
    """Robot as JSON data with the content of the text."""
    table, drive = model.table, model.drive
    quantities = ("antecedent", "sigma", "mu", "gamma", "b", "beta", "alpha", "d", "theta", "r")
    known = bool(model.inertia.values.any())
    links = zip(table.names, model.inertia.values, model.inertia.is_physical, strict=True)
    return {
        "robot": model.name,
        "table": [
            {"name": table.names[j]} | {word: getattr(table, word)[j].item() for word in quantities}
            for j in range(model.f)
        ],
        "base": model.base,
        "tool": model.tool,
        "tip": int(model.tip),
        "gravity": model.gravity,
        "joints": [
            {"name": name, "unit": unit}
            | {word: getattr(table, word)[k] for word in _LIMITS}
            | {word: getattr(drive, word)[k] for word in _DRIVES}
            for k, (name, unit) in enumerate(zip(table.joint_names, _units(model), strict=True))
        ],
        "transmission": None
        if model.transmission is None
        else {"matrix": model.transmission.matrix, "offset": model.transmission.offset},
        "links": [
            {"name": name, **dict(zip(PARAMETERS, values, strict=True)), "physical": physical}
            for name, values, physical in links
        ]
        if known
        else None,
        "total_mass": model.inertia.mass.sum() if known else None,
        "frames": list(model.frame_names),
        "configurations": dict(model.configurations),
        "notes": list(model.notes),
    }


def pose_text(pose: np.ndarray) -> str:
    """A pose as four lines of numbers."""
    return "\n".join("  " + "   ".join(f"{v + 0.0:8.6f}" for v in row) for row in pose.round(9))


def joint_table(model: RobotModel) -> str:
    """Joint limits in a box."""
    table = model.table
    limits = {word: getattr(table, word) for word in _LIMITS}
    drives = {word: getattr(model.drive, word) for word in _DRIVES}
    columns = [(word, [length_text(v) for v in x]) for word, x in (limits | drives).items()]
    return boxed([("joint", list(table.joint_names)), ("unit", _units(model)), *columns])


def inertia_table(model: RobotModel) -> str:
    """Inertial parameters in two boxes: the inertia tensor; first moments and mass."""
    values = model.inertia.values
    columns = [(p, [f"{v:.4g}" for v in values[:, i]]) for i, p in enumerate(PARAMETERS)]
    frames = ("frame", list(model.table.names))
    return "\n".join(boxed([frames, *part]) for part in (columns[:6], columns[6:]))


def _units(model: RobotModel) -> list[str]:
    table = model.table
    return ["m" if s == PRISMATIC else "rad" for s in table.sigma[table.joint_rows]]


def narrow(text: str) -> str:
    """A text with its lines wrapped for a narrow terminal, those that go on another joined."""
    text = re.sub(r"\n {7,}(?=[^\s=])", " ", text)
    shape = {"width": _WIDTH, "subsequent_indent": " " * 4, "break_on_hyphens": False}
    return "\n".join(textwrap.fill(line, **shape) for line in text.splitlines())
