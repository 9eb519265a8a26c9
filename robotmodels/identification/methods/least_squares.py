"""Ordinary, weighted and iteratively re-weighted least squares on reduced equations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...errors import InvalidValueError
from ..scale.reduction import Reduction
from .estimate import Estimate, EstimateStatus, Method

_ITERATIONS = 100
_LEFT = 5.0
"""Equations that a kind must have beyond the parameters it determines."""
_STILL = 1e-8
"""Part of its deviation that a parameter moves at most in the last iteration."""


def ordinary(reduction: Reduction) -> Estimate:
    """Ordinary least squares: all equations count alike.

    Parameters
    ----------
    reduction : Reduction
        Of the equations; its columns are independent.

    Returns
    -------
    Estimate
        Its covariance holds if the noise of all joints is alike and white.

    Raises
    ------
    InvalidValueError
        Fewer equations than parameters.

    References
    ----------
    Seed book section 1.6.2.1.

    Examples
    --------
    >>> from robotmodels.identification import (
    ...     Log,
    ...     choose_processing,
    ...     equations,
    ...     reduce_equations,
    ... )
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> system = equations(base, log, choose_processing(log))
    >>> found = ordinary(reduce_equations(system))
    >>> round(float(found.values[found.names.index("Fv2")]), 3)
    2.0
    """
    check_count(reduction)
    values, inverse, rest = solved(reduction, None)
    left = reduction.rows - len(values)
    taken = shares(reduction, None, inverse)
    return Estimate(
        Method.OLS, reduction.names, values, rest / left * inverse,
        deviations_of(reduction, values, taken), notes=few_notes(reduction, taken),
    )  # fmt: skip


def weighted(reduction: Reduction) -> Estimate:
    """Weighted least squares: the equations of each joint by the deviation of its residuals.

    Parameters
    ----------
    reduction : Reduction
        Of the equations.

    Returns
    -------
    Estimate
        Weights are of the residuals of ordinary least squares.

    Raises
    ------
    InvalidValueError
        Fewer equations than parameters.

    References
    ----------
    Seed book section 1.6.2.1; M. Gautier and P. Poignet, "Extended Kalman filtering and weighted
    least squares dynamic identification of robot", Control Engineering Practice 9, 2001.

    Examples
    --------
    >>> from robotmodels.identification import (
    ...     Log,
    ...     choose_processing,
    ...     equations,
    ...     reduce_equations,
    ... )
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> system = equations(base, log, choose_processing(log))
    >>> found = weighted(reduce_equations(system))
    >>> round(float(found.values[found.names.index("Fv2")]), 3)
    2.0
    """
    return _with_weights(reduction, Method.WLS, 1)


def reweighted(reduction: Reduction) -> Estimate:
    """Weighted least squares whose weights are those of its own residuals, by iteration.

    Parameters
    ----------
    reduction : Reduction
        Of the equations.

    Returns
    -------
    Estimate
        The maximum of the likelihood, if the noise of each joint is white and normal.

    Raises
    ------
    InvalidValueError
        Fewer equations than parameters.

    References
    ----------
    A. Janot, M. Gautier, A. Jubien and P.-O. Vandanjon, "Comparison between the CLOE method and the
    DIDIM method for robots identification", IEEE T-CST 22(5), 2014, section II.

    Examples
    --------
    >>> from robotmodels.identification import (
    ...     Log,
    ...     choose_processing,
    ...     equations,
    ...     reduce_equations,
    ... )
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> system = equations(base, log, choose_processing(log))
    >>> found = reweighted(reduce_equations(system))
    >>> round(float(found.values[found.names.index("Fv2")]), 3)
    2.0
    """
    return _with_weights(reduction, Method.IRLS, _ITERATIONS)


def _with_weights(reduction: Reduction, method: Method, most: int) -> Estimate:
    check_count(reduction)
    values, inverse, rest = solved(reduction, None)
    w: Array | None = None
    status = EstimateStatus.SOLVED if most == 1 else EstimateStatus.NOT_CONVERGED
    done = 0
    while done < most:
        done += 1
        before = values
        taken = shares(reduction, w, inverse)
        w = weights_of(deviations_of(reduction, values, taken), reduction)
        values, inverse, rest = solved(reduction, w)
        moved = np.abs(values - before)
        if (moved <= _STILL * np.sqrt(np.diag(inverse)) + 1e-15 * np.abs(values)).all():
            status = EstimateStatus.SOLVED
            break
    scale = rest / (reduction.rows - len(values))
    taken = shares(reduction, w, inverse)
    return Estimate(
        method, reduction.names, values, scale * inverse, deviations_of(reduction, values, taken),
        status, done, few_notes(reduction, taken),
    )  # fmt: skip


def solved(reduction: Reduction, weights: Array | None) -> tuple[Array, Array, float]:
    """Least-squares parameters, inverse information matrix and residual sum of squares.

    Shapes: weights (m,) -> values (b,), inverse (b, b).
    """
    from scipy.linalg import solve_triangular

    R, y, rest = reduction.stacked(weights)
    # columns of like lengths: units of parameters differ by decades
    size = np.linalg.norm(R, axis=0)
    inverse = solve_triangular(R / size, np.eye(len(R))) / size[:, None]
    return inverse @ y, inverse @ inverse.T, rest


def shares(reduction: Reduction, weights: Array | None, inverse: Array) -> Array:
    """Sum of leverages of each kind of equations; their total is the number of parameters.

    Shapes: weights (m,), inverse (b, b) -> (m,).
    """
    w = np.ones(len(reduction.factors)) if weights is None else weights
    parts = (R[:, :-1] * weight for R, weight in zip(reduction.factors, w, strict=True))
    return np.array([float(((R @ inverse) * R).sum()) for R in parts])


def deviations_of(reduction: Reduction, values: Array, taken: Array | None = None) -> Array:
    """Residual standard deviation of each kind of equations."""
    sums, counts = reduction.sums(values), reduction.counts
    if taken is None:
        return np.sqrt(sums / np.maximum(counts * (1.0 - len(values) / reduction.rows), 1e-300))
    left = counts - taken
    few = too_few(reduction, taken)
    pooled = float(sums.sum()) / max(reduction.rows - len(values), 1)
    found = np.where(few, np.maximum(pooled, sums / np.maximum(counts, 1)), 0.0)
    found[~few] = (sums / np.maximum(left, 1e-300))[~few]
    return np.sqrt(np.where(counts > 0, found, 0.0))


def too_few(reduction: Reduction, taken: Array) -> NDArray[np.bool_]:
    """Kinds of equations with too few residual degrees of freedom to estimate their noise."""
    return (reduction.counts > 0) & (reduction.counts - taken < _LEFT)


def few_notes(reduction: Reduction, taken: Array) -> tuple[str, ...]:
    """A sentence for each kind whose residuals tell nothing of its noise."""
    return tuple(
        f"Kind {j + 1} of the equations (joint) has {reduction.counts[j]}, and determines "
        f"{taken[j]:.1f} parameters: its noise is taken as that of all. A longer log, or a smaller "
        "decimation= or dead_band=, gives it more."
        for j in np.flatnonzero(too_few(reduction, taken))
    )


def weights_of(sigma: Array, reduction: Reduction) -> Array:
    """Weights 1 / standard deviation, with a floor at rounding. Shapes: sigma (m,) -> (m,)."""
    if not any(R[:, -1].any() for R in reduction.factors):
        return np.ones(len(reduction.factors))
    size = np.array([np.linalg.norm(R[:, -1]) for R in reduction.factors])
    size = size / np.sqrt(np.maximum(reduction.counts, 1))
    least = max(1e-12 * float(size.max(initial=0.0)), 1e-300)
    return 1.0 / np.maximum(sigma, least)


def used_weights(method: Method, reduction: Reduction) -> Array:
    """Weights with which one of these methods has solved the equations. Shapes: -> (m,)."""
    if method is Method.OLS:
        return np.ones(len(reduction.factors))
    before = ordinary(reduction) if method is Method.WLS else reweighted(reduction)
    return weights_of(before.sigma, reduction)


def check_count(reduction: Reduction) -> None:
    """Refuse fewer equations than parameters."""
    b = len(reduction.names)
    if reduction.rows <= b:
        raise InvalidValueError(
            f"log: {reduction.rows} equations for {b} parameters are too few; give a longer log, a "
            "smaller decimation= or dead_band=, or fewer parameters."
        )
