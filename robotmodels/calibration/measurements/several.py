"""Functions of several measurements: whitened rows, scale, targets with too few rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..._arrays import Array, as_exact
from .base import Labelled, Measurement, have_solution


def whitened(measurement: Measurement, rows: Array, scale: Array) -> Array:
    """Rows divided by their standard deviations, or by the root of their covariance.

    Shapes: rows (B, k) or (B, k, m), scale (k,).
    """
    columns = rows if rows.ndim == 3 else rows[..., None]
    if measurement.covariance is not None:
        columns = np.linalg.solve(np.linalg.cholesky(measurement.covariance), columns)
    else:
        sigma = scale if measurement.sigma is None else measurement.sigma
        columns = columns / sigma[..., None]
    return columns.reshape(rows.shape)


def scale_is_observable(measurements: Iterable[Measurement], base_origin: Any = None) -> bool:
    """Whether measurements determine the scale of a robot, all of them together."""
    measurements = tuple(measurements)
    if any(m.knows_length for m in measurements):
        return True
    A, b = np.zeros((0, 3)), np.zeros(0)
    if base_origin is not None:
        A, b = np.eye(3), as_exact(base_origin, (3,), "base_origin")
    parts = [(A, b), *(m.scale_centres for m in measurements)]
    return not have_solution(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def single_observations(measurements: Iterable[Measurement]) -> dict[str, str]:
    """Targets with no more rows than unknown coordinates of their own, and a sentence on each."""
    unknowns: dict[str, set[str]] = {}
    rows, blocks = Counter[str](), Counter[str]()
    for m in measurements:
        own: dict[str, set[str]] = {}
        for fixture in m.fixtures:
            own.setdefault(fixture.name.rpartition(".")[0], set()).add(fixture.name)
        for target, names in own.items():
            label = target.removeprefix(f"{m.name}:")
            # fixtures of kinds without labels are common to all blocks
            count = m.label.count(label) if isinstance(m, Labelled) else m.blocks
            unknowns.setdefault(target, set()).update(names)
            rows[target] += count * len(m.axes)
            blocks[target] += count
    times = {target: "once" if b == 1 else f"{b} times" for target, b in blocks.items()}
    return {
        target: f"{target} is measured {times[target]}: {rows[target]} rows determine its "
        f"{len(names)} unknown coordinates at most, and no parameter of the robot. Measure it in "
        "more postures, or leave it out."
        for target, names in unknowns.items()
        if rows[target] <= len(names)
    }
