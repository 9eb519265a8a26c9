"""A plan as numbers: registers, operations ``r_d = f r_a r_b + g r_c r_e``, and a table of steps.

An operation belongs to the level after the last step whose result it needs, so that postures that
share their first joints share everything computed from them, the check of the pose included.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, read_only
from . import layout
from .catalogue import Step
from .equations import Arm, Split
from .expressions import ONE, Expression, Graph, Kind
from .polynomials import part
from .products import Fixed, product

SLACK = 1e-9
"""Overshoot beside the amplitude that is tried as a double root."""
ZERO_AMPLITUDE = 1e-13
"""Amplitudes beside their usual size that leave a joint undetermined."""
SMALL_AMPLITUDE = 1e-4
"""Amplitudes beside their usual size below which a pose is left to a more careful method."""
ACCEPTED = 1e-9
"""Largest error of a posture of the plan [m, rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Program:
    """Plan for the kernel: instructions (`layout`), numbers, most postures, whether it is rare."""

    plan: NDArray[np.uint32]
    numbers: Array
    branches: int
    rare: bool

    @property
    def kernel(self) -> Callable[..., int]:
        """The compiled function that runs it, imported when it is needed."""
        from ._kernel import solve_poses, solve_poses_rare

        return solve_poses_rare if self.rare else solve_poses

    def adapted(
        self, to_base: Array, joints: Array, labels: NDArray[np.int16] | tuple[()] = ()
    ) -> Array:
        """Numbers for poses in the world, with joint limits and branch codes.

        Shapes: to_base (4, 4), joints (3, k): lower and upper limits, 1 for revolute.
        """
        numbers = np.array(self.numbers)
        at, limits = int(self.plan[layout.SIDES]), int(self.plan[layout.LIMITS])
        before = numbers[at : at + 12].reshape(3, 4)
        before[...] = before @ to_base
        numbers[limits:] = np.ravel(joints)
        return read_only(np.concatenate([numbers, labels]))

    def run(
        self, numbers: Array, poses: Array, references: Array
    ) -> tuple[Array, Array, NDArray[np.int64]]:
        """Postures in the order of the tree, unchecked poses.

        Shapes: poses (N, 4, 4), references (N, k) -> q (N, S, k), residual (N, S),
        marks (N, 2 + 2 S): count, flags, bits of free unknowns, bits of branches.
        """
        (N, k), S = references.shape, self.branches
        q, residual = np.empty((N, S, k)), np.empty((N, S))
        marks = np.empty((N, 2 + 2 * S), np.int64)
        self.kernel(self.plan, numbers, poses, references, layout.UNORDERED, q, residual, marks)
        return q, residual, marks


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


def compile_plan(arm: Arm, steps: Sequence[Step]) -> Program:
    """Program of a complete plan."""
    graph, form = arm.graph, arm.form
    table = _Registers(graph)
    for j in range(4):
        for i in range(3):
            e = arm.U0.R[i][j] if j < 3 else arm.U0.p[i]
            table.give(e, 0, table.new())
    rows = np.zeros((len(steps), layout.STEP), dtype=np.int64)
    references: list[Array] = []
    values: dict[int, Expression] = {}
    for n, step in enumerate(steps):
        rows[n, layout.CODE] = step.type.kernel
        for m, number in enumerate(step.unknowns):
            values[number], rows[n, layout.FIRST + m] = _unknown(arm, number, table, n + 1)
            rows[n, layout.REFERENCE + m] = len(references)
            references.append(_reference(arm, number))
        for m, e in enumerate(step.type.arguments(*step.coefficients)):
            rows[n, layout.COEFFICIENTS + m] = table.expression(e)[0]
    results = [table.expression(_joint_value(arm, j, values))[0] for j in range(form.k)]
    reached = np.cumprod([1, *(step.type.branches for step in steps)])
    exact = [_as_is(arm, j) for j in range(form.k)]
    checks = (_check(arm, exact, s, table, reached) for s in range(form.k + 1))
    results += [table.expression(e)[0] for e in min(checks, key=lambda check: check[0])[1]]
    operations = sorted(table.operations, key=lambda operation: max(operation[0], 0))
    levels = [max(level, 0) for level, _, _ in operations]
    starts = np.searchsorted(np.array(levels, np.int64), np.arange(len(steps) + 2))
    parts = [rows, starts, [where for _, where, _ in operations], results, form.sigma]
    places = np.cumsum([layout.HEAD, *(np.size(p) for p in parts)])
    factors = [f for _, _, f in operations]
    scales = [_scale(step, graph) for step in steps]
    numbers = [
        factors, table.initial, references, form.before[:3], form.after, form.lever, scales,
        [SLACK, ZERO_AMPLITUDE, SMALL_AMPLITUDE, ACCEPTED], np.zeros(3 * form.k),
    ]  # fmt: skip
    spans = np.delete(np.cumsum([np.size(p) for p in numbers]), layout.LEVER - layout.INITIAL)
    branches, registers = int(reached[-1]), len(table.initial)
    head = [form.k, len(steps), registers, len(references), branches, *places[:5], *spans]
    return Program(
        plan=read_only(np.concatenate([np.ravel(p) for p in (head, *parts)]), np.uint32),
        numbers=read_only(np.concatenate([np.ravel(p) for p in numbers])),
        branches=branches,
        rare=any(step.type.kernel in layout.RARE for step in steps),
    )


def _unknown(arm: Arm, number: int, table: _Registers, level: int) -> tuple[Expression, int]:
    """Registers for value, cosine and sine of an unknown; its value, and the first of them."""
    item, register = arm.joints.unknowns[number], table.new()
    table.new()
    table.new()
    C, S = arm.joints.symbols(number)
    if item.slides:
        table.give(C, level, register)
        return C, register
    samples = arm.joints.samples(number)
    value = arm.graph.symbol(Kind.JOINT, f"value of unknown {number}", "", samples)
    for i, e in enumerate((value, C, S)):
        table.give(e, level, register + i)
    return value, register


def _scale(step: Step, graph: Graph) -> float:
    """Usual size of the coefficients that must not all be zero for the step to have an answer."""
    return max((graph.size(step.coefficients[i]) for i in step.type.amplitude), default=1.0)


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
    for solved, sign in joints.path(joints.sum_of(j)):
        factor, node = values[solved.unknown]
        terms.append((sense * sign * joints.sense(solved.span) * factor, node))
    return arm.graph.sum((*terms, offset))


def _as_is(arm: Arm, j: int) -> Fixed:
    """The constant before a joint without rounding to structure: the check is of the true arm."""
    nominal, exact = arm.K[j], arm.form.exact[j]

    def element(e: Expression, value: float) -> Expression:
        return e if abs(arm.graph.values(e)[0] - value) <= 1e-15 else (float(value), ONE)

    R = [[element(nominal.R[i][c], exact[i, c]) for c in range(3)] for i in range(3)]
    return Fixed(R, [element(nominal.p[i], exact[i, 3]) for i in range(3)])


def _check(
    arm: Arm, K: list[Fixed], s: int, table: _Registers, reached: NDArray[np.int64]
) -> tuple[float, list[Expression]]:
    """Both sides of the matrix equation split after joint s, and how many operations they take.

    Built strictly: what is zero at every right posture must not be taken for granted here.
    """
    graph = arm.graph
    split = Split(s, arm.form.k, arm.E is not None)
    graph.strict = True
    left, right = (product(side, arm.joints) for side in arm.sides(split, K))
    graph.strict = False
    sides = [part(side[j][i] or {}) for side in (left, right) for j in range(4) for i in range(3)]
    trial = table.trial()
    for e in sides:
        trial.expression(e)
    price = float(sum(reached[max(level, 0)] for level, _, _ in trial.operations))
    return price, sides
