"""``robotmodels igm``: every posture that brings a robot's tool to a pose, or why there is none."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import se3
from .._arrays import Array, as_mask
from ..errors import InvalidValueError
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
branch, what it misses and whether it is inside the joint limits; or why there is none. Lengths are
in m, angles in rad unless --degrees is given."""
OPTIONS = """\
@robot
@json
the pose of the tool, in one of three ways:
--xyz X Y Z [] position in world axes
--rpy R P Y [] with --xyz: roll, pitch and yaw of the orientation, Rot(z,Y) Rot(y,P) Rot(x,R); may
    be left out if --mask asks for no rotation
--matrix NUMBERS [] 16 numbers of the 4x4 pose, row by row
--q NUMBERS [] the pose that these joint variables (or a named configuration) lead to
what is asked for:
--degrees [flag] angles in degrees, those given and those printed
--limits [flag] only postures inside the joint limits
--q-ref NUMBERS [] order by the distance to this posture; joints that the pose leaves free take its
    values (default 0)
--mask NUMBERS [] 1 or 0 for each of x y z rx ry rz: what has to be met; or one of the words
    position, xyz (the same) and orientation
--mask-axes [world|tool =world] axes of the mask
--lock JOINT=VALUE [repeated] a joint, by name or number from 1, that keeps a value; may be repeated
--arm-angle ANGLE [] seven-joint arms: angle of the elbow about the line from shoulder to wrist
--tolerance NUMBERS [] how much may be missing: metres and radians, or one number for both (default
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
    q_ref = arguments.q_ref
    found = inverse_model(
        model, T,
        q_ref=None if q_ref is None else posture(q_ref, model, "--q-ref", degrees),
        mask=mask, mask_axes=arguments.mask_axes, limits=arguments.limits,
        lock=locks_of(arguments.lock, model, degrees),
        arm_angle=angle_of(arguments.arm_angle, degrees),
        position_tolerance=float(tolerance[0]), orientation_tolerance=float(tolerance[-1]),
    )  # fmt: skip
    text = as_text(model, T, found, arguments.mask_axes, degrees)
    return Report(text, as_json(model, T, found, degrees), bool(found.count))


def mask_of(text: str | None) -> Array | None:
    """What has to be met, from six numbers or a word."""
    if text is None:
        return None
    if text.isalpha():
        return as_mask(text, name="--mask").astype(np.float64)
    return numbers(text, 6, "--mask")


def pose_of(arguments: argparse.Namespace, model: RobotModel, mask: Array | None) -> Array:
    """The pose asked for."""
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
                "--xyz: the orientation is missing; add --rpy, or ask for the position alone with "
                "--mask position."
            )
        return se3.translation(*xyz)
    rpy = numbers(arguments.rpy, 3, "--rpy")
    return se3.from_rpy(np.deg2rad(rpy) if arguments.degrees else rpy, xyz)


def locks_of(
    words: Sequence[str], model: RobotModel, degrees: bool
) -> dict[int | str, float] | None:
    """Joints that keep a value."""
    names = list(model.table.joint_names)
    locks: dict[int | str, float] = {}
    for word in words:
        joint, equals, text = word.partition("=")
        known = joint in names or (joint.isdecimal() and 1 <= int(joint) <= model.n)
        if not equals or not known:
            raise InvalidValueError(
                f"--lock: expected JOINT=VALUE with a joint by its number from 1 to {model.n} or "
                f"by its name ({', '.join(names)}), got {word!r}."
            )
        column = names.index(joint) if joint in names else int(joint) - 1
        if column in locks:
            raise InvalidValueError(f"--lock: joint {joint} is given twice.")
        value = float(numbers(text, 1, f"--lock {joint}")[0])
        locks[column] = np.deg2rad(value).item() if degrees and revolute(model)[column] else value
    return locks or None


def angle_of(text: str | None, degrees: bool) -> float | None:
    """The arm angle in radians."""
    if text is None:
        return None
    angle = float(numbers(text, 1, "--arm-angle")[0])
    return float(np.deg2rad(angle)) if degrees else angle


_COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")


def as_text(model: RobotModel, T: Array, found: IGMSolutions, mask_axes: str, degrees: bool) -> str:
    """The solutions of one pose as text."""
    names = model.table.joint_names
    count = int(found.count)
    lines = [
        f"{model.name}: {count} posture{'s' * (count != 1)}. {found.reason()}",
        f"method: {found.method}",
        f"pose of the tool (m):\n{pose_text(T)}",
    ]
    if not found.mask.all():
        asked = " ".join(c for c, m in zip(_COMPONENTS, found.mask, strict=True) if m)
        lines.append(f"asked for: {asked} in {mask_axes} axes")
    units = _units(model, degrees)
    if count:
        q = _shown(model, found.q[:count], degrees)
        columns = [("", [str(k + 1) for k in range(count)]), ("branch", list(found.branch[:count]))]
        columns += [
            (f"q{j + 1} [{unit}]", [_number(v, unit) for v in q[:, j]])
            for j, unit in enumerate(units)
        ]
        columns.append(("residual", [f"{r:.1e}" for r in found.residual[:count]]))
        inside = ["inside" if w else "outside" for w in found.within_limits[:count]]
        columns.append(("limits", inside))
        if found.double.any():
            columns.append(("root", ["double" if d else "" for d in found.double[:count]]))
        lines += [f"q: {', '.join(names)}", boxed(columns)]
    lines += _family_lines(names, found)
    if not count and found.closest is not None and np.isfinite(found.closest).all():
        q = _shown(model, found.closest, degrees)
        each = zip(names, q, units, strict=True)
        lines.append(
            "closest posture: " + ", ".join(f"{n} {_number(v, u)} {u}" for n, v, u in each)
        )
    return "\n".join(lines)


def as_json(model: RobotModel, T: Array, found: IGMSolutions, degrees: bool) -> dict[str, Any]:
    """Solutions of one pose as JSON data."""
    names = np.array(model.table.joint_names)
    q = _shown(model, found.q, degrees)
    postures = [
        {
            "q": q[s].tolist(),
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
        closest = _shown(model, found.closest, degrees).tolist()
    return {
        "robot": model.name,
        "joints": names.tolist(),
        "units": _units(model, degrees),
        "pose": T.tolist(),
        "reached": bool(postures),
        "status": IGMStatus(int(found.status)).name,
        "reason": found.reason(),
        "method": found.method,
        "mask": found.mask.astype(int).tolist(),
        "postures": postures,
        "closest": closest,
    }


def _family_lines(names: tuple[str, ...], found: IGMSolutions) -> list[str]:
    """Which joints took the reference, each set once with the postures it holds for."""
    groups: dict[tuple[bytes, bytes], list[int]] = {}
    for s in np.flatnonzero(found.valid):
        free, family = found.free_joints[s], found.family_joints[s]
        if free.any() or family.any():
            groups.setdefault((free.tobytes(), family.tobytes()), []).append(int(s))
    lines = []
    for rows in groups.values():
        free, family = found.free_joints[rows[0]], found.family_joints[rows[0]]
        which = ", ".join(str(s + 1) for s in rows)
        taken = ", ".join(n for n, f in zip(names, free, strict=True) if f)
        others = ", ".join(n for n, f in zip(names, family, strict=True) if f)
        text = f"infinite family through posture {which}:"
        text += f" {taken} took the reference;" if taken else ""
        lines.append(f"{text} {others or 'no other joint'} moves with it.")
    return lines


def _units(model: RobotModel, degrees: bool) -> list[str]:
    return [("deg" if degrees else "rad") if turns else "m" for turns in revolute(model)]


def _shown(model: RobotModel, q: Array, degrees: bool) -> Array:
    return np.where(revolute(model), np.rad2deg(q), q) if degrees else q


def _number(value: float, unit: str) -> str:
    text = f"{value:.4f}" if unit == "deg" else f"{value:.6f}"
    return text.removeprefix("-") if float(text) == 0 else text
