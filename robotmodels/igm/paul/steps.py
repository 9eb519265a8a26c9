"""The steps of a plan in words: equations, formulas, and where they do not determine a joint."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..._arrays import Array
from .catalogue import positive_sine
from .equations import Split
from .expressions import Expression, Kind, negative
from .formulas import Page
from .plan import PaulPlan, Step
from .types import EquationType
from .typeset import Prose, Typesetter, display, matrices, type_formula
from .writer import Writer


@dataclass(frozen=True, slots=True)
class ExplainedStep:
    """One step of the derivation."""

    joints: tuple[str, ...]
    type: EquationType
    matrix_equation: str
    equations: tuple[str, ...]
    formulas: tuple[str, ...]
    undetermined: str
    branches: int
    text: str
    latex: str


class PlanText(Typesetter):
    """Writes the steps of one plan."""

    def __init__(self, plan: PaulPlan) -> None:
        self.plan, self.graph, self.joints = plan, plan.arm.graph, plan.arm.joints
        self.write = Writer(self.graph)
        self._short: dict[int, Expression] = {}
        self.axes, self.origins = _axes(plan)

    def symbol(self, name: str) -> str:
        """LaTeX of a symbol, as the expressions have it where it is one of theirs."""
        return self.graph.latex.get(name) or super().symbol(name)

    def variable(self, j: int) -> str:
        """The variable of a joint."""
        row = self.plan.form.rows[j]
        return f"{'r' if row.sigma else 'θ'}{row.frame}"

    def unknown(self, number: int) -> str:
        """An unknown: a joint variable, or a sum of them."""
        return self._total(self.joints.unknowns[number].terms)

    def _total(self, terms: Iterable[tuple[int, float]]) -> str:
        out = ""
        for j, sign in terms:
            name = self.variable(j)
            out += f" {'-' if sign < 0 else '+'} {name}" if out else name
        return out

    def sum(self, *terms: tuple[Expression, str]) -> str:
        """Expressions times symbols, added."""
        return self.write.sum(list(terms))

    def short(self, e: Expression, lines: list[str]) -> Expression:
        """A name B1, B2, ... for a sum that depends on the pose; its line is added if it is new."""
        node = self.graph.nodes[e[1]]
        if node.kind is not Kind.SUM or self.graph.is_constant(e):
            return e
        if e[1] not in self._short:
            sign = 1.0 if not self.write(e).startswith("-") else -1.0
            number = len(self._short) + 1
            name = self.graph.named(f"B{number}", f"B_{{{number}}}", (sign * np.sign(e[0]), e[1]))
            # the name stands for the sum with its first term positive
            self._short[e[1]] = (sign * float(np.sign(e[0])), name[1])
            lines.append(f"B{number} = {self.write(self.graph.nodes[name[1]].parts[0])}")
        factor, named = self._short[e[1]]
        return e[0] * factor, named

    def difference(self, i: int, j: int) -> tuple[str, float, str, str]:
        """The angle j without the angle i: its name, sign, cosine and sine."""
        own = self.joints.unknowns[i].terms
        rest = [term for term in self.joints.unknowns[j].terms if term not in own]
        sign = rest[0][1]
        name = self._total((m, s * sign) for m, s in rest)
        if len(rest) == 1:
            frame = self.joints.frame(rest[0][0])
            return name, sign, f"C{frame}", f"S{frame}"
        return name, sign, f"cos({name})", f"sin({name})"

    def matrix_equation(self, split: Split) -> str:
        """Such as ``1T0 U0 = 1T6``."""
        rows, k = self.plan.form.rows, self.plan.form.k

        def pose(a: int, b: int) -> str:
            frames = [rows[j - 1].frame if j else 0 for j in (a, b)]
            return f"{frames[0]}T{frames[1]}"

        left = [pose(split.s, 0)] * (split.s > 0) + ["U0"]
        left += ["E^-1"] * (self.plan.arm.E is not None and not split.tool)
        left += [pose(k, split.p)] * (split.p < k)
        right = [pose(split.s, split.p)] if split.s < split.p else ["1"]
        return f"{' '.join(left)} = {' '.join(right + ['E'] * split.tool)}"

    def _where(self, split: Split) -> Prose:
        out = ", both sides inverted" if split.inverse else ""
        if split.twist:
            out += f", in the axes before joint {split.s + 1}"
        return self.sentence("{}" + out, matrices(self.matrix_equation(split)))

    def step(self, number: int, step: Step) -> ExplainedStep:
        """One step in words."""
        symbols = [[self.graph.nodes[e[1]].name for e in self.joints.symbols(u)]
                   for u in step.unknowns]  # fmt: skip
        page = Page(
            self, step.coefficients, step.unknowns, tuple(self.unknown(u) for u in step.unknowns),
            tuple(C for C, _ in symbols), tuple(S for _, S in symbols),
        )  # fmt: skip
        step.type.write(page)
        undetermined = self._undetermined(step)
        formulas = (*page.formulas, *self._derived(number))
        new = [line for line in formulas if line not in page.equations]
        equation = self.joined([self._where(s) for s in dict.fromkeys(step.splits)], "; ")
        elements = ", ".join(f"({r + 1}, {c + 1})" for r, c in step.elements)
        several = "s" * (len(step.elements) > 1)
        count = f"{step.type.branches} solutions" if step.type.branches > 1 else "one solution"
        title, _, case = step.type.title.partition(" with ")
        name = (
            self.sentence(title + " with {}", type_formula(case)) if case else self.sentence(title)
        )
        kind = self.sentence("{}: {}", name, type_formula(step.type.formula))
        heading = f"Step {number + 1}:"
        found = self.joined([self.unknown(u) for u in step.unknowns], " and ")
        first = self.sentence(" {} (" + count + "), {}", found, kind)
        second = self.sentence("{}, element" + several + f" {elements}", equation)
        text = [f"{heading}{first.text}", f"  {second.text}"]
        latex = [rf"\textbf{{{heading}}}{first.latex}.", f"{second.latex}:"]
        for word, lines in (("", page.equations), ("with", page.definitions), ("hence", new)):
            if lines:
                text += [f"  {word}"] * bool(word) + [f"    {line}" for line in lines]
                rows = [self.formula(line).latex for line in lines]
                latex += [word] * bool(word) + [display(rows)]
        if undetermined:
            text.append(f"  {undetermined.text}")
            latex.append(undetermined.latex)
        return ExplainedStep(
            joints=page.angle,
            type=step.type,
            matrix_equation=self.matrix_equation(step.splits[0]),
            equations=tuple(page.equations),
            formulas=(*page.definitions, *formulas),
            undetermined=undetermined.text if undetermined else "",
            branches=step.type.branches,
            text="\n".join(text),
            latex="\n".join(latex),
        )

    def _derived(self, number: int) -> list[str]:
        """Joints that follow from sums of angles once this step is done."""
        order = {u: n for n, step in enumerate(self.plan.steps) for u in step.unknowns}
        lines = []
        for j, row in enumerate(self.plan.form.rows):
            if row.sigma or j not in self.plan.solved:
                continue
            path = self.joints.path(self.joints.sum_of(j))
            if len(path) < 2 or max(order[s.unknown] for s, _ in path) != number:
                continue
            sense, words = self.joints.group[j][2], ""
            signed = [(sense * sign * self.joints.sense(s.span), s) for s, sign in path]
            for sign, solved in sorted(signed, key=lambda t: -t[0]):
                name = self.unknown(solved.unknown)
                name = f"({name})" if " " in name else name
                words += f" {'-' if sign < 0 else '+'} {name}" if words else (
                    f"-{name}" if sign < 0 else name)  # fmt: skip
            lines.append(f"{self.variable(j)} = {words}")
        return lines

    def _undetermined(self, step: Step) -> Prose | None:
        """Where the step has no single answer, and what is done there."""
        first, sentence = self.unknown(step.unknowns[0]), self.sentence
        takes = sentence(
            "there {} takes the value of `q_ref` (0 without one) and counts once", first
        )
        if step.type is EquationType.TYPE_2_ZERO:
            where = sentence("{} and {}", *(self._vanishes(e) for e in step.coefficients))
            which = self._which(step, first)
            meaning = self._meaning(step)
            return sentence("{}{} is free where {}{}: {}.", which, first, where, meaning, takes)
        if step.type in (EquationType.TYPE_2, EquationType.TYPE_6, EquationType.TYPE_7):
            elbow = "" if step.type is EquationType.TYPE_2 else " (stretched or folded)"
            return sentence(
                "The two solutions fall together where {}" + elbow + "; where it is smaller the "
                "pose is out of reach. {} is free where {}: {}.",
                "X**2 + Y**2 = Z**2", first, "X = Y = Z = 0", takes,
            )  # fmt: skip
        if step.type is EquationType.TYPE_8:
            return sentence(
                "The two solutions fall together where the cosine is 1 or {} (stretched or "
                "folded); where it is larger in size the pose is out of reach. "
                "{} is free where {}: {}.", "-1", first, "Z1 = Z2 = 0", takes,
            )  # fmt: skip
        if step.type is EquationType.TYPE_4:
            return sentence("{} is free where {}.", self.unknown(step.unknowns[1]), "Y1 = Y2 = 0")
        if step.type is EquationType.TYPE_1 and not self.graph.is_constant(step.coefficients[0]):
            X = f"{self.write(step.coefficients[0])} = 0"
            return sentence("{} is not determined where {}.", first, X)
        return None

    def _vanishes(self, e: Expression) -> str:
        """An expression, without a minus in front, equal to zero."""
        text = self.write(e)
        return f"{self.write(negative(e)) if text.startswith('-') else text} = 0"

    def _which(self, step: Step, first: str) -> Prose:
        """Which of the two solutions has which sign of the sine that follows."""
        X, Y = step.coefficients
        other = positive_sine(step.unknowns[0], X, Y, self.joints)
        if other is None:
            return Prose("", "")
        frame = self.joints.frame(other[0])
        turned = f"({first})'" if " " in first else f"{first}'"
        above, below = f"S{frame} > 0", f"S{frame} < 0"
        return self.sentence("{} has {} and {} has {}. ", first, above, turned, below)

    def _meaning(self, step: Step) -> Prose:
        """What it means for the arm that the amplitude of an equation vanishes."""
        nothing = Prose("", "")
        if self.joints.unknowns[step.unknowns[0]].span is None:
            return nothing
        j = self.joints.unknowns[step.unknowns[0]].terms[0][0]
        size = np.hypot(*(self.graph.values(e) for e in step.coefficients))
        axis, origin = self.axes[:, j], self.origins[:, j]
        for m in range(self.plan.form.k):
            across = np.linalg.norm(np.cross(axis, self.axes[:, m]), axis=1)
            if m != j and across.max() > 1e-6 and _proportional(size, across):
                a, b = sorted(self.plan.form.rows[i].frame for i in (j, m))
                how = "aligned" if self._meet(j, m) else "parallel"
                return self.sentence(f" (axes {a} and {b} are {how})")
        for m in range(self.plan.form.k):
            away = self.origins[:, m] - origin
            lateral = np.linalg.norm(np.cross(axis, away), axis=1)
            if m != j and lateral.max() > 1e-6 and _proportional(size, lateral):
                frame, of = self.plan.form.rows[j].frame, self.plan.form.rows[m].frame
                return self.sentence(f" ({{}} is on the axis of joint {frame})", f"O{of}")
        return nothing

    def _meet(self, j: int, m: int) -> bool:
        """Whether two axes meet in the same point of the first one at every sample posture."""
        a, b = self.axes[:, j], self.axes[:, m]
        across = np.cross(a, b)
        between = self.origins[:, m] - self.origins[:, j]
        rounding = 1e-9 * float(np.abs(self.origins).max())
        gap = (between * across).sum(axis=1)
        along = (np.cross(between, b) * across).sum(axis=1) / (across**2).sum(axis=1)
        return bool(np.abs(gap).max() <= rounding and np.ptp(along) <= rounding)


def _axes(plan: PaulPlan) -> tuple[Array, Array]:
    """Directions and origins of the joint axes at the sample postures, ``(samples, k, 3)``."""
    arm, form = plan.arm, plan.form
    postures = arm.joints.postures
    z, o = np.empty((len(postures), form.k, 3)), np.empty((len(postures), form.k, 3))
    for i, q in enumerate(postures):
        for j, T in enumerate(arm.frames(q)):
            z[i, j], o[i, j] = T[:3, 2], T[:3, 3]
    return z, o


def _proportional(a: Array, b: Array) -> bool:
    """Whether two lists of positive numbers have a constant ratio."""
    return bool(np.abs(a * b[0] - b * a[0]).max() <= 1e-9 * (a[0] * b.max() + b[0] * a.max()))
