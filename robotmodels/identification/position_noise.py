"""Noise of measured positions, and the bias that it causes in least squares.

Source: W. Fuller, "Measurement Error Models", 1987, section 1.1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from ..logs import Log
from ..logs.channels import resolution, stretches
from ..minimal_parameters import BaseParameters
from ..regressors import torque_regressor
from .delay import representative_part
from .forms import moving_joints
from .signals import central_differences, zero_phase
from .weak_prior import plausible_sizes

_ROWS, _PER_CUTOFF = 4000, 2.5  # largest number of rows, and rows per period of the cutoff


@dataclass(frozen=True, slots=True, eq=False)
class PositionNoise:
    """Noise standard deviation and encoder resolution of each joint's positions (n,)."""

    std: Array
    quantisation_step: Array

    @classmethod
    def of(cls, log: Log) -> PositionNoise:
        """Noise of the positions of a log: white, or the quantisation of an encoder."""
        from scipy.signal import welch

        part = stretches(log, 4096, 4 * 4096)
        std, step = np.zeros(log.n), np.zeros(log.n)
        for rows in part.recordings():
            # the largest, since an encoder at rest has no visible noise
            q = np.asarray(part.q[rows])
            if len(q) >= 16:
                f, P = welch(q - q[0], nperseg=min(len(q), 1024), axis=0)
                high = (f > 0.25) & (f < 0.45)  # in sampling rates: above the motion
                std = np.maximum(std, np.sqrt(0.5 * np.median(P[high], axis=0)))
            step = np.maximum(step, [resolution(x) for x in q.T])
        uniform = step / np.sqrt(12.0)
        coarse = uniform > std / 1.5
        std = np.where(coarse, np.maximum(uniform, std), std)
        return cls(std, np.where(coarse, step, 0.0))

    def draw(self, q: Array, dt: float, rng: np.random.Generator) -> Array:
        """Random noise for positions q (N, n): white, or encoder quantisation.

        The latter is coloured in slow motion: smoothed positions are quantised with random offsets.
        """
        noise = self.std * rng.normal(size=q.shape)
        coarse = np.flatnonzero(self.quantisation_step > 0.0)
        if coarse.size:
            step = self.quantisation_step[coarse]
            smooth = zero_phase(q[:, coarse], min(20.0, 0.2 / dt), dt)
            smooth = smooth + step * rng.random(len(step))
            noise[:, coarse] = np.round(smooth / step) * step - smooth
        return noise


def predicted_bias(
    base: BaseParameters, log: Log, lowest: float, highest: float
) -> Callable[[float], Array]:
    """Function of a cutoff in Hz: predicted bias of each parameter in standard errors (b,).

    The log, or stretches of a long one, is prepared for cutoffs from ``lowest`` to ``highest``.
    """
    part, rng = representative_part(log, lowest), np.random.default_rng(0)
    noise = PositionNoise.of(part)
    step = max(1, int(0.05 / (highest * log.dt)))  # at least 20 samples in a period of the cutoff
    channels = []
    for rows in part.recordings():
        q = np.asarray(part.q[rows])
        x = np.concatenate((q, noise.draw(q, part.dt, rng), part.tau[rows]), axis=1)
        channels.append((x if step == 1 else zero_phase(x, 4.0 * highest, part.dt))[::step])

    def bias(cutoff: float) -> Array:
        signals = _filtered_rows(channels, step * log.dt, cutoff)
        if not signals[0].any():
            return np.zeros(len(base))
        used = signals.shape[1] / (_PER_CUTOFF * cutoff * step * log.dt * sum(map(len, channels)))
        return _bias_ratio(base, signals) / np.sqrt(min(1.0, used) * len(part) / len(log))

    return bias


def _bias_ratio(base: BaseParameters, signals: Array) -> Array:
    """Predicted bias in standard errors (b,) of the equations of these samples (7, N, n)."""
    tau, q, v, a, *noisy = signals
    options = {"columns": base.names, "friction": base.friction}
    W = torque_regressor(base.model, q, v, a, base.drive, **options)
    D = torque_regressor(base.model, noisy[0], noisy[1], noisy[2], base.drive, **options) - W
    band = np.maximum(0.01 * np.abs(v).max(axis=0), np.finfo(float).tiny)
    use = moving_joints(base.model, band, v)
    # a weak prior of 0.3 plausible sizes: parameters without effect have no large bias
    sizes = plausible_sizes(base, base.names, q, v, a, tau) * 0.3
    A, E, y = use[:, :, None] * W * sizes, use[:, :, None] * D * sizes, tau * use
    prior, weights = np.eye(len(sizes)), np.ones(base.model.n)
    for _ in range(2):
        R, z = (weights[:, None] * A).reshape(-1, len(sizes)), (weights * y).reshape(-1)
        values = np.linalg.solve(R.T @ R + prior, R.T @ z)
        variances = ((y - A @ values) ** 2).sum(axis=0) / np.maximum(use.sum(axis=0), 1)
        least = 1e-12 * max(float(variances.max()), 1e-300)
        weights = 1.0 / np.sqrt(np.maximum(variances, least))
    R, E = ((weights[:, None] * x).reshape(-1, len(sizes)) for x in (A, E))
    covariance = np.linalg.inv(R.T @ R + prior)
    return np.abs(covariance @ (E.T @ (E @ values))) / np.sqrt(np.diag(covariance))


def _filtered_rows(channels: list[Array], dt: float, cutoff: float) -> Array:
    """Torques, q, v and a, and these three with noise, filtered and decimated (7, N, n)."""
    step = max(1, int(1.0 / (_PER_CUTOFF * cutoff * dt)), sum(map(len, channels)) // _ROWS)
    edge = int(np.ceil(1.0 / (cutoff * dt)))
    pieces = [np.zeros((7, 0, channels[0].shape[1] // 3))]
    for part in channels:
        if len(part) <= 2 * edge + step:
            continue
        q, noise, tau = np.split(zero_phase(part, cutoff, dt), 3, axis=1)
        rows = [tau]
        for x in (q, q + noise):
            v = central_differences(x, dt)
            rows += [x, v, central_differences(v, dt)]
        pieces.append(np.stack([x[edge : len(part) - edge : step] for x in rows]))
    return np.concatenate(pieces, axis=1)
