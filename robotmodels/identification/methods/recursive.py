"""Recursive least squares in time: how the estimate settles, and whether it drifts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, as_floats, read_only
from ...errors import InvalidValueError
from ..equations import Equations
from ..scale.reduction import Reduction
from .detailed import DetailedEstimate
from .estimate import Estimate, EstimateStatus, Method
from .least_squares import check_count, deviations_of, ordinary, weights_of

_POINTS = 200
"""Points of the history, where nothing else is asked for."""
_TOLD = 1e-9
"""Diagonal of the factor, of columns of length one, from which the log tells a parameter."""


@dataclass(frozen=True, slots=True, eq=False)
class RecursiveHistory(Rebuilt):
    """Estimates as the log goes on. Read-only.

    Parameters
    ----------
    t : ndarray, shape (h,)
        Times of the last equations that each estimate knows, seconds.
    values : ndarray, shape (h, b)
        Parameters; NaN while the log does not tell them from each other.
    deviations : ndarray, shape (h, b)
        Theirs; NaN likewise.
    """

    t: Array
    values: Array
    deviations: Array

    def __post_init__(self) -> None:
        for name in ("t", "values", "deviations"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RecursiveEstimate(DetailedEstimate):
    """Parameters at the end of the log. Read-only.

    Parameters
    ----------
    history : RecursiveHistory
        How they came.
    forgetting : float
        Weight of an instant relative to the next.
    weights : ndarray, shape (m,)
        What the equations of each kind were multiplied by.
    memory : float
        Instants that count, the older ones by their weight.
    """

    history: RecursiveHistory
    forgetting: float
    weights: Array
    memory: float

    def __post_init__(self) -> None:
        Estimate.__post_init__(self)
        object.__setattr__(self, "weights", read_only(self.weights))


def recursive(
    system: Equations,
    reduction: Reduction,
    forgetting: float = 1.0,
    every: int | None = None,
    weights: Array | None = None,
) -> RecursiveEstimate:
    """Weighted least squares in the order of time, by updates of a triangular factor.

    The square-root information form: no covariance is inverted or updated by differences, so that
    nothing is lost over long logs, and no first guess is needed. Without forgetting, the last
    estimate is that of weighted least squares with the same weights.

    Parameters
    ----------
    system : Equations
        Robot, log and choices.
    reduction : Reduction
        Of the same equations; where the weights come from.
    forgetting : float
        Weight of the squares of an instant relative to those of the next, above 0 and at most 1:
        about ``1 / (1 - forgetting)`` instants count.
    every : int, optional
        Instants between the points of the history; default about two hundred points.
    weights : ndarray, shape (m,), optional
        Of each kind of equations; default of the residuals of weighted least squares.

    Returns
    -------
    RecursiveEstimate
        With the history of values and deviations.

    Raises
    ------
    InvalidValueError
        A factor outside its range; fewer equations than parameters.

    References
    ----------
    Seed book section 1.6.4; G. Bierman, "Factorization Methods for Discrete Sequential
    Estimation", Academic Press 1977, chapter V.

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.identification import Log, choose_processing, equations, reduce_equations
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> from robotmodels.robots import load
    >>> model, t, w = load("rx90"), 0.01 * np.arange(600)[:, None], np.linspace(1.0, 5.0, 6)
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.01, q, idm(model, q, v, a), v, a)
    >>> base = base_parameters(model, drive=False)
    >>> given = choose_processing(log, filtered=False, decimation=1, edges=0.0, dead_band=0.0)
    >>> system = equations(base, log, given)
    >>> found = recursive(system, reduce_equations(system), every=100)
    >>> len(found.history), bool(np.allclose(found.values, base.values(model)))
    (6, True)
    """
    factor = float(as_floats(forgetting, "forgetting"))
    if not 0.0 < factor <= 1.0:
        raise InvalidValueError(
            f"forgetting: expected a number above 0 and at most 1, got {forgetting!r:.60}."
        )
    if every is not None and (not isinstance(every, (int, np.integer)) or every < 1):
        raise InvalidValueError(f"every: expected a whole number from 1, got {every!r:.60}.")
    check_count(reduction)
    if weights is None:
        weights = weights_of(ordinary(reduction).sigma, reduction)
    state = _State(len(reduction.names), factor)
    points: list[tuple[float, Array, Array]] = []
    stride = every or max(1, int((reduction.counts + reduction.left_out).max()) // _POINTS)
    waiting = 0  # instants since the last point
    last = 0.0
    for block in system.blocks():
        k = 0
        while k < len(block):
            count = min(stride - waiting, len(block) - k)
            part = slice(k, k + count)
            state.add(block.W[part], block.y[part], block.use[part], weights)
            k += count
            waiting += count
            last = float(block.t[k - 1])
            if waiting == stride:
                points.append((last, *state.solution()))
                waiting = 0
    if waiting:
        points.append((last, *state.solution()))
    values = points[-1][1]
    if np.isnan(values).any():
        raise InvalidValueError(
            f"forgetting: with {factor:g} about {state.memory:.3g} instants count at the end of "
            "the log, which do not tell the parameters from each other; take a larger factor."
        )
    history = RecursiveHistory(*(np.array(x) for x in zip(*points, strict=True)))
    notes: tuple[str, ...] = ()
    if factor < 1.0:
        notes = (
            f"About {state.memory:.3g} instants of the log count, those at its end most; earlier "
            "ones are forgotten.",
        )
    return RecursiveEstimate(
        Method.RECURSIVE, reduction.names, values, state.covariance(),
        deviations_of(reduction, values), EstimateStatus.SOLVED, len(points), notes,
        history=history, forgetting=factor, weights=weights, memory=state.memory,
    )  # fmt: skip


class _State:
    """A triangular factor of all equations so far, the older ones less and less."""

    def __init__(self, b: int, forgetting: float) -> None:
        self.R = np.zeros((0, b + 1))
        self.forgetting = forgetting
        self.equations = self.memory = 0.0

    def add(self, W: Array, y: Array, use: NDArray[np.bool_], weights: Array) -> None:
        k, _, b = W.shape
        rows = np.concatenate((W, y[..., None]), axis=2) * weights[:, None]
        age = self.forgetting ** np.arange(k - 1, -1, -1.0)
        rows *= np.sqrt(age)[:, None, None]
        fade = self.forgetting**k
        whole = np.vstack((np.sqrt(fade) * self.R, rows[use]))
        # fewer rows than columns tell no solution yet, and are kept as they are
        self.R = np.asarray(np.linalg.qr(whole, mode="r")) if len(whole) >= b + 1 else whole
        self.equations = fade * self.equations + float(age @ use.sum(axis=1))
        self.memory = fade * self.memory + float(age.sum())

    def solution(self) -> tuple[Array, Array]:
        b = self.R.shape[1] - 1
        nothing = np.full(b, np.nan)
        if len(self.R) < b + 1 or self.equations <= b:
            return nothing, nothing
        size = np.linalg.norm(self.R[:, :b], axis=0)
        if not size.all() or (np.abs(np.diag(self.R)[:b]) < _TOLD * size).any():
            return nothing, nothing
        inverse = self._inverse()
        return inverse @ self.R[:b, b], np.sqrt(self._scale()) * np.linalg.norm(inverse, axis=1)

    def covariance(self) -> Array:
        inverse = self._inverse()
        return self._scale() * inverse @ inverse.T

    def _inverse(self) -> Array:
        from scipy.linalg import solve_triangular

        b = self.R.shape[1] - 1
        R = self.R[:b, :b]
        size = np.linalg.norm(R, axis=0)
        return solve_triangular(R / size, np.eye(b)) / size[:, None]

    def _scale(self) -> float:
        b = self.R.shape[1] - 1
        return float(self.R[b:, b] @ self.R[b:, b]) / (self.equations - b)
