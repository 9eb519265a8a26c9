"""Total least squares: noise in the regressor as well as in the torques."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_floats, read_only
from ..._outcomes import Outcome
from ...errors import InvalidValueError, ShapeError
from ..scale.reduction import Reduction
from .detailed import DetailedEstimate
from .estimate import Estimate, Method
from .least_squares import check_count, deviations_of, ordinary, weighted, weights_of

_CONSTANT = ("Fc", "offset")
"""Columns of signs and ones, which noise does not change outside of the dead bands."""
_GENERIC = 1e-8
"""Share of the torque in the direction of least noise below which there is no solution."""
_ALIKE = 0.999
"""Smallest singular values whose ratio is nearer to one do not tell the direction."""


class TotalStatus(Outcome):
    """What became of total least squares.

    Examples
    --------
    >>> TotalStatus.GENERIC.sentence
    'One combination of the columns explains the torque with the least noise.'
    """

    GENERIC = 0, "One combination of the columns explains the torque with the least noise."
    ALIKE = (
        1,
        "Several combinations explain the torque with as little noise; the parameters are one of "
        "them, and their deviations are large.",
    )
    NOT_GENERIC = (
        2,
        "The combination with the least noise leaves the torque out, so that total least squares "
        "has no solution; the parameters are those of weighted least squares.",
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TotalEstimate(DetailedEstimate):
    """Parameters by total least squares. Read-only.

    Parameters
    ----------
    noise : ndarray, shape (b + 1,)
        Deviations of the noise of the regressor's columns and of the torque that the solution is
        for, relative to each other, in equations divided by the deviations of their residuals.
    scale : float
        What they are multiplied by, as it is found: 1 if they were right.
    solution : TotalStatus
        Whether it exists and is the only one.
    """

    noise: Array
    scale: float
    solution: TotalStatus

    def __post_init__(self) -> None:
        Estimate.__post_init__(self)
        object.__setattr__(self, "noise", read_only(self.noise))


def total(reduction: Reduction, noise: ArrayLike = 0.001) -> TotalEstimate:
    """Total least squares: the least change of regressor and torques that makes them agree.

    The equations of each joint are divided by the deviation of their residuals, columns and
    torque then by the deviations of their noise, so that a change of one counts as one of another
    (total least squares without such a scaling depends on the units). Columns without noise,
    those of signs and ones, are not changed.

    Parameters
    ----------
    reduction : Reduction
        Of the equations.
    noise : float or array_like, shape (b + 1,)
        One number: deviation of the noise of every column relative to its root mean square, those
        of dry friction and offsets left out; that of the torque is then what the residuals of
        weighted least squares have besides. Or the deviations of each column and, last, of the
        torque, all in SI units; 0 for what is exact.

    Returns
    -------
    TotalEstimate
        The covariance holds for small, white noise; ``solution`` says whether there is one.

    Raises
    ------
    InvalidValueError, ShapeError
        Negative noise; noise of the torque that is zero; fewer equations than parameters.

    References
    ----------
    S. Van Huffel and J. Vandewalle, "The Total Least Squares Problem", SIAM 1991, sections 3.4 and
    3.5 (mixed problems); W. Fuller, "Measurement Error Models", Wiley 1987, section 2.3
    (covariance); M. Gautier, P.-O. Vandanjon and C. Presse, "Identification of inertial and drive
    gain parameters of robots", IEEE CDC 1994.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> A = rng.normal(size=(900, 2))
    >>> y = A @ [2.0, -1.0] + 0.02 * rng.normal(size=900)
    >>> R = np.linalg.qr(np.column_stack((A + 0.4 * rng.normal(size=A.shape), y)), mode="r")
    >>> reduction = Reduction(("XX1", "XY1"), (R,), np.array([900]), np.array([0]))
    >>> weighted(reduction).values.round(1), total(reduction, [0.4, 0.4, 0.02]).values.round(1)
    (array([ 1.7, -0.9]), array([ 2., -1.]))
    """
    check_count(reduction)
    start = weighted(reduction)
    b, rows = len(start.values), reduction.rows
    weights = weights_of(ordinary(reduction).sigma, reduction)
    R, y, rest = reduction.stacked(weights)
    levels, notes = _levels(reduction, (R, y, rest), noise, weights, start.values)
    whole = np.vstack((np.column_stack((R, y)), np.r_[np.zeros(b), np.sqrt(rest)]))
    exact = np.flatnonzero(levels[:b] == 0.0)
    noisy = np.flatnonzero(levels[:b] > 0.0)
    order = np.r_[exact, noisy, b]
    T = np.asarray(np.linalg.qr(whole[:, order], mode="r"))
    e = len(exact)
    part = np.concatenate((noisy, [b]))
    _, s, Vt = np.linalg.svd(T[e:, e:] / levels[part])
    scale = float(s[-1]) / np.sqrt(rows - b)
    direction = Vt[-1]
    if abs(direction[-1]) < _GENERIC:
        return TotalEstimate(
            Method.TLS, reduction.names, start.values, start.covariance, start.sigma,
            start.status, 1, (*notes, TotalStatus.NOT_GENERIC.sentence),
            noise=levels, scale=scale, solution=TotalStatus.NOT_GENERIC,
        )  # fmt: skip
    values = np.empty(b)
    values[noisy] = -direction[:-1] / direction[-1] * levels[b] / levels[noisy]
    # exact columns follow from the rows that they alone have
    right = T[:e, -1] - T[:e, e:-1] @ values[noisy]
    values[exact] = np.linalg.solve(T[:e, :e], right) if e else 0.0
    solution = TotalStatus.GENERIC
    if len(s) > 1 and s[-1] > _ALIKE * s[-2]:
        solution = TotalStatus.ALIKE
        notes = (*notes, solution.sentence)
    return TotalEstimate(
        Method.TLS, reduction.names, values, _covariance(R, rows, values, levels * scale),
        deviations_of(reduction, values), start.status, 1, notes,
        noise=levels, scale=scale, solution=solution,
    )  # fmt: skip


def _levels(
    reduction: Reduction, system: tuple[Array, Array, float], noise: ArrayLike, weights: Array,
    values: Array,
) -> tuple[Array, tuple[str, ...]]:  # fmt: skip
    """Deviations of the noise of columns and torque, in weighted equations."""
    given = as_floats(noise, "noise")
    R, y, rest = system
    b = len(values)
    if given.shape not in ((), (b + 1,)):
        raise ShapeError(
            f"noise: expected one relative deviation, or the deviations of the {b} columns and of "
            f"the torque, shape ({b + 1},), got {given.shape}."
        )
    if (given < 0.0).any():
        raise InvalidValueError(f"noise: expected no negative deviation, got {given.min():g}.")
    counts = reduction.counts
    if given.ndim:
        # weights of the kinds differ: their mean, as far as each takes part
        mean = np.sqrt(float((counts * weights**2).sum()) / reduction.rows)
        if not given[-1] > 0.0:
            raise InvalidValueError(
                "noise: the last number is the deviation of the torque's noise, and is positive."
            )
        return given * mean, ()
    levels = np.append(given * np.linalg.norm(R, axis=0) / np.sqrt(reduction.rows), 1.0)
    constant = [name.startswith(_CONSTANT) for name in reduction.names]
    levels[:-1][constant] = 0.0
    explained = float(((levels[:-1] * values) ** 2).sum())
    if explained < 0.99:
        levels[-1] = np.sqrt(1.0 - explained)
        return levels, ()
    levels[-1] = float(given) * np.sqrt((float(y @ y) + rest) / reduction.rows)
    return levels, (
        f"noise: {float(given):g} of every column would be more than all residuals; the torque has "
        "been given the same relative noise.",
    )


def _covariance(R: Array, rows: int, values: Array, noise: Array) -> Array:
    """Of small white noise in columns and torque, to the first order and the noise's square."""
    from scipy.linalg import cho_factor, cho_solve

    b = len(values)
    size = np.linalg.norm(R, axis=0) / np.sqrt(rows)
    own = noise[:b] / size
    x = values * size
    Q = R / size
    M = Q.T @ Q / rows - np.diag(own**2)
    residual = float(noise[b] ** 2 + (own * x) @ (own * x))
    cross = -(own**2) * x
    middle = residual * (M + np.diag(own**2)) - np.outer(cross, cross)
    try:
        factor = cho_factor(M)
    except np.linalg.LinAlgError:  # noise as large as a column: nothing is known of it
        return np.full((b, b), np.inf)
    inverse = cho_solve(factor, np.eye(b))
    return inverse @ middle @ inverse / rows / np.outer(size, size)
