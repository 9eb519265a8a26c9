"""Least squares drawn toward a prior, as strongly as is stated or as the log suggests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_exact, as_floats, read_only
from ...errors import InvalidValueError, ShapeError
from ...estimation.merging import merged_tree
from ...estimation.strength import StrengthSelection
from ..equations import Block, Equations
from ..scale.reduction import Reduction, block_reduction, merge
from .detailed import DetailedEstimate
from .estimate import Estimate, Method
from .least_squares import check_count, deviations_of, ordinary, weighted, weights_of

_DECADE = 8
"""Strengths that are tried for a factor of ten."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RidgeEstimate(DetailedEstimate):
    """Parameters drawn toward a prior. Read-only.

    The covariance is that of the parameters given log and prior: it holds if the prior's
    deviations (divided by the root of the strength) are true, and then includes what the
    parameters are drawn away from the truth.

    Parameters
    ----------
    prior : ndarray, shape (b,)
        Values that they are drawn toward.
    prior_deviations : ndarray, shape (b,)
        Theirs, before the strength.
    strength : float
        What the squares of the prior are multiplied by.
    degrees : float
        Parameters that the log has determined, of b: the trace of the matrix that makes predicted
        torques of measured ones.
    """

    prior: Array
    prior_deviations: Array
    strength: float
    degrees: float

    def __post_init__(self) -> None:
        Estimate.__post_init__(self)
        for name in ("prior", "prior_deviations"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def ridge(
    reduction: Reduction,
    prior: ArrayLike | None = None,
    deviations: ArrayLike | None = None,
    strength: float | None = None,
    parts: Sequence[Reduction] | None = None,
) -> RidgeEstimate:
    """Weighted least squares with a prior: values that are expected, and how well.

    Parameters
    ----------
    reduction : Reduction
        Of the equations.
    prior : array_like, shape (b,), optional
        Values expected, such as those of a CAD model (``base.values(model)``); default 0.
    deviations : array_like, shape (b,), optional
        Their standard deviations. Without them every parameter is drawn as far as its effect on
        the torques is small (columns of one length).
    strength : float, optional
        What the squares of the prior are multiplied by, from 0. Default 1 where deviations are
        stated; else what generalised cross-validation on the factor chooses, or, with ``parts``,
        what predicts segments of the log best that are kept aside.
    parts : sequence of Reduction, optional
        Segments of the log, of `segments`; they then choose the strength in any case.

    Returns
    -------
    RidgeEstimate
        With the strength and the effective degrees of freedom.

    Raises
    ------
    InvalidValueError, ShapeError
        Deviations that are not positive, a negative strength, fewer than two parts, both strength
        and parts; arrays that do not fit.

    References
    ----------
    G. Golub, M. Heath and G. Wahba, "Generalized cross-validation as a method for choosing a good
    ridge parameter", Technometrics 21(2), 1979.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> A = rng.normal(size=(900, 2))
    >>> y = A @ [2.0, -1.0] + rng.normal(size=900)
    >>> R = np.linalg.qr(np.column_stack((A, y)), mode="r")
    >>> reduction = Reduction(("XX1", "XY1"), (R,), np.array([900]), np.array([0]))
    >>> found = ridge(reduction, prior=[0.0, 0.0], deviations=[1.0, 0.001])
    >>> abs(found.values.round()), round(found.degrees, 1)
    (array([2., 0.]), 1.0)
    """
    check_count(reduction)
    start = weighted(reduction)
    weights = weights_of(ordinary(reduction).sigma, reduction)
    b = len(start.values)
    x0 = np.zeros(b) if prior is None else as_exact(prior, (b,), "prior")
    R, y, rest = reduction.stacked(weights)
    d = _deviations(deviations, R, reduction)
    if parts is not None:
        if strength is not None:
            raise InvalidValueError("strength: parts choose it; leave out one of the two.")
        factor = select_ridge_strength(parts, x0, d, weights).strength
    elif strength is not None:
        factor = float(as_floats(strength, "strength"))
        if not factor >= 0.0:
            raise InvalidValueError(f"strength: expected a number from 0, got {strength!r:.60}.")
    elif deviations is not None:
        factor = 1.0
    else:
        factor = _by_validation(R, y - R @ x0, rest, d, reduction.rows)
    U, s, Vt = np.linalg.svd(R * d)
    shares = s**2 + factor
    values = x0 + d * (Vt.T @ (s / shares * (U.T @ (y - R @ x0))))
    half = (d[:, None] * Vt.T) / np.sqrt(shares)
    drawn = np.abs(values - start.values)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.where(drawn > 0.0, drawn / start.deviations, 0.0)
    degrees = float((s**2 / shares).sum())
    k = int(np.argmax(far))
    note = (
        f"The log determines {degrees:.1f} of {b} parameters, the prior the rest (strength "
        f"{factor:.3g}); {reduction.names[k]} is drawn farthest from weighted least squares, by "
        f"{far[k]:.2g} of its deviations there. All are biased toward the prior."
    )
    return RidgeEstimate(
        Method.RIDGE, reduction.names, values, half @ half.T, deviations_of(reduction, values),
        start.status, 1, (note,), prior=x0, prior_deviations=d, strength=factor, degrees=degrees,
    )  # fmt: skip


def segments(system: Equations, count: int = 5) -> tuple[Reduction, ...]:
    """Reductions of contiguous parts of a log, for cross-validation.

    Neighbouring equations are alike; folds that mix them would keep nothing aside.

    Parameters
    ----------
    system : Equations
        Robot, log and choices.
    count : int
        Parts, of like lengths.

    Returns
    -------
    tuple of Reduction
        In order.

    Raises
    ------
    InvalidValueError
        Fewer than two, or more than there are instants with equations.

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.identification import Log, choose_processing, equations
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> from robotmodels.robots import load
    >>> model, t, w = load("rx90"), 0.01 * np.arange(600)[:, None], np.linspace(1.0, 5.0, 6)
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.01, q, idm(model, q, v, a), v, a)
    >>> base = base_parameters(model, drive=False)
    >>> given = choose_processing(log, filtered=False, decimation=1, edges=0.0, dead_band=0.0)
    >>> system = equations(base, log, given)
    >>> [part.rows for part in segments(system, 3)]
    [1200, 1200, 1200]
    """
    total = sum(len(block) for block in system.blocks())
    if not isinstance(count, (int, np.integer)) or not 2 <= count <= total:
        raise InvalidValueError(f"count: expected from 2 to {total} parts, got {count!r:.40}.")
    ends = np.linspace(0, total, count + 1).astype(int)
    parts: list[list[Reduction]] = [[] for _ in range(count)]
    first = 0
    for block in system.blocks():
        for k in range(count):
            rows = slice(*np.clip(ends[k : k + 2] - first, 0, len(block)).tolist())
            if rows.start < rows.stop:
                part = Block(*(getattr(block, field.name)[rows] for field in fields(Block)))
                parts[k].append(block_reduction(system.names, part))
        first += len(block)
    return tuple(reduce(merge, part) for part in parts)


def select_ridge_strength(
    parts: Sequence[Reduction],
    prior: ArrayLike,
    deviations: ArrayLike,
    weights: Array | None = None,
) -> StrengthSelection:
    """Try strengths of a prior on parts of a log that are kept aside in turn.

    Parameters
    ----------
    parts : sequence of Reduction
        Of `segments`.
    prior, deviations : array_like, shape (b,)
        Expected values and their deviations.
    weights : ndarray, shape (m,), optional
        Of the kinds of equations; default those of weighted least squares of all parts.

    Returns
    -------
    StrengthSelection
        Errors are mean squares of weighted residuals.

    Raises
    ------
    InvalidValueError, ShapeError
        Fewer than two parts; arrays that do not fit.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> A = rng.normal(size=(900, 2))
    >>> y = A @ [2.0, -1.0] + rng.normal(size=900)
    >>> parts = [
    ...     Reduction(("XX1", "XY1"), (np.column_stack((A, y))[k::3],), np.array([300]), [0])
    ...     for k in range(3)
    ... ]
    >>> right = select_ridge_strength(parts, [2.0, -1.0], [0.1, 0.1]).strength
    >>> bool(right > select_ridge_strength(parts, [9.0, 9.0], [0.1, 0.1]).strength)
    True
    """
    if len(parts) < 2:
        raise InvalidValueError(f"parts: expected two or more, got {len(parts)}; see segments.")
    whole = merged_tree(parts, merge)
    assert whole is not None
    b = len(whole.names)
    x0, d = as_exact(prior, (b,), "prior"), as_exact(deviations, (b,), "deviations")
    w = weights_of(ordinary(whole).sigma, whole) if weights is None else weights
    R, _, _ = whole.stacked(w)
    strengths = _grid(np.linalg.svd(R * d)[1])
    errors = np.empty((len(strengths), len(parts)))
    for k, aside in enumerate(parts):
        rest = merged_tree((part for i, part in enumerate(parts) if i != k), merge)
        assert rest is not None
        R, y, _ = rest.stacked(w)
        U, s, Vt = np.linalg.svd(R * d, full_matrices=False)
        z = U.T @ (y - R @ x0)
        for n, strength in enumerate(strengths):
            low = s**2 + strength
            gain = np.divide(s, low, out=np.zeros_like(s), where=low > 0.0)
            values = x0 + d * (Vt.T @ (gain * z))
            errors[n, k] = aside.sums(values) @ w**2 / max(aside.rows, 1)
    return StrengthSelection(strengths, errors)


def _deviations(deviations: ArrayLike | None, R: Array, reduction: Reduction) -> Array:
    if deviations is None:
        return np.sqrt(reduction.rows) / np.linalg.norm(R, axis=0)
    d = as_floats(deviations, "deviations")
    if d.shape != (R.shape[1],):
        raise ShapeError(f"deviations: expected shape ({R.shape[1]},), got {d.shape}.")
    if not (d > 0.0).all():
        raise InvalidValueError(f"deviations: expected positive numbers, got {d.min():g}.")
    return d


def _by_validation(R: Array, y: Array, rest: float, d: Array, rows: int) -> float:
    """Strength whose generalised cross-validation error is least."""
    U, s, _ = np.linalg.svd(R * d)
    z = (U.T @ y) ** 2
    strengths = _grid(s)
    left = strengths[:, None] / (s**2 + strengths[:, None])
    squares = (left**2 * z).sum(axis=1) + rest
    degrees = (1.0 - left).sum(axis=1)
    return float(strengths[int(np.argmin(squares / (rows - degrees) ** 2))])


def _grid(s: Array) -> Array:
    """Nothing, and strengths from where the prior hardly acts to where it alone does."""
    low, high = np.log10(1e-4 * max(s[-1], 1e-12 * s[0]) ** 2), np.log10(1e2 * s[0] ** 2)
    return np.append(0.0, np.logspace(low, high, int(_DECADE * (high - low)) + 2))
