"""Which angles and lengths are known, and the sines and cosines of sums about parallel axes.

Revolute joints whose axes are parallel, whatever slides between them, form a group. Its running
sums of angles are points on a line: ``Phi_0 = 0, Phi_1, ...``; a joint's angle, or the sum of
several, is the difference of two of them. Solving an angle ties two points together, so that a sum
that is known (theta_234 of a UR arm) is used as readily as a joint that is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..._arrays import Array
from .expressions import ONE, UNIT, ZERO, Expression, Graph, Kind, negative
from .normal_form import NormalForm, Row
from .polynomials import Polynomial, constant, cosine, length, plus, scaled, sine

CosSin = tuple[Expression, Expression]


class JointSum(NamedTuple):
    """A sum of angles: the difference of two running sums of a group."""

    group: int
    a: int
    b: int


@dataclass(frozen=True, slots=True)
class Unknown:
    """A variable of the equations: an angle (a joint's or a sum), or the length of a joint.

    ``terms`` are the joints whose variables add up to it, with their signs.
    """

    span: JointSum | None
    terms: tuple[tuple[int, float], ...]
    slides: bool
    name: str
    latex: str


@dataclass(slots=True)
class Solved:
    """A span whose angle a step gave: the symbols of its cosine and sine."""

    span: JointSum
    unknown: int
    cos: Expression
    sin: Expression


class Joints:
    """The joints of an arm, the groups of parallel ones, and what is known of them so far."""

    def __init__(self, form: NormalForm, graph: Graph, rotations: list[list[list[Expression]]],
                 postures: Array) -> None:  # fmt: skip
        self.form, self.graph, self.postures = form, graph, postures
        self.unknowns: list[Unknown] = []
        self._numbers: dict[object, int] = {}
        self.lengths: dict[int, Expression] = {}  # of solved sliding joints
        self.solved: list[Solved] = []
        self.group: dict[int, tuple[int, int, float]] = {}  # joint: group, place, sense
        self.members: list[list[int]] = []
        self._grouped(rotations)
        self._root = [list(range(len(m) + 1)) for m in self.members]
        self.shortest = False  # write an unknown angle by the shortest sum, or from the first joint

    def _grouped(self, rotations: list[list[list[Expression]]]) -> None:
        sense = 1.0
        between: Array = np.eye(3)
        for j, row in enumerate(self.form.rows):
            between = between @ np.array([[self.graph.values(e)[0] for e in r]
                                          for r in rotations[j]])  # fmt: skip
            if row.sigma:
                continue
            parallel = abs(abs(between[2, 2]) - 1.0) < 1e-15
            if self.members and parallel:
                sense *= float(np.sign(between[2, 2]))
                self.members[-1].append(j)
            else:
                sense = 1.0
                self.members.append([j])
            self.group[j] = len(self.members) - 1, len(self.members[-1]) - 1, sense
            between = np.eye(3)

    def sense(self, span: JointSum) -> float:
        """Sense of the first joint of a span within its group."""
        return self.group[self.members[span.group][min(span.a, span.b)]][2]

    def terms(self, span: JointSum) -> tuple[tuple[int, float], ...]:
        """Joints of a span a < b with their signs, the first one positive."""
        joints = self.members[span.group][span.a : span.b]
        first = self.sense(span)
        return tuple((j, first * self.group[j][2]) for j in joints)

    def sum_of(self, j: int) -> JointSum:
        """JointSum of one revolute joint."""
        group, place, _ = self.group[j]
        return JointSum(group, place, place + 1)

    def row(self, j: int) -> Row:
        """Constants of a joint."""
        return self.form.rows[j]

    def _letters(self, terms: tuple[tuple[int, float], ...], latex: bool = False) -> str:
        wide = max(row.frame for row in self.form.rows) > 9
        # in LaTeX a sum that subtracts shows all its signs: S_{12-4} reads as 12 minus 4
        signed = latex and any(sign < 0 for _, sign in terms)
        between = "+" if signed else ("," if latex else "_") if wide else ""
        out = ""
        for j, sign in terms:
            minus = ("-" if latex else "m") if sign < 0 else ""
            out += (minus or (between if out else "")) + str(self.row(j).frame)
        return out

    def unknown(self, key: JointSum | int) -> int:
        """Number of the unknown of a span (a < b) or of a sliding joint."""
        if key not in self._numbers:
            span = key if isinstance(key, JointSum) else None
            terms = self.terms(key) if isinstance(key, JointSum) else ((key, 1.0),)
            letters = self._letters(terms), self._letters(terms, latex=True)
            self._numbers[key] = len(self.unknowns)
            self.unknowns.append(Unknown(span, terms, span is None, *letters))
        return self._numbers[key]

    def samples(self, number: int) -> Array:
        """Values of an unknown at the sample postures."""
        terms = self.unknowns[number].terms
        return np.sum([sign * self.postures[:, j] for j, sign in terms], axis=0)

    def symbols(self, number: int) -> CosSin:
        """Symbols of the cosine and sine of an angle, or of a length (with 0)."""
        item, values = self.unknowns[number], self.samples(number)
        if item.slides:
            name, latex = f"r{item.name}", f"r_{{{item.latex}}}"
            return self.graph.symbol(Kind.JOINT, name, latex, values), ZERO
        C = self.graph.symbol(Kind.JOINT, f"C{item.name}", f"C_{{{item.latex}}}", np.cos(values))
        S = self.graph.symbol(Kind.JOINT, f"S{item.name}", f"S_{{{item.latex}}}", np.sin(values))
        return C, S

    def settle(self, number: int) -> None:
        """Count an unknown as known from now on."""
        item = self.unknowns[number]
        C, S = self.symbols(number)
        if item.span is None:
            self.lengths[item.terms[0][0]] = C
            return
        self.solved.append(Solved(item.span, number, C, S))
        root = self._root[item.span.group]
        low, high = sorted((root[item.span.a], root[item.span.b]))
        self._root[item.span.group] = [low if r == high else r for r in root]

    def knows(self, j: int) -> bool:
        """Whether a joint is known by itself."""
        if self.row(j).sigma:
            return j in self.lengths
        group, place, _ = self.group[j]
        return self._root[group][place] == self._root[group][place + 1]

    def path(self, span: JointSum) -> list[tuple[Solved, float]]:
        """Solved spans that add up to a known one, with their signs in the sense of the group."""
        seen: dict[int, list[tuple[Solved, float]]] = {span.a: []}
        waiting = [span.a]
        while waiting:
            at = waiting.pop(0)
            for solved in self.solved:
                if solved.span.group != span.group:
                    continue
                for start, end, sign in ((solved.span.a, solved.span.b, 1.0),
                                        (solved.span.b, solved.span.a, -1.0)):  # fmt: skip
                    if start == at and end not in seen:
                        seen[end] = [*seen[at], (solved, sign)]
                        waiting.append(end)
        return seen[span.b]

    def parts_of(self, j: int) -> list[tuple[float, int]]:
        """Unknowns that add up to the angle of a joint that is known, with their signs."""
        sense, path = self.group[j][2], self.path(self.sum_of(j))
        return [(sense * sign * self.sense(s.span), s.unknown) for s, sign in path]

    def _added(self, a: CosSin, b: CosSin) -> CosSin:
        """Cosine and sine of the sum of two angles."""
        (C1, S1), (C2, S2), dot = a, b, self.graph.dot
        return dot((C1, C2), (negative(S1), S2)), dot((S1, C2), (C1, S2))

    def _known(self, span: JointSum) -> CosSin:
        """Cosine and sine of ``Phi_b - Phi_a``, which is known, in the sense of the group."""
        if span.a == span.b:
            return UNIT, ZERO
        if span.a > span.b:
            C, S = self._known(JointSum(span.group, span.b, span.a))
            return C, negative(S)
        sense, path, (C, S) = self.sense(span), self.path(span), (UNIT, ZERO)
        for solved, sign in path:
            sine = (sign * self.sense(solved.span) * solved.sin[0], solved.sin[1])
            C, S = self._added((C, S), (solved.cos, sine))
        if len(path) > 1:
            terms = self.terms(span)
            letters, latex = self._letters(terms), self._letters(terms, latex=True)
            C = self.graph.named(f"C{letters}", f"C_{{{latex}}}", C)
            S = self.graph.named(f"S{letters}", f"S_{{{latex}}}", (sense * S[0], S[1]))
            S = (sense * S[0], S[1])
        return C, S

    def cos_sin(self, span: JointSum, sign: float) -> tuple[Polynomial, Polynomial]:
        """Cosine and sine of ``sign (Phi_b - Phi_a)`` as polynomials."""
        root = self._root[span.group]
        ra, rb = root[span.a], root[span.b]
        if ra == rb:
            C, S = self._known(span)
            return constant(C), constant((sign * S[0], S[1]))
        if self.shortest:
            ends = ((abs(a - b), a, b) for a in range(len(root)) for b in range(len(root))
                    if root[a] == ra and root[b] == rb)  # fmt: skip
            _, ra, rb = min(ends)
        key = JointSum(span.group, min(ra, rb), max(ra, rb))
        number = self.unknown(key)
        turn = self.sense(key) * (1.0 if ra < rb else -1.0)
        c: Polynomial = {(cosine(number),): UNIT}
        s: Polynomial = {(sine(number),): (turn, ONE)}
        # the rest, Phi_b - Phi_rb + Phi_ra - Phi_a, is known
        behind, before = JointSum(span.group, rb, span.b), JointSum(span.group, span.a, ra)
        g, (C, S) = self.graph, self._added(self._known(behind), self._known(before))
        total = plus(g, scaled(g, C, s), scaled(g, S, c))
        return plus(g, scaled(g, C, c), scaled(g, negative(S), s)), scaled(g, (sign, ONE), total)

    def length(self, j: int) -> Polynomial:
        """Length of a sliding joint."""
        if j in self.lengths:
            return constant(self.lengths[j])
        return {(length(self.unknown(j)),): UNIT}

    @property
    def has_alternatives(self) -> bool:
        """Whether unknown angles can be written in more than one way."""
        return any(1 < len(set(root)) < len(root) for root in self._root)
