"""A plan as numbers: registers, operations ``r_d = f r_a r_b + g r_c r_e``, and a table of steps.

An operation belongs to the level after the last step whose result it needs, so that postures that
share their first joints share everything computed from them, the check of the pose included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, read_only
from .equation_type import EquationType
from .equations import Arm, Split
from .expressions import ONE, ZERO, Expression, Graph, Kind
from .polynomials import part
from .products import Fixed, product

if TYPE_CHECKING:
    from .plan import Step

_HEAD = 13
STEP = 24
"""Numbers per step: type, registers of the results (2 x 3), references (2), coefficients (15)."""


@dataclass(frozen=True, slots=True, eq=False)
class Program:
    """Plan for the kernel, packed into two arrays."""

    plan: NDArray[np.uint32]
    numbers: Array
    branches: int


class _Registers:
    """Registers given to nodes, and the operations that fill them."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.of: dict[int, int] = {ONE: 0}
        self.level: dict[int, int] = {ONE: -1}
        self.initial: list[float] = [1.0]
        self.operations: list[tuple[int, tuple[int, ...], tuple[float, float]]] = []
        self._scaled: dict[Expression, int] = {}

    def trial(self) -> _Registers:
        """A copy whose operations count from here."""
        other = _Registers(self.graph)
        other.of, other.level = dict(self.of), dict(self.level)
        other._scaled = dict(self._scaled)
        return other

    def new(self, value: float = 0.0) -> int:
        self.initial.append(value)
        return len(self.initial) - 1

    def give(self, e: Expression, level: int, register: int) -> None:
        self.of[e[1]], self.level[e[1]] = register, level

    def add(self, level: int, where: tuple[int, ...], numbers: tuple[float, float]) -> None:
        self.operations.append((level, where, numbers))

    def expression(self, e: Expression) -> tuple[int, int]:
        """Register and level of an expression."""
        if e[0] == 0.0:
            return self.constant(0.0), -1
        self.node(e[1])
        if e[0] == 1.0:
            return self.of[e[1]], self.level[e[1]]
        if e[1] == ONE:
            return self.constant(e[0]), -1
        if e not in self._scaled:
            self._scaled[e] = self.new()
            self.add(self.level[e[1]], (self._scaled[e], self.of[e[1]], 0, 0, 0), (e[0], 0.0))
        return self._scaled[e], self.level[e[1]]

    def constant(self, value: float) -> int:
        e = (value, -1)
        if e not in self._scaled:
            self._scaled[e] = self.new(value)
        return self._scaled[e]

    def node(self, number: int) -> None:
        """Make sure that a node has a register."""
        if number in self.of:
            return
        node, graph = self.graph.nodes[number], self.graph
        if graph.is_constant((1.0, number)):
            self.give((1.0, number), -1, self.new(float(node.values[0])))
            return
        if node.kind is Kind.NAMED:
            register, level = self.expression(node.parts[0])
            self.give((1.0, number), level, register)
            return
        if node.kind is Kind.PRODUCT:
            a, b = self._factors(number)
            self._emit(number, [(1.0, a, b)])
            return
        terms = []
        for factor, child in node.parts:
            a, b = self._factors(child)
            terms.append((factor, a, b))
        terms.sort(key=lambda t: max(self.level[t[1]], self.level[t[2]]))
        self._emit(number, terms)

    def _factors(self, number: int) -> tuple[int, int]:
        """A node as a product of two nodes that have registers."""
        node = self.graph.nodes[number]
        if node.kind is not Kind.PRODUCT or self.graph.is_constant((1.0, number)):
            self.node(number)
            return number, ONE
        parts = [n for _, n in node.parts]
        for n in parts:
            self.node(n)
        if len(parts) > 2:
            # what is known first is multiplied first
            parts.sort(key=lambda n: self.level[n])
            early = self.graph.product(*((1.0, n) for n in parts[:-1]))
            self.node(early[1])
            return early[1], parts[-1]
        return parts[0], parts[1]

    def _emit(self, number: int, terms: list[tuple[float, int, int]]) -> None:
        level = max(self.level[n] for _, a, b in terms for n in (a, b))
        while len(terms) > 2:
            one, two = terms[0], terms[1]
            own = max(self.level[n] for _, a, b in (one, two) for n in (a, b))
            register = self.new()
            self._operation(own, register, one, two)
            # a register without a node of its own
            name = -2 - register
            self.of[name], self.level[name] = register, own
            terms = sorted(
                [(1.0, name, ONE), *terms[2:]],
                key=lambda t: max(self.level[t[1]], self.level[t[2]]),
            )
        register = self.new()
        self._operation(level, register, terms[0], terms[1] if len(terms) > 1 else None)
        self.give((1.0, number), level, register)

    def _operation(self, level: int, to: int, one: tuple[float, int, int],
                   two: tuple[float, int, int] | None) -> None:  # fmt: skip
        f, a, b = one
        g, c, e = two if two is not None else (0.0, ONE, ONE)
        self.add(level, (to, self.of[a], self.of[b], self.of[c], self.of[e]), (f, g))


