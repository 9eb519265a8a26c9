"""The singular positions of a robot in closed form: factors of the determinant of its Jacobian."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ..kinematics import SingularityKind
from ..kinematics.lengths import ModelCache
from ..kinematics.singular.events import ArmGeometry
from ..model import RobotModel, check_model
from .chain import TOOL
from .explanation import Document, equations, frame_label, prose
from .factor import SingularityFactor, factor_of, numbers_of, unit_text, with_meaning
from .factoring import factored
from .formula import formula, formulas
from .jacobian import reduced_name
from .minors import ROWS, Block, Minor, Patterns, deciding_minors, smallest_sets
from .notation import checked_names
from .polynomials import Poly, PolynomialChain
from .singularity_explanation import FormulaStatus, SingularityCondition, SingularityExplanation

_MOST_TERMS = 600
"""Determinants with more terms are not written out."""
_MOST_MINORS = 40
_LONGEST = 300
"""Minors beyond this number, and factors with more characters, are not printed."""
_EXPLANATIONS = ModelCache()
_ORDER = {kind: place for place, kind in enumerate(SingularityKind)}


def explain_singularities(
    model: RobotModel,
    frame: str | int | None = None,
    symbols: Mapping[str, str] | None = None,
) -> SingularityExplanation:
    """Singular positions of a robot as formulas: factors of the determinant of its Jacobian.

    Only the third of the three matrices of the book can be singular. Its projection and
    intermediate frames are those with the most zeros; rows and columns are rearranged to a block
    triangular form, so that the determinant is the product of small ones (for a spherical wrist
    those of arm and wrist), and these are factored as polynomials in sines and cosines.

    The matrix that decides: for six joints the Jacobian. For up to three joints the rows of the
    position of the frame, if it has as many freedoms as they are (as by default in
    `classify_singularity`, `nearest_singularity` and `singularity_flags`); else the rows that are
    not zero, if they are as many as the joints (four of a SCARA arm); else all square minors. For
    more joints than rows the matrix loses rank where every minor has a factor that vanishes, and
    ``conditions`` are the smallest sets of such factors.

    Book section 1.3.1.3.

    Constants are kept as symbols while factoring. Entries below 1e-11 in random configurations
    count as zero, directions that are lost to 1e-9 as lost, and sums of constants that cancel to
    1e-12 of their size are dropped. Results are kept with the model.

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
    model.twin.frame(frame)  # refused here, whatever is kept
    names = checked_names(symbols)
    key = frame, *names.items()
    return _EXPLANATIONS(model, key, lambda: _explanation(model, frame, names))


def _explanation(
    model: RobotModel, frame: str | int | None, symbols: Mapping[str, str]
) -> SingularityExplanation:
    chain = PolynomialChain(model, model.twin.frame(frame), symbols)
    numbers, none = numbers_of(chain, []), FormulaStatus.NO_JOINTS
    draft = SingularityExplanation(model.name, frame_label(frame), none, "no rows", numbers)
    if not chain.path_joints:
        return _printed(draft, chain)
    patterns = Patterns(model, frame, chain)
    words, minors = deciding_minors(patterns)
    draft = replace(draft, task=words)
    if minors is None:
        return _printed(replace(draft, status=FormulaStatus.TOO_MANY_JOINTS), chain)
    if not minors:
        constant = 0.0 if patterns.count == 6 else float("nan")
        never = FormulaStatus.NEVER_FULL_RANK
        return _printed(replace(draft, status=never, constant=constant), chain)
    arm = ArmGeometry(model, frame, chain.path_joints, patterns.position_only)
    square = len(minors) == 1 and len(minors[0].columns) == patterns.count
    products = [_product(minor, patterns, chain) for minor in minors]
    products = [product for product in products if product.constant]
    return _explained(draft, products, _Factors(chain, arm, square))


class Product(NamedTuple):
    """A minor as a product of powers; a factor too long to be written is a matrix."""

    minor: Minor
    constant: Poly
    factors: dict[Any, int]  # of polynomials, or of matrices (rows of polynomials)


def _product(minor: Minor, patterns: Patterns, chain: PolynomialChain) -> Product:
    """Determinant of a square part, block by block."""
    ring = chain.ring
    i, j = minor.projection, minor.intermediate
    columns = {c: chain.column(chain.path_joints[c], i, j) for c in minor.columns}
    filled = patterns.filled[i, j]
    constant = ring.one * _order_sign(minor.blocks)
    powers: Counter[Any] = Counter()
    for block in minor.blocks:
        M = tuple(
            tuple(
                chain.cleaned(columns[c][r]) if filled[r, c] else ring.zero for c in block.columns
            )
            for r in block.rows
        )
        D = ring.determinant(M, _MOST_TERMS)
        if D is None:
            powers[M] += 1
            continue
        part, factors = factored(D, chain)
        constant = ring.times(constant, part)
        powers.update(factors)
    return Product(minor, constant, dict(powers))


