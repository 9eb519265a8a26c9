"""The steps of a plan in words: equations, formulas, and where they do not determine a joint."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..._arrays import Array
from .catalogue import Step, positive_sine
from .equations import Split
from .expressions import Expression, Kind, negative
from .plan import PaulPlan
from .types import EquationType, Page
from .typeset import Typesetter, plain
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


class PlanText:
    """Writes the steps of one plan: markup of `typeset`."""

    def __init__(self, plan: PaulPlan) -> None:
        self.plan, self.graph, self.joints = plan, plan.arm.graph, plan.arm.joints
        self.write, self.tex = Writer(self.graph), Typesetter(self.graph.latex)
        self._short: dict[int, Expression] = {}
        frames = plan.arm.frames(self.joints.postures)
        self.axes, self.origins = frames[..., :3, 2], frames[..., :3, 3]

    def variable(self, j: int) -> str:
        """The variable of a joint."""
        row = self.plan.form.rows[j]
        return f"{'r' if row.sigma else 'θ'}{row.frame}"

    def unknown(self, number: int) -> str:
        """An unknown: a joint variable, or a sum of them."""
        return self._total(self.joints.unknowns[number].terms)

    def _total(self, terms: Iterable[tuple[int, float]]) -> str:
        return _added((sign, self.variable(j)) for j, sign in terms)

    def short(self, e: Expression, lines: list[str]) -> Expression:
        """A name B1, B2, ... for a sum that depends on the pose; its line is added if it is new."""
        node = self.graph.nodes[e[1]]
        if node.kind is not Kind.SUM or self.graph.is_constant(e):
            return e
        if e[1] not in self._short:
            # the name denotes the sum with its first term positive
            sign = float(np.sign(e[0])) * (-1.0 if self.write(e).startswith("-") else 1.0)
            number = len(self._short) + 1
            name = self.graph.named(f"B{number}", f"B_{{{number}}}", (sign, e[1]))
            self._short[e[1]] = (sign, name[1])
            lines.append(f"B{number} = {self.write((sign, e[1]))}")
        factor, named = self._short[e[1]]
        return e[0] * factor, named

    def difference(self, i: int, j: int) -> tuple[str, float, str, str]:
        """The angle j without the angle i: its name, sign, cosine and sine."""
        own = self.joints.unknowns[i].terms
        rest = [term for term in self.joints.unknowns[j].terms if term not in own]
        sign = rest[0][1]
        name = self._total((m, s * sign) for m, s in rest)
        if len(rest) == 1:
            frame = self.joints.row(rest[0][0]).frame
            return name, sign, f"C{frame}", f"S{frame}"
        return name, sign, f"cos({name})", f"sin({name})"

    def matrix_equation(self, split: Split) -> str:
        """Such as ``1T0 U0 = 1T6``."""
        frames, k = [0, *(row.frame for row in self.plan.form.rows)], self.plan.form.k
        left = [f"{frames[split.s]}T0"] * (split.s > 0) + ["U0"]
        left += ["E^-1"] * (self.plan.arm.E is not None and not split.tool)
        left += [f"{frames[k]}T{frames[split.p]}"] * (split.p < k)
        right = f"{frames[split.s]}T{frames[split.p]}" if split.s < split.p else "1"
        return f"{' '.join(left)} = {right}{' E' * split.tool}"

    def _where(self, split: Split) -> str:
        out = f"${self.matrix_equation(split)}$" + ", both sides inverted" * split.inverse
        return out + f", in the axes before joint {split.s + 1}" * split.twist

    def step(self, number: int, step: Step) -> ExplainedStep:
        """One step in words."""
        nodes, symbols = self.graph.nodes, [self.joints.symbols(u) for u in step.unknowns]
        page = Page(
            self, step.type.formula, step.coefficients, step.unknowns,
            tuple(map(self.unknown, step.unknowns)),
            tuple(nodes[C[1]].name for C, _ in symbols),
            tuple(nodes[S[1]].name for _, S in symbols),
        )  # fmt: skip
        step.type.write(page)
        formulas = [*page.formulas, *self._derived(number)]
        found = " and ".join(f"${angle}$" for angle in page.angle)
        count = f"{step.type.branches} solutions" if step.type.branches > 1 else "one solution"
        equation = "; ".join(map(self._where, dict.fromkeys(e.split for e in step.equations)))
        elements = ", ".join(f"({e.row + 1}, {e.column + 1})" for e in step.equations)
        several = "s" * (len(step.equations) > 1)
        first = f" {found} ({count}), {step.type.markup}"
        second = f"{equation}, element{several} {elements}"
        heading, undetermined = f"Step {number + 1}:", self._undetermined(step)
        text = [plain(heading + first), f"  {plain(second)}"]
        latex = [rf"\textbf{{{heading}}}{self.tex.prose(first)}.", f"{self.tex.prose(second)}:"]
        new = [line for line in formulas if line not in page.equations]
        for word, lines in (("", page.equations), ("with", page.definitions), ("hence", new)):
            if lines:
                text += [f"  {word}"] * bool(word) + [f"    {plain(line)}" for line in lines]
                latex += [word] * bool(word) + [self.tex.rows(lines)]
        if undetermined:
            text.append(f"  {plain(undetermined)}")
            latex.append(self.tex.prose(undetermined))
        return ExplainedStep(
            joints=page.angle,
            type=step.type,
            matrix_equation=self.matrix_equation(step.equations[0].split),
            equations=tuple(page.equations),
            formulas=tuple(map(plain, (*page.definitions, *formulas))),
            undetermined=plain(undetermined),
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
            parts = sorted(self.joints.parts_of(j), key=lambda part: -part[0])
            if len(parts) > 1 and max(order[u] for _, u in parts) == number:
                names = ((sign, self.unknown(u)) for sign, u in parts)
                words = _added((sign, f"({n})" if " " in n else n) for sign, n in names)
                lines.append(f"{self.variable(j)} = {words}")
        return lines

    def _undetermined(self, step: Step) -> str:
        """Positions at which the step does not determine its unknown, and the value taken there."""
        first = f"${self.unknown(step.unknowns[0])}$"
        takes = f"there {first} takes the value of `q_ref` (0 without one) and counts once."
        if step.type is EquationType.TYPE_2_ZERO:
            where = " and ".join(map(self._vanishes, step.coefficients))
            which, meaning = self._which(step, first), self._meaning(step)
            return f"{which}{first} is free where {where}{meaning}: {takes}"
        together = "The two solutions coincide where"
        if step.type in (EquationType.TYPE_2, EquationType.TYPE_6, EquationType.TYPE_7):
            elbow = " (stretched or folded)" * (step.type is not EquationType.TYPE_2)
            return (
                f"{together} $X**2 + Y**2 = Z**2${elbow}; where it is smaller the pose is out of "
                f"reach. {first} is free where $X = Y = Z = 0$: {takes}"
            )
        if step.type is EquationType.TYPE_8:
            return (
                f"{together} the cosine is 1 or $-1$ (stretched or folded); where it is larger in "
                f"size the pose is out of reach. {first} is free where $Z1 = Z2 = 0$: {takes}"
            )
        if step.type is EquationType.TYPE_4:
            return f"${self.unknown(step.unknowns[1])}$ is free where $Y1 = Y2 = 0$."
        if step.type is EquationType.TYPE_1 and not self.graph.is_constant(step.coefficients[0]):
            return f"{first} is not determined where ${self.write(step.coefficients[0])} = 0$."
        return ""

    def _vanishes(self, e: Expression) -> str:
        """An expression, without a minus in front, equal to zero."""
        text = self.write(e)
        return f"${self.write(negative(e)) if text.startswith('-') else text} = 0$"

    def _which(self, step: Step, first: str) -> str:
        """Which of the two solutions has which sign of the sine that follows."""
        X, Y = step.coefficients
        other = positive_sine(step.unknowns[0], X, Y, self.joints)
        if other is None:
            return ""
        frame, name = self.joints.row(other[0]).frame, first.strip("$")
        turned = f"$({name})'$" if " " in name else f"${name}'$"
        return f"{first} has $S{frame} > 0$ and {turned} has $S{frame} < 0$. "

    def _meaning(self, step: Step) -> str:
        """Meaning for the arm of an equation whose amplitude vanishes."""
        if self.joints.unknowns[step.unknowns[0]].span is None:
            return ""
        j = self.joints.unknowns[step.unknowns[0]].terms[0][0]
        size = np.hypot(*(self.graph.values(e) for e in step.coefficients))
        axis, frames = self.axes[:, j], [row.frame for row in self.plan.form.rows]
        others = [m for m in range(self.plan.form.k) if m != j]
        for m in others:
            if _proportional(size, np.cross(axis, self.axes[:, m])):
                a, b = sorted((frames[j], frames[m]))
                how = "aligned" if self._meet(j, m) else "parallel"
                return f" (axes {a} and {b} are {how})"
        for m in others:
            if _proportional(size, np.cross(axis, self.origins[:, m] - self.origins[:, j])):
                return f" ($O{frames[m]}$ is on the axis of joint {frames[j]})"
        return ""

    def _meet(self, j: int, m: int) -> bool:
        """Whether two axes meet in the same point of the first one at every sample posture."""
        a, b = self.axes[:, j], self.axes[:, m]
        across = np.cross(a, b)
        between = self.origins[:, m] - self.origins[:, j]
        rounding = 1e-9 * float(np.abs(self.origins).max())
        gap = (between * across).sum(axis=1)
        along = (np.cross(between, b) * across).sum(axis=1) / (across**2).sum(axis=1)
        return bool(np.abs(gap).max() <= rounding and np.ptp(along) <= rounding)


def _added(terms: Iterable[tuple[float, str]]) -> str:
    """A sum in print, from signs and names."""
    out = ""
    for sign, name in terms:
        minus = " - " if out else "-"
        out += f"{minus if sign < 0 else ' + ' if out else ''}{name}"
    return out


def _proportional(a: Array, vectors: Array) -> bool:
    """Whether positive numbers (N,) have a constant ratio to the lengths of vectors (N, 3)."""
    b = np.linalg.norm(vectors, axis=1)
    far = np.abs(a * b[0] - b * a[0]).max() > 1e-9 * (a[0] * b.max() + b[0] * a.max())
    return bool(b.max() > 1e-6 and not far)
