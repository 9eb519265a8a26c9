"""Numbers as messages and reprs show them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .._arrays import Array


def least_shown(value: float, digits: int = 12) -> str:
    """A least value in few digits, rounded up: it is accepted when it is passed back."""
    text = f"{value:.{digits}g}"
    up = value + abs(value) * 10.0 ** (1 - digits)
    return text if float(text) >= value else f"{up:.{digits}g}"


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
    return counted(t.size, "sample") + (f" at {t[0]:.4g} s" if t.size == 1 else times)