def _order_sign(blocks: Sequence[Block]) -> int:
    """Sign of bringing the rows and the columns of all blocks together."""
    sign = 1
    for order in ([r for b in blocks for r in b.rows], [c for b in blocks for c in b.columns]):
        for k, value in enumerate(order):
            sign *= (-1) ** sum(later < value for later in order[k + 1 :])
    return sign


class _Factors:
    """Factors of the minors in formulas and words, each made once."""

    def __init__(self, chain: PolynomialChain, arm: ArmGeometry, square: bool) -> None:
        self.chain, self.square = chain, square
        # without its meaning, and the sign that was taken out of it
        self.draft = cache(partial(factor_of, chain=chain))
        self.made = cache(lambda p: with_meaning(self.draft(p)[0], chain, arm, square))

    def order(self, p: Any) -> tuple[Any, ...]:
        """Place among the factors."""
        factor = self.made(p)
        return _ORDER[factor.kind], factor.joints, factor.text

    def impossible(self, factors: frozenset[Any]) -> bool:
        """Whether two factors of one joint alone vanish at different values of it."""
        alone: dict[int, set[float]] = {}
        for p in factors:
            if isinstance(p, tuple) or len(self.chain.joints_of(p)) != 1:
                continue
            factor, _ = self.draft(p)
            if factor.never_zero:
                return True
            if factor.solved_joint is not None:
                zeros = factor.zeros(np.zeros(len(self.chain.variables)))
                values = {round(float(z) % (2 * np.pi), 6) for z in zeros if not np.isnan(z)}
                joint = factor.joints[0]
                alone[joint] = alone.get(joint, values) & values
        return not all(alone.values())


def _explained(
    draft: SingularityExplanation,
    products: Sequence[Product],
    book: _Factors,
) -> SingularityExplanation:
    chain, square = book.chain, book.square
    constant, powers = None, {}
    expressions: list[Any] = []
    if square:
        ((minor, factor, powers),) = products
        keys = list(powers)
        sets = [frozenset({p}) for p in keys if not book.made(p).never_zero]
        signed = factor * prod(book.draft(p)[1] ** k for p, k in powers.items())
        constant = formula(signed, chain)
        expressions.append(_matrix(minor, chain))
        i, j = (draft.frame if node == TOOL else f"R_{node}" for node in minor[2:4])
        draft = replace(draft, projection=i, intermediate=j, matrix=expressions[0], rows=minor.rows)
        draft = replace(draft, constant=chain.ring.value(signed, chain.known))
    else:
        sets = smallest_sets([list(p.factors) for p in products], chain, book.impossible)
        keys = list(dict.fromkeys(p for s in sets or () for p in s))
    ordered = sorted(keys, key=book.order)
    made = {p: replace(book.made(p), power=powers.get(p, 1)) for p in ordered}
    factors = tuple(made.values())
    # a row of velocities of translation each, less the strokes
    first = products[0].minor
    degree = sum(row < 3 for row in first.rows)
    degree -= sum(chain.is_prismatic(chain.path_joints[c]) for c in first.columns)
    expressions += [f.expression for f in factors if f.expression is not None]
    draft = replace(
        draft,
        status=_status(square, factors, sets),
        factors=factors,
        conditions=_conditions(sets or [], book, made),
        unit=unit_text(degree),
        numbers=numbers_of(chain, expressions),
    )
    minors = [] if square else [_minor_text(p, book, chain) for p in products[:_MOST_MINORS]]
    return _printed(draft, chain, constant, minors)


def _status(
    square: bool, factors: Sequence[SingularityFactor], sets: Sequence[Any] | None
) -> FormulaStatus:
    if sets is None:
        return FormulaStatus.TOO_MANY_FAMILIES
    if any(factor.expression is None for factor in factors):
        return FormulaStatus.TOO_LONG
    if not square:
        return FormulaStatus.MINORS
    if len(factors) == 1 and len(factors[0].joints) >= 3:
        return FormulaStatus.NOT_FACTORED
    if any(factor.solved_joint is None for factor in factors):
        return FormulaStatus.NOT_SOLVED
    return FormulaStatus.FACTORED


