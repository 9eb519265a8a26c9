"""Polynomials in sines, cosines, strokes and constants, modulo S^2 + C^2 = 1, and their chain.

SymPy's sparse polynomials compute the sums and products; only the squares of sines (and of the
roots of 2 and 3, from angles of 45 and 30 degrees) are replaced, which gives every expression one
form: it is zero if and only if it has no terms.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ..geometry import FIXED, PRISMATIC
from ..kinematics import link_poses
from .chain import PLANES, Chain, Move

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
        self.partner = {a: b for pair in self.pairs for a, b in (pair, pair[::-1])}
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
        """The polynomial with every square of a sine written by the cosine."""
        for k, square in self._squares:
            if any(monomial[k] > 1 for monomial in p):
                p = self.replaced(p, k, square)
        return p

    def replaced(self, p: Poly, k: int, square: Poly) -> Poly:
        """The polynomial with another form of the square of a generator."""
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

    def applied(self, A: Rows, v: Sequence[Poly]) -> list[Poly]:
        """Product of a matrix and a vector."""
        return [self.dot(row, v) for row in A]

    def cross(self, u: Sequence[Poly], v: Sequence[Poly]) -> list[Poly]:
        """Vector product."""
        return [self.reduced(u[i] * v[k] - u[k] * v[i]) for i, k in PLANES]

    def determinant(self, M: Sequence[Sequence[Poly]], most_terms: int) -> Poly | None:
        """Determinant by minors of the lower rows; None if an intermediate result is too long."""
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


class PolynomialChain(Chain):
    """A chain whose axes and origins are polynomials, in the axes of any node."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.angles: dict[int, Any] = {}  # of each revolute joint: C_j is its cosine
        self.cosine: dict[int, tuple[Any, Any]] = {}  # its symbols
        self.ring = self._ring()
        self.coefficients: dict[Poly, Any] = {}  # already written as formulas
        self.steps = {j: self._step(moves) for j, moves in self.moves.items()}
        self._rotations: dict[tuple[int, int], Rows] = {}
        self.known = self._values()
        # generators of each joint
        self.moving = {
            j: frozenset(self.ring.index[s] for s in self.symbols_of(j)) for j in self.joints
        }
        self.all_moving = frozenset().union(*self.moving.values())

    def symbols_of(self, j: int) -> tuple[Any, ...]:
        """Stroke of a prismatic joint; cosine and sine of a revolute one."""
        return (self.notation.stroke(j),) if self.is_prismatic(j) else self.cosine[j]

    def _ring(self) -> TrigRing:
        plain: set[Any] = set()
        pairs: dict[tuple[Any, Any], None] = {}
        for j, moves in self.moves.items():
            for move in moves:
                if not move.turns:
                    plain |= move.amount.free_symbols
                    continue
                C, S = self.notation.cos_sin(move.amount)
                names = sorted((C.free_symbols | S.free_symbols), key=str)
                if len(names) != 2:
                    continue
                pairs[names[0], names[1]] = None
                if move.amount.joints:
                    self.cosine[j] = (names[0], names[1])
                    self.angles[j] = move.amount.without_quarters()
        plain |= {self.notation.stroke(j) for j in self.joints if self.is_prismatic(j)}
        return TrigRing(sorted(plain, key=str), list(pairs))

    def _values(self) -> dict[Any, float]:
        """Values of the constants: lengths, and cosines and sines of constant angles."""
        known = {c.symbol: c.value for c in self.notation.constants}
        for symbol in self.ring.symbols:
            meaning = self.notation.abbreviations.get(symbol)
            if meaning is not None and not meaning.free_symbols & set(self.variables):
                known[symbol] = float(meaning.subs(known))
        return known

    def _step(self, moves: Sequence[Move]) -> tuple[Rows, list[Poly]]:
        """Rotation and position of a chain of motions."""
        ring = self.ring
        R = [[ring.one if i == k else ring.zero for k in range(3)] for i in range(3)]
        p = [ring.zero] * 3
        for move in moves:
            if move.turns:
                C, S = map(ring.of, self.notation.cos_sin(move.amount))
                i, k = PLANES[move.axis]
                for row in R:
                    row[i], row[k] = (
                        ring.reduced(row[i] * C + row[k] * S),
                        ring.reduced(row[k] * C - row[i] * S),
                    )
            else:
                amount = ring.of(move.amount)
                p = [ring.reduced(a + row[move.axis] * amount) for a, row in zip(p, R, strict=True)]
        return R, p

    def joints_of(self, p: Poly) -> tuple[int, ...]:
        """Numbers of the frames whose variables a polynomial depends on."""
        found = self.ring.occurring(p)
        return tuple(j for j, own in self.moving.items() if own & found)

    def rotation(self, a: int, b: int) -> Rows:
        """Axes of node b in those of node a."""
        if (a, b) not in self._rotations:
            steps = self.steps_between(a, b)
            if not steps:
                return [[self.ring.one * (i == k) for k in range(3)] for i in range(3)]
            node, down = steps[-1]
            R = self.steps[node][0]
            columns = list(zip(*R, strict=True)) if down else R
            before = self.rotation(a, self.parent[node] if down else node)
            self._rotations[a, b] = [[self.ring.dot(row, c) for c in columns] for row in before]
        return self._rotations[a, b]

    def _translations(self, a: int, b: int) -> list[tuple[int, list[Poly]]]:
        """Translations from the origin of a to that of b, each in the axes of a node."""
        out = []
        for node, down in self.steps_between(a, b):
            step = self.steps[node][1]
            if any(step):
                out.append((self.parent[node], step if down else [-v for v in step]))
        return out

    def lever(self, i: int, a: int, b: int) -> list[Poly]:
        """Vector from the origin of a to that of b, in the axes of i."""
        steps = self._translations(a, b)
        return self._sum(self.ring.applied(self.rotation(i, node), step) for node, step in steps)

    def column(self, k: int, i: int, j: int) -> list[Poly]:
        """Column of joint k in the third matrix: projection on i, at the origin of j.

        Each step of the lever is multiplied by the axis where the paths to both and to i meet, so
        that no joint occurs twice and nothing has to be simplified.
        """
        ring = self.ring
        axis = self._axis(i, k)
        if self.is_prismatic(k):
            return [*axis, *[ring.zero] * 3]
        terms = []
        for node, step in self._translations(k, j):
            b = self.meeting(k, node, i)
            moment = ring.cross(self._axis(b, k), ring.applied(self.rotation(b, node), step))
            terms.append(ring.applied(self.rotation(i, b), moment))
        return [*self._sum(terms), *axis]

    def _axis(self, i: int, k: int) -> list[Poly]:
        return [row[2] for row in self.rotation(i, k)]

    def _sum(self, vectors: Iterable[Sequence[Poly]]) -> list[Poly]:
        return [sum(x, self.ring.zero) for x in zip([self.ring.zero] * 3, *vectors, strict=True)]

    def cleaned(self, p: Poly) -> Poly:
        """The polynomial without terms whose constants cancel, as lengths of opposite sign may."""
        ring = self.ring
        out = ring.zero
        for key, part in ring.collected(p, self.all_moving).items():
            sizes = [abs(ring.value(ring.ring({m: c}), self.known)) for m, c in part.items()]
            if abs(ring.value(part, self.known)) > 1e-12 * max(1e-3, *sizes):
                out += part * ring.ring({key: 1})
        return out

    @cached_property
    def parallel_groups(self) -> list[tuple[int, ...]]:
        """Successive revolute joints whose axes are parallel: their angles are added."""
        groups: list[tuple[int, ...]] = []
        axes = link_poses(self.model, np.zeros(self.model.n))[:, :3, 2]
        for j in sorted(self.cosine):
            before = self.parent[j]
            while before > 0 and self.table.sigma[before - 1] in (PRISMATIC, FIXED):
                before = self.parent[before]
            group = next((g for g in groups if before in g), None)
            parallel = np.linalg.norm(np.cross(axes[before - 1], axes[j - 1])) <= 1e-12
            if group is not None and parallel:
                groups[groups.index(group)] = (*group, j)
            else:
                groups.append((j,))
        return groups
