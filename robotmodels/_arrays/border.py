"""Checks of arguments: array-likes in, checked float64 arrays of the right shape out."""

from __future__ import annotations

from math import isfinite, nan
from operator import index
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InvalidValueError, ShapeError

Array = NDArray[np.float64]

LARGEST = 1e50
"""Largest number in a model (lengths, inertia ...): products of several stay finite."""
_FLOAT64 = np.dtype(np.float64)
_MASKS = {"position": (True, False), "xyz": (True, False), "orientation": (False, True)}
_AT_A_TIME = 2**18
"""Numbers that are looked at together."""


def as_floats(value: ArrayLike, name: str) -> Array:
    """Convert to a float64 array and refuse everything that is not a real finite number."""
    array = _converted(value, name)
    if not _all_finite(array):
        bad = np.argwhere(~np.isfinite(array))[0]
        at = ", ".join(str(int(i)) for i in bad)
        where = f" at index [{at}]" if array.ndim else ""
        raise InvalidValueError(
            f"{name}: expected finite numbers, got {array[tuple(bad)]}{where}; "
            "remove or repair such values before the call."
        )
    return array


def as_bounded(value: ArrayLike, name: str, largest: float, least: float = 0.0) -> Array:
    """Finite floats within bounds, so that squares and products neither overflow nor underflow."""
    array = _converted(value, name)
    size = _size(array)
    if not size <= largest:
        as_floats(array, name)  # names NaN and infinity
        raise InvalidValueError(
            f"{name}: expected entries up to {largest:g}, got {size:.3g}; check the units."
        )
    if 0.0 < size < least:
        raise InvalidValueError(
            f"{name}: expected zeros, or a largest entry of at least {least:g}, got {size:.3g}; "
            "check the units."
        )
    return array


def as_reals(value: ArrayLike, name: str) -> Array:
    """Convert to a float64 array of real numbers that may be infinite or NaN, such as limits."""
    return _converted(value, name)


def as_core(value: ArrayLike, core: tuple[int, ...], name: str) -> Array:
    """Finite floats of shape ``(..., *core)``."""
    array = _converted(value, name)
    k = len(core)
    if array.shape[array.ndim - k :] != core or array.ndim < k:
        raise ShapeError(_shape_message(name, core, array.shape))
    return as_floats(array, name)


def as_vector(value: ArrayLike, n: int, name: str) -> Array:
    """Finite floats of shape ``(..., n)``; the quick path of `as_core` for joint vectors."""
    # the usual case quickly: one configuration, as an array or a list of numbers. A sum is finite
    # only if every term is (one that overflows takes the slow check)
    array = value
    if type(value) is list and len(value) == n and set(map(type, value)) == {float}:
        array = np.array(value, _FLOAT64)
    if (
        type(array) is np.ndarray
        and array.dtype is _FLOAT64
        and array.shape == (n,)
        and array.flags.c_contiguous
        and isfinite(sum(array.tolist()))
    ):
        return array
    checked = as_core(value, (n,), name)
    # Pinocchio misreads strides that are no multiple of eight bytes (columns of packed records)
    return np.ascontiguousarray(checked) if checked.ndim == 1 else checked


def as_exact(value: ArrayLike, shape: tuple[int, ...], name: str) -> Array:
    """Finite floats of exactly this shape: no batch axes."""
    array = _converted(value, name)
    if array.shape != shape:
        raise ShapeError(f"{name}: expected shape {shape}, got {array.shape}.")
    return as_floats(array, name)


def as_number(
    value: ArrayLike,
    name: str,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
) -> float:
    """One finite number within bounds, such as a length or a tolerance."""
    try:
        number = float(as_exact(value, (), name))
    except ValueError:
        number = nan
    bounds = [(above, "above {:g}"), (least, "of at least {:g}"), (below, "below {:g}")]
    fits = (
        abs(number) <= LARGEST  # not NaN
        and (above is None or number > above)
        and (least is None or number >= least)
        and (below is None or number < below)
    )
    if not fits:
        words = " and".join(f" {text.format(x)}" for x, text in bounds if x is not None)
        if isfinite(number) and abs(number) > LARGEST:
            words = f" of at most {LARGEST:g} in size"
        raise InvalidValueError(f"{name}: expected a finite number{words}, got {value!r:.80}.")
    return number


def as_each(
    value: ArrayLike | None,
    count: int,
    name: str,
    least: float = -np.inf,
    above: float = -np.inf,
    finite: bool = False,
    default: float = np.nan,
) -> Array:
    """One number for all or one for each, perhaps infinite, within bounds. Shapes: -> (count,)."""
    array = as_reals(default if value is None else value, name)
    if array.shape not in ((), (count,)):
        raise ShapeError(f"{name}: expected one number or shape ({count},), got {array.shape}.")
    fits = (array >= least) & ((array > above) | (above == -np.inf))
    if not (fits & (np.abs(array) < np.inf) if finite else fits).all():
        words = " finite" * finite + " numbers"
        words += f" above {above:g}" if above > -np.inf else f" of at least {least:.3g}"
        raise InvalidValueError(f"{name}: expected{words}, got {array.tolist()!r:.60}.")
    return np.broadcast_to(array, (count,)).copy()


