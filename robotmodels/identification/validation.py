"""Torques of identified parameters, their errors on a log, and tests of the residuals.

Book sections 1.5.1.4, 1.6.5; G. Ljung and G. Box, Biometrika 65, 1978; D. Stoffer and C. Toloi,
Statistics & Probability Letters 13, 1992 (gaps); I. Lobato and C. Velasco, Econometric Theory 20,
2004 (normality of correlated series).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, as_exact, as_vector, batch_rows
from ..dynamics.inverse import motion_torques
from ..errors import InvalidValueError
from ..friction import check_linear
from ..friction.protocols import basis_at
from ..logs import Log
from ..loops import LoopedParameters
from ..minimal_parameters import BaseParameters
from ..model import RobotModel
from ..regressors import torque_regressor_chunks
from ..table_text import percent_text
from .delay import representative_part
from .equations import Equations
from .forms import EquationForm
from .signals import Processing, decimation_window, piece_signals, pieces

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


POOR = 0.3
"""Unexplained share of the torque (root mean square) above which a prediction is poor."""
_NOISE = 2.0  # allowance for coloured noise: factor on the white-noise power


@dataclass(frozen=True, slots=True, eq=False)
class Errors(Frozen):
    """Errors of predicted torques, by joint. Read-only.

    Parameters
    ----------
    rmse, relative, bias : ndarray, shape (n,)
        Root mean square of measured less predicted torque at the rate of the log (N m or N), the
        same relative to the measured torque, and its mean.
    filtered_rmse, filtered_relative, correlation : ndarray, shape (n,)
        The same of the equations, both sides filtered and dead bands left out (NaN for a joint
        without equations), and the correlation of their successive residuals.
    noise : ndarray, shape (n,)
        Root mean square of the white part of the errors, from their second differences.
    samples : int
        Number of samples, without the edges of recordings.
    """

    rmse: Array
    relative: Array
    bias: Array
    filtered_rmse: Array
    filtered_relative: Array
    correlation: Array
    noise: Array
    samples: int


@dataclass(frozen=True, slots=True)
class Validation:
    """Errors of the predicted torques of an identification.

    Parameters
    ----------
    in_sample, held_out : Errors, Errors or None
        On the log that was fitted, and on that given as ``test``.
    nominal : Errors or None
        Of the given robot on the fitted log (NaN for the equations); None for one without masses.
    folds : None
        Neighbouring samples are correlated, so that parts of a log are not independent.
    """

    in_sample: Errors
    held_out: Errors | None = None
    nominal: Errors | None = None
    folds: None = None


def prediction_errors(
    system: Equations, values: Array, ramp: Array, nominal: bool = False
) -> tuple[Errors, Errors | None]:
    """Errors of values (b,) on the log of equations, and of the given robot.

    Dry friction is linear within the velocities ``ramp`` (n,).
    """
    if system.form is not EquationForm.TORQUE:
        system = Equations(system.base, system.names, system.log, system.processing)
    known = nominal and bool(system.model.inertia.values.any())
    pieces = system.pieces()
    if not any(piece.stop > piece.start for piece in pieces):
        raise InvalidValueError(
            f"log: none of its recordings is longer than the {2 * system.processing.edges} samples "
            "that are cut at both ends; give a longer one, or shorter edges (processing=)."
        )
    n, last = system.log.n, np.zeros((0, system.log.n))
    own, given = np.zeros((2, 4, n))
    squares, torque, used, products = np.zeros((4, n))
    samples = steps = 0
    for piece in pieces:
        x, block = piece_signals(system.log, system.processing, piece, 0), system.block(piece)
        predicted = parameter_torque(system.base, system.names, values, x.q, x.v, x.a, ramp)
        own += _sums(x.tau - predicted, x.tau)
        if known:
            given += _sums(x.tau - motion_torques(system.model, x.q, x.v, x.a), x.tau)
        samples, steps = samples + len(x.tau), steps + max(len(x.tau) - 2, 0)
        r = np.where(block.use, block.y - block.W @ values, 0.0)
        squares += (r * r).sum(axis=0)
        torque += np.where(block.use, block.y**2, 0.0).sum(axis=0)
        used += block.use.sum(axis=0)
        chain = np.vstack((last, r))
        products += (chain[1:] * chain[:-1]).sum(axis=0)
        last = r[-1:]
    none = np.full(n, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        filtered = np.sqrt(squares / used), np.sqrt(squares / torque), products / squares
        found = _errors(own, filtered, samples, steps)
        return found, _errors(given, (none, none, none), samples, steps) if known else None


def _sums(e: Array, tau: Array) -> Array:
    """Sums over samples: squared errors, errors, squared torques and second differences."""
    rough = np.diff(e, 2, axis=0)
    return np.array(
        [(e * e).sum(axis=0), e.sum(axis=0), (tau * tau).sum(axis=0), (rough * rough).sum(axis=0)]
    )


def _errors(sums: Array, filtered: tuple[Array, Array, Array], samples: int, steps: int) -> Errors:
    """Errors from the `_sums` of all pieces, with those of the equations."""
    squares, total, torque, rough = sums
    noise = np.sqrt(rough / (6.0 * max(steps, 1)))
    relative = np.sqrt(squares / torque)
    return Errors(np.sqrt(squares / samples), relative, total / samples, *filtered, noise, samples)


def no_errors(n: int) -> Errors:
    """Errors of an estimate without values: NaN."""
    return Errors(*np.full((7, n), np.nan), samples=0)


def poor_prediction(
    model: RobotModel, processing: Processing, in_sample: Errors, held_out: Errors | None
) -> str:
    """Sentence about poorly predicted torques, empty if there are none."""
    names = np.array(model.table.joint_names)
    gain = float((decimation_window(processing.decimation) ** 2).sum())
    slides = model.table.sigma[model.table.joint_rows] == 1
    usual, beyond = np.zeros(model.n), np.zeros(model.n, dtype=bool)
    sentences: list[str] = []
    for log, side in (("the log", in_sample), ("the held-out log", held_out)):
        if side is None:
            continue
        rests = np.isnan(side.filtered_relative)
        error = np.where(rests, side.rmse, side.filtered_rmse) ** 2
        part = np.where(rests, side.relative, side.filtered_relative)
        known = (part > 0.0) & np.isfinite(part)
        torque = np.where(known, error, np.inf) / np.where(known, part, 1.0) ** 2
        left = error - _NOISE * np.where(rests, 1.0, gain) * side.noise**2
        if side is in_sample:
            usual = np.where(known, torque, 0.0)
        worse = ~rests & (left > torque)
        poor = worse | ~rests & (left > POOR**2 * np.sqrt(torque * np.maximum(torque, usual)))
        beyond |= worse
        named = [f"{names[j]} ({percent_text(part[j])})" for j in np.flatnonzero(poor)]
        total = np.where(rests, left, error)
        units = [unit for unit in (known & slides, known & ~slides) if unit.any()]  # N and N m
        whole = max((total[unit].sum() / torque[unit].sum() for unit in units), default=0.0)
        if whole > POOR**2:
            named.append(f"all joints together ({percent_text(np.sqrt(whole))})")
        if named:
            sentences.append(f"on {log}: {', '.join(named)}")
    if not sentences:
        return ""
    text = f"Poor prediction. Unexplained part of the torque {'; '.join(sentences)}"
    if beyond.any():
        text += f"; worse than predicting zero torque: {', '.join(names[beyond])}"
    why = (
        "The parameters do not generalise to that motion: use a log that excites these joints "
        "more, or fewer parameters (essential=True in the method)."
        if sentences[0].startswith("on the held-out log")
        else "The order of the joints, signs, zeros, units, the sampling period, the model or the "
        "direction of its gravity may be wrong, the log too short or too noisy, or the method or "
        "form unsuitable (compare method 'wls' and form 'torque')."
    )
    return f"{text}. {why} Do not use the parameters until the cause is known."


_LAGS = 40
SIGNIFICANCE = 0.01
"""Significance level of the residual tests."""
_FEW = 20  # least number of equations for the residual tests


@dataclass(frozen=True, slots=True, eq=False)
class ResidualDiagnostics(Frozen):
    """Statistics of the residuals of m groups of equations over L lags. Read-only.

    Shapes: counts, mean, std, skewness, kurtosis (less 3 of a normal distribution) (m,);
    autocorrelation and its 95 % bounds if white (m, L + 1); p-values (m,), NaN if not tested.
    """

    counts: NDArray[np.int64]
    mean: Array
    std: Array
    autocorrelation: Array
    bounds: Array
    skewness: Array
    kurtosis: Array
    white_p: Array
    normal_p: Array

    @property
    def lags(self) -> int:
        """Number of lags."""
        return self.autocorrelation.shape[1] - 1


def residual_diagnostics(system: Equations, values: Array) -> ResidualDiagnostics:
    """Statistics of the residuals of equations at values (b,).

    Equations in a dead band and the ends of recordings are gaps, which no pair of residuals spans.
    """
    from scipy.special import chdtrc

    residuals, use = _series(system, values)
    lags = max(1, min(_LAGS, int(use.any(axis=1).sum()) // 4))
    counts = use.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = residuals.sum(axis=0) / counts
        e = np.where(use, residuals - mean, 0.0)
        std = np.sqrt((e**2).sum(axis=0) / counts)
        e = e / np.where(std > 0.0, std, np.nan)
        both = ((use[k:] & use[: len(e) - k], e[k:] * e[: len(e) - k]) for k in range(lags + 1))
        sums = np.array([(x.sum(axis=0), y.sum(axis=0)) for x, y in both])
        pairs, products = sums.transpose(1, 2, 0)
        rho = products / pairs
        bounds = 1.959964 / np.sqrt(pairs)
        bounds[:, 0] = 0.0
        skewness = (e**3).sum(axis=0) / counts
        kurtosis = (e**4).sum(axis=0) / counts - 3.0
        Q = (counts + 2.0) / counts * np.nansum(pairs[:, 1:] * rho[:, 1:] ** 2, axis=1)
        # variances of the moments of a correlated series
        r = np.nan_to_num(rho[:, 1:])
        F3 = np.maximum(1.0 + 2.0 * (r**3).sum(axis=1), 0.1)
        F4 = 1.0 + 2.0 * (r**4).sum(axis=1)
        G = counts * (skewness**2 / (6.0 * F3) + kurtosis**2 / (24.0 * F4))
    enough = (counts >= _FEW) & (std > 0.0)
    white, normal = (np.where(enough, p, np.nan) for p in (chdtrc(lags, Q), chdtrc(2, G)))
    return ResidualDiagnostics(counts, mean, std, rho, bounds, skewness, kurtosis, white, normal)


def _series(system: Equations, values: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Residuals (N, m), zero in gaps, and mask of equations (N, m)."""
    residuals, use, begin = [], [], None
    gap = np.zeros((_LAGS, system.groups))
    for piece in system.pieces():
        block = system.block(piece)
        if begin not in (None, piece.begin):
            residuals.append(gap)
            use.append(gap > 0.0)
        begin = piece.begin
        residuals.append(np.where(block.use, block.y - block.W @ values, 0.0))
        use.append(block.use)
    return np.concatenate(residuals), np.concatenate(use)
