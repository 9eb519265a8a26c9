"""Drive gains: torque per current of each motor, identified with a known load.

Source: M. Gautier and S. Briot, "Global identification of joint drive gains and dynamic parameters
of robots", ASME J. Dynamic Systems, Measurement and Control 136(5), 2014, section 3; S. Van Huffel
and J. Vandewalle, "The total least squares problem", SIAM, 1991, sections 3.5 and 3.6 (exact
columns, scaled columns).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .._outcomes import Outcome
from ..drive import Drives
from ..errors import InvalidValueError
from ..estimation import column_basis
from ..estimation.covariance import correlated_covariance
from ..estimation.factor import TriangularFactors
from ..friction import Friction
from ..logs import Log
from ..minimal_parameters import BaseParameters
from ..model import RobotModel, check_model
from .common_equations import (
    UNIDENTIFIABLE,
    CommonEquations,
    NamedEstimate,
    column_lengths,
    equations_of,
    residual_noise,
)
from .equations import Block, parameters_of
from .forms import FormedRows
from .payload import LoadedLog, common_unknowns
from .signals import Processing

_ITERATIONS = 30
_SIGNIFICANT = 5.0
"""Least gap of the last two singular values, standard deviations of their noise."""


class GainStatus(Outcome):
    """Outcome of the identification of drive gains."""

    SOLVED = 0, "The gains are those that fit all logs best."
    NOT_IDENTIFIABLE = (
        1,
        "The last two singular values are nearly equal: other gain ratios fit equally well; "
        "use a motion that excites the joints together.",
    )
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
    singular_values: Array
    status: GainStatus

    @property
    def gains(self) -> Array:
        """Torque on the joint side per unit of the log, of each motor; NaN where not identified."""
        return self.values[-len(self.noise) :]

    @property
    def gain_standard_errors(self) -> Array:
        """Standard errors of the gains, shape (n,)."""
        return self.standard_errors[-len(self.noise) :]

    @property
    def ratio(self) -> float:
        """Ratio of the last two singular values, both at least at the noise level."""
        s = np.maximum(self.singular_values, 1.0)
        return float(s[-2] / s[-1]) if len(s) > 1 else np.inf

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
    method: Literal["tls", "wls"] = "tls",
    drive: Drives = True,
    friction: Friction | None = None,
    base: BaseParameters | None = None,
    processing: Processing | None = None,
    executor: Executor | None = None,
) -> DriveGains:
    """Identify drive gains, base parameters and unknown load parameters simultaneously.

    The torques of the logs are motor currents times gear ratios. Currents alone fix the gains and
    the parameters up to a common factor, which the known load fixes. The currents of coupled
    motors are separated by the transmission of the model.

    Parameters
    ----------
    model : RobotModel
        The robot; its inertia is not used.
    unloaded : Log or sequence of Log
        Without load; may be empty where loads differ.
    loaded : LoadedLog or sequence of LoadedLog
        With loads whose masses are known at least.
    method : {"tls", "wls"}
        Total least squares: the currents are noisy, all other columns exact, and each is scaled by
        the length of its noise. Weighted least squares, with the known load on the right side, is
        simpler, and biased by noise.
    drive, friction, base
        As for `fit`.
    processing : Processing, optional
        Processing of all logs; default the choice for the first.
    executor : concurrent.futures.Executor, optional
        Computes the pieces of the logs.

    Returns
    -------
    DriveGains
        ``.gains`` and ``.gain_standard_errors``, torque on the joint side per unit of the log;
        ``.applied(log)``, the log with torques; ``.names, .values, .standard_errors, .covariance``
        of the base parameters, of the unknown parameters of loads (``"MX load 1"``) and of the
        gains (``"gain 1"``); ``.noise`` of the currents and ``.singular_values`` in its units;
        ``.status``, ``.notes``.

    Raises
    ------
    InvalidValueError, ShapeError
        No loaded log; logs of other joints or of different sampling periods; a transmission that
        cannot be inverted.

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
    if method not in ("tls", "wls"):
        raise InvalidValueError(f"method: expected 'tls' or 'wls', got {method!r:.60}.")
    bare = (unloaded,) if isinstance(unloaded, Log) else tuple(unloaded)
    carried = (loaded,) if isinstance(loaded, LoadedLog) else tuple(loaded)
    if not all(isinstance(each, LoadedLog) for each in carried):
        raise InvalidValueError("loaded: expected LoadedLog(log, KnownPayload(mass)), or several.")
    if not carried:
        raise InvalidValueError(
            "loaded: without a known load the scale of the gains is undetermined; give at least "
            "one LoadedLog(log, KnownPayload(mass))."
        )
    logs = (*bare, *(each.log for each in carried))
    base = parameters_of(model, base, drive, friction)
    side, n = motor_side(model), model.n
    form = None if np.array_equal(side, np.eye(n)) else partial(_motor_rows, side)
    systems = equations_of(base, logs, processing)
    loads = [*[None] * len(bare), *(each.payload for each in carried)]
    every = CommonEquations(systems, *common_unknowns(base, loads), form)
    whole = every.reduced(executor)
    noise = residual_noise(whole)
    basis = column_basis(whole.stacked(1.0 / noise)[0], nothing=UNIDENTIFIABLE)
    kept, last = basis.kept, len(every.names) - 1
    names = [every.names[k] for k in kept if k != last] + [f"gain {m + 1}" for m in range(n)]
    none = np.full(len(names), np.nan)
    values, covariance, s = none, np.outer(none, none), none[-n:]
    # no other column may depend on the known load, the last column
    solvable = last in kept and np.count_nonzero(basis.coefficients[-1]) == 1
    if solvable:
        part = whole.with_names(tuple(every.names[k] for k in kept))
        solution, inverse, weights, s = _solved(part, noise, method == "tls")
        solvable = bool(np.isfinite(solution).all())
        if solvable:
            linear = _LinearisedEquations(every.columns(kept), solution)
            spread = correlated_covariance(linear, solution, weights, inverse)
            values, covariance = solution, spread.covariance
    result = DriveGains(base, tuple(names), values, covariance, side, noise, s, GainStatus.SOLVED)
    chance = _SIGNIFICANT * np.sqrt(2.0 / max(float(whole.counts.min()), 1.0))
    if solvable and result.ratio**2 < 1.0 + chance:
        return replace(result, status=GainStatus.NOT_IDENTIFIABLE)
    if not (result.gain_standard_errors < np.abs(result.gains)).any():
        return replace(result, status=GainStatus.LOAD_INSIGNIFICANT)
    return result


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
    needed = (side != 0.0).astype(np.int64)
    rest = (~use).astype(np.int64) @ needed.T
    return np.einsum("mj,kjb->kmb", side, W), tau @ side.T, rest == 0


