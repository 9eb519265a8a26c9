"""Joint sliders of a robot: its independent joints, those that follow them, and their panel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .._json_data import json_data
from ..errors import InvalidValueError
from ..model import RobotModel
from .over_time import is_prismatic

_COUPLED = 1e-6  # rad or m that a joint may be off its coupling


@dataclass(frozen=True, slots=True, eq=False)
class SliderPanel:
    """Sliders of a robot: n joints move as ``q = C x + q_0``, x are the r independent ones.

    Shapes: independent, start (r,); matrix (n, r); offset (n,). Struts join points of the base and
    of a moving frame.
    """

    independent: NDArray[np.int64]
    matrix: Array
    offset: Array
    start: Array
    joints: tuple[dict[str, Any], ...]
    postures: tuple[tuple[str, Array], ...]
    targets: tuple[tuple[str, str, Array], ...]
    struts: tuple[dict[str, Any], ...] = ()

    @property
    def q(self) -> Array:
        """All n joint variables at first, rad or m."""
        return self.matrix @ self.start + self.offset

    def data(self) -> dict[str, Any]:
        """The panel as data for its script."""
        return {each.name: json_data(getattr(self, each.name)) for each in fields(self)}


def slider_panel(
    model: RobotModel, q: Array, paths: Sequence[str], frames: Sequence[str]
) -> SliderPanel:
    """The sliders of a robot whose joints and frames are drawn at some paths."""
    independent, matrix, offset = coupling(model)
    postures = []
    for name, posture in model.configurations.items():
        x = posture[independent]
        kept = np.allclose(matrix @ x + offset, posture, rtol=0.0, atol=_COUPLED)
        postures.append((name if kept else f"{name} (coupled joints follow)", x))
    joints = tuple(_joint(model, i, path, matrix, independent) for i, path in enumerate(paths))
    tool = model.frame_names[-1]
    targets = {tool: (tool, frames[model.tip], model.tool)}
    for j, name in enumerate(model.table.names, start=1):
        targets.setdefault(name, (name, frames[j], np.eye(4)))
    # a link of the source URDF goes before a joint of the same name, as in dgm
    links = {f.name: (f.name, frames[f.parent], f.pose) for f in model.frames if f.name != tool}
    return SliderPanel(
        independent=independent,
        matrix=matrix,
        offset=offset,
        start=q[independent],
        joints=joints,
        postures=tuple(postures),
        targets=tuple((targets | links).values()),
    )


def coupled_posture(model: RobotModel, q: Array | None) -> Array:
    """Initial configuration of the sliders."""
    independent, matrix, offset = coupling(model)
    given = model.configurations["zero"] if q is None else q
    coupled = matrix @ given[independent] + offset
    off = np.abs(given - coupled)
    if q is not None and (off > _COUPLED).any():
        j = int(off.argmax())
        raise InvalidValueError(
            f"q: {model.table.joint_names[j]} moves with other joints, whose values put it at "
            f"{coupled[j]:.9g}, got {q[j]:.9g}; give it that value, or drop the transmission with "
            "with_transmission(None)."
        )
    return coupled


def coupling(model: RobotModel) -> tuple[NDArray[np.int64], Array, Array]:
    """Which joints are independent, and how the others follow them.

    Shapes: -> independent (r,), matrix (n, r), offset (n,).
    """
    n = model.n
    rank = n if model.transmission is None else np.linalg.matrix_rank(model.transmission.matrix)
    if model.transmission is None or rank == n:
        return np.arange(n), np.eye(n), np.zeros(n)
    K, q_0 = model.transmission.matrix, model.transmission.offset
    # joints that an encoder of their own moves come first: they lead, the others mimic
    chosen: list[int] = []
    for j in sorted(range(n), key=lambda j: (K[j, j] == 0.0, j)):
        if np.linalg.matrix_rank(K[[*chosen, j]]) > len(chosen):
            chosen.append(j)
    independent = np.array(sorted(chosen), dtype=np.int64)
    C = K @ np.linalg.pinv(K[independent])
    C[np.abs(C) < 1e-14] = 0.0
    C[independent] = np.eye(independent.size)
    offset = q_0 - C @ q_0[independent]
    offset[independent] = 0.0
    return independent, C, offset


def _joint(
    model: RobotModel, i: int, path: str, matrix: Array, independent: NDArray[np.int64]
) -> dict[str, Any]:
    """A joint as data of the panel."""
    table, names = model.table, model.table.joint_names
    prismatic = bool(is_prismatic(model)[i])
    lower, upper = float(table.lower[i]), float(table.upper[i])
    half = 1.0 if prismatic else np.pi  # to either side where there is no limit
    ends = (
        lower if np.isfinite(lower) else min(-half, upper - 2.0 * half),
        upper if np.isfinite(upper) else max(half, lower + 2.0 * half),
    )
    note = "" if table.mu[table.joint_rows[i]] else ", passive"
    leads = bool(i in independent)
    if not leads:
        leaders = ", ".join(names[k] for k, c in zip(independent, matrix[i], strict=True) if c)
        note += f", follows {leaders}" if leaders else ", does not move"
    return {
        "name": names[i],
        "path": path,
        "prismatic": prismatic,
        "lower": max(lower, -1e9),
        "upper": min(upper, 1e9),
        "ends": list(ends),
        "leads": leads,
        "note": note,
    }
