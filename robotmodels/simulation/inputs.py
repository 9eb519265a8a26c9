"""The border of a simulation: times, laws of torque and wrench, tolerances."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, nextafter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats, as_vector
from ..errors import InvalidValueError, ShapeError

Law = Callable[[float, Array, Array], ArrayLike]
"""Torques or a wrench at time t, positions q and velocities v."""

_NO_KNOTS = np.empty(0)


@dataclass(frozen=True, slots=True)
class Table:
    """Values at times, linear between them. Shapes: t (N,), values (N, k)."""

    t: Array
    values: Array

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Value at a time."""
        k = int(np.searchsorted(self.t, t, side="right")) - 1
        k = min(max(k, 0), len(self.t) - 2)
        s = (t - self.t[k]) / (self.t[k + 1] - self.t[k])
        return (1.0 - s) * self.values[k] + s * self.values[k + 1]


@dataclass(frozen=True, slots=True)
class Constant:
    """The same values always. Shapes: values (k,)."""

    values: Array

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """The values."""
        return self.values


@dataclass(frozen=True, slots=True)
class Checked:
    """Law of the caller with checked values."""

    law: Law
    size: int
    name: str

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """The law's answer."""
        try:
            answer = self.law(t, q.copy(), v.copy())
        except Exception as error:
            error.add_note(f"Raised by {self.name}(t, q, v) at t = {t:.9g} s.")
            raise
        try:
            value = np.asarray(answer)
        except ValueError:  # rows of several lengths
            value = None
        if value is None or value.shape != (self.size,):
            came = "None" if answer is None else f"{answer!r:.60}"
            if value is not None and answer is not None:
                came = f"shape {value.shape}: {came}"
            raise ShapeError(
                f"{self.name}: expected {_call(self.name, self.size)}, got {came} at t = {t:.9g} s."
            )
        if value.dtype != np.float64 or not isfinite(sum(value.tolist())):
            return as_floats(value, f"{self.name} at t = {t:.9g} s")
        return value


def as_law(law: Law | ArrayLike | None, size: int, t: Array | None, name: str) -> Any:
    """A law from what the caller gave, and the times at which it has kinks.

    Shapes: law (size,) or (N, size), t (N,).
    """
    if law is None:
        return None, _NO_KNOTS
    if callable(law):
        _check_signature(law, size, name)
        return Checked(law, size, name), _NO_KNOTS
    values = as_floats(law, name)
    if values.shape == (size,):
        return Constant(values.copy()), _NO_KNOTS
    if values.ndim == 2 and t is None:
        raise ShapeError(
            f"{name}: rows of values belong to the times t, but t is a duration; give the times, "
            f"or a function {_call(name, size)}."
        )
    if t is None or values.shape != (len(t), size):
        rows = "" if t is None else f", or ({len(t)}, {size}) for the times t"
        raise ShapeError(
            f"{name}: expected a function {_call(name, size)}, or an array of shape "
            f"({size},){rows}; got shape {values.shape}."
        )
    if len(t) == 1:
        return Constant(values[0].copy()), _NO_KNOTS
    return Table(t, values.copy()), t[1:-1]


def _call(name: str, size: int) -> str:
    return f"{name}(t, q, v) -> ({size},)"


def _check_signature(law: Any, size: int, name: str) -> None:
    try:
        signature = inspect.signature(law)
    except (TypeError, ValueError):  # some compiled functions do not tell
        return
    try:
        signature.bind(0.0, _NO_KNOTS, _NO_KNOTS)
    except TypeError:
        what = getattr(law, "__name__", type(law).__name__)
        raise InvalidValueError(
            f"{name}: expected a function {_call(name, size)} of time (s), positions and "
            f"velocities, got {what}{signature}, which does not take these three arguments."
        ) from None


def as_times(t: ArrayLike) -> tuple[float, float, Array | None]:
    """Start, end, and the times of the samples if the caller gave them. Shapes: -> times (N,)."""
    times = as_floats(t, "t")
    if times.ndim == 0:
        if times < 0.0:
            raise InvalidValueError(f"t: expected a duration that is not negative, got {times} s.")
        return 0.0, float(times), None
    if times.ndim != 1 or not times.size:
        raise ShapeError(
            f"t: expected a duration, or times of shape (N,) with N at least 1, got {times.shape}."
        )
    falls = times[1:] <= times[:-1]
    if falls.any():
        k = int(np.flatnonzero(falls)[0])
        raise InvalidValueError(
            f"t: expected ascending times, got {times[k]} s and then {times[k + 1]} s at [{k + 1}]."
        )
    return float(times[0]), float(times[-1]), times.copy()


def as_state(values: ArrayLike, n: int, name: str) -> Array:
    """One state of the joints."""
    array = as_vector(values, n, name)
    if array.ndim != 1:
        raise ShapeError(
            f"{name}: expected one state of shape ({n},), got {array.shape}; simulate several "
            "one after the other."
        )
    return array.copy()


def as_positive(value: Any, name: str, infinite: bool = False) -> float:
    """One positive number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not number > 0.0 or (np.isinf(number) and not infinite):
        raise InvalidValueError(f"{name}: expected a positive number, got {value!r:.60}.")
    return number


def before(t: float, start: float) -> float:
    """The last instant before t, not before the start."""
    return max(nextafter(t, start), start)