def _solved(
    factors: TriangularFactors, noise: Array, total: bool
) -> tuple[Array, Array, Array, Array]:
    """Solution of ``E x + known - diag(currents) gains = 0`` by scaled total least squares.

    Shapes: -> values (c + n,), inverse information, weights (n,), singular values (n,).
    """
    from scipy.linalg import solve_triangular

    n, c = len(noise), len(factors.names) - 1
    keep = [*range(c), *range(c + 1, c + 1 + n)]
    currents = (-F[:, -1:] * np.eye(n)[m] for m, F in enumerate(factors.factors))
    wide = [np.hstack((F[:, :-1], y)) for F, y in zip(factors.factors, currents, strict=True)]
    weights, none = 1.0 / noise, np.zeros((c + 1 + n, c + 1 + n))
    for _ in range(_ITERATIONS):
        rows = [weight * F for weight, F in zip(weights, wide, strict=True)]
        R = np.asarray(np.linalg.qr(np.vstack((none, *rows)), mode="r"))
        scale = weights * noise * np.sqrt(np.maximum(factors.counts, 1))
        _, s, V = np.linalg.svd(R[c + 1 :, c + 1 :] / scale)
        if total:
            g = V[-1] / scale
            exact = -solve_triangular(R[: c + 1, : c + 1], R[: c + 1, c + 1 :] @ g)
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                values = np.append(exact[:-1], g) / exact[-1]
        else:
            size = column_lengths(R[:, keep])
            values = np.linalg.lstsq(R[:, keep] / size, -R[:, c], rcond=1e-13)[0] / size
        gains = np.abs(values[c:])
        if not np.isfinite(gains).all() or not gains.any():
            break
        # a motor whose gain vanishes would get all the weight
        before, weights = weights, 1.0 / (noise * np.maximum(gains, 1e-6 * gains.max()))
        if np.abs(weights - before).max() <= 1e-9 * weights.max():
            break
    R = R[:, keep]
    size = column_lengths(R)
    # less the expected squares of the noise of the currents
    added = np.concatenate((np.zeros(c), scale if total else np.zeros(n))) / size
    share, vectors = np.linalg.eigh((R / size).T @ (R / size) - np.diag(added**2))
    inverse = (vectors / np.maximum(share, 1e-14 * share[-1])) @ vectors.T / np.outer(size, size)
    return values, inverse, weights, s


@dataclass(frozen=True, slots=True, eq=False)
class _LinearisedEquations:
    """Equations linearised at a solution, with noise-free currents as columns."""

    system: CommonEquations
    values: Array

    def blocks(self) -> Iterator[Block]:
        """Blocks whose residuals at the solution are gain x current - torque."""
        c = len(self.system.names) - 1
        gains = self.values[c:]
        for block in self.system.blocks():
            torque = block.W @ np.append(self.values[:c], 1.0)
            slopes = -torque / np.where(gains != 0.0, gains, np.inf)
            W = np.concatenate((block.W[:, :, :c], slopes[:, :, None] * np.eye(len(gains))), axis=2)
            y = block.y * gains - torque + W @ self.values
            yield replace(block, W=W, y=y)
