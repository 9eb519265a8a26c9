"""Expressions in print: text that is Python as well, ordered as the book orders them."""

from __future__ import annotations

from itertools import groupby

from .expressions import ONE, Expression, Graph, Kind, negative

_RANK = {Kind.ONE: 0, Kind.JOINT: 1, Kind.NAMED: 1, Kind.POSE: 2, Kind.CONSTANT: 3, Kind.PRODUCT: 4,
         Kind.SUM: 5}  # fmt: skip


def number(value: float) -> str:
    """A number with twelve digits."""
    return f"{value:.12g}"


class Writer:
    """Writes the expressions of one graph."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph

    def __call__(self, e: Expression) -> str:
        """An expression."""
        return self.sum((e, ""))

    def sum(self, *terms: tuple[Expression, str]) -> str:
        """Expressions times symbols (1 for an empty one), added."""
        out = ""
        for e, symbol in terms:
            if not e[0]:
                continue
            for sign, words in [self._product(e, symbol)] if symbol else self._terms(e):
                if out:
                    out += f" {'-' if sign < 0 else '+'} {words}"
                else:
                    out = f"-{words}" if sign < 0 else words
        return out or "0"

    def _product(self, e: Expression, symbol: str) -> tuple[int, str]:
        """An expression times a symbol, with its sign."""
        if e[1] == ONE and abs(e[0]) == 1.0:
            return int(e[0]), symbol
        terms = self._terms(e)
        if len(terms) == 1:
            return terms[0][0], f"{terms[0][1]}*{symbol}"
        is_negative = all(sign < 0 for sign, _ in terms)
        inner = self(negative(e) if is_negative else e)
        return -1 if is_negative else 1, f"({inner})*{symbol}"

    def _terms(self, e: Expression) -> list[tuple[int, str]]:
        """Terms of a sum with their signs, a positive one first."""
        flat = sorted(self._flat(e), key=lambda t: self._order(t[1]))
        lead = next((i for i, t in enumerate(flat) if t[0] > 0), 0)
        if lead and not self._nested(flat[0][1]):
            flat.insert(0, flat.pop(lead))
        return [(1 if f > 0 else -1, self._term(abs(f), node)) for f, node in flat]

    def _nested(self, number: int) -> bool:
        """Whether a sum is in it: such a term stays in front with its minus, as in the book."""
        nodes, node = self.graph.nodes, self.graph.nodes[number]
        parts = {n for _, n in node.parts} if node.kind is Kind.PRODUCT else set()
        return len(parts) > 1 and any(
            nodes[n].kind is Kind.SUM or (nodes[n].kind is Kind.NAMED and nodes[n].name[0] == "B")
            for n in parts
        )

    def _flat(self, e: Expression) -> list[Expression]:
        factor, number = e
        node = self.graph.nodes[number]
        if node.kind is not Kind.SUM or abs(factor) != 1.0:
            return [e]
        return [t for f, n in node.parts for t in self._flat((factor * f, n))]

    def _order(self, number: int) -> tuple[int, int, int, str]:
        """Terms with x before those with y and z, the constants behind them."""
        axis, column = min(self._poses(number), default=(9, ""))
        return axis, -self.graph.leaves((1.0, number)), _RANK[self.graph.nodes[number].kind], column

    def _poses(self, number: int) -> list[tuple[int, str]]:
        node = self.graph.nodes[number]
        if node.kind is Kind.POSE:
            return [("xyz".index(node.name[1]), node.name[0])]
        if node.kind is Kind.NAMED and node.name[0] != "B":
            return []
        return [p for _, n in node.parts for p in self._poses(n)]

    def _term(self, factor: float, node: int) -> str:
        item = self.graph.nodes[node]
        factors = [n for _, n in item.parts] if item.kind is Kind.PRODUCT else [node]
        factors.sort(key=lambda n: (_RANK[self.graph.nodes[n].kind], self.graph.nodes[n].name, n))
        words = [number(factor)] if factor != 1.0 or node == ONE else []
        for n, equal in groupby(n for n in factors if n != ONE):
            of = self.graph.nodes[n]
            text = f"({self((1.0, n))})" if of.kind is Kind.SUM else of.name
            power = len(list(equal))
            words.append(text if power == 1 else f"{text}**{power}")
        return "*".join(words)
