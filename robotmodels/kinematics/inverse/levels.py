"""Joint velocities that serve several tasks in strict order, within bounds.

B. Siciliano and J.-J. Slotine 1991; the bounds by the dual method of D. Goldfarb and A. Idnani
1983. The same equations serve accelerations: a `Level` has a ``drift``.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from .methods import InverseMethod
from .tasks import Level


class LevelVelocities(NamedTuple):
    """Joint velocities of L levels: ``mixed`` where the bounds change the direction of a rate.

    Shapes: v, limited (N, n); scale, mixed (N, L); error (N, m_l).
    """

    v: Array
    scale: Array
    limited: NDArray[np.bool_]
    mixed: NDArray[np.bool_]
    error: tuple[Array, ...]


def level_velocities(
    levels: Sequence[Level],
    secondary: Array,
    bounds: tuple[Array, Array] | None,
    joint_weights: Array,
    method: InverseMethod,
) -> LevelVelocities:
    """Joint velocities that serve levels of tasks in strict order, within bounds.

    Shapes: secondary, bounds (N, n); joint_weights (n,).
    """
    from ...kernels.level_velocities import level_velocities as kernel

    N, n = secondary.shape
    starts = np.cumsum([0, *(level.J.shape[1] for level in levels)])
    J = np.concatenate([np.empty((N, 0, n)), *(level.J for level in levels)], axis=1)
    rate = np.concatenate([np.empty((N, 0)), *(level.rate for level in levels)], axis=1)
    drift = np.concatenate([np.empty((N, 0)), *(level.drift for level in levels)], axis=1)
    weights = np.concatenate([np.empty(0), *(level.weights for level in levels)])
    v, error = np.empty((N, n)), np.empty((N, starts[-1]))
    scale, mixed = np.empty((2, N, len(levels)))
    low, high = (np.ascontiguousarray(b) for b in bounds or (secondary, secondary))
    kernel(
        J, rate, drift, weights, starts, np.ascontiguousarray(secondary), low, high,
        int(bounds is not None), np.sqrt(joint_weights), np.array(method.kernel_arguments), v,
        scale, mixed, error,
    )  # fmt: skip
    limited = np.zeros((N, n), bool) if bounds is None else (v <= low) | (v >= high)
    parts = tuple(error[:, a:b] for a, b in pairwise(starts))
    return LevelVelocities(v, scale, limited, mixed > 0.0, parts)
