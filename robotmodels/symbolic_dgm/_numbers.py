"""Numbers of an expression, vectorised over configurations."""

from __future__ import annotations

from typing import Any

import numpy as np


def number_of(expr: Any, known: dict[Any, Any]) -> Any:
    """Value of an expression; ``known`` has the symbols' and takes up those of its parts."""
    value = known.get(expr)
    if value is None:
        if expr.is_number:
            value = float(expr)
        elif expr.is_Pow and expr.exp.is_Integer:
            value = number_of(expr.base, known) ** int(expr.exp)
        else:
            of = [number_of(arg, known) for arg in expr.args]
            if expr.is_Add:
                value = sum(of)
            elif expr.is_Mul:
                value = of[0]
                for factor in of[1:]:
                    value = value * factor
            else:  # the only functions of the abbreviations
                value = {"cos": np.cos, "sin": np.sin}[expr.func.__name__](of[0])
        known[expr] = value
    return value
