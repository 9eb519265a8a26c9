"""Lengths and angles as a report on a calibration prints them."""

from __future__ import annotations


def millimetres(value: float) -> str:
    """A length as text in millimetres: to a tenth of a micrometre."""
    return _fixed(1e3 * value)


def degrees(value: float) -> str:
    """An angle as text in degrees, to a tenth of a thousandth."""
    return _fixed(57.29577951308232 * value)


def in_unit(value: float, unit: str) -> str:
    """A number of a unit as it is printed: m as mm, rad as deg, others as they are."""
    if unit == "m":
        return millimetres(value)
    if unit == "rad":
        return degrees(value)
    return "-" if value != value else f"{value:.3e}"


def printed_unit(unit: str) -> str:
    """Name of the unit that `in_unit` prints."""
    return {"m": "mm", "rad": "deg"}.get(unit, unit)


_NOTHING = 1e-8
"""Millimetres or degrees: rounding of a source."""


def _fixed(value: float) -> str:
    if value != value:
        return "-"
    # what is below the last digit, or far above it, is told by its power of ten
    if abs(value) < _NOTHING:
        return "0"
    if not 5e-5 <= abs(value) < 1e6:
        return f"{value:.1e}"
    return f"{value:.4f}"
