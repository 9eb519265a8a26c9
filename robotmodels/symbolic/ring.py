"""Polynomials in sines, cosines, strokes and constants, modulo S^2 + C^2 = 1.

SymPy's sparse polynomials compute the sums and products; only the squares of sines (and of the
roots of 2 and 3, from angles of 45 and 30 degrees) are replaced, which gives every expression one
form: it is zero if and only if it has no terms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .moves import PLANES

Poly = Any
"""A ``sympy.polys.rings.PolyElement``."""
Monomial = tuple[int, ...]
Rows = list[list[Poly]]


class TrigRing:
    """The ring of one explanation."""

    def __init__(self, plain: Sequence[Any], pairs: Sequence[tuple[Any, Any]]) -> None:
        import sympy
        from sympy.polys.rings import ring

        names = sympy.symbols("root2 root3")
        self.roots = {sympy.sqrt(2): names[0], sympy.sqrt(3): names[1]}
        self.symbols = (*names, *plain, *(s for pair in pairs for s in pair))
        self.ring: Any = ring(self.symbols, sympy.QQ)[0]
        self.index = {symbol: k for k, symbol in enumerate(self.symbols)}
        self.pairs = [(self.index[c], self.index[s]) for c, s in pairs]
        self.zero, self.one, self.gens = self.ring.zero, self.ring.one, self.ring.gens
        # index of the generator whose square is known, and its square
        self._squares = [(0, 2 * self.one), (1, 3 * self.one)]
        self._squares += [(s, self.one - self.gens[c] ** 2) for c, s in self.pairs]

    def of(self, expr: Any) -> Poly:
        """Polynomial of a SymPy expression in symbols of the ring, rationals and the two roots."""
        return self.ring.from_expr(expr.xreplace(self.roots))

    def expression(self, p: Poly) -> Any:
        """SymPy expression of a polynomial."""
        return p.as_expr().xreplace({symbol: root for root, symbol in self.roots.items()})

    def reduced(self, p: Poly) -> Poly:
        """The same with every square of a sine written by the cosine."""
        for k, square in self._squares:
            if any(monomial[k] > 1 for monomial in p):
                p = self.replaced(p, k, square)
        return p

    def replaced(self, p: Poly, k: int, square: Poly) -> Poly:
        """The same with another form of the square of a generator."""
        out = self.zero
        for monomial, coefficient in p.items():
            half, rest = divmod(monomial[k], 2)
            term = self.ring({(*monomial[:k], rest, *monomial[k + 1 :]): coefficient})
            out += term * square**half if half else term
        return out

    def collected(self, p: Poly, own: frozenset[int]) -> dict[Monomial, Poly]:
        """Terms by their powers of some generators, with the polynomials that multiply those."""
        out: dict[Monomial, Poly] = {}
        for monomial, coefficient in p.items():
            key = tuple(e if k in own else 0 for k, e in enumerate(monomial))
            rest = tuple(0 if k in own else e for k, e in enumerate(monomial))
            out[key] = out.get(key, self.zero) + self.ring({rest: coefficient})
        return out

    def times(self, a: Poly, b: Poly) -> Poly:
        """Product."""
        return self.reduced(a * b)

    def dot(self, u: Sequence[Poly], v: Sequence[Poly]) -> Poly:
        """Scalar product."""
        return self.reduced(sum((a * b for a, b in zip(u, v, strict=True)), self.zero))

    def product(self, A: Rows, B: Rows) -> Rows:
        """Matrix product."""
        columns = list(zip(*B, strict=True))
        return [[self.dot(row, column) for column in columns] for row in A]

    def applied(self, A: Rows, v: Sequence[Poly]) -> list[Poly]:
        """Product of a matrix and a vector."""
        return [self.dot(row, v) for row in A]

    def cross(self, u: Sequence[Poly], v: Sequence[Poly]) -> list[Poly]:
        """Vector product."""
        return [self.reduced(u[i] * v[k] - u[k] * v[i]) for i, k in PLANES]

    def determinant(self, M: Sequence[Sequence[Poly]], most_terms: int) -> Poly | None:
        """By minors of the lower rows; None where an intermediate result has too many terms."""
        minors: dict[tuple[int, ...], Poly] = {(): self.one}
        size = len(M)
        for row in range(size - 1, -1, -1):
            larger: dict[tuple[int, ...], Poly] = {}
            for columns, minor in minors.items():
                for column in range(size):
                    if column in columns or not minor or not M[row][column]:
                        continue
                    both = tuple(sorted((*columns, column)))
                    sign = -1 if sum(c < column for c in columns) % 2 else 1
                    term = self.times(M[row][column], minor)
                    larger[both] = larger.get(both, self.zero) + sign * term
                    if len(larger[both]) > most_terms:
                        return None
            minors = larger
        return minors.get(tuple(range(size)), self.zero)

    def occurring(self, p: Poly) -> frozenset[int]:
        """Indices of the generators in it."""
        return frozenset(k for monomial in p for k, power in enumerate(monomial) if power)

    def value(self, p: Poly, known: Mapping[Any, float]) -> float:
        """Value of a polynomial in constants."""
        numbers = [2.0**0.5, 3.0**0.5, *(known.get(s, np.nan) for s in self.symbols[2:])]
        total = 0.0
        for monomial, coefficient in p.items():
            term = float(coefficient)
            for k in np.flatnonzero(monomial):
                term *= numbers[k] ** monomial[k]
            total += term
        return total