def lowered(arm: Arm, steps: Sequence[Step]) -> Program:
    """Program of a complete plan."""
    graph, joints, form = arm.graph, arm.joints, arm.form
    table = _Registers(graph)
    for j in range(4):
        for i in range(3):
            e = arm.U0.R[i][j] if j < 3 else arm.U0.p[i]
            table.give(e, 0, table.new())
    rows = np.zeros((len(steps), STEP), dtype=np.int64)
    references: list[Array] = []
    values: dict[int, Expression] = {}
    for n, step in enumerate(steps):
        rows[n, 0] = step.type.code
        for m, number in enumerate(step.unknowns):
            if m and step.type in (EquationType.POLYNOMIAL, EquationType.QUARTIC):
                break
            value = graph.symbol(Kind.JOINT, f"value of unknown {number}", "",
                                 joints.samples(number))  # fmt: skip
            C, S = joints.symbols(number)
            if joints.unknowns[number].slides:
                value = C
            register = table.new()
            for _ in range(2):
                table.new()
            table.give(value, n + 1, register)
            if not joints.unknowns[number].slides:
                table.give(C, n + 1, register + 1)
                table.give(S, n + 1, register + 2)
            values[number] = value
            rows[n, 1 + 3 * m : 4 + 3 * m] = register, register + 1, register + 2
            rows[n, 7 + m] = len(references)
            references.append(_reference(arm, number))
        for m, e in enumerate(_for_kernel(step)):
            rows[n, 9 + m] = table.expression(e)[0]
    results = [table.expression(_joint_value(arm, j, values))[0] for j in range(form.k)]
    reached = np.cumprod([1, *(step.type.branches for step in steps)])
    nominal = arm.K
    arm.K = [_as_is(arm, j) for j in range(form.k)]
    sides = min((_check(arm, s, table, reached) for s in range(form.k + 1)), key=lambda c: c[0])[1]
    arm.K = nominal
    results += [table.expression(e)[0] for e in sides]
    order = sorted(range(len(table.operations)), key=lambda i: max(table.operations[i][0], 0))
    operations = [table.operations[i] for i in order]
    levels = np.array([max(level, 0) for level, _, _ in operations], dtype=np.int64)
    starts = np.searchsorted(levels, np.arange(len(steps) + 2))
    branches = int(reached[-1])
    parts = [rows, starts, np.array([w for _, w, _ in operations]), results, form.sigma]
    places = np.cumsum([_HEAD, *(np.size(p) for p in parts)])
    factors = np.array([f for _, _, f in operations])
    sides = [form.before[:3], form.after[:3], form.lever, [_scale(step, graph) for step in steps]]
    spans = np.cumsum([factors.size, len(table.initial), np.size(references)])
    head = [form.k, len(steps), *places[:5], len(table.initial), len(references), branches, *spans]
    whole = np.concatenate([np.ravel(p) for p in (head, *parts)])
    numbers = [np.ravel(p) for p in (factors, table.initial, references, *sides)]
    return Program(
        plan=read_only(whole, np.uint32),
        numbers=read_only(np.concatenate(numbers)),
        branches=branches,
    )


