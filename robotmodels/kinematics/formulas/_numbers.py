"""Formulas in numbers, with the constants of one robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._arrays import Array
from ...symbolic_dgm._numbers import number_of


@dataclass(frozen=True, slots=True, eq=False)
class FormulaNumbers:
    """Values of the symbols of formulas."""

    variables: tuple[Any, ...]
    abbreviations: tuple[tuple[Any, Any], ...]
    constants: tuple[tuple[Any, float], ...]

    def known(self, q: Array) -> dict[Any, Any]:
        """Values of the symbols, vectorised over the leading axes of q (..., n)."""
        known: dict[Any, Any] = dict(self.constants)
        known |= {symbol: q[..., i] for i, symbol in enumerate(self.variables)}
        for symbol, meaning in self.abbreviations:
            known[symbol] = number_of(meaning, known)
        return known

    def values(self, expr: Any, q: Array) -> Array:
        """Values (...) of an expression."""
        return np.zeros(q.shape[:-1]) + number_of(expr, self.known(q))

    def matrix(self, entries: Any, q: Array) -> Array:
        """Values (..., rows, columns) of a matrix of expressions."""
        known = self.known(q)
        out = np.empty((*q.shape[:-1], *entries.shape))
        for i in range(entries.shape[0]):
            for j in range(entries.shape[1]):
                out[..., i, j] = number_of(entries[i, j], known)
        return out
