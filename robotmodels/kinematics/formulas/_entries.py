"""Entries of the three matrices as formulas: expanded and collected, or nested where they are long.

An arm with many oblique axes has entries of thousands of terms when multiplied out. These are
built as the direct model's are, from the right, vector by vector, with partial results named
``U1``, ``U2``, ...
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

from ...geometry import PRISMATIC
from ...symbolic_dgm._angles import Angle
from ...symbolic_dgm._words import Move, multiplied_out
from ._chain import TOOL, WORLD, SymbolicChain
from ._collect import cleaned, formula

_MOST_ANGLES = 8
"""Angles between frames, right ones not counted, up to which entries are multiplied out."""


def rotation_entries(chain: SymbolicChain, i: int) -> list[list[Any]]:
    """Axes of node i in the world."""
    if _is_short(chain, WORLD, i):
        return [
            [formula(cleaned(p, chain), chain) for p in row] for row in chain.rotation(WORLD, i)
        ]
    matrix = multiplied_out(_turns(moves_between(chain, WORLD, i)), chain.notation)
    return [[matrix[row, k] for k in range(3)] for row in range(3)]


def lever_entries(chain: SymbolicChain, i: int, j: int) -> list[Any]:
    """From the origin of node j to that of the frame, in the axes of i."""
    if _is_short(chain, i, j, TOOL):
        return [formula(cleaned(p, chain), chain) for p in chain.lever(i, j, TOOL)]
    return _seen_from(chain, i, j, _position(chain, j, TOOL))


def column_entries(chain: SymbolicChain, k: int, i: int, j: int) -> list[Any]:
    """Column of joint k in the third matrix."""
    import sympy

    if _is_short(chain, i, k, j):
        return [formula(cleaned(p, chain), chain) for p in chain.column(k, i, j)]
    zero = sympy.S.Zero
    a = _seen_from(chain, i, k, [zero, zero, sympy.S.One])
    if chain.table.sigma[k - 1] == PRISMATIC:
        return [*a, zero, zero, zero]
    x, y, _ = _position(chain, k, j)
    return [*_seen_from(chain, i, k, [-y, x, zero]), *a]


def column_length(chain: SymbolicChain, k: int, i: int, j: int) -> int:
    """Symbols in a column when it is multiplied out; an estimate where it would be long."""
    if not _is_short(chain, i, k, j):
        return 2 ** _angles_between(chain, i, k, j)
    return sum(sum(monomial) for p in chain.column(k, i, j) for monomial in p)


def _is_short(chain: SymbolicChain, *nodes: int) -> bool:
    return _angles_between(chain, *nodes) <= _MOST_ANGLES


def _angles_between(chain: SymbolicChain, *nodes: int) -> int:
    """Angles that the way between nodes has, right ones not counted."""
    steps = set()
    for a, b in pairwise(nodes):
        up, down = set(chain.ancestors(a)), set(chain.ancestors(b))
        steps |= up ^ down
    return sum(_angles(chain, node) for node in steps if node != WORLD)


def _angles(chain: SymbolicChain, node: int) -> int:
    amounts = [m.amount for m in chain.moves[node] if isinstance(m.amount, Angle)]
    return sum(amount.quarters is None for amount in amounts)


def moves_between(chain: SymbolicChain, a: int, b: int) -> list[Move]:
    """Elementary motions whose product is the pose of node b in node a."""
    way = chain.between(a, b)
    out: list[Move] = []
    for near, far in pairwise(way):
        if chain.parent.get(far) == near:
            out += chain.moves[far]
        else:
            out += [_opposite(move) for move in reversed(chain.moves[near])]
    return out


def _opposite(move: Move) -> Move:
    amount = move.amount
    return replace(move, amount=amount.times(-1) if isinstance(amount, Angle) else -amount)


def _turns(moves: list[Move]) -> list[Move]:
    return [move for move in moves if isinstance(move.amount, Angle)]


def _position(chain: SymbolicChain, a: int, b: int) -> list[Any]:
    matrix = multiplied_out(moves_between(chain, a, b), chain.notation)
    return [matrix[row, 3] for row in range(3)]


def _seen_from(chain: SymbolicChain, i: int, k: int, v: list[Any]) -> list[Any]:
    """A vector in the axes of k, in those of i."""
    v = [chain.notation.shortened(x) for x in v]
    moves = _turns(moves_between(chain, i, k))
    moves += [Move(axis, x, "", "") for axis, x in enumerate(v) if x != 0]
    matrix = multiplied_out(moves, chain.notation)
    return [matrix[row, 3] for row in range(3)]
