"""The matrix equations of an arm, element by element: pre- and post-multiplication."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np

from ..._arrays import Array
from ..chain import motion
from .expressions import UNIT, ZERO, Expression, Graph, Kind, negative
from .normal_form import NormalForm
from .polynomials import Monomial, minus, plus, unknowns
from .products import Fixed, Item, Motion, Rotation, product, turned
from .unknowns import Joints

SAMPLES = 7


@dataclass(frozen=True, slots=True)
class Split:
    """Matrix equation ``(0Ts)^-1 U0 (pTk)^-1 = sTp``: joints up to s and after p go with the pose.

    ``tool``: the tool stays with the joints; ``twist``: the constant before joint s + 1 goes with
    the pose; ``inverse``: both sides are inverted.
    """

    s: int
    p: int
    tool: bool = False
    twist: bool = False
    inverse: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Equation:
    """One element of a matrix equation, ``polynomial = 0``, with at most two unknowns."""

    polynomial: dict[Monomial, Expression]
    unknowns: frozenset[int]
    split: Split
    row: int
    column: int
    length: int

    @property
    def of_position(self) -> bool:
        """Whether it compares positions."""
        return self.column == 3


class Arm:
    """The matrices of one arm, with the symbols of its pose and table."""

    def __init__(
        self, form: NormalForm, names: Mapping[str, tuple[str, float]] | None = None
    ) -> None:
        self.form = form
        self.names = names or {}
        graph = self.graph = Graph(SAMPLES)
        rng = np.random.default_rng(3)
        postures = rng.uniform(-2.5, 2.5, (SAMPLES, form.k))
        slides = form.sigma == 1
        postures[:, slides] *= 0.3 * _reach(form)
        self.constants: list[tuple[str, str, float, str]] = []
        self.K = [self._row_matrix(j) for j in range(form.k)]
        self.E = self._tool_matrix()
        self.joints = Joints(form, graph, [K.R for K in self.K], postures)
        U = self.frames(postures)[:, -1]
        U = U if self.E is None else U @ _number(self.E, graph)
        U0 = [[graph.symbol(Kind.POSE, c + a, f"{c}_{{{a}}}", U[:, i, j])
               for j, c in enumerate("snaP")] for i, a in enumerate("xyz")]  # fmt: skip
        self.U0 = Fixed([row[:3] for row in U0], [row[3] for row in U0], False)
        self.U0_inverse = self.U0.inverse(graph)

    def _constant(self, name: str, latex: str, value: float, meaning: str) -> Expression:
        if value == 0.0:
            return ZERO
        own, meant = self.names.get(name, ("", 0.0))
        # frames that were moved along their axes have other constants than the table
        if own and abs(value - meant) < 1e-12:
            name, latex = own, rf"\mathit{{{own}}}".replace("_", r"\_")
        if all(name != c[0] for c in self.constants):
            self.constants.append((name, latex, value, meaning))
        return self.graph.symbol(Kind.CONSTANT, name, latex, np.full(SAMPLES, value))

    def _angle(self, name: str, latex: str, value: float, meaning: str):  # noqa: ANN202
        """Cosine and sine of a constant angle."""
        quarters = round(value / (pi / 2))
        if abs(value - quarters * pi / 2) < 1e-15:
            turn = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarters % 4]
            return (turn[0], 0), (turn[1], 0)
        return (
            self._constant(f"C{name}", rf"C{latex}", cos(value), f"cosine of {meaning}"),
            self._constant(f"S{name}", rf"S{latex}", sin(value), f"sine of {meaning}"),
        )

    def _row_matrix(self, j: int) -> Fixed:
        row, graph = self.form.rows[j], self.graph
        name = str(row.frame)
        ca, sa = self._angle(f"A{name}", rf"\alpha_{{{name}}}", row.alpha, f"alpha{name}")
        ct, st = self._angle(f"TH{name}", rf"\theta_{{{name}}}", row.theta, f"theta{name}")
        d = self._constant(f"D{name}", f"D_{{{name}}}", row.d, f"d{name}")
        r = self._constant(f"RL{name}", f"RL_{{{name}}}", row.r, f"r{name}")
        X = [[UNIT, ZERO, ZERO], [ZERO, ca, negative(sa)], [ZERO, sa, ca]]
        turn = [[ct, negative(st), ZERO], [st, ct, ZERO], [ZERO, ZERO, UNIT]]
        return Fixed(
            turned(X, turn, graph), [d, graph.product(negative(sa), r), graph.product(ca, r)]
        )

    def _tool_matrix(self) -> Fixed | None:
        tool = self.form.tool
        if np.abs(tool - np.eye(4)).max() < 1e-13:
            return None

        def element(value: float, name: str, latex: str, meaning: str, known: float) -> Expression:
            if abs(value - known) < 1e-12:
                return known, 0
            return self._constant(name, latex, value, f"{meaning} of the tool")

        R = [[element(x, f"{c}{a}E", f"{c}_{{{a}E}}", c + a, float(round(x)))
              for c, x in zip("sna", row, strict=True)]
             for a, row in zip("xyz", tool[:3, :3].tolist(), strict=True)]  # fmt: skip
        p = [element(x, f"{a}E", f"{a}_{{E}}", a.lower(), 0.0)
             for a, x in zip("XYZ", tool[:3, 3].tolist(), strict=True)]  # fmt: skip
        return Fixed(R, p)

    def frames(self, q: Array) -> Array:
        """Poses of the frames of the rows at postures. Shapes: q (N, k) -> (N, k, 4, 4)."""
        T: Array = np.eye(4)
        out = []
        for j, row in enumerate(self.form.rows):
            T = T @ _number(self.K[j], self.graph) @ motion(row.sigma, q[:, j])
            out.append(T)
        return np.stack(out, axis=1)

    def sides(self, split: Split, K: list[Fixed] | None = None) -> tuple[list[Item], list[Item]]:
        """Matrices on the side of the pose and on the other; ``K`` replaces the constants."""
        K = K or self.K
        parts = [item for j in range(self.form.k) for item in (K[j], Motion(j, 1))]
        parts += [] if self.E is None else [self.E]
        first = 2 * split.s + split.twist
        last = len(parts) if split.tool else 2 * split.p
        before, middle, after = parts[:first], parts[first:last], parts[last:]
        if split.inverse:
            return [*after, self.U0_inverse, *before], self._inverted(middle)
        return [*self._inverted(before), self.U0, *self._inverted(after)], middle

    def _inverted(self, items: list[Item]) -> list[Item]:
        """Factors of the inverse of a product."""
        return [
            Motion(item.joint, -item.sign) if isinstance(item, Motion) else item.inverse(self.graph)
            for item in reversed(items)
        ]

    def splits(self, inverse: bool) -> Iterator[Split]:
        """Ways to write the equation while some joints are known; simplest first."""
        k = self.form.k
        unknown = [j for j in range(k) if not self.joints.knows(j)]
        last = unknown[-1] + 1
        for s in range(unknown[0], last):
            oblique = not _is_right(self.K[s].R)
            for p in (*((k,) if last < k else ()), *range(last, s, -1)):
                for twist in (False, True) if oblique else (False,):
                    if p == k and self.E is not None:
                        yield Split(s, p, True, twist, inverse)
                    yield Split(s, p, False, twist, inverse)

    def equations(self, inverse: bool = False) -> list[Equation]:
        """Elements of all matrix equations that have one or two unknowns."""
        found: list[Equation] = []
        for shortest in (True, False) if self.joints.has_alternatives else (False,):
            self.joints.shortest = shortest
            found += self._written(inverse)
        return found

    def _written(self, inverse: bool) -> list[Equation]:
        found: list[Equation] = []
        graph, seen = self.graph, set()
        for split in self.splits(inverse):
            left, right = (product(side, self.joints) for side in self.sides(split))
            for column in (3,) if inverse else (3, 0, 1, 2):
                for row in range(3):
                    p = plus(graph, left[column][row], minus(right[column][row]))
                    if not p or not (of := unknowns(p)) or len(of) > 2:
                        continue
                    key = frozenset(p.items())
                    if key in seen or frozenset((m, negative(e)) for m, e in p.items()) in seen:
                        continue
                    seen.add(key)
                    length = sum(graph.leaves(e) for e in p.values())
                    found.append(Equation(p, of, split, row, column, length))
        return found


def _is_right(R: Rotation) -> bool:
    return all(e[1] == 0 for row in R for e in row)


def _reach(form: NormalForm) -> float:
    lengths = sum(abs(row.d) + abs(row.r) for row in form.rows)
    return lengths + float(np.abs(form.tool[:3, 3]).sum()) or 1.0


def _number(item: Fixed, graph: Graph) -> Array:
    T = np.eye(4)
    T[:3, :3] = [[graph.values(e)[0] for e in row] for row in item.R]
    T[:3, 3] = [graph.values(e)[0] for e in item.p]
    return T
