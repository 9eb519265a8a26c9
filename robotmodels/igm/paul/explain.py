"""The inverse geometric model explained: the plan of Paul's method in words and formulas."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from ...geometry import constant_names
from ...latex_text import Explanation, escaped, meaning_latex, powers, table_latex
from ...model import RobotModel, check_model
from ...table_text import SMALLEST, angle_text
from ..arm_angle import prepare_arm_angle
from ..loop import JointChain, joint_chain
from ..structure import Family, plan_loop
from .plan import PaulPlan, derive_plan
from .steps import ExplainedStep, PlanText
from .types import EquationType
from .typeset import display, plain
from .unknowns import JointSum
from .writer import number

_ARCS = (EquationType.TYPE_2_ZERO, EquationType.TYPE_3, EquationType.TYPE_3_DIRECT)
"""Types whose solution is an arc tangent of the pose."""


@dataclass(frozen=True, slots=True, repr=False)
class InverseModelExplanation(Explanation):
    """How the inverse geometric model of a robot is derived, made by `explain_igm`.

    Parameters
    ----------
    robot : str
        Its name.
    steps : tuple of ExplainedStep
        In the order in which the joints are found.
    complete : bool
        Whether Paul's method gives all joints.
    remaining : tuple of str
        Variables that it does not give.
    takes_over : str
        The method that solves the arm where Paul's stops; empty if it does not stop.
    plan : PaulPlan
        The plan that is printed, the same that the kernel runs.
    text, latex : str
        The derivation; the LaTeX has the same content, as paragraphs and amsmath environments.

    Examples
    --------
    >>> from robotmodels.igm.paul import explain_igm
    >>> from robotmodels.robots import load
    >>> explain_igm(load("crx10ia")).complete
    False
    """

    robot: str
    steps: tuple[ExplainedStep, ...]
    complete: bool
    remaining: tuple[str, ...]
    takes_over: str
    plan: PaulPlan
    text: str
    latex: str

    def __repr__(self) -> str:
        found = "all joints" if self.complete else f"all but {', '.join(self.remaining)}"
        return f"<InverseModelExplanation of {self.robot}: {found} by Paul's method>"


def explain_igm(model: RobotModel) -> InverseModelExplanation:
    """Derive the inverse geometric model by Paul's method and explain it step by step.

    Notation: ``U0`` is the desired pose, its elements ``sx nx ax Px`` and so on as in eq. [1.13];
    ``sTp`` the pose of R_p in R_s. ``C1``, ``S1`` are cosine and sine of ``θ1``, ``C23`` of
    ``θ2 + θ3`` (an ``m`` before a number subtracts). ``Dj`` and ``RLj`` are d and r of row j,
    unless ``DHTable.symbols`` names them.

    Parameters
    ----------
    model : RobotModel
        The robot, any number of joints.

    Returns
    -------
    InverseModelExplanation
        Prints as the derivation; has the steps and ``.latex``.

    Raises
    ------
    InvalidValueError
        ``model`` is not a RobotModel, or no joint moves its tool.

    References
    ----------
    Book section 1.2.3.2, example 1.3 (its formula for S2 has a misprint that is put right
    here); the exercise, eq. (4.9) and (4.13), whose ``arctan(y/x)`` loses the quadrant: atan2 is
    used, and both solutions are kept.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> rx90 = explain_igm(load("rx90"))
    >>> print("; ".join(rx90.steps[2].formulas))
    θ4 = atan2(S1*ax - C1*ay, -C23*(C1*ax + S1*ay) - S23*az); θ4' = θ4 + π
    """
    check_model(model)
    chain, table = joint_chain(model), model.table
    own = constant_names(table.symbols)
    names = {
        usual: (own[usual], float(getattr(table, column)[j]))
        for column, letter in (("d", "D"), ("r", "RL"))
        for j in range(table.f)
        if (usual := f"{letter}{j + 1}") in own
    }
    plan = derive_plan(chain, [int(table.joint_rows[c]) + 1 for c in chain.columns], names)
    words = PlanText(plan)
    steps = tuple(words.step(number, step) for number, step in enumerate(plan.steps))
    takes_over = "" if plan.complete else _successor(chain)
    # blocks of text and LaTeX; a sentence is markup of `typeset`
    title = f"Inverse geometric model of {model.name} by Paul's method"
    blocks = [(title, rf"\textbf{{{escaped(title)}}}"), (str(table), table_latex(str(table)))]
    before = [_pose_line(model, plan), *_notation(words, steps)]
    blocks += [(plain(line), words.tex.prose(line)) for line in before]
    if constants := plan.arm.constants:
        lines = [f"  {n} = {number(v)}  ({meaning})" for n, _, v, meaning in constants]
        rows = [rf"{symbol} = {powers(number(v))} \quad ({meaning_latex(meaning)})"
                for _, symbol, v, meaning in constants]  # fmt: skip
        blocks.append(("\n".join(["Constants", *lines]), "Constants\n" + display(rows)))
    blocks += [(step.text, step.latex) for step in steps]
    end = _end(words, takes_over)
    blocks.append(("\n".join(map(plain, end)), "\n\n".join(map(words.tex.prose, end))))
    text, latex = map("\n\n".join, zip(*blocks, strict=True))
    remaining = tuple(map(words.variable, plan.remaining))
    return InverseModelExplanation(
        model.name, steps, plan.complete, remaining, takes_over, plan, text, latex
    )


def _successor(chain: JointChain) -> str:
    """The method that solves an arm where Paul's method stops."""
    if chain.k > 7:
        return "locked joints (`lock` of `igm`), or the numeric solver `igm_numeric`"
    if chain.k == 7:
        if prepare_arm_angle(chain) is not None:
            return "the arm angle (`arm_angle` of `igm`), as shoulder and wrist are spherical"
        return (
            "a locked joint (`lock` of `igm`), as the arm has no arm angle: that needs seven "
            "revolute joints with a spherical shoulder and a spherical wrist"
        )
    if chain.k < 6:
        return "`igm`, which adds virtual joints to make six, or the numeric solver `igm_numeric`"
    loop = plan_loop(chain)
    if loop is None:
        return "Raghavan and Roth's elimination, up to 16 postures"
    if loop.family is Family.CONCURRENT:
        return "Pieper's method: three axes meet, and a quartic gives one of the other joints"
    return "the closed form of three parallel axes"


