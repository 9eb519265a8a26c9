"""What joint sliders move: the independent joints of a robot, and the joints that follow them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..errors import InvalidValueError
from ..geometry import PRISMATIC
from ..model import RobotModel

# A joint without a limit: half a turn to either side, or this many metres.
_HALF_TURN, _HALF_STROKE = np.pi, 1.0

# How far a joint may be from what its coupling says, rad or m.
_COUPLED = 1e-6


@dataclass(frozen=True, slots=True)
class Slider:
    """Slider of a joint in the panel."""

    name: str
    path: str
    prismatic: bool
    passive: bool
    lower: float
    upper: float
    ends: tuple[float, float]
    follows: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A frame whose pose the panel can show."""

    name: str
    path: str
    pose: Array


@dataclass(frozen=True, slots=True, eq=False)
class SliderPanel:
    """Sliders of a robot: n joints move as ``q = C x + q_0``, x are the r independent ones.

    Shapes: independent, start (r,); matrix (n, r); offset (n,).
    """

    joints: tuple[Slider, ...]
    independent: NDArray[np.int64]
    matrix: Array
    offset: Array
    start: Array
    postures: tuple[tuple[str, Array], ...]
    targets: tuple[Target, ...]

    @property
    def q(self) -> Array:
        """All n joint variables at first, rad or m."""
        return self.matrix @ self.start + self.offset


def slider_panel(
    model: RobotModel, q: Array, moving: Sequence[str], frames: Sequence[str]
) -> SliderPanel:
    """The sliders of a robot."""
    independent, matrix, offset = coupling(model)
    postures = []
    for name, posture in model.configurations.items():
        x = posture[independent]
        kept = np.allclose(matrix @ x + offset, posture, rtol=0.0, atol=_COUPLED)
        postures.append((name if kept else f"{name} (coupled joints follow)", x))
    joints = tuple(_slider(model, i, path, matrix, independent) for i, path in enumerate(moving))
    tool = Target(model.frame_names[-1], frames[model.tip], model.tool)
    targets = {tool.name: tool}
    for j, name in enumerate(model.table.names, start=1):
        targets.setdefault(name, Target(name, frames[j], np.eye(4)))
    # a link of the source URDF goes before a joint of the same name, as in dgm
    targets |= {f.name: Target(f.name, frames[f.parent], f.pose) for f in model.frames}
    targets[tool.name] = tool
    return SliderPanel(
        joints, independent, matrix, offset, q[independent], tuple(postures),
        tuple(targets.values()),
    )  # fmt: skip


def coupled_posture(model: RobotModel, q: Array | None) -> Array:
    """Initial posture of the sliders."""
    independent, matrix, offset = coupling(model)
    asked = model.configurations["zero"] if q is None else q
    coupled = matrix @ asked[independent] + offset
    off = np.abs(asked - coupled)
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
    if model.transmission is None:
        return np.arange(n), np.eye(n), np.zeros(n)
    K, q_0 = model.transmission.matrix, model.transmission.offset
    # joints that an encoder of their own moves come first: they lead, the others mimic
    order = sorted(range(n), key=lambda j: (K[j, j] == 0.0, j))
    chosen: list[int] = []
    basis = np.zeros((0, n))
    for j in order:
        row = K[j] / (np.linalg.norm(K[j]) or 1.0)
        rest = row - basis.T @ (basis @ row)
        if np.linalg.norm(rest) > 1e-9:
            chosen.append(j)
            basis = np.vstack((basis, rest / np.linalg.norm(rest)))
    independent = np.array(sorted(chosen), dtype=np.int64)
    if independent.size == n:
        return independent, np.eye(n), np.zeros(n)
    C = K @ np.linalg.pinv(K[independent])
    C[np.abs(C) < 1e-14] = 0.0
    C[independent] = np.eye(independent.size)
    offset = q_0 - C @ q_0[independent]
    offset[independent] = 0.0
    return independent, C, offset


def _slider(
    model: RobotModel, i: int, path: str, matrix: Array, independent: NDArray[np.int64]
) -> Slider:
    table = model.table
    names = table.joint_names
    row = int(table.joint_rows[i])
    prismatic = bool(table.sigma[row] == PRISMATIC)
    leaders = () if i in independent else tuple(
        names[k] for k, c in zip(independent, matrix[i], strict=True) if c
    )  # fmt: skip
    lower, upper = float(table.lower[i]), float(table.upper[i])
    return Slider(
        names[i], path, prismatic, not table.mu[row], lower, upper,
        _ends(lower, upper, _HALF_STROKE if prismatic else _HALF_TURN), leaders,
    )  # fmt: skip


def _ends(lower: float, upper: float, half: float) -> tuple[float, float]:
    """The limits; where one is missing, as much as a joint without any has, beyond the other."""
    low = lower if np.isfinite(lower) else min(-half, upper - 2.0 * half)
    high = upper if np.isfinite(upper) else max(half, lower + 2.0 * half)
    return low, high
