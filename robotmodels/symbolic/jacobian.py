"""The Jacobian as formulas: three matrices, the third simplified by the choice of frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import as_vector
from ..errors import InvalidValueError
from ..kinematics.factors import JacobianFactors, middle_frames
from ..latex_text import Explanation
from ..model import FrameOfInterest, RobotModel, check_model
from .chain import TOOL, WORLD, multiplied_out
from .explanation import Document, FormulaNumbers, aligned, equations, frame_label
from .factor import numbers_of
from .formula import formulas
from .minors import ROWS, filled_entries
from .polynomials import PolynomialChain

_COMPARED = 6
"""So many pairs of frames, those with the most zeros, are written out to choose among."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class JacobianExplanation(Explanation):
    """The three matrices of the Jacobian as formulas, made by `explain_jacobian`.

    Parameters
    ----------
    projection, intermediate : str
        Names of the frames i and j, such as ``"R_3"`` and ``"R_4"``.
    rotation : sympy.ImmutableDenseMatrix, shape (3, 3)
        Axes of R_i in the world.
    lever : sympy.ImmutableDenseMatrix, shape (3, 1)
        From the origin of R_j to that of the frame, in the axes of R_i, metres.
    reduced : sympy.ImmutableDenseMatrix, shape (6, n)
        The third matrix, rows ``[v; w]``.
    """

    robot: str
    frame: str
    projection: str
    intermediate: str
    rotation: Any
    lever: Any
    reduced: Any
    numbers: FormulaNumbers
    text: str = ""
    latex: str = ""

    @property
    def first(self) -> Any:
        """The first matrix, ``diag(R_i, R_i)``, 6 by 6 expressions."""
        import sympy

        return sympy.ImmutableDenseMatrix(sympy.diag(self.rotation, self.rotation))

    @property
    def second(self) -> Any:
        """The second matrix, ``[1, -[L]x; 0, 1]``, 6 by 6 expressions."""
        import sympy

        out = sympy.eye(6)
        out[:3, 3:] = -self.lever.hat()
        return sympy.ImmutableDenseMatrix(out)

    def evaluate(self, q: ArrayLike) -> JacobianFactors:
        """The three matrices in numbers at q (..., n): equal to `jacobian_factors`."""
        q = as_vector(q, len(self.numbers.variables), "q")
        first, second, third = (
            self.numbers.matrix(M, q) for M in (self.first, self.second, self.reduced)
        )
        return JacobianFactors(first, second, third, self.projection, self.intermediate)

    def __repr__(self) -> str:
        return f"<JacobianExplanation of {self.robot}: {self.projection}, {self.intermediate}>"


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

    Book section 1.3.1.3.

    Parameters
    ----------
    projection, intermediate : str or int, optional
        Frames i and j of the table; 0 is R_0. Whichever is not given is chosen so that the third
        matrix has the most zeros, then the shortest formulas, then lies in the middle of the arm.

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
    others = [k for k in (i, j) if k is not None and k > 0]
    chain = PolynomialChain(model, point, symbols, others)
    if i is None or j is None:
        i, j = _simplest(model, frame, point, chain, i, j)
    reduced = sympy.zeros(6, len(chain.variables))
    rotation = _rotation(chain, i)
    lever = sympy.ImmutableDenseMatrix(3, 1, _lever(chain, i, j))
    for k in chain.path_joints:
        reduced[:, chain.joints[k]] = sympy.Matrix(_column(chain, k, i, j))
    reduced = sympy.ImmutableDenseMatrix(reduced)
    label = frame_label(frame)
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
    )
    return _printed(draft, chain)


# An arm with many oblique axes has entries of thousands of terms when they are expanded. These are
# built as the direct model's are, from the right, vector by vector, with partial results named U1,
# U2, ...


def _rotation(chain: PolynomialChain, i: int) -> Any:
    """Axes of node i in the world."""
    import sympy

    if chain.is_short(WORLD, i):
        rows = [formulas(row, chain) for row in chain.rotation(WORLD, i)]
        return sympy.ImmutableDenseMatrix(rows)
    moves = [move for move in chain.moves_between(WORLD, i) if move.turns]
    return multiplied_out(moves, chain.notation)[:3, :3]


def _lever(chain: PolynomialChain, i: int, j: int) -> list[Any]:
    """Vector from the origin of node j to that of the frame, in the axes of i."""
    if chain.is_short(i, j, TOOL):
        return formulas(chain.lever(i, j, TOOL), chain)
    return chain.nested_vector(i, j, chain.nested_position(j, TOOL))


