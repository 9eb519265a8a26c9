"""The Jacobian as formulas: three matrices, the third as simple as frames can make it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import InvalidValueError
from ...model import FrameOfInterest, RobotModel, check_model
from ..factors import jacobian_factors, middle_frames
from ..singular.events import random_postures
from ._chain import TOOL, SymbolicChain
from ._entries import column_entries, column_length, lever_entries, rotation_entries
from ._factor import numbers_of
from ._jacobian_printing import jacobian_latex, jacobian_text
from .jacobian_explanation import JacobianExplanation

_COMPARED = 6
"""So many pairs of frames, those with the most zeros, are written out to choose among."""


def explain_jacobian(
    model: RobotModel,
    projection: str | int | None = None,
    intermediate: str | int | None = None,
    frame: str | int | None = None,
    symbols: Mapping[str, str] | None = None,
) -> JacobianExplanation:
    """The Jacobian as formulas, decomposed into three matrices as in the book.

    ``J = diag(R_i, R_i) [1, -[L]x; 0, 1] iJ_{n,j}``; column k of the third matrix is
    ``[a_k x L_{k,j}; a_k]`` if joint k is revolute and ``[a_k; 0]`` if it is prismatic, all in the
    axes of R_i, with ``L_{k,j}`` from O_k to O_j. Notation as of `explain_dgm`: ``C23`` is
    ``cos(θ2 + θ3)``, ``D3`` and ``RL4`` are constants of the table.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    projection, intermediate : str or int, optional
        Frames i and j of the table; 0 is R_0. Whichever is not given is chosen so that the third
        matrix has the most zeros, then the shortest formulas, then lies in the middle of the arm.
    frame : str or int, optional
        Frame whose Jacobian it is; default the tool.
    symbols : mapping of str to str, optional
        Other names of symbols, as for `explain_dgm`.

    Returns
    -------
    JacobianExplanation
        Prints as the matrices; has the expressions, ``.latex`` and ``.evaluate(q)``.

    Raises
    ------
    FrameNotFoundError
        No such frame.
    InvalidValueError
        ``projection`` or ``intermediate`` is fixed to a frame of the table without being it, or
        ``symbols`` does not fit.

    References
    ----------
    Seed book section 1.3.1.3.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> text = explain_jacobian(load("rx90"), 3, 4).text
    >>> print(text[text.rindex("3J6,4") :])
    3J6,4, rows vx, vy, vz, wx, wy, wz
    <BLANKLINE>
      ⎡               0  -RL4 + S3*D3  -RL4  0   0       0 ⎤
      ⎢               0         C3*D3     0  0   0       0 ⎥
      ⎢ S23*RL4 - C2*D3             0     0  0   0       0 ⎥
      ⎢             S23             0     0  0  S4  -C4*S5 ⎥
      ⎢             C23             0     0  1   0      C5 ⎥
      ⎣               0             1     1  0  C4   S4*S5 ⎦
    """
    import sympy

    check_model(model)
    point = model.twin.frame(frame)
    i = None if projection is None else _node(model, projection, point, "projection")
    j = None if intermediate is None else _node(model, intermediate, point, "intermediate")
    chain = SymbolicChain(model, point, [k for k in (i, j) if k is not None and k > 0], symbols)
    if i is None or j is None:
        i, j = _simplest(model, frame, point, chain, i, j)
    rotation = sympy.ImmutableDenseMatrix(rotation_entries(chain, i))
    lever = sympy.ImmutableDenseMatrix([[v] for v in lever_entries(chain, i, j)])
    reduced = _reduced(chain, i, j)
    chain.notation.check_new_names()
    label = "the tool" if frame is None else f"R_{frame}" if not isinstance(frame, str) else frame
    names = [label if node == TOOL else f"R_{node}" for node in (i, j)]
    draft = JacobianExplanation(
        robot=model.name,
        frame=label,
        projection=names[0],
        intermediate=names[1],
        rotation=rotation,
        lever=lever,
        reduced=reduced,
        numbers=numbers_of(chain, [rotation, lever, reduced]),
        text="",
        latex="",
    )
    last = chain.path[-1] if chain.path else 0
    columns = [f"joint {int(row) + 1}" for row in model.table.joint_rows]
    return replace(
        draft,
        text=jacobian_text(draft, last, columns, chain.notation),
        latex=jacobian_latex(draft, last, chain.notation),
    )


def _reduced(chain: SymbolicChain, i: int, j: int) -> Any:
    import sympy

    out = sympy.zeros(6, len(chain.variables))
    for k in chain.path:
        if k in chain.joints:
            for row, entry in enumerate(column_entries(chain, k, i, j)):
                out[row, chain.joints[k]] = entry
    return sympy.ImmutableDenseMatrix(out)


def _length(chain: SymbolicChain, i: int, j: int) -> int:
    """How many symbols the third matrix has when multiplied out."""
    return sum(column_length(chain, k, i, j) for k in chain.path if k in chain.joints)


def _simplest(
    model: RobotModel,
    frame: str | int | None,
    point: FrameOfInterest,
    chain: SymbolicChain,
    i: int | None,
    j: int | None,
) -> tuple[int, int]:
    """The pair of frames on the way to the frame whose third matrix is simplest."""
    q = random_postures(model, 4, seed=3)
    frames = [0, *chain.path]
    at_frame = model.twin.names.tool if frame is None else frame
    middle = middle_frames(point)
    place = {node: k for k, node in enumerate(frames)} | {TOOL: len(frames)}
    found = []
    for a in frames if i is None else [i]:
        for b in frames if j is None else [j]:
            c, d = (at_frame if node == TOOL else node for node in (a, b))
            J = jacobian_factors(model, q, c, d, frame).reduced
            entries = int((np.abs(J) > 1e-11).any(axis=0).sum())
            away = abs(place.get(a, 0) - place[middle[0]]) + abs(place.get(b, 0) - place[middle[1]])
            found.append((entries, away, a, b))
    found.sort()
    best = []
    for entries, away, a, b in found[:_COMPARED]:
        best.append((entries + _length(chain, a, b), away, a, b))
    return min(best)[2:]


def _node(model: RobotModel, wanted: str | int, point: FrameOfInterest, name: str) -> int:
    """Number of a frame of the table, or the frame of interest itself."""
    found = model.twin.frame(wanted)
    if not found.position.any() and np.array_equal(found.rotation, np.eye(3)):
        return found.parent
    same = found.parent == point.parent and np.array_equal(found.position, point.position)
    if same and np.array_equal(found.rotation, point.rotation):
        return TOOL
    raise InvalidValueError(
        f"{name}: formulas need a frame of the table, and {wanted!r} is fixed to frame "
        f"{found.parent}; take that, or jacobian_factors for numbers."
    )
