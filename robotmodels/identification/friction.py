"""Friction curves that are not linear in their parameters: Stribeck friction, friction by load.

Both are fitted together with the base parameters and drives by one nonlinear least-squares fit on
triangular factors of the columns and residuals at each point; a test of each joint's curve follows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, as_floats
from .._outcomes import Outcome
from ..errors import InvalidValueError
from ..estimation import column_basis
from ..estimation.covariance import correlated_covariance
from ..estimation.factor import TriangularFactors
from ..estimation.linear import check_count, residual_noise
from ..friction import LoadFriction, StribeckFriction
from ..inertia import PARAMETERS
from ..logs import Log
from ..minimal_parameters import BaseParameters
from ..model import RobotModel, check_model
from .equations import Equations, parameters_of, reduce_equations
from .forms import FormedRows
from .loads import (
    UNIDENTIFIABLE,
    CommonEquations,
    NamedEstimate,
    column_lengths,
    equations_of,
    scaled_inverse,
)
from .signals import Processing

_Curve = Callable[[Array, Array, Array, Array], tuple[Array, Array, Array]]
"""From W (k, n, b), velocities, b parameters and curve parameters (n, c): W with the slopes of the
torque, columns of the curve parameters (k, n, c), torque of the curve (k, n)."""
_GRID = 16  # Stribeck velocities that are tried first, for each joint and exponent
_SOLVER: dict[str, Any] = {"x_scale": "jac", "xtol": 1e-9, "ftol": 1e-11, "gtol": None}
_SIGNIFICANT = 1e-3  # significance level of a friction curve


class FrictionStatus(Outcome):
    """Outcome of a fit of friction curves."""

    SOLVED = 0, "The significant friction curves fit the log best."
    INSIGNIFICANT = 1, "No joint has significant friction beyond viscous and Coulomb friction."
    NOT_CONVERGED = 2, "The iterations ended before the parameters converged; use them with care."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FrictionFit(NamedEstimate):
    """Base parameters and friction curves; see `fit_friction`."""

    base: BaseParameters
    names: tuple[str, ...]
    values: Array
    covariance: Array
    friction: StribeckFriction | LoadFriction
    p_value: Array
    sigma: Array
    status: FrictionStatus

    @property
    def significant(self) -> NDArray[np.bool_]:
        """Joints whose curve is significant, shape (n,)."""
        return self.p_value < _SIGNIFICANT

    @property
    def notes(self) -> tuple[str, ...]:
        """Joints whose curve is not significant."""
        return tuple(
            f"This friction is not significant at joint {j + 1} (p = {self.p_value[j]:.2g})."
            for j in np.flatnonzero(~self.significant)
        )


def fit_friction(
    model: RobotModel,
    log: Log,
    curve: Literal["stribeck", "load"] = "stribeck",
    *,
    exponents: Sequence[float] = (2.0,),
    base: BaseParameters | None = None,
    processing: Processing | None = None,
) -> FrictionFit:
    """Fit Stribeck friction or load-dependent friction with base parameters and drives.

    Stribeck friction adds ``drop exp(-|v / vs|^exponent) sign(v)`` to viscous and Coulomb friction,
    ``drop = Fs - Fc``; load-dependent friction adds ``Fl |load| sign(v)``, where the load is the
    torque of the links' identified parameters.

    Parameters
    ----------
    model, log, processing
        As for `fit`; with slow motion outside of the dead band, or with different loads.
    curve : {"stribeck", "load"}
        The friction.
    exponents : sequence of float
        Exponents of Stribeck's curve that are tried, such as ``(1.0, 2.0)``.
    base : BaseParameters, optional
        With Coulomb friction; default all drive parameters.

    Returns
    -------
    FrictionFit
        ``.names, .values, .standard_errors, .covariance`` of the identifiable base parameters and
        of ``Fl`` of each joint, or of ``drop`` and ``vs`` where the curve is significant, with the
        number of the frame (``.value("vs2")``); ``.friction`` for simulation, without the curves
        that are not significant; ``.significant`` and ``.p_value`` (chi-squared tests; 1 for
        negative curves) and ``.sigma`` (residual standard deviation) of each joint; ``.status``,
        ``.notes``.

    References
    ----------
    Book section 1.5.1.4; B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, Automatica
    30(7), 1994, section 2; P. Hamon, M. Gautier and P. Garrec, "Dynamic identification of robots
    with a dry friction model depending on load and velocity", IEEE/RSJ IROS 2010, section III.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> arm, log = example_log()
    >>> fit_friction(arm, log).status.name  # the example has no Stribeck friction
    'INSIGNIFICANT'
    """
    check_model(model)
    if curve not in ("stribeck", "load"):
        raise InvalidValueError(f"curve: expected 'stribeck' or 'load', got {curve!r:.60}.")
    powers = as_floats(exponents, "exponents").reshape(-1)
    if not powers.size or (powers <= 0.0).any():
        raise InvalidValueError(f"exponents: expected positive numbers, got {exponents!r:.60}.")
    base = parameters_of(model, base, True)
    if not any(name.rstrip("0123456789") == "Fc" for name in base.names):
        raise InvalidValueError(
            "base: expected Fc among its parameters, to which the friction is added; request "
            "base_parameters(model, drive=True)."
        )
    (system,) = equations_of(base, (log,), processing)
    factors = reduce_equations(system)
    check_count(factors)
    identifiable = column_basis(factors.stacked()[0], negligible=UNIDENTIFIABLE).kept
    system = system.with_names(tuple(base.names[k] for k in identifiable))
    return _fit_load(system) if curve == "load" else _fit_stribeck(system, powers)


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """A point of the fit: b parameters and c of each joint's curve, of which some are free.

    Shapes: x (b + n c,), free (f,) numbers of its entries, limits (2, b + n c).
    """

    system: Equations
    curve: _Curve
    x: Array
    free: NDArray[np.int64]
    limits: Array

    @property
    def first(self) -> NDArray[np.int64]:
        """Entries of the first curve parameter of each joint, shape (n,)."""
        b, n = len(self.system.names), self.system.model.n
        return np.arange(b, len(self.x), (len(self.x) - b) // n)

    def at(self, part: Array) -> _Point:
        """The point with other values of the free parameters."""
        x = self.x.copy()
        x[self.free] = part
        return replace(self, x=x)

    def tangents(self) -> CommonEquations:
        """Columns of the free parameters, and the residuals as the measured side."""
        b, n = len(self.system.names), self.system.model.n
        theta, curves = self.x[:b], self.x[b:].reshape(n, -1)

        def form(W: Array, tau: Array, v: Array, use: NDArray[np.bool_]) -> FormedRows:
            changed, columns, torque = self.curve(W, v, theta, curves)
            by_joint = np.zeros((len(W), n, *curves.shape))
            by_joint[:, range(n), range(n)] = columns
            whole = np.concatenate((changed, by_joint.reshape(len(W), n, -1)), axis=2)
            return np.take(whole, self.free, axis=2), tau - W @ theta - torque, use

        return CommonEquations((self.system,), tuple(map(str, self.free)), (None,), form)

    def linear(self, weights: Array | None = None) -> tuple[TriangularFactors, Array, Array, Array]:
        """Reduced tangents, weights, and the rows ``R step = e`` of all joints together."""
        factors = self.tangents().reduced()
        weights = 1.0 / residual_noise(factors) if weights is None else weights
        R, e, rest = factors.stacked(weights)
        return factors, weights, np.vstack((R, 0.0 * R[:1])), np.append(e, np.sqrt(rest))

    def fitted(self) -> tuple[_Point, bool]:
        """Least squares of the free parameters that are independent, with this point's weights."""
        from scipy.optimize import least_squares

        _, weights, R, _ = self.linear()
        basis = column_basis(R / column_lengths(R), negligible=UNIDENTIFIABLE)
        point = replace(self, free=self.free[basis.kept])

        @lru_cache(maxsize=1)
        def at(part: bytes) -> tuple[Array, Array]:
            # rows up to a rotation, which no step of a trust region depends on
            _, _, R, e = point.at(np.frombuffer(part)).linear(weights)
            return e, -R

        solution = least_squares(
            lambda x: at(x.tobytes())[0],
            point.x[point.free],
            bounds=tuple(point.limits[:, point.free]),
            **{**_SOLVER, "jac": lambda x: at(x.tobytes())[1]},
        )
        return point.at(solution.x), solution.status > 0

    def tested(self, p_value: Array) -> tuple[_Point, Array]:
        """The point without insignificant curves, and the covariance; p-values are written."""
        from scipy.stats import chi2

        _, weights, R, _ = self.linear()
        half, none = scaled_inverse(R), np.zeros(len(self.free))
        inverse = half @ half.T
        covariance = correlated_covariance(self.tangents(), none, weights, inverse).covariance
        variance = np.maximum(np.diag(covariance), np.diag(inverse))  # not below rounding
        x, free = self.x.copy(), self.free
        c = (len(x) - self.first[0]) // len(self.first)
        for j, first in enumerate(self.first):
            columns = np.arange(first, first + c)
            if np.isin(columns, self.free).all():
                k, size = np.searchsorted(self.free, first), x[first]
                tested = size > 0.0 and R[:, k].any()
                p_value[j] = chi2.sf(size**2 / variance[k], c) if tested else 1.0
            # without a curve its velocity is undetermined
            if c > 1 and p_value[j] >= _SIGNIFICANT:
                x[first] = 0.0
                free = np.setdiff1d(free, columns)
        return replace(self, x=x, free=free), covariance


