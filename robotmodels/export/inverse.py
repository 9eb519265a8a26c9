"""The inverse geometric model on a tape: Paul's plan, all branches at once.

The plan that `explain_igm` prints and that the package's kernel runs is unrolled: every step is
solved for each of its solutions, and a flag goes along that says whether they exist. Where a step
is singular, an undetermined joint is 0 and the status of the pose says so.

References
----------
Seed book section 1.2.3.2; W. Khalil, E. Dombre, *Modeling, Identification and Control of Robots*,
section 4.4 and appendix 1, for the types of equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import cos, pi, sin

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import InvalidValueError
from ..igm import IGMStatus
from ..igm.by_plan import ByPlan, prepare_by_plan
from ..igm.families import prepare_task
from ..igm.loop import JointChain, joint_chain
from ..igm.paul import explain_igm, layout
from ..igm.paul.program import ACCEPTED, SLACK, SMALL_AMPLITUDE, ZERO_AMPLITUDE
from ..igm.request import Task
from ..model import RobotModel
from .tape import Number, Scalar, Tape, function, pick

Angle = tuple[Number, Number, Number]
"""Value, cosine and sine of an unknown; a length has its value alone."""
_NEAR = 1e-12  # of the squared amplitude: discriminants of solutions that are nearly one
_BEYOND = 1e-6  # of the amplitude: overshoot that tolerances of a pose may cause


@dataclass(frozen=True, slots=True)
class Branch:
    """A solution of the steps so far: whether it exists, is free, is near a singular pose."""

    unknowns: tuple[Angle, ...] = ()
    valid: Number = 1.0
    free: Number = 0.0
    doubtful: Number = 0.0


@dataclass(frozen=True, slots=True)
class Limits:
    """Overshoot of a double root, amplitude that is zero, amplitude that is small."""

    slack: float
    zero: float
    small: float


@dataclass(slots=True)
class _Plan:
    """The plan as the kernel reads it, see `igm.paul.layout`."""

    code: Array
    numbers: Array
    found: list[tuple[list[Number], Branch]] = field(default_factory=list)

    def head(self, which: int) -> int:
        return int(self.code[which])

    def place(self, which: int, k: int = 0) -> int:
        """Element k of a part of the instructions."""
        return int(self.code[int(self.code[which]) + k])

    def number(self, which: int, k: int = 0) -> float:
        return float(self.numbers[int(self.code[which]) + k])


def prepared_plan(model: RobotModel) -> tuple[JointChain, ByPlan]:
    """The plan of an arm, or the error that names the family of its inverse model."""
    chain = joint_chain(model)
    family = prepare_task(chain, Task())
    plan = None if family is None else prepare_by_plan(chain, family)
    if plan is None:
        after = explain_igm(model).takes_over or "the numeric solver `igm_numeric`"
        raise InvalidValueError(
            f"model: {model.name!r} has no plan of Paul's equations, from which code of the inverse "
            f"geometric model is written; in this package {after} solves it."
        )
    polynomials = [s.type.formula for s in plan.plan.steps if s.type.kernel in _POLYNOMIALS]
    if polynomials:
        raise InvalidValueError(
            f"model: the plan of {model.name!r} contains {polynomials[0]}, whose roots have no "
            "code without loops; `igm` of this package solves it."
        )
    return chain, plan


_POLYNOMIALS = (layout.QUARTIC, layout.POLYNOMIAL)


def inverse_model(model: RobotModel, tape: Tape, T: Sequence[Number]) -> tuple[list[Number], ...]:
    """Joint variables (S n,), flags (S,) and status of a world pose (16,), row by row."""
    chain, solver = prepared_plan(model)
    program = solver.program
    plan = _Plan(program.plan, program.adapted(se3.inverse(model.base), np.zeros((3, chain.k))))
    registers = [plan.number(layout.INITIAL, i) for i in range(plan.head(layout.REGISTERS))]
    _solve(plan, 0, _loaded(plan, registers, T), Branch())
    nothing = Scalar(tape, tape.add("nan", ()))
    q: list[Number] = []
    reached: Number = 0.0
    free: Number = 0.0
    doubtful: Number = 0.0
    for values, branch in plan.found:
        row: list[Number] = [0.0] * model.n
        for column, value in zip(chain.columns.tolist(), values, strict=True):
            row[column] = value
        q += [pick(branch.valid, 0.5, x, nothing) for x in row]
        reached = pick(branch.valid, 0.5, 1.0, reached)
        free = pick(branch.valid, 0.5, pick(branch.free, 0.5, 1.0, free), free)
        doubtful = pick(branch.doubtful, 0.5, 1.0, doubtful)
    status = pick(doubtful, 0.5, float(IGMStatus.INCOMPLETE), float(IGMStatus.REACHED))
    status = pick(free, 0.5, float(IGMStatus.REACHED_FAMILY), status)
    status = pick(reached, 0.5, status, float(IGMStatus.NOT_CONVERGED))
    return q, [branch.valid for _, branch in plan.found], [status]


def _loaded(plan: _Plan, x: Sequence[Number], T: Sequence[Number]) -> list[Number]:
    """Registers with ``U0 = before T after``, column by column, and the references (all 0)."""
    out = list(x)
    for i in range(3):
        row = [plan.number(layout.SIDES, 4 * i + j) for j in range(4)]
        m = [sum((row[k] * T[4 * k + j] for k in range(3)), 0.0) for j in range(4)]
        m[3] = m[3] + row[3]
        for j in range(4):
            after = [plan.number(layout.SIDES, 12 + 4 * k + j) for k in range(4)]
            out[1 + 3 * j + i] = sum((m[k] * after[k] for k in range(4)), 0.0)
    k = plan.head(layout.JOINTS)
    references = range(plan.head(layout.UNKNOWNS))
    return out + [plan.number(layout.REFERENCES, i * (k + 1) + k) for i in references]


def _solve(plan: _Plan, level: int, x: list[Number], branch: Branch) -> None:
    """The rest of the tree of solutions behind a branch."""
    x = list(x)
    starts, operations = plan.head(layout.STARTS), plan.head(layout.OPERATIONS)
    for i in range(int(plan.code[starts + level]), int(plan.code[starts + level + 1])):
        d, a, b, c, e = plan.code[operations + 5 * i : operations + 5 * i + 5].tolist()
        f, g = plan.numbers[2 * i : 2 * i + 2].tolist()
        x[d] = f * (x[a] * x[b]) + g * (x[c] * x[e])
    if level == plan.head(layout.STEPS):
        _keep(plan, x, branch)
        return
    at = plan.head(layout.STEP_TABLE) + layout.STEP * level
    step = plan.code[at : at + layout.STEP].tolist()
    g = [x[k] for k in step[layout.COEFFICIENTS :]]
    free = plan.head(layout.REGISTERS)
    wanted = [x[free + step[layout.REFERENCE + i]] for i in range(2)]
    scale = plan.number(layout.SCALES, level)
    limits = Limits(SLACK, ZERO_AMPLITUDE * scale, SMALL_AMPLITUDE * scale)
    for solution in _SOLVERS[step[layout.CODE]](g, limits, [float(w) for w in wanted]):  # type: ignore[arg-type]
        own = list(x)
        for place, angle in zip(step[layout.FIRST : layout.SECOND + 1], solution.unknowns):
            if place > 12:
                own[place : place + 3] = angle
        after = Branch(
            (),
            both(branch.valid, solution.valid),
            either(branch.free, solution.free),
            either(branch.doubtful, both(branch.valid, solution.doubtful)),
        )
        _solve(plan, level + 1, own, after)


def both(a: Number, b: Number) -> Number:
    """Whether both flags are set."""
    return pick(a, 0.5, b, 0.0) if isinstance(a, Scalar) else (b if a > 0.5 else 0.0)


def either(a: Number, b: Number) -> Number:
    """Whether one of two flags is set."""
    return pick(a, 0.5, 1.0, b)


def _keep(plan: _Plan, x: list[Number], branch: Branch) -> None:
    """Check both sides of the pose; the joint variables in (-pi, pi]."""
    k = plan.head(layout.JOINTS)
    turn: Number = 0.0
    far: Number = 0.0
    for i in range(3):
        place = [plan.place(layout.RESULTS, k + i + 3 * j) for j in range(8)]
        d = [x[place[j]] - x[place[j + 4]] for j in range(4)]
        off = d[3] + sum((plan.number(layout.LEVER, j) * d[j] for j in range(3)), 0.0)
        turn = turn + sum((d[j] * d[j] for j in range(3)), 0.0)
        far = far + off * off
    worst = pick(far, 0.5 * turn, far, 0.5 * turn)
    met = pick(worst, ACCEPTED**2, 0.0, 1.0)
    values = []
    for j in range(k):
        value = x[plan.place(layout.RESULTS, j)]
        if plan.place(layout.SIGMA, j) == 0 and isinstance(value, Scalar):
            value = value + 2.0 * pi * function("floor", (pi - value) * (0.5 / pi))
        values.append(value)
    plan.found.append((values, replace(branch, valid=both(branch.valid, met))))


def _angle(sine: Number, cosine: Number, amplitude: Number, small: Number, other: float) -> Angle:
    """An angle by multiples of its sine and cosine; the other value where both are nearly 0."""
    scale = 1.0 / pick(amplitude, small, amplitude, 1.0)
    value = pick(amplitude, small, function("atan2", sine, cosine), other)
    return (
        value,
        pick(amplitude, small, cosine * scale, cos(other)),
        pick(amplitude, small, sine * scale, sin(other)),
    )


def _root(square: Number) -> Number:
    return function("sqrt", pick(square, 0.0, square, 0.0))


def _size(a: Number, b: Number) -> Number:
    return function("sqrt", a * a + b * b)


def _below(x: Number, limit: Number) -> Number:
    return pick(x, limit, 0.0, 1.0)


def direct_angle(g: Sequence[Number], limits: Limits, wanted: Sequence[float]) -> list[Branch]:
    """``X S = g0, X C = g1`` with X > 0."""
    rho = _size(g[0], g[1])
    free, near = _below(rho, limits.zero), _below(rho, limits.small)
    return [Branch((_angle(g[0], g[1], rho, limits.zero, wanted[0]),), 1.0, free, near)]


def opposite_angles(g: Sequence[Number], limits: Limits, wanted: Sequence[float]) -> list[Branch]:
    """``X S = g0, X C = g1`` with X of any sign: an angle and the opposite one."""
    first = direct_angle(g, limits, wanted)[0]
    second = direct_angle([-g[0], -g[1]], limits, wanted)[0]
    return [first, replace(second, valid=_below(first.free, 0.5))]


def one_equation(g: Sequence[Number], limits: Limits, wanted: Sequence[float]) -> list[Branch]:
    """``X S + Y C = Z``, two solutions."""
    X, Y, Z = g[:3]
    square = X * X + Y * Y
    rho = function("sqrt", square)
    room = (rho - Z) * (rho + Z)
    size = pick(Z, 0.0, Z, -Z)
    free = _below(rho, limits.zero)
    double = both(_below(room, _NEAR * square), _below(size - rho, _BEYOND * rho))
    near = either(_below(rho, limits.small), double)
    there = _below(size - rho, limits.slack * rho)
    still = _below(size, max(limits.zero, limits.slack))
    first = pick(free, 0.5, still, there)
    second = both(both(first, _below(free, 0.5)), pick(room, 0.0, 1.0, 0.0))
    Z = pick(Z, rho, rho, pick(-Z, rho, -rho, Z))  # an overshoot is a double root
    root = function("sqrt", pick(room, 0.0, room, 0.0))
    out = []
    for valid, e in ((first, root), (second, -root)):
        S, C = X * Z + Y * e, Y * Z - X * e
        angle = _angle(S, C, square, limits.zero**2, wanted[0])
        out.append(Branch((angle,), valid, free, near))
    return out


def two_equations(g: Sequence[Number], limits: Limits, wanted: Sequence[float]) -> list[Branch]:
    """``X1 S + Y1 C = Z1, X2 S + Y2 C = Z2``; the stronger one alone where they depend."""
    X1, Y1, Z1, X2, Y2, Z2 = g[:6]
    det = X1 * Y2 - X2 * Y1
    one, two = X1 * X1 + Y1 * Y1, X2 * X2 + Y2 * Y2
    size, width = function("sqrt", one * two), pick(det, 0.0, det, -det)
    stronger = [pick(two, one, b, a) for a, b in ((X1, X2), (Y1, Y2), (Z1, Z2))]
    alone = one_equation(stronger, limits, wanted)[0]
    sign = pick(det, 0.0, 1.0, -1.0)
    S, C = sign * (Z1 * Y2 - Z2 * Y1), sign * (X1 * Z2 - X2 * Z1)
    rho, least = _size(S, C), limits.zero**2
    angle = _angle(S, C, rho, least, wanted[0])
    depends = both(pick(size, least, 1.0, 0.0), _below(width, 1e-12 * size))
    free = either(_below(size, least), _below(rho, least))
    near = either(_below(width, 1e-6 * size), _below(rho, limits.small**2))
    return [
        Branch(
            (
                tuple(
                    pick(depends, 0.5, a, b) for a, b in zip(alone.unknowns[0], angle, strict=True)
                ),
            ),  # type: ignore[arg-type]
            pick(depends, 0.5, alone.valid, 1.0),
            pick(depends, 0.5, alone.free, free),
            near,
        )
    ]


def two_angles(g: Sequence[Number], limits: Limits, wanted: Sequence[float]) -> list[Branch]:
    """``W1 Cj + W2 Sj = X Ci + Y Si + Z1, sense (W1 Sj - W2 Cj) = X Si - Y Ci + Z2``."""
    W1, W2, X, Y, Z1, Z2, sense = g
    square = W1 * W1 + W2 * W2
    third = 0.5 * (square - X * X - Y * Y - Z1 * Z1 - Z2 * Z2)
    W = float(function("sqrt", square)) if not isinstance(square, Scalar) else 1.0
    scaled = Limits(limits.slack, max(limits.zero * W, limits.zero**2), limits.small * W)
    out = []
    for first in one_equation([Z1 * Y + Z2 * X, Z1 * X - Z2 * Y, third], scaled, wanted):
        _, C, S = first.unknowns[0]
        one, two = X * C + Y * S + Z1, sense * (X * S - Y * C + Z2)
        Sj, Cj = W2 * one + W1 * two, W1 * one - W2 * two
        rho = _size(Sj, Cj)
        angle = _angle(Sj, Cj, rho, limits.zero**2, wanted[1])
        free = either(first.free, _below(rho, limits.zero**2))
        out.append(replace(first, unknowns=(*first.unknowns, angle), free=free))
    return out


def length(g: Sequence[Number], limits: Limits, wanted: Sequence[float]) -> list[Branch]:
    """``g0 r = g1``."""
    size = pick(g[0], 0.0, g[0], -g[0])
    r = g[1] / pick(size, limits.zero, g[0], 1.0)
    free, near = _below(size, limits.zero), _below(size, limits.small)
    return [Branch(((pick(size, limits.zero, r, wanted[0]), 1.0, 0.0),), 1.0, free, near)]


def length_times_angle(
    g: Sequence[Number], limits: Limits, wanted: Sequence[float]
) -> list[Branch]:
    """``X1 r S = Y1, X2 r C = Y2``: a length of either sign, then the angle."""
    A, B = g[1] / g[0], g[3] / g[2]
    r = _size(A, B)
    free, near = _below(r, limits.zero), _below(r, limits.small)
    out = []
    for sign, valid in ((1.0, 1.0), (-1.0, pick(r, limits.zero, 1.0, 0.0))):
        angle = _angle(sign * A, sign * B, r, limits.zero, wanted[1])
        out.append(Branch(((sign * r, 1.0, 0.0), angle), valid, free, near))
    return out


def length_and_angle(g: Sequence[Number], limits: Limits, wanted: Sequence[float]) -> list[Branch]:
    """``X1 S = Y1 + Z1 r, X2 C = Y2 + Z2 r``: a length by a quadratic, then the angle."""
    u0, u1, v0, v1 = g[1] / g[0], g[2] / g[0], g[4] / g[3], g[5] / g[3]
    a, h, c = u1 * u1 + v1 * v1, u0 * u1 + v0 * v1, u0 * u0 + v0 * v0 - 1.0
    room = h * h - a * c
    root, size = _root(room), h * h + pick(a * c, 0.0, a * c, -(a * c))
    near = both(_below(room, _NEAR * size), _below(-room, _BEYOND * size))
    there = _below(-room, limits.slack * size)
    out = []
    for sign, valid in ((1.0, there), (-1.0, pick(room, 0.0, 1.0, 0.0))):
        r = (sign * root - h) / a
        S, C = u0 + u1 * r, v0 + v1 * r
        angle = _angle(S, C, _size(S, C), limits.zero, wanted[1])
        out.append(Branch(((r, 1.0, 0.0), angle), valid, 0.0, near))
    return out


_SOLVERS = {
    layout.ANGLE: direct_angle,
    layout.OPPOSITE_ANGLES: opposite_angles,
    layout.ONE_EQUATION: one_equation,
    layout.TWO_EQUATIONS: two_equations,
    layout.TWO_ANGLES: two_angles,
    layout.LENGTH: length,
    layout.LENGTH_TIMES_ANGLE: length_times_angle,
    layout.LENGTH_AND_ANGLE: length_and_angle,
}
