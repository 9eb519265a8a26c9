"""``robotmodels igm``: every posture that brings a robot's tool to a pose, or why there is none."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import se3
from .._arrays import Array, as_mask
from ..errors import InvalidValueError, RobotModelsWarning
from ..igm import IGMSolutions, IGMStatus
from ..igm import igm as inverse_model
from ..kinematics import dgm
from ..model import RobotModel
from ..table_text import boxed
from .arguments import numbers, posture, revolute, robot_of
from .info import pose_text
from .output import Report

EXAMPLES = """\
examples:
  robotmodels igm rx90 --xyz 0.3 0.2 0.5 --rpy 0 90 45 --degrees
  robotmodels igm lab_trr --xyz 0.4 0.2 0.5 --mask 1 1 1 0 0 0
  robotmodels igm arm.urdf --matrix 0 0 -1 0.4  0 1 0 0.1  1 0 0 0.6  0 0 0 1
  robotmodels igm erd:ur5 --q 0.3 -0.9 1.2 0.4 0.8 -0.2 --limits
  robotmodels igm iiwa14 --q 10 30 0 -80 0 40 0 --degrees --arm-angle 20"""
DESCRIPTION = """\
Inverse geometric model: print every posture that brings the robot's tool to a pose, with its
branch, its error and whether it is inside the joint limits; or why there is none. Lengths are
in m, angles in rad unless --degrees is given."""
OPTIONS = """\
@robot
@json
the pose of the tool, in one of three ways:
--xyz X Y Z [] position in world axes
--rpy R P Y [] with --xyz: roll, pitch and yaw of the orientation, Rot(z,Y) Rot(y,P) Rot(x,R); may
    be left out if --mask requests no rotation
--matrix NUMBERS [] 16 numbers of the 4x4 pose, row by row
--q NUMBERS [] the pose that these joint variables (or a named configuration) lead to
the request:
@degrees
--limits [flag] only postures inside the joint limits
--q-ref NUMBERS [] order by the distance to this posture; joints that the pose leaves free take its
    values (default 0)
