"""The whole explanation: table, meaning of the symbols, steps, and what is left to say."""

from __future__ import annotations

import re

import numpy as np

from ...latex_text import escaped, meaning_latex, powers, table_latex
from ...model import RobotModel
from ...table_text import SMALLEST
from .steps import ExplainedStep, PlanText
from .types import EquationType
from .typeset import Line, Prose, angle, display, matrices, number
from .unknowns import JointSum

_ARCS = (EquationType.TYPE_2_ZERO, EquationType.TYPE_3, EquationType.TYPE_3_DIRECT)
"""Types whose solution is an arc tangent of the pose."""


def render(
    model: RobotModel, words: PlanText, steps: tuple[ExplainedStep, ...], takes_over: str
) -> tuple[str, str]:
    """The explanation of an arm as text and LaTeX."""
    constants = words.plan.arm.constants
    title = f"Inverse geometric model of {model.name} by Paul's method"
    table = str(model.table)
    text, latex = [title, "", table], [rf"\textbf{{{escaped(title)}}}", table_latex(table)]
    before = [_pose_line(model, words)]
    if notation := _notation(words, "\n".join(step.text for step in steps)):
        before.append(notation)
    for line in before:
        text += ["", line.text]
        latex.append(line.latex)
    if constants:
        text += ["", "Constants"]
        text += [f"  {n} = {v:.12g}  ({meaning})" for n, _, v, meaning in constants]
        rows = [rf"{symbol} = {powers(number(v))} \quad ({meaning_latex(meaning)})"
                for _, symbol, v, meaning in constants]  # fmt: skip
        latex.append("Constants\n" + display(rows))
    for step in steps:
        text += ["", step.text]
        latex.append(step.latex)
    text.append("")
    for line in _end(words, takes_over):
        text.append(line.text)
        latex.append(line.latex)
    return "\n".join(text), "\n\n".join(latex)


def _end(words: PlanText, takes_over: str) -> list[Prose]:
    """How many postures or what remains, the offsets, and the quadrants."""
    plan, sentence = words.plan, words.sentence
    lines = []
    if plan.complete:
        branches = [str(s.type.branches) for s in plan.steps if s.type.branches > 1]
        most = plan.most_postures
        each = Line(" x ".join(branches), r" \times ".join(branches))
        how = sentence(" ({})", each) if len(branches) > 1 else Prose("", "")
        lines.append(sentence(
            f"At most {most} posture{'s' * (most != 1)}{{}}; "
            "each is checked on the whole pose before it is returned.", how,
        ))  # fmt: skip
    else:
        rest = words.joined([words.variable(j) for j in plan.remaining], ", ")
        why = (
            "there are more joints than components of a pose"
            if plan.form.k > 6
            else "no element of any matrix equation, however it is multiplied, has one or two "
            "unknowns in a form of the catalogue"
        )
        lines.append(sentence("Paul's method stops here: {} remain, because " + why + ".", rest))
        lines.append(sentence(f"What takes over: {takes_over}."))
    if plan.steps and (offsets := _offsets(words)):
        lines.append(sentence("Joint variables with an offset: {}.", words.joined(offsets, ", ")))
    if any(s.type in _ARCS for s in plan.steps):
        lines.append(
            sentence(
                "atan2 keeps the quadrant that arctan(y/x) loses; two solutions are both kept."
            )
        )
    return lines


def _offsets(words: PlanText) -> list[Line]:
    """Joint variables as the model counts them, where the rows count them from elsewhere."""
    lines = []
    for j, row in enumerate(words.plan.form.rows):
        if abs(row.offset) < SMALLEST:  # the table shows none either
            continue
        sign, x = "-" if row.offset > 0 else "+", words.variable(j)
        size = abs(row.offset)
        value = number(size) if row.sigma else angle(size)
        text = f"q{words.plan.chain.columns[j] + 1} = {x} {sign} {value}"
        lines.append(Line(text, words.formula(re.sub(r"(\d)π", r"\1*π", text)).latex))
    return lines


def _notation(words: PlanText, text: str) -> Prose | None:
    """What C, S and their numbers stand for, with the sums of angles that occur."""
    used = set(re.findall(r"\b[CS]([\dm_]+)\b", text))
    if not used:
        return None
    sums = []
    joints = words.joints
    for group, members in enumerate(joints.members):
        for a in range(len(members)):
            for b in range(a + 2, len(members) + 1):
                u = joints.unknown(JointSum(group, a, b))
                item = joints.unknowns[u]
                if item.name in used:
                    names = [f"C{item.name}", f"S{item.name}"]
                    sums.append(words.sentence("{} and {} of {}", *names, words.unknown(u)))
    tail = words.sentence(", {}", words.joined(sums, ", ")) if sums else Prose("", "")
    return words.sentence("{} and {} are cosine and sine of {}{}.", "Cj", "Sj", "θj", tail)


def _pose_line(model: RobotModel, words: PlanText) -> Prose:
    """Meaning of U0, Z and E."""
    form, whole = words.plan.form, words.plan.form.k >= 6
    moved = not np.allclose(form.before, np.eye(4), atol=1e-13)
    left = moved or not np.allclose(model.base, np.eye(4), atol=1e-13)
    right = whole and not np.allclose(form.after, np.eye(4), atol=1e-13)
    meanings = []
    if whole and left:
        meanings.append(("Z", "the base and the constant transformation before the first joint"))
    elif left:
        table = " and the constant transformation before the first joint" * moved
        meanings.append(("Z", f"the base{table}"))
    if right:
        meanings.append(("E", "the constant transformation after the last joint, with the tool"))
    elif words.plan.arm.E is not None:
        meanings.append(("E", "the tool"))
    U0 = matrices("U0 = " + "Z^-1 " * left + "T" + " E^-1" * right)
    rows = [
        Line(" ".join(c + a for c in "snaP"), r" \; ".join(f"{c}_{{{a}}}" for c in "snaP"))
        for a in "xyz"
    ]
    tail = "".join(f", {{}} {meaning}" for _, meaning in meanings)
    names = (matrices(name) for name, _ in meanings)
    pose = "{}: the desired pose" + " [1.11]" * whole + ", with the elements {}, {}, {} [1.13]"
    return words.sentence(pose + tail + ".", U0, *rows, *names)
