"""The singular positions of a robot in closed form: factors of the determinant of its Jacobian."""

from __future__ import annotations

import weakref
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...model import FrameOfInterest, RobotModel, check_model
from ..singular.events import ArmGeometry
from ._blocks import Block, triangular_blocks
from ._chain import TOOL, SymbolicChain
from ._collect import cleaned, formula
from ._conditions import families
from ._factor import factor_of, numbers_of, unit_text, with_meaning
from ._factoring import factored
from ._ring import Poly
from ._singularity_printing import MinorWords, explanation_latex, explanation_text
from ._task import Minor, Patterns, Task, task_of
from .singularity_explanation import (
    FormulaStatus,
    SingularityCondition,
    SingularityExplanation,
    SingularityFactor,
    SingularityKind,
)

_MOST_TERMS = 600
"""Determinants with more terms are not written out."""
_MOST_KNOWN = 8
# by identity: a model's hash reads all of its numbers
_KNOWN: dict[int, tuple[weakref.ref[RobotModel], dict[Any, SingularityExplanation]]] = {}
_ORDER = {kind: place for place, kind in enumerate(SingularityKind)}


def explain_singularities(
    model: RobotModel,
    frame: str | int | None = None,
    symbols: Mapping[str, str] | None = None,
) -> SingularityExplanation:
    """Where a robot is singular, as formulas: the factors of the determinant of its Jacobian.

    Only the third of the three matrices of the book can be singular. The projection and
    intermediate frames are chosen so that it has the most zeros; rows and columns are rearranged
    to a block triangular form, so that the determinant is the product of small ones, and these
    are factored as polynomials in sines and cosines. For an arm with a spherical wrist that gives
    the determinant of the arm times that of the wrist.

    What decides: for six joints the determinant of the Jacobian (base and tool do not matter).
    For up to three joints the position of the frame, if it has as many freedoms as they are (here
    the tool matters; `classify_singularity`, `nearest_singularity` and `singularity_flags` take it
    by default as well); else the rows that are not zero, if they are as many as the joints (four
    of a SCARA arm); else all square minors. For more joints than rows all square minors: the
    matrix loses rank where every minor has a factor that vanishes, and ``conditions`` are the
    smallest sets of such factors.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    frame : str or int, optional
        Name or number of the frame whose motion it is; default the tool. Joints that do not move
        it have no part.
    symbols : mapping of str to str, optional
        Other names of symbols, as for `explain_dgm`.

    Returns
    -------
    SingularityExplanation
        Prints as the derivation; has the factors, ``.latex``, ``.values(q)`` and
        ``.determinant(q)``. Where no factors in closed form exist its status says so.

    Raises
    ------
    FrameNotFoundError
        No such frame.
    InvalidValueError
        ``symbols`` does not fit.

    Notes
    -----
    Constants are kept as symbols while factoring. Entries below 1e-11 in random postures count as
    zero, directions that are lost to 1e-9 as lost, and sums of constants that cancel to 1e-12 of
    their size are dropped. The last results of a model are kept as long as it is: asking again
    returns the same object.

    References
    ----------
    Seed book section 1.3.1.3.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> for factor in explain_singularities(load("rx90")).factors:
    ...     print(factor.kind.value, "|", factor.text, "|", factor.solution)
    shoulder | S23*RL4 - C2*D3 | θ2 = atan2(D3 - S3*RL4, C3*RL4) or that plus π
    elbow | C3 | θ3 = -π/2 or π/2
    wrist | S5 | θ5 = 0 or π
    """
    check_model(model)
    point = model.twin.frame(frame)
    # in words: what does not fit is refused below
    names = repr(dict(symbols)) if isinstance(symbols, Mapping) else repr(symbols)
    key = (point.pin_id, repr(frame), names)
    known = _known(model)
    found = known.pop(key, None)
    if found is None:
        found = _explanation(model, point, frame, symbols)
    known[key] = found  # the last one asked for comes last
    while len(known) > _MOST_KNOWN:
        known.pop(next(iter(known)))
    return found


