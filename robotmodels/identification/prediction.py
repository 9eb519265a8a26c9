"""Torques that identified parameters predict."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_vector, batch_rows
from ..friction import check_linear
from ..friction.protocols import basis_at
from ..logs import Log
from ..minimal_parameters import BaseParameters
from ..regressors import torque_regressor_chunks
from .preparation.delay_rows import looked_at
from .preparation.processing import Processing
from .preparation.signals import piece_signals, pieces

_RAMPS = (0.0, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Widths over which dry friction may rise, in dead bands."""


def predicted_torque(
    base: BaseParameters,
    names: tuple[str, ...],
    values: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    dead_band: ArrayLike = 0.0,
) -> Array:
    """Torques of identified parameters, with dry friction that rises over the dead band.

    The direction of a joint that hardly moves is that of the noise, and it may rest. So dry
    friction is taken linear between its values at both ends of the dead band.

    Parameters
    ----------
    base : BaseParameters
        Of the robot.
    names : tuple of str
        The b parameters that were identified, of these.
    values : array_like, shape (b,)
        Their values.
    q, v, a : array_like, shape (..., n)
        Joint variables (rad or m), velocities and accelerations.
    dead_band : array_like, scalar or shape (n,)
        Velocities, rad/s or m/s; 0 takes the sign as it is.

    Returns
    -------
    ndarray, shape (..., n)
        N m or N.

    Raises
    ------
    ShapeError, InvalidValueError
        Arrays that do not fit, NaN.

    References
    ----------
    Seed book sections 1.5.1.4 and 1.6.5.

    Examples
    --------
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> from robotmodels.robots import load
    >>> base = base_parameters(load("planar_2r"), drive=("Fc",))
    >>> beta = np.zeros(len(base)); beta[base.names.index("Fc1")] = 2.0
    >>> at_rest = predicted_torque(base, base.names, beta, [0, 0], [0.01, 0], [0, 0], 0.04)
    >>> at_rest.round(9) + 0.0
    array([0.5, 0. ])
    """
    model = base.model
    n = model.n
    b = as_exact(values, (len(names),), "values")
    band = np.broadcast_to(as_vector(np.broadcast_to(dead_band, (n,)), n, "dead_band"), (n,))
    arrays = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(a, n, "a")
    batch, rows = batch_rows(arrays, ("q", "v", "a"))
    tau = np.empty((rows[0].shape[0], n))
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
    """Velocities (n,) over which predicted dry friction rises linearly, fitted to the log.

    The equations leave out the dead bands, so that they do not determine friction near rest. Widths
    from zero (an ideal step) to eight dead bands are compared on the samples there.
    """
    band = processing.dead_band
    if not band.any():
        return band
    part = looked_at(log, processing.motion)
    squares = np.zeros((len(_RAMPS), log.n))
    for piece in pieces(part, processing):
        found = piece_signals(part, processing, piece, 0)
        rows = (np.abs(found.v) < max(_RAMPS) * band).any(axis=1)
        q, v, a, tau = (x[rows] for x in (found.q, found.v, found.a, found.tau))
        e = tau - predicted_torque(base, names, values, q, v, a)
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
    """What dry friction inside the dead bands is, less what its sign makes of it."""
    model = base.model
    out = np.zeros(v.shape)
    frames = [int(row) + 1 for row in model.table.joint_rows]
    wide = np.where(band > 0.0, band, 1.0)
    inside = np.abs(v) < band
    if not inside.any():
        return out
    ramp = np.where(inside, v / wide - np.sign(v), 0.0)
    out += ramp * np.array([terms.get(f"Fc{j}", 0.0) for j in frames])
    if base.friction is not None:
        friction = check_linear(base.friction)
        inner = np.where(inside, v, band)  # anything outside: its share is zero below
        share = (inner / wide + 1.0) / 2.0
        low, high = basis_at(friction, -wide, q), basis_at(friction, wide, q)
        between = low + share[:, None] * (high - low)
        change = np.where(inside[:, None], between - basis_at(friction, v, q), 0.0)
        own = [[terms.get(f"{kind}{j}", 0.0) for j in frames] for kind in friction.kinds]
        out += (change * np.array(own)).sum(axis=1)
    if model.transmission is not None:
        for m in model.transmission.coupled_motors:
            value = terms.get(f"Fcm{frames[m - 1]}", 0.0)
            w = model.transmission.weights[m - 1]
            speed = v @ w
            slow = np.abs(speed) < band[m - 1]
            change = np.where(slow, speed / wide[m - 1] - np.sign(speed), 0.0)
            out += value * np.outer(change, w)
    return out
