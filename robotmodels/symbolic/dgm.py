"""The direct geometric model as formulas, derived step by step as in the book."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..latex_text import Explanation, table_latex
from ..model import RobotModel
from .chain import TOOL, WORLD, Chain, Move, motion_text, multiplied_out
from .explanation import Document, FormulaNumbers, frame_label


@dataclass(frozen=True, slots=True)
class SymbolicTransform:
    """One transformation matrix of the derivation.

    Parameters
    ----------
    name : str
        Such as ``"2T3"``, the pose of R_3 in R_2; ``"Z"`` and ``"E"`` are base and tool.
    motion : str
        The product that it is, such as ``"Trans(x, D3) Rot(z, θ3)"`` or ``"2T3 3T6"``.
    matrix : sympy.ImmutableDenseMatrix, shape (4, 4)
        Its entries, lengths in metres.
    """

    name: str
    motion: str
    matrix: Any


@dataclass(frozen=True, slots=True, repr=False)
class DirectModelExplanation(Explanation):
    """The symbolic direct geometric model of a robot, made by `explain_dgm`.

    Parameters
    ----------
    variables : tuple of sympy.Symbol, length n
        Joint variables in table order, numbered by frame: ``theta_j`` or ``r_j``.
    factors, products : tuple of SymbolicTransform
        ``T(a(j), j)`` of each row from the base to the frame, and the products of the last two,
        three, ... of them; the last one is the product of all.
    product : SymbolicTransform
        ``0Tn``, the pose of the last frame of the chain in R_0.
    base, tool : SymbolicTransform or None
        ``Z`` and ``E`` of eq. [1.10]; None where they are the identity.
    pose : sympy.ImmutableDenseMatrix, shape (4, 4)
        The world pose, ``Z 0Tn E``; its columns are ``s``, ``n``, ``a``, ``P``.
    abbreviations : tuple of (sympy.Symbol, sympy.Expr)
        ``C23`` and its meaning ``cos(theta2 + theta3)``, and so on, each after those it uses.
    constants : tuple of (sympy.Symbol, float)
        Lengths (metres) and angles (radians) of this robot.
    """

    robot: str
    frame: str
    variables: tuple[Any, ...]
    factors: tuple[SymbolicTransform, ...]
    products: tuple[SymbolicTransform, ...]
    product: SymbolicTransform
    base: SymbolicTransform | None
    tool: SymbolicTransform | None
    pose: Any
    abbreviations: tuple[tuple[Any, Any], ...]
    constants: tuple[tuple[Any, float], ...]
    text: str = ""
    latex: str = ""

    @property
    def s(self) -> Any:
        """First axis of the frame in the world, a column of three expressions."""
        return self.pose[:3, 0]

    @property
    def n(self) -> Any:
        """Second axis of the frame in the world."""
        return self.pose[:3, 1]

    @property
    def a(self) -> Any:
        """Third axis of the frame in the world."""
        return self.pose[:3, 2]

    @property
    def P(self) -> Any:
        """Origin of the frame in the world, metres."""
        return self.pose[:3, 3]

    def written_out(self) -> Any:
        """The pose (4, 4) in joint variables and constants only, for differentiation and the like.

        It is long for an arm with many oblique axes.
        """
        pose = self.pose
        for symbol, meaning in reversed(self.abbreviations):
            pose = pose.xreplace({symbol: meaning})
        return pose

    def evaluate(self, q: ArrayLike) -> Array:
        """World poses (..., 4, 4) of q (..., n) by the formulas: equal to `dgm`."""
        q = as_vector(q, len(self.variables), "q")
        numbers = FormulaNumbers(self.variables, self.abbreviations, self.constants)
        return numbers.matrix(self.pose, q)

    def __repr__(self) -> str:
        return f"<DirectModelExplanation of {self.robot}: pose of {self.frame} in the world>"


def explain_dgm(
    model: RobotModel,
    frame: str | int | None = None,
    symbols: Mapping[str, str] | None = None,
) -> DirectModelExplanation:
    """The direct geometric model as formulas, derived step by step as in the book.

    First the matrix ``T(a(j), j)`` of each row, then their products from the right, then the
    components s, n, a, P of ``0Tn``, and with the base and the tool where there are any. Angles
    about parallel axes are added, also where translations stand between them.

    Notation: ``C1``, ``S1`` are cosine and sine of ``θ1``, ``C23`` of ``θ2 + θ3``, ``C2m3`` of
    ``θ2 - θ3`` (opposite axes), ``C1p45`` of ``θ1 + 45°``; with ten frames or more ``C2_3``.
    Constants that are not zero get symbols: ``Dj``, ``RLj`` and ``BLj`` for d, r and b of row j,
    and ``Aj``, ``Bj``, ``Gj`` and ``THj`` for alpha, beta, gamma and the constant part of theta
    where they are no multiple of 30 or 45 degrees. Names in ``DHTable.symbols``, such as those of a
    ``.par`` file, replace these. The base is ``Z = Trans(X0, Y0, Z0) Rot(z, AZ0) Rot(y, AY0)
    Rot(x, AX0)``, the tool the same with E instead of 0. Partial results of more than 100 symbols
    (arms with many oblique axes) are named ``U1``, ``U2``, ...

    Book eq. [1.3], [1.4], [1.10] and example 1.2; the exercise, eq. (4.5).

    Angles within 1e-13 rad of a multiple of 30 or 45 degrees are taken as exact, lengths below
    1e-13 m as zero.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> rx90 = explain_dgm(load("rx90"))
    >>> print(rx90.text[rx90.text.rindex("Px"):])
    Px = -C1*(S23*RL4 - C2*D3)
    Py = -S1*(S23*RL4 - C2*D3)
    Pz = C23*RL4 + S2*D3
    """
    chain = Chain(model, model.twin.frame(frame), symbols)
    notation, path, moves = chain.notation, chain.path, chain.moves

    def step(name: str, moves: Sequence[Move], motion: str = "") -> SymbolicTransform:
        motion = motion or motion_text(moves, notation)
        return SymbolicTransform(name, motion, multiplied_out(moves, notation))

    factors = tuple(step(f"{chain.parent[j]}T{j}", moves[j]) for j in path)
    product = factors[-1] if path else step("0T0", [])
    products = []
    for factor, j in zip(factors[-2::-1], path[-2::-1], strict=True):
        before = chain.parent[j]
        name, motion = f"{before}T{path[-1]}", f"{factor.name} {product.name}"
        product = step(name, chain.moves_between(before, path[-1]), motion)
        products.append(product)
    pose = product.matrix
    if moves[0] or moves[TOOL]:
        pose = multiplied_out(chain.moves_between(WORLD, TOOL), notation)
    base = step("Z", moves[0]) if moves[0] else None
    tool = step("E", moves[TOOL]) if moves[TOOL] else None
    steps = [t for t in (*factors, *products, base, tool) if t]
    draft = DirectModelExplanation(
        robot=model.name,
        frame=frame_label(frame),
        variables=chain.variables,
        factors=factors,
        products=tuple(products),
        product=product,
        base=base,
        tool=tool,
        pose=pose,
        abbreviations=notation.used_abbreviations([pose, *(t.matrix for t in steps)]),
        constants=tuple((c.symbol, c.value) for c in notation.constants),
    )
    return _printed(draft, chain)


def _printed(e: DirectModelExplanation, chain: Chain) -> DirectModelExplanation:
    out = Document(
        f"Direct geometric model of {e.robot}: pose of {e.frame} in the world", chain.notation
    )
    table, last = str(chain.table), e.product.name[1:]
    out.add(table, table_latex(table))
    out.add_symbols([], e.abbreviations, every=True)
    if e.factors:
        out.add("Transformation of each row, T(a(j), j) [1.3]")
    for step in e.factors:
        out.add_transform(step.name, step.motion, step.matrix)
    if len(e.products) > 1:
        out.add("Products from the right")
    for step in e.products[:-1]:
        out.add_transform(step.name, step.motion, step.matrix)
    names = " ".join(t.name for t in e.factors) or "1"
    out.add_components(f"0{last}", e.product.matrix, names, " [1.4]: its columns are s, n, a, P")
    if e.base or e.tool:
        for step, of in ((e.base, "R_0 in the world"), (e.tool, f"{e.frame} in R_{last[1:]}")):
            if step:
                out.add_transform(step.name, step.motion, step.matrix, f"the pose of {of}")
        names = " ".join(t.name for t in (e.base, e.product, e.tool) if t)
        out.add_components("", e.pose, names, f" [1.10], the pose of {e.frame} in the world")
    return out.of(e)
