"""The chain of a robot in symbols: its nodes, and the motions and products between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from ..geometry import PRISMATIC
from ..model import FrameOfInterest, RobotModel
from .moves import Move, multiplied_out, pose_moves, row_moves
from .notation import Notation

WORLD, TOOL = -1, -2
"""Numbers of the two nodes that are no frames of the table."""
_ANGLES_OF_A_FORMULA = 8
"""Angles between nodes, right ones not counted, up to which products are expanded."""


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
        # number of the frame to the variable and its place in q
        self.joints = {j: k for j, k in places.items() if j in needed}
        self.path_joints = [j for j in self.path if j in self.joints]
        self.parent = {j: int(table.antecedent[j - 1]) for j in needed}
        self.parent |= {0: WORLD, TOOL: point.parent}
        self.moves = {j: row_moves(table, j, self.notation) for j in needed}
        base, R, p = model.base, point.rotation, point.position
        self.moves[0] = pose_moves(base[:3, :3], base[:3, 3], "0", "base", self.notation)
        self.moves[TOOL] = pose_moves(R, p, "E", "tool", self.notation)

    def is_prismatic(self, j: int) -> bool:
        """Whether frame j slides."""
        return bool(self.table.sigma[j - 1] == PRISMATIC)

    def ancestors(self, node: int) -> list[int]:
        """The node, its parent, and so on to the world."""
        out = [node]
        while out[-1] != WORLD:
            out.append(self.parent[out[-1]])
        return out

    def between(self, a: int, b: int) -> list[int]:
        """Nodes from a to b, both included."""
        up, down = self.ancestors(a), self.ancestors(b)
        common = next(node for node in up if node in down)
        return up[: up.index(common) + 1] + down[: down.index(common)][::-1]

    def meeting(self, a: int, b: int, c: int) -> int:
        """The node where the paths between three nodes meet."""
        third = self.between(a, c)
        return [node for node in self.between(a, b) if node in third][-1]

    def moves_between(self, a: int, b: int) -> list[Move]:
        """Elementary motions whose product is the pose of node b in node a."""
        out: list[Move] = []
        for near, far in pairwise(self.between(a, b)):
            if self.parent.get(far) == near:
                out += self.moves[far]
            else:
                out += [move.inverse() for move in reversed(self.moves[near])]
        return out

    def angles_between(self, *nodes: int) -> int:
        """Number of angles on the paths between nodes, right ones not counted."""
        steps = set()
        for a, b in pairwise(nodes):
            steps |= set(self.ancestors(a)) ^ set(self.ancestors(b))
        moves = [m for node in steps if node != WORLD for m in self.moves[node]]
        return sum(m.turns and m.amount.quarters is None for m in moves)

    def is_short(self, *nodes: int) -> bool:
        """Whether products between nodes are short when expanded."""
        return self.angles_between(*nodes) <= _ANGLES_OF_A_FORMULA

    def nested_rotation(self, a: int, b: int) -> Any:
        """Axes of node b in those of node a, as nested products."""
        moves = [move for move in self.moves_between(a, b) if move.turns]
        return multiplied_out(moves, self.notation)[:3, :3]

    def nested_position(self, a: int, b: int) -> list[Any]:
        """Origin of node b in node a, as nested products."""
        return list(multiplied_out(self.moves_between(a, b), self.notation)[:3, 3])

    def nested_vector(self, i: int, k: int, v: Sequence[Any]) -> list[Any]:
        """A vector in the axes of k, in those of i, as nested products."""
        moves = [move for move in self.moves_between(i, k) if move.turns]
        short = [self.notation.shortened(x) for x in v]
        moves += [Move(axis, x) for axis, x in enumerate(short) if x != 0]
        return list(multiplied_out(moves, self.notation)[:3, 3])