@mask
--mask-axes [world|tool =world] axes of the mask
--lock JOINT=VALUE [repeated] a joint, by name or number from 1, that keeps a value; may be repeated
--arm-angle ANGLE [] seven-joint arms: angle of the elbow about the line from shoulder to wrist
--tolerance NUMBERS [] largest error: metres and radians, or one number for both (default
    1e-9); poses given with few digits need more"""
NOT_REACHED = "the pose is not reached"


def run(arguments: argparse.Namespace) -> Report:
    """Run the command: solve and print."""
    model = robot_of(arguments)
    mask = mask_of(arguments.mask)
    T = pose_of(arguments, model, mask)
    tolerance = (1e-9,) if arguments.tolerance is None else numbers(
        arguments.tolerance, (1, 2), "--tolerance"
    )  # fmt: skip
    degrees = bool(arguments.degrees)
    q_ref, arm_angle = arguments.q_ref, None
    if arguments.arm_angle is not None:
        arm_angle = float(numbers(arguments.arm_angle, 1, "--arm-angle")[0])
        arm_angle = float(np.deg2rad(arm_angle)) if degrees else arm_angle
    found = inverse_model(
        model, T,
        q_ref=None if q_ref is None else posture(q_ref, model, "--q-ref", degrees),
        mask=mask, mask_axes=arguments.mask_axes, limits=arguments.limits,
        lock=locks_of(arguments.lock, model, degrees),
        arm_angle=arm_angle,
        position_tolerance=float(tolerance[0]), orientation_tolerance=float(tolerance[-1]),
    )  # fmt: skip
    data = as_json(model, T, found, degrees)
    return Report(as_text(data, arguments.mask_axes), data, bool(found.count))


def mask_of(text: str | None) -> Array | None:
    """Requested components, from six numbers or a word."""
    if text is None:
        return None
    if text.isalpha():
        return as_mask(text, name="--mask").astype(np.float64)
    return numbers(text, 6, "--mask")


def pose_of(arguments: argparse.Namespace, model: RobotModel, mask: Array | None) -> Array:
    """The requested pose."""
    ways = ("--xyz", "--matrix", "--q")
    given = [w for w in ways if getattr(arguments, w.removeprefix("--")) is not None]
    if len(given) != 1:
        raise InvalidValueError(
            f"pose: expected one of {', '.join(ways)}, got {' and '.join(given) or 'none'}."
        )
    if arguments.rpy is not None and given != ["--xyz"]:
        raise InvalidValueError(f"--rpy belongs to --xyz; {given[0]} holds the orientation.")
    if given == ["--q"]:
        return dgm(model, posture(arguments.q, model, "--q", arguments.degrees))
    if given == ["--matrix"]:
        return se3.as_pose(numbers(arguments.matrix, 16, "--matrix").reshape(4, 4), "--matrix")
    xyz = numbers(arguments.xyz, 3, "--xyz")
    if arguments.rpy is None:
        if mask is None or mask[3:].any():
            raise InvalidValueError(
                "--xyz: the orientation is missing; add --rpy, or request the position alone with "
                "--mask position."
            )
        return se3.translation(*xyz)
    rpy = numbers(arguments.rpy, 3, "--rpy")
    if not arguments.degrees and np.abs(rpy).max() > 4.0 * np.pi:
        words = f"--rpy: an angle of {np.abs(rpy).max():g} rad is more than two turns"
        warnings.warn(f"{words}; for degrees add --degrees.", RobotModelsWarning, stacklevel=2)
    return se3.from_rpy(np.deg2rad(rpy) if arguments.degrees else rpy, xyz)


def locks_of(
    words: Sequence[str], model: RobotModel, degrees: bool
) -> dict[int | str, float] | None:
    """Joints that keep a value."""
    names, locks = list(model.table.joint_names), dict[int | str, float]()
    for word in words:
        joint, equals, text = word.partition("=")
        column = names.index(joint) if joint in names else -1
        if joint.isdecimal():
            column = int(joint) - 1
        if not (equals and 0 <= column < model.n) or column in locks:
            raise InvalidValueError(
                f"--lock: expected JOINT=VALUE, each joint once, by its number from 1 to {model.n} "
                f"or by its name ({', '.join(names)}), got {word!r}."
            )
        value = float(numbers(text, 1, f"--lock {joint}")[0])
        locks[column] = np.deg2rad(value).item() if degrees and revolute(model)[column] else value
    return locks or None


def as_json(model: RobotModel, T: Array, found: IGMSolutions, degrees: bool) -> dict[str, Any]:
    """Solutions of one pose as JSON data."""
    names, turns = np.array(model.table.joint_names), revolute(model)
    scale = np.where(turns, 180.0 / np.pi, 1.0) if degrees else 1.0
    postures = [
        {
            "q": (found.q[s] * scale).tolist(),
            "branch": str(found.branch[s]),
            "residual": float(found.residual[s]),
            "within_limits": bool(found.within_limits[s]),
            "double": bool(found.double[s]),
            "free_joints": names[found.free_joints[s]].tolist(),
            "family_joints": names[found.family_joints[s]].tolist(),
        }
        for s in np.flatnonzero(found.valid)
    ]
    closest = None
    if not postures and found.closest is not None and np.isfinite(found.closest).all():
        closest = (found.closest * scale).tolist()
    return {
        "robot": model.name,
        "joints": names.tolist(),
        "units": np.where(turns, "deg" if degrees else "rad", "m").tolist(),
        "pose": T.tolist(),
        "reached": bool(postures),
        "status": IGMStatus(int(found.status)).name,
        "reason": found.reason(),
        "method": found.method,
        "mask": found.mask.astype(int).tolist(),
        "postures": postures,
        "closest": closest,
    }


def as_text(data: dict[str, Any], mask_axes: str = "world") -> str:
    """Solutions of one pose as text."""
    names, units, rows = data["joints"], data["units"], data["postures"]
    lines = [
        f"{data['robot']}: {len(rows)} posture{'s' * (len(rows) != 1)}. {data['reason']}",
        f"method: {data['method']}",
        f"pose of the tool (m):\n{pose_text(np.array(data['pose']))}",
    ]
    if not all(data["mask"]):
        requested = " ".join(
            np.array(["x", "y", "z", "rx", "ry", "rz"])[np.array(data["mask"]) > 0]
        )
        lines.append(f"requested: {requested} in {mask_axes} axes")
    if rows:
        columns = [
            ("", [str(k + 1) for k in range(len(rows))]),
            ("branch", [row["branch"] for row in rows]),
            *(
                (f"q{j + 1} [{unit}]", [_number(row["q"][j], unit) for row in rows])
                for j, unit in enumerate(units)
            ),
            ("residual", [f"{row['residual']:.1e}" for row in rows]),
            ("limits", ["inside" if row["within_limits"] else "outside" for row in rows]),
            ("root", ["double" if row["double"] else "" for row in rows]),
        ]
        lines += [f"q: {', '.join(names)}", boxed([c for c in columns if any(c[1])])]
    families: dict[tuple[str, str], list[str]] = {}  # of postures with the same free joints
    for k, row in enumerate(rows, start=1):
        free, others = ", ".join(row["free_joints"]), ", ".join(row["family_joints"])
        if free or others:
            families.setdefault((free, others), []).append(str(k))
    for (free, others), which in families.items():
        text = f" {free} took the reference;" if free else ""
        text += f" {others or 'no other joint'} moves with it."
        lines.append(f"infinite family through posture {', '.join(which)}:{text}")
    if data["closest"] is not None:
        each = zip(names, data["closest"], units, strict=True)
        closest = ", ".join(f"{name} {_number(v, unit)} {unit}" for name, v, unit in each)
        lines.append(f"closest posture: {closest}")
    return "\n".join(lines)


def _number(value: float, unit: str) -> str:
    text = f"{value:.4f}" if unit == "deg" else f"{value:.6f}"
    return text.removeprefix("-") if float(text) == 0 else text
