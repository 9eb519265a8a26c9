"""Filtered regressor: the torque model through a low-pass filter, without accelerations."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..drive import Drives
from ..errors import InvalidValueError, ShapeError
from ..friction import Friction, LinearFriction
from ..model import RobotModel, check_model
from .chunks import check_log, check_size, pieces
from .columns import ChosenColumns, Columns, chosen_columns, friction_of, standard_blocks
from .low_pass import FilterRun, LowPass, check_period
from .momentum import fill_momenta

_PIECE = 128  # four buffers of it stay near the processor


def filtered_regressor(
    model: RobotModel,
    dt: float,
    q: ArrayLike,
    v: ArrayLike,
    low_pass: LowPass,
    drive: Drives = True,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Array:
    """Torque regressor through a low-pass filter, from positions and velocities alone.

    The momentum form filtered: ``F(tau) = (F(dP/dt) - F(S)) @ parameters``, where the filter gives
    ``F(dP/dt)`` from P without differentiating it. Filter the measured torques alike, with
    ``low_pass.filter(tau, dt)``; both start from rest, so that they belong together from the first
    sample. The derivative of a discrete filter is that of the trapezoidal rule.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints.
    dt : float
        Sampling period, seconds; that of the filter if it is a discrete one.
    q, v : array_like, shape (N, n)
        Joint variables (rad or m) and velocities, regularly sampled.
    low_pass : LowPass
        ``LowPass.first_order(cutoff)`` or ``LowPass.from_scipy(...)``, continuous or discrete.
    drive : bool or collection of DriveKind or str
        Which drive parameters have columns: all, none, or kinds such as ``("Ia", "Fv", "Fc")``;
        what couples motors goes with its kind.
    columns, friction
        As for `torque_regressor`.

    Returns
    -------
    ndarray, shape (N, n, p)
        Columns as `parameter_names`; the first sample is zero.

    Raises
    ------
    ShapeError, InvalidValueError
        As `torque_regressor`; a period that is not positive; something that is no filter; a log
        without samples.

    References
    ----------
    Seed book section 1.6.2; J.-J. Slotine and W. Li, "On the adaptive control of robot
    manipulators", IJRR 6(3), 1987.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> t = np.linspace(0.0, 5.0, 501)[:, None]
    >>> W = filtered_regressor(one, 0.01, t**2, 2 * t, LowPass.first_order(4.0), columns=["ZZ1"])
    >>> round(float(W[-1, 0, 0]), 6)
    2.0
    """
    check_model(model)
    q, v, dt = _samples(model, q, v, dt, low_pass)
    chosen = chosen_columns(standard_blocks(model, drive, friction), columns, model)
    W = np.empty((q.shape[0], model.n, chosen.count))
    linear = friction_of(model, friction)
    for piece, part in _stream(model, chosen, linear, dt, q, v, low_pass, _PIECE):
        W[piece] = part
    return W


def filtered_regressor_chunks(
    model: RobotModel,
    dt: float,
    q: ArrayLike,
    v: ArrayLike,
    low_pass: LowPass,
    drive: Drives = True,
    size: int = _PIECE,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Iterator[tuple[slice, Array]]:
    """The filtered regressor of a long log, a piece at a time; the filter runs on between them.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    dt : float
        Sampling period, seconds.
    q, v : array_like, shape (N, n)
        Joint variables (rad or m) and velocities, regularly sampled.
    low_pass : LowPass
        The filter.
    drive : bool or collection of DriveKind or str
        Which drive parameters have columns: all, none, or kinds such as ``("Ia", "Fv", "Fc")``;
        what couples motors goes with its kind.
    size : int
        Samples in a piece.
    columns, friction
        As for `torque_regressor`.

    Yields
    ------
    rows : slice
        Which samples the piece is for.
    W : ndarray, shape (k, n, p)
        Their regressor. The next piece overwrites it.

    Raises
    ------
    ShapeError, InvalidValueError
        As `filtered_regressor`, or ``size`` below 1.

    References
    ----------
    Seed book section 1.6.2.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> x, low_pass = np.zeros((1000, 1)), LowPass.first_order(4.0)
    >>> [W.shape for _, W in filtered_regressor_chunks(one, 0.01, x, x, low_pass, size=600)]
    [(600, 1, 14), (400, 1, 14)]
    """
    check_model(model)
    check_size(size)
    q, v, dt = _samples(model, q, v, dt, low_pass)
    chosen = chosen_columns(standard_blocks(model, drive, friction), columns, model)
    return _stream(model, chosen, friction_of(model, friction), dt, q, v, low_pass, size)


def _samples(
    model: RobotModel, q: ArrayLike, v: ArrayLike, dt: float, low_pass: LowPass
) -> tuple[Array, Array, float]:
    if not isinstance(low_pass, LowPass):
        raise InvalidValueError(
            "low_pass: expected LowPass.first_order(cutoff) or LowPass.from_scipy(...), got "
            f"{type(low_pass).__name__}."
        )
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    if q.ndim != 2 or q.shape != v.shape:
        raise ShapeError(
            f"q, v: expected samples of shape (N, {model.n}) both, got {q.shape} and {v.shape}."
        )
    check_log(q.shape[0])
    return np.ascontiguousarray(q), np.ascontiguousarray(v), check_period(dt)


def _stream(
    model: RobotModel,
    chosen: ChosenColumns,
    friction: LinearFriction | None,
    dt: float,
    q: Array,
    v: Array,
    low_pass: LowPass,
    size: int,
) -> Iterator[tuple[slice, Array]]:
    N, n = q.shape
    P, S, W, F = np.empty((4, min(size, N), n, chosen.count))
    momentum, force = FilterRun(low_pass, dt), FilterRun(low_pass, dt)
    for piece in pieces(N, P.shape[0]):
        k = piece.stop - piece.start
        fill_momenta(model, chosen, friction, (q[piece], v[piece]), P[:k], S[:k])
        momentum.derivatives(_channels(P, k), _channels(W, k))
        force.values(_channels(S, k), _channels(F, k))
        W[:k] -= F[:k]
        yield piece, W[:k]


def _channels(buffer: Array, k: int) -> Array:
    """The first k samples of a buffer, every entry a channel."""
    return buffer[:k].reshape(k, buffer.shape[1] * buffer.shape[2])