def _matrix(minor: Minor, chain: PolynomialChain) -> Any:
    import sympy

    i, j = minor.projection, minor.intermediate
    columns = [chain.column(chain.path_joints[c], i, j) for c in minor.columns]
    rows = [formulas([column[r] for column in columns], chain) for r in minor.rows]
    return sympy.ImmutableDenseMatrix(rows)


def _conditions(
    sets: Iterable[frozenset[Any]], book: _Factors, made: Mapping[Any, SingularityFactor]
) -> tuple[SingularityCondition, ...]:
    """Conditions of the sets, the shortest first."""
    out = []
    for s in sorted(sets, key=lambda s: (len(s), sorted(map(book.order, s)))):
        factors = tuple(made[p] for p in sorted(s, key=book.order))
        if not factors:
            continue  # no minor: the rank is never full
        kinds = {factor.kind for factor in factors}
        kind = kinds.pop() if len(kinds) == 1 else SingularityKind.OTHER
        text = " and ".join(f"{factor.text} = 0" for factor in factors)
        out.append(SingularityCondition(factors, kind, text))
    return tuple(out)


def _minor_text(product: Product, book: _Factors, chain: PolynomialChain) -> str:
    """A minor as ``without joint 3: S4 * (C2*D3 + ...)``."""
    minor = product.minor
    left_out = [str(k) for c, k in enumerate(chain.path_joints) if c not in minor.columns]
    name = f"rows {', '.join(ROWS[r] for r in minor.rows)}"
    if left_out:
        name = f"without joint{'s' if len(left_out) > 1 else ''} {' and '.join(left_out)}"
    texts = [(book.draft(p)[0].text, power) for p, power in product.factors.items()]
    short = [(t if len(t) <= _LONGEST else "a long polynomial", k) for t, k in texts]
    return f"{name}: {_joined([_power(t, k) for t, k in short] or ['1'])}"


def _power(text: str, exponent: int) -> str:
    if exponent == 1:
        return text
    return f"{text}**{exponent}" if text.isidentifier() else f"({text})**{exponent}"


def _joined(words: Sequence[str]) -> str:
    if len(words) == 1:
        return words[0]
    whole = " * ".join(f"({w})" if " " in w else w for w in words)
    return f"-{whole[5:]}" if whole.startswith("-1 * ") else whole


def _printed(
    e: SingularityExplanation,
    chain: PolynomialChain,
    constant: Any = None,
    minors: Sequence[str] = (),
) -> SingularityExplanation:
    notation = chain.notation
    out = Document(f"Singular positions of {e.robot}: motion of {e.frame}", notation)
    out.add(e.status.value)
    shown = [x for x in (*(f.expression for f in e.factors), e.matrix, constant) if x is not None]
    out.add_symbols(shown, e.numbers.abbreviations)
    if e.matrix is not None:
        name = reduced_name(e.projection, e.intermediate, chain.path[-1])
        heading = (
            f"Third matrix {name} (projection {e.projection}, intermediate frame "
            f"{e.intermediate}), {e.task}"
        )
        rows, columns = [ROWS[r] for r in e.rows], [f"joint {j}" for j in chain.path_joints]
        out.add_matrix(heading, name, e.matrix, rows, columns)
        words = [notation.text(constant)] if constant != 1 or not e.factors else []
        whole = _joined(words + [_power(f.text, f.power) for f in e.factors])
        out.add(f"Its determinant is {whole}", equations([rf"\det = {notation.tex(whole)}"]))
    if minors:
        heading = f"Minors of the third matrix ({e.task}), up to constants"
        out.add_lines(heading, minors, equations(map(notation.tex, minors)))
    if e.factors:
        out.add("Factors")
    for f in e.factors:
        lines = [f"{f.kind.value}: {f.text} = 0", *(f"  {x}" for x in (f.meaning, f.solution) if x)]
        latex = equations(x for x in (f"{f.latex} = 0", f.solution_latex) if x)
        heading = prose(f"{f.kind.value}: {f.meaning}".rstrip(": "))
        out.add("\n".join(lines), f"{heading}\n\n{latex}")
    if minors:
        tex = [r" \text{ and } ".join(f"{f.latex} = 0" for f in c.factors) for c in e.conditions]
        texts = [f"{c.kind.value}: {c.text}" for c in e.conditions]
        latex = equations(tex or [r"\text{none}"])
        out.add_lines("Singular positions", texts or ["none"], latex)
    elif e.matrix is not None and not e.factors:
        out.add("It is a constant: there are no singular positions.")
    return out.of(e)
