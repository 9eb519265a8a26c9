"""Sets of factors that have to vanish together for all minors of a matrix to vanish."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..kinematics import SingularityKind
from .factor import SingularityFactor
from .factoring import factored
from .polynomial_chain import PolynomialChain
from .ring import Poly

_MOST_SETS = 300


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingularityCondition:
    """Factors that are zero together in a family of singular positions.

    Parameters
    ----------
    factors : tuple of SingularityFactor
        One for a square matrix; for others every minor must have a factor that vanishes.
    kind : SingularityKind
        That of all its factors, else OTHER.
    text : str
        Such as ``"S2 = 0 and C3 = 0"``.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.symbolic import explain_singularities
    >>> iiwa = explain_singularities(load("iiwa14"))
    >>> [c.text for c in iiwa.conditions]
    ['S4 = 0', 'S2 = 0 and C3 = 0', 'S2 = 0 and S6 = 0', 'C5 = 0 and S6 = 0']
    >>> iiwa.conditions[0].holds(np.zeros(7))
    np.True_
    """

    factors: tuple[SingularityFactor, ...]
    kind: SingularityKind
    text: str

    def holds(self, q: ArrayLike, tolerance: float = 1e-9) -> Any:
        """Whether every factor is smaller than a tolerance (in its unit) at q (..., n)."""
        return np.all([np.abs(f.values(q)) <= tolerance for f in self.factors], axis=0)

    def __repr__(self) -> str:
        return f"<SingularityCondition {self.kind.value}: {self.text:.60}>"


def smallest_sets(
    minors: Sequence[Sequence[Any]],
    chain: PolynomialChain,
    impossible: Callable[[frozenset[Any]], bool],
) -> list[frozenset[Any]] | None:
    """Smallest sets of factors whose zeros are zeros of every minor; None if they are too many.

    A factor is a polynomial, or the entries of a matrix whose determinant is not written out.
    """
    cases: list[frozenset[Any]] = [frozenset()]
    reduced = _Reduced(chain)
    for minor in sorted(minors, key=lambda factors: sum(map(_length, factors))):
        grown: set[frozenset[Any]] = set()
        for case in cases:
            parts = [reduced(p, case) for p in minor]
            if None in parts:
                grown.add(case)
            else:
                grown |= {case | {part} for found in parts for part in found or ()}
        grown = {option for option in grown if not impossible(option)}
        cases = [s for s in grown if not any(other < s for other in grown)]
        if len(cases) > _MOST_SETS:
            return None
    return cases


def _length(p: Any) -> int:
    return 10**6 if isinstance(p, tuple) else len(p)


class _Reduced:
    """Factors of a polynomial where some sines, cosines and strokes are zero."""

    def __init__(self, chain: PolynomialChain) -> None:
        self.chain = chain
        self._known: dict[Any, tuple[Poly, ...] | None] = {}
        self._partner = {a: b for pair in chain.ring.pairs for a, b in (pair, pair[::-1])}

    def __call__(self, p: Any, case: frozenset[Any]) -> tuple[Any, ...] | None:
        """Factors of which one has to vanish for p to vanish; None if p vanishes already."""
        if p in case:
            return None
        if isinstance(p, tuple):
            return (p,)
        zeros = frozenset(k for factor in case if (k := self._generator(factor)) is not None)
        present = self.chain.ring.occurring(p)
        zeros &= present | {self._partner[k] for k in present if k in self._partner}
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
        return monomial.index(1) if sum(monomial) == 1 else None

    def _factors(self, p: Poly, zeros: frozenset[int]) -> tuple[Poly, ...] | None:
        ring = self.chain.ring
        # where a sine is zero the cosine is 1 or -1, so that its square is 1
        units = {self._partner[k] for k in zeros if k in self._partner}
        left = {m: c for m, c in p.items() if not any(m[k] for k in zeros)}
        out = ring.ring(left) if left else ring.zero
        for k in units:
            out = ring.replaced(out, k, ring.one)
        if not out:
            return None
        found = factored(out, self.chain)
        if not found.constant:
            return None
        return tuple(q for q, _ in found.factors if self._generator(q) not in units)
