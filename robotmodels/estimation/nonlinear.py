"""Nonlinear least squares: Gauss-Newton steps with damping, whole measurements weighted by a loss.

Each step solves ``min |J dx + r|`` over columns scaled to length 1, through a triangular factor of
``[J r]`` and the singular values of the triangle. So the condition is not squared, as it is by
normal equations, and damping, truncation and statistics cost nothing more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_floats
from .._choices import chosen
from ..errors import InvalidValueError, ShapeError
from .losses import Loss, loss_terms, median_length, robust_scale, tuning
from .nonlinear_fit import FitStatus, NonlinearFit
from .prior import Prior
from .spread import spread

Linearise = Callable[[Array], tuple[Array, Array]]

_SINGULAR = 1e-13
"""Relative singular value under which a direction has no effect but rounding."""


def fit_nonlinear(
    linearise: Linearise,
    x0: ArrayLike,
    *,
    sigma: ArrayLike = 1.0,
    block: ArrayLike | None = None,
    loss: Loss | str = Loss.SQUARES,
    prior: Prior | None = None,
    sigma_known: bool = False,
    truncation: float | None = None,
    damping: float = 0.0,
    tolerance: float = 1e-12,
    iterations: int = 100,
) -> NonlinearFit:
    """Fit parameters to residuals.

    Parameters
    ----------
    linearise : callable
        ``linearise(x) -> (r, J)``: residual rows (M,), model minus measurement, and their
        derivatives (M, P).
    x0 : array_like, shape (P,)
        Where to start.
    sigma : array_like, scalar or shape (M,)
        Standard deviations of the rows, in their units; they weight rows of different kinds.
    block : array_like of int, shape (M,), optional
        Number of the measurement that each row belongs to; default each row its own.
    loss : Loss or str
        How much long residuals count. A loss other than squares acts on the length of a whole
        measurement, relative to a scale from the median.
    prior : Prior, optional
        Gaussian prior of the parameters: the fit is the maximum a posteriori.
    sigma_known : bool
        Whether ``sigma`` is the truth. By default it is right up to a factor, which is estimated.
    truncation : float, optional
        Drop directions whose singular value relative to the largest (columns scaled to length 1) is
        smaller: the parameters do not move along them.
    damping : float
        Levenberg-Marquardt factor of the first step; 0 is Gauss-Newton. It rises when a step fails.
    tolerance : float
        Largest last step relative to the parameters, both scaled by the columns.
    iterations : int
        Largest number of steps.

    Returns
    -------
    NonlinearFit
        Estimate, covariance, weights, outliers and status.

    Raises
    ------
    ShapeError, InvalidValueError
        Shapes that do not fit, deviations that are not positive, NaN in rows or Jacobian at x0.

    References
    ----------
    Seed book section 1.4.4.3; J. J. More, "The Levenberg-Marquardt algorithm", Lecture Notes in
    Mathematics 630, 1978; R. A. Maronna et al., "Robust Statistics", 2nd ed., 2019, section 5.

    Examples
    --------
    >>> t = np.linspace(0.0, 1.0, 20)
    >>> y = 2.0 * np.exp(-3.0 * t)
    >>> def linearise(x):
    ...     e = np.exp(-x[1] * t)
    ...     return x[0] * e - y, np.column_stack((e, -x[0] * t * e))
    >>> fit = fit_nonlinear(linearise, [1.0, 1.0])
    >>> fit.x.round(9), fit.status.sentence
    (array([2., 3.]), 'The fit has converged: further steps are rounding.')
    """
    problem = _Problem.checked(linearise, x0, sigma, block, prior)
    loss = chosen(Loss, loss, "loss")
    threshold = _SINGULAR if truncation is None else _share(truncation)
    budget = _Budget(_count(iterations), _nonnegative(damping, "damping"))
    tolerance = _nonnegative(tolerance, "tolerance")
    point = problem.at(as_exact(x0, (problem.parameters,), "x0"))
    if loss is not Loss.SQUARES:
        point = _robust_start(problem, point, threshold, budget, sigma_known)
    point, status = _minimised(problem, point, loss, threshold, budget, tolerance)
    raise NotImplementedError
