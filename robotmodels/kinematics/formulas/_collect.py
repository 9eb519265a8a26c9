"""Polynomials as formulas a person reads: angles of parallel axes added, common parts drawn out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Any

from ...symbolic_dgm._angles import Angle
from ._chain import SymbolicChain
from ._ring import Poly

_LONGEST = 150
"""More terms than this are not tried in other forms."""

# one trigonometric part of a term: a power product of single joints, or a function of a sum
_Part = tuple[Any, ...]
_Terms = dict[tuple[_Part, ...], Poly]


def formula(p: Poly, chain: SymbolicChain) -> Any:
    """The shortest of several ways to write a polynomial."""
    import sympy

    if not p:
        return sympy.S.Zero
    plain = _plain_terms(p, chain)
    candidates = [_flat(plain, chain)]
    if len(p) <= _LONGEST:
        summed = _summed_terms(p, chain)
        forms = [plain] if summed is None or summed == plain else [plain, summed]
        candidates += [_flat(terms, chain) for terms in forms[1:]]
        for terms in forms:
            units = len(next(iter(terms)))
            orders: Iterable[Sequence[int]] = (range(units), range(units)[::-1])
            candidates += [_nested(terms, order, chain) for order in orders]
    facts = chain.notation.facts
    return min(candidates, key=lambda expr: (facts(expr).leaves, len(chain.notation.text(expr))))


def cleaned(p: Poly, chain: SymbolicChain) -> Poly:
    """Without the terms whose constants cancel in numbers, as lengths of opposite sign may."""
    ring, moving = chain.ring, chain.all_moving
    known = chain.constants()
    by_motion: dict[tuple[int, ...], Poly] = {}
    for monomial, coefficient in p.items():
        key = tuple(power if k in moving else 0 for k, power in enumerate(monomial))
        by_motion[key] = by_motion.get(key, ring.zero) + ring.ring({monomial: coefficient})
    out = ring.zero
    for key, part in by_motion.items():
        rest = ring.ring(
            {tuple(a - b for a, b in zip(m, key, strict=True)): c for m, c in part.items()}
        )
        sizes = [abs(float(ring.values(ring.ring({m: c}), known, ()))) for m, c in rest.items()]
        if abs(float(ring.values(rest, known, ()))) > 1e-12 * max(1e-3, *sizes):
            out += part
    return out


def _plain_terms(p: Poly, chain: SymbolicChain) -> _Terms:
    """Terms by the powers of each joint's cosine and sine; coefficients hold the rest."""
    units = [(j,) for j in _turning(chain)]
    return _split(p, chain, units, lambda powers: [(Fraction(1), tuple(powers))])


def _turning(chain: SymbolicChain) -> list[int]:
    return sorted(chain.cosine)


def _split(
    p: Poly,
    chain: SymbolicChain,
    units: Sequence[tuple[int, ...]],
    parts: Callable[[list[tuple[int, int, int]]], list[tuple[Fraction, _Part]]],
) -> _Terms:
    """Sort the terms of p by the part that each unit (joints whose axes are parallel) has."""
    ring = chain.ring
    places = {j: tuple(ring.index[s] for s in chain.cosine[j]) for j in _turning(chain)}
    own = {k for place in places.values() for k in place}
    out: _Terms = {}
    for monomial, coefficient in p.items():
        rest = ring.ring({tuple(0 if k in own else e for k, e in enumerate(monomial)): coefficient})
        options: list[tuple[Fraction, tuple[_Part, ...]]] = [(Fraction(1), ())]
        for unit in units:
            powers = [(j, monomial[places[j][0]], monomial[places[j][1]]) for j in unit]
            options = [
                (a * b, (*before, part))
                for a, before in options
                for b, part in parts([x for x in powers if x[1] or x[2]])
            ]
        for factor, key in options:
            term = rest * ring.ring.domain(factor.numerator, factor.denominator)
            out[key] = out.get(key, ring.zero) + term
    return {key: value for key, value in out.items() if value}


