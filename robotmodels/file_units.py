"""Units of files: a reader converts by its arguments, never by the size of the numbers."""

from __future__ import annotations

from enum import Enum
from typing import Any, TypeVar

import numpy as np

from .errors import InvalidValueError


class LengthUnit(Enum):
    """Unit of the lengths in a file; the value is its symbol."""

    METRE = "m"
    MILLIMETRE = "mm"

    @property
    def factor(self) -> float:
        """Metres in one of it."""
        return 1e-3 if self is LengthUnit.MILLIMETRE else 1.0


class AngleUnit(Enum):
    """Unit of the angles in a file; the value is its symbol."""

    RADIAN = "rad"
    DEGREE = "deg"

    @property
    def factor(self) -> float:
        """Radians in one of it."""
        return float(np.pi / 180.0) if self is AngleUnit.DEGREE else 1.0


class TimeUnit(Enum):
    """Unit of the times in a file; the value is its symbol."""

    SECOND = "s"
    MILLISECOND = "ms"
    MICROSECOND = "us"
    NANOSECOND = "ns"

    @property
    def factor(self) -> float:
        """Seconds in one of it."""
        return {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[self.value]


U = TypeVar("U", LengthUnit, AngleUnit, TimeUnit)


def as_file_unit(kind: type[U], value: Any, name: str) -> U:
    """A unit given as a member or by its symbol."""
    try:
        return kind(value)
    except ValueError:
        symbols = " or ".join(repr(member.value) for member in kind)
        raise InvalidValueError(f"{name}: expected {symbols}, got {value!r:.60}.") from None