def _known(model: RobotModel) -> dict[Any, SingularityExplanation]:
    """The last explanations of a model, the oldest first."""
    key = id(model)
    entry = _KNOWN.get(key)
    if entry is None or entry[0]() is not model:
        entry = _KNOWN[key] = (weakref.ref(model, lambda _: _KNOWN.pop(key, None)), {})
    return entry[1]


def _explanation(
    model: RobotModel,
    point: FrameOfInterest,
    frame: str | int | None,
    symbols: Mapping[str, str] | None,
) -> SingularityExplanation:
    chain = SymbolicChain(model, point, symbols=symbols)
    numbers = [j for j in chain.path if j in chain.joints]
    label = "the tool" if frame is None else f"R_{frame}" if not isinstance(frame, str) else frame
    empty = SingularityExplanation(
        robot=model.name, frame=label, status=FormulaStatus.NO_JOINTS, task="no rows",
        factors=(), conditions=(), constant=float("nan"), unit="1", projection="",
        intermediate="", matrix=None, rows=(), numbers=numbers_of(chain, []), text="", latex="",
    )  # fmt: skip
    if not numbers:
        chain.notation.check_new_names()
        return _printed(empty, chain)
    patterns = Patterns(model, frame, chain.path, [chain.joints[j] for j in numbers])
    task = task_of(patterns, len(numbers))
    if not task.full_rank or task.too_many:
        status = FormulaStatus.NEVER_FULL_RANK
        if task.too_many:
            status = FormulaStatus.TOO_MANY_JOINTS
        nothing = float("nan") if task.too_many or len(numbers) != 6 else 0.0
        chain.notation.check_new_names()
        draft = replace(empty, status=status, task=task.words, constant=nothing)
        return _printed(draft, chain)
    arm = ArmGeometry(model, frame, numbers, task.position_only)
    products = tuple(_product(minor, numbers, patterns, chain) for minor in task.minors)
    products = tuple(product for product in products if product.constant)
    return _explained(empty, chain, numbers, task, products, arm)


@dataclass(frozen=True, slots=True)
class Product:
    """A minor as a product of powers; a factor too long to be written is a matrix."""

    minor: Minor
    constant: Poly
    factors: tuple[tuple[Any, int], ...]  # polynomial or matrix (rows of polynomials)


def _product(minor: Minor, numbers: list[int], patterns: Patterns, chain: SymbolicChain) -> Product:
    """Determinant of a square part, block by block."""
    ring = chain.ring
    i, j = minor.projection, minor.intermediate
    columns = {c: chain.column(numbers[c], i, j) for c in minor.columns}
    filled = patterns.filled[i, j]
    blocks = triangular_blocks(filled[np.ix_(minor.rows, minor.columns)])
    if blocks is None:
        return Product(minor, ring.zero, ())
    constant = ring.one * _order_sign(blocks)
    powers: dict[Any, int] = {}
    for block in blocks:
        rows, own = [minor.rows[r] for r in block.rows], [minor.columns[c] for c in block.columns]
        M = tuple(
            tuple(cleaned(columns[c][r], chain) if filled[r, c] else ring.zero for c in own)
            for r in rows
        )
        D = ring.determinant(M, _MOST_TERMS)
        if D is None:
            powers[M] = powers.get(M, 0) + 1
            continue
        parts = factored(D, chain)
        constant = ring.times(constant, parts.constant)
        for p, power in parts.factors:
            powers[p] = powers.get(p, 0) + power
    return Product(minor, constant, tuple(powers.items()))


def _order_sign(blocks: Sequence[Block]) -> int:
    """Sign of bringing the rows and the columns of all blocks together."""
    sign = 1
    for order in ([r for b in blocks for r in b.rows], [c for b in blocks for c in b.columns]):
        for k, value in enumerate(order):
            sign *= (-1) ** sum(later < value for later in order[k + 1 :])
    return sign


