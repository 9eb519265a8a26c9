"""Products of the arm's matrices and their inverses, as polynomials in the unknowns.

They are multiplied out from the right, column by column, so that coefficients come nested as the
book prints them: ``C23 (C1 ax + S1 ay) + S23 az``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .expressions import UNIT, ZERO, Expression, Graph, negative
from .polynomials import Vector, constant, minus, plus, scaled, times
from .unknowns import Joints, JointSum

Rotation = list[list[Expression]]
IDENTITY: Rotation = [[UNIT if i == j else ZERO for j in range(3)] for i in range(3)]


@dataclass(frozen=True, slots=True)
class Motion:
    """``M_j``, or its inverse if ``sign`` is -1."""

    joint: int
    sign: int


@dataclass(frozen=True, slots=True, eq=False)
class Fixed:
    """A known matrix: axes ``R`` and origin ``p``; ``table`` if it is made of the table alone."""

    R: Rotation
    p: list[Expression]
    table: bool = True

    def inverse(self, graph: Graph) -> Fixed:
        """The inverse matrix."""
        R = [[self.R[j][i] for j in range(3)] for i in range(3)]
        p = [negative(graph.dot(*zip(row, self.p, strict=True))) for row in R]
        return Fixed(R, p, self.table)


Item = Motion | Fixed


@dataclass(slots=True)
class _Segment:
    """Turns about parallel axes that follow each other, what they carry, then a fixed rotation."""

    span: JointSum | None
    sign: float
    rotation: Rotation
    carried: list[tuple[JointSum | None, Vector]]


def product(items: Sequence[Item], joints: Joints) -> list[Vector]:
    """The product of matrices as its four columns s, n, a, P of three polynomials each."""
    graph = joints.graph
    columns: list[Vector] = [[constant(e) for e in row] for row in (*IDENTITY, [ZERO] * 3)]
    for segment in reversed(_segments(items, joints)):
        columns = [_turned(segment, segment.span, _mapped(segment.rotation, c, graph), joints)
                   for c in columns]  # fmt: skip
        for span, vector in segment.carried:
            moved = _turned(segment, span, vector, joints)
            columns[3] = [plus(graph, a, b) for a, b in zip(moved, columns[3], strict=True)]
    return columns


def _segments(items: Sequence[Item], joints: Joints) -> list[_Segment]:
    graph = joints.graph
    out = [_Segment(None, 1.0, IDENTITY, [])]
    for item in items:
        now = out[-1]
        is_empty = not (now.span or now.carried) and now.rotation == IDENTITY
        if isinstance(item, Fixed):
            if not item.table and not is_empty:
                now = _Segment(None, 1.0, IDENTITY, [])
                out.append(now)
            if any(e[0] for e in item.p):
                vector: Vector = [constant(e) for e in item.p]
                now.carried.append((now.span, _mapped(now.rotation, vector, graph)))
            now.rotation = turned(now.rotation, item.R, graph)
            continue
        if joints.row(item.joint).sigma:
            along_z = scaled(graph, (float(item.sign), 0), joints.length(item.joint))
            now.carried.append((now.span, _mapped(now.rotation, [{}, {}, along_z], graph)))
            continue
        group, place, sense = joints.group[item.joint]
        start, end = (place, place + 1) if item.sign > 0 else (place + 1, place)
        along = now.rotation[2][2]
        parallel = along[1] == 0 and abs(along[0]) == 1.0
        if now.span is not None and parallel and now.span.group == group and now.span.b == start:
            now.span = JointSum(group, now.span.a, end)
            continue
        # sign: the sense of the group as the axes of this frame have it
        segment = _Segment(JointSum(group, start, end), sense, IDENTITY, [])
        out[len(out) - is_empty :] = [segment]
    return out


def _turned(segment: _Segment, span: JointSum | None, v: Vector, joints: Joints) -> Vector:
    if span is None or (v[0] == {} and v[1] == {}):
        return v
    graph = joints.graph
    C, S = joints.cos_sin(span, segment.sign)
    return [
        plus(graph, times(graph, C, v[0]), minus(times(graph, S, v[1]))),
        plus(graph, times(graph, S, v[0]), times(graph, C, v[1])),
        v[2],
    ]


def _mapped(R: Rotation, v: Vector, graph: Graph) -> Vector:
    return [plus(graph, *(scaled(graph, e, p) for e, p in zip(row, v, strict=True))) for row in R]


def turned(A: Rotation, B: Rotation, graph: Graph) -> Rotation:
    """The product of two rotations."""
    columns = list(zip(*B, strict=True))
    return [[graph.dot(*zip(row, column, strict=True)) for column in columns] for row in A]
