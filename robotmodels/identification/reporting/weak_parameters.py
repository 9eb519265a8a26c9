"""Parameters that an identification does not show well: not seen, correlated, of a wrong sign."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import Array
from ...estimation.correlation import correlated_pairs
from ...minimal_parameters import BaseParameters
from ..methods.estimate import Estimate

if TYPE_CHECKING:
    from ..result import IdentificationResult

STRONG = 0.9
"""Correlation from which a pair of estimates is named."""
NOT_SEEN = 0.3
"""Relative deviation from which a parameter counts as not seen."""


@dataclass(frozen=True, slots=True)
class WrongSign:
    """A parameter that is negative although it cannot be.

    Parameters
    ----------
    name : str
        The base parameter.
    value, deviation : float
        SI units.
    terms : tuple of str
        What it is a sum of: none of these can be negative.
    """

    name: str
    value: float
    deviation: float
    terms: tuple[str, ...]

    @property
    def certain(self) -> bool:
        """Whether noise does not explain it: it is more than two deviations below zero."""
        return self.value < -2.0 * self.deviation

    @property
    def sentence(self) -> str:
        """What it means, and what to do."""
        what = " + ".join(self.terms[:4]) + (" + ..." if len(self.terms) > 4 else "")
        why = (
            "more than noise explains: something is missing in the model, or the log has wrong "
            "signs or units"
            if self.certain
            else "within its noise: the log does not show it"
        )
        return (
            f"{self.name} = {self.value:.3g} is negative, but {what} cannot be; it is {why}. A "
            "physically consistent fit keeps to what can be."
        )


def wrong_signs(base: BaseParameters, estimate: Estimate) -> tuple[WrongSign, ...]:
    """Parameters that are negative although they are sums of what cannot be.

    Moments of inertia, masses, rotor inertias and frictions, alone or added up.

    Parameters
    ----------
    base : BaseParameters
        What the parameters stand for.
    estimate : Estimate
        Their values.

    Returns
    -------
    tuple of WrongSign
        In the order of the estimate.

    Examples
    --------
    >>> import robotmodels as rm
    >>> from robotmodels.identification import Estimate, Method
    >>> base = rm.base_parameters(rm.load("planar_2r"), drive=("Fv",))
    >>> values = np.where(np.array(base.names) == "Fv2", -1.0, 1.0)
    >>> found = Estimate(Method.OLS, base.names, values, np.eye(len(base)), np.ones(2))
    >>> [(one.name, one.certain) for one in wrong_signs(base, found)]
    [('Fv2', False)]
    """
    from ...minimal_parameters.real_drives import positive_drives

    names = base.parameter_names
    f = base.model.f
    # a fixed order of ten for each frame: XX XY XZ YY YZ ZZ MX MY MZ M
    bodies = [10 * j + k for j in range(f) for k in (0, 3, 5, 9)]
    positive = np.zeros(len(names), dtype=bool)
    positive[[*bodies, *positive_drives(base).tolist()]] = True
    rows = dict(zip(base.names, base.matrix, strict=True))
    found = []
    for name, value, deviation in zip(
        estimate.names, estimate.values.tolist(), estimate.deviations.tolist(), strict=True
    ):
        row = rows[name]
        terms = np.flatnonzero(row)
        if value < 0.0 and positive[terms].all() and (row[terms] > 0.0).all():
            found.append(WrongSign(name, value, deviation, tuple(names[k] for k in terms)))
    return tuple(found)


def strong_correlations(
    estimate: Estimate, least: float = STRONG
) -> tuple[tuple[str, str, float], ...]:
    """Pairs of estimates that the log hardly tells apart, the strongest first.

    Parameters
    ----------
    estimate : Estimate
        Parameters with their covariance.
    least : float
        Magnitude of the correlation from which a pair is named.

    Returns
    -------
    tuple of (str, str, float)
        Names and correlation.

    Examples
    --------
    >>> from robotmodels.identification import Method
    >>> P = np.array([[1.0, 0.95], [0.95, 1.0]])
    >>> strong_correlations(Estimate(Method.OLS, ("Fv1", "Fc1"), np.ones(2), P, np.ones(1)))
    (('Fv1', 'Fc1', 0.95),)
    """
    return correlated_pairs(estimate.correlation, estimate.names, least)


def not_seen(estimate: Estimate, least: float = NOT_SEEN) -> tuple[str, ...]:
    """Parameters whose relative deviation says that the log hardly shows them.

    Parameters
    ----------
    estimate : Estimate
        Parameters with their deviations.
    least : float
        Relative deviation from which they are named.

    Returns
    -------
    tuple of str
        The least seen first.

    References
    ----------
    Seed book section 1.6.2.1: less than ten times the least relative deviation, or 30 %, is usual.

    Examples
    --------
    >>> from robotmodels.identification import Method
    >>> P = np.diag([0.01, 0.25])
    >>> not_seen(Estimate(Method.OLS, ("Fv1", "Fc1"), np.ones(2), P, np.ones(1)))
    ('Fc1',)
    """
    relative = estimate.relative_deviations
    order = np.argsort(-relative, kind="stable")
    return tuple(estimate.names[k] for k in order.tolist() if relative[k] > least)


def understatement(result: IdentificationResult) -> Array:
    """By which factors the deviations of white residuals are too small.

    Parameters
    ----------
    result : IdentificationResult
        Of `fit`.

    Returns
    -------
    ndarray, shape (b,)
        Deviations that take correlation into account over those that do not; NaN where these
        vanish.

    Examples
    --------
    >>> from robotmodels.identification import Log, fit
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> understatement(fit(arm, log, drive=("Fv",))).shape
    (8,)
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(result.white > 0.0, result.deviations / result.white, np.nan)