def _column(chain: PolynomialChain, k: int, i: int, j: int) -> list[Any]:
    """Column of joint k in the third matrix."""
    import sympy

    if chain.is_short(i, k, j):
        return formulas(chain.column(k, i, j), chain)
    zero = sympy.S.Zero
    axis = chain.nested_vector(i, k, [zero, zero, sympy.S.One])
    if chain.is_prismatic(k):
        return [*axis, zero, zero, zero]
    x, y, _ = chain.nested_position(k, j)
    return [*chain.nested_vector(i, k, [-y, x, zero]), *axis]


def _column_length(chain: PolynomialChain, k: int, i: int, j: int) -> int:
    """Symbols in a column when it is expanded; an estimate where it would be long."""
    if not chain.is_short(i, k, j):
        return 2 ** chain.angles_between(i, k, j)
    return sum(sum(monomial) for p in chain.column(k, i, j) for monomial in p)


def _simplest(
    model: RobotModel,
    frame: str | int | None,
    point: FrameOfInterest,
    chain: PolynomialChain,
    i: int | None,
    j: int | None,
) -> tuple[int, int]:
    """The pair of frames on the path to the frame whose third matrix is simplest."""
    frames = [0, *chain.path]
    place = {node: k for k, node in enumerate(frames)} | {TOOL: len(frames)}
    middle = [place[node] for node in middle_frames(point)]
    pairs = [(a, b) for a in (frames if i is None else [i]) for b in (frames if j is None else [j])]
    found = []
    for (a, b), filled in filled_entries(model, frame, pairs).items():
        away = abs(place.get(a, 0) - middle[0]) + abs(place.get(b, 0) - middle[1])
        found.append((int(filled.sum()), away, a, b))
    best = []
    for entries, away, a, b in sorted(found)[:_COMPARED]:
        length = sum(_column_length(chain, k, a, b) for k in chain.path_joints)
        best.append((entries + length, away, a, b))
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


def _letter(name: str) -> str:
    """Index of a frame: its number, or E for the frame that is explained."""
    return name[2:] if name.startswith("R_") and name[2:].isdigit() else "E"


def reduced_name(projection: str, intermediate: str, last: int) -> str:
    """Name of a third matrix, such as ``3J6,4``."""
    return f"{_letter(projection)}J{last},{_letter(intermediate)}"


def _printed(e: JacobianExplanation, chain: PolynomialChain) -> JacobianExplanation:
    out = Document(f"Jacobian of {e.robot}: motion of {e.frame} in the world", chain.notation)
    i, j = _letter(e.projection), _letter(e.intermediate)
    name = reduced_name(e.projection, e.intermediate, chain.path[-1] if chain.path else 0)
    blocks = [
        [rf"\mathbf{{R}}_{{{i}}}", r"\mathbf{0}", r"\mathbf{0}", rf"\mathbf{{R}}_{{{i}}}"],
        [r"\mathbf{1}", r"-\hat{\mathbf{L}}", r"\mathbf{0}", r"\mathbf{1}"],
    ]
    bmatrix = r"\begin{{bmatrix}} {} & {} \\ {} & {} \end{{bmatrix}} "
    product = "".join(bmatrix.format(*block) for block in blocks) + chain.notation.tex(name)
    out.add(
        f"J = diag({i}R, {i}R) [1, -[L]x; 0, 1] {name} with projection frame {e.projection} and "
        f"intermediate frame {e.intermediate}",
        equations([rf"\mathbf{{J}} = {product}"]),
    )
    out.add_symbols([e.rotation, e.lever, e.reduced], e.numbers.abbreviations)
    heading = f"{i}R, the axes of {e.projection} in the world"
    out.add_matrix(heading, f"{i}R", e.rotation, "xyz", "sna")
    heading = f"L, from O_{j} to the origin of {e.frame}, in the axes of {e.projection}"
    lever = [(f"L{a}", chain.notation.text(v)) for a, v in zip("xyz", e.lever, strict=True)]
    lines = [f"  {left} = {right}" for left, right in lever]
    out.add(heading)
    tex = [(f"L_{left[1]}", chain.notation.tex(right)) for left, right in lever]
    out.add("\n".join(lines), aligned(tex))
    columns = [f"joint {int(row) + 1}" for row in chain.table.joint_rows]
    out.add_matrix(f"{name}, rows vx, vy, vz, wx, wy, wz", name, e.reduced, ROWS, columns)
    return out.of(e)
