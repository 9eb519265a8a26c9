"""Sliding modes of first and higher order, and their scalar laws.

The surface is ``s = e' + slope e`` with ``e = q_d - q``. With a model the torque is that of the
acceleration ``q_d'' + slope e' + u``, so that ``s' = -u`` up to disturbances, with u in rad/s^2
(m/s^2); without one the torque is u itself, in N m (N).

Parameters
----------
reference, model
    See `robotmodels.control`; reference None is the scalar law alone, for `first_order`.
slope : float or array_like
    Rate at which the error vanishes on the surface, 1/s.
gain, layer : float or array_like
    Of the first order: larger than every disturbance, in the unit of u; half width of the boundary
    layer, rad/s (m/s), of which 0 switches, and needs a sampling period.
k1, k2 : float or array_like
    Gains of the root and of the integral of super-twisting.
law : SlidingMode, SuperTwisting or callable
    Of `first_order`: a law, whose integral starts at zero, or a function of s.
s0 : array_like, shape (...)
    Start, of any shape: all entries are independent.
disturbance : callable or array_like, optional
    Function of t, or constant; its values broadcast with s0, as the gains do.
t, step : float
    Duration and step, s.

Returns
-------
ndarray, shape (N + 1, ...)
    s at the multiples of the step, N = t / step.

References
----------
Book sections 5.2.6 and 5.2.7; A. Levant, Int. J. Control 58(6), 1993 (super-twisting).

Examples
--------
>>> SlidingMode([0.0], slope=5.0, gain=2.0, layer=0.1).command(0.0, [0.01], [0.0])
array([-1.])
>>> first_order(SlidingMode(None, slope=1.0, gain=2.0), 1.0, 0.5, t=1.0, step=0.25)
array([ 1.   ,  0.625,  0.25 , -0.125,  0.5  ])
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats, as_number, as_reals
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel
from .joint_laws import SurfaceLaw
from .law import NONE, model_torques

_MOST_STEPS = 10_000_000


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Sliding(SurfaceLaw):
    """Parts of both laws."""

    def _begin(self: Any, gains: tuple[str, ...]) -> None:
        if self.reference is not None:
            self._prepare(gains, self.model, zero="layer")
        else:  # the scalar law alone
            self._set(n=None, _desired=None)
            self._keep_gains(gains, None, "layer")

    def _torques(self: Any, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        v_r, a_r = self._rates(t, q, v)
        u = -self.reaching(v_r - v, x)[0]
        return u if self.model is None else model_torques(self.model, q, v, a_r + u)

    def _rate(self: Any, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        return self.reaching(self._rates(t, q, v)[0] - v, x)[1]

    def _measured(self: Any, *values: Any) -> tuple[Array, ...]:
        if self.reference is None:
            raise InvalidValueError("reference: a law for a robot needs one, this one is scalar.")
        return SurfaceLaw._measured(self, *values)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SlidingMode(_Sliding):
    """Sliding mode of first order: ``u = gain sign(s)``, with a layer ``gain sat(s / layer)``."""

    reference: Any
    slope: Any
    gain: Any
    layer: Any = 0.0
    model: RobotModel | None = None

    def __post_init__(self) -> None:
        self._begin(("slope", "gain", "layer"))

    @property
    def switches(self) -> bool:
        """Whether a layer is missing."""
        return not np.all(self.layer)

    def reaching(self, s: Array, x: Array) -> tuple[Array, Array]:
        """``s'`` by the law alone, and no rate of a state."""
        with np.errstate(divide="ignore", invalid="ignore"):
            inside = np.clip(s / self.layer, -1.0, 1.0)
        return -self.gain * np.where(np.asarray(self.layer) > 0.0, inside, np.sign(s)), NONE


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SuperTwisting(_Sliding):
    """Sliding mode of second order: ``u = k1 sqrt(|s|) sign(s) + x``, ``x' = k2 sign(s)``.

    It needs a sampling period. For disturbances with rates up to L, ``k1 = 1.5 sqrt(L)`` and
    ``k2 = 1.1 L`` (Levant).
    """

    reference: Any
    slope: Any
    k1: Any
    k2: Any
    model: RobotModel | None = None
    state0: Array = field(init=False)

    switches = True

    def __post_init__(self) -> None:
        self._begin(("slope", "k1", "k2"))
        self._set(state0=np.zeros(self.n or 1))

    def reaching(self, s: Array, x: Array) -> tuple[Array, Array]:
        """``s'`` by the law alone, and the rate of its integral."""
        way = np.sign(s)
        return -self.k1 * np.sqrt(np.abs(s)) * way - x, self.k2 * way


def first_order(
    law: SlidingMode | SuperTwisting | Callable[[Array], ArrayLike],
    s0: ArrayLike,
    disturbance: Callable[[float], ArrayLike] | ArrayLike | None,
    t: float,
    step: float,
) -> Array:
    """Scalar sliding mode ``s' = law(s) + disturbance(t)`` by explicit Euler steps."""
    h, end = as_number(step, "step", above=0.0), as_number(t, "t", least=0.0)
    if end / h > _MOST_STEPS:
        raise InvalidValueError(f"step: {h:.3g} s would take more than {_MOST_STEPS} steps.")
    s = as_floats(s0, "s0")
    x, out = np.zeros(s.shape), np.empty((round(end / h) + 1, *s.shape))
    if not isinstance(law, _Sliding) and not callable(law):
        raise InvalidValueError(
            f"law: expected a sliding mode or a function of s, got {type(law).__name__}."
        )
    constant = 0.0 if disturbance is None else disturbance
    push: Any = disturbance if callable(disturbance) else lambda t: constant
    given: Any = law
    own: Any = given.reaching if isinstance(law, _Sliding) else lambda s, x: (given(s), NONE)
    out[0] = s
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        for k in range(1, len(out)):
            rate, change = own(s, x)
            s = s + h * (as_reals(rate, "law(s)") + as_reals(push((k - 1) * h), "disturbance"))
            if s.shape != x.shape:
                raise ShapeError(
                    f"law, disturbance: expected one number or shape {x.shape}, that of s0, got "
                    f"{s.shape}."
                )
            out[k], x = s, x + h * change if change.size else x
    if not np.isfinite(out).all():
        raise InvalidValueError("law, disturbance: s is not finite; expected finite values.")
    return out
