"""Factors of a polynomial in sines and cosines.

Such polynomials have no unique factors as they stand (S^2 = (1 - C)(1 + C)), but as functions of
the half-angle tangents t they do, up to powers of 1 + t^2: there C = (1 - t^2)/(1 + t^2) and
S = 2 t/(1 + t^2). What splits is brought back to sines and cosines if that is possible without
half angles.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Any

from ._chain import SymbolicChain
from ._collect import cleaned
from ._ring import Poly

_LONGEST = 200
"""Polynomials of more terms are not factored beyond their sines, cosines and strokes."""
_LONGEST_IN_TANGENTS = 400
_PRIMES = (3, 7, 11, 19, 23, 31, 43, 47, 59, 67, 71, 79, 83, 103, 107, 127, 131, 139, 151, 163)


@dataclass(frozen=True, slots=True)
class Factored:
    """``constant`` times the product of the powers."""

    constant: Poly
    factors: tuple[tuple[Poly, int], ...]
    complete: bool  # whether every factor is known to be irreducible


def factored(p: Poly, chain: SymbolicChain) -> Factored:
    """Factors of a polynomial, those without joint variables gathered in the constant."""
    ring, moving = chain.ring, chain.all_moving
    p = cleaned(p, chain)
    if not p:
        return Factored(ring.zero, (), True)
    found: dict[Poly, int] = {}
    constant, rest = _monomials(p, chain, found)
    rest = _squares(rest, chain, found)
    part = _constant_part(rest, chain)
    constant, rest = constant * part, rest.exquo(part)
    complete = True
    if ring.is_constant(rest, moving):
        constant = constant * rest
    else:
        parts, complete = _split(rest, chain)
        for one in parts:
            content, one = _normal(one)
            constant = constant * content
            found[one] = found.get(one, 0) + 1
    # what SymPy's divisions return is equal to the same polynomial, but hashes otherwise
    fresh: dict[Poly, int] = {}
    for one, power in found.items():
        same = ring.ring(dict(one))
        fresh[same] = fresh.get(same, 0) + power
    return Factored(constant, tuple(fresh.items()), complete)


def _normal(p: Poly) -> tuple[Any, Poly]:
    """Whole coefficients without a common divisor, the first one positive."""
    content, p = p.primitive()
    if p.LC < 0:
        content, p = -content, -p
    return content, p


def _monomials(p: Poly, chain: SymbolicChain, found: dict[Poly, int]) -> tuple[Poly, Poly]:
    """Draw out what divides every term: constants, and strokes, sines and cosines."""
    ring, moving = chain.ring, chain.all_moving
    lowest = [min(powers) for powers in zip(*p, strict=True)]
    constant = ring.one
    for k, power in enumerate(lowest):
        if not power:
            continue
        generator = ring.ring.gens[k]
        if k in moving:
            found[generator] = found.get(generator, 0) + power
        else:
            constant = constant * generator**power
    rest = ring.ring(
        {tuple(a - b for a, b in zip(m, lowest, strict=True)): c for m, c in p.items()}
    )
    return constant, rest


def _squares(p: Poly, chain: SymbolicChain, found: dict[Poly, int]) -> Poly:
    """Draw out sines hidden in 1 - C^2: written with squares of sines they divide every term."""
    ring = chain.ring
    gens = ring.ring.gens
    again = True
    while again:
        again = False
        for j in chain.cosine:
            c, s = (ring.index[symbol] for symbol in chain.cosine[j])
            turned = _without_squares(p, c, 1 - gens[s] ** 2, ring.ring)
            if min(monomial[s] for monomial in turned) > 0:
                found[gens[s]] = found.get(gens[s], 0) + 1
                p = ring.reduced(turned.exquo(gens[s]))
                again = True
            if min(monomial[c] for monomial in p) > 0:
                found[gens[c]] = found.get(gens[c], 0) + 1
                p = p.exquo(gens[c])
                again = True
    return p


def _without_squares(p: Poly, k: int, square: Poly, ring: Any) -> Poly:
    out = ring.zero
    for monomial, coefficient in p.items():
        half, rest = divmod(monomial[k], 2)
        lower = list(monomial)
        lower[k] = rest
        out += ring({tuple(lower): coefficient}) * square**half
    return out


def _constant_part(p: Poly, chain: SymbolicChain) -> Poly:
    """The common divisor of the coefficients, as (RL2 + RL3) of (RL2 + RL3)*C4."""
    ring, moving = chain.ring, chain.all_moving
    by_motion: dict[tuple[int, ...], Poly] = {}
    for monomial, coefficient in p.items():
        key = tuple(power if k in moving else 0 for k, power in enumerate(monomial))
        rest = tuple(0 if k in moving else power for k, power in enumerate(monomial))
        by_motion[key] = by_motion.get(key, ring.zero) + ring.ring({rest: coefficient})
    if any(len(part) == 1 for part in by_motion.values()):
        return ring.one  # monomials are drawn out already
    common = ring.zero
    for part in by_motion.values():
        common = common.gcd(part)
        if len(common) == 1:
            return ring.one
    return common


def _split(p: Poly, chain: SymbolicChain) -> tuple[list[Poly], bool]:
    """Factors of what has no simple ones, and whether they are known to be irreducible."""
    if len(p) > _LONGEST:
        return [p], False
    tangents = _Tangents(p, chain)
    # with numbers for the constants it is quick, and what does not split then does not at all
    quick = tangents.factors(numbers=True)
    if sum(power for _, power in quick) <= 1:
        return [p], tangents.has_all_roots(quick)
    if tangents.length > _LONGEST_IN_TANGENTS:
        return [p], False
    parts: list[Poly] = []
    for factor, power in tangents.factors(numbers=False):
        back = tangents.to_angles(factor)
        if back is None:
            return [p], False
        parts += [back] * power
    ring = chain.ring
    whole = ring.one
    for part in parts:
        whole = ring.times(whole, part)
    if not whole or ring.reduced(whole * p.LC - p * whole.LC):
        return [p], False
    ratio = p.LC / whole.LC
    return [parts[0] * ratio, *parts[1:]], True


class _Tangents:
    """A polynomial as a function of the tangents of half its joint angles."""

    def __init__(self, p: Poly, chain: SymbolicChain) -> None:
        ring = chain.ring
        self.p, self.chain = p, chain
        present = ring.occurring(p)
        pairs = [tuple(ring.index[s] for s in pair) for pair in chain.cosine.values()]
        self.pairs = [pair for pair in pairs if set(pair) & present]
        turning = {k for pair in self.pairs for k in pair}
        self.others = sorted(present - turning)
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
        t = tangents.gens
        values: dict[int, Any] = dict(zip(kept, t[len(self.pairs) :], strict=True))
        if numbers:
            primes = [_PRIMES[n % len(_PRIMES)] for n in range(len(self.others))]
            values = dict(zip(self.others, primes, strict=True)) | values
        whole = tangents.zero
        for monomial, coefficient in self.p.items():
            term = tangents.ground_new(coefficient)
            for k in self.others:
                term = term * values[k] ** monomial[k]
            for (c, s), degree, tangent in zip(self.pairs, self.degrees, t, strict=False):
                a, b = monomial[c], monomial[s]
                one = 1 + tangent**2
                term = term * (1 - tangent**2) ** a * (2 * tangent) ** b * one ** (degree - a - b)
            whole += term
        moving = {*range(len(self.pairs)), *(len(self.pairs) + kept.index(k) for k in strokes)}
        return [
            (factor, power)
            for factor, power in whole.factor_list()[1]
            if any(m[k] for m in factor for k in moving)
        ]

    def has_all_roots(self, factors: list[tuple[Poly, int]]) -> bool:
        """Whether no power of 1 + C is among the factors, whose tangent is infinite."""
        return all(
            sum(power * max(m[k] for m in factor) for factor, power in factors) == 2 * degree
            for k, degree in enumerate(self.degrees)
        )

    def to_angles(self, factor: Poly) -> Poly | None:
        """A factor in sines and cosines; None if it needs half angles."""
        ring = self.chain.ring
        gens = ring.ring.gens
        count = len(self.pairs)
        degrees = [max(m[k] for m in factor) for k in range(count)]
        if any(degree % 2 for degree in degrees):
            return None
        out = ring.zero
        for monomial, coefficient in factor.items():
            term = ring.ring.ground_new(coefficient)
            for k, power in zip(self.others, monomial[count:], strict=True):
                term = term * gens[k] ** power
            for (c, s), power, degree in zip(self.pairs, monomial, degrees, strict=False):
                C, S = gens[c], gens[s]
                odd = power % 2
                # t^power / (1 + t^2)^(degree/2), by the squares of half-angle sine and cosine
                term = term * (S / 2) ** odd if odd else term
                term = term * ((1 - C) / 2) ** ((power - odd) // 2)
                term = term * ((1 + C) / 2) ** ((degree - power - odd) // 2)
            out += ring.reduced(term)
        return out
