"""Polynomials in sines, cosines, strokes and constants, modulo S^2 + C^2 = 1.

SymPy's sparse polynomials do the sums and products; only the squares of sines (and of the roots of
2 and 3, from angles of 45 and 30 degrees) are replaced, which gives every expression one form:
it is zero if and only if it has no terms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..._arrays import Array

Poly = Any
"""A ``sympy.polys.rings.PolyElement``."""


class TrigRing:
    """The ring of one explanation."""

    def __init__(self, plain: Sequence[Any], pairs: Sequence[tuple[Any, Any]]) -> None:
        import sympy
        from sympy.polys.rings import ring

        self.roots = (sympy.Symbol("root2"), sympy.Symbol("root3"))
        symbols = [*self.roots, *plain, *(s for pair in pairs for s in pair)]
        self.ring: Any = ring(symbols, sympy.QQ)[0]
        self.symbols = tuple(symbols)
        self.index = {symbol: k for k, symbol in enumerate(symbols)}
        self.pairs = [(self.index[c], self.index[s]) for c, s in pairs]
        gens = self.ring.gens
        one = self.ring.one
        # index of the generator whose square is known, and its square
        self._squares = [(0, 2 * one), (1, 3 * one)]
        self._squares += [(s, one - gens[c] ** 2) for c, s in self.pairs]
        self._powers: dict[tuple[int, int], Poly] = {}

    @property
    def zero(self) -> Poly:
        return self.ring.zero

    @property
    def one(self) -> Poly:
        return self.ring.one

    def generator(self, symbol: Any) -> Poly:
        return self.ring.gens[self.index[symbol]]

    def of(self, expr: Any) -> Poly:
        """A polynomial of a SymPy expression: symbols of the ring, sums, products, roots."""
        import sympy

        if expr.is_Symbol:
            return self.generator(expr)
        if expr.is_Rational:
            return self.ring(sympy.QQ(int(expr.p), int(expr.q)))
        if expr.is_Add:
            return sum((self.of(arg) for arg in expr.args), self.zero)
        if expr.is_Mul:
            out = self.one
            for arg in expr.args:
                out = out * self.of(arg)
            return out
        for root, number in zip(self.roots, (2, 3), strict=True):
            if expr == sympy.sqrt(number):
                return self.generator(root)
            if expr == 1 / sympy.sqrt(number):
                return self.generator(root) / number
        return self._expanded(sympy.expand(sympy.sqrtdenest(expr)), expr)

    def _expanded(self, expr: Any, whole: Any) -> Poly:
        import sympy

        if expr.is_Pow and expr.base.is_Integer and expr.exp == sympy.Rational(1, 2):
            roots = [r for r, n in zip(self.roots, (2, 3), strict=True) if expr.base % n == 0]
            if expr.base == 6:
                return self.generator(roots[0]) * self.generator(roots[1])
        if expr == whole:
            raise ValueError(f"no polynomial in sines and cosines: {expr}")
        return self.of(expr)

    def times(self, a: Poly, b: Poly) -> Poly:
        return self.reduced(a * b)

    def reduced(self, p: Poly) -> Poly:
        """The same with every square of a sine written by the cosine."""
        for k, square in self._squares:
            if not any(monomial[k] > 1 for monomial in p):
                continue
            out = self.zero
            for monomial, coefficient in p.items():
                half, rest = divmod(monomial[k], 2)
                lower = list(monomial)
                lower[k] = rest
                term = self.ring({tuple(lower): coefficient})
                out += term * self._power(k, half, square) if half else term
            p = out
        return p

    def _power(self, k: int, exponent: int, square: Poly) -> Poly:
        if (k, exponent) not in self._powers:
            self._powers[k, exponent] = square**exponent
        return self._powers[k, exponent]

    def dot(self, u: Sequence[Poly], v: Sequence[Poly]) -> Poly:
        return self.reduced(sum((a * b for a, b in zip(u, v, strict=True)), self.zero))

    def product(self, A: Sequence[Sequence[Poly]], B: Sequence[Sequence[Poly]]) -> list[list[Poly]]:
        columns = list(zip(*B, strict=True))
        return [[self.dot(row, column) for column in columns] for row in A]

    def applied(self, A: Sequence[Sequence[Poly]], v: Sequence[Poly]) -> list[Poly]:
        return [self.dot(row, v) for row in A]

    def cross(self, u: Sequence[Poly], v: Sequence[Poly]) -> list[Poly]:
        return [
            self.reduced(u[1] * v[2] - u[2] * v[1]),
            self.reduced(u[2] * v[0] - u[0] * v[2]),
            self.reduced(u[0] * v[1] - u[1] * v[0]),
        ]

    def determinant(self, M: Sequence[Sequence[Poly]], most_terms: int) -> Poly | None:
        """By minors of the lower rows; None where an intermediate result has too many terms."""
        minors: dict[tuple[int, ...], Poly] = {(): self.one}
        size = len(M)
        for row in range(size - 1, -1, -1):
            larger: dict[tuple[int, ...], Poly] = {}
            for columns, minor in minors.items():
                if not minor:
                    continue
                for column in range(size):
                    if column in columns or not M[row][column]:
                        continue
                    both = tuple(sorted((*columns, column)))
                    # of as many columns to its left as the minor has, the sign
                    sign = -1 if sum(c < column for c in columns) % 2 else 1
                    term = self.times(M[row][column], minor)
                    larger[both] = larger.get(both, self.zero) + sign * term
                    if len(larger[both]) > most_terms:
                        return None
            minors = larger
        return minors.get(tuple(range(size)), self.zero)

    def is_constant(self, p: Poly, moving: frozenset[int]) -> bool:
        return not (self.occurring(p) & moving)

    def occurring(self, p: Poly) -> frozenset[int]:
        """Indices of the generators in it."""
        return frozenset(k for monomial in p for k, power in enumerate(monomial) if power)

    def degree(self, p: Poly, indices: frozenset[int]) -> int:
        """Largest total degree in some generators."""
        return max((sum(monomial[k] for k in indices) for monomial in p), default=0)

    def values(self, p: Poly, known: Mapping[Any, Any], shape: tuple[int, ...]) -> Array:
        """Numbers of a polynomial, vectorised: ``known`` gives those of the symbols."""
        out = np.zeros(shape)
        numbers = [2.0**0.5, 3.0**0.5, *(known.get(s, np.nan) for s in self.symbols[2:])]
        for monomial, coefficient in p.items():
            term: Any = float(coefficient)
            for k, power in enumerate(monomial):
                if power:
                    term = term * (numbers[k] if power == 1 else numbers[k] ** power)
            out = out + term
        return out
