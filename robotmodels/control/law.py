"""Parts of all control laws: their defaults, gains, and the model that the controller believes."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Value, as_floats, as_vector, read_only
from ..dynamics import gravity_torque, idm
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel

NONE = read_only([])
NO_WRENCH = read_only(np.zeros(6))
_SLOWEST = 5e-324


class Law(Value):
    """Defaults of control laws: no state, continuous, without a Lyapunov function."""

    __slots__ = ()

    switches = False
    """Whether the torque or the rate of the state jumps: a continuous simulation would stall."""

    @property
    def n(self: Any) -> int:
        """Number of joints."""
        return self.model.n

    @property
    def state0(self) -> Array:
        """State at the start, shape (k,)."""
        return NONE

    def rate(self, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Time derivative of the state, shape (k,)."""
        return NONE

    def lyapunov(self, plant: RobotModel, t: float, q: Array, v: Array, x: Array) -> float | None:
        """Lyapunov function at a state of the plant, None where the law has none."""
        return None

    @property
    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, f.name) for f in fields(self) if f.init)  # type: ignore[arg-type]

    def _set(self, **values: Any) -> None:
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value = read_only(value, value.dtype.type)
            object.__setattr__(self, name, value)

    def _measured(self, q: Any, v: Any, wrench: Any = None) -> tuple[Array, Array, Array]:
        """Positions and velocities (n,), and the wrench (6,), zero without a sensor."""
        f = NO_WRENCH if wrench is None else as_vector(wrench, 6, "wrench")
        return as_vector(q, self.n, "q"), as_vector(v, self.n, "v"), f

    def __repr__(self) -> str:
        shown = []
        for f in fields(self):  # type: ignore[arg-type]
            value = getattr(self, f.name)
            if isinstance(value, np.ndarray) and value.ndim < 2 and value.size <= 7:
                value = value.tolist()
                if isinstance(value, list) and len(value) > 1 and len(set(value)) == 1:
                    value = value[0]
            elif isinstance(value, RobotModel):
                value = value.name
            elif not isinstance(value, (int, float, str, Law)):
                value = None if value is None else type(value).__name__
            if f.init and value is not None:
                shown.append(f"{f.name}={value}")
        return f"{type(self).__name__}({', '.join(shown)})"


def as_gains(value: ArrayLike, name: str, n: int | None = None, zero: bool = False) -> Array:
    """Positive numbers: one, or one for each of n components."""
    gains = as_floats(value, name)
    if gains.ndim > 1 or (gains.ndim == 1 and n is not None and gains.size != n):
        wanted = "(n,)" if n is None else f"({n},)"
        raise ShapeError(f"{name}: expected one number or shape {wanted}, got {gains.shape}.")
    if not ((gains >= 0.0) if zero else (gains > 0.0)).all():
        least = "at least 0" if zero else "above 0"
        raise InvalidValueError(f"{name}: expected gains {least}, got {gains.tolist()}.")
    return gains.copy()


def as_word(value: Any, words: tuple[str, ...], name: str) -> None:
    """Refuse a choice that is not listed."""
    if value not in words:
        wanted = " or ".join(map(repr, words))
        raise InvalidValueError(f"{name}: expected {wanted}, got {value!r:.40}.")


def model_torques(
    model: RobotModel, q: Array, v: Array, a: Array, wrench: ArrayLike | None = None
) -> Array:
    """Inverse dynamics; a joint at rest has the dry friction of its direction of acceleration."""
    return idm(model, q, started(v, a), a, wrench)


def virtual_torques(model: RobotModel, q: Array, v: Array, v_r: Array, a_r: Array) -> Array:
    """``A a_r + C(q, v) v_r + Q`` of the bodies.

    C(q, v) v_r is symmetric in both velocities: a difference of squares of half sums.
    """
    less = idm(model, q, 0.5 * (v - v_r), drive=False) - gravity_torque(model, q)
    return idm(model, q, 0.5 * (v + v_r), a_r, drive=False) - less


def started(v: Array, towards: Array) -> Array:
    """Velocities, the smallest ones in the given direction for joints at rest."""
    return v if v.all() else np.where(v == 0.0, _SLOWEST * np.sign(towards), v)