class _FactorBook:
    """Factors as a person reads them, each made once."""

    def __init__(self, chain: SymbolicChain, arm: ArmGeometry, square: bool) -> None:
        self.chain, self.arm, self.square = chain, arm, square
        self.signs: dict[Any, int] = {}  # drawn out of each
        self._formulas: dict[Any, SingularityFactor] = {}
        self._made: dict[Any, SingularityFactor] = {}

    def formula(self, p: Any, power: int = 1) -> SingularityFactor:
        """Without its meaning."""
        if p not in self._formulas:
            made = (_long_factor(p, self.chain), 1) if isinstance(p, tuple) else None
            self._formulas[p], self.signs[p] = made or factor_of(p, power, self.chain)
        return self._formulas[p]

    def __call__(self, p: Any, power: int = 1) -> SingularityFactor:
        if p not in self._made:
            draft = self.formula(p, power)
            self._made[p] = with_meaning(draft, self.chain, self.arm, self.square)
        return self._made[p]

    def order(self, p: Any) -> tuple[Any, ...]:
        return _ORDER[self(p).kind], self(p).joints, self(p).text

    def impossible(self, factors: frozenset[Any]) -> bool:
        """Whether two factors of one joint alone vanish at different values of it."""
        alone: dict[int, set[float]] = {}
        for p in factors:
            if isinstance(p, tuple) or len(self.chain.joints_of(p)) != 1:
                continue
            factor = self.formula(p)
            if factor.never_zero:
                return True
            if factor.solved_joint is None:
                continue
            zeros = factor.zeros(np.zeros(len(factor.numbers.variables)))
            values = {round(float(z) % (2 * np.pi), 6) for z in zeros if not np.isnan(z)}
            joint = factor.joints[0]
            alone[joint] = alone[joint] & values if joint in alone else values
            if not alone[joint]:
                return True
        return False


def _explained(
    empty: SingularityExplanation,
    chain: SymbolicChain,
    numbers: list[int],
    task: Task,
    products: tuple[Product, ...],
    arm: ArmGeometry,
) -> SingularityExplanation:
    book = _FactorBook(chain, arm, task.square)
    constant, projection, intermediate, matrix, rows = None, "", "", None, ()
    number, expressions = float("nan"), []
    sets: list[frozenset[Any]] | None
    if task.square:
        (product,) = products
        factors = tuple(book(p, power) for p, power in product.factors)
        sets = [frozenset({p}) for p, _ in product.factors if not book(p).never_zero]
        signs = [book.signs[p] ** power for p, power in product.factors]
        signed = product.constant * int(np.prod(signs))
        number = float(chain.ring.values(signed, chain.constants(), ()))
        constant = formula(signed, chain)
        minor, rows = product.minor, product.minor.rows
        projection = _frame_name(minor.projection, chain, empty.frame)
        intermediate = _frame_name(minor.intermediate, chain, empty.frame)
        matrix = _matrix(minor, numbers, chain)
        expressions.append(matrix)
        keys = [p for p, _ in product.factors]
    else:
        minors = [[p for p, _ in product.factors] for product in products]
        sets = families(minors, chain, book.impossible)
        keys = list(dict.fromkeys(p for s in sets for p in s)) if sets is not None else []
    factors = tuple(book(p) for p in sorted(keys, key=book.order))
    chain.notation.check_new_names()
    expressions += [f.expression for f in factors if f.expression is not None]
    draft = replace(
        empty, status=_status(task, factors, sets), task=task.words, factors=factors,
        conditions=_conditions(sets or [], book), constant=number,
        unit=unit_text(_degree(task, numbers, chain)), projection=projection,
        intermediate=intermediate, matrix=matrix, rows=rows,
        numbers=numbers_of(chain, expressions),
    )  # fmt: skip
    words = [] if task.square else _minor_words(products, numbers, book)
    return _printed(draft, chain, constant, words)


