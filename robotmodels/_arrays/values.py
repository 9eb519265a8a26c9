"""Immutable values: read-only arrays, and equality, hash and copies of objects that hold them."""

from __future__ import annotations

from dataclasses import fields
from enum import Enum
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def read_only(array: ArrayLike, dtype: type = np.float64) -> NDArray[Any]:
    """A private, C-ordered, read-only copy."""
    copy = np.array(array, dtype=dtype, order="C")
    copy.setflags(write=False)
    return copy


class Rebuilt:
    """Base of frozen dataclasses whose arrays stay read-only when they are copied or unpickled.

    NumPy forgets that an array is read-only when it is pickled.
    """

    __slots__ = ()

    def __reduce__(self) -> tuple[Any, ...]:
        values = tuple(getattr(self, f.name) for f in fields(self) if f.init)  # type: ignore[arg-type]
        return _rebuilt, (type(self), values)


def _rebuilt(kind: type, values: tuple[Any, ...]) -> Any:
    for value in values:
        for array in value if isinstance(value, tuple) else (value,):
            if isinstance(array, np.ndarray):
                array.flags.writeable = False
    return kind(*values)


class Frozen(Rebuilt):
    """Base of frozen dataclasses whose arrays become read-only copies."""

    __slots__ = ()

    def __post_init__(self) -> None:
        for name in _names(type(self)):
            object.__setattr__(self, name, _kept(getattr(self, name)))


@cache
def _names(kind: type) -> tuple[str, ...]:
    """Names of the fields of a dataclass."""
    return tuple(field.name for field in fields(kind))  # type: ignore[arg-type]


def _kept(value: Any) -> Any:
    """A read-only copy of an array, also inside tuples."""
    if type(value) is tuple:
        return tuple(map(_kept, value))
    return read_only(value, value.dtype.type) if isinstance(value, np.ndarray) else value


class Value(Rebuilt):
    """Base of frozen dataclasses that are equal if their fields are, arrays included."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(same_value(a, b) for a, b in zip(self._values, other._values, strict=True))  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return value_hash(type(self).__name__, *self._values)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._texts()})"

    def _texts(self, *hidden: type) -> str:
        """The fields given, but for those of some types, each in a line."""
        names = (f.name for f in fields(self) if f.init and not f.name.startswith("_"))  # type: ignore[arg-type]
        shown = (
            (name, value) for name in names if not isinstance(value := getattr(self, name), hidden)
        )
        return ", ".join(f"{name}={_shown(value)}" for name, value in shown if value is not None)

    @property
    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, f.name) for f in fields(self))  # type: ignore[arg-type]


def _shown(value: object) -> str:
    """A field in one line: arrays of more than eight numbers by their shape."""
    if type(value) is tuple:
        return f"({', '.join(map(_shown, value))})"
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, np.ndarray) and value.size > 8:
        return f"<{value.shape} array>"
    if isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.size:
        text = np.array2string(value, separator=", ", formatter={"float": "{:.6g}".format})
        return " ".join(text.split())
    plain = value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
    return " ".join(repr(plain).split())


def same_value(a: object, b: object) -> bool:
    """Equality of fields that may be arrays or tuples of them; NaN equals NaN."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        floats = a.dtype.kind == b.dtype.kind == "f"
        return np.array_equal(a, b) or (floats and np.array_equal(a, b, equal_nan=True))
    if type(a) is tuple and type(b) is tuple:
        return len(a) == len(b) and all(map(same_value, a, b))
    return bool(a == b or (a != a and b != b))


def value_hash(*fields: object) -> int:
    """Hash of fields that may be arrays, consistent with `same_value`."""
    return hash(tuple(map(_hashable, fields)))


def _hashable(value: Any) -> Any:
    """A field for a hash, in which 0.0 and -0.0 are the same, as they compare alike, and NaN."""
    if isinstance(value, np.ndarray):
        return (value if value.dtype.kind == "U" else value + 0.0).tobytes()
    if type(value) is tuple:
        return tuple(map(_hashable, value))
    return "NaN" if isinstance(value, float) and value != value else value
