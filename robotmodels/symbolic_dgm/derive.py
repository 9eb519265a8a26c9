"""The direct geometric model as formulas, step by step as the book derives it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..geometry import PRISMATIC
from ..model import RobotModel
from ._notation import Notation
from ._printing import derivation_latex, derivation_text
from ._words import Move, motion_latex, motion_text, multiplied_out, pose_moves, row_moves
from .result import DirectModelExplanation, SymbolicTransform


def explain_dgm(
    model: RobotModel,
    frame: str | int | None = None,
    symbols: Mapping[str, str] | None = None,
) -> DirectModelExplanation:
    """The direct geometric model as formulas, derived step by step as in the book.

    First the matrix ``T(a(j), j)`` of each row, then their products from the right, then the
    components s, n, a, P of ``0Tn``, and with the base and the tool where there are any. Angles
    about parallel axes are added, whatever stands between them.

    Notation: ``C1``, ``S1`` are cosine and sine of ``θ1``, ``C23`` of ``θ2 + θ3``; an ``m`` before
    a number subtracts, so ``C2m3 = cos(θ2 - θ3)`` for opposite axes. With ten frames or more,
    sums have underscores: ``C2_3``. Constants that are not zero get symbols: ``Dj``, ``RLj`` and
    ``BLj`` for d, r and b of row j, and for angles that are no multiple of 30 or 45 degrees ``Aj``,
    ``Bj``, ``Gj`` and ``THj`` for alpha, beta, gamma and the constant part of theta
    (``C2TH2 = cos(θ2 + TH2)``); ``C1p45 = cos(θ1 + 45°)``. The base is ``Z = Trans(X0, Y0, Z0)
    Rot(z, AZ0) Rot(y, AY0) Rot(x, AX0)``, the tool the same with E instead of 0. Partial results
    of more than 100 symbols (arms with many oblique axes) are named ``U1``, ``U2``, ...

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    frame : str or int, optional
        Name or number of a frame; default the tool.
    symbols : mapping of str to str, optional
        Other names for some of the symbols, such as ``{"RL1": "l1", "C1": "c1"}``.

    Returns
    -------
    DirectModelExplanation
        Prints as the derivation; has the matrices, ``.latex`` and ``.evaluate(q)``.

    Raises
    ------
    FrameNotFoundError
        No such frame.
    InvalidValueError
        ``symbols`` renames something that does not occur, gives a name that is not an
        identifier, or gives one twice.

    Notes
    -----
    Angles within 1e-13 rad of a multiple of 30 or 45 degrees are taken as exact, lengths below
    1e-13 m as zero.

    References
    ----------
    Seed book eq. [1.3], [1.4], [1.10] and example 1.2; the exercise, eq. (4.5).

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> rx90 = explain_dgm(load("rx90"))
    >>> print(rx90.text[rx90.text.rindex("Px"):])
    Px = -C1*(S23*RL4 - C2*D3)
    Py = -S1*(S23*RL4 - C2*D3)
    Pz = C23*RL4 + S2*D3
    """
    import sympy

    point = model.twin.frame(frame)
    table, path = model.table, [int(j) for j in point.path]
    notation = Notation(table.f, symbols)
    variables = tuple(
        notation.variable(int(row) + 1, table.sigma[row] == PRISMATIC) for row in table.joint_rows
    )
    rows = {j: row_moves(table, j, notation) for j in path}
    Z = pose_moves(model.base[:3, :3], model.base[:3, 3], "0", "base", notation)
    E = pose_moves(point.rotation, point.position, "E", "tool", notation)

    def step(name: str, moves: Sequence[Move]) -> SymbolicTransform:
        return SymbolicTransform(name, motion_text(moves), multiplied_out(moves, notation))

    factors = tuple(step(f"{table.antecedent[j - 1]}T{j}", rows[j]) for j in path)
    products = []
    for k in range(len(path) - 2, -1, -1):
        last, of = path[-1], products[-1].name if products else factors[-1].name
        moves = [move for j in path[k:] for move in rows[j]]
        name = f"{table.antecedent[path[k] - 1]}T{last}"
        matrix = multiplied_out(moves, notation)
        products.append(SymbolicTransform(name, f"{factors[k].name} {of}", matrix))
    if path:
        product = products[-1] if products else factors[0]
    else:
        product = SymbolicTransform("0T0", "1", sympy.ImmutableDenseMatrix.eye(4))
    everything = [*Z, *(move for j in path for move in rows[j]), *E]
    pose = multiplied_out(everything, notation) if Z or E else product.matrix
    base = step("Z", Z) if Z else None
    tool = step("E", E) if E else None
    notation.check_new_names()
    steps = (*factors, *products, *(t for t in (base, tool) if t))
    abbreviations = notation.used_abbreviations([pose, *(t.matrix for t in steps)])
    label = "the tool" if frame is None else f"R_{frame}" if not isinstance(frame, str) else frame
    draft = DirectModelExplanation(
        robot=model.name,
        frame=label,
        variables=variables,
        factors=factors,
        products=tuple(products),
        product=product,
        base=base,
        tool=tool,
        pose=pose,
        abbreviations=abbreviations,
        constants=tuple((c.symbol, c.value) for c in notation.constants),
        text="",
        latex="",
    )
    motions = [motion_latex(moves) for moves in (*rows.values(), Z, E)]
    return replace(
        draft,
        text=derivation_text(draft, str(table), notation),
        latex=derivation_latex(draft, str(table), motions, notation),
    )
