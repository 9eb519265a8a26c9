"""A robot whose poses are polynomials: axes and origins of any frame seen from any other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..._arrays import Array
from ...geometry import FIXED, PRISMATIC, REVOLUTE
from ...model import FrameOfInterest, RobotModel
from ...symbolic_dgm._angles import Angle
from ...symbolic_dgm._notation import Notation
from ...symbolic_dgm._words import Move, pose_moves, row_moves
from ._ring import Poly, TrigRing

_PLANES = ((1, 2), (2, 0), (0, 1))  # the axes that a rotation about x, y, z mixes
WORLD, TOOL = -1, -2
"""Numbers of the two nodes that are no frames of the table."""

Rows = list[list[Poly]]
Step = tuple[Rows, list[Poly]]


class SymbolicChain:
    """Symbolic chain of the world, R_0, the frames of the table and the frame of interest."""

    def __init__(
        self,
        model: RobotModel,
        point: FrameOfInterest,
        others: Sequence[int] = (),
        symbols: Mapping[str, str] | None = None,
        with_ends: bool = True,
    ) -> None:
        table = model.table
        self.model, self.table = model, table
        self.path = [int(j) for j in point.path]
        self.notation = Notation(table.f, symbols)
        self.variables = tuple(
            self.notation.variable(int(row) + 1, bool(table.sigma[row] == PRISMATIC))
            for row in table.joint_rows
        )
        needed = sorted({*self.path, *(int(j) for k in others for j in table.path(k))})
        # number of the frame to the variable and its place in q
        self.joints = {int(row) + 1: k for k, row in enumerate(table.joint_rows)}
        self.joints = {j: k for j, k in self.joints.items() if j in needed}
        notation = self.notation
        moves: dict[int, list[Move]] = {j: row_moves(table, j, notation) for j in needed}
        self.parent = {j: int(table.antecedent[j - 1]) for j in needed}
        self.parent[0] = WORLD
        self.parent[TOOL] = point.parent
        base, R, p = model.base, point.rotation, point.position
        moves[0] = pose_moves(base[:3, :3], base[:3, 3], "0", "base", notation) if with_ends else []
        moves[TOOL] = pose_moves(R, p, "E", "tool", notation) if with_ends else []
        self.moves = moves
        self.angles: dict[int, Angle] = {}  # of each revolute joint: what C_j is the cosine of
        self.cosine: dict[int, tuple[Any, Any]] = {}  # its symbols
        plain, pairs = self._generators()
        self.ring = TrigRing(plain, pairs)
        self._rotations: dict[tuple[int, int], Rows] = {}
        self._constants: dict[Any, float] | None = None
        self.coefficients: dict[Poly, Any] = {}  # already written as formulas
        self.steps: dict[int, Step] = {j: self._step(m) for j, m in moves.items()}
        self.moving = self._moving_generators()

    def _generators(self) -> tuple[list[Any], list[tuple[Any, Any]]]:
        plain: dict[Any, None] = {}
        pairs: dict[tuple[Any, Any], None] = {}
        for j, moves in self.moves.items():
            for move in moves:
                if not isinstance(move.amount, Angle):
                    plain |= dict.fromkeys(move.amount.free_symbols)
                    continue
                C, S = self.notation.cos_sin(move.amount)
                names = sorted((C.free_symbols | S.free_symbols), key=str)
                if len(names) != 2:
                    continue
                pairs[names[0], names[1]] = None
                if move.amount.joints:
                    self.cosine[j] = (names[0], names[1])
                    quarters = move.amount.turns * 2
                    exact = move.amount.turns if quarters.denominator == 1 else 0
                    self.angles[j] = Angle(
                        move.amount.joints, move.amount.constants, move.amount.turns - exact
                    )
        for j in self.joints:
            if self.table.sigma[j - 1] == PRISMATIC:
                plain[self.notation.stroke(j)] = None
        constants = sorted(plain, key=str)
        return constants, list(pairs)

    def _moving_generators(self) -> dict[int, frozenset[int]]:
        """Generators of each joint."""
        out = {}
        for j in self.joints:
            if self.table.sigma[j - 1] == PRISMATIC:
                symbols: tuple[Any, ...] = (self.notation.stroke(j),)
            else:
                symbols = self.cosine[j]
            out[j] = frozenset(self.ring.index[s] for s in symbols)
        return out

    @property
    def all_moving(self) -> frozenset[int]:
        return frozenset().union(*self.moving.values()) if self.moving else frozenset()

    def joints_of(self, p: Poly) -> tuple[int, ...]:
        """Numbers of the frames whose variables a polynomial depends on."""
        found = self.ring.occurring(p)
        return tuple(j for j, own in self.moving.items() if own & found)

    def _step(self, moves: Sequence[Move]) -> Step:
        """Rotation and position that a row of moves multiplies out to."""
        ring = self.ring
        R = [[ring.one if i == k else ring.zero for k in range(3)] for i in range(3)]
        p = [ring.zero] * 3
        for move in moves:
            if isinstance(move.amount, Angle):
                C, S = (ring.of(v) for v in self.notation.cos_sin(move.amount))
                i, k = _PLANES[move.axis]
                for row in R:
                    row[i], row[k] = (
                        ring.reduced(row[i] * C + row[k] * S),
                        ring.reduced(row[k] * C - row[i] * S),
                    )
            else:
                amount = ring.of(move.amount)
                p = [ring.reduced(a + row[move.axis] * amount) for a, row in zip(p, R, strict=True)]
        return R, p

    def ancestors(self, node: int) -> list[int]:
        """The node, its parent, and so on to the world."""
        out = [node]
        while out[-1] != WORLD:
            out.append(self.parent[out[-1]])
        return out

    def between(self, a: int, b: int) -> list[int]:
        """Nodes on the way from a to b, both included."""
        up, down = self.ancestors(a), self.ancestors(b)
        common = next(node for node in up if node in down)
        return up[: up.index(common) + 1] + down[: down.index(common)][::-1]

    def meeting(self, a: int, b: int, c: int) -> int:
        """The node where the ways between three nodes meet."""
        third = self.between(a, c)
        return [node for node in self.between(a, b) if node in third][-1]

    def rotation(self, a: int, b: int) -> Rows:
        """Axes of node b in those of node a."""
        known = self._rotations.get((a, b))
        if known is None:
            if a == b:
                one, zero = self.ring.one, self.ring.zero
                known = [[one if i == k else zero for k in range(3)] for i in range(3)]
            else:
                way = self.between(a, b)
                last = self._single(way[-2], b)
                known = (
                    last if len(way) == 2 else self.ring.product(self.rotation(a, way[-2]), last)
                )
            self._rotations[a, b] = known
        return known

    def _single(self, a: int, b: int) -> Rows:
        if self.parent.get(b) == a:
            return self.steps[b][0]
        return [list(row) for row in zip(*self.steps[a][0], strict=True)]

    def _levers(self, a: int, b: int) -> list[tuple[int, list[Poly]]]:
        """Steps from the origin of a to that of b: each a vector in the axes of a node."""
        way = self.between(a, b)
        out = []
        for near, far in pairwise(way):
            if self.parent.get(far) == near:
                out.append((near, self.steps[far][1]))
            else:
                out.append((far, [-v for v in self.steps[near][1]]))
        return [(node, step) for node, step in out if any(step)]

    def lever(self, i: int, a: int, b: int) -> list[Poly]:
        """Vector from the origin of a to that of b, in the axes of i."""
        out = [self.ring.zero] * 3
        for node, step in self._levers(a, b):
            seen = self.ring.applied(self.rotation(i, node), step)
            out = [x + y for x, y in zip(out, seen, strict=True)]
        return out

    def axis(self, i: int, k: int) -> list[Poly]:
        """Direction of the axis of frame k in the axes of i."""
        return [row[2] for row in self.rotation(i, k)]

    def column(self, k: int, i: int, j: int) -> list[Poly]:
        """Column of joint k in the third matrix: projection on i, at the origin of j.

        Each step of the lever is multiplied by the axis where the ways to both and to i meet, so
        that no joint occurs twice and nothing has to be simplified.
        """
        ring = self.ring
        a = self.axis(i, k)
        if self.table.sigma[k - 1] == PRISMATIC:
            return [*a, *[ring.zero] * 3]
        v = [ring.zero] * 3
        for node, step in self._levers(k, j):
            b = self.meeting(k, node, i)
            seen = ring.cross(self.axis(b, k), ring.applied(self.rotation(b, node), step))
            turned = ring.applied(self.rotation(i, b), seen)
            v = [x + y for x, y in zip(v, turned, strict=True)]
        return [*v, *a]

    def constants(self) -> dict[Any, float]:
        """Values of the symbols that do not move: lengths, and cosines and sines of angles."""
        if self._constants is not None:
            return dict(self._constants)
        known = {c.symbol: c.value for c in self.notation.constants}
        for pair in self.ring.pairs:
            for k in pair:
                symbol = self.ring.symbols[k]
                meaning = self.notation.abbreviations[symbol]
                if not meaning.free_symbols & set(self.variables):
                    known[symbol] = float(meaning.subs(known))
        self._constants = known
        return dict(known)

    def numbers(self, q: Array) -> dict[Any, Any]:
        """Values of all generators, vectorised over the leading axes of q."""
        known: dict[Any, Any] = self.constants()
        for j, place in self.joints.items():
            if self.table.sigma[j - 1] == PRISMATIC:
                known[self.notation.stroke(j)] = q[..., place]
                continue
            angle = self.angles[j]
            offset = sum(t.sign * t.value for t in angle.constants)
            phi = q[..., place] + (offset + float(angle.turns) * np.pi)
            C, S = self.cosine[j]
            known[C], known[S] = np.cos(phi), np.sin(phi)
        return known

    def parallel_groups(self) -> list[tuple[int, ...]]:
        """Revolute joints one after another whose axes are parallel: their angles are added."""
        groups: list[list[int]] = []
        poses = _zero_axes(self.model)
        for j in sorted(self.joints):
            if self.table.sigma[j - 1] != REVOLUTE:
                continue
            before = self._joint_before(j)
            same = (
                before is not None
                and np.linalg.norm(np.cross(poses[before - 1], poses[j - 1])) <= 1e-12
            )
            for group in groups:
                if same and before in group:
                    group.append(j)
                    break
            else:
                groups.append([j])
        return [tuple(group) for group in groups]

    def _joint_before(self, j: int) -> int | None:
        node = self.parent[j]
        while node > 0 and self.table.sigma[node - 1] in (PRISMATIC, FIXED):
            node = self.parent[node]
        return node if node > 0 else None


def _zero_axes(model: RobotModel) -> Array:
    from ..poses import link_poses

    return link_poses(model, np.zeros(model.n))[:, :3, 2]
