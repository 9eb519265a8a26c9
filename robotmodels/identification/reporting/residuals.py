"""What the residuals of an identification say: whether they are white and normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, as_floats, read_only
from ...errors import InvalidValueError, ShapeError
from ...estimation.diagnostics import ResidualTest
from ..equations import Equations

_LAGS = 40
_DOUBT = 0.01
"""Probability under which a test speaks against its assumption."""
_FEW = 20
"""Equations below which nothing is said of residuals."""


@dataclass(frozen=True, slots=True, eq=False)
class ResidualDiagnostics(Rebuilt):
    """Whether residuals of equations are white and normal, by kind of equations. Read-only.

    Parameters
    ----------
    counts : ndarray of int, shape (m,)
        Equations of each kind (joint) that took part.
    mean, deviation : ndarray, shape (m,)
        Of the residuals, in the unit of the equations.
    autocorrelation : ndarray, shape (m, L + 1)
        Over 0 to L equations; NaN for a kind whose residuals vanish.
    bounds : ndarray, shape (m, L + 1)
        What 95 % of the correlations of white residuals are within.
    skewness, kurtosis : ndarray, shape (m,)
        Third and fourth moment of the residuals, in powers of their deviation, the latter less the
        3 of a normal distribution.
    whiteness : tuple of ResidualTest
        By Ljung and Box, over all L.
    normality : tuple of ResidualTest
        By skewness and kurtosis, with the variances that correlated residuals have.
    """

    counts: NDArray[np.int64]
    mean: Array
    deviation: Array
    autocorrelation: Array
    bounds: Array
    skewness: Array
    kurtosis: Array
    whiteness: tuple[ResidualTest, ...]
    normality: tuple[ResidualTest, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "counts", read_only(self.counts, np.int64))
        names = ("mean", "deviation", "autocorrelation", "bounds", "skewness", "kurtosis")
        for name in names:
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def lags(self) -> int:
        """Equations over which correlation was looked for."""
        return self.autocorrelation.shape[1] - 1


def residual_diagnostics(
    system: Equations, values: Array, lags: int = _LAGS
) -> ResidualDiagnostics:
    """Statistics of the residuals, piece by piece, so that memory does not grow with the log.

    Equations in a dead band are gaps: pairs with one of them are left out of the correlations, and
    so are pairs of two recordings.

    Parameters
    ----------
    system : Equations
        The equations, of the log that was fitted or of another one.
    values : ndarray, shape (b,)
        Parameters.
    lags : int
        Over how many equations correlation is looked for; at most a quarter of them.

    Returns
    -------
    ResidualDiagnostics
        By kind of equations.

    Raises
    ------
    ShapeError, InvalidValueError
        Not one value for each parameter; less than one lag.

    References
    ----------
    Seed book section 1.6.5; G. Ljung and G. Box, "On a measure of lack of fit in time series
    models", Biometrika 65, 1978; D. Stoffer and C. Toloi, "A note on the Ljung-Box-Pierce
    portmanteau statistic with missing data", Statistics & Probability Letters 13, 1992;
    I. Lobato and C. Velasco, "A simple test of normality for time series", Econometric Theory 20,
    2004.

    Examples
    --------
    >>> import robotmodels as rm
    >>> from robotmodels.identification import Log, choose_processing, equations
    >>> rng, t = np.random.default_rng(0), np.arange(0.0, 5.0, 0.01)[:, None]
    >>> log = Log(0.01, np.sin(t) * [1.0, 0.7], rng.normal(size=(500, 2)))
    >>> base = rm.base_parameters(rm.load("planar_2r"))
    >>> raw = choose_processing(log, decimation=1, dead_band=0.0, filtered=False)
    >>> found = residual_diagnostics(equations(base, log, raw), np.zeros(len(base)))
    >>> [test.passed for test in found.whiteness]
    [True, True]
    """
    b = len(system.names)
    x = as_floats(values, "values")
    if x.shape != (b,):
        raise ShapeError(f"values: expected one for each of the {b} parameters, got {x.shape}.")
    if lags < 1:
        raise InvalidValueError(f"lags: expected a whole number from 1, got {lags!r}.")
    parts = system.pieces()
    # of all equations there are, before those in dead bands are left out
    instants = sum(-(-(p.stop - p.start) // system.processing.decimation) for p in parts)
    lags = max(1, min(lags, instants // 4))
    sums = _Sums(system.kinds, lags)
    begin = -1
    for piece in parts:
        block = system.block(piece)
        sums.add(np.where(block.use, block.y - block.W @ x, 0.0), block.use, piece.begin != begin)
        begin = piece.begin
    return sums.result()


class _Sums:
    """Sums of residuals as they come: powers, and products with those that came before."""

    def __init__(self, kinds: int, lags: int) -> None:
        self.lags = lags
        self.powers = np.zeros((5, kinds))
        # pairs, products, and the sums of the earlier and of the later one of each pair
        self.pairs = np.zeros((4, kinds, lags + 1))
        self.origin: Array | None = None
        self.size = np.ones(kinds)
        self.e, self.use = np.zeros((0, kinds)), np.zeros((0, kinds))

    def add(self, e: Array, use: NDArray[np.bool_], start: bool) -> None:
        origin = self.origin
        if origin is None:
            if not use.any():
                return
            # residuals count from near their mean: powers do not cancel
            count = np.maximum(use.sum(axis=0), 1)
            self.origin = origin = e.sum(axis=0) / count
            size = np.sqrt((((e - origin) * use) ** 2).sum(axis=0) / count)
            self.size = np.where(size > 0.0, size, 1.0)
        here = np.where(use, (e - origin) / self.size, 0.0)
        taken = use.astype(np.float64)
        for k in range(5):
            self.powers[k] += taken.sum(axis=0) if k == 0 else (here**k).sum(axis=0)
        if start:
            self.e, self.use = self.e[:0], self.use[:0]
        chain, alive = np.vstack((self.e, here)), np.vstack((self.use, taken))
        old = len(self.e)
        for lag in range(self.lags + 1):
            first = max(old - lag, 0)
            later = slice(first + lag, None)
            count = len(chain) - first - lag
            if count <= 0:
                continue
            earlier = slice(first, first + count)
            self.pairs[0, :, lag] += (alive[earlier] * alive[later]).sum(axis=0)
            self.pairs[1, :, lag] += (chain[earlier] * chain[later]).sum(axis=0)
            self.pairs[2, :, lag] += (chain[earlier] * alive[later]).sum(axis=0)
            self.pairs[3, :, lag] += (alive[earlier] * chain[later]).sum(axis=0)
        self.e, self.use = chain[-self.lags :], alive[-self.lags :]

    def result(self) -> ResidualDiagnostics:
        from scipy.special import chdtrc

        N = self.powers[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            raw = self.powers[1:] / N
            mu = raw[0]
            pairs, products, earlier, later = self.pairs
            covariance = (products - mu[:, None] * (earlier + later)) / pairs + mu[:, None] ** 2
            m2 = raw[1] - mu**2
            m3 = raw[2] - 3.0 * mu * raw[1] + 2.0 * mu**3
            m4 = raw[3] - 4.0 * mu * raw[2] + 6.0 * mu**2 * raw[1] - 3.0 * mu**4
            still = m2 <= 0.0
            rho = np.where(still[:, None], np.nan, covariance / m2[:, None])
            skewness, kurtosis = m3 / m2**1.5, m4 / m2**2 - 3.0
            bounds = 1.959964 / np.sqrt(pairs)
            bounds[:, 0] = 0.0
            # with all pairs present this is the sum of Ljung and Box: rho there is pairs / N of it
            Q = (N + 2.0) / N * np.nansum(pairs[:, 1:] * rho[:, 1:] ** 2, axis=1)
            # sums of the powers of the correlations: the variances of the two moments
            r = np.nan_to_num(rho[:, 1:])
            F3 = np.maximum(1.0 + 2.0 * (r**3).sum(axis=1), 0.1)
            F4 = 1.0 + 2.0 * (r**4).sum(axis=1)
            G = N * (skewness**2 / (6.0 * F3) + kurtosis**2 / (24.0 * F4))
        enough = (N >= _FEW) & ~still
        white = tuple(
            _whiteness(float(q), float(chdtrc(self.lags, q)), float(rho[j, 1]))
            if enough[j] else _nothing()
            for j, q in enumerate(Q)
        )  # fmt: skip
        normal = tuple(
            _normality(float(g), float(chdtrc(2, g)), float(kurtosis[j]))
            if enough[j] else _nothing()
            for j, g in enumerate(G)
        )  # fmt: skip
        origin = np.zeros(len(N)) if self.origin is None else self.origin
        deviation = self.size * np.sqrt(np.maximum(m2, 0.0))
        return ResidualDiagnostics(
            N.astype(np.int64), origin + self.size * mu, deviation, rho, bounds, skewness,
            kurtosis, white, normal,
        )  # fmt: skip


def _nothing() -> ResidualTest:
    return ResidualTest(np.nan, np.nan, "Too few residuals, or residuals that vanish.")


def _whiteness(statistic: float, p: float, first: float) -> ResidualTest:
    if p >= _DOUBT:
        return ResidualTest(statistic, p, "Residuals are white.")
    return ResidualTest(
        statistic, p,
        f"Residuals are correlated in time ({first:+.2f} between successive ones): the model "
        "misses something that lasts.",
    )  # fmt: skip


def _normality(statistic: float, p: float, kurtosis: float) -> ResidualTest:
    if p >= _DOUBT:
        return ResidualTest(statistic, p, "Residuals are normal.")
    tails = "there are more far ones" if kurtosis > 0.0 else "they are flatter or lopsided"
    return ResidualTest(statistic, p, f"Residuals are not normal: {tails}.")
