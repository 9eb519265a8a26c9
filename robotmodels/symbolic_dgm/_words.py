"""Chains of elementary motions, and how they are multiplied out.

A chain is held as a word of elementary rotations and translations. Rotations by multiples of a
right angle are moved to its right end (they only permute the axes of what they pass), so that
rotations about parallel axes become neighbours and their angles add before any sine or cosine is
written: C23 arises by construction, nothing is simplified afterwards. The word is then multiplied
out from the right, vector by vector, which gives the nested formulas of the book.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import hypot, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array
from ..geometry import PRISMATIC, REVOLUTE, DHTable
from ._angles import ROUNDING, Angle
from ._notation import Notation

_PLANES = ((1, 2), (2, 0), (0, 1))  # the axes that a rotation about x, y, z mixes
_GREEK = {"G": r"\gamma", "B": r"\beta", "A": r"\alpha", "TH": r"\theta^{0}"}


@dataclass(frozen=True, slots=True)
class Move:
    """Rot(axis, amount) if amount is an angle, Trans(axis, amount) if it is a length.

    ``latex`` is the amount in print, as ``text`` is.
    """

    axis: int
    amount: Any
    text: str
    latex: str


@dataclass(slots=True)
class _Stop:
    """A rotation by ``angle`` in all since its group began, then a translation by ``offset``."""

    angle: Angle
    offset: list[Any]


@dataclass(slots=True)
class _Group:
    """Rotations about parallel axes that follow each other, whatever is translated between."""

    axis: int
    stops: list[_Stop]


class Word:
    """A chain of elementary motions in normal form: translation, groups of rotations, quarters."""

    def __init__(self) -> None:
        import sympy

        self._zero = sympy.S.Zero
        self.start: list[Any] = [self._zero] * 3
        self.groups: list[_Group] = []
        self.quarters: NDArray[np.int64] = np.eye(3, dtype=np.int64)  # a rotation at the right end

    def add(self, move: Move) -> None:
        image = self.quarters[:, move.axis]
        axis = int(np.flatnonzero(image)[0])
        sign = int(image[axis])
        if not isinstance(move.amount, Angle):
            offset = self.groups[-1].stops[-1].offset if self.groups else self.start
            offset[axis] += sign * move.amount
            return
        count = move.amount.quarters
        if count is not None:
            self.quarters = self.quarters @ _quarter_turns(move.axis, count)
            return
        self._rotate(axis, move.amount.times(sign))

    def _rotate(self, axis: int, angle: Angle) -> None:
        if not self.groups or self.groups[-1].axis != axis:
            self.groups.append(_Group(axis, [_Stop(angle, [self._zero] * 3)]))
            return
        stops = self.groups[-1].stops
        total = stops[-1].angle.plus(angle)
        if any(stops[-1].offset):
            stops.append(_Stop(total, [self._zero] * 3))
            return
        stops[-1].angle = total
        # two constant angles may make a right angle, or cancel
        count = total.quarters
        if count is not None and len(stops) == 1:
            self.groups.pop()
            self.quarters = _quarter_turns(axis, count) @ self.quarters


def _quarter_turns(axis: int, count: int) -> NDArray[np.int64]:
    i, j = _PLANES[axis]
    turn = np.eye(3, dtype=np.int64)
    turn[i, i] = turn[j, j] = 0
    turn[i, j], turn[j, i] = -1, 1
    return np.linalg.matrix_power(turn, count)


def multiplied_out(moves: Iterable[Move], notation: Notation) -> Any:
    """Multiply a chain out, from the right, each column on its own."""
    import sympy

    word = Word()
    for move in moves:
        word.add(move)
    columns = [[sympy.Integer(int(v)) for v in word.quarters[:, k]] for k in range(3)]
    point: list[Any] = [sympy.S.Zero] * 3
    for number, group in reversed(list(enumerate(word.groups))):
        *between, last = group.stops
        columns = [_rotated(group.axis, last.angle, column, notation) for column in columns]
        point = _rotated(group.axis, last.angle, _sum(last.offset, point), notation)
        for stop in between:
            point = _sum(point, _rotated(group.axis, stop.angle, stop.offset, notation))
        if number:
            columns = [[notation.shortened(v) for v in column] for column in columns]
            point = [notation.shortened(v) for v in point]
    columns.append(_sum(word.start, point))
    rows = [[column[i] for column in columns] for i in range(3)]
    return sympy.ImmutableDenseMatrix([*rows, [0, 0, 0, 1]])


def _sum(u: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    return [a + b for a, b in zip(u, v, strict=True)]


def _rotated(axis: int, angle: Angle, v: Sequence[Any], notation: Notation) -> list[Any]:
    i, j = _PLANES[axis]
    out = list(v)
    if v[i] != 0 or v[j] != 0:
        C, S = notation.cos_sin(angle)
        out[i] = notation.times(C, v[i]) + notation.times(-S, v[j])
        out[j] = notation.times(S, v[i]) + notation.times(C, v[j])
    return out


def row_moves(table: DHTable, j: int, notation: Notation) -> list[Move]:
    """The elementary motions of a row, eq. [1.3] with gamma, b and beta; none that is 1."""
    row = j - 1
    sigma = table.sigma[row]

    def angle(column: str, name: str) -> Angle:
        value = float(getattr(table, column)[row])
        latex = _GREEK[name]
        own = name == "TH" and sigma == REVOLUTE
        meaning = f"the constant part of θ{j}" if own else f"{column}{j}"
        return notation.angle(f"{name}{j}", f"{latex}_{{{j}}}", value, meaning)

    def length(column: str, name: str) -> Any:
        value = float(getattr(table, column)[row])
        own = name == "RL" and sigma == PRISMATIC
        meaning = f"the constant part of r{j}" if own else f"{column}{j}"
        return notation.length(f"{name}{j}", f"{name}_{{{j}}}", value, meaning)

    gamma, b = angle("gamma", "G"), length("b", "BL")
    beta, alpha, d = angle("beta", "B"), angle("alpha", "A"), length("d", "D")
    theta, r = angle("theta", "TH"), length("r", "RL")
    if sigma == REVOLUTE:
        theta = notation.joint_angle(j).plus(theta)
    elif sigma == PRISMATIC:
        r = notation.stroke(j) + r
    amounts = (("z", gamma), ("z", b), ("y", beta), ("x", alpha), ("x", d), ("z", theta), ("z", r))
    return _moves(amounts, notation)


def pose_moves(R: Array, p: Array, suffix: str, of: str, notation: Notation) -> list[Move]:
    """A constant pose as Trans(x) Trans(y) Trans(z) Rot(z) Rot(y) Rot(x); none that is 1."""
    if hypot(R[0, 0], R[1, 0]) <= ROUNDING:  # pitch 90 degrees: the yaw is free, 0 is simplest
        up = float(np.sign(-R[2, 0]))
        angles = np.arctan2(-R[1, 2], R[1, 1]), up * pi / 2, 0.0
    else:
        angles = se3.to_rpy(R)
    amounts: list[tuple[str, Any]] = []
    for axis, value in zip("xyz", p, strict=True):
        upper = axis.upper()
        meaning = f"{axis} of the {of}"
        length = notation.length(f"{upper}{suffix}", f"{upper}_{{{suffix}}}", value, meaning)
        amounts.append((axis, length))
    for axis, value in zip("zyx", angles[::-1], strict=True):
        latex = rf"\alpha_{{{axis}{suffix}}}"
        meaning = f"angle about {axis} of the {of}"
        name = f"A{axis.upper()}{suffix}"
        amounts.append((axis, notation.angle(name, latex, float(value), meaning)))
    return _moves(amounts, notation)


def _moves(amounts: Iterable[tuple[str, Any]], notation: Notation) -> list[Move]:
    moves = []
    for axis, amount in amounts:
        if isinstance(amount, Angle):
            if not amount.is_zero:
                text, latex = amount.text(), amount.text(latex=True)
                moves.append(Move("xyz".index(axis), amount, text, latex))
        elif amount != 0:
            text, latex = notation.text(amount), notation.text(amount, latex=True)
            moves.append(Move("xyz".index(axis), amount, text, latex))
    return moves


def motion_text(moves: Sequence[Move]) -> str:
    words = (
        f"{'Rot' if isinstance(m.amount, Angle) else 'Trans'}({'xyz'[m.axis]}, {m.text})"
        for m in moves
    )
    return " ".join(words) or "1"


def motion_latex(moves: Sequence[Move]) -> str:
    words = (
        rf"\mathbf{{{'Rot' if isinstance(m.amount, Angle) else 'Trans'}}}"
        rf"(\mathbf{{{'xyz'[m.axis]}}}, {m.latex})"
        for m in moves
    )
    return r" \, ".join(words) or "1"
