"""Essential parameters: those whose deviations say that they are seen."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, as_floats, read_only
from ..._choices import chosen
from ...errors import InvalidValueError
from ..scale.reduction import Reduction
from .estimate import Estimate
from .least_squares import check_count, weighted, weights_of


class EssentialRule(Enum):
    """When enough parameters have been dropped.

    Examples
    --------
    >>> [rule.name for rule in EssentialRule]
    ['RATIO', 'F_TEST', 'AIC']
    """

    RATIO = "the largest relative deviation is within a ratio of the smallest"
    F_TEST = "the residuals would grow more than chance explains"
    AIC = "Akaike's criterion is least"


@dataclass(frozen=True, slots=True, eq=False)
class Essential(Rebuilt):
    """Which parameters are essential, and how the others went. Read-only.

    Parameters
    ----------
    names : tuple of str
        Essential parameters, in the order they had.
    dropped : tuple of str
        The others, in the order they were dropped.
    rule : EssentialRule
        What ended it.
    relative : ndarray, shape (d + 1,)
        Largest relative deviation before each drop, and at last.
    ratio : ndarray, shape (d + 1,)
        Largest relative deviation over the smallest, likewise.
    growth : ndarray, shape (d + 1,)
        Growth of the weighted residuals' root mean square since the start, likewise: 0.01 is 1 %.
    f : ndarray, shape (d + 1,)
        Statistic of Fisher's test that all parameters dropped so far are zero; 0 for none.
    aic : ndarray, shape (d + 1,)
        Akaike's criterion, relative to that at the start.
    """

    names: tuple[str, ...]
    dropped: tuple[str, ...]
    rule: EssentialRule
    relative: Array
    ratio: Array
    growth: Array
    f: Array
    aic: Array

    def __post_init__(self) -> None:
        for name in ("relative", "ratio", "growth", "f", "aic"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.names)

    def reduce(self, reduction: Reduction) -> Reduction:
        """The reduction in the essential parameters alone.

        Parameters
        ----------
        reduction : Reduction
            Of the parameters that these were chosen from.

        Returns
        -------
        Reduction
            Of the same equations.
        """
        return with_columns(reduction, self.names)


def essential(
    reduction: Reduction,
    estimate: Estimate | None = None,
    ratio: float = 30.0,
    growth: float = 0.1,
    rule: EssentialRule | str = EssentialRule.RATIO,
    level: float = 0.05,
) -> Essential:
    """Drop the parameters that the log does not show, one at a time.

    Each time the one of the largest relative deviation goes and the others are found again, all on
    the triangular factor. Deviations are those of white residuals, whose ratios the rule is about.

    Parameters
    ----------
    reduction : Reduction
        Of the equations.
    estimate : Estimate, optional
        Its residuals' deviations give the weights of the kinds of equations; default weighted
        least squares.
    ratio : float
        Of the rule ``RATIO``: largest relative deviation over the smallest that is left.
    growth : float
        Of the rule ``RATIO``: it stops as well before the residuals have grown by more than this
        part. In a log that shows all parameters well the ratio alone would go on.
    rule : EssentialRule or str
        "ratio", "f_test" or "aic".
    level : float
        Of the rule ``F_TEST``: probability of keeping what could all be dropped.

    Returns
    -------
    Essential
        Names, order and growth of the residuals.

    Raises
    ------
    InvalidValueError
        A ratio below 1, a negative growth, a level outside of 0 to 1, another rule; fewer equations
        than parameters.

    References
    ----------
    W. Khalil and E. Dombre, "Modeling, Identification and Control of Robots", 2002, section
    12.5; C. Presse and M. Gautier, "Bayesian estimation of inertial parameters of robots", IEEE
    ICRA 1992.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> A = rng.normal(size=(900, 2))
    >>> y = A @ [2.0, 0.0] + rng.normal(size=900)
    >>> R = np.linalg.qr(np.column_stack((A, y)), mode="r")
    >>> reduction = Reduction(("XX1", "XY1"), (R,), np.array([900]), np.array([0]))
    >>> found = essential(reduction)
    >>> found.names, found.dropped, bool(found.growth[-1] < 0.01)
    (('XX1',), ('XY1',), True)
    """
    kind = chosen(EssentialRule, rule, "rule")
    most = float(as_floats(ratio, "ratio"))
    if not most >= 1.0:
        raise InvalidValueError(f"ratio: expected a number from 1, got {ratio!r:.60}.")
    grown = float(as_floats(growth, "growth"))
    if not grown >= 0.0:
        raise InvalidValueError(f"growth: expected a number from 0, got {growth!r:.60}.")
    chance = float(as_floats(level, "level"))
    if not 0.0 < chance < 1.0:
        raise InvalidValueError(f"level: expected a number between 0 and 1, got {level!r:.60}.")
    check_count(reduction)
    found = weighted(reduction) if estimate is None else estimate
    R, y, rest = reduction.stacked(weights_of(found.sigma, reduction))
    rows, b = reduction.rows, R.shape[1]
    kept = list(range(b))
    order: list[int] = []
    path: list[tuple[float, float, float]] = []
    least = rest
    while True:
        largest, smallest, at, squares = _deviations(R[:, kept], y, rest, rows)
        path.append((largest, largest / smallest, squares))
        if len(kept) == 1 or (kind is EssentialRule.RATIO and largest <= most * smallest):
            break
        if (
            kind is not EssentialRule.AIC
            and order
            and squares > _most(kind, least, grown, chance, len(order), rows - b)
        ):
            break
        order.append(kept.pop(at))
    relative, ratios, squares = (np.array(x) for x in zip(*path, strict=True))
    number = np.arange(len(path))
    tiny = 1e-300
    f = np.append(0.0, _statistic(squares[1:], least, number[1:], rows - b))
    logarithm = np.asarray(np.log(np.maximum(squares, tiny) / max(least, tiny)), np.float64)
    aic = rows * logarithm - 2.0 * number
    last = len(order)
    if kind is EssentialRule.AIC:
        last = int(np.argmin(aic))
    elif last and squares[-1] > _most(kind, least, grown, chance, last, rows - b):
        last -= 1  # the drop that was one too many
    dropped = order[:last]
    part = slice(last + 1)
    names = tuple(name for k, name in enumerate(reduction.names) if k not in dropped)
    return Essential(
        names, tuple(reduction.names[k] for k in dropped), kind, relative[part], ratios[part],
        np.sqrt(np.maximum(squares / max(least, tiny), 1.0))[part] - 1.0, f[part], aic[part],
    )  # fmt: skip


def with_columns(reduction: Reduction, names: tuple[str, ...]) -> Reduction:
    """The reduction of the same equations in fewer parameters, the others being zero."""
    missing = [name for name in names if name not in reduction.names]
    if missing:
        raise InvalidValueError(f"names: {', '.join(missing)} are not parameters here.")
    at = [reduction.names.index(name) for name in names]
    factors = tuple(F[:, [*at, F.shape[1] - 1]] for F in reduction.factors)
    return Reduction(tuple(names), factors, reduction.counts, reduction.left_out)


def _deviations(R: Array, y: Array, rest: float, rows: int) -> tuple[float, float, int, float]:
    """Largest and smallest relative deviation, where the largest is, and the squares left."""
    from scipy.linalg import solve_triangular

    b = R.shape[1]
    size = np.linalg.norm(R, axis=0)
    T = np.asarray(np.linalg.qr(np.column_stack((R / size, y)), mode="r"))
    inverse = solve_triangular(T[:b, :b], np.eye(b))
    values = np.abs(inverse @ T[:b, b])
    squares = rest + float(T[b:, b] @ T[b:, b])
    deviations = np.linalg.norm(inverse, axis=1) * np.sqrt(max(squares, 1e-300) / (rows - b))
    relative = deviations / np.maximum(values, 1e-300)
    at = int(np.argmax(relative))
    return float(relative[at]), float(relative.min()), at, squares


def _statistic(squares: Array, least: float, dropped: NDArray[np.int64], left: int) -> Array:
    """Fisher's statistic of restrictions."""
    return (squares - least) / dropped / max(least / left, 1e-300)


def _most(
    kind: EssentialRule, least: float, growth: float, level: float, dropped: int, left: int
) -> float:
    """Sum of squares that the residuals may have after so many drops."""
    if kind is EssentialRule.RATIO:
        return least * (1.0 + growth) ** 2
    from scipy.stats import f

    return least * (1.0 + dropped / left * float(f.ppf(1.0 - level, dropped, left)))
