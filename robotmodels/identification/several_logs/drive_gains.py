"""Drive gains: torque per current of each motor, found with the robot's parameters from a load."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ..._choices import chosen
from ...drive import Drives
from ...errors import InvalidValueError
from ...estimation import column_basis
from ...friction import Friction
from ...logs import Log
from ...minimal_parameters import BaseParameters, base_parameters
from ...model import RobotModel, check_model
from ..correlated import correlated_covariance
from ..equations import Block, Equations, equations
from ..preparation.processing import Processing, choose_processing
from ..scale.reduction import Reduction
from .drive_gains_result import DriveGains, GainMethod, GainStatus
from .drive_gains_total import TotalSolution, known_side, total_least_squares
from .known_payload import LoadedLog
from .loaded import (
    MappedEquations,
    SeveralLogs,
    mapped_reduction,
    payload_columns,
    reduced_side,
    residual_noise,
)

_NOTHING = 1e-7
_KNOWN = "known load"
_SURE = 5.0
"""Deviations of chance by which the last but one singular value is above the last."""


def identify_drive_gains(
    model: RobotModel,
    unloaded: Log | Sequence[Log],
    loaded: LoadedLog | Sequence[LoadedLog],
    *,
    method: GainMethod | str = GainMethod.TLS,
    drive: Drives = True,
    friction: Friction | None = None,
    base: BaseParameters | None = None,
    processing: Processing | None = None,
    executor: Executor | None = None,
) -> DriveGains:
    """Gains of all drives, base parameters and what is unknown of the loads, all at once.

    The torques of the logs are motor currents times gear ratios. Currents alone fix the gains and
    the parameters up to a common factor, which the known load fixes. The currents of coupled
    motors are taken apart by the transmission of the model.

    Parameters
    ----------
    model : RobotModel
        The robot; its own inertia is not used.
    unloaded : Log or sequence of Log
        Without load; may be empty where loads differ.
    loaded : LoadedLog or sequence of LoadedLog
        With loads whose masses are known at least.
    method : GainMethod or str
        "total least squares" (``GainMethod.TLS``): the currents are noisy, all other columns
        exact, and each is scaled by the length of its noise. ``GainMethod.WLS`` is simpler, and
        biased by noise.
    drive, friction, base
        As for `fit`.
    processing : Processing, optional
        Of all logs; default what the first suggests.
    executor : concurrent.futures.Executor, optional
        Who computes the pieces of the logs.

    Returns
    -------
    DriveGains
        With deviations, corrected for correlated residuals.

    Raises
    ------
    InvalidValueError, ShapeError
        No loaded log; logs of other joints or of different sampling periods; a transmission that
        cannot be inverted.

    References
    ----------
    M. Gautier and S. Briot, "Global identification of joint drive gains and dynamic parameters of
    robots", ASME J. Dynamic Systems, Measurement and Control 136(5), 2014; M. Gautier,
    P.-O. Vandanjon and C. Presse, "Identification of inertial and drive gain parameters of robots",
    IEEE CDC 1994.

    Examples
    --------
    >>> from robotmodels.identification import KnownPayload
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.dynamics import with_payload
    >>> loaded = with_payload(arm, 2.0, [0.1, 0.0, 0.0])
    >>> gains = np.array([2.0, 4.0])
    >>> currents = Log(0.005, q, log.tau / gains)
    >>> more = Log(0.005, q, (idm(loaded, q, v, a) + 2.0 * v) / gains)
    >>> with_load = LoadedLog(more, KnownPayload(2.0, [0.1, 0.0, 0.0]))
    >>> identify_drive_gains(arm, currents, with_load).gains.round(3)
    array([2., 4.])
    """
    check_model(model)
    way = chosen(GainMethod, method, "method")
    bare = (unloaded,) if isinstance(unloaded, Log) else tuple(unloaded)
    carried = (loaded,) if isinstance(loaded, LoadedLog) else tuple(loaded)
    if not carried:
        raise InvalidValueError(
            "loaded: without a log with a known load the scale of the gains is open; give at least "
            "one LoadedLog(log, KnownPayload(mass))."
        )
    logs = (*bare, *(one.log for one in carried))
    if len({log.dt for log in logs}) > 1:
        raise InvalidValueError(
            "loaded: the logs have different sampling periods; read_log(..., period=) resamples."
        )
    if base is None:
        base = base_parameters(model, drive=drive, friction=friction)
    else:
        base.check(model)
    choices = choose_processing(logs[0]) if processing is None else processing
    side = motor_side(model)
    systems = [equations(base, log, choices) for log in logs]
    reductions = [reduced_side(system, side, executor) for system in systems]
    names, matrices = _unknowns(base, len(bare), carried)
    whole = mapped_reduction(reductions, matrices, names)
    noise = residual_noise(whole)
    R, _, _ = whole.stacked(1.0 / noise)
    found = column_basis(R, nothing=_NOTHING)
    kept = found.kept
    parts = tuple(
        MappedEquations(system, M[:, kept], tuple(names[k] for k in kept), side)
        for system, M in zip(systems, matrices, strict=True)
    )
    dropped = tuple(name for k, name in enumerate(names) if k not in kept)
    nothing = _empty(base, names, dropped, noise, side, way)
    own = found.coefficients[-1] if _KNOWN not in dropped else np.zeros(0)
    if not own.size or np.count_nonzero(own) > 1:
        return nothing
    columns = [*kept.tolist(), len(names)]
    factors = tuple(F[:, columns] for F in whole.factors)
    reduction = Reduction(parts[0].names, factors, whole.counts, whole.left_out)
    solve = total_least_squares if way is GainMethod.TLS else known_side
    solution = solve(reduction, noise)
    return _gains(nothing, parts, reduction, solution)


def motor_side(model: RobotModel) -> Array:
    """Matrix from joint torques to motor torques, on the joint side. Shapes: -> (n, n)."""
    if model.transmission is None:
        return np.eye(model.n)
    if not model.transmission.is_invertible:
        raise InvalidValueError(
            "model: its transmission is singular (a joint mimics another one), so that joint "
            "torques do not tell the currents; give the model without it."
        )
    K = model.transmission.matrix.T
    own = np.diag(K).copy()
    own[own == 0.0] = np.abs(K).max(axis=1)[own == 0.0]
    return K / own[:, None] + 0.0


def _unknowns(
    base: BaseParameters, bare: int, carried: tuple[LoadedLog, ...]
) -> tuple[tuple[str, ...], list[Array]]:
    """Names of all unknowns, the known load last, and the map of each log."""
    b = len(base)
    names, first = [*base.names], {}
    for one in carried:
        if id(one.payload) not in first:
            first[id(one.payload)] = len(names)
            number = len(first)
            names += [f"{name} load {number}" for name in one.unknown]
    matrices = []
    for one in (*(None,) * bare, *carried):
        M = np.zeros((b, len(names) + 1))
        M[:, :b] = np.eye(b)
        if one is not None:
            P = payload_columns(base, one.payload.frame)
            start = first[id(one.payload)]
            M[:, start : start + len(one.unknown)] = P[:, ~one.payload.known]
            M[:, -1] = P @ one.payload.parameters
        matrices.append(M)
    return (*names, _KNOWN), matrices


def _empty(
    base: BaseParameters, names: tuple[str, ...], dropped: tuple[str, ...], noise: Array,
    side: Array, way: GainMethod,
) -> DriveGains:  # fmt: skip
    """What is returned where the load is not seen."""
    n = len(noise)
    rest = tuple(name for name in names if name not in dropped and name != _KNOWN)
    none = np.full(len(rest), np.nan)
    return DriveGains(
        np.full(n, np.nan), np.full((n, n), np.nan), base, rest, none, none,
        tuple(name for name in dropped if name != _KNOWN), noise, np.full(n, np.nan), side, way,
        GainStatus.LOAD_NOT_SEEN,
    )  # fmt: skip


def _gains(
    nothing: DriveGains, parts: tuple[MappedEquations, ...], reduction: Reduction,
    solution: TotalSolution,
) -> DriveGains:  # fmt: skip
    c = len(solution.x)
    theta = np.concatenate((solution.x, solution.gains))
    result = replace(nothing, singular_values=solution.singular_values)
    if not np.isfinite(theta).all():
        return result
    known = np.append(solution.x, 1.0)
    moved = GainEquations(SeveralLogs(parts), known, solution.gains)
    # all that it takes of the equations are their blocks
    spread = correlated_covariance(
        cast(Equations, moved), theta, solution.weights, solution.inverse
    )
    deviations = np.sqrt(np.maximum(np.diag(spread.covariance), 0.0))
    status = GainStatus.SOLVED
    if (deviations[c:] > np.abs(solution.gains)).all():
        status = GainStatus.LOAD_NOT_SEEN
    count = float(reduction.counts.min())
    if result.ratio**2 < 1.0 + _SURE * np.sqrt(2.0 / max(count, 1.0)):
        status = GainStatus.NOT_IDENTIFIABLE
    return replace(
        result, gains=solution.gains, covariance=spread.covariance[c:, c:], values=solution.x,
        deviations=deviations[:c], status=status,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class GainEquations:
    """Equations linearised about a solution, with noise-free currents as columns."""

    logs: SeveralLogs
    known: Array
    gains: Array

    def blocks(self) -> Iterator[Block]:
        """Blocks of c + n columns whose residuals at the solution are gain x current - torque."""
        n = len(self.gains)
        gains = np.where(self.gains != 0.0, self.gains, np.inf)
        theta = np.concatenate((self.known[:-1], self.gains))
        for block in self.logs.blocks():
            torque = block.W @ self.known
            currents: NDArray[np.float64] = np.zeros((len(block), n, n))
            currents[:, range(n), range(n)] = -torque / gains
            W = np.concatenate((block.W[:, :, :-1], currents), axis=2)
            y = block.y * self.gains - torque + W @ theta
            yield Block(block.t, W, y, block.use, block.v)
