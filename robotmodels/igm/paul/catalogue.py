"""Recognition of the types of equations, and their order of preference."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from ..._arrays import Array
from .equations import Equation
from .expressions import ONE, ZERO, Expression, Graph, Kind, negative
from .polynomials import cosine, length, part, sine
from .types import EquationType
from .unknowns import Joints


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """Equations of the catalogue that give one or two unknowns: a candidate, a step of a plan.

    ``unknowns`` in the order in which the type names them; ``coefficients`` in the order of its
    formula (X, Y, Z of type 2; X1, Y1, Z1, X2, Y2, Z2 of type 3; ...).
    """

    type: EquationType
    unknowns: tuple[int, ...]
    coefficients: tuple[Expression, ...]
    equations: tuple[Equation, ...]


Rows = tuple[tuple[list[Expression], Expression], ...]
"""Of each equation the coefficients of its atoms, and the rest."""
_WEAK = 1e-6
_MOST_ROWS = 8
"""Equations in the same unknowns that are combined in pairs: the shortest."""


def candidates(equations: Sequence[Equation], joints: Joints) -> list[Step]:
    """Everything of the catalogue that is found among equations."""
    single: dict[int, list[Equation]] = {}
    double: dict[object, list[Equation]] = {}
    for equation in equations:
        if len(equation.unknowns) == 1:
            single.setdefault(next(iter(equation.unknowns)), []).append(equation)
        else:
            double.setdefault((equation.unknowns, equation.split), []).append(equation)
    out: list[Step] = []
    for number, group in single.items():
        of = _lengths if joints.unknowns[number].slides else _angles
        out += of(number, group, joints)
    for find in (_pair, _polynomial):
        if out:
            break
        for group in double.values():
            short = sorted(group, key=lambda e: (not e.of_position, e.length))[:_MOST_ROWS]
            a, b = sorted(short[0].unknowns)
            for pair in permutations(short, 2):
                found = (find(i, j, pair, joints) for i, j in ((a, b), (b, a)))
                out += [step for step in found if step is not None]
    return out


def cost(c: Step, joints: Joints) -> tuple[float, ...]:
    """Cost of a candidate: few unknowns, position, one solution, short formulas."""
    graph, rank = joints.graph, c.type.rank
    items = [joints.unknowns[u] for u in c.unknowns]
    if c.type is EquationType.TYPE_3:
        X1, Y1, _, X2, Y2, _ = c.coefficients
        rank = 0 if graph.is_constant(graph.determinant(X1, Y1, X2, Y2)) else 1
    if c.type is EquationType.TYPE_1 and not graph.is_constant(c.coefficients[0]):
        rank = 4
    return (
        len(frozenset().union(*(e.unknowns for e in c.equations))),
        any(not _is_position(e, joints) for e in c.equations),
        rank,
        sum(len(i.terms) > 1 for i in items),
        min(j for i in items for j, _ in i.terms),
        sum(e.length for e in c.equations) + 3 * sum(e.split.inverse for e in c.equations),
        sum(graph.leaves(x) for x in c.coefficients),
        sum(e.split.s - e.split.p for e in c.equations),
    )


def _is_position(equation: Equation, joints: Joints) -> bool:
    """Whether it compares positions, and no unknown joint was moved behind the pose."""
    moved = range(equation.split.p, joints.form.k)
    return equation.of_position and all(joints.knows(j) for j in moved)


def _rows(equations: Sequence[Equation], *atoms: int) -> Rows | None:
    """Coefficients of single atoms and of 1 in equations that have nothing else."""
    allowed = {(), *((a,) for a in atoms)}
    if not all(allowed.issuperset(e.polynomial) for e in equations):
        return None
    return tuple(([part(e.polynomial, a) for a in atoms], part(e.polynomial)) for e in equations)


def _times(sign: float, *parts: Expression) -> tuple[Expression, ...]:
    return tuple((sign * f, n) for f, n in parts)


def _strong(graph: Graph, *parts: Expression) -> bool:
    """Whether an amplitude is away from zero at most postures."""
    size: Array = np.sqrt(sum(graph.values(e) ** 2 for e in parts))
    return float(np.median(size)) > _WEAK


def _lengths(number: int, group: list[Equation], joints: Joints) -> Iterable[Step]:
    graph, r = joints.graph, length(number)
    for e in group:
        powers = tuple(part(e.polynomial, *[r] * i) for i in range(5))
        degree = max(map(len, e.polynomial))
        if degree == 1 and _strong(graph, powers[1]):
            yield Step(EquationType.TYPE_1, (number,), (powers[1], negative(powers[0])), (e,))
        elif 1 < degree <= 4:
            yield Step(EquationType.POLYNOMIAL, (number,), powers, (e,))


def _angles(number: int, group: list[Equation], joints: Joints) -> Iterable[Step]:
    graph, of = joints.graph, (number,)
    rows: list[tuple[Equation, Expression, Expression, Expression]] = []
    for e in group:
        found = _rows((e,), sine(number), cosine(number))
        if found is None:
            continue
        (((X, Y), k),) = found
        if not _strong(graph, X, Y):
            continue
        rows.append((e, X, Y, negative(k)))
        if k[0]:
            yield Step(EquationType.TYPE_2, of, (X, Y, negative(k)), (e,))
        else:
            yield Step(EquationType.TYPE_2_ZERO, of, _signed(number, X, Y, joints), (e,))
    rows.sort(key=lambda row: (not _is_position(row[0], joints), row[0].length))
    for a, b in combinations(rows[:_MOST_ROWS], 2):
        (x1, y1, _), (x2, y2, _) = (map(graph.values, row[1:]) for row in (a, b))
        size = np.hypot(x1, y1) * np.hypot(x2, y2)
        if np.median(np.abs(x1 * y2 - x2 * y1) / np.maximum(size, 1e-300)) < 1e-2:
            continue
        for one, two in ((a, b), (b, a)):
            direct = _direct(graph, one[1:], two[1:])
            if direct is not None:
                yield Step(EquationType.TYPE_3_DIRECT, of, direct, (one[0], two[0]))
                break
        else:
            yield Step(EquationType.TYPE_3, of, (*a[1:], *b[1:]), (a[0], b[0]))


def _direct(
    graph: Graph, of_sine: tuple[Expression, ...], of_cosine: tuple[Expression, ...]
) -> tuple[Expression, ...] | None:
    """``W S = A, W C = B`` with a constant W > 0, if the two equations are of this form."""
    (X1, Y1, Z1), (X2, Y2, Z2) = of_sine, of_cosine
    if Y1[0] or X2[0] or X1[1] != Y2[1] or abs(X1[0]) != abs(Y2[0]) or not graph.is_constant(X1):
        return None
    sign = 1.0 if graph.values(X1)[0] > 0 else -1.0
    same = sign if X1[0] == Y2[0] else -sign
    return (*_times(sign, X1, Z1), *_times(same, Z2))


def _signed(number: int, X: Expression, Y: Expression, joints: Joints) -> tuple[Expression, ...]:
    """The sign of type 2 with Z = 0: ``atan2(-Y, X)`` is the solution that is named first.

    Of a wrist it is the one with a positive sine of the angle between the aligned axes, as in the
    book; else the one that needs fewer minus signs.
    """
    other = positive_sine(number, X, Y, joints)
    if other is not None:
        return _times(float(np.sign(other[1])), X, Y)

    def weight(e: Expression) -> int:
        node = joints.graph.nodes[e[1]]
        parts = node.parts if node.kind is Kind.SUM else ((1.0, e[1]),)
        return sum(1 if e[0] * f > 0 else -1 for f, _ in parts)

    return _times(-1.0 if weight(X) < weight(Y) else 1.0, X, Y)


def positive_sine(
    number: int, X: Expression, Y: Expression, joints: Joints
) -> tuple[int, float] | None:
    """A joint whose sine is ``X C - Y S`` up to a factor, and that factor."""
    graph = joints.graph
    angle = joints.samples(number)
    along = graph.values(X) * np.cos(angle) - graph.values(Y) * np.sin(angle)
    own = [j for j, _ in joints.unknowns[number].terms]
    for j in joints.group:
        ratio = along / np.sin(joints.postures[:, j])
        if j not in own and np.ptp(ratio) <= 1e-9 * np.abs(ratio).max():
            return j, float(ratio[0])
    return None


def _pair(i: int, j: int, pair: tuple[Equation, Equation], joints: Joints) -> Step | None:
    """Types 4 to 8: two equations in two unknowns; i is solved first, but for type 4."""
    graph = joints.graph
    i_slides, j_slides = (joints.unknowns[u].slides for u in (i, j))
    if j_slides:
        with_sine, with_cosine = (tuple(sorted((length(j), u))) for u in (sine(i), cosine(i)))
        p, q = (e.polynomial for e in pair)
        if i_slides or not {with_sine, ()} >= p.keys() or not {with_cosine, ()} >= q.keys():
            return None
        values = (p[with_sine], negative(part(p)), q[with_cosine], negative(part(q)))
        if not _strong(graph, values[0]) or not _strong(graph, values[2]):
            return None
        return Step(EquationType.TYPE_4, (j, i), values, pair)
    own = (length(i),) if i_slides else (sine(i), cosine(i))
    rows = _rows(pair, sine(j), cosine(j), *own)
    if rows is None:
        return None
    if not i_slides:
        return _two_angles(i, j, rows, pair, joints)
    ((s1, c1, r1), k1), ((s2, c2, r2), k2) = rows
    if not (r1[0] or r2[0]) or c1[0] or s2[0]:
        return None
    if not _strong(graph, s1) or not _strong(graph, c2):
        return None
    values = (s1, negative(k1), negative(r1), c2, negative(k2), negative(r2))
    return Step(EquationType.TYPE_5, (i, j), values, pair)


def _two_angles(
    i: int, j: int, rows: Rows, pair: tuple[Equation, Equation], joints: Joints
) -> Step | None:
    """Types 6 to 8."""
    graph = joints.graph
    ((sj1, cj1, si1, ci1), k1), (second, rest) = rows
    for sign in (1.0, -1.0):
        # an equation and its negative are the same
        sj, cj, s2, c2, k = _times(sign, *second, rest)
        if ci1 != s2 or negative(si1) != c2 or not _strong(graph, ci1, si1):
            continue
        if not graph.is_constant(sj1) or not graph.is_constant(cj1):
            continue
        zero = not (sj1[0] or si1[0] or cj[0] or c2[0])
        if zero and cj1 == sj and graph.is_constant(ci1) and _is_sum(i, j, joints):
            positive = 1.0 if ci1[0] > 0 else -1.0
            values = _times(positive, ci1, cj1, negative(k1), negative(k))
            return Step(EquationType.TYPE_8, (i, j), values, pair)
        right = _times(-1.0, ci1, si1, k1, k)
        if not cj1[0] and not sj[0] and sj1 == cj:
            values = _times(1.0 if sj1[0] > 0 else -1.0, sj1, *right)
            return Step(EquationType.TYPE_6, (i, j), values, pair)
        for sense in (1.0, -1.0):
            if sj == (sense * cj1[0], cj1[1]) and cj == (-sense * sj1[0], sj1[1]):
                values = (cj1, sj1, *right, (sense, ONE))
                return Step(EquationType.TYPE_7, (i, j), values, pair)
    return None


def _is_sum(i: int, j: int, joints: Joints) -> bool:
    """Whether the angle j is the sum of i and another joint, both seen from the same frame."""
    a, b = joints.unknowns[i].span, joints.unknowns[j].span
    return a is not None and b is not None and (a.group, a.a) == (b.group, b.a) and a.b < b.b


def _polynomial(i: int, j: int, pair: tuple[Equation, Equation], joints: Joints) -> Step | None:
    """The angle j eliminated from two equations: degree two in a length, a quartic in an angle."""
    slides, graph = joints.unknowns[i].slides, joints.graph
    if joints.unknowns[j].slides or pair[0].row > pair[1].row:
        return None
    own = (length(i),) if slides else (cosine(i), sine(i))
    rows = _rows(pair, sine(j), cosine(j), *own)
    if rows is None:
        return None
    ((s1, c1, *x1), k1), ((s2, c2, *x2), k2) = rows
    det = graph.determinant(s1, c1, s2, c2)
    if not (slides or graph.is_constant(det)) or not _strong(graph, det):
        return None
    # det (Sj, Cj) = minus the adjugate times what is left: squares added are det^2
    u, v = [], []
    for x, y in zip((k1, *x1), (k2, *x2), strict=True):
        u.append(graph.determinant(x, c1, y, c2))
        v.append(graph.determinant(s1, x, s2, y))

    def squares(m: int, n: int, factor: float = 1.0) -> tuple[Expression, ...]:
        return _times(factor, graph.product(u[m], u[n]), graph.product(v[m], v[n]))

    def total(*terms: tuple[Expression, ...]) -> Expression:
        return graph.sum(e for term in terms for e in term)

    halves = () if slides else (squares(1, 1, 0.5), squares(2, 2, 0.5))
    a0 = total(squares(0, 0), *halves, (negative(graph.product(det, det)),))
    a1 = total(squares(0, 1, 2.0))
    if slides:
        powers = (a0, a1, total(squares(1, 1)), ZERO, ZERO)
        return Step(EquationType.POLYNOMIAL, (i,), powers, pair)
    a3 = total(squares(1, 1, 0.5), squares(2, 2, -0.5))
    a2, a4 = total(squares(0, 2, 2.0)), total(squares(1, 2))
    return Step(EquationType.QUARTIC, (i,), (a0, a1, a2, a3, a4), pair)
