"""A factor of a determinant: its formula, joints and meaning, and the zeros of the factor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..errors import InvalidValueError
from ..kinematics import SingularityKind
from ..kinematics.singular.events import ArmGeometry, random_postures
from ..model import RobotModel
from .angles import greek
from .explanation import FormulaNumbers
from .formula import formula
from .polynomials import Poly, PolynomialChain


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingularityFactor:
    """A factor of the determinant: the robot is singular where it is zero.

    Parameters
    ----------
    kind : SingularityKind
        The part of the arm.
    text, latex : str
        The formula, in the notation of `explain_dgm`; the text is Python as well.
    expression : sympy.Expr or None
        The formula; None where it is too long to be written out.
    joints : tuple of int
        Columns of q, from 0, that it depends on.
    power : int
        Exponent in the determinant (1 for minors).
    unit : str
        ``"1"``, ``"m"``, ``"m^2"``, ...
    meaning : str
        The geometric condition in the arm, in a sentence.
    solved_joint : int or None
        Column of the joint whose value `zeros` gives; None where no joint can be solved for.
    solution, solution_latex : str
        The zeros, as formulas for that joint.
    never_zero : bool
        Whether the constants of this robot keep it from vanishing.
    """

    kind: SingularityKind
    text: str
    latex: str
    expression: Any
    joints: tuple[int, ...]
    unit: str
    numbers: FormulaNumbers
    power: int = 1
    meaning: str = ""
    solved_joint: int | None = None
    solution: str = ""
    solution_latex: str = ""
    never_zero: bool = False
    matrix: Any = None
    coefficients: tuple[Any, Any, Any] | None = None
    offset: float = 0.0
    prismatic: bool = False

    def values(self, q: ArrayLike) -> Array:
        """Values (...) of the factor at q (..., n), in ``unit``."""
        q = as_vector(q, len(self.numbers.variables), "q")
        if self.expression is None:
            return np.asarray(np.linalg.det(self.numbers.matrix(self.matrix, q)))
        return self.numbers.values(self.expression, q)

    def zeros(self, q: ArrayLike) -> Array:
        """Values (..., 2) of the solved joint that make the factor zero, the others as in q.

        Angles in (-pi, pi], or a stroke and NaN; NaN where there is none. It is an error if no
        joint could be solved for (``solved_joint`` is None).
        """
        q = as_vector(q, len(self.numbers.variables), "q")
        if self.coefficients is None:
            raise InvalidValueError(
                f"{self.text:.60}: no joint of this factor can be solved for in closed form; look "
                "for its zeros in numbers, in the data of singularity_map for instance."
            )
        A, B, C = (self.numbers.values(c, q) for c in self.coefficients)
        out = np.full((*q.shape[:-1], 2), np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.prismatic:
                out[..., 0] = np.where(A != 0.0, -C / A, np.nan)
                return out
            ratio = -C / np.hypot(A, B)
            # rounding must not remove a double root
            ratio = np.where(np.abs(np.abs(ratio) - 1.0) < 1e-14, np.sign(ratio), ratio)
            half = np.arccos(np.where(np.abs(ratio) <= 1.0, ratio, np.nan))
        middle = np.arctan2(B, A)
        both = np.stack([middle - half, middle + half], axis=-1) - self.offset
        return np.sort(np.pi - np.mod(np.pi - both, 2.0 * np.pi), axis=-1)

    def __repr__(self) -> str:
        return f"<SingularityFactor {self.kind.value}: {self.text:.60}>"


class _Equation(NamedTuple):
    """``A cos(phi) + B sin(phi) + C = 0`` of a revolute joint, ``A r + C = 0`` of a prismatic."""

    joint: int
    A: Poly
    B: Poly
    C: Poly


def factor_of(p: Any, chain: PolynomialChain) -> tuple[SingularityFactor, int]:
    """The factor without its meaning, and the sign that was taken out of it.

    ``p`` is a polynomial, or rows of them whose determinant is too long to be written out.
    """
    if isinstance(p, tuple):
        return _long_factor(p, chain), 1
    notation = chain.notation
    expression = formula(p, chain)
    sign = -1 if notation.text(expression).startswith("-") else 1
    expression = sign * expression
    text = notation.text(expression)
    draft = SingularityFactor(
        kind=SingularityKind.OTHER,
        text=text,
        latex=notation.tex(text),
        expression=expression,
        joints=tuple(chain.joints[j] for j in chain.joints_of(p)),
        unit=unit_text(_length_degree(p, chain)),
        numbers=numbers_of(chain, [expression]),
    )
    equation = _equation(p * sign, chain)
    if equation is None:
        return draft, sign
    j, *parts = equation
    coefficients = tuple(formula(c, chain) for c in parts)
    draft = replace(
        draft,
        solved_joint=chain.joints[j],
        coefficients=coefficients,
        offset=0.0 if chain.is_prismatic(j) else chain.angles[j].offset,
        prismatic=chain.is_prismatic(j),
        numbers=numbers_of(chain, [expression, *coefficients]),
    )
    alone = not any(map(chain.joints_of, parts))
    here = draft.zeros(np.zeros(len(chain.variables))) if alone else None
    if here is not None and np.isnan(here).all():
        text, never = "it vanishes nowhere", True
    else:
        text, never = _solution_text(equation, here, chain), False
    latex = notation.tex(text)
    return replace(draft, solution=text, solution_latex=latex, never_zero=never), sign


def _long_factor(M: tuple[tuple[Poly, ...], ...], chain: PolynomialChain) -> SingularityFactor:
    """A determinant that is computed from its entries."""
    import sympy

    entries = sympy.ImmutableDenseMatrix([[formula(p, chain) for p in row] for row in M])
    joints = {j for row in M for p in row for j in chain.joints_of(p)}
    text = f"the determinant of a {len(M)} by {len(M)} block"
    columns = tuple(sorted(chain.joints[j] for j in joints))
    numbers, latex = numbers_of(chain, [entries]), rf"\text{{{text}}}"
    kind = SingularityKind.OTHER
    return SingularityFactor(kind, text, latex, None, columns, "", numbers, matrix=entries)


def with_meaning(
    factor: SingularityFactor, chain: PolynomialChain, arm: ArmGeometry, square: bool
) -> SingularityFactor:
    """The factor with the event in the arm where it vanishes."""
    joints = tuple(j for j, place in chain.joints.items() if place in factor.joints)
    kind, sentence = arm.kind_of_joints(joints), ""
    if square:
        sentence = "axes and points show nothing special, but the columns become dependent"
    if factor.never_zero:
        return replace(factor, kind=kind, meaning="it never vanishes with these constants")
    q = _zero_configurations(factor, chain.model)
    event = None if q is None else arm.event(q)
    if event is not None:
        kind, sentence = event.kind or kind, event.sentence
    return replace(factor, kind=kind, meaning=sentence)


def _zero_configurations(factor: SingularityFactor, model: RobotModel) -> Array | None:
    """Several configurations in which a factor vanishes."""
    if factor.solved_joint is None:
        return None
    q = random_postures(model, 60, seed=11)
    found, rows = factor.zeros(q), np.arange(len(q))
    side = np.where(np.isnan(found[rows, rows % 2]), 0, rows % 2)  # both solutions, in turn
    q[:, factor.solved_joint] = found[rows, side]
    q = q[~np.isnan(q).any(axis=1)]
    return q[:12] if len(q) >= 4 else None


def numbers_of(chain: PolynomialChain, expressions: list[Any]) -> FormulaNumbers:
    """The symbols that evaluate these expressions."""
    return FormulaNumbers(
        variables=chain.variables,
        abbreviations=chain.notation.used_abbreviations(expressions),
        constants=tuple((c.symbol, c.value) for c in chain.notation.constants),
    )


def _length_degree(p: Poly, chain: PolynomialChain) -> int:
    """Power of metres that a homogeneous polynomial has."""
    lengths = {c.symbol for c in chain.notation.constants if c.unit == "m"}
    lengths |= {chain.notation.stroke(j) for j in chain.joints if chain.is_prismatic(j)}
    indices = [chain.ring.index[s] for s in lengths if s in chain.ring.index]
    return max((sum(monomial[k] for k in indices) for monomial in p), default=0)


def unit_text(degree: int) -> str:
    """A power of metres: ``"1"``, ``"m"``, ``"m^2"``."""
    return "1" if degree == 0 else "m" if degree == 1 else f"m^{degree}"


def _equation(p: Poly, chain: PolynomialChain) -> _Equation | None:
    """The equation of the joint for which a factor is most simply solved."""
    ring = chain.ring
    options: list[tuple[tuple[Any, ...], _Equation]] = []
    for j in chain.joints_of(p):
        parts = ring.collected(p, chain.moving[j])
        if any(sum(key) > 1 for key in parts):
            continue
        keys = [next(iter(ring.of(symbol))) for symbol in chain.symbols_of(j)]
        A, B = ([parts.get(key, ring.zero) for key in keys] + [ring.zero])[:2]
        C = parts.get((0,) * len(ring.symbols), ring.zero)
        a, b, c = (len(chain.joints_of(x)) for x in (A, B, C))
        if chain.is_prismatic(j) and a:
            continue  # a stroke times a function of other joints has no zero where that is zero
        options.append(((bool(C), c, a + b, len(p), j), _Equation(j, A, B, C)))
    return min(options, key=lambda option: option[0])[1] if options else None


def _solution_text(s: _Equation, here: Array | None, chain: PolynomialChain) -> str:
    """The zeros as formulas; ``here`` are their values if they are constants."""
    notation = chain.notation
    name = greek(chain.variables[chain.joints[s.joint]].name)
    A, B, C = (formula(x, chain) for x in (s.A, s.B, -s.C))
    if chain.is_prismatic(s.joint):
        if not s.C:
            return f"{name} = 0"
        over = "" if A == 1 else f"/({notation.text(A)})"
        value = "" if here is None else f", here {here[0]:.6g} m"
        return f"{name} = ({notation.text(C)}){over}{value}"
    angle = chain.angles[s.joint]
    left = angle.text()
    value = "" if here is None else f", here {name} = {here[0]:.6g} or {here[1]:.6g} rad"
    if s.C:
        a, b, c = map(notation.text, (A, B, C))
        return f"{left} = atan2({b}, {a}) ± acos(({c})/sqrt(({a})**2 + ({b})**2)){value}"
    if not s.A or not s.B:
        value = value if len(angle.terms) > 1 or angle.turns else ""
        return f"{left} = {'-π/2 or π/2' if s.A else '0 or π'}{value}"
    top, sign = formula(-s.A, chain), -1 if notation.text(B).startswith("-") else 1
    top, bottom = notation.text(sign * top), notation.text(sign * B)
    return f"{left} = atan2({top}, {bottom}) or that plus π{value}"
