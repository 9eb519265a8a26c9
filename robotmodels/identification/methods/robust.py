"""Robust least squares: equations that hit something, slip or spike lose their say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, read_only
from ..._choices import chosen
from ...estimation.losses import Loss, loss_terms, tuning
from ...estimation.merging import merged_factor, merged_tree
from ..equations import Block, Equations
from ..scale.reduction import Reduction
from .detailed import DetailedEstimate
from .estimate import Estimate, EstimateStatus, Method
from .least_squares import check_count, solved, weighted, weights_of
from .lengths import Lengths

_MOST = 100
_STILL = 1e-4
"""Movement of the parameters, in their deviations, below which they stand still."""
_SCALES = 20
"""Passes that change the deviations: medians of few residuals may go round in circles."""
_STEADY = 1e-3
"""Change of the deviations, relative, below which they stand still."""
_ROUNDING = 1e-12
"""Change of predicted torques, relative to the measured, that is rounding."""
_FAR = 4.0
"""Deviations beyond which an equation is an outlier: 6 of 100000 of normal noise are."""
_LISTED = 1000
_KEPT_BYTES = 2**27
"""Equations that are smaller than this together are kept between the iterations."""
_ONE = np.ones(1, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Outliers(Rebuilt):
    """Equations more than four deviations away. Read-only.

    Parameters
    ----------
    counts : ndarray of int, shape (m,)
        How many, by kind of equations (joint).
    t : ndarray, shape (k,)
        Times in the log of the thousand largest at most, ascending, seconds.
    kind : ndarray of int, shape (k,)
        Their kinds, from 0.
    size : ndarray, shape (k,)
        Their residuals, in deviations.
    """

    counts: NDArray[np.int64]
    t: Array
    kind: NDArray[np.int64]
    size: Array

    def __post_init__(self) -> None:
        for name in ("counts", "kind"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.int64))
        for name in ("t", "size"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __len__(self) -> int:
        return int(self.counts.sum())


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RobustEstimate(DetailedEstimate):
    """Parameters by a robust loss. Read-only.

    ``sigma`` are deviations of the good equations, from medians; ``covariance`` takes variances
    that differ from equation to equation into account, but no correlation.

    Parameters
    ----------
    loss : Loss
        Which.
    slopes : ndarray, shape (m,)
        Mean derivative of the influence of each kind: the share of its information that is left.
    outliers : Outliers
        What was far away.
    """

    loss: Loss
    slopes: Array
    outliers: Outliers

    def __post_init__(self) -> None:
        Estimate.__post_init__(self)
        object.__setattr__(self, "slopes", read_only(self.slopes))

    def influence(self, residuals: Array) -> Array:
        """What residuals count as.

        Parameters
        ----------
        residuals : ndarray, shape (k, m)
            Of equations.

        Returns
        -------
        ndarray, shape (k, m)
            In the same units; near themselves where small, bounded where large.
        """
        u = np.abs(residuals) * _weights(self.sigma)
        return residuals * loss_terms(self.loss, u, tuning(self.loss, _ONE))[1]


def robust(
    system: Equations, reduction: Reduction, loss: Loss | str = Loss.HUBER
) -> RobustEstimate:
    """M-estimate: the loss of each equation's residual, in deviations of its joint.

    Passes over the equations, a block at a time. Deviations are medians of residuals and change
    with them; losses whose influence falls again start where Huber's ends and keep its deviations.
    Outliers are told among equations: a spike shorter than the decimation's window is spread over
    the equations whose windows it is in.

    Parameters
    ----------
    system : Equations
        Robot, log and choices.
    reduction : Reduction
        Of the same equations; its weighted least squares is the start.
    loss : Loss or str
        "huber", "cauchy" or "tukey"; with each, 95 % of the efficiency on normal noise.

    Returns
    -------
    RobustEstimate
        With the outliers, by joint and time.

    Raises
    ------
    InvalidValueError
        Another loss; fewer equations than parameters.

    References
    ----------
    P. J. Huber and E. M. Ronchetti, "Robust Statistics", 2nd ed., Wiley 2009, sections 7.6 to 7.8;
    V. Yohai, "High breakdown-point and high efficiency robust estimates for regression", Annals of
    Statistics 15(2), 1987 (the scale that is kept).

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.identification import Log, choose_processing, equations, reduce_equations
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> from robotmodels.robots import load
    >>> model, t, w = load("rx90"), 0.01 * np.arange(600)[:, None], np.linspace(1.0, 5.0, 6)
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> tau = idm(model, q, v, a)
    >>> tau[::20] += 50.0  # one of twenty samples is wrong
    >>> log = Log(0.01, q, tau, v, a)
    >>> base = base_parameters(model, drive=False)
    >>> given = choose_processing(log, filtered=False, decimation=1, edges=0.0, dead_band=0.0)
    >>> system = equations(base, log, given)
    >>> found = robust(system, reduce_equations(system), "tukey")
    >>> found.outliers.counts, bool(np.allclose(found.values, base.values(model)))
    (array([30, 30, 30, 30, 30, 30]), True)
    """
    kind = chosen(Loss, loss, "loss")
    check_count(reduction)
    start = weighted(reduction)
    blocks = _Blocks(system)
    values, sigma, status, count = _iterated(
        blocks, reduction, Loss.HUBER if kind is not Loss.SQUARES else kind, start.values, None
    )
    if kind not in (Loss.HUBER, Loss.SQUARES):
        values, sigma, status, more = _iterated(blocks, reduction, kind, values, sigma)
        count += more
    return _judged(blocks, reduction, kind, values, sigma, status, count)


class _Blocks:
    """Equations that are made again for each pass, unless they are few enough to be kept."""

    def __init__(self, system: Equations) -> None:
        self.system = system
        rows = sum(piece.stop - piece.start for piece in system.pieces())
        size = 8 * system.kinds * (len(system.names) + 1) * rows / system.processing.decimation
        self.kept: list[Block] | None = list(system.blocks()) if size <= _KEPT_BYTES else None

    def __iter__(self) -> Iterator[Block]:
        return self.system.blocks() if self.kept is None else iter(self.kept)


def _weights(sigma: Array) -> Array:
    return 1.0 / np.where(sigma > 0.0, sigma, np.inf)


def _iterated(
    blocks: _Blocks, reduction: Reduction, loss: Loss, values: Array, sigma: Array | None
) -> tuple[Array, Array, EstimateStatus, int]:
    """Parameters that stand still, with given deviations or those of their residuals."""
    fixed = sigma is not None
    scale = _scale(blocks, reduction, values) if sigma is None else sigma
    for count in range(1, _MOST + 1):
        R, y, lengths = _pass(blocks, reduction, loss, values, scale)
        size = np.linalg.norm(R, axis=0)
        size[size == 0.0] = 1.0
        inverse = np.linalg.inv(R / size) / size[:, None]
        before, values = values, inverse @ y
        deviations = np.linalg.norm(inverse, axis=1)
        moved = values - before
        still = (np.abs(moved) <= _STILL * deviations).all() or _rounding(reduction, moved)
        if not fixed and count <= _SCALES:
            # deviations of the residuals that this pass has met
            last, scale = scale, _floored(lengths, reduction)
            still &= bool((np.abs(scale - last) <= _STEADY * last + 10.0 * _least(reduction)).all())
        if still:
            return values, scale, EstimateStatus.SOLVED, count
    return values, scale, EstimateStatus.NOT_CONVERGED, _MOST


def _rounding(reduction: Reduction, moved: Array) -> bool:
    """Whether parameters have moved so little that torques change by rounding alone."""
    changes = [np.linalg.norm(F[:, :-1] @ moved) for F in reduction.factors]
    sizes = [np.linalg.norm(F[:, -1]) for F in reduction.factors]
    return float(max(changes)) <= _ROUNDING * float(max(sizes))


def _least(reduction: Reduction) -> float:
    """Deviation that stands for none, of which rounding makes a multiple."""
    return float(1.0 / weights_of(np.zeros(len(reduction.factors)), reduction).max())


def _pass(
    blocks: _Blocks, reduction: Reduction, loss: Loss, values: Array, sigma: Array
) -> tuple[Array, Array, Lengths]:
    """Triangular system with the weights of the residuals, and the lengths of these."""
    c = tuning(loss, _ONE)
    weights = _weights(sigma)
    lengths = Lengths(len(sigma))

    def factors() -> Iterator[Array]:
        for block in blocks:
            e = np.abs(block.y - block.W @ values)
            lengths.add(e, block.use)
            share = np.sqrt(loss_terms(loss, e * weights, c)[1]) * weights
            w = share[block.use][:, None]
            rows = np.column_stack((block.W[block.use], block.y[block.use])) * w
            yield merged_factor(np.zeros((0, rows.shape[1])), rows)

    whole = merged_tree(factors(), merged_factor)
    assert whole is not None  # a log has pieces
    R = np.asarray(np.linalg.qr(whole, mode="r"))
    b = len(values)
    return R[:b, :b], R[:b, b], lengths


def _scale(blocks: _Blocks, reduction: Reduction, values: Array) -> Array:
    lengths = Lengths(len(reduction.factors))
    for block in blocks:
        lengths.add(np.abs(block.y - block.W @ values), block.use)
    return _floored(lengths, reduction)


def _floored(lengths: Lengths, reduction: Reduction) -> Array:
    """Deviations from medians, parameters taken off in equal shares; not less than rounding."""
    share = 1.0 - len(reduction.names) / reduction.rows
    sigma = lengths.deviations() / np.sqrt(share)
    return 1.0 / weights_of(sigma, reduction)


def _judged(
    blocks: _Blocks, reduction: Reduction, loss: Loss, values: Array, sigma: Array,
    status: EstimateStatus, count: int,
) -> RobustEstimate:  # fmt: skip
    """Covariance and outliers."""
    b, m = len(values), len(sigma)
    weights, c = _weights(sigma), tuning(loss, _ONE)
    slopes, scores = np.zeros(m), np.zeros((b, b))
    counts = np.zeros(m, dtype=np.int64)
    far: Array = np.zeros((0, 3))
    for block in blocks:
        u = np.where(block.use, (block.y - block.W @ values) * weights, 0.0)
        _, w, slope = loss_terms(loss, np.abs(u), c)
        slopes += np.where(block.use, slope, 0.0).sum(axis=0)
        rows = ((w * u * weights)[..., None] * block.W).reshape(-1, b)
        scores += rows.T @ rows
        away = np.abs(u) > _FAR
        counts += away.sum(axis=0)
        i, j = np.nonzero(away)
        far = np.vstack((far, np.column_stack((block.t[i], j.astype(np.float64), u[i, j]))))
        if len(far) > _LISTED:
            far = far[np.argsort(-np.abs(far[:, 2]), kind="stable")[:_LISTED]]
    far = far[np.lexsort((far[:, 1], far[:, 0]))]
    slopes = np.maximum(slopes / np.maximum(reduction.counts, 1), 1e-3)
    _, inverse, _ = solved(reduction, np.sqrt(slopes) * weights)
    covariance = reduction.rows / (reduction.rows - b) * inverse @ scores @ inverse
    notes: tuple[str, ...] = ()
    if counts.any():
        shares = " ".join(f"{100 * x:.2g}" for x in counts / np.maximum(reduction.counts, 1))
        notes = (
            f"{int(counts.sum())} equations are more than {_FAR:g} deviations away (per cent by "
            f"joint: {shares}); see the estimate's outliers.",
        )
    return RobustEstimate(
        Method.ROBUST, reduction.names, values, covariance, sigma, status, count, notes,
        loss=loss, slopes=slopes,
        outliers=Outliers(counts, far[:, 0], far[:, 1].astype(np.int64), far[:, 2]),
    )  # fmt: skip
