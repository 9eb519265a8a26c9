"""The steps of a plan in words: equations, formulas, and where they do not determine a joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array
from ...model import RobotModel
from .catalogue import positive_sine
from .equation_type import EquationType
from .equations import Split
from .expressions import Expression, Kind, negative
from .formulas import Line, solution_of
from .plan import PaulPlan, Step
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

    def _where(self, split: Split) -> str:
        out = ", both sides inverted" if split.inverse else ""
        if split.twist:
            out += f", in the axes before joint {split.s + 1}"
        return out

    def step(self, number: int, step: Step) -> Told:
        """One step in words."""
        names = tuple(self.unknown(u) for u in self._given(step))
        solution = solution_of(step, self)
        undetermined = self._undetermined(step)
        derived = self._derived(number)
        formulas = (*solution.formulas, *derived)
        splits = list(dict.fromkeys(step.splits))
        equation = "; ".join(self.matrix_equation(s) + self._where(s) for s in splits)
        elements = ", ".join(f"({r + 1}, {c + 1})" for r, c in step.elements)
        kind = f"{step.type.title}: {step.type.formula}"
        several = "s" * (len(step.elements) > 1)
        count = f"{step.type.branches} solutions" if step.type.branches > 1 else "one solution"
        text = [
            f"Step {number + 1}: {' and '.join(names)} ({count}), {kind}",
            f"  {equation}, element{several} {elements}",
            *(f"    {line.text}" for line in solution.equations),
        ]
        if solution.definitions:
            text += ["  with", *(f"    {line.text}" for line in solution.definitions)]
        new = [line.text for line in formulas if line not in solution.equations]
        if new:
            text += ["  hence", *(f"    {words}" for words in new)]
        if undetermined:
            text.append(f"  {undetermined}")
        latex_names = r" \text{ and } ".join(self.unknown(u, True) for u in self._given(step))
        rows = [line.latex for line in (*solution.equations, *solution.definitions, *formulas)]
        heading = (
            rf"\textbf{{Step {number + 1}:}} ${latex_names}$, {step.type.title}, from "
            + "; ".join(f"${self.matrix_equation(s, True)}$" for s in splits)
            + f", element{several} {elements}"
        )
        latex = heading + "\n\\begin{align*}\n" + " \\\\\n".join(rows) + "\n\\end{align*}"
        return Told(
            names, self.matrix_equation(step.splits[0]),
            tuple(line.text for line in solution.equations),
            tuple(line.text for line in (*solution.definitions, *formulas)), undetermined,
            "\n".join(text), latex,
        )  # fmt: skip

    def _given(self, step: Step) -> tuple[int, ...]:
        single = (EquationType.POLYNOMIAL, EquationType.QUARTIC)
        return step.unknowns[:1] if step.type in single else step.unknowns

    def _derived(self, number: int) -> list[Line]:
        """Joints that follow from sums of angles once this step is done."""
        order = {u: n for n, step in enumerate(self.plan.steps) for u in self._given(step)}
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
                both.append(f"{self.variable(j, latex)} = {words}")
            lines.append(Line(*both))
        return lines

    def _undetermined(self, step: Step) -> str:
        """Where the step has no single answer, and what is done there."""
        write = self.writers[0]
        first = self.unknown(step.unknowns[0])
        takes = f"there {first} takes the value of q_ref (0 without one) and counts once"
        if step.type is EquationType.TYPE_2_ZERO:
            X, Y = (negative(e) if write(e).startswith("-") else e for e in step.coefficients)
            where = f"{write(X)} = 0 and {write(Y)} = 0"
            other = positive_sine(
                step.unknowns[0], step.coefficients[0], step.coefficients[1], self.joints
            )
            which = ""
            if other is not None:
                frame = self.joints.frame(other[0])
                which = f"{first} has S{frame} > 0 and {first}' has S{frame} < 0. "
            return f"{which}{first} is free where {where}{self._meaning(step)}: {takes}."
        if step.type is EquationType.TYPE_2:
            return (
                "The two solutions fall together where X**2 + Y**2 = Z**2; where it is smaller the "
                f"pose is out of reach. {first} is free where X = Y = Z = 0: {takes}."
            )
        if step.type in (EquationType.TYPE_6, EquationType.TYPE_7):
            return (
                "The two solutions fall together where X**2 + Y**2 = Z**2 (stretched or folded); "
                f"where it is smaller the pose is out of reach. {first} is free where "
                f"X = Y = Z = 0: {takes}."
            )
        if step.type is EquationType.TYPE_8:
            return (
                "The two solutions fall together where the cosine is 1 or -1 (stretched or "
                "folded); where it is larger in size the pose is out of reach. "
                f"{first} is free where Z1 = Z2 = 0: {takes}."
            )
        if step.type is EquationType.TYPE_4:
            return f"{self.unknown(step.unknowns[1])} is free where Y1 = Y2 = 0."
        if step.type is EquationType.TYPE_1 and not self.graph.is_constant(step.coefficients[0]):
            return f"{first} is not determined where {write(step.coefficients[0])} = 0."
        return ""

    def _meaning(self, step: Step) -> str:
        """What it means for the arm that the amplitude of an equation vanishes."""
        if self.joints.unknowns[step.unknowns[0]].span is None:
            return ""
        j = self.joints.unknowns[step.unknowns[0]].terms[0][0]
        size = np.hypot(*(self.graph.values(e) for e in step.coefficients))
        axis, origin = self.axes[:, j], self.origins[:, j]
        for m in range(self.plan.form.k):
            across = np.linalg.norm(np.cross(axis, self.axes[:, m]), axis=1)
            if m != j and across.max() > 1e-6 and _proportional(size, across):
                a, b = sorted(self.plan.form.rows[i].frame for i in (j, m))
                how = "aligned" if self._meet(j, m) else "parallel"
                return f" (axes {a} and {b} are {how})"
        for m in range(self.plan.form.k):
            away = self.origins[:, m] - origin
            lateral = np.linalg.norm(np.cross(axis, away), axis=1)
            if m != j and lateral.max() > 1e-6 and _proportional(size, lateral):
                frame = self.plan.form.rows[j].frame
                return f" (O{self.plan.form.rows[m].frame} is on the axis of joint {frame})"
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

    def whole(
        self, model: RobotModel, steps: list[tuple[str, str]], takes_over: str
    ) -> tuple[str, str]:
        """The whole explanation, as text and LaTeX."""
        plan = self.plan
        text = [f"Inverse geometric model of {model.name} by Paul's method", "", str(model.table)]
        text += ["", self._pose_line(model)]
        if plan.arm.constants:
            text += ["", "Constants"]
            text += [f"  {n} = {v:.12g}  ({meaning})" for n, _, v, meaning in plan.arm.constants]
        for told, _ in steps:
            text += ["", told]
        text += [""]
        latex = [rf"\textbf{{Inverse geometric model of {model.name} by Paul's method}}"]
        latex += [told for _, told in steps]
        if plan.complete:
            each = " x ".join(str(s.type.branches) for s in plan.steps if s.type.branches > 1)
            most = plan.most_postures
            how = f" ({each})" if each and each != str(most) else ""
            count = f"At most {most} posture{'s' * (most != 1)}{how}; "
            count += "each is checked on the whole pose before it is returned."
            text.append(count)
            latex.append(count.replace(" x ", r" $\times$ "))
        else:
            rest = ", ".join(self.variable(j) for j in plan.remaining)
            why = (
                "there are more joints than components of a pose"
                if plan.form.k > 6
                else "no element of any matrix equation, however it is multiplied, has one or two "
                "unknowns in a form of the catalogue"
            )
            stop = f"Paul's method stops here: {rest} remain, because {why}."
            over = f"What takes over: {takes_over}."
            text += [stop, over]
            latex += [self._greek(stop), self._greek(over)]
        offsets = [
            f"q{j + 1} = {self.variable(j)} {'-' if r.offset > 0 else '+'} {abs(r.offset):.12g}"
            for j, r in enumerate(plan.form.rows) if abs(r.offset) > 1e-15
        ]  # fmt: skip
        if offsets and plan.complete:
            text.append("Joint variables with an offset: " + ", ".join(offsets) + ".")
        if any(s.type.code in (9, 3, 10) for s in plan.steps):
            note = "atan2 keeps the quadrant that arctan(y/x) loses; two solutions are both kept."
            text.append(note)
            latex.append(note)
        return "\n".join(text), "\n\n".join(latex)

    def _greek(self, words: str) -> str:
        for j in range(self.plan.form.k):
            words = words.replace(self.variable(j), f"${self.variable(j, True)}$")
        return words

    def _pose_line(self, model: RobotModel) -> str:
        form = self.plan.form
        plain = np.allclose(model.base, np.eye(4), atol=1e-13)
        elements = "with the elements sx nx ax Px, sy ny ay Py, sz nz az Pz [1.13]"
        if form.k < 6:
            first = "U0 = T" if plain else "U0 = Z^-1 T"
            tail = "" if self.plan.arm.E is None else ", E the tool"
            if not np.allclose(form.before, np.eye(4), atol=1e-13):
                first, tail = "U0 = Z^-1 T", f"{tail}, Z the base and the constant before joint 1"
            return f"{first}: the desired pose, {elements}{tail}."
        left = not plain or not np.allclose(form.before, np.eye(4), atol=1e-13)
        right = not np.allclose(form.after, np.eye(4), atol=1e-13)
        words = "U0 = " + ("Z^-1 T" if left else "T") + (" E^-1" if right else "")
        why = []
        if left:
            why.append("Z the base and what the table has before the first motion")
        if right:
            why.append("E what it has after the last motion, and the tool")
        return (
            f"{words}: the desired pose [1.11], {elements}" + "".join(f", {w}" for w in why) + "."
        )


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
