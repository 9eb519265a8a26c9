"""The geometric table as the book prints it (Table 1.1)."""

from __future__ import annotations

from fractions import Fraction
from math import pi

import numpy as np

from ._arrays import Array
from .geometry import FIXED, PRISMATIC, DHTable

_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_SMALLEST = 1e-9  # a nanometre: what is smaller is rounding of the source, not geometry to read


def boxed_table(table: DHTable) -> str:
    """Lay a table out in a box, one row per frame.

    Columns that say nothing (antecedents of a serial robot, mu when every joint is actuated,
    gamma, b and beta when zero) are left out. Angles are shown as fractions of pi where they
    are, in radians otherwise; lengths are in metres.

    Parameters
    ----------
    table : DHTable
        The table.

    Returns
    -------
    str
        Text of several lines.

    Examples
    --------
    >>> print(boxed_table(DHTable.from_rows([{"sigma": 0}, {"sigma": 0, "d": 0.45}])))
    ┌───┬────┬────┬──────┬────┬────┐
    │ j │ σj │ αj │   dj │ θj │ rj │
    ├───┼────┼────┼──────┼────┼────┤
    │ 1 │  0 │  0 │    0 │ θ₁ │  0 │
    │ 2 │  0 │  0 │ 0.45 │ θ₂ │  0 │
    └───┴────┴────┴──────┴────┴────┘
    """
    columns: list[tuple[str, list[str]]] = [("j", [str(j + 1) for j in range(table.f)])]
    if not table.is_serial:
        columns.append(("a(j)", [str(a) for a in table.antecedent]))
    columns.append(("σj", [str(s) for s in table.sigma]))
    if (table.mu != (table.sigma != FIXED)).any():
        columns.append(("μj", [str(m) for m in table.mu]))
    if _shows(table.gamma) or _shows(table.b):
        columns.append(("γj", [angle_text(v) for v in table.gamma]))
        columns.append(("bj", [length_text(v) for v in table.b]))
    if _shows(table.beta):
        columns.append(("βj", [angle_text(v) for v in table.beta]))
    columns.append(("αj", [angle_text(v) for v in table.alpha]))
    columns.append(("dj", [length_text(v) for v in table.d]))
    columns.append(("θj", [_own(table, j, "θ") for j in range(table.f)]))
    columns.append(("rj", [_own(table, j, "r") for j in range(table.f)]))
    return boxed(columns)


def boxed(columns: list[tuple[str, list[str]]]) -> str:
    """Draw a box around columns of text.

    Parameters
    ----------
    columns : list of (heading, cells)
        All of the same length.

    Returns
    -------
    str
        Text of several lines, right-aligned cells.

    Examples
    --------
    >>> print(boxed([("x", ["1"])]))
    ┌───┐
    │ x │
    ├───┤
    │ 1 │
    └───┘
    """
    widths = [max(len(cell) for cell in (head, *cells)) for head, cells in columns]

    def rule(left: str, middle: str, right: str) -> str:
        return left + middle.join("─" * (w + 2) for w in widths) + right

    def line(cells: list[str]) -> str:
        padded = (f" {c:>{w}} " for c, w in zip(cells, widths, strict=True))
        return "│" + "│".join(padded) + "│"

    body = [
        line([cells[i] for _, cells in columns])
        for i in range(len(columns[0][1]) if columns else 0)
    ]
    head = line([head for head, _ in columns])
    return "\n".join([rule("┌", "┬", "┐"), head, rule("├", "┼", "┤"), *body, rule("└", "┴", "┘")])


def angle_text(value: float) -> str:
    """An angle as a fraction of pi if it is one to rounding, else in radians.

    Parameters
    ----------
    value : float
        Radians.

    Returns
    -------
    str
        For instance ``-π/2``, ``0`` or ``0.3``.

    Examples
    --------
    >>> angle_text(-np.pi / 2), angle_text(0.3)
    ('-π/2', '0.3')
    """
    ratio = Fraction(value / pi).limit_denominator(12)
    if value and abs(float(ratio) * pi - value) < 1e-12 and ratio:
        top = {1: "π", -1: "-π"}.get(ratio.numerator, f"{ratio.numerator}π")
        return top if ratio.denominator == 1 else f"{top}/{ratio.denominator}"
    return length_text(value)


def length_text(value: float) -> str:
    """A number with six significant digits and no needless zeros; below 1e-9 it shows as 0.

    Parameters
    ----------
    value : float
        Any number.

    Returns
    -------
    str
        Its text.

    Examples
    --------
    >>> length_text(0.45), length_text(-0.0)
    ('0.45', '0')
    """
    return f"{value:.6g}" if abs(value) >= _SMALLEST else "0"


def _own(table: DHTable, j: int, symbol: str) -> str:
    """Cell of the theta or r column: the variable with its offset, or a constant."""
    offset = float(table.theta[j] if symbol == "θ" else table.r[j])
    text = angle_text if symbol == "θ" else length_text
    variable = "r" if table.sigma[j] == PRISMATIC else "θ"
    if table.sigma[j] == FIXED or symbol != variable:
        return text(offset)
    name = symbol + str(j + 1).translate(_SUBSCRIPTS)
    if abs(offset) < _SMALLEST:
        return name
    return f"{name} {'+' if offset > 0 else '-'} {text(abs(offset))}"


def _shows(column: Array) -> bool:
    return bool((np.abs(column) >= _SMALLEST).any())
