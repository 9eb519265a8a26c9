"""The inverse geometric model on a tape: Paul's plan, all branches at once.

The plan that `explain_igm` prints and that the package's kernel runs is unrolled: every step is
solved for each of its solutions, and a flag marks those that exist. At a singular
pose an undetermined joint is 0, and the status of the pose reports it. Each solver takes the
coefficients of its type of equation and returns its solutions.

References
----------
Book section 1.2.3.2; W. Khalil, E. Dombre, *Modeling, Identification and Control of Robots*,
section 4.4 and appendix 1, for the types of equations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from .. import se3
from ..errors import InvalidValueError
from ..igm import IGMStatus
from ..igm.by_plan import prepare_by_plan
from ..igm.families import prepare_task
from ..igm.loop import joint_chain
from ..igm.paul import explain_igm, layout
from ..igm.paul.program import ACCEPTED, SLACK, SMALL_AMPLITUDE, ZERO_AMPLITUDE
from ..igm.request import Task
from ..model import RobotModel
from .recursion import Vector, vector
from .tape import Number, Scalar, Tape, function, pick

_NEAR = 1e-12  # of the squared amplitude: discriminants of solutions that are nearly one
_BEYOND = 1e-6  # of the amplitude: overshoot that tolerances of a pose may cause
_LEAST = 1e-14  # of the largest coefficient: slopes that are zero
_FREE, _DOUBTFUL = 9.0, float(IGMStatus.INCOMPLETE)
"""Statuses while the branches are compared: the largest holds, and a family is the worst."""
Unknown = tuple[Number, Number, Number]
"""Value, cosine and sine of an unknown; of a length the value alone counts."""


class Solution(NamedTuple):
    """Unknowns of a step, whether they exist (0 or 1), and their status."""

    unknowns: tuple[Unknown, ...]
    valid: Number
    status: Number


class Limits(NamedTuple):
    """Thresholds below which an amplitude is zero, or small; values of unknowns that are free."""

    zero: float
    small: float
    wanted: tuple[float, ...]


class _Tree:
    """A plan as the kernel reads it (`igm.paul.layout`), and the postures that it gives."""

    def __init__(self, model: RobotModel) -> None:
        chain = joint_chain(model)
        family = prepare_task(chain, Task())
        solver = None if family is None else prepare_by_plan(chain, family)
        if solver is None:
            other = explain_igm(model).takes_over or "the numeric solver `igm_numeric`"
            raise InvalidValueError(
                f"model: Paul's equations do not solve {model.name}, so its inverse model has no "
                f"straight-line code; `igm` uses {other}."
            )
        at = solver.program.adapted(se3.inverse(model.base), np.zeros((3, chain.k)))
        self.columns: list[int] = chain.columns.tolist()
        self.code: list[int] = solver.program.plan.tolist()
        self.numbers: list[float] = at.tolist()
        self.found: list[tuple[list[Number], Number, Number]] = []

    def part(self, which: int, first: int, count: int) -> Vector:
        """Some of the numbers of a part."""
        at = self.code[which] + first
        return vector(*self.numbers[at : at + count])

    def solve(self, level: int, x: list[Number], valid: Number, status: Number) -> None:
        """The rest of the tree of solutions behind a branch with the registers ``x``."""
        code, x, k = self.code, list(x), self.code[layout.JOINTS]
        for i in range(*(code[code[layout.STARTS] + level + m] for m in range(2))):
            at = code[layout.OPERATIONS] + 5 * i
            d, a, b, c, e = code[at : at + 5]
            f, g = self.numbers[2 * i : 2 * i + 2]
            x[d] = f * (x[a] * x[b]) + g * (x[c] * x[e])
        if level == code[layout.STEPS]:
            self.keep(x, valid, status)
            return
        at = code[layout.STEP_TABLE] + layout.STEP * level
        step = code[at : at + layout.STEP]
        free = (step[layout.REFERENCE + i] * (k + 1) + k for i in (0, 1))
        wanted = tuple(self.part(layout.REFERENCES, at, 1)[0] for at in free)
        scale = self.part(layout.SCALES, level, 1)[0]
        limits = Limits(ZERO_AMPLITUDE * scale, SMALL_AMPLITUDE * scale, wanted)
        coefficients = [x[i] for i in step[layout.COEFFICIENTS :]]
        for solution in _SOLVERS[step[layout.CODE]](coefficients, limits):
            own = list(x)
            for place, unknown in zip(step[layout.FIRST :], solution.unknowns, strict=False):
                if place > 12:
                    own[place : place + 3] = unknown
            there = pick(valid, 0.5, solution.valid, 0.0)
            self.solve(level + 1, own, there, _larger(status, solution.status))

    def keep(self, x: list[Number], valid: Number, status: Number) -> None:
        """Check both sides of the pose; joint variables in (-pi, pi]."""
        code, k = self.code, self.code[layout.JOINTS]
        results, sigma = code[layout.RESULTS], code[layout.SIGMA]
        sides = vector(*(x[i] for i in code[results + k : results + k + 24])).reshape(2, 4, 3)
        d = sides[0] - sides[1]
        off, turn = d[3] + self.part(layout.LEVER, 0, 3) @ d[:3], d[:3].ravel()
        met = _below(_larger(off @ off, 0.5 * (turn @ turn)), ACCEPTED**2)
        values = [x[code[results + j]] for j in range(k)]
        for j, value in enumerate(values):
            if code[sigma + j] == 0 and isinstance(value, Scalar):
                values[j] = value + 2.0 * pi * function("floor", (pi - value) * (0.5 / pi))
        self.found.append((values, pick(valid, 0.5, met, 0.0), status))


def inverse_model(model: RobotModel, tape: Tape, T: Sequence[Number]) -> tuple[list[Number], ...]:
    """Joint variables (S n,), flags (S,) and status of a world pose (16,), row by row."""
    tree = _Tree(model)
    before, after = tree.part(layout.SIDES, 0, 12), tree.part(layout.SIDES, 12, 16)
    pose = np.vstack([vector(*T[:12]).reshape(3, 4), (0.0, 0.0, 0.0, 1.0)])
    x: list[Number] = tree.part(layout.INITIAL, 0, tree.code[layout.REGISTERS]).tolist()
    x[1:13] = (before.reshape(3, 4) @ pose @ after.reshape(4, 4)).T.ravel()
    tree.solve(0, x, 1.0, 0.0)
    q: list[Number] = []
    status: Number = float(IGMStatus.NOT_CONVERGED)
    reached: Number = 0.0
    for values, valid, own in tree.found:
        row: list[Number] = [0.0] * model.n
        for column, value in zip(tree.columns, values, strict=True):
            row[column] = value
        q += [pick(valid, 0.5, x, tape.scalar("nan")) for x in row]
        worse = pick(reached, 0.5, _larger(status, own), own)
        status, reached = pick(valid, 0.5, worse, status), _larger(valid, reached)
    status = pick(status, 8.5, float(IGMStatus.REACHED_FAMILY), status)
    return q, [valid for _, valid, _ in tree.found], [status]


def status_notes() -> list[str]:
    """The statuses of a pose in sentences."""
    more = {1: " Joints that are free are 0.", 7: " The pose is nearly singular."}
    codes = (IGMStatus(k) for k in (0, 1, 6, 7))
    return [f"  status {int(code)}: {code.sentence}{more.get(int(code), '')}" for code in codes]


def _larger(a: Number, b: Number) -> Number:
    return pick(a, b, a, b)


def _below(x: Number, limit: Number) -> Number:
    return pick(x, limit, 0.0, 1.0)


def _size(x: Number) -> Number:
    return pick(x, 0.0, x, -x)


def _status(amplitude: Number, zero: float, small: float) -> Number:
    """Regular, doubtful or free, by the amplitude that determines an unknown."""
    return pick(amplitude, small, 0.0, pick(amplitude, zero, _DOUBTFUL, _FREE))


def _angle(sine: Number, cosine: Number, amplitude: Number, zero: float, other: float) -> Unknown:
    """An angle by multiples of its sine and cosine; the other value where both are zero."""
    scale = 1.0 / pick(amplitude, zero, amplitude, 1.0)
    three = function("atan2", sine, cosine), cosine * scale, sine * scale
    a, C, S = zip(three, (other, cos(other), sin(other)), strict=True)
    return pick(amplitude, zero, *a), pick(amplitude, zero, *C), pick(amplitude, zero, *S)


def opposite_angles(g: Sequence[Number], limits: Limits) -> list[Solution]:
    """``X S = g0, X C = g1`` with X of any sign: the angle for X > 0, and the opposite one."""
    rho = function("sqrt", g[0] * g[0] + g[1] * g[1])
    status = _status(rho, limits.zero, limits.small)
    one, two = (
        _angle(sign * g[0], sign * g[1], rho, limits.zero, limits.wanted[0]) for sign in (1.0, -1.0)
    )
    is_free = pick(status, 8.5, 1.0, 0.0)
    return [Solution((one,), 1.0, status), Solution((two,), _below(is_free, 0.5), status)]


def angle_of_one(g: Sequence[Number], limits: Limits) -> list[Solution]:
    """``X S + Y C = Z``, two solutions."""
    X, Y, Z = g[:3]
    square = X * X + Y * Y
    rho, size = function("sqrt", square), _size(Z)
    room = (rho - Z) * (rho + Z)
    double = pick(room, _NEAR * square, 0.0, _below(size - rho, _BEYOND * rho))
    status = _status(rho, limits.zero, limits.small)
    status = pick(status, 0.5, status, pick(double, 0.5, _DOUBTFUL, 0.0))
    free = _below(size, max(limits.zero, SLACK))
    first = pick(rho, limits.zero, _below(size - rho, SLACK * rho), free)
    second = pick(rho, limits.zero, pick(room, 0.0, 1.0, 0.0), 0.0)
    Z = pick(Z, rho, rho, pick(-Z, rho, -rho, Z))  # an overshoot is a double root
    root = function("sqrt", _larger(room, 0.0))
    out = []
    for valid, e in ((first, root), (second, -root)):
        S, C = X * Z + Y * e, Y * Z - X * e
        angle = _angle(S, C, square, limits.zero**2, limits.wanted[0])
        out.append(Solution((angle,), valid, status))
    return out


def angle_of_two(g: Sequence[Number], limits: Limits) -> list[Solution]:
    """``X1 S + Y1 C = Z1, X2 S + Y2 C = Z2``; doubtful where they depend on each other."""
    X1, Y1, Z1, X2, Y2, Z2 = g[:6]
    det = X1 * Y2 - X2 * Y1
    size = function("sqrt", (X1 * X1 + Y1 * Y1) * (X2 * X2 + Y2 * Y2))
    sign = pick(det, 0.0, 1.0, -1.0)
    S, C = sign * (Z1 * Y2 - Z2 * Y1), sign * (X1 * Z2 - X2 * Z1)
    rho = function("sqrt", S * S + C * C)
    angle = _angle(S, C, rho, limits.zero**2, limits.wanted[0])
    near = pick(_size(det), _BEYOND * size, 0.0, _DOUBTFUL)
    return [Solution((angle,), 1.0, _larger(near, _status(rho, limits.zero**2, limits.small**2)))]


def pair_of_angles(g: Sequence[Number], limits: Limits) -> list[Solution]:
    """``W1 Cj + W2 Sj = X Ci + Y Si + Z1, sense (W1 Sj - W2 Cj) = X Si - Y Ci + Z2``."""
    W1, W2, X, Y, Z1, Z2, sense = g
    square = W1 * W1 + W2 * W2
    third = 0.5 * (square - X * X - Y * Y - Z1 * Z1 - Z2 * Z2)
    width = 1.0 if isinstance(square, Scalar) else float(square) ** 0.5
    least = limits.zero**2
    scaled = limits._replace(zero=max(limits.zero * width, least), small=limits.small * width)
    out = []
    for first in angle_of_one([Z1 * Y + Z2 * X, Z1 * X - Z2 * Y, third], scaled):
        _, C, S = first.unknowns[0]
        one, two = X * C + Y * S + Z1, sense * (X * S - Y * C + Z2)
        Sj, Cj = W2 * one + W1 * two, W1 * one - W2 * two
        rho = function("sqrt", Sj * Sj + Cj * Cj)
        second = _angle(Sj, Cj, rho, least, limits.wanted[1])
        status = _larger(first.status, _status(rho, least, least))
        out.append(Solution((*first.unknowns, second), first.valid, status))
    return out


def length(g: Sequence[Number], limits: Limits) -> list[Solution]:
    """``g0 r = g1``."""
    size = _size(g[0])
    r = g[1] / pick(size, limits.zero, g[0], 1.0)
    value = pick(size, limits.zero, r, limits.wanted[0])
    return [Solution(((value, 1.0, 0.0),), 1.0, _status(size, limits.zero, limits.small))]


def length_and_angle(g: Sequence[Number], limits: Limits, is_product: bool) -> list[Solution]:
    """``X1 S = Y1 + Z1 r, X2 C = Y2 + Z2 r`` or ``X1 r S = Y1, X2 r C = Y2``.

    An equation without r gives the angle, both equations then the length.
    """
    others, out = limits._replace(wanted=limits.wanted[::-1]), []
    if is_product:
        X1, Y1, X2, Y2, Z1, Z2 = *g[:4], 0.0, 0.0
        angles = opposite_angles([X2 * Y1, X1 * Y2], others)
    else:
        X1, Y1, Z1, X2, Y2, Z2 = g[:6]
        angles = angle_of_one([X1 * Z2, -(X2 * Z1), Y1 * Z2 - Y2 * Z1], others)
    for angle in angles:
        _, C, S = angle.unknowns[0]
        A, B = (X1 * S, X2 * C), (Y1, Y2)
        A, B = (A, B) if is_product else ((Z1, Z2), (A[0] - Y1, A[1] - Y2))
        square = A[0] * A[0] + A[1] * A[1]
        r = (A[0] * B[0] + A[1] * B[1]) / pick(square, limits.zero**2, square, 1.0)
        near = pick(square, limits.small**2, 0.0, _DOUBTFUL)
        both = (r, 1.0, 0.0), *angle.unknowns
        out.append(Solution(both, angle.valid, _larger(angle.status, near)))
    return out


def polynomial(g: Sequence[Number], limits: Limits) -> list[Solution]:
    """``g0 + g1 r + ... + g4 r^4 = 0``, an equation of the angle x with ``r = tan(x / 2)``."""
    g0, g1, g2, g3, g4 = g[:5]
    if g3 == g4 == 0.0:
        found = angle_of_one([g1, g0 - g2, -(g0 + g2)], limits)
    else:
        trigonometric = [3.0 * (g0 + g4) + g2, 4.0 * (g0 - g4), 2.0 * (g1 + g3)]
        found = quartic([*trigonometric, g0 - g2 + g4, g1 - g3], limits)
    out = []
    for solution in found:
        _, C, S = solution.unknowns[0]
        r = S / pick(1.0 + C, _NEAR, 1.0 + C, 1.0)
        r = pick(solution.status, 8.5, limits.wanted[0], r)
        valid = pick(1.0 + C, _NEAR, solution.valid, 0.0)  # not at infinity
        out.append(Solution(((r, 1.0, 0.0),), valid, solution.status))
    return out


def quartic(g: Sequence[Number], limits: Limits) -> list[Solution]:
    """``a0 + a1 C + a2 S + a3 cos(2 x) + a4 sin(2 x) = 0``, four solutions.

    Ferrari's formulas for ``t = tan(x / 2)`` find them, Newton's method makes them exact.
    """
    a0, a1, a2, a3, a4 = g[:5]
    size: Number = 0.0
    start: Number = 0.0
    for w in np.arange(0.1, 6.0, 0.4 * pi).tolist():  # x from an angle opposite to which f is large
        f = a0 - a1 * cos(w) - a2 * sin(w) + a3 * cos(2.0 * w) + a4 * sin(2.0 * w)
        start, size = pick(_size(f), size, w, start), _larger(_size(f), size)
    C, S = function("cos", start), function("sin", start)
    a1, a2 = a1 * C + a2 * S, a2 * C - a1 * S
    C, S = C * C - S * S, 2.0 * (S * C)
    a3, a4 = a3 * C + a4 * S, a4 * C - a3 * S
    lead = pick(size, 0.0, a0 - a1 + a3, 1.0)
    b, c = (2.0 * a2 - 4.0 * a4) / lead, (2.0 * a0 - 6.0 * a3) / lead
    d, e = (2.0 * a2 + 4.0 * a4) / lead, (a0 + a1 + a3) / lead
    # y^4 + p y^2 + q y + r = 0 with t = y - b / 4, and its resolvent with the largest root m
    h = 0.25 * b
    p, q = c - 6.0 * h * h, d - 2.0 * h * c + 8.0 * h * h * h
    r = e - h * d + h * h * c - 3.0 * h * h * h * h
    m = _larger(_largest_root(p, 0.25 * p * p - r, -0.125 * q * q), 1e-30)
    root = function("sqrt", 2.0 * m)
    free, out = _below(size, 0.0), []
    for sign in (1.0, -1.0):
        room = -2.0 * (p + m + sign * (q / root))
        scale = _size(p) + m + _size(q / root)
        near = pick(_size(room), _BEYOND * scale, 0.0, _DOUBTFUL)
        half = function("sqrt", _larger(room, 0.0))
        for other in (half, -half):
            x = 2.0 * function("atan2", 0.5 * (sign * root + other) - h, 1.0)
            for _ in range(4):
                C, S = function("cos", x), function("sin", x)
                f = a0 + a1 * C + a2 * S + a3 * (C * C - S * S) + 2.0 * a4 * (S * C)
                slope = a2 * C - a1 * S - 4.0 * a3 * (S * C) + 2.0 * a4 * (C * C - S * S)
                x = x - f / pick(_size(slope), _LEAST * size, slope, 1.0)
            x = pick(free, 0.5, limits.wanted[0], x + start)
            angle = x, function("cos", x), function("sin", x)
            valid = pick(free, 0.5, float(not out), _below(-room, _BEYOND * scale))
            out.append(Solution((angle,), valid, pick(free, 0.5, _FREE, near)))
    return out


def _largest_root(a: Number, b: Number, c: Number) -> Number:
    """Largest real root of ``m^3 + a m^2 + b m + c = 0``, by Cardano's formulas."""
    P, Q = b - a * a / 3.0, c - a * b / 3.0 + 2.0 / 27.0 * (a * a * a)
    square = 0.25 * Q * Q + P * P * P / 27.0
    root = function("sqrt", _size(square))
    u = function("exp", function("log", _larger(0.5 * _size(Q) + root, 1e-300)) / 3.0)
    alone = pick(Q, 0.0, -1.0, 1.0) * (u - P / (3.0 * u))
    angle = function("atan2", root, -0.5 * Q) / 3.0
    largest = 2.0 * function("sqrt", _larger(-P / 3.0, 0.0)) * function("cos", angle)
    return pick(square, 0.0, alone, largest) - a / 3.0


_SOLVERS: dict[int, Callable[[Sequence[Number], Limits], list[Solution]]] = {
    layout.ANGLE: lambda g, limits: opposite_angles(g, limits)[:1],
    layout.OPPOSITE_ANGLES: opposite_angles,
    layout.ONE_EQUATION: angle_of_one,
    layout.TWO_EQUATIONS: angle_of_two,
    layout.TWO_ANGLES: pair_of_angles,
    layout.LENGTH: length,
    layout.LENGTH_TIMES_ANGLE: partial(length_and_angle, is_product=True),
    layout.LENGTH_AND_ANGLE: partial(length_and_angle, is_product=False),
    layout.POLYNOMIAL: polynomial,
    layout.QUARTIC: quartic,
}
