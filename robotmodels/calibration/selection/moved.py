"""Chosen configurations moved one after the other to where they show more."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...geometry import PRISMATIC
from ...model import RobotModel
from .exchange import Progress, added, index_of
from .observability import Criterion

_STEP = 1e-6
_SWEEPS = 3
_ITERATIONS = 15
_WORTH = 1e-4
"""Gain of a whole sweep (of a logarithm) below which no other follows."""


def moved_configurations(
    groups: Array,
    rows: Array,
    criterion: Criterion,
    rows_of: Callable[[Array], Array],
    inside: Callable[[Array], NDArray[np.bool_]],
    model: RobotModel,
    progress: Progress | None = None,
) -> Array:
    """Coordinate-wise local optimisation of the configurations.

    Shapes: groups (count, m, n), rows (count, k, p) -> (count, m, n).
    """
    from scipy.optimize import minimize

    groups, rows = groups.copy(), rows.copy()
    count, m, n = groups.shape
    lower, upper = np.tile(model.lower, m), np.tile(model.upper, m)
    kinds = np.tile(model.table.sigma[model.table.joint_rows], m)
    # a stroke without limits would run away, as longer levers always show more
    endless = (kinds == PRISMATIC) & ~(np.isfinite(lower) & np.isfinite(upper))
    p = rows.shape[-1]
    information = np.einsum("gki,gkj->ij", rows, rows)
    value = float(index_of(information, criterion))
    total = _SWEEPS * count
    for sweep in range(_SWEEPS):
        before = value
        for g in range(count):
            others = rows[np.arange(count) != g].reshape(-1, p)
            rest = others.T @ others + 1e-12 * np.trace(information) / p * np.eye(p)
            x0 = groups[g].ravel()
            low = np.where(endless, x0, lower)
            high = np.where(endless, x0, upper)

            def cost(x: Array, rest: Array = rest, high: Array = high) -> tuple[float, Array]:
                # a step back from an upper limit, as rows beyond it mean nothing
                h = np.where(x + _STEP > high, -_STEP, _STEP)
                points = np.vstack([x, x + np.diag(h)]).reshape(-1, m, n)
                found = added(rest, rows_of(points), criterion)
                return -float(found[0]), -(found[1:] - found[0]) / h

            bounds = list(zip(low, high, strict=True))
            x = minimize(
                cost, np.clip(x0, low, high), jac=True, method="L-BFGS-B", bounds=bounds,
                options={"maxiter": _ITERATIONS},
            ).x  # fmt: skip
            for share in (1.0, 0.5, 0.25, 0.1):
                tried = np.clip(x0 + share * (x - x0), lower, upper).reshape(1, m, n)
                if not inside(tried)[0]:
                    continue
                new = rows_of(tried)[0]
                after = float(index_of(others.T @ others + new.T @ new, criterion))
                if after > value:
                    groups[g], rows[g], value = tried[0], new, after
                    information = others.T @ others + new.T @ new
                    break
            if progress is not None:
                progress(sweep * count + g + 1, total)
        if value - before < _WORTH:
            break
    if progress is not None:
        progress(total, total)
    return groups
