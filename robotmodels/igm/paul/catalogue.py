"""How the types of equations are recognised, and which of them is taken first."""

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
class Candidate:
    """Equations of the catalogue that give one or two unknowns.

    ``unknowns`` in the order in which the type names them; ``coefficients`` in the order of its
    formula (X, Y, Z of type 2; X1, Y1, Z1, X2, Y2, Z2 of type 3; ...).
    """

    type: EquationType
    unknowns: tuple[int, ...]
    coefficients: tuple[Expression, ...]
    equations: tuple[Equation, ...]


_WEAK = 1e-6
_MOST_ROWS = 8
"""Equations in the same unknowns that are combined in pairs: the shortest."""


def candidates(equations: Sequence[Equation], joints: Joints) -> list[Candidate]:
    """Everything of the catalogue that is found among equations."""
    single: dict[int, list[Equation]] = {}
    double: dict[object, list[Equation]] = {}
    for equation in equations:
        if len(equation.unknowns) == 1:
            single.setdefault(next(iter(equation.unknowns)), []).append(equation)
        else:
            double.setdefault((equation.unknowns, equation.split), []).append(equation)
    out: list[Candidate] = []
    for number, group in single.items():
        of = _lengths if joints.unknowns[number].slides else _angles
        out += of(number, group, joints)
    if out:
        return out
    for find in (_pair, _polynomial):
        for group in double.values():
            short = sorted(group, key=lambda e: (not e.of_position, e.length))[:_MOST_ROWS]
            a, b = sorted(short[0].unknowns)
            for first, second in permutations(short, 2):
                for i, j in ((a, b), (b, a)):
                    found = find(i, j, first, second, joints)
                    if found is not None:
                        out.append(found)
        if out:
            return out
    return out


def cost(c: Candidate, joints: Joints) -> tuple[float, ...]:
    """Price of a candidate: few unknowns, position, one solution, short formulas."""
    graph = joints.graph
    items = [joints.unknowns[u] for u in c.unknowns]
    order = _ORDER[c.type]
    if c.type is EquationType.TYPE_3 and not graph.is_constant(_determinant(c, graph)):
        order = 1
    if c.type is EquationType.TYPE_1 and not graph.is_constant(c.coefficients[0]):
        order = 4
    return (
        len(frozenset().union(*(e.unknowns for e in c.equations))),
        any(not _is_position(e, joints) for e in c.equations),
        order,
        sum(len(i.terms) > 1 for i in items),
        min(j for i in items for j, _ in i.terms),
        sum(e.length for e in c.equations) + 3 * sum(e.split.inverse for e in c.equations),
        sum(graph.leaves(x) for x in c.coefficients),
        sum(e.split.s - e.split.p for e in c.equations),
    )


_ORDER = {
    EquationType.TYPE_1: 0, EquationType.TYPE_3_DIRECT: 0, EquationType.TYPE_3: 0,
    EquationType.TYPE_2_ZERO: 2, EquationType.TYPE_2: 3, EquationType.TYPE_4: 0,
    EquationType.TYPE_5: 2, EquationType.TYPE_8: 1, EquationType.TYPE_6: 3,
    EquationType.TYPE_7: 4, EquationType.POLYNOMIAL: 5, EquationType.QUARTIC: 6,
}  # fmt: skip


def _is_position(equation: Equation, joints: Joints) -> bool:
    """Whether it compares positions, and no unknown joint was moved behind the pose."""
    moved = range(equation.split.p, joints.form.k)
    return equation.of_position and all(joints.knows(j) for j in moved)


def _determinant(c: Candidate, graph: Graph) -> Expression:
    X1, Y1, _, X2, Y2, _ = c.coefficients
    return graph.sum((graph.product(X1, Y2), negative(graph.product(X2, Y1))))


def _rows(equation: Equation, *atoms: int) -> tuple[list[Expression], Expression] | None:
    """Coefficients of single atoms and of 1 in an equation that has nothing else."""
    p = equation.polynomial
    allowed = {(), *((a,) for a in atoms)}
    if not allowed.issuperset(p):
        return None
    return [part(p, a) for a in atoms], part(p)