def _point(system: Equations, curve: _Curve, curves: Array) -> _Point:
    """A point with free parameters, those of the curves given. Shapes: curves (n, c)."""
    x = np.append(np.zeros(len(system.names)), curves)
    limits = np.full((2, len(x)), [[-np.inf], [np.inf]])
    return _Point(system, curve, x, np.arange(len(x)), limits)


def _stribeck(exponent: Array) -> _Curve:
    """Stribeck friction by the drop and vs of each joint."""

    def curve(W: Array, v: Array, theta: Array, x: Array) -> tuple[Array, Array, Array]:
        (drop, vs), ratio = x.T, np.minimum((np.abs(v) / x[:, 1]) ** exponent, 700.0)
        column = np.exp(-ratio) * np.sign(v)
        return W, np.stack((column, drop * column * ratio * exponent / vs), axis=2), drop * column

    return curve


def _by_load(links: NDArray[np.bool_]) -> _Curve:
    """Load-dependent friction by the load part of each joint. Shapes: links (b,)."""

    def curve(W: Array, v: Array, theta: Array, x: Array) -> tuple[Array, Array, Array]:
        load = W @ np.where(links, theta, 0.0)
        column = np.abs(load) * np.sign(v)
        share = x[:, 0] * np.sign(load) * np.sign(v)
        changed = W + share[:, :, None] * np.where(links, W, 0.0)
        return changed, column[:, :, None], x[:, 0] * column

    return curve


