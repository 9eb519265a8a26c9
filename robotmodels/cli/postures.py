"""The solutions of an inverse geometric model as text and as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._arrays import Array
from ..igm import IGMSolutions, IGMStatus
from ..model import RobotModel
from ..table_text import boxed
from .info import pose_text
from .numbers import revolute

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