def _strong(graph: Graph, *parts: Expression) -> bool:
    """Whether an amplitude is away from zero at most postures."""
    size: Array = np.sqrt(sum(graph.values(e) ** 2 for e in parts))
    return float(np.median(size)) > _WEAK


def _lengths(number: int, group: list[Equation], joints: Joints) -> Iterable[Candidate]:
    graph, r = joints.graph, length(number)
    for e in group:
        p = e.polynomial
        degree = max(len(m) for m in p)
        if degree == 1 and _strong(graph, part(p, r)):
            found = Candidate(EquationType.TYPE_1, (number,), (part(p, r), negative(part(p))),
                              (e,))  # fmt: skip
            yield found
        elif 1 < degree <= 4:
            powers = tuple(part(p, *[r] * i) for i in range(5))
            yield Candidate(EquationType.POLYNOMIAL, (number,), powers, (e,))  # fmt: skip


def _angles(number: int, group: list[Equation], joints: Joints) -> Iterable[Candidate]:
    graph, C, S = joints.graph, cosine(number), sine(number)
    rows: list[tuple[Equation, Expression, Expression, Expression]] = []
    for e in group:
        found = _rows(e, S, C)
        if found is None:
            continue
        (X, Y), k = found
        if not _strong(graph, X, Y):
            continue
        rows.append((e, X, Y, negative(k)))
        if k[0]:
            one = Candidate(EquationType.TYPE_2, (number,), (X, Y, negative(k)), (e,))
        else:
            signed = _signed(number, X, Y, joints)
            one = Candidate(EquationType.TYPE_2_ZERO, (number,), signed, (e,))
        yield one
    rows.sort(key=lambda row: (not _is_position(row[0], joints), row[0].length))
    for a, b in combinations(rows[:_MOST_ROWS], 2):
        (_, X1, Y1, Z1), (_, X2, Y2, Z2) = a, b
        det = graph.values(X1) * graph.values(Y2) - graph.values(X2) * graph.values(Y1)
        size = np.hypot(graph.values(X1), graph.values(Y1))
        size = size * np.hypot(graph.values(X2), graph.values(Y2))
        if np.median(np.abs(det) / np.maximum(size, 1e-300)) < 1e-2:
            continue
        pair = (a[0], b[0])
        direct = _direct(graph, a[1:], b[1:])
        if direct is None:
            turned = _direct(graph, b[1:], a[1:])
            if turned is not None:
                direct, pair = turned, (b[0], a[0])
        one = (
            Candidate(EquationType.TYPE_3, (number,), (X1, Y1, Z1, X2, Y2, Z2), pair)
            if direct is None
            else Candidate(EquationType.TYPE_3_DIRECT, (number,), direct, pair)
        )
        yield one


def _direct(
    graph: Graph, of_sine: tuple[Expression, ...], of_cosine: tuple[Expression, ...]
) -> tuple[Expression, ...] | None:
    """``W S = A, W C = B`` with a constant W > 0, if the two equations are of this form."""
    (X1, Y1, Z1), (X2, Y2, Z2) = of_sine, of_cosine
    if Y1[0] or X2[0] or X1[1] != Y2[1] or abs(X1[0]) != abs(Y2[0]) or not graph.is_constant(X1):
        return None
    sign = 1.0 if graph.values(X1)[0] > 0 else -1.0
    same = sign if X1[0] == Y2[0] else -sign
    return (sign * X1[0], X1[1]), (sign * Z1[0], Z1[1]), (same * Z2[0], Z2[1])


def _signed(
    number: int, X: Expression, Y: Expression, joints: Joints
) -> tuple[Expression, Expression]:
    """The sign of type 2 with Z = 0: ``atan2(-Y, X)`` is the solution that is named first.

    Of a wrist it is the one with a positive sine of the angle between the aligned axes, as in the
    book; else the one that needs fewer minus signs.
    """
    graph = joints.graph
    other = positive_sine(number, X, Y, joints)
    if other is not None:
        return (X, Y) if other[1] > 0 else (negative(X), negative(Y))

    def weight(e: Expression) -> int:
        node = graph.nodes[e[1]]
        parts = node.parts if node.kind is Kind.SUM else ((1.0, e[1]),)
        return sum(1 if e[0] * f > 0 else -1 for f, _ in parts)

    if weight(X) - weight(Y) < 0:
        return negative(X), negative(Y)
    return X, Y


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


