"""Momentum and filtered regressors: identification without accelerations.

Source: J.-J. Slotine and W. Li, "On the adaptive control of robot manipulators", IJRR 6(3), 1987
(the filtered form); A. De Luca and R. Mattone, "Actuator failure detection and isolation using
generalized momenta", IEEE ICRA 2003.

Parameters
----------
model, drive, columns, friction
    As for `torque_regressor`.
q, v : array_like, shape (..., n)
    Joint variables (rad or m) and velocities; regularly sampled, (N, n), for a filter.
dt : float
    Sampling period, seconds.
low_pass : array_like, shape (k, 6)
    Second-order sections of a stable filter for this period, such as
    ``scipy.signal.butter(4, cutoff, fs=1 / dt, output="sos")``.

Raises
------
ShapeError, InvalidValueError
    As `torque_regressor`; a period that is not positive; sections of another shape, or of a
    filter that is not stable; a log without samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, as_floats, as_vector
from ..drive import Drives
from ..errors import InvalidValueError, ShapeError
from ..friction import Friction, LinearFriction
from ..model import RobotModel, check_model
from .chunks import FORMS, Form, check_log, evaluate
from .columns import LINKS, ChosenColumns, Columns
from .drives import add_torques, friction_terms, rotor_terms


class MomentumRegressors(NamedTuple):
    """Regressors of the generalised momentum and of the forces that change it besides the torques.

    Attributes
    ----------
    momentum : ndarray, shape (..., n, p)
        ``P @ parameters`` is ``p = A(q) v``, rotors included.
    force : ndarray, shape (..., n, p)
        ``S @ parameters`` is ``C(q, v)^T v - Q(q) - friction - offset``.
    """

    momentum: Array
    force: Array


def momentum_regressor(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    drive: Drives = True,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> MomentumRegressors:
    """Regressors P and S of the momentum form ``dp/dt = tau + C^T v - Q - friction``.

    With ``p = P @ parameters`` the torque is ``tau = (dP/dt - S) @ parameters``: filtered or
    integrated, it needs no accelerations.

    Returns
    -------
    MomentumRegressors
        ``momentum`` and ``force``, each of shape (..., n, p); columns as `parameter_names`.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> P, S = momentum_regressor(one, [0.0], [3.0], columns=["ZZ1", "Fv1"])
    >>> P, S
    (array([[3., 0.]]), array([[ 0., -3.]]))
    """
    return evaluate(FORMS[momentum_regressor], model, (q, v), drive, columns, friction)


def filtered_regressor(
    model: RobotModel,
    dt: float,
    q: ArrayLike,
    v: ArrayLike,
    low_pass: ArrayLike,
    drive: Drives = True,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Array:
    """Torque regressor through a low-pass filter, from positions and velocities alone.

    The momentum form between samples, ``(P_k - P_{k-1}) / dt - (S_k + S_{k-1}) / 2``, through the
    filter: ``filtered_torque(tau, low_pass) = W @ parameters`` up to the square of the period.

    Returns
    -------
    ndarray, shape (N, n, p)
        Columns as `parameter_names`; the first sample is zero.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from scipy.signal import butter
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> t = np.linspace(0.0, 5.0, 501)[:, None]
    >>> low_pass = butter(1, 1.0, fs=100.0, output="sos")
    >>> W = filtered_regressor(one, 0.01, t**2, 2 * t, low_pass, columns=["ZZ1"])
    >>> round(float(W[-1, 0, 0]), 6)
    2.0
    """
    check_model(model)
    sections = _sections(low_pass)
    period = as_floats(dt, "dt")
    if period.ndim != 0 or not period > 0.0:
        raise InvalidValueError(f"dt: expected the sampling period in seconds, got {dt!r:.80}.")
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    if q.ndim != 2 or q.shape != v.shape:
        raise ShapeError(
            f"q, v: expected samples of shape (N, {model.n}) both, got {q.shape} and {v.shape}."
        )
    check_log(len(q), "q, v")
    P, S = momentum_regressor(model, q, v, drive, columns, friction)
    return _filtered(sections, np.diff(P, axis=0) / period - 0.5 * (S[1:] + S[:-1]))


def filtered_torque(tau: ArrayLike, low_pass: ArrayLike) -> Array:
    """Measured torques ``tau`` through the filter of `filtered_regressor`.

    Returns
    -------
    ndarray, shape (N, ...)
        Means of neighbouring samples of the torques (N, ...), filtered from rest; the first is
        zero.

    Examples
    --------
    >>> filtered_torque([2.0, 4.0, 6.0], [[1.0, 0, 0, 1.0, 0, 0]])
    array([0., 3., 5.])
    """
    sections, signal = _sections(low_pass), as_floats(tau, "tau")
    if signal.ndim < 1:
        raise ShapeError("tau: expected samples along the first axis, got one number.")
    check_log(len(signal), "tau")
    return _filtered(sections, 0.5 * (signal[1:] + signal[:-1]))


def _fill_momenta(
    model: RobotModel,
    chosen: ChosenColumns,
    friction: LinearFriction | None,
    rows: Sequence[Array],
    P: Array,
    S: Array,
) -> None:
    """Write the chosen columns of the samples ``(q, v)`` into ``P`` and ``S (N, n, c)``."""
    from ..kernels.regressors import momentum_regressors

    q, v = rows
    momentum_regressors(q, v, model.chain, model.gravity, chosen.places[LINKS], P, S)
    add_torques(chosen, rotor_terms(model, v), P)
    add_torques(chosen, friction_terms(model, q, v, friction), S, -1.0)


FORMS[momentum_regressor] = Form(_fill_momenta, "qv", arrays=2, result=MomentumRegressors)


def _sections(low_pass: ArrayLike) -> Array:
    """Second-order sections (k, 6) of a stable filter."""
    sections = as_core(low_pass, (6,), "low_pass")
    if sections.ndim != 2 or not len(sections) or not sections[:, 3].all():
        raise ShapeError(
            "low_pass: expected second-order sections (k, 6) such as scipy.signal.butter(4, "
            f"cutoff, fs=1 / dt, output='sos'), got shape {sections.shape}."
        )
    sections = sections / sections[:, 3:4]
    largest = max(np.abs(np.roots(row)).max(initial=0.0) for row in sections[:, 3:])
    if largest >= 1.0:
        raise InvalidValueError(f"low_pass: the filter is not stable, |pole| = {largest:.6g}.")
    return sections


def _filtered(sections: Array, between: Array) -> Array:
    """Filter values between samples (N - 1, ...) from rest, after a first value of zero."""
    from scipy.signal import sosfilt

    start = np.zeros((1, *between.shape[1:]))
    return np.asarray(sosfilt(sections, np.concatenate((start, between)), axis=0), np.float64)
