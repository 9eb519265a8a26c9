"""The chain of a robot in symbols: elementary motions, and their products.

Rotations by multiples of a right angle are moved to the right end of a chain (they only permute
the axes of the motions that they pass), so that rotations about parallel axes become neighbours
and their angles add before any sine or cosine is written: C23 arises by construction and nothing
is simplified afterwards. The chain is then multiplied out from the right, vector by vector, which
gives the nested formulas of the book.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array
from ..geometry import PRISMATIC, REVOLUTE, DHTable
from ..model import FrameOfInterest, RobotModel
from .angles import ROUNDING, Angle
from .notation import Notation

PLANES = ((1, 2), (2, 0), (0, 1))
"""The two axes that a rotation about x, y or z turns."""
_GREEK = {"G": r"\gamma", "B": r"\beta", "A": r"\alpha", "TH": r"\theta^{0}"}
WORLD, TOOL = -1, -2
"""Numbers of the two nodes that are no frames of the table."""
_ANGLES_OF_A_FORMULA = 8
"""Products over more angles than this (right angles not counted) stay nested."""


@dataclass(frozen=True, slots=True)
class Move:
    """Rot(axis, amount) if amount is an angle, Trans(axis, amount) if it is a length."""

    axis: int
    amount: Any

    @property
    def turns(self) -> bool:
        """Whether it is a rotation."""
        return isinstance(self.amount, Angle)

    def inverse(self) -> Move:
        """The opposite motion."""
        return Move(self.axis, self.amount.times(-1) if self.turns else -self.amount)


_Group = tuple[int, list[tuple[Angle, list[Any]]]]
"""Successive rotations about one axis, as total angles, each followed by a translation."""


def _normal_form(
    moves: Iterable[Move],
) -> tuple[list[Any], list[_Group], NDArray[np.int64]]:
    """First translation, groups of rotations, and the rotation by right angles at the end."""
    import sympy

    start: list[Any] = [sympy.S.Zero] * 3
    groups: list[_Group] = []
    right = np.eye(3, dtype=np.int64)
    for move in moves:
        image = right[:, move.axis]
        axis = int(np.flatnonzero(image)[0])
        sign = int(image[axis])
        if not move.turns:
            offset = groups[-1][1][-1][1] if groups else start
            offset[axis] += sign * move.amount
            continue
        count = move.amount.quarters
        if count is not None:
            right = right @ _right_angles(move.axis, count)
            continue
        angle = move.amount.times(sign)
        if not groups or groups[-1][0] != axis:
            groups.append((axis, []))
        stops = groups[-1][1]
        total = stops[-1][0].plus(angle) if stops else angle
        if stops and not any(stops[-1][1]):
            stops.pop()
        stops.append((total, [sympy.S.Zero] * 3))
        # two constant angles may make a right angle, or cancel
        if len(stops) == 1 and total.quarters is not None:
            groups.pop()
            right = _right_angles(axis, total.quarters) @ right
    return start, groups, right


def _right_angles(axis: int, count: int) -> NDArray[np.int64]:
    i, j = PLANES[axis]
    turn = np.eye(3, dtype=np.int64)
    turn[i, i] = turn[j, j] = 0
    turn[i, j], turn[j, i] = -1, 1
    return np.linalg.matrix_power(turn, count)


def multiplied_out(moves: Iterable[Move], notation: Notation) -> Any:
    """Product of a chain as a 4 by 4 matrix, from the right, each column on its own."""
    import sympy

    start, groups, right = _normal_form(moves)
    columns = [[sympy.Integer(int(v)) for v in right[:, k]] for k in range(3)]
    point: list[Any] = [sympy.S.Zero] * 3
    for number, (axis, stops) in reversed(list(enumerate(groups))):
        *between, (angle, offset) = stops
        columns = [_rotated(axis, angle, column, notation) for column in columns]
        point = _rotated(axis, angle, _sum(offset, point), notation)
        for angle, offset in between:
            point = _sum(point, _rotated(axis, angle, offset, notation))
        if number:
            columns = [[notation.shortened(v) for v in column] for column in columns]
            point = [notation.shortened(v) for v in point]
    columns.append(_sum(start, point))
    rows = [[column[i] for column in columns] for i in range(3)]
    return sympy.ImmutableDenseMatrix([*rows, [0, 0, 0, 1]])


def _sum(u: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    return [a + b for a, b in zip(u, v, strict=True)]


def _rotated(axis: int, angle: Angle, v: Sequence[Any], notation: Notation) -> list[Any]:
    i, j = PLANES[axis]
    out = list(v)
    if v[i] != 0 or v[j] != 0:
        C, S = notation.cos_sin(angle)
        out[i] = notation.times(C, v[i]) + notation.times(-S, v[j])
        out[j] = notation.times(S, v[i]) + notation.times(C, v[j])
    return out


def row_moves(table: DHTable, j: int, notation: Notation) -> list[Move]:
    """Elementary motions of a row, eq. [1.3] with gamma, b and beta; identity motions left out."""
    sigma = table.sigma[j - 1]

    def constant(column: str, name: str) -> Any:
        value = float(getattr(table, column)[j - 1])
        own = (name == "TH" and sigma == REVOLUTE) or (name == "RL" and sigma == PRISMATIC)
        joint = {"theta": f"θ{j}"}.get(column, f"{column}{j}")
        meaning = f"the constant part of {joint}" if own else f"{column}{j}"
        text = table.symbols.get((column, j), "")
        meaning += f" = {text}" if text and f"{name}{j}" not in notation.new_names else ""
        if name in _GREEK:
            return notation.angle(f"{name}{j}", f"{_GREEK[name]}_{{{j}}}", value, meaning)
        return notation.length(f"{name}{j}", f"{name}_{{{j}}}", value, meaning)

    gamma, b, beta = constant("gamma", "G"), constant("b", "BL"), constant("beta", "B")
    alpha, d = constant("alpha", "A"), constant("d", "D")
    theta, r = constant("theta", "TH"), constant("r", "RL")
    if sigma == REVOLUTE:
        theta = notation.joint_angle(j).plus(theta)
    elif sigma == PRISMATIC:
        r = notation.stroke(j) + r
    return _moves("zzyxxzz", [gamma, b, beta, alpha, d, theta, r])


def pose_moves(R: Array, p: Array, suffix: str, of: str, notation: Notation) -> list[Move]:
    """A constant pose as motions along x, y, z, then about z, y, x; identities are left out."""
    if hypot(R[0, 0], R[1, 0]) <= ROUNDING:  # pitch 90 degrees: the yaw is free, 0 is simplest
        up = float(np.sign(-R[2, 0]))
        angles = np.arctan2(-R[1, 2], R[1, 1]), up * pi / 2, 0.0
    else:
        angles = se3.to_rpy(R)
    amounts: list[Any] = []
    for axis, value in zip("xyz", p, strict=True):
        name = f"{axis.upper()}{suffix}", f"{axis.upper()}_{{{suffix}}}"
        amounts.append(notation.length(*name, value, f"{axis} of the {of}"))
    for axis, value in zip("zyx", angles[::-1], strict=True):
        name = f"A{axis.upper()}{suffix}", rf"\alpha_{{{axis}{suffix}}}"
        amounts.append(notation.angle(*name, float(value), f"angle about {axis} of the {of}"))
    return _moves("xyzzyx", amounts)


def _moves(axes: str, amounts: Sequence[Any]) -> list[Move]:
    zero = Angle()
    both = zip(axes, amounts, strict=True)
    return [Move("xyz".index(axis), x) for axis, x in both if x not in (0, zero)]


def motion_text(moves: Sequence[Move], notation: Notation) -> str:
    """A chain in words, such as ``Rot(z, θ1) Trans(z, RL1)``."""
    words = (
        f"Rot({'xyz'[m.axis]}, {m.amount.text()})"
        if m.turns
        else f"Trans({'xyz'[m.axis]}, {notation.text(m.amount)})"
        for m in moves
    )
    return " ".join(words) or "1"


class Chain:
    """The world, R_0, frames of the table and the frame of interest, and their motions."""

    def __init__(
        self,
        model: RobotModel,
        point: FrameOfInterest,
        symbols: Mapping[str, str] | None = None,
        others: Sequence[int] = (),
    ) -> None:
        table = model.table
        self.model, self.table = model, table
        self.path = [int(j) for j in point.path]
        self.notation = Notation(table, symbols)
        self.variables = self.notation.variables
        needed = sorted({*self.path, *(int(j) for k in others for j in table.path(k))})
        places = {int(row) + 1: k for k, row in enumerate(table.joint_rows)}
        # frame number to column of q
        self.joints = {j: k for j, k in places.items() if j in needed}
        self.path_joints = [j for j in self.path if j in self.joints]
        self.parent = {j: int(table.antecedent[j - 1]) for j in needed}
        self.parent |= {0: WORLD, TOOL: point.parent}
        self.moves = {j: row_moves(table, j, self.notation) for j in needed}
        base, R, p = model.base, point.rotation, point.position
        self.moves[0] = pose_moves(base[:3, :3], base[:3, 3], "0", "base", self.notation)
        self.moves[TOOL] = pose_moves(R, p, "E", "tool", self.notation)

    def is_prismatic(self, j: int) -> bool:
        """Whether joint j is prismatic."""
        return bool(self.table.sigma[j - 1] == PRISMATIC)

    def ancestors(self, node: int) -> list[int]:
        """The node, its parent, and so on to the world."""
        out = [node]
        while out[-1] != WORLD:
            out.append(self.parent[out[-1]])
        return out

    def meeting(self, *nodes: int) -> int:
        """The node where the paths between three nodes meet: the last that two descend from."""
        lines = [self.ancestors(node) for node in nodes]
        shared = [node for line in lines for node in line if sum(node in x for x in lines) > 1]
        return max(shared, key=lambda node: len(self.ancestors(node)))

    def steps_between(self, a: int, b: int) -> list[tuple[int, bool]]:
        """Nodes whose motions lead from a to b, and whether from their parents to them."""
        up, down = self.ancestors(a), self.ancestors(b)
        above = [(node, False) for node in up if node not in down]
        return above + [(node, True) for node in reversed(down) if node not in up]

    def moves_between(self, a: int, b: int) -> list[Move]:
        """Elementary motions whose product is the pose of node b in node a."""
        out: list[Move] = []
        for node, down in self.steps_between(a, b):
            moves = self.moves[node]
            out += moves if down else [move.inverse() for move in reversed(moves)]
        return out

    def angles_between(self, *nodes: int) -> int:
        """Number of angles on the paths between nodes, right ones not counted."""
        steps = {node for a, b in pairwise(nodes) for node, _ in self.steps_between(a, b)}
        moves = [m for node in steps for m in self.moves[node]]
        return sum(m.turns and m.amount.quarters is None for m in moves)

    def is_short(self, *nodes: int) -> bool:
        """Whether products between nodes are short when expanded."""
        return self.angles_between(*nodes) <= _ANGLES_OF_A_FORMULA

    def nested_position(self, a: int, b: int) -> list[Any]:
        """Origin of node b in node a, as nested products."""
        return list(multiplied_out(self.moves_between(a, b), self.notation)[:3, 3])

    def nested_vector(self, i: int, k: int, v: Sequence[Any]) -> list[Any]:
        """A vector in the axes of k, in those of i, as nested products."""
        moves = [move for move in self.moves_between(i, k) if move.turns]
        short = [self.notation.shortened(x) for x in v]
        moves += [Move(axis, x) for axis, x in enumerate(short) if x != 0]
        return list(multiplied_out(moves, self.notation)[:3, 3])