def _pair(i: int, j: int, first: Equation, second: Equation, joints: Joints) -> Candidate | None:
    """Two equations in two unknowns; i is solved first."""
    a, b = joints.unknowns[i], joints.unknowns[j]
    if a.slides and b.slides:
        return None
    if b.slides:
        return _products(i, j, first, second, joints)
    if a.slides:
        return _length_and_angle(i, j, first, second, joints)
    return _two_angles(i, j, first, second, joints)


def _products(
    i: int, j: int, first: Equation, second: Equation, joints: Joints
) -> Candidate | None:
    """Type 4: an angle i and a length j that multiplies its sine and cosine."""
    r, C, S = length(j), cosine(i), sine(i)
    p, q = first.polynomial, second.polynomial
    with_sine, with_cosine = tuple(sorted((r, S))), tuple(sorted((r, C)))
    if not {with_sine, ()}.issuperset(p) or not {with_cosine, ()}.issuperset(q):
        return None
    coefficients = (p[with_sine], negative(part(p)), q[with_cosine], negative(part(q)))
    if not _strong(joints.graph, coefficients[0]) or not _strong(joints.graph, coefficients[2]):
        return None
    return Candidate(EquationType.TYPE_4, (j, i), coefficients, (first, second))


def _length_and_angle(
    i: int, j: int, first: Equation, second: Equation, joints: Joints
) -> Candidate | None:
    """Length i and angle j: type 5, or the polynomial of degree two in the length."""
    graph = joints.graph
    one, two = (_rows(e, sine(j), cosine(j), length(i)) for e in (first, second))
    if one is None or two is None:
        return None
    ((s1, c1, r1), k1), ((s2, c2, r2), k2) = one, two
    if not r1[0] and not r2[0]:
        return None
    if not c1[0] and not s2[0] and _strong(graph, s1) and _strong(graph, c2):
        values = (s1, negative(k1), negative(r1), c2, negative(k2), negative(r2))
        return Candidate(EquationType.TYPE_5, (i, j), values, (first, second))
    return None


def _two_angles(
    i: int, j: int, first: Equation, second: Equation, joints: Joints
) -> Candidate | None:
    """Types 6 to 8, or a quartic in angle i."""
    graph = joints.graph
    one, two = (_rows(e, sine(j), cosine(j), sine(i), cosine(i)) for e in (first, second))
    if one is None or two is None:
        return None
    ((sj1, cj1, si1, ci1), k1), ((sj2, cj2, si2, ci2), k2) = one, two
    pair = (first, second)
    for sign in (1.0, -1.0):
        # an equation and its negative are the same
        s2, c2, k = ((sign * f, n) for f, n in (si2, ci2, k2))
        if ci1 != s2 or negative(si1) != c2 or not _strong(graph, ci1, si1):
            continue
        sj, cj = ((sign * f, n) for f, n in (sj2, cj2))
        eighth = _type_8(i, j, (cj1, sj1, ci1, si1, k1), (sj, cj, s2, c2, k), pair, joints)
        if eighth is not None:
            return eighth
        right = (negative(ci1), negative(si1), negative(k1), negative(k))
        if not graph.is_constant(sj1) or not graph.is_constant(cj1):
            continue
        if not cj1[0] and not sj[0] and sj1 == cj:
            positive = 1.0 if sj1[0] > 0 else -1.0
            values = tuple((positive * f, n) for f, n in (sj1, *right))
            return Candidate(EquationType.TYPE_6, (i, j), values, pair)
        for sense in (1.0, -1.0):
            if sj == (sense * cj1[0], cj1[1]) and cj == (-sense * sj1[0], sj1[1]):
                values = (cj1, sj1, *right, (sense, ONE))
                return Candidate(EquationType.TYPE_7, (i, j), values, pair)
    return None


