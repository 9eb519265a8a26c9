"""Delay between positions and torques of a log, and the filtered samples that determine it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt, as_number
from .._outcomes import Outcome
from ..errors import InvalidValueError, ShapeError
from ..logs import Log
from ..logs.channels import SAMPLES, stretches
from ..logs.log import check_is_log
from ..model import RobotModel, check_model
from ..regressors import torque_regressor
from .signals import Signals, central_differences, zero_phase

SMOOTH_DRIVE = ("Ia", "Fv", "offset")
"""Drive parameters whose columns are continuous at velocity reversals."""


class SynchronisationStatus(Outcome):
    """Outcome of the delay estimation."""

    FOUND = 0, "The torques fit the positions best at one delay."
    AT_THE_END = 1, "The torques fit best at an end of the delays tried; extend them (within=)."
    FLAT = 2, "The torques fit equally well at every delay tried: the motion is too slow."

    @property
    def is_success(self) -> bool:
        """Whether the delay is determined."""
        return self is SynchronisationStatus.FOUND


@dataclass(frozen=True, slots=True, eq=False)
class Synchronisation(Rebuilt):
    """Delays (s) of the torques behind the positions, of all joints and of each.

    Shapes: joint_delays, joint_standard_errors (n,), NaN where not determined; delays tried and
    their relative residuals (S,); dt is the sampling period.
    """

    status: SynchronisationStatus
    delay: float
    standard_error: float
    joint_delays: Array
    joint_standard_errors: Array
    delays: Array
    residuals: Array
    dt: float

    @property
    def is_out_of_step(self) -> bool:
        """Whether the delay is significant, and more than a tenth of a sample."""
        significant = abs(self.delay) > max(4.0 * self.standard_error, 0.1 * self.dt)
        return bool(self.status.is_success and significant)

    def __str__(self) -> str:
        if not self.status.is_success:
            return self.status.sentence
        joints = ", ".join(f"{1e3 * delay:.2f}" for delay in self.joint_delays)
        return (
            f"The torques lag {1e3 * self.delay:.3f} ms behind the positions "
            f"({self.delay / self.dt:.2f} samples; standard error "
            f"{1e3 * self.standard_error:.3f} ms); joint by joint {joints} ms."
        )


def synchronisation(
    log: Log, model: RobotModel, *, cutoff: float | None = None, within: float | None = None
) -> Synchronisation:
    """Estimate the delay of the torques of a log behind its positions (book section 1.6.2.4).

    For each delay the torques are shifted back, and the residual of the dynamic model with free
    parameters is computed; the minimum over the delays is interpolated. Long logs are represented
    by stretches. The model is rigid: at high cutoffs joint flexibility looks like a delay.

    Parameters
    ----------
    log, model : Log, RobotModel
        The log and its robot, whose inertia and friction are not used.
    cutoff : float, optional
        Cutoff of positions and torques, Hz; default 15, or a tenth of the sampling rate
        if that is less.
    within : float, optional
        Largest delay that is tried, in both directions, s; default 0.02 or five samples if that is
        more.

    Returns
    -------
    Synchronisation
        The delay; `robotmodels.logs.with_delay` removes it from the log.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> arm, log = example_log()
    >>> abs(synchronisation(log, arm).delay) < 1e-4
    True
    """
    check_log_and_model(log, model)
    fc = default_cutoff(log) if cutoff is None else checked_cutoff(log, cutoff)
    within = max(0.02, 5.0 * log.dt) if within is None else within
    span = as_number(within, "within", least=log.dt)
    # filtered torques change little over a step, so that a spline interpolates their residuals
    step = 0.1 / fc / np.pi
    count = int(np.ceil(span / step))
    delays: Array = np.asarray(step * np.arange(-count, count + 1), np.float64)
    margin = int(np.ceil((delays[-1] + 2.0 * step) / log.dt)) + 2
    part = representative_part(log, min(fc, 1.0 / span))
    curves, inflation = np.full((2, log.n, len(delays)), np.nan)
    power = 0.0
    for j, residuals, freedom, size in _shifted_residuals(part, fc, margin, model, delays):
        squares = (residuals**2).sum(axis=0)
        variance = max(squares.min() / freedom, 1e-24 * size / len(residuals), 1e-300)
        curves[j], power = squares / variance, power + size / variance
        inflation[j] = [_inflation(r) for r in residuals.T]
    if not power > 0.0:
        raise InvalidValueError(
            "log: no joint has enough samples in motion to compare torques with; see check_log."
        )
    joints = np.array([_minimum(delays, *both) for both in zip(curves, inflation, strict=True)])
    each, errors = np.where(np.isfinite(joints[:, 1:]), joints, np.nan).T
    total = np.nansum(curves, axis=0)
    delay, error = _minimum(delays, total, np.nanmean(inflation, axis=0))
    relative = np.sqrt(total / power)
    status = SynchronisationStatus.FLAT
    if delay in (delays[0], delays[-1]):
        status = SynchronisationStatus.AT_THE_END
    # a single sine is flat: its phase is equally well explained by friction
    elif error < span and float(np.ptp(relative)) > 1e-6:
        status = SynchronisationStatus.FOUND
    return Synchronisation(status, delay, error, each, errors, delays, relative, log.dt)


def check_log_and_model(log: Log, model: RobotModel) -> None:
    """Raise unless these are a log and a model of as many joints."""
    check_is_log(log)
    check_model(model)
    if model.n != log.n:
        raise ShapeError(f"log: {log.n} joints, the model {model.name} has {model.n}.")


def checked_cutoff(log: Log, cutoff: float) -> float:
    """User-given cutoff in Hz, below half the sampling rate."""
    return as_number(cutoff, "cutoff", above=0.0, below=0.5 / log.dt)


def default_cutoff(log: Log) -> float:
    """Default cutoff in Hz; above 15 Hz joint flexibility and friction lag bias the delay."""
    return min(15.0, 0.1 / log.dt)


def representative_part(log: Log, cutoff: float) -> Log:
    """Subset of a long log: at most 1e5 samples in up to 20 evenly spread stretches."""
    length = max(SAMPLES // 20, int(50.0 / (cutoff * log.dt)))
    return stretches(log, length, max(SAMPLES, length))


def filtered_samples(
    log: Log, cutoff: float, margin: int, most: int = 6000
) -> tuple[Signals, NDArray[np.int64]]:
    """Zero-phase filtered signals, torques too, and the numbers of a sparse subset of rows.

    The rows are at least ``margin`` away from all ends of recordings.
    """
    step = max(1, int(0.4 / (cutoff * log.dt)))  # filtered signals contain no more
    margin += int(np.ceil(1.0 / (cutoff * log.dt)))
    q, v, a, tau = (np.zeros(log.q.shape) for _ in range(4))
    kept = []
    for part in log.recordings():
        if part.stop - part.start > 2 * margin + step:
            q[part], tau[part] = (zero_phase(x[part], cutoff, log.dt) for x in (log.q, log.tau))
            v[part] = central_differences(q[part], log.dt)
            a[part] = central_differences(v[part], log.dt)
            kept.append(np.arange(part.start + margin, part.stop - margin, step))
    if not kept:
        raise InvalidValueError(
            f"log: no recording is longer than {2 * margin + step} samples, which the filter at "
            f"{cutoff:g} Hz and the delays that are tried need; give a higher cutoff or try fewer."
        )
    rows = np.concatenate(kept)
    if len(rows) > most:
        rows = rows[np.linspace(0, len(rows) - 1, most).round().astype(int)]
    return Signals(log.t, q, v, a, tau), rows


def motor_speeds(model: RobotModel) -> Array:
    """Weights (n + k, n) of the joint velocities and of k coupled motor velocities."""
    if model.transmission is None:
        return np.eye(model.n)
    motors = np.array(model.transmission.coupled_motors, dtype=int) - 1
    return np.concatenate([np.eye(model.n), model.transmission.weights[motors]])


def _shifted_residuals(
    log: Log, cutoff: float, margin: int, model: RobotModel, delays: Array
) -> Iterator[tuple[int, Array, int, float]]:
    """Joints with enough samples in motion: number, residuals (rows, S) of the shifted torques.

    Then degrees of freedom, and sum of squares of the torque.
    """
    from scipy.ndimage import map_coordinates

    x, rows = filtered_samples(log, cutoff, margin)
    weights, dt = motor_speeds(model), log.dt
    speed = x.v @ weights.T
    steps, largest = np.sign(speed), np.abs(speed).max(axis=0)
    moving = np.abs(speed[rows]) > 0.02 * largest
    near = int(np.ceil(0.25 / (cutoff * dt)))  # around a reversal
    for side in (-near, near):
        moving &= steps[np.clip(rows + side, 0, len(steps) - 1)] == steps[rows]
    # dry friction of a joint that never moves is constant
    usable = ~(~(moving | (largest < 1e-9)) @ (weights != 0.0))
    for part in log.recordings():  # the filter spreads steps as in the torques
        steps[part] = zero_phase(steps[part], cutoff, dt)
    W = torque_regressor(model, x.q[rows], x.v[rows], x.a[rows], drive=SMOOTH_DRIVE)
    for j, tau in enumerate(x.tau.T):
        used = rows[usable[:, j]]
        A = np.concatenate([W[usable[:, j], j], steps[used] * weights[:, j]], axis=1)
        size = np.linalg.norm(A, axis=0)
        U, s, _ = np.linalg.svd(A / np.where(size > 0.0, size, 1.0), full_matrices=False)
        basis = U[:, s > 1e-9 * s.max(initial=0.0)]
        if len(used) > basis.shape[1] + 10:
            y = map_coordinates(tau, [used[:, None] + delays / dt])
            residuals = y - basis @ (basis.T @ y)
            yield j, residuals, len(used) - basis.shape[1], float(tau[used] @ tau[used])


def _minimum(delays: Array, curve: Array, inflation: Array) -> tuple[float, float]:
    """Delay at the minimum of a curve of residuals, and its standard error; infinite at an end."""
    from scipy.interpolate import CubicSpline

    best = int(np.argmin(curve))
    if best in (0, len(delays) - 1):
        return float(delays[best]), float("inf")
    spline = CubicSpline(delays, curve)
    candidates = np.append(spline.derivative().roots(extrapolate=False), delays[best])
    at = float(candidates[np.nanargmin(spline(candidates))])
    return at, float(np.sqrt(2.0 * inflation[best] / max(float(spline(at, 2)), 1e-300)))


def _inflation(r: Array) -> float:
    """Variance inflation by autocorrelation of residuals, 1 + 2 sum(rho_k)."""
    power, inflation = max(float(r @ r), 1e-300), 1.0
    for k in range(1, min(25, len(r) // 4)):
        rho = float(r[:-k] @ r[k:]) / power
        if rho < 0.05:
            break
        inflation += 2.0 * rho
    return inflation
