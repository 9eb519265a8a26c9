"""Joint velocities that serve several tasks in strict order, within bounds.

Seed book section 1.3.2.4. The same equations serve accelerations: `Level` has a ``drift``.

Source: B. Siciliano and J.-J. Slotine 1991; the solution is the dual method of D. Goldfarb and A.
Idnani 1983; J. Baillieul 1985 (extended Jacobian).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_exact, as_floats, as_reals
from ...errors import InvalidValueError, ShapeError
from .methods import InverseMethod, as_method

__all__ = ["Level", "LevelVelocities", "level_velocities", "stacked"]


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """What one priority level asks of the joint velocities: ``J v = rate - drift``, row by row.

    Shapes: J (N, m, n); rate, drift (N, m); weights (m,).
    """

    J: Array
    rate: Array
    drift: Array | None = None
    weights: Array | None = None

    def __post_init__(self) -> None:
        J = as_floats(self.J, "J")
        if J.ndim != 3:
            raise ShapeError(f"J: expected shape (N, m, n), got {J.shape}; one is (1, m, n).")
        N, m, _ = J.shape
        _set(self, "J", J)
        _set(self, "rate", as_exact(self.rate, (N, m), "rate"))
        if self.drift is not None:
            _set(self, "drift", as_exact(self.drift, (N, m), "drift"))
        if self.weights is not None:
            weights = as_exact(self.weights, (m,), "weights")
            if not (weights > 0.0).all():
                raise InvalidValueError(
                    f"weights: expected positive numbers, got {weights}; leave rows out that "
                    "should have none."
                )
            _set(self, "weights", weights)

    @property
    def m(self) -> int:
        """Number of rows."""
        return self.J.shape[1]


@dataclass(frozen=True, slots=True, eq=False)
class LevelVelocities:
    """Joint velocities of `level_velocities`, N rows.

    Shapes: v, limited (N, n); scale, mixed (N, L); error, singular_values (N, m_l).
    """

    v: Array
    scale: Array
    limited: NDArray[np.bool_]
    mixed: NDArray[np.bool_]
    error: tuple[Array, ...]
    singular_values: tuple[Array, ...]


def level_velocities(
    levels: Sequence[Level],
    secondary: ArrayLike | None = None,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    joint_weights: ArrayLike | None = None,
    method: InverseMethod | None = None,
) -> LevelVelocities:
    """Joint velocities that serve levels of tasks in strict order, within bounds.

    Shapes: secondary, lower, upper (N, n) or (n,); joint_weights (n,).
    """
    from ...kernels.level_velocities import level_velocities as kernel

    levels = tuple(levels)
    N, n = _sizes(levels, secondary, lower)
    wish = np.zeros((N, n)) if secondary is None else _rows(secondary, N, n, "secondary")
    bounds = _bounds(lower, upper, N, n)
    weights = (
        np.ones(n) if joint_weights is None else as_exact(joint_weights, (n,), "joint_weights")
    )
    if not (weights > 0.0).all():
        raise InvalidValueError(f"joint_weights: expected positive numbers, got {weights}.")
    starts = np.cumsum([0, *(level.m for level in levels)])
    M = int(starts[-1])
    whole = stacked(levels) if levels else None
    J = np.empty((N, 0, n)) if whole is None else whole.J
    rate = np.empty((N, 0)) if whole is None else whole.rate
    drift = np.zeros((N, M)) if whole is None or whole.drift is None else whole.drift
    row_weights = np.ones(M) if whole is None or whole.weights is None else whole.weights
    v, scale, mixed = np.empty((N, n)), np.empty((N, len(levels))), np.empty((N, len(levels)))
    error, singular_values = np.empty((N, M)), np.empty((N, M))
    numbers = np.array(as_method(method).kernel_arguments, dtype=np.float64)
    low, high = bounds or (wish, wish)
    kernel(
        J, rate, drift, row_weights, starts, wish, low, high, int(bounds is not None),
        np.sqrt(weights), numbers, v, scale, mixed, error, singular_values,
    )  # fmt: skip
    limited = np.zeros((N, n), bool) if bounds is None else (v <= bounds[0]) | (v >= bounds[1])
    parts = [slice(a, b) for a, b in pairwise(starts)]
    return LevelVelocities(
        v, scale, limited, mixed > 0.0,
        tuple(np.ascontiguousarray(error[:, part]) for part in parts),
        tuple(np.ascontiguousarray(singular_values[:, part]) for part in parts),
    )  # fmt: skip


def stacked(levels: Sequence[Level]) -> Level:
    """One level of the rows of several: tasks of the same priority (augmentation)."""
    if len(levels) == 1:
        return levels[0]
    if not levels:
        raise InvalidValueError("levels: expected at least one, got none.")
    _sizes(tuple(levels), None, None)
    drifts = [level.drift for level in levels]
    weights = [level.weights for level in levels]
    return Level(
        J=np.concatenate([level.J for level in levels], axis=1),
        rate=np.concatenate([level.rate for level in levels], axis=1),
        drift=None if all(d is None for d in drifts) else np.concatenate(
            [np.zeros_like(level.rate) if level.drift is None else level.drift
             for level in levels], axis=1),
        weights=None if all(w is None for w in weights) else np.concatenate(
            [np.ones(level.m) if level.weights is None else level.weights for level in levels]),
    )  # fmt: skip


def _sizes(
    levels: tuple[Level, ...], secondary: ArrayLike | None, lower: ArrayLike | None
) -> tuple[int, int]:
    for level in levels:
        if not isinstance(level, Level):
            raise InvalidValueError(
                f"levels: expected Level values, got {type(level).__name__}; a task gives one by "
                "task.level(model, q)."
            )
    shapes = {(level.J.shape[0], level.J.shape[2]) for level in levels}
    if len(shapes) > 1:
        raise ShapeError(
            "levels: expected the same number of configurations and joints in all, got J of shapes "
            f"{', '.join(str(level.J.shape) for level in levels)}."
        )
    if shapes:
        return shapes.pop()
    for given in (secondary, lower):
        if np.ndim(given) == 2:  # type: ignore[arg-type]
            N, n = np.shape(given)  # type: ignore[arg-type]
            return N, n
    raise InvalidValueError(
        "levels: without a level, secondary or lower has to be of shape (N, n) to say how many "
        "configurations and joints there are."
    )


def _rows(value: ArrayLike, N: int, n: int, name: str, finite: bool = True) -> Array:
    array = as_floats(value, name) if finite else as_reals(value, name)
    if array.shape not in ((N, n), (n,)):
        raise ShapeError(f"{name}: expected shape ({N}, {n}) or ({n},), got {array.shape}.")
    return np.ascontiguousarray(np.broadcast_to(array, (N, n)))


def _bounds(
    lower: ArrayLike | None, upper: ArrayLike | None, N: int, n: int
) -> tuple[Array, Array] | None:
    if lower is None and upper is None:
        return None
    if lower is None or upper is None:
        raise InvalidValueError(
            "lower, upper: expected both or neither; give infinities where there is no bound."
        )
    low = _rows(lower, N, n, "lower", finite=False)
    high = _rows(upper, N, n, "upper", finite=False)
    wrong = np.argwhere(~((low <= high) & (low < np.inf) & (high > -np.inf)))
    if wrong.size:
        i, j = wrong[0]
        raise InvalidValueError(
            f"lower, upper: expected lower <= upper, with room for a finite velocity, got "
            f"[{low[i, j]}, {high[i, j]}] for joint {j} of row {i}."
        )
    return low, high


def _set(owner: object, name: str, array: Array) -> None:
    view = np.ascontiguousarray(array).view()
    view.setflags(write=False)
    object.__setattr__(owner, name, view)
