"""Predicted bias of least squares by noise of the positions, at any cutoff.

Source: W. Fuller, "Measurement Error Models", 1987, section 1.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from ..logs import Log
from ..minimal_parameters import BaseParameters
from ..regressors import torque_regressor
from .forms.torque import turning
from .preparation.delay_rows import looked_at
from .preparation.filters import central_differences, zero_phase
from .preparation.position_noise import noise_draw, noise_levels
from .weak_prior import plausible_sizes

_THINNED, _PASSED = 0.05, 4.0
"""Periods of the highest cutoff between samples that are kept, and what passes, in cutoffs."""
_ROWS = 4000
_PRIOR = 0.3
"""Standard deviation of the weak prior, in plausible sizes."""
_PER_CUTOFF = 2.5
"""Rows in a period of the cutoff: filtered signals hold no more."""
_DEAD = 0.01
"""Velocity, relative to the largest, below which a joint's equations are left out here."""


@dataclass(frozen=True, slots=True, eq=False)
class RegressorNoise:
    """Positions, simulated noise and torques of a log, from which `bias_ratio` predicts.

    ``parts`` are arrays (N, 3 n), one for each recording, filtered and thinned out to a period
    ``dt``; ``share`` is the part of the log that they cover.
    """

    base: BaseParameters
    parts: tuple[Array, ...]
    dt: float
    share: float


def regressor_noise(
    base: BaseParameters, log: Log, lowest: float, highest: float
) -> RegressorNoise:
    """Prepare a log for cutoffs from ``lowest`` to ``highest`` Hz; of a long one, stretches."""
    part = looked_at(log, lowest)
    levels, rng = noise_levels(part), np.random.default_rng(0)
    step = max(1, int(_THINNED / (highest * log.dt)))
    parts = []
    for rows in part.recordings():
        q = np.asarray(part.q[rows])
        noise = noise_draw(q, part.dt, levels, rng)
        channels = np.concatenate((q, noise, part.tau[rows]), axis=1)
        if step > 1 and len(q) > 1:
            channels = zero_phase(channels, _PASSED * highest, part.dt)
        parts.append(channels[::step])
    return RegressorNoise(base, tuple(parts), step * log.dt, len(part) / len(log))


def bias_ratio(given: RegressorNoise, cutoff: float) -> Array:
    """Predicted bias by noise in the regressor over the standard error, of each parameter (b,)."""
    base = given.base
    columns = {"columns": base.names, "friction": base.friction}
    signals, moved, torques = _rows(given, cutoff)
    if not len(torques):
        return np.zeros(len(base))
    W = torque_regressor(base.model, *signals, base.drive, **columns)
    D = torque_regressor(base.model, *moved, base.drive, **columns) - W
    band = np.maximum(_DEAD * np.abs(signals[1]).max(axis=0), np.finfo(float).tiny)
    use = turning(base.model, band, signals[1])
    W, D, y = W * use[:, :, None], D * use[:, :, None], torques * use
    sizes = plausible_sizes(base, base.names, *signals, torques) * _PRIOR
    weights = np.ones(base.model.n)
    for _ in range(2):
        A = (W * weights[:, None]).reshape(-1, len(sizes)) * sizes
        information = A.T @ A + np.eye(len(sizes))
        values = np.linalg.solve(information, A.T @ (y * weights).reshape(-1))
        left = ((y - W @ (sizes * values)) ** 2).sum(axis=0) / np.maximum(use.sum(axis=0), 1)
        weights = 1.0 / np.sqrt(np.maximum(left, 1e-12 * max(float(left.max()), 1e-300)))
    A, E = ((x * weights[:, None]).reshape(-1, len(sizes)) * sizes for x in (W, D))
    inverse = np.linalg.inv(A.T @ A + np.eye(len(sizes)))
    bias = -inverse @ (E.T @ (E @ values))
    # the log as a whole has as many rows more than are looked at here
    samples = sum(len(part) for part in given.parts)
    share = given.share * min(1.0, len(y) / (_PER_CUTOFF * cutoff * given.dt * samples))
    return np.abs(bias) / np.sqrt(np.diag(inverse) * share)


def _rows(
    given: RegressorNoise, cutoff: float
) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array], Array]:
    """Signals, the same with noise added, and torques, filtered and thinned out."""
    dt, n = given.dt, given.base.model.n
    samples = sum(len(part) for part in given.parts)
    step = max(1, int(1.0 / (_PER_CUTOFF * cutoff * dt)), samples // _ROWS)
    edge = int(np.ceil(1.0 / (cutoff * dt)))
    found: list[list[Array]] = [[np.zeros((0, n))] for _ in range(7)]
    for part in given.parts:
        if len(part) <= 2 * edge + step:
            continue
        q, noise, tau = np.split(zero_phase(part, cutoff, dt), 3, axis=1)
        kept = slice(edge, len(part) - edge, step)
        parts = [tau[kept]]
        for x in (q, q + noise):
            v = central_differences(x, dt)
            parts += [x[kept], v[kept], central_differences(v, dt)[kept]]
        for rows, more in zip(found, parts, strict=True):
            rows.append(more)
    tau, q, v, a, *moved = (np.concatenate(rows) for rows in found)
    return (q, v, a), (moved[0], moved[1], moved[2]), tau