def _fit_stribeck(system: Equations, powers: Array) -> FrictionFit:
    """Best Stribeck curve of each joint on a grid of velocities and exponents, then refined."""
    n, b, log = system.model.n, len(system.names), system.log
    speed = np.abs(np.diff(log.q, axis=0)) / log.dt if log.v is None else np.abs(log.v)
    fast = np.maximum(np.percentile(speed, 95.0, axis=0), 1e-12)
    high = 0.5 * fast
    low = np.minimum(np.maximum(system.processing.dead_band, 1e-3 * fast), 0.5 * high)
    grid = low[:, None] * (high / low)[:, None] ** np.linspace(0.0, 1.0, _GRID)
    vs, exponent = np.tile(grid, len(powers)), np.repeat(powers, _GRID)
    c = vs.shape[1]

    def all_curves(W: Array, v: Array, theta: Array, x: Array) -> tuple[Array, Array, Array]:
        decay = np.exp(-((np.abs(v)[:, :, None] / vs) ** exponent))
        return W, decay * np.sign(v)[:, :, None], 0.0 * v

    _, _, R, y = _point(system, all_curves, np.zeros((n, c))).linear()
    tried = np.column_stack((R[:, b:], y))
    tried -= R[:, :b] @ (scaled_inverse(R[:, :b]) @ tried)
    gain = np.abs(tried[:, -1] @ tried[:, :-1]) / column_lengths(tried[:, :-1])
    best = gain.reshape(n, c).argmax(axis=1)
    start = _point(
        system, _stribeck(exponent[best]), np.column_stack((0.0 * high, vs[range(n), best]))
    )
    columns = [*range(b), *(b + c * np.arange(n) + best)]
    start.x[[*range(b), *start.first]] = scaled_inverse(R[:, columns]) @ y
    start.limits[:, b + 1 :: 2] = 0.1 * low, 4.0 * high
    p_value = np.ones(n)
    start, _ = start.tested(p_value)  # a curve of zero has no velocity
    return _refined(start, p_value, exponent[best])


def _fit_load(system: Equations) -> FrictionFit:
    """Load-dependent friction, from the fit without it."""
    n, b = system.model.n, len(system.names)
    links = np.array([name.rstrip("0123456789") in PARAMETERS for name in system.names])
    start = _point(system, _by_load(links), np.zeros((n, 1)))
    _, _, R, y = start.linear()
    start.x[:b] = scaled_inverse(R[:, :b]) @ y
    return _refined(start, np.ones(n), np.zeros(0))


def _refined(point: _Point, p_value: Array, exponent: Array) -> FrictionFit:
    """Best fit from a start."""
    before = None
    while True:
        found, converged = point.fitted()
        # a curve that compensated an error of another joint's curve becomes insignificant
        point, covariance = found.tested(p_value)
        if len(point.free) == len(found.free) == before:
            break
        before = len(point.free)
    factors = point.linear()[0]
    sigma = np.sqrt(factors.sums(np.zeros(len(point.free))) / np.maximum(factors.counts, 1))
    system, base = point.system, point.system.base
    frames = [int(row) + 1 for row in base.model.table.joint_rows]
    kinds = ("drop", "vs") if exponent.size else ("Fl",)
    names = [*system.names, *(f"{kind}{j}" for j in frames for kind in kinds)]
    names, values = tuple(names[k] for k in point.free), point.x[point.free]
    known = dict(zip(names, values.tolist(), strict=True))
    parts = {k: np.array([known.get(f"{k}{j}", 0.0) for j in frames]) for k in ("Fv", "Fc", *kinds)}
    significant = p_value < _SIGNIFICANT
    if exponent.size:
        # negative by noise: zero
        Fv, Fc, drop = (np.maximum(parts[kind], 0.0) for kind in ("Fv", "Fc", "drop"))
        vs = np.where(significant, parts["vs"], 1.0)
        friction = StribeckFriction(Fv, Fc, Fc + drop, vs, exponent)
    else:
        friction = LoadFriction(parts["Fl"])
    status = FrictionStatus.SOLVED if converged else FrictionStatus.NOT_CONVERGED
    status = status if significant.any() else FrictionStatus.INSIGNIFICANT
    return FrictionFit(base, names, values, covariance, friction, p_value, sigma, status)