def as_flag(value: Any, name: str) -> bool:
    """True or False; any other value is refused."""
    if not isinstance(value, (bool, np.bool_)):
        raise InvalidValueError(f"{name}: expected True or False, got {value!r:.60}.")
    return bool(value)


def as_count(value: Any, name: str, least: int = 1, most: int | None = None) -> int:
    """A whole number within bounds, such as a number of samples."""
    try:
        number = least - 1 if isinstance(value, (bool, np.bool_)) else index(value)
    except TypeError:
        number = least - 1
    if number < least or (most is not None and number > most):
        to = "" if most is None else f" to {most}"
        raise InvalidValueError(
            f"{name}: expected a whole number from {least}{to}, got {value!r:.60}."
        )
    return number


def as_mask(
    mask: ArrayLike | str | None,
    components: tuple[str, ...] = ("x", "y", "z", "rx", "ry", "rz"),
    name: str = "mask",
) -> NDArray[np.bool_]:
    """Which components count: zeros and ones, None for all, "position" or "xyz", "orientation"."""
    k = len(components)
    if mask is None:
        return np.ones(k, dtype=np.bool_)
    if isinstance(mask, str) and k == 6 and mask in _MASKS:
        return np.repeat(_MASKS[mask], 3)
    words = " ".join(components)
    if isinstance(mask, str):
        raise InvalidValueError(
            f"{name}: expected zeros and ones for {words}, or a word ({', '.join(_MASKS)}), got "
            f"{mask!r}."
        )
    given = isinstance(mask, np.ndarray) and mask.dtype == np.bool_
    flags = given or (isinstance(mask, (list, tuple)) and set(map(type, mask)) == {bool})
    numbers = as_floats(np.asarray(mask, np.float64) if flags else mask, name)
    if numbers.shape != (k,):
        raise ShapeError(f"{name}: expected {k} numbers {words}, got shape {numbers.shape}.")
    if not np.isin(numbers, (0.0, 1.0)).all():
        raise InvalidValueError(
            f"{name}: expected zeros and ones for {words}, got {numbers.tolist()}; a component is "
            "either requested or not; it has no weight."
        )
    if not numbers.any():
        raise InvalidValueError(f"{name}: all of {words} are 0, so nothing is requested.")
    return numbers == 1.0


def _converted(value: ArrayLike, name: str) -> Array:
    try:
        array = np.asarray(value)
    except (ValueError, TypeError) as error:
        raise InvalidValueError(
            f"{name}: expected numbers in a regular array, got {type(value).__name__} ({error})."
        ) from None
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InvalidValueError(f"{name}: some entries are masked; fill or remove them first.")
    if array.dtype == np.float64:
        return array
    if array.dtype.kind not in "iuf":
        if array.size == 0:
            return array.astype(np.float64)
        raise InvalidValueError(
            f"{name}: expected real numbers, got {array.dtype} values ({value!r:.80})."
        )
    return array.astype(np.float64)


def _all_finite(array: Array) -> bool:
    if array.ndim == 0 or array.size <= _AT_A_TIME:
        return bool(np.isfinite(array).all())
    # long logs piece by piece: what isfinite tells of all of them would be held at once
    rows = max(1, _AT_A_TIME * len(array) // array.size)
    return all(bool(np.isfinite(array[k : k + rows]).all()) for k in range(0, len(array), rows))


def _size(array: Array) -> float:
    """Largest absolute value; NaN where one is."""
    if array.size <= _AT_A_TIME:
        if not array.size:
            return 0.0
        return max(float(array.max()), -float(array.min()))
    rows = max(1, _AT_A_TIME * len(array) // array.size)
    sizes = [_size(array[k : k + rows]) for k in range(0, len(array), rows)]
    return float(np.max(sizes))


def _shape_message(name: str, core: tuple[int, ...], shape: tuple[int, ...]) -> str:
    wanted = ", ".join(["...", *map(str, core)])
    message = f"{name}: expected shape ({wanted}), got {shape}."
    if len(core) == 1 and shape == (core[0], 1):
        message += f" This is a column: pass {name}.ravel(), joint vectors are rows."
    elif len(core) == 1 and len(shape) >= 2 and shape[-2] == core[0]:
        message += f" The axes look transposed: rows are samples, so pass {name}.T."
    elif core == (4, 4) and len(shape) == 3 and shape[:2] == (4, 4):
        message += " This is MATLAB's order (4, 4, N): "
        message += "robotmodels.se3.poses_from_matlab brings it to (N, 4, 4)."
    return message