def _end(words: PlanText, takes_over: str) -> list[str]:
    """Number of postures or the remaining joints, the offsets, and the quadrants."""
    plan = words.plan
    if plan.complete:
        most = plan.most_postures
        branches = [str(s.type.branches) for s in plan.steps if s.type.branches > 1]
        each = f" (${' x '.join(branches)}$)" if len(branches) > 1 else ""
        lines = [
            f"At most {most} posture{'s' * (most != 1)}{each}; "
            "each is checked on the whole pose before it is returned."
        ]
    else:
        rest = ", ".join(f"${words.variable(j)}$" for j in plan.remaining)
        why = (
            "there are more joints than components of a pose"
            if plan.form.k > 6
            else "no element of any matrix equation, however it is multiplied, has one or two "
            "unknowns in a form of the catalogue"
        )
        lines = [f"Paul's method stops here: {rest} remain, because {why}."]
        lines.append(f"The arm is solved by {takes_over}.")
    offsets = []
    for j, row in enumerate(plan.form.rows):
        if abs(row.offset) >= SMALLEST:  # the table shows no others either
            size = abs(row.offset)
            value = number(size) if row.sigma else angle_text(size, SMALLEST, number)
            left = f"q{plan.chain.columns[j] + 1} = {words.variable(j)}"
            offsets.append(f"${left} {'-' if row.offset > 0 else '+'} {value}$")
    if plan.steps and offsets:
        lines.append(f"Joint variables with an offset: {', '.join(offsets)}.")
    if any(s.type in _ARCS for s in plan.steps):
        lines.append(
            "atan2 gives the quadrant, which arctan(y/x) does not; two solutions are both kept."
        )
    return lines


def _notation(words: PlanText, steps: tuple[ExplainedStep, ...]) -> list[str]:
    """Meaning of C, S and their numbers, with the sums of angles that occur."""
    used = {n for step in steps for n in re.findall(r"\b[CS]([\dm_]+)\b", step.text)}
    joints, sums = words.joints, ""
    for group, members in enumerate(joints.members):
        for a in range(len(members)):
            for b in range(a + 2, len(members) + 1):
                u = joints.unknown(JointSum(group, a, b))
                name = joints.unknowns[u].name
                if name in used:
                    sums += f", $C{name}$ and $S{name}$ of ${words.unknown(u)}$"
    return [f"$Cj$ and $Sj$ are cosine and sine of $θj${sums}."] if used else []


def _pose_line(model: RobotModel, plan: PaulPlan) -> str:
    """Meaning of U0, Z and E."""
    form, whole = plan.form, plan.form.k >= 6
    moved, based, right = (
        not np.allclose(T, np.eye(4), atol=1e-13) for T in (form.before, model.base, form.after)
    )
    constant = "the constant transformation"
    meanings = ""
    if left := moved or based:
        table = f" and {constant} before the first joint" * (whole or moved)
        meanings += f", $Z$ the base{table}"
    if right:
        meanings += f", $E$ {constant} after the last joint, with the tool"
    elif plan.arm.E is not None:
        meanings += ", $E$ the tool"
    U0 = "U0 = " + "Z^-1 " * left + "T" + " E^-1" * right
    rows = ", ".join("$" + " ".join(c + a for c in "snaP") + "$" for a in "xyz")
    pose = f"${U0}$: the desired pose{' [1.11]' * whole}, with the elements {rows} [1.13]"
    return f"{pose}{meanings}."