def _type_8(
    i: int,
    j: int,
    first: tuple[Expression, ...],
    second: tuple[Expression, ...],
    pair: tuple[Equation, Equation],
    joints: Joints,
) -> Candidate | None:
    """Type 8: j is the sum of i and another joint, both seen from the same frame.

    ``first`` is in Cj, Sj, Ci, Si, 1 and ``second`` in Sj, Cj, Si, Ci, 1.
    """
    graph = joints.graph
    if any(e[0] for e in (first[1], first[3], second[1], second[3])):
        return None
    if first[0] != second[0] or first[2] != second[2]:
        return None
    a, b = joints.unknowns[i].span, joints.unknowns[j].span
    if a is None or b is None or a.group != b.group or a.a != b.a or not a.b < b.b:
        return None
    if not graph.is_constant(first[0]) or not graph.is_constant(first[2]):
        return None
    sign = 1.0 if first[2][0] > 0 else -1.0
    terms = (first[2], first[0], negative(first[4]), negative(second[4]))
    values = tuple((sign * f, n) for f, n in terms)
    return Candidate(EquationType.TYPE_8, (i, j), values, pair)


def _polynomial(
    i: int, j: int, first: Equation, second: Equation, joints: Joints
) -> Candidate | None:
    """The angle j eliminated from two equations: a polynomial in i."""
    if joints.unknowns[j].slides or first.row > second.row:
        return None
    if joints.unknowns[i].slides:
        return _in_a_length(i, j, first, second, joints)
    return _in_an_angle(i, j, first, second, joints)


def _in_a_length(
    i: int, j: int, first: Equation, second: Equation, joints: Joints
) -> Candidate | None:
    """Degree two in the length i."""
    graph = joints.graph
    one, two = (_rows(e, sine(j), cosine(j), length(i)) for e in (first, second))
    if one is None or two is None:
        return None
    ((s1, c1, r1), k1), ((s2, c2, r2), k2) = one, two
    product, add = graph.product, graph.sum
    det = add((product(s1, c2), negative(product(s2, c1))))
    if not _strong(graph, det):
        return None
    # det (S, C) = -(adjugate) (k + r_i), squares added
    u = [add((product(c2, x), negative(product(c1, y)))) for x, y in ((k1, k2), (r1, r2))]
    v = [add((product(s1, y), negative(product(s2, x)))) for x, y in ((k1, k2), (r1, r2))]
    a0 = add((product(u[0], u[0]), product(v[0], v[0]), negative(product(det, det))))
    a1 = add((product((2.0, ONE), u[0], u[1]), product((2.0, ONE), v[0], v[1])))
    a2 = add((product(u[1], u[1]), product(v[1], v[1])))
    powers = (a0, a1, a2, ZERO, ZERO)
    return Candidate(EquationType.POLYNOMIAL, (i,), powers, (first, second))


def _in_an_angle(
    i: int, j: int, first: Equation, second: Equation, joints: Joints
) -> Candidate | None:
    """A quartic in the angle i."""
    graph = joints.graph
    one, two = (_rows(e, sine(j), cosine(j), sine(i), cosine(i)) for e in (first, second))
    if one is None or two is None:
        return None
    ((sj1, cj1, si1, ci1), k1), ((sj2, cj2, si2, ci2), k2) = one, two
    pair = (first, second)
    product, add = graph.product, graph.sum
    det = add((product(sj1, cj2), negative(product(sj2, cj1))))
    if not graph.is_constant(det) or not _strong(graph, det):
        return None
    # det (Sj, Cj) = minus the adjugate times (k + c Ci + s Si): squares added
    u, v = [], []
    for x, y in ((k1, k2), (ci1, ci2), (si1, si2)):
        u.append(add((product(cj2, x), negative(product(cj1, y)))))
        v.append(add((product(sj1, y), negative(product(sj2, x)))))
    dot = lambda m, n: (product(u[m], u[n]), product(v[m], v[n]))  # noqa: E731
    half = lambda m, n: [product((0.5, ONE), e) for e in dot(m, n)]  # noqa: E731
    twice = lambda m, n: [product((2.0, ONE), e) for e in dot(m, n)]  # noqa: E731
    a0 = add((*dot(0, 0), *half(1, 1), *half(2, 2), negative(product(det, det))))
    a3 = add((*half(1, 1), *map(negative, half(2, 2))))
    quartic = (a0, add(twice(0, 1)), add(twice(0, 2)), a3, add(dot(1, 2)))
    return Candidate(EquationType.QUARTIC, (i,), quartic, pair)
