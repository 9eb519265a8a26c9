"""A polynomial factor as a person reads it: formula, joints, meaning, and where it vanishes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import pi
from typing import Any

import numpy as np

from ..._arrays import Array
from ...symbolic_dgm._angles import greek
from ..singular.events import ArmGeometry, random_postures
from ..singularity_kind import SingularityKind
from ._chain import SymbolicChain
from ._collect import formula
from ._numbers import FormulaNumbers
from ._ring import Poly
from .singularity_explanation import SingularityFactor


@dataclass(frozen=True, slots=True)
class _Solution:
    """``A cos(phi) + B sin(phi) + C = 0`` of a revolute joint, ``A r + C = 0`` of a prismatic."""

    joint: int
    A: Poly
    B: Poly
    C: Poly


def factor_of(p: Poly, power: int, chain: SymbolicChain) -> tuple[SingularityFactor, int]:
    """The factor without its meaning, and the sign that was drawn out of it."""
    notation = chain.notation
    expression, sign = _leading_positive(formula(p, chain), chain)
    solution = _solution(p * sign, chain)
    draft = SingularityFactor(
        kind=SingularityKind.OTHER,
        text=notation.text(expression),
        latex=notation.text(expression, latex=True),
        expression=expression,
        joints=tuple(chain.joints[j] for j in chain.joints_of(p)),
        power=power,
        unit=unit_text(length_degree(p, chain)),
        meaning="",
        solved_joint=None,
        solution="",
        solution_latex="",
        never_zero=False,
        numbers=numbers_of(chain, [expression]),
    )
    if solution is None:
        return draft, sign
    coefficients = tuple(formula(c, chain) for c in (solution.A, solution.B, solution.C))
    prismatic = solution.joint not in chain.cosine
    offset = 0.0
    if not prismatic:
        angle = chain.angles[solution.joint]
        offset = float(sum(t.sign * t.value for t in angle.constants)) + float(angle.turns) * pi
    draft = replace(
        draft,
        solved_joint=chain.joints[solution.joint],
        coefficients=coefficients,
        offset=offset,
        prismatic=prismatic,
        numbers=numbers_of(chain, [expression, *coefficients]),
    )
    text, latex, never = _solution_words(solution, draft, chain)
    return replace(draft, solution=text, solution_latex=latex, never_zero=never), sign


def with_meaning(
    factor: SingularityFactor, chain: SymbolicChain, arm: ArmGeometry, square: bool
) -> SingularityFactor:
    """The factor with what happens where it vanishes."""
    numbers = tuple(j for j, place in chain.joints.items() if place in factor.joints)
    kind, sentence = arm.kind_of_joints(numbers), ""
    if square:
        sentence = "axes and points show nothing special, but the columns become dependent"
    if factor.never_zero:
        return replace(factor, kind=kind, meaning="it never vanishes with these constants")
    q = _zeros(factor, chain.model)
    event = None if q is None else arm.event(q)
    if event is not None:
        kind, sentence = event.kind or kind, event.sentence
    return replace(factor, kind=kind, meaning=sentence)


def _joint_names(numbers: tuple[int, ...]) -> str:
    words = [str(k) for k in numbers]
    if len(words) == 1:
        return f"joint {words[0]}"
    return f"joints {', '.join(words[:-1])} and {words[-1]}"


def _zeros(factor: SingularityFactor, model: Any) -> Array | None:
    """Several configurations in which a factor vanishes."""
    if factor.solved_joint is None:
        return None
    q = random_postures(model, 60, seed=11)
    found = factor.zeros(q)
    # both solutions, in turn
    side = np.arange(len(q)) % 2
    side = np.where(np.isnan(found[np.arange(len(q)), side]), 0, side)
    q[:, factor.solved_joint] = found[np.arange(len(q)), side]
    q = q[~np.isnan(q).any(axis=1)]
    return q[:12] if len(q) >= 4 else None


def _leading_positive(expr: Any, chain: SymbolicChain) -> tuple[Any, int]:
    """The expression or its opposite, whichever begins without a minus."""
    if chain.notation.text(expr).startswith("-"):
        return -expr, -1
    return expr, 1


def numbers_of(chain: SymbolicChain, expressions: list[Any]) -> FormulaNumbers:
    """What evaluates these expressions."""
    return FormulaNumbers(
        variables=chain.variables,
        abbreviations=chain.notation.used_abbreviations(expressions),
        constants=tuple((c.symbol, c.value) for c in chain.notation.constants),
    )


def length_degree(p: Poly, chain: SymbolicChain) -> int:
    """Power of metres that a homogeneous polynomial has."""
    lengths = {c.symbol for c in chain.notation.constants if c.unit == "m"}
    lengths |= {chain.notation.stroke(j) for j in chain.joints if j not in chain.cosine}
    indices = frozenset(chain.ring.index[s] for s in lengths if s in chain.ring.index)
    return chain.ring.degree(p, indices)


def unit_text(degree: int) -> str:
    """A power of metres in words: ``"1"``, ``"m"``, ``"m^2"``."""
    return "1" if degree == 0 else "m" if degree == 1 else f"m^{degree}"


def _solution(p: Poly, chain: SymbolicChain) -> _Solution | None:
    """The joint for which a factor is most simply solved."""
    ring = chain.ring
    options: list[tuple[tuple[Any, ...], _Solution]] = []
    for j in chain.joints_of(p):
        own = sorted(chain.moving[j])
        if any(sum(m[k] for k in own) > 1 for m in p):
            continue
        parts = [ring.zero, ring.zero, ring.zero]
        cosine = ring.index[chain.cosine[j][0]] if j in chain.cosine else own[0]
        for monomial, coefficient in p.items():
            place = next((0 if k == cosine else 1 for k in own if monomial[k]), 2)
            rest = tuple(0 if k in own else e for k, e in enumerate(monomial))
            parts[place] += ring.ring({rest: coefficient})
        A, B, C = parts
        others = [len(chain.joints_of(x)) for x in (A, B, C)]
        if j not in chain.cosine and others[0]:
            continue  # a stroke times a function of other joints has no zero where that is zero
        score = (bool(C), others[2], others[0] + others[1], len(p), j)
        options.append((score, _Solution(j, A, B, C)))
    return min(options, key=lambda option: option[0])[1] if options else None


def _solution_words(
    s: _Solution, draft: SingularityFactor, chain: SymbolicChain
) -> tuple[str, str, bool]:
    """Where it vanishes as text and LaTeX, and whether that is nowhere."""
    notation, j = chain.notation, s.joint
    alone = not any(chain.joints_of(x) for x in (s.A, s.B, s.C))
    symbol = chain.variables[chain.joints[j]]
    name, latex = greek(symbol.name), notation.latex[symbol]
    here = draft.zeros(np.zeros(len(chain.variables))) if alone else np.full(2, np.nan)
    if draft.prismatic:
        ratio = formula(-s.C, chain), formula(s.A, chain)
        if not s.C:
            return f"{name} = 0", f"{latex} = 0", False
        over = "" if ratio[1] == 1 else f"/({notation.text(ratio[1])})"
        top, bottom = (notation.text(x, latex=True) for x in ratio)
        value = f", here {here[0]:.6g} m" if alone else ""
        fraction = top if ratio[1] == 1 else rf"\frac{{{top}}}{{{bottom}}}"
        return f"{name} = ({notation.text(ratio[0])}){over}{value}", f"{latex} = {fraction}", False
    if alone and np.isnan(here).all():
        return "it vanishes nowhere", r"\text{it vanishes nowhere}", True
    angle = chain.angles[j]
    exact = (0, 1) if not s.A else (Fraction(-1, 2), Fraction(1, 2)) if not s.B else None
    if not s.C and exact and not angle.constants and not angle.turns:
        words = {0: ("0", "0"), 1: ("π", r"\pi"), Fraction(-1, 2): ("-π/2", r"-\frac{\pi}{2}"),
                 Fraction(1, 2): ("π/2", r"\frac{\pi}{2}")}  # fmt: skip
        (a, a_latex), (b, b_latex) = (words[value] for value in exact)
        return f"{name} = {a} or {b}", rf"{latex} = {a_latex} \text{{ or }} {b_latex}", False
    left, left_latex = angle.text(), angle.text(latex=True)
    value = f", here {name} = {here[0]:.6g} or {here[1]:.6g} rad" if alone else ""
    value_latex = (
        rf", \quad {latex} = {here[0]:.6g} \text{{ or }} {here[1]:.6g} \,\mathrm{{rad}}"
        if alone
        else ""
    )
    A, B, C = s.A, s.B, s.C
    if not C:
        if alone and exact:
            a, b = ("0", "π") if not A else ("-π/2", "π/2")
            a_latex, b_latex = ("0", r"\pi") if not A else (r"-\frac{\pi}{2}", r"\frac{\pi}{2}")
            text = f"{left} = {a} or {b}{value}"
            return text, rf"{left_latex} = {a_latex} \text{{ or }} {b_latex}{value_latex}", False
        top, bottom = formula(-A, chain), formula(B, chain)
        if notation.text(bottom).startswith("-"):
            top, bottom = -top, -bottom
        text = f"{left} = atan2({notation.text(top)}, {notation.text(bottom)}) or that plus π"
        both = f"{notation.text(top, latex=True)}, {notation.text(bottom, latex=True)}"
        tex = (
            rf"{left_latex} = \operatorname{{atan2}}\left({both}\right) \text{{ or that plus }} \pi"
        )
        return text + value, tex + value_latex, False
    a, b, c = (formula(x, chain) for x in (A, B, -C))
    ta, tb, tc = (notation.text(x) for x in (a, b, c))
    la, lb, lc = (notation.text(x, latex=True) for x in (a, b, c))
    text = f"{left} = atan2({tb}, {ta}) ± acos(({tc})/sqrt(({ta})**2 + ({tb})**2))"
    tex = (
        rf"{left_latex} = \operatorname{{atan2}}\left({lb}, {la}\right) \pm \arccos"
        rf"\frac{{{lc}}}{{\sqrt{{\left({la}\right)^{{2}} + \left({lb}\right)^{{2}}}}}}"
    )
    return text + value, tex + value_latex, False
