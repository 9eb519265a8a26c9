"""Polynomials in the unknown sines, cosines and lengths; their coefficients are known expressions.

A monomial is a sorted tuple of atoms: cosine, sine or length of an unknown. A polynomial in more
than two unknowns occurs in no equation of the catalogue and is replaced by None.
"""

from __future__ import annotations

from .expressions import ONE, ZERO, Expression, Graph

Monomial = tuple[int, ...]
Polynomial = dict[Monomial, Expression] | None
Vector = list[Polynomial]
Gathered = dict[Monomial, list[Expression]]

MOST_UNKNOWNS = 2


def cosine(unknown: int) -> int:
    """Atom of the cosine of an unknown angle."""
    return 2 * unknown


def sine(unknown: int) -> int:
    """Atom of the sine of an unknown angle."""
    return 2 * unknown + 1


length = cosine
"""Atom of an unknown length."""


def constant(e: Expression) -> Polynomial:
    """A polynomial without unknowns."""
    return {(): e} if e[0] else {}


def unknowns(p: dict[Monomial, Expression]) -> frozenset[int]:
    """Numbers of the unknowns in it."""
    return frozenset(atom >> 1 for monomial in p for atom in monomial)


def plus(graph: Graph, *terms: Polynomial) -> Polynomial:
    """Sum of polynomials."""
    kept = [t for t in terms if t is None or t]
    if len(kept) == 1:
        return kept[0]
    gathered: Gathered = {}
    for t in kept:
        if t is None:
            return None
        for monomial, e in t.items():
            gathered.setdefault(monomial, []).append(e)
    out = _summed(graph, gathered)
    return out if len(unknowns(out)) <= MOST_UNKNOWNS else None


def times(graph: Graph, p: Polynomial, q: Polynomial) -> Polynomial:
    """Product of two polynomials."""
    if p == {} or q == {}:
        return {}
    if p is None or q is None or len(unknowns(p) | unknowns(q)) > MOST_UNKNOWNS:
        return None
    gathered: Gathered = {}
    for m, a in p.items():
        for n, b in q.items():
            monomial = tuple(sorted(m + n)) if m and n else m or n
            gathered.setdefault(monomial, []).append(graph.product(a, b))
    return _summed(graph, gathered)


def _summed(graph: Graph, gathered: Gathered) -> dict[Monomial, Expression]:
    out = {m: parts[0] if len(parts) == 1 else graph.sum(parts) for m, parts in gathered.items()}
    return {monomial: e for monomial, e in out.items() if e[0]}


def scaled(graph: Graph, e: Expression, p: Polynomial) -> Polynomial:
    """A polynomial times a known expression."""
    if e[0] == 0.0 or p == {}:
        return {}
    if p is None or e == (1.0, ONE):
        return p
    return {monomial: graph.product(e, a) for monomial, a in p.items()}


def minus(p: Polynomial) -> Polynomial:
    """The negative."""
    return None if p is None else {monomial: (-e[0], e[1]) for monomial, e in p.items()}


def part(p: dict[Monomial, Expression], *atoms: int) -> Expression:
    """Coefficient of a monomial."""
    return p.get(tuple(sorted(atoms)), ZERO)
