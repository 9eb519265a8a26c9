"""By how much the torques of a log lag behind its positions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..._arrays import Array, Rebuilt, as_floats
from ..._outcomes import Outcome
from ...errors import InvalidValueError, ShapeError
from ...logs import Log
from ...logs.log import check_is_log
from ...model import RobotModel, check_model
from .delay_rows import ThinRows, looked_at, thin_rows

_CUTOFF = 15.0
"""Above it flexible joints and friction that takes time show as delays of their own."""
_SHARE = 0.1
_WITHIN = 0.02
_CERTAIN = 4.0
_LAGS = 25
_TELLING = 1e-6


class SynchronisationStatus(Outcome):
    """What was found of the delay.

    Examples
    --------
    >>> SynchronisationStatus.FOUND.sentence
    'The torques fit the positions best at one delay.'
    """

    FOUND = 0, "The torques fit the positions best at one delay."
    AT_THE_END = (
        1,
        "The torques fit best at an end of the delays that were tried; try more (within=), and see "
        "whether positions and torques are of the same motion.",
    )
    FLAT = 2, "The torques fit as well at any delay that was tried; the motion is too slow to tell."

    @property
    def is_success(self) -> bool:
        """Whether the delay means something."""
        return self is SynchronisationStatus.FOUND


@dataclass(frozen=True, slots=True, eq=False)
class Synchronisation(Rebuilt):
    """Delay between positions and torques, of all joints together and of each.

    Parameters
    ----------
    status : SynchronisationStatus
        Whether there is one.
    delay : float
        Seconds that the torques lag behind; negative if they come before.
    deviation : float
        Its standard deviation, s, corrected for residuals that are correlated in time.
    joint_delays, joint_deviations : ndarray, shape (n,)
        Of each joint alone; NaN where its torque does not tell.
    delays : ndarray, shape (S,)
        That were tried, s.
    residuals : ndarray, shape (S,)
        Norm of the weighted residual at each, relative to that of the torques.
    dt : float
        Of the log, s.
    """

    status: SynchronisationStatus
    delay: float
    deviation: float
    joint_delays: Array
    joint_deviations: Array
    delays: Array
    residuals: Array
    dt: float

    @property
    def is_out_of_step(self) -> bool:
        """Whether the delay is surely not zero, and more than a tenth of a sample."""
        return bool(
            self.status.is_success
            and abs(self.delay) > max(_CERTAIN * self.deviation, 0.1 * self.dt)
        )

    def __str__(self) -> str:
        if not self.status.is_success:
            return self.status.sentence
        joints = ", ".join(f"{1e3 * delay:.2f}" for delay in self.joint_delays)
        return (
            f"The torques lag {1e3 * self.delay:.3f} ms behind the positions "
            f"({self.delay / self.dt:.2f} samples; standard deviation "
            f"{1e3 * self.deviation:.3f} ms); joint by joint {joints} ms."
        )


def synchronisation(
    log: Log, model: RobotModel, *, cutoff: float | None = None, within: float | None = None
) -> Synchronisation:
    """Estimate by how much the torques of a log lag behind its positions.

    For each delay the torques are moved back, and what the dynamic model with free parameters
    leaves of them is computed; the delay with the least residual is found by a parabola through
    the delays next to it, to well below a sample. Inertia and friction of the model are not used.
    Of a log of more than 1e5 samples so many are looked at, in up to 20 stretches spread evenly
    over it. With too few excited parameters a delay is still found; it is that of the terms which
    are. The model is rigid: on the log of the TX40 cutoffs of 10 to 20 Hz find no delay within the
    deviation, those of 40 Hz and more find torques 2.5 ms early, which is no matter of recording.

    Parameters
    ----------
    log : Log
        What was recorded.
    model : RobotModel
        The robot it is of.
    cutoff : float, optional
        Of the filter for positions and torques, Hz; default 15, or a tenth of the sampling rate
        if that is less.
    within : float, optional
        Largest delay that is tried, either way, s; default 0.02 or five samples if that is more.

    Returns
    -------
    Synchronisation
        Take the delay out with `robotmodels.logs.with_delay`.

    Raises
    ------
    ShapeError, InvalidValueError
        The model has other joints; the log is too short for the filter and the delays.

    References
    ----------
    Seed book section 1.6.2.4.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> t = np.arange(0.0, 4.0, 0.001)[:, None]
    >>> q = np.sin(3.0 * t) + np.sin(7.0 * t)
    >>> late = t - 0.004
    >>> tau = -9.0 * np.sin(3.0 * late) - 49.0 * np.sin(7.0 * late)
    >>> found = synchronisation(Log(0.001, q, tau), one)
    >>> abs(found.delay - 0.004) < 1e-4
    True
    """
    check_is_log(log)
    check_model(model)
    if model.n != log.n:
        raise ShapeError(f"log: {log.n} joints, the model {model.name} has {model.n}.")
    fc = min(_CUTOFF, _SHARE / log.dt) if cutoff is None else float(as_floats(cutoff, "cutoff"))
    if not 0.0 < fc < 0.5 / log.dt:
        raise InvalidValueError(
            f"cutoff: expected a frequency between 0 and {0.5 / log.dt:g} Hz, got {fc:g}."
        )
    span = max(_WITHIN, 5.0 * log.dt) if within is None else float(as_floats(within, "within"))
    if not span >= log.dt:
        raise InvalidValueError(
            f"within: expected at least a sampling period ({log.dt:g} s), got {span:g}."
        )
    # filtered torques change little over this time: a parabola fits between
    reach = 0.1 / fc / np.pi
    steps = int(np.ceil(span / reach))
    delays: Array = np.asarray(reach * np.arange(-steps, steps + 1), np.float64)
    margin = int(np.ceil((delays[-1] + 2.0 * reach) / log.dt)) + 2
    log = looked_at(log, min(fc, 1.0 / span))
    rows = thin_rows(log, model, fc, margin)
    seen = [j for j in range(log.n) if len(rows.places[j]) > rows.bases[j].shape[1] + 10]
    if not seen:
        raise InvalidValueError(
            "log: no joint has enough samples in motion to compare torques with; see check_log."
        )
    moved = _Moved(rows, log.dt)
    squares = np.full((log.n, len(delays)), np.nan)
    for j in seen:
        squares[j] = moved.squares(j, delays)
    freedom = np.array([len(p) - b.shape[1] for p, b in zip(rows.places, rows.bases, strict=True)])
    variances = np.nanmin(squares[seen], axis=1) / freedom[seen]
    floor = 1e-24 * np.array([float((rows.tau[rows.places[j], j] ** 2).mean()) for j in seen])
    weights = 1.0 / np.maximum(variances, np.maximum(floor, 1e-300))
    total = weights @ squares[seen]
    size = sum(
        w * float((rows.tau[rows.places[j], j] ** 2).sum())
        for w, j in zip(weights, seen, strict=True)
    )
    joint_delays, joint_deviations = np.full(log.n, np.nan), np.full(log.n, np.nan)
    for k, j in enumerate(seen):
        best = int(np.argmin(squares[j]))
        if 0 < best < len(delays) - 1:
            at, curvature = _vertex(delays[best], reach, partial(moved.squares, j))
            spread = moved.correlation(j, at)
            joint_delays[j] = at
            joint_deviations[j] = np.sqrt(2.0 * spread / (weights[k] * max(curvature, 1e-300)))
    best = int(np.argmin(total))
    relative = np.sqrt(total / size)
    if not 0 < best < len(delays) - 1:
        status = SynchronisationStatus.AT_THE_END
        return Synchronisation(
            status, float(delays[best]), float("inf"), joint_delays, joint_deviations, delays,
            relative, log.dt,
        )  # fmt: skip

    def weighted(d: Array) -> Array:
        return weights @ np.array([moved.squares(j, d) for j in seen])

    at, curvature = _vertex(delays[best], reach, weighted)
    spread = float(np.mean([moved.correlation(j, at) for j in seen]))
    deviation = float(np.sqrt(2.0 * spread / curvature)) if curvature > 0.0 else float("inf")
    # where no delay is better than another, as for a single sine: its phase is taken as friction
    told = deviation < span and float(np.ptp(relative)) > _TELLING
    return Synchronisation(
        SynchronisationStatus.FOUND if told else SynchronisationStatus.FLAT,
        at, deviation, joint_delays, joint_deviations, delays, relative, log.dt,
    )  # fmt: skip


class _Moved:
    """Residuals of torques that are moved in time."""

    def __init__(self, rows: ThinRows, dt: float) -> None:
        self.rows = rows
        self.dt = dt

    def torques(self, j: int, delays: Array) -> Array:
        """Filtered torques of joint j ``delays`` later, shape (N_j, S): cubic between samples."""
        shift = delays / self.dt
        whole = np.floor(shift).astype(np.int64)
        x = shift - whole
        tau, at = self.rows.tau[:, j], self.rows.places[j][:, None] + whole
        before, here, after, then = (tau[at + k] for k in (-1, 0, 1, 2))
        return (
            here
            + 0.5 * x * (after - before)
            + x**2 * (before - 2.5 * here + 2.0 * after - 0.5 * then)
            + x**3 * (-0.5 * before + 1.5 * here - 1.5 * after + 0.5 * then)
        )

    def residuals(self, j: int, delays: Array) -> Array:
        """What the model leaves of them, shape (N_j, S)."""
        y = self.torques(j, delays)
        basis = self.rows.bases[j]
        return y - basis @ (basis.T @ y)

    def squares(self, j: int, delays: Array) -> Array:
        """Sums of squares of these, shape (S,)."""
        return (self.residuals(j, delays) ** 2).sum(axis=0)

    def correlation(self, j: int, delay: float) -> float:
        """How many neighbours say the same as one: 1 + twice the sum of autocorrelations."""
        r = self.residuals(j, np.array([delay]))[:, 0]
        power = float(r @ r)
        if power == 0.0:
            return 1.0
        found = 1.0
        for k in range(1, min(_LAGS, len(r) // 4)):
            rho = float(r[:-k] @ r[k:]) / power
            if rho < 0.05:
                break
            found += 2.0 * rho
        return found


def _vertex(near: float, reach: float, squares: Callable[[Array], Array]) -> tuple[float, float]:
    """Least point of a curve near a delay, and its curvature, by parabolas twice."""
    at, h, curvature = near, 0.5 * reach, 0.0
    for _ in range(3):
        low, middle, high = squares(np.array([at - h, at, at + h]))
        curvature = (low - 2.0 * middle + high) / h**2
        if not curvature > 0.0:
            return float(at), 0.0
        at += float(np.clip(0.5 * (low - high) / (curvature * h), -2.0 * h, 2.0 * h))
    return float(at), float(curvature)
