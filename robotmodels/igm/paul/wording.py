"""The steps of a plan in words: equations, formulas, and where they do not determine a joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array
from .catalogue import positive_sine
from .equations import Split
from .expressions import Expression, Kind, negative
from .formulas import solution_of
from .plan import PaulPlan, Step
from .prose import Line, Prose, display, joined, said, type_formula
from .types import EquationType
from .writing import Writer


@dataclass(frozen=True, slots=True)
class Told:
    """A step in words."""

    names: tuple[str, ...]
    matrix_equation: str
    equations: tuple[str, ...]
    formulas: tuple[str, ...]
    undetermined: str
    text: str
    latex: str


class Wording:
    """Writes the steps of one plan."""

    def __init__(self, plan: PaulPlan) -> None:
        self.plan, self.graph, self.joints = plan, plan.arm.graph, plan.arm.joints
        self.writers = (Writer(self.graph, False), Writer(self.graph, True))
        self.short: dict[int, Expression] = {}
        self.axes, self.origins = _axes(plan)

    def variable(self, j: int, latex: bool = False) -> str:
        """The variable of a joint."""
        row = self.plan.form.rows[j]
        if latex:
            return rf"r_{{{row.frame}}}" if row.sigma else rf"\theta_{{{row.frame}}}"
        return f"{'r' if row.sigma else 'θ'}{row.frame}"

    def unknown(self, number: int, latex: bool = False) -> str:
        """An unknown: a joint variable, or a sum of them."""
        out = ""
        for j, sign in self.joints.unknowns[number].terms:
            name = self.variable(j, latex)
            out += f" {'-' if sign < 0 else '+'} {name}" if out else name
        return out

    def line(self, number: int) -> Line:
        """An unknown in both kinds of print."""
        return Line(self.unknown(number), self.unknown(number, True))

    def shortened(self, e: Expression) -> tuple[Expression, list[Line]]:
        """A name B1, B2, ... for a sum that depends on the pose, and its line if it is new."""
        node = self.graph.nodes[e[1]]
        if node.kind is not Kind.SUM or self.graph.is_constant(e):
            return e, []
        lines: list[Line] = []
        if e[1] not in self.short:
            sign = 1.0 if not self.writers[0](e).startswith("-") else -1.0
            number = len(self.short) + 1
            name = self.graph.named(f"B{number}", f"B_{{{number}}}", (sign * np.sign(e[0]), e[1]))
            # the name stands for the sum with its first term positive
            self.short[e[1]] = (sign * float(np.sign(e[0])), name[1])
            meaning = self.graph.nodes[name[1]].parts[0]
            text, latex = (write(meaning) for write in self.writers)
            lines.append(Line(f"B{number} = {text}", f"B_{{{number}}} &= {latex}"))
        factor, named = self.short[e[1]]
        return (e[0] * factor, named), lines

    def matrix_equation(self, split: Split, latex: bool = False) -> str:
        """Such as ``1T0 U0 = 1T6``."""
        rows = self.plan.form.rows
        k = len(rows)

        def frame(j: int) -> int:
            return rows[j - 1].frame if j else 0

        def pose(a: int, b: int) -> str:
            if latex:
                return rf"{{}}^{{{frame(a)}}}\mathbf{{T}}_{{{frame(b)}}}"
            return f"{frame(a)}T{frame(b)}"

        U, E = (r"\mathbf{U}_0", r"\mathbf{E}") if latex else ("U0", "E")
        tool = self.plan.arm.E is not None
        left = [pose(split.s, 0)] if split.s else []
        left.append(U)
        if tool and not split.tool:
            left.append(f"{E}^{{-1}}" if latex else "E^-1")
        if split.p < k:
            left.append(pose(k, split.p))
        right = [pose(split.s, split.p)] if split.s < split.p else ["1"]
        if split.tool:
            right.append(E)
        space = r" \, " if latex else " "
        return f"{space.join(left)} = {space.join(right)}"

    def _where(self, split: Split) -> Prose:
        equation = Line(self.matrix_equation(split), self.matrix_equation(split, True))
        out = ", both sides inverted" if split.inverse else ""
        if split.twist:
            out += f", in the axes before joint {split.s + 1}"
        return said("{}" + out, equation)

    def step(self, number: int, step: Step) -> Told:
        """One step in words."""
        solution = solution_of(step, self)
        undetermined = self._undetermined(step)
        formulas = (*solution.formulas, *self._derived(number))
        new = [line for line in formulas if line not in solution.equations]
        equation = joined([self._where(s) for s in dict.fromkeys(step.splits)], "; ")
        elements = ", ".join(f"({r + 1}, {c + 1})" for r, c in step.elements)
        several = "s" * (len(step.elements) > 1)
        count = f"{step.type.branches} solutions" if step.type.branches > 1 else "one solution"
        title, _, case = step.type.title.partition(" with ")
        name = said(title + " with {}", type_formula(case)) if case else said(title)
        kind = said("{}: {}", name, type_formula(step.type.formula))
        heading = f"Step {number + 1}:"
        first = said(
            " {} (" + count + "), {}", joined([self.line(u) for u in step.unknowns], " and "), kind
        )
        second = said("{}, element" + several + f" {elements}", equation)
        text = [f"{heading}{first.text}", f"  {second.text}"]
        latex = [rf"\textbf{{{heading}}}{first.latex}.", f"{second.latex}:"]
        groups = (("", solution.equations), ("with", solution.definitions), ("hence", new))
        for word, lines in groups:
            if lines:
                text += [f"  {word}"] * bool(word) + [f"    {line.text}" for line in lines]
                latex += [word] * bool(word) + [display(list(lines))]
        if undetermined:
            text.append(f"  {undetermined.text}")
            latex.append(undetermined.latex)
        return Told(
            tuple(self.unknown(u) for u in step.unknowns), self.matrix_equation(step.splits[0]),
            tuple(line.text for line in solution.equations),
            tuple(line.text for line in (*solution.definitions, *formulas)),
            undetermined.text if undetermined else "", "\n".join(text), "\n".join(latex),
        )  # fmt: skip

    def _derived(self, number: int) -> list[Line]:
        """Joints that follow from sums of angles once this step is done."""
        order = {u: n for n, step in enumerate(self.plan.steps) for u in step.unknowns}
        lines = []
        for j, row in enumerate(self.plan.form.rows):
            if row.sigma or j not in self.plan.solved:
                continue
            path = self.joints.path(self.joints.span_of(j))
            if len(path) < 2 or max(order[s.unknown] for s, _ in path) != number:
                continue
            sense = self.joints.group[j][2]
            both = []
            for latex in (False, True):
                words = ""
                signed = [(sense * way * self.joints.sense(s.span), s) for s, way in path]
                for sign, solved in sorted(signed, key=lambda t: -t[0]):
                    name = self.unknown(solved.unknown, latex)
                    name = f"({name})" if " " in name else name
                    words += f" {'-' if sign < 0 else '+'} {name}" if words else (
                        f"-{name}" if sign < 0 else name)  # fmt: skip
                both.append(f"{self.variable(j, latex)} {'&=' if latex else '='} {words}")
            lines.append(Line(*both))
        return lines

    def _undetermined(self, step: Step) -> Prose | None:
        """Where the step has no single answer, and what is done there."""
        first = self.line(step.unknowns[0])
        takes = said("there {} takes the value of `q_ref` (0 without one) and counts once", first)
        squares = Line("X**2 + Y**2 = Z**2", "X^2 + Y^2 = Z^2")
        if step.type is EquationType.TYPE_2_ZERO:
            where = said("{} and {}", *(self._vanishes(e) for e in step.coefficients))
            which = self._which(step, first)
            meaning = self._meaning(step)
            return said("{}{} is free where {}{}: {}.", which, first, where, meaning, takes)
        if step.type in (EquationType.TYPE_2, EquationType.TYPE_6, EquationType.TYPE_7):
            elbow = "" if step.type is EquationType.TYPE_2 else " (stretched or folded)"
            return said(
                "The two solutions fall together where {}" + elbow + "; where it is smaller the "
                "pose is out of reach. {} is free where {}: {}.",
                squares, first, Line("X = Y = Z = 0", "X = Y = Z = 0"), takes,
            )  # fmt: skip
        if step.type is EquationType.TYPE_8:
            return said(
                "The two solutions fall together where the cosine is 1 or {} (stretched or "
                "folded); where it is larger in size the pose is out of reach. "
                "{} is free where {}: {}.",
                Line("-1", "-1"), first, type_formula("Z1 = Z2 = 0"), takes,
            )  # fmt: skip
        if step.type is EquationType.TYPE_4:
            second = self.line(step.unknowns[1])
            return said("{} is free where {}.", second, type_formula("Y1 = Y2 = 0"))
        if step.type is EquationType.TYPE_1 and not self.graph.is_constant(step.coefficients[0]):
            X = self._vanishes(step.coefficients[0], signed=True)
            return said("{} is not determined where {}.", first, X)
        return None

    def _vanishes(self, e: Expression, signed: bool = False) -> Line:
        """An expression, without a minus in front unless ``signed``, equal to zero."""
        if not signed and self.writers[0](e).startswith("-"):
            e = negative(e)
        text, latex = (write(e) for write in self.writers)
        return Line(f"{text} = 0", f"{latex} = 0")

    def _which(self, step: Step, first: Line) -> Prose:
        """Which of the two solutions has which sign of the sine that follows."""
        X, Y = step.coefficients
        other = positive_sine(step.unknowns[0], X, Y, self.joints)
        if other is None:
            return Prose("", "")
        frame = self.joints.frame(other[0])
        turned = Line(f"{first.text}'", f"{first.latex}'")
        if " " in first.text:
            turned = Line(f"({first.text})'", f"({first.latex})'")
        above = Line(f"S{frame} > 0", f"S_{{{frame}}} > 0")
        below = Line(f"S{frame} < 0", f"S_{{{frame}}} < 0")
        return said("{} has {} and {} has {}. ", first, above, turned, below)

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
                return said(f" (axes {a} and {b} are {how})")
        for m in range(self.plan.form.k):
            away = self.origins[:, m] - origin
            lateral = np.linalg.norm(np.cross(axis, away), axis=1)
            if m != j and lateral.max() > 1e-6 and _proportional(size, lateral):
                frame, of = self.plan.form.rows[j].frame, self.plan.form.rows[m].frame
                O = Line(f"O{of}", f"O_{{{of}}}")  # noqa: E741
                return said(f" ({{}} is on the axis of joint {frame})", O)
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
