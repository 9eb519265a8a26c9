"""Torques of identified parameters (seed book sections 1.5.1.4 and 1.6.5)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_vector, batch_rows
from ..friction import check_linear
from ..friction.protocols import basis_at
from ..logs import Log
from ..loops import LoopedParameters
from ..minimal_parameters import BaseParameters
from ..regressors import torque_regressor_chunks
from .delay import representative_part
from .signals import Processing, piece_signals, pieces

_RAMPS = (0.0, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Candidate friction regularisation velocities, in dead bands."""


def parameter_torque(
    base: BaseParameters,
    names: tuple[str, ...],
    values: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    width: ArrayLike = 0.0,
) -> Array:
    """Torques (..., n) of parameter values (b,) at q, v, a (..., n).

    Within ``width`` (n,), rad/s or m/s, of zero velocity dry friction is linear.
    """
    model = base.model
    n = model.n
    b = as_exact(values, (len(names),), "values")
    band = np.broadcast_to(as_vector(np.broadcast_to(width, (n,)), n, "width"), (n,))
    arrays = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(a, n, "a")
    batch, rows = batch_rows(arrays, ("q", "v", "a"))
    tau = np.empty((rows[0].shape[0], n))
    if isinstance(base, LoopedParameters):
        W = base.torque_rows(*rows, columns=names)
        return (W @ b).reshape(*batch, n)
    if tau.size:
        chunks = torque_regressor_chunks(
            model, rows[0], rows[1], rows[2], base.drive, columns=names, friction=base.friction
        )
        for part, W in chunks:
            tau[part] = W @ b
    terms = dict(zip(names, b.tolist(), strict=True))
    tau += _over_dead_band(base, terms, rows[0], rows[1], band)
    return tau.reshape(*batch, n)


def friction_ramp(
    base: BaseParameters, names: tuple[str, ...], values: Array, log: Log, processing: Processing
) -> Array:
    """Friction regularisation velocities (n,), fitted to the log.

    The equations leave out the dead bands; widths up to eight of them are compared there.
    """
    band = processing.dead_band
    if not band.any() or isinstance(base, LoopedParameters):
        return np.zeros(band.shape)
    part = representative_part(log, processing.motion)
    squares = np.zeros((len(_RAMPS), log.n))
    for piece in pieces(part, processing):
        signals = piece_signals(part, processing, piece, 0)
        rows = (np.abs(signals.v) < max(_RAMPS) * band).any(axis=1)
        q, v, a, tau = (x[rows] for x in (signals.q, signals.v, signals.a, signals.tau))
        e = tau - parameter_torque(base, names, values, q, v, a)
        terms = dict(zip(names, values.tolist(), strict=True))
        for k, times in enumerate(_RAMPS):
            ramp = _over_dead_band(base, terms, q, v, times * band)
            squares[k] += ((e - ramp) ** 2).sum(axis=0)
    least = squares.min(axis=0)
    relative = squares / np.where(least > 0.0, least, 1.0)
    return _RAMPS[int(np.argmin(relative.sum(axis=1)))] * band


def _over_dead_band(
    base: BaseParameters, terms: dict[str, float], q: Array, v: Array, band: Array
) -> Array:
    """Regularised less ideal dry friction inside the dead bands (N, n)."""
    model = base.model
    frames = [int(row) + 1 for row in model.table.joint_rows]
    out: Array = _rounded_sign(v, band) * np.array([terms.get(f"Fc{j}", 0.0) for j in frames])
    if base.friction is not None:
        friction, wide = check_linear(base.friction), np.where(band > 0.0, band, 1.0)
        inside = np.abs(v) < band
        inner = np.where(inside, v, band)  # any value outside: its share is zero below
        share = (inner / wide + 1.0) / 2.0
        low, high = basis_at(friction, -wide, q), basis_at(friction, wide, q)
        between = low + share[:, None] * (high - low)
        change = np.where(inside[:, None], between - basis_at(friction, v, q), 0.0)
        values = [[terms.get(f"{kind}{j}", 0.0) for j in frames] for kind in friction.kinds]
        out += (change * np.array(values)).sum(axis=1)
    if model.transmission is not None:
        for m in model.transmission.coupled_motors:
            w = model.transmission.weights[m - 1]
            change = _rounded_sign(v @ w, band[m - 1])
            out = out + terms.get(f"Fcm{frames[m - 1]}", 0.0) * change[:, None] * w
    return out


def _rounded_sign(v: Array, width: Array) -> Array:
    """Linear function less the sign of velocities, within the width around zero."""
    ramp = v / np.where(width > 0.0, width, 1.0)
    return np.where(np.abs(v) < width, ramp - np.sign(v), 0.0)
