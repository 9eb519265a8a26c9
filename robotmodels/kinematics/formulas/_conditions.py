"""Which factors have to vanish together for all minors of a matrix to vanish."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any

from ._chain import SymbolicChain
from ._factoring import factored
from ._ring import Poly

_MOST_SETS = 300

Key = Hashable
"""A polynomial, or the entries of a matrix whose determinant is not written out."""


def families(
    minors: Sequence[Sequence[Any]],
    chain: SymbolicChain,
    impossible: Callable[[frozenset[Any]], bool],
) -> list[frozenset[Any]] | None:
    """Smallest sets of factors such that every minor is zero where those of a set are."""
    cases: list[frozenset[Any]] = [frozenset()]
    reduced = _Reduced(chain)
    for minor in sorted(minors, key=lambda factors: sum(_length(p) for p in factors)):
        grown: set[frozenset[Any]] = set()
        for case in cases:
            options: set[frozenset[Any]] = set()
            for p in minor:
                parts = reduced(p, case)
                if parts is None:
                    options = {case}
                    break
                options |= {case | {part} for part in parts}
            grown |= {option for option in options if not impossible(option)}
        cases = [s for s in grown if not any(other < s for other in grown)]
        if len(cases) > _MOST_SETS:
            return None
    return cases


def _length(p: Any) -> int:
    return 10**6 if isinstance(p, tuple) else len(p)


class _Reduced:
    """Factors of a polynomial where some sines, cosines and strokes are zero."""

    def __init__(self, chain: SymbolicChain) -> None:
        self.chain = chain
        self._known: dict[tuple[Poly, frozenset[int]], tuple[Poly, ...] | None] = {}
        self._partner = {a: b for pair in chain.ring.pairs for a, b in (pair, pair[::-1])}

    def __call__(self, p: Any, case: frozenset[Any]) -> tuple[Any, ...] | None:
        """What has to vanish for p to vanish, one of these; None if p vanishes already."""
        if p in case:
            return None
        if isinstance(p, tuple):
            return (p,)
        zeros = frozenset(k for one in case if (k := self._generator(one)) is not None)
        zeros &= self.chain.ring.occurring(p) | {
            self._partner[k] for k in self.chain.ring.occurring(p) if k in self._partner
        }
        if not zeros:
            return (p,)
        if (p, zeros) not in self._known:
            self._known[p, zeros] = self._factors(p, zeros)
        parts = self._known[p, zeros]
        return None if parts is None or any(part in case for part in parts) else parts

    def _generator(self, p: Any) -> int | None:
        """Number of the sine, cosine or stroke that p is."""
        if isinstance(p, tuple) or len(p) != 1:
            return None
        (monomial,) = p
        return next(iter(self.chain.ring.occurring(p))) if sum(monomial) == 1 else None

    def _factors(self, p: Poly, zeros: frozenset[int]) -> tuple[Poly, ...] | None:
        ring = self.chain.ring
        out = ring.zero
        # where a sine is zero the cosine is 1 or -1, so that its square is 1
        units = {self._partner[k] for k in zeros if k in self._partner}
        for monomial, coefficient in p.items():
            if any(monomial[k] for k in zeros):
                continue
            lower = tuple(e % 2 if k in units else e for k, e in enumerate(monomial))
            out += ring.ring({lower: coefficient})
        if not out:
            return None
        found = factored(out, self.chain)
        if not found.constant:
            return None
        return tuple(q for q, _ in found.factors if self._generator(q) not in units)