def _summed_terms(p: Poly, chain: SymbolicChain) -> _Terms | None:
    """Terms by sines and cosines of sums of parallel joints; None if a power is in the way."""
    units = chain.parallel_groups()
    grouped = {j for unit in units if len(unit) > 1 for j in unit}
    ring = chain.ring
    for monomial in p:
        for j in grouped:
            c, s = (ring.index[symbol] for symbol in chain.cosine[j])
            if monomial[c] + monomial[s] > 1:
                return None

    def parts(powers: list[tuple[int, int, int]]) -> list[tuple[Fraction, _Part]]:
        if all(j not in grouped for j, _, _ in powers):
            return [(Fraction(1), tuple(powers))]
        return _product_to_sum(powers)

    return _split(p, chain, units, parts)


def _product_to_sum(powers: list[tuple[int, int, int]]) -> list[tuple[Fraction, _Part]]:
    """Sines and cosines multiplied: those of sums and differences of the angles."""
    total: dict[tuple[str, tuple[tuple[int, int], ...]], Fraction] = {("C", ()): Fraction(1)}
    half = Fraction(1, 2)
    for j, cosine, _ in powers:
        new: dict[tuple[str, tuple[tuple[int, int], ...]], Fraction] = {}
        for (kind, angles), factor in total.items():
            plus, minus = (*angles, (j, 1)), (*angles, (j, -1))
            if kind == "C" and cosine:
                made = [("C", plus, half), ("C", minus, half)]
            elif kind == "C":
                made = [("S", plus, half), ("S", minus, -half)]
            elif cosine:
                made = [("S", plus, half), ("S", minus, half)]
            else:
                made = [("C", minus, half), ("C", plus, -half)]
            for letter, sum_, share in made:
                # the first angle of a sum counts positive
                sign = sum_[0][1]
                turned = tuple((k, sign * s) for k, s in sum_)
                value = factor * share * (sign if letter == "S" else 1)
                new[letter, turned] = new.get((letter, turned), Fraction(0)) + value
        total = {key: value for key, value in new.items() if value}
    return [(value, ("sum", *key)) for key, value in total.items()]


def _part_expression(part: _Part, chain: SymbolicChain) -> Any:
    import sympy

    if part and part[0] == "sum":
        _, letter, angles = part
        total = Angle()
        for j, sign in angles:
            total = total.plus(chain.angles[j].times(sign))
        if not angles:
            return sympy.S.One
        C, S = chain.notation.cos_sin(total)
        return C if letter == "C" else S
    out = sympy.S.One
    for j, c, s in part:
        C, S = chain.cosine[j]
        out *= C**c * S**s
    return out


def _coefficient(p: Poly, chain: SymbolicChain) -> Any:
    import sympy

    known = chain.coefficients.get(p)
    if known is None:
        expr = p.as_expr()
        roots = dict(zip(chain.ring.roots, (sympy.sqrt(2), sympy.sqrt(3)), strict=True))
        expr = expr.xreplace(roots)
        known = sympy.factor_terms(expr) if expr.is_Add else expr
        chain.coefficients[p] = known
    return known


def _flat(terms: _Terms, chain: SymbolicChain) -> Any:
    import sympy

    return sympy.Add(
        *(
            chain.notation.times(_product(key, chain), _coefficient(value, chain))
            for key, value in terms.items()
        )
    )


def _product(key: tuple[_Part, ...], chain: SymbolicChain) -> Any:
    import sympy

    return sympy.Mul(*(_part_expression(part, chain) for part in key))


def _nested(terms: _Terms, order: Sequence[int], chain: SymbolicChain) -> Any:
    """Common parts drawn out, one unit after another."""
    import sympy

    order = list(order)
    if not order:
        return sympy.Add(*(_coefficient(value, chain) for value in terms.values()))
    first, rest = order[0], order[1:]
    by_part: dict[_Part, _Terms] = {}
    for key, value in terms.items():
        by_part.setdefault(key[first], {})[key] = value
    out = sympy.S.Zero
    for part, inner in by_part.items():
        out += chain.notation.times(_part_expression(part, chain), _nested(inner, rest, chain))
    return out
