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
TOLERANCES = SLACK, ZERO_AMPLITUDE, SMALL_AMPLITUDE, ACCEPTED


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
        self, poses: Array, references: Array, tolerances: Sequence[float] = TOLERANCES
    ) -> tuple[Array, Array, NDArray[np.int64]]:
        """Postures in the order of the tree, unchecked poses.

        Shapes: poses (N, 4, 4), references (N, k) -> q (N, S, k), residual (N, S),
        marks (N, 2 + 2 S): count, flags, bits of free unknowns, bits of branches.
        """
        numbers, at = np.array(self.numbers), int(self.plan[layout.TOLERANCES])
        numbers[at : at + 4] = tolerances
        (N, k), S = references.shape, self.branches
        q, residual = np.empty((N, S, k)), np.empty((N, S))
        marks = np.empty((N, 2 + 2 * S), np.int64)
        self.kernel(self.plan, numbers, poses, references, layout.UNORDERED, q, residual, marks)
        return q, residual, marks


_Term = tuple[float, int, int]
"""A number times two nodes."""


class _Registers:
    """Registers of nodes, the levels at which they are known, and the operations that fill them."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.of: dict[int, tuple[int, int]] = {ONE: (0, -1)}  # register and level
        self.initial: list[float] = [1.0]
        self.operations: list[tuple[int, tuple[int, ...], tuple[float, float]]] = []
        self._scaled: dict[Expression, int] = {}

    def trial(self) -> _Registers:
        """A copy whose operations count from here."""
        other = _Registers(self.graph)
        other.of, other._scaled = dict(self.of), dict(self._scaled)
        return other

    def new(self, value: float = 0.0) -> int:
        """One more register."""
        self.initial.append(value)
        return len(self.initial) - 1

    def expression(self, e: Expression) -> int:
        """Register of an expression."""
        register, level = self.node(e[1])
        if e[0] == 1.0:
            return register
        if e not in self._scaled:
            self._scaled[e] = to = self.new(e[0] if e[1] == ONE else 0.0)
            if e[1] != ONE:
                self.operations.append((level, (to, register, 0, 0, 0), (e[0], 0.0)))
        return self._scaled[e]

    def node(self, number: int) -> tuple[int, int]:
        """Register and level of a node."""
        node, graph = self.graph.nodes[number], self.graph
        if number in self.of:
            pass
        elif graph.is_constant((1.0, number)):
            self.of[number] = self.new(float(node.values[0])), -1
        elif node.kind is Kind.NAMED:
            meaning = node.parts[0]
            self.of[number] = self.expression(meaning), self.of[meaning[1]][1]
        elif node.kind is Kind.PRODUCT:
            self._emit(number, [(1.0, *self._factors(number))])
        else:
            self._emit(number, [(f, *self._factors(n)) for f, n in node.parts])
        return self.of[number]

    def _factors(self, number: int) -> tuple[int, int]:
        """A node as a product of two nodes that have registers."""
        node = self.graph.nodes[number]
        if node.kind is not Kind.PRODUCT or self.graph.is_constant((1.0, number)):
            self.node(number)
            return number, ONE
        parts = [n for _, n in node.parts]
        for n in parts:
            self.node(n)
        if len(parts) == 2:
            return parts[0], parts[1]
        # what is known first is multiplied first
        parts.sort(key=lambda n: self.of[n][1])
        early = self.graph.product(*((1.0, n) for n in parts[:-1]))
        self.node(early[1])
        return early[1], parts[-1]

    def _level(self, term: _Term) -> int:
        return max(self.of[n][1] for n in term[1:])

    def _emit(self, number: int, terms: list[_Term]) -> None:
        """Add terms, two in an operation, those known first before the others."""
        terms = sorted(terms, key=self._level)
        while len(terms) > 2:
            # a register without a node of its own
            name = -2 - len(self.initial)
            self._operation(name, terms[:2])
            terms = sorted([(1.0, name, ONE), *terms[2:]], key=self._level)
        self._operation(number, terms)

    def _operation(self, name: int, terms: list[_Term]) -> None:
        level, register = max(map(self._level, terms)), self.new()
        (f, a, b), (g, c, e), *_ = *terms, (0.0, ONE, ONE)
        where = (register, *(self.of[n][0] for n in (a, b, c, e)))
        self.operations.append((level, where, (f, g)))
        self.of[name] = register, level


def compile_plan(arm: Arm, steps: Sequence[Step]) -> Program:
    """Program of a complete plan."""
    graph, form = arm.graph, arm.form
    table = _Registers(graph)
    for j in range(4):
        for i in range(3):
            e = arm.U0.R[i][j] if j < 3 else arm.U0.p[i]
            table.of[e[1]] = table.new(), 0
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
            rows[n, layout.COEFFICIENTS + m] = table.expression(e)
    results = [table.expression(_joint_value(arm, j, values)) for j in range(form.k)]
    reached = np.cumprod([1, *(step.type.branches for step in steps)])
    exact = [_as_is(arm, j) for j in range(form.k)]
    checks = (_check(arm, exact, s, table, reached) for s in range(form.k + 1))
    results += [table.expression(e) for e in min(checks, key=lambda check: check[0])[1]]
    operations = sorted(table.operations, key=lambda operation: max(operation[0], 0))
    levels = [max(level, 0) for level, _, _ in operations]
    starts = np.searchsorted(np.array(levels, np.int64), np.arange(len(steps) + 2))
    parts = [rows, starts, [where for _, where, _ in operations], results, form.sigma]
    places = np.cumsum([layout.HEAD, *(np.size(p) for p in parts)])
    factors = [f for _, _, f in operations]
    # usual sizes of the coefficients that must not all be zero for a step to have an answer
    amplitudes = [[graph.values(s.coefficients[i]) for i in s.type.amplitude] for s in steps]
    scales = [np.abs(values).max(initial=0.0) if values else 1.0 for values in amplitudes]
    numbers = [
        factors, table.initial, references, form.before[:3], form.after, form.lever, scales,
        TOLERANCES, np.zeros(3 * form.k),
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
    register, (C, S) = [table.new() for _ in range(3)], arm.joints.symbols(number)
    value, symbols = C, (C,)
    if not arm.joints.unknowns[number].slides:
        samples = arm.joints.samples(number)
        value = arm.graph.symbol(Kind.JOINT, f"value of unknown {number}", "", samples)
        symbols = value, C, S
    table.of |= {e[1]: (r, level) for e, r in zip(symbols, register, strict=False)}
    return value, register[0]


def _reference(arm: Arm, number: int) -> Array:
    row = np.zeros(arm.form.k + 1)
    for j, sign in arm.joints.unknowns[number].terms:
        row[j] += sign
        row[-1] += sign * arm.form.rows[j].offset
    return row


def _joint_value(arm: Arm, j: int, values: dict[int, Expression]) -> Expression:
    """The variable of a joint from the values that the steps give."""
    joints, row = arm.joints, arm.form.rows[j]
    terms = [joints.lengths[j]] if row.sigma else [
        (sign * values[u][0], values[u][1]) for sign, u in joints.parts_of(j)
    ]  # fmt: skip
    return arm.graph.sum((*terms, (-row.offset, ONE)))


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
    cost = float(sum(reached[max(level, 0)] for level, _, _ in trial.operations))
    return cost, sides
