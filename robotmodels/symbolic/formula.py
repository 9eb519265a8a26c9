"""Polynomials as short formulas: angles of parallel axes added, common parts factored out."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product
from math import prod
from typing import Any

from .angles import Angle
from .polynomials import Poly, PolynomialChain

_LONGEST = 150
"""Polynomials with more terms are written in one form only."""

_Part = tuple[Any, ...]
"""Trigonometric part of a term: powers of single joints, or a function of a sum of angles."""
_Terms = dict[tuple[_Part, ...], Poly]


def formula(p: Poly, chain: PolynomialChain) -> Any:
    """The shortest of several ways to write a polynomial."""
    import sympy

    if not p:
        return sympy.S.Zero
    forms = [_terms(p, chain, [(j,) for j in sorted(chain.cosine)])]
    candidates = []
    if len(p) <= _LONGEST:
        units = chain.parallel_groups
        grouped = [chain.moving[j] for unit in units if len(unit) > 1 for j in unit]
        # the power of a sine or cosine has no simple form in sums of angles
        if grouped and all(sum(m[k] for k in own) <= 1 for own in grouped for m in p):
            forms.append(_terms(p, chain, units))
        for terms in forms:
            order = range(len(next(iter(terms))))
            candidates += [_nested(terms, o, chain) for o in (order, order[::-1])]
    candidates = [_flat(terms, chain) for terms in forms] + candidates
    return min(candidates, key=chain.notation.size)


def formulas(entries: Sequence[Poly], chain: PolynomialChain) -> list[Any]:
    """Formulas of several polynomials without the terms that cancel in numbers."""
    return [formula(chain.cleaned(p), chain) for p in entries]


def _terms(p: Poly, chain: PolynomialChain, units: Sequence[tuple[int, ...]]) -> _Terms:
    """Terms of p by the trigonometric part of each unit: a joint, or joints of parallel axes."""
    ring = chain.ring
    places = {j: [ring.index[s] for s in pair] for j, pair in chain.cosine.items()}
    own = frozenset(k for place in places.values() for k in place)
    out: _Terms = {}
    for monomial, rest in ring.collected(p, own).items():
        options = []
        for unit in units:
            powers = [(j, *(monomial[k] for k in places[j])) for j in unit]
            powers = [x for x in powers if x[1] or x[2]]
            sums = len(unit) > 1 and powers
            options.append(_product_to_sum(powers) if sums else {tuple(powers): Fraction(1)})
        for choice in product(*(option.items() for option in options)):
            key = tuple(part for part, _ in choice)
            factor = prod((f for _, f in choice), start=Fraction(1))
            term = rest * ring.ring.domain(factor.numerator, factor.denominator)
            out[key] = out.get(key, ring.zero) + term
    return {key: value for key, value in out.items() if value}


def _product_to_sum(powers: Sequence[tuple[int, ...]]) -> dict[_Part, Fraction]:
    """A product of sines and cosines by those of sums and differences of the angles."""
    half = Fraction(1, 2)
    total: dict[_Part, Fraction] = {("C", ()): Fraction(1)}
    for j, cosine, _ in powers:
        new: dict[_Part, Fraction] = {}
        for (kind, angles), factor in total.items():
            # C C, C S, S C and S S, each by the function of the sum and of the difference
            other = kind if cosine else "S" if kind == "C" else "C"
            plus = -half if kind == "S" and not cosine else half
            minus = -half if kind == "C" and not cosine else half
            for sign, share in ((1, plus), (-1, minus)):
                both = (*angles, (j, sign))
                first = both[0][1]  # the first angle of a sum counts positive
                part = (other, tuple((k, first * s) for k, s in both))
                value = factor * share * (first if other == "S" else 1)
                new[part] = new.get(part, Fraction(0)) + value
        total = {part: value for part, value in new.items() if value}
    return {("sum", *part): value for part, value in total.items()}


def _expression(part: _Part, chain: PolynomialChain) -> Any:
    import sympy

    if not part or part[0] != "sum":
        pairs = ((chain.cosine[j], powers) for j, *powers in part)
        return sympy.Mul(
            *(f**k for pair, powers in pairs for f, k in zip(pair, powers, strict=True))
        )
    _, letter, angles = part
    total = Angle()
    for j, sign in angles:
        total = total.plus(chain.angles[j].times(sign))
    C, S = chain.notation.cos_sin(total) if angles else (sympy.S.One, sympy.S.Zero)
    return C if letter == "C" else S


def _coefficient(p: Poly, chain: PolynomialChain) -> Any:
    import sympy

    if p not in chain.coefficients:
        expr = chain.ring.expression(p)
        chain.coefficients[p] = sympy.factor_terms(expr) if expr.is_Add else expr
    return chain.coefficients[p]


def _flat(terms: _Terms, chain: PolynomialChain) -> Any:
    import sympy

    def term(key: tuple[_Part, ...], value: Poly) -> Any:
        parts = sympy.Mul(*(_expression(part, chain) for part in key))
        return chain.notation.times(parts, _coefficient(value, chain))

    return sympy.Add(*(term(key, value) for key, value in terms.items()))


def _nested(terms: _Terms, order: Sequence[int], chain: PolynomialChain) -> Any:
    """Common parts factored out, one unit after another."""
    import sympy

    if not order:
        return sympy.Add(*(_coefficient(value, chain) for value in terms.values()))
    by_part: dict[_Part, _Terms] = {}
    for key, value in terms.items():
        by_part.setdefault(key[order[0]], {})[key] = value
    return sympy.Add(
        *(
            chain.notation.times(_expression(part, chain), _nested(inner, order[1:], chain))
            for part, inner in by_part.items()
        )
    )
