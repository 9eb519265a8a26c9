"""Drive gains: torque per current of each motor, identified with a known load.

Source: M. Gautier and S. Briot, "Global identification of joint drive gains and dynamic parameters
of robots", ASME J. Dynamic Systems, Measurement and Control 136(5), 2014, section 3.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .._outcomes import Outcome
from ..drive import Drives
from ..errors import InvalidValueError
from ..estimation import column_basis, fit_nonlinear
from ..estimation.covariance import correlated_covariance
from ..estimation.factor import TriangularFactors
from ..estimation.linear import residual_noise
from ..friction import Friction
from ..logs import Log
from ..minimal_parameters import BaseParameters
from ..model import RobotModel, check_model
from .equations import Block, parameters_of
from .forms import FormedRows
from .loads import (
    DEPENDENT,
    UNIDENTIFIABLE,
    CommonEquations,
    LoadedLog,
    NamedEstimate,
    common_unknowns,
    equations_of,
    scaled_inverse,
)
from .signals import Processing

_SIGNIFICANT = 3.0  # least significant gain, in standard errors


class GainStatus(Outcome):
    """Outcome of the identification of drive gains."""

    SOLVED = 0, "The gains are those that fit all logs best."
    NOT_IDENTIFIABLE = 1, "Some gains are not significant; excite the joints together, or longer."
    LOAD_INSIGNIFICANT = (
        2,
        "The known load is not significant, so that the scale of the gains is undetermined; use a "
        "heavier load, a motion that lifts it, and a log without it.",
    )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DriveGains(NamedEstimate):
    """Drive gains and the parameters identified with them; see `identify_drive_gains`."""

    base: BaseParameters
    names: tuple[str, ...]
    values: Array
    covariance: Array
    side: Array
    noise: Array

    @property
    def gains(self) -> Array:
        """Torque on the joint side per unit of the log, of each motor; NaN where not identified."""
        return self.values[-len(self.noise) :]

    @property
    def gain_standard_errors(self) -> Array:
        """Standard errors of the gains, shape (n,)."""
        return self.standard_errors[-len(self.noise) :]

    @property
    def status(self) -> GainStatus:
        """Outcome: whether all gains, some or none differ from zero by three standard errors."""
        significant = np.abs(self.gains) > _SIGNIFICANT * self.gain_standard_errors
        if significant.all():
            return GainStatus.SOLVED
        return GainStatus.NOT_IDENTIFIABLE if significant.any() else GainStatus.LOAD_INSIGNIFICANT

    @property
    def notes(self) -> tuple[str, ...]:
        """Unidentifiable base parameters."""
        names = ", ".join(name for name in self.base.names if name not in self.names)
        return (f"The logs do not distinguish {names} from other parameters.",) if names else ()

    def applied(self, log: Log) -> Log:
        """The log with torques of the joints (N m or N) instead of their currents."""
        currents = log.tau @ self.side.T
        tau = np.linalg.solve(self.side, (currents * self.gains).T).T
        return replace(log, tau=np.ascontiguousarray(tau))


def identify_drive_gains(
    model: RobotModel,
    unloaded: Log | Sequence[Log],
    loaded: LoadedLog | Sequence[LoadedLog],
    *,
    drive: Drives = True,
    friction: Friction | None = None,
    base: BaseParameters | None = None,
    processing: Processing | None = None,
    executor: Executor | None = None,
) -> DriveGains:
    """Identify drive gains, base parameters and unknown load parameters simultaneously.

    The torques of the logs are motor currents times gear ratios. Currents alone fix the gains and
    the parameters up to a common factor, which the known load fixes. The currents of coupled
    motors are separated by the transmission of the model. The estimate is that of maximum
    likelihood for noise of the currents.

    Parameters
    ----------
    model : RobotModel
        The robot; its inertia is not used.
    unloaded : Log or sequence of Log
        Without load; may be empty where loads differ.
    loaded : LoadedLog or sequence of LoadedLog
        With loads whose masses are known at least.
    drive, friction, base, processing, executor
        As for `fit`; processing of all logs.

    Returns
    -------
    DriveGains
        ``.gains`` and ``.gain_standard_errors``, torque on the joint side per unit of the log;
        ``.applied(log)``, the log with torques; ``.names, .values, .standard_errors, .covariance``
        of the base parameters, of the unknown parameters of loads (``"MX load 1"``) and of the
        gains (``"gain 1"``); ``.noise`` of the currents; ``.status``, ``.notes``.

    References
    ----------
    M. Gautier and S. Briot, "Global identification of joint drive gains and dynamic parameters of
    robots", ASME J. Dynamic Systems, Measurement and Control 136(5), 2014.

    Examples
    --------
    >>> from robotmodels.dynamics import idm, with_payload
    >>> from robotmodels.identification import KnownPayload
    >>> from robotmodels.robots import load
    >>> arm, t, w = load("rx90"), 0.01 * np.arange(900)[:, None], np.linspace(1.0, 5.0, 6)
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> carrying, gains = with_payload(arm, 2.0, [0.1, 0.0, 0.05]), np.linspace(1.0, 2.0, 6)
    >>> bare, loaded = (Log(0.01, q, idm(each, q, v, a) / gains, v, a) for each in (arm, carrying))
    >>> result = identify_drive_gains(arm, bare, LoadedLog(loaded, KnownPayload(2.0)))
    >>> result.gains.round(2)
    array([1. , 1.2, 1.4, 1.6, 1.8, 2. ])
    """
    check_model(model)
    bare = (unloaded,) if isinstance(unloaded, Log) else tuple(unloaded)
    carried = (loaded,) if isinstance(loaded, LoadedLog | Log) else tuple(loaded)
    if not carried or not all(isinstance(each, LoadedLog) for each in carried):
        raise InvalidValueError(
            "loaded: without a known load the scale of the gains is undetermined; give at least "
            "one LoadedLog(log, KnownPayload(mass))."
        )
    base = parameters_of(model, base, drive, friction)
    side, n = motor_side(model), model.n
    form = None if np.array_equal(side, np.eye(n)) else partial(_motor_rows, side)
    systems = equations_of(base, (*bare, *(each.log for each in carried)), processing)
    loads = [*[None] * len(bare), *(each.payload for each in carried)]
    every = CommonEquations(systems, *common_unknowns(base, loads), form)
    whole = every.reduced(executor)
    noise = residual_noise(whole)
    basis = column_basis(whole.stacked(1.0 / noise)[0], negligible=UNIDENTIFIABLE)
    kept, last = basis.kept, len(every.names) - 1
    names = [every.names[k] for k in kept if k != last] + [f"gain {m + 1}" for m in range(n)]
    values = np.full(len(names), np.nan)
    covariance = np.outer(values, values)
    # no other column may depend on the known load, the last column
    if last in kept and np.count_nonzero(basis.coefficients[-1]) == 1:
        part = whole.with_names(tuple(every.names[k] for k in kept))
        x, inverse = _solved(part, noise)
        rows = _LinearisedEquations(every.columns(kept), x)
        spread = correlated_covariance(rows, 0.0 * x, 1.0 / noise, inverse).covariance
        # gains are the reciprocals of the last unknowns
        c = len(x) - n
        with np.errstate(divide="ignore", invalid="ignore"):
            values = np.append(x[:c], 1.0 / x[c:])
            slopes = np.append(np.ones(c), values[c:] ** 2)
            covariance = spread * np.outer(slopes, slopes)
            covariance[:c, c:] *= -1.0
            covariance[c:, :c] *= -1.0
    return DriveGains(base, tuple(names), values, covariance, side, noise)


def motor_side(model: RobotModel) -> Array:
    """Matrix from joint torques to motor torques on the joint side. Shapes: -> (n, n)."""
    if model.transmission is None:
        return np.eye(model.n)
    if not model.transmission.is_invertible:
        raise InvalidValueError(
            "model: its transmission is singular (a joint mimics another one), so that joint "
            "torques do not determine the currents; give the model without it."
        )
    K = model.transmission.matrix.T
    scale = np.diag(K).copy()
    scale[scale == 0.0] = np.abs(K).max(axis=1)[scale == 0.0]
    return K / scale[:, None] + 0.0


def _motor_rows(side: Array, W: Array, tau: Array, v: Array, use: NDArray[np.bool_]) -> FormedRows:
    """Equations of the motors, from the joint equations at the rate of the log."""
    rest = (~use).astype(np.int64) @ (side != 0.0).astype(np.int64).T
    return np.einsum("mj,kjb->kmb", side, W), tau @ side.T, rest == 0


def _solved(factors: TriangularFactors, noise: Array) -> tuple[Array, Array]:
    """Least squares of ``currents - u (E x + known)``, u the reciprocal gains.

    Shapes: -> x and u (c + n,), inverse information.
    """
    n, c = len(noise), len(factors.names) - 1
    rows = np.vstack([F / sigma for F, sigma in zip(factors.factors, noise, strict=True)])
    E, known, currents = rows[:, :c], rows[:, c], rows[:, -1]
    motors = np.repeat(np.eye(n), [len(F) for F in factors.factors], axis=0)

    def linearise(z: Array) -> tuple[Array, Array]:
        torque, u = E @ z[:c] + known, motors @ z[c:]
        return u * torque - currents, np.hstack((u[:, None] * E, torque[:, None] * motors))

    # start: least squares of E x + known - currents gains, linear in x and the gains
    A = np.hstack((E, -currents[:, None] * motors))
    start = scaled_inverse(A) @ -known
    start[c:] = 1.0 / np.where(start[c:] == 0.0, np.inf, start[c:])
    z = fit_nonlinear(linearise, start, truncation=DEPENDENT).x
    half = scaled_inverse(linearise(z)[1])
    return z, half @ half.T


@dataclass(frozen=True, slots=True, eq=False)
class _LinearisedEquations:
    """Equations of the currents, linearised at x and reciprocal gains u, shape (c + n,)."""

    system: CommonEquations
    values: Array

    def blocks(self) -> Iterator[Block]:
        """Blocks with the slopes as columns and the residuals as the measured side."""
        c = len(self.system.names) - 1
        u = self.values[c:]
        for block in self.system.blocks():
            torque = block.W @ np.append(self.values[:c], 1.0)
            columns = torque[:, :, None] * np.eye(len(u))
            W = np.concatenate((u[:, None] * block.W[:, :, :c], columns), axis=2)
            yield replace(block, W=W, y=block.y - u * torque)