def _for_kernel(step: Step) -> tuple[Expression, ...]:
    """Coefficients as the kernel takes them: types 6 and 7 are one."""
    if step.type is EquationType.TYPE_6:
        # W Sj and W Cj are W1 Cj + W2 Sj and -(W1 Sj - W2 Cj) with W1 = 0
        return ZERO, *step.coefficients, (-1.0, ONE)
    if step.type is EquationType.TYPE_3_DIRECT:
        return step.coefficients[1:]
    return step.coefficients


def _scale(step: Step, graph: Graph) -> float:
    """Usual size of what must not be zero for the step to have an answer."""
    of = {
        EquationType.TYPE_1: (0,), EquationType.TYPE_2: (0, 1), EquationType.TYPE_2_ZERO: (0, 1),
        EquationType.TYPE_3: (0, 1, 3, 4), EquationType.TYPE_3_DIRECT: (0,),
        EquationType.TYPE_4: (0, 2), EquationType.TYPE_5: (0, 3), EquationType.TYPE_6: (0,),
        EquationType.TYPE_7: (0, 1), EquationType.TYPE_8: (0, 1),
    }.get(step.type, ())  # fmt: skip
    return max((graph.size(step.coefficients[i]) for i in of), default=1.0)


def _reference(arm: Arm, number: int) -> Array:
    row = np.zeros(arm.form.k + 1)
    for j, sign in arm.joints.unknowns[number].terms:
        row[j] += sign
        row[-1] += sign * arm.form.rows[j].offset
    return row


def _joint_value(arm: Arm, j: int, values: dict[int, Expression]) -> Expression:
    """The variable of a joint from the values that the steps give."""
    joints = arm.joints
    row = arm.form.rows[j]
    offset = (-row.offset, ONE)
    if row.sigma:
        return arm.graph.sum((joints.lengths[j], offset))
    sense = joints.group[j][2]
    terms = []
    for solved, way in joints.path(joints.span_of(j)):
        factor, node = values[solved.unknown]
        terms.append((sense * way * joints.sense(solved.span) * factor, node))
    return arm.graph.sum((*terms, offset))


def _as_is(arm: Arm, j: int) -> Fixed:
    """The constant before a joint without rounding to structure: the check is of the true arm."""
    nominal, exact = arm.K[j], arm.form.exact[j]

    def element(e: Expression, value: float) -> Expression:
        return e if abs(arm.graph.values(e)[0] - value) <= 1e-15 else (float(value), ONE)

    R = [[element(nominal.R[i][c], exact[i, c]) for c in range(3)] for i in range(3)]
    return Fixed(R, [element(nominal.p[i], exact[i, 3]) for i in range(3)])


def _check(
    arm: Arm, s: int, table: _Registers, reached: NDArray[np.int64]
) -> tuple[float, list[Expression]]:
    """Both sides of the matrix equation split after joint s, and how many operations they take.

    Built strictly: what is zero at every right posture must not be taken for granted here.
    """
    graph = arm.graph
    split = Split(s, arm.form.k, arm.E is not None)
    graph.strict = True
    left, right = (product(side, arm.joints) for side in arm.sides(split))
    graph.strict = False
    sides = [part(side[j][i] or {}) for side in (left, right) for j in range(4) for i in range(3)]
    trial = table.trial()
    for e in sides:
        trial.expression(e)
    price = float(sum(reached[max(level, 0)] for level, _, _ in trial.operations))
    return price, sides
