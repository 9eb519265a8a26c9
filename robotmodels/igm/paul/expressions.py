"""Expressions of Paul's equations: a shared graph whose sums and products stay factored.

An expression is a number times a node: ``(factor, node)``. A node is 1, a symbol, a sum or a
product, and equal nodes are one, so that a subexpression is computed and printed once. Every node
carries its values at a few random postures of the arm: an expression that is zero at all of them
is zero.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from functools import reduce

import numpy as np

from ..._arrays import Array

Expression = tuple[float, int]
"""A number and a node that it multiplies."""

ONE: int = 0
ZERO: Expression = (0.0, ONE)
UNIT: Expression = (1.0, ONE)
DUST = 1e-12
"""Values this small beside those of the parts are rounding."""


class Kind(Enum):
    """Kinds of nodes."""

    ONE = "the number 1"
    CONSTANT = "a constant of the table"
    POSE = "an element of the pose"
    JOINT = "a joint variable, or the cosine or sine of one"
    NAMED = "an expression with a name of its own, such as the cosine of a sum of angles"
    SUM = "a sum"
    PRODUCT = "a product"


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """One node of the graph.

    ``parts`` of a sum and of a named node are expressions; of a product, nodes with factor 1.
    """

    kind: Kind
    parts: tuple[Expression, ...]
    values: Array
    name: str = ""


class Graph:
    """The nodes of one derivation."""

    def __init__(self, samples: int) -> None:
        self.samples = samples
        self.nodes: list[Node] = [Node(Kind.ONE, (), np.ones(samples))]
        self.strict = False  # keep sums that are zero at every posture that meets its pose
        self.latex: dict[str, str] = {}  # of the names
        self._known: dict[object, int] = {}

    def values(self, e: Expression) -> Array:
        """Values of an expression at the sample postures."""
        return e[0] * self.nodes[e[1]].values

    def _new(self, key: object, node: Node) -> int:
        if key not in self._known:
            self._known[key] = len(self.nodes)
            self.nodes.append(node)
        return self._known[key]

    def symbol(self, kind: Kind, name: str, latex: str, values: Array) -> Expression:
        """A symbol; one name is one symbol."""
        self.latex[name] = latex
        return 1.0, self._new((kind, name), Node(kind, (), np.asarray(values), name))

    def named(self, name: str, latex: str, meaning: Expression) -> Expression:
        """A name for an expression."""
        self.latex[name] = latex
        node = Node(Kind.NAMED, (meaning,), self.values(meaning), name)
        return 1.0, self._new((Kind.NAMED, name, meaning), node)

    def product(self, *factors: Expression) -> Expression:
        """The product; factors of products are joined, sums are not multiplied out."""
        number, nodes = 1.0, []
        for factor, node in factors:
            number *= factor
            if self.nodes[node].kind is Kind.PRODUCT:
                nodes += [part for _, part in self.nodes[node].parts]
            elif node != ONE:
                nodes.append(node)
        if number == 0.0:
            return ZERO
        if len(nodes) < 2:
            return number, nodes[0] if nodes else ONE
        nodes.sort()
        key = (Kind.PRODUCT, *nodes)
        if key not in self._known:
            values = reduce(np.multiply, (self.nodes[node].values for node in nodes))
            self._new(key, Node(Kind.PRODUCT, tuple((1.0, n) for n in nodes), values))
        return number, self._known[key]

    def sum(self, terms: Iterable[Expression]) -> Expression:
        """The sum: equal terms are joined, what is zero at every posture is zero."""
        factors: dict[int, float] = {}
        for factor, node in terms:
            if factor:
                factors[node] = factors.get(node, 0.0) + factor
        kept = sorted((n, f) for n, f in factors.items() if abs(f) > 1e-15)
        if not kept:
            return ZERO
        if len(kept) == 1:
            return kept[0][1], kept[0][0]
        sign = 1.0 if kept[0][1] > 0.0 else -1.0
        parts = tuple((sign * f, n) for n, f in kept)
        key = (Kind.SUM, parts)
        if key not in self._known:
            each = np.array([f * self.nodes[n].values for f, n in parts])
            values = each.sum(axis=0)
            if not self.strict and np.abs(values).max() <= DUST * np.abs(each).max():
                return ZERO
            self._new(key, Node(Kind.SUM, parts, values))
        return sign, self._known[key]

    def dot(self, *pairs: tuple[Expression, ...]) -> Expression:
        """Sum of products."""
        return self.sum([self.product(*pair) for pair in pairs])

    def determinant(self, a: Expression, b: Expression, c: Expression, d: Expression) -> Expression:
        """``a d - c b``, of the rows (a, b) and (c, d)."""
        return self.sum((self.product(a, d), negative(self.product(c, b))))

    def leaves(self, e: Expression) -> int:
        """How many symbols are printed for it: a measure of length."""
        node = self.nodes[e[1]]
        if node.kind in (Kind.SUM, Kind.PRODUCT):
            return sum(self.leaves(part) for part in node.parts)
        return 0 if node.kind is Kind.ONE else 1

    def is_constant(self, e: Expression) -> bool:
        """Whether it is made of the table alone."""
        node = self.nodes[e[1]]
        if node.kind in (Kind.SUM, Kind.PRODUCT, Kind.NAMED):
            return all(self.is_constant(part) for part in node.parts)
        return node.kind in (Kind.ONE, Kind.CONSTANT)


def negative(e: Expression) -> Expression:
    """Minus an expression."""
    return -e[0], e[1]
