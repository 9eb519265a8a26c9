"""Numbers as messages and reprs show them.

Bounds are rounded to the side on which they are accepted when they are passed back.
"""

from __future__ import annotations

from collections.abc import Iterable
from decimal import ROUND_CEILING, ROUND_FLOOR, Context

import numpy as np

from .._arrays import Array


def least_shown(value: float, digits: int = 12) -> str:
    """A least value in few digits, not below it."""
    up = Context(prec=digits, rounding=ROUND_CEILING).create_decimal(float(value))
    return f"{float(up):.{digits}g}"


def most_shown(value: float, digits: int = 12) -> str:
    """Upper bound as text, rounded down."""
    down = Context(prec=digits, rounding=ROUND_FLOOR).create_decimal(float(value))
    return f"{float(down):.{digits}g}"


def counted(number: int, one: str) -> str:
    """Number with its noun."""
    return f"{number} {one}" if number == 1 else f"{number} {one}s"


def greatest_shown(rows: Iterable[tuple[str, Array]]) -> str:
    """The greatest sizes of quantities of joints, and which joint has them."""
    texts = []
    for name, values in rows:
        size = np.abs(np.where(np.isnan(values), 0.0, values)).reshape(-1, values.shape[-1])
        if size.size:
            size = size.max(axis=0)
            joint = f" (joint {int(size.argmax()) + 1})" if size.size > 1 and size.any() else ""
            texts.append(f"{name} {size.max():.4g}{joint}")
    return "greatest " + ", ".join(texts) if texts else "no values"


def seconds_shown(t: Array) -> str:
    """The times of samples. Shapes: t (N,)."""
    times = f" from {t[0]:.4g} s to {t[-1]:.4g} s" if t.size > 1 else ""
    if t.size == 1:
        times = f" at {t[0]:.4g} s"
    return counted(t.size, "sample") + times