def _minor_words(
    products: Sequence[Product], numbers: Sequence[int], book: _FactorBook
) -> list[MinorWords]:
    out = []
    for product in products:
        minor = product.minor
        left_out = tuple(k for c, k in enumerate(numbers) if c not in minor.columns)
        factors = tuple((book.formula(p), power) for p, power in product.factors)
        out.append((left_out, minor.rows, factors))
    return out


def _printed(
    draft: SingularityExplanation,
    chain: SymbolicChain,
    constant: Any = None,
    minors: Sequence[MinorWords] = (),
) -> SingularityExplanation:
    return replace(
        draft,
        text=explanation_text(draft, constant, minors, chain),
        latex=explanation_latex(draft, constant, minors, chain),
    )


def _status(
    task: Task, factors: Sequence[SingularityFactor], sets: Sequence[Any] | None
) -> FormulaStatus:
    if sets is None:
        return FormulaStatus.TOO_MANY_FAMILIES
    if any(factor.expression is None for factor in factors):
        return FormulaStatus.TOO_LONG
    if not task.square:
        return FormulaStatus.MINORS
    if len(factors) == 1 and len(factors[0].joints) >= 3:
        return FormulaStatus.NOT_FACTORED
    if any(factor.solved_joint is None for factor in factors):
        return FormulaStatus.NOT_SOLVED
    return FormulaStatus.FACTORED


def _degree(task: Task, numbers: list[int], chain: SymbolicChain) -> int:
    """Power of metres of a minor: a row of velocities of translation each, less the strokes."""
    minor = task.minors[0]
    strokes = sum(numbers[c] not in chain.cosine for c in minor.columns)
    return sum(row < 3 for row in minor.rows) - strokes


def _long_factor(M: tuple[tuple[Poly, ...], ...], chain: SymbolicChain) -> SingularityFactor:
    """A determinant that is too long to be written out: computed from its entries."""
    import sympy

    entries = sympy.ImmutableDenseMatrix([[formula(p, chain) for p in row] for row in M])
    joints = {j for row in M for p in row for j in chain.joints_of(p)}
    return SingularityFactor(
        kind=SingularityKind.OTHER,
        text=f"the determinant of a {len(M)} by {len(M)} block",
        latex=rf"\text{{the determinant of a }} {len(M)} \times {len(M)} \text{{ block}}",
        expression=None,
        joints=tuple(sorted(chain.joints[j] for j in joints)),
        power=1,
        unit="",
        meaning="",
        solved_joint=None,
        solution="",
        solution_latex="",
        never_zero=False,
        numbers=numbers_of(chain, [entries]),
        matrix=entries,
    )


def _matrix(minor: Minor, numbers: list[int], chain: SymbolicChain) -> Any:
    import sympy

    columns = [
        chain.column(numbers[c], minor.projection, minor.intermediate) for c in minor.columns
    ]
    return sympy.ImmutableDenseMatrix(
        [[formula(cleaned(column[r], chain), chain) for column in columns] for r in minor.rows]
    )


def _frame_name(node: int, chain: SymbolicChain, frame: str) -> str:
    return frame if node == TOOL else f"R_{node}"


def _conditions(
    sets: Iterable[frozenset[Any]], book: _FactorBook
) -> tuple[SingularityCondition, ...]:
    """Conditions of the sets, the shortest first."""
    out = []
    for s in sorted(sets, key=lambda s: (len(s), sorted(map(book.order, s)))):
        factors = tuple(book(p) for p in sorted(s, key=book.order))
        if not factors:
            continue  # no minor: the rank is never full
        kinds = {factor.kind for factor in factors}
        kind = kinds.pop() if len(kinds) == 1 else SingularityKind.OTHER
        text = " and ".join(f"{factor.text} = 0" for factor in factors)
        out.append(SingularityCondition(factors, kind, text))
    return tuple(out)
