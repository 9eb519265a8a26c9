"""Factors of a polynomial in sines and cosines.

Such polynomials have no unique factors as they stand (S^2 = (1 - C)(1 + C)), but as functions of
the half-angle tangents t they do, up to powers of 1 + t^2: there C = (1 - t^2)/(1 + t^2) and
S = 2 t/(1 + t^2). Factors are brought back to sines and cosines if that is possible without half
angles.
"""

from __future__ import annotations

from collections import Counter
from math import prod
from typing import Any

from .polynomials import Poly, PolynomialChain

_LONGEST = 200
"""Polynomials of more terms are not factored beyond their sines, cosines and strokes."""
_LONGEST_IN_TANGENTS = 400
_PRIMES = (3, 7, 11, 19, 23, 31, 43, 47, 59, 67, 71, 79, 83, 103, 107, 127, 131, 139, 151, 163)


def factored(p: Poly, chain: PolynomialChain) -> tuple[Poly, dict[Poly, int]]:
    """Constant and powers of the factors in which a joint variable occurs."""
    ring = chain.ring
    p = chain.cleaned(p)
    if not p:
        return ring.zero, {}
    found: Counter[Poly] = Counter()
    rest = _without_variables(p, chain, found)
    # the common divisor of the coefficients, as (RL2 + RL3) of (RL2 + RL3)*C4
    constant = ring.zero
    for part in ring.collected(rest, chain.all_moving).values():
        constant = constant.gcd(part)
    rest = rest.exquo(constant)
    if not ring.occurring(rest) & chain.all_moving:
        return constant * rest, dict(found)
    for factor in _tangent_factors(rest, chain):
        # whole coefficients without a common divisor, the first one positive
        content, factor = factor.primitive()
        if factor.LC < 0:
            content, factor = -content, -factor
        constant = constant * content
        # SymPy's quotients equal the same polynomial, but have other hashes
        found[ring.ring(dict(factor))] += 1
    return constant, dict(found)


def _without_variables(p: Poly, chain: PolynomialChain, found: Counter[Poly]) -> Poly:
    """Take out strokes, sines and cosines; a sine hidden in 1 - C^2 divides its form in sines."""
    ring = chain.ring
    cosine_of = {s: c for c, s in ring.pairs}
    again = True
    while again:
        again = False
        for k in chain.all_moving:
            own = ring.gens[k]
            form = ring.replaced(p, cosine_of[k], 1 - own**2) if k in cosine_of else p
            lowest = min(monomial[k] for monomial in form)
            if lowest:
                found[own] += lowest
                p = ring.reduced(form.exquo(own**lowest))
                again = True
    return p


def _tangent_factors(p: Poly, chain: PolynomialChain) -> list[Poly]:
    """Factors of a polynomial without simple ones; itself if none are found."""
    if len(p) > _LONGEST:
        return [p]
    ring, tangents = chain.ring, _Tangents(p, chain)
    # with numbers for the constants it is quick, and an irreducible result is irreducible
    if sum(power for _, power in tangents.factors(numbers=True)) <= 1:
        return [p]
    if tangents.length > _LONGEST_IN_TANGENTS:
        return [p]
    parts: list[Poly] = []
    whole = ring.one
    for factor, power in tangents.factors(numbers=False):
        back = tangents.to_angles(factor)
        if back is None:
            return [p]
        for _ in range(power):
            parts.append(back)
            whole = ring.times(whole, back)
    if not whole or ring.reduced(whole * p.LC - p * whole.LC):
        return [p]
    return [parts[0] * (p.LC / whole.LC), *parts[1:]]


class _Tangents:
    """A polynomial as a function of the tangents of half its joint angles."""

    def __init__(self, p: Poly, chain: PolynomialChain) -> None:
        ring = chain.ring
        self.p, self.chain = p, chain
        present = ring.occurring(p)
        pairs = [tuple(ring.index[s] for s in pair) for pair in chain.cosine.values()]
        self.pairs = [pair for pair in pairs if set(pair) & present]
        self.others = sorted(present - {k for pair in self.pairs for k in pair})
        self.degrees = [max(m[c] + m[s] for m in p) for c, s in self.pairs]
        self.length = len(p) * prod(1 + d for d in self.degrees)

    def factors(self, numbers: bool) -> list[tuple[Poly, int]]:
        """Those in which a joint occurs, the constants as prime numbers or as they are."""
        import sympy
        from sympy.polys.rings import ring

        strokes = [k for k in self.others if k in self.chain.all_moving]
        kept = strokes if numbers else self.others
        names = [f"t{c}" for c, _ in self.pairs] + [f"k{k}" for k in kept]
        tangents = ring(names, sympy.QQ)[0]
        count = len(self.pairs)
        values: dict[int, Any] = {
            k: _PRIMES[n % len(_PRIMES)] for n, k in enumerate(self.others)
        } | dict(zip(kept, tangents.gens[count:], strict=True))
        whole = tangents.zero
        for monomial, coefficient in self.p.items():
            term = tangents.ground_new(coefficient)
            for k in self.others:
                term = term * values[k] ** monomial[k]
            for (c, s), degree, t in zip(self.pairs, self.degrees, tangents.gens, strict=False):
                a, b = monomial[c], monomial[s]
                term = term * (1 - t**2) ** a * (2 * t) ** b * (1 + t**2) ** (degree - a - b)
            whole += term
        moving = {*range(count), *(count + kept.index(k) for k in strokes)}
        return [
            (factor, power)
            for factor, power in whole.factor_list()[1]
            if any(m[k] for m in factor for k in moving)
        ]

    def to_angles(self, factor: Poly) -> Poly | None:
        """A factor in sines and cosines; None if it needs half angles."""
        ring = self.chain.ring
        count = len(self.pairs)
        degrees = [max(m[k] for m in factor) for k in range(count)]
        if any(degree % 2 for degree in degrees):
            return None
        out = ring.zero
        for monomial, coefficient in factor.items():
            term = ring.ring.ground_new(coefficient)
            for k, power in zip(self.others, monomial[count:], strict=True):
                term = term * ring.gens[k] ** power
            for (c, s), power, degree in zip(self.pairs, monomial, degrees, strict=False):
                C, S = ring.gens[c], ring.gens[s]
                # t^power / (1 + t^2)^(degree/2), by the squares of half-angle sine and cosine
                half, odd = divmod(power, 2)
                whole = ((1 - C) / 2) ** half * ((1 + C) / 2) ** ((degree - power - odd) // 2)
                term = term * whole * (S / 2) ** odd
            out += ring.reduced(term)
        return out
