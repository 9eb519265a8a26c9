"""Convex constraints on standard parameters, and dissipativity constraints of drives.

Sources: P. Wensing, S. Kim and J.-J. Slotine, IEEE RA-L 3(1), 2018; C. Sousa and R. Cortesao, IJRR
33(6), 2014. Every constraint is affine in the standard parameters x.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import DriveKind, drive_kinds
from ..friction import (
    AsymmetricFriction,
    CoulombFriction,
    Friction,
    FrictionSum,
    StribeckFriction,
    ViscousFriction,
)
from .result import BaseParameters

_INSIDE = 1e-9
"""Smallest eigenvalue of matrices in the solver's units: margin for its rounding."""
_DISSIPATIVE = (ViscousFriction, CoulombFriction, AsymmetricFriction, StribeckFriction)


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """Standard parameters x with ``rows @ x + offset`` in a cone. Shapes: rows (k, p), offset (k,).

    The cone: zero, non-negative numbers, a first entry not below the norm of the others, or a
    positive semidefinite matrix, row by row. A sentence for each number, or one for the cone.
    """

    cone: Literal["zero", "nonnegative", "second_order", "semidefinite"]
    rows: Array
    offset: Array
    sentences: tuple[str, ...]

    def slack(self, x: Array) -> Array:
        """Distance to the boundary, one for each sentence; negative outside."""
        s = self.rows @ x + self.offset
        if self.cone == "semidefinite":
            k = round(len(s) ** 0.5)
            return np.asarray(np.linalg.eigvalsh(s.reshape(k, k))[:1], dtype=np.float64)
        if self.cone == "second_order":
            return np.array([float(s[0] - np.linalg.norm(s[1:]))])
        return s if self.cone == "nonnegative" else -np.abs(s)

    def stated(
        self, cp: Any, change: Any, unit: Array, x: Array, size: float, room: float = 0.0
    ) -> Any:
        """The constraint on ``x + size * unit @ change``, divided by size. Shapes: unit (p, p).

        The eigenvalues of a matrix are at least ``room`` and the solver's rounding.
        """
        s = (self.rows @ unit) @ change + (self.rows @ x + self.offset) / size
        if self.cone == "semidefinite":
            k = round(len(self.offset) ** 0.5)
            return cp.reshape(s, (k, k), order="C") >> (_INSIDE + room / size) * np.eye(k)
        if self.cone == "second_order":
            return cp.SOC(s[0], s[1:])
        return s >= 0 if self.cone == "nonnegative" else s == 0


def positive_drives(base: BaseParameters) -> NDArray[np.int64]:
    """Numbers of the nonnegative standard parameters of drives. Shapes: -> (k,)."""
    f, n = base.model.f, base.model.n
    kinds = drive_kinds(base.drive)
    starts = [10 * f + n * k for k, kind in enumerate(kinds) if kind is not DriveKind.OFFSET]
    numbers = [range(start, start + n) for start in starts]
    numbers += [range(start, start + n * count) for start, count, _ in _frictions(base)]
    return np.array([k for part in numbers for k in part], dtype=np.int64)


def stribeck_numbers(base: BaseParameters) -> tuple[list[int], list[int]]:
    """Numbers of the static and of the Coulomb friction of Stribeck curves."""
    n = base.model.n
    starts = [start for start, _, stribeck in _frictions(base) if stribeck]
    coulomb = [start + n + j for start in starts for j in range(n)]
    return [number + n for number in coulomb], coulomb


def drive_sizes(base: BaseParameters, prior: Array) -> Array:
    """Natural sizes of drive parameters: a prior's, beside others of the kind. Shapes: -> (d,)."""
    sizes, kinds = np.abs(prior[10 * base.model.f :]), parameter_kinds(base)[10 * base.model.f :]
    for kind in set(kinds.tolist()):
        same = kinds == kind
        sizes[same] = np.maximum(sizes[same], 1e-2 * sizes[same].max())
    return np.where(sizes > 0, sizes, 1.0)


def parameter_kinds(base: BaseParameters) -> NDArray[np.str_]:
    """Kind of each standard parameter; couplings of motors have that of the joints. -> (p,)."""
    coupling = {kind.coupling: kind.value for kind in DriveKind if kind.coupling is not None}
    letters = [name.rstrip("0123456789") for name in base.parameter_names]
    return np.array([coupling.get(name, name) for name in letters])


def sign_constraints(base: BaseParameters, unit: Array) -> Iterator[Constraint]:
    """Nonnegativity of rotor inertias, frictions and their sums. Shapes: unit (p,)."""
    p, names = len(unit), base.parameter_names
    rows: list[dict[int, float]] = [{k: 1.0} for k in positive_drives(base).tolist()]
    sentences = [f"{names[k]} is zero." for row in rows for k in row]
    motors, weights = _motors(base)
    for kind, start, joined in _coupled_kinds(base, len(motors)):
        if kind is DriveKind.FC:  # dry friction of coupled motors is dissipative
            for m, j in zip(*np.nonzero(weights), strict=True):
                rows.append({start + int(j): 1.0, joined + int(m): abs(float(weights[m, j]))})
                both = " and ".join(names[k] for k in rows[-1])
                sentences.append(f"Dry friction of {both} together dissipates no energy.")
    for static, coulomb in zip(*stribeck_numbers(base), strict=True):  # the curve decreases from Fs
        rows.append({static: 1.0, coulomb: -1.0})
        sentences.append(f"{names[static]} of Stribeck's curve is its {names[coulomb]}.")
    if rows:
        matrix = np.zeros((len(rows), p))
        for i, row in enumerate(rows):
            matrix[i, list(row)] = list(row.values())
        matrix /= np.abs(matrix * unit).max(axis=1)[:, None]
        yield Constraint("nonnegative", matrix, np.zeros(len(rows)), tuple(sentences))


def coupled_constraints(
    base: BaseParameters, unit: Array
) -> Iterator[tuple[tuple[int, ...], Constraint]]:
    """Matrices of rotor inertia and viscous friction of joints that motors couple, >= 0.

    Each with the numbers of the parameters on its diagonal. Shapes: unit (p,).
    """
    motors, weights = _motors(base)
    for kind, start, joined in _coupled_kinds(base, len(motors)):
        if kind is DriveKind.FC:
            continue
        for joints, members in _connected(weights != 0.0):
            numbers, k = start + joints, len(joints)
            D = np.diag(unit[numbers] ** -0.5)
            rows = np.zeros((k * k, len(unit)))
            for i, number in enumerate(numbers):
                rows[i * (k + 1), number] = 1.0 / unit[number]
            for m in members:
                w = weights[m, joints]
                rows[:, joined + m] = (D @ (np.outer(w, w) - np.diag(w**2)) @ D).ravel()
            numbers = (*numbers.tolist(), *(joined + m for m in members))
            names = ", ".join(base.parameter_names[number] for number in numbers)
            sentence = f"The matrix of coupled motors with {names} is singular."
            one = Constraint("semidefinite", rows, np.zeros(k * k), (sentence,))
            yield tuple(numbers[:k]), one


def _motors(base: BaseParameters) -> tuple[list[int], Array]:
    """Coupled motors, from 0, and their turns per turn of the joints (m, n)."""
    K = base.model.transmission
    motors = [] if K is None else [m - 1 for m in K.coupled_motors]
    return motors, np.zeros((0, base.model.n)) if K is None else K.weights[motors]


def _coupled_kinds(base: BaseParameters, motors: int) -> list[tuple[DriveKind, int, int]]:
    """Coupled kinds: number of their first parameter, and of their first coupling."""
    kinds, f, n = drive_kinds(base.drive), base.model.f, base.model.n
    joined = [kind for kind in kinds if kind.coupling is not None] if motors else []
    first = 10 * f + n * len(kinds)
    return [
        (kind, 10 * f + n * kinds.index(kind), first + motors * i) for i, kind in enumerate(joined)
    ]


def _connected(turns: NDArray[np.bool_]) -> list[tuple[NDArray[np.int64], list[int]]]:
    """Sets of joints connected by motors, with these motors. Shapes: turns (m, n)."""
    from scipy.sparse.csgraph import connected_components

    _, labels = connected_components(turns @ turns.T.astype(float), directed=False)
    sets = [np.flatnonzero(labels == k) for k in range(labels.max(initial=-1) + 1)]
    return [(np.flatnonzero(turns[members].any(axis=0)), members.tolist()) for members in sets]


def _frictions(base: BaseParameters) -> list[tuple[int, int, bool]]:
    """For each dissipative part of the friction model: first number, kinds, whether Stribeck's."""
    if base.friction is None:
        return []
    n, dissipative = base.model.n, []
    parts: tuple[Friction, ...] = (base.friction,)
    if isinstance(base.friction, FrictionSum):
        parts = base.friction.parts
    counts = [len(part.kinds) for part in parts]  # type: ignore[attr-defined]
    start = len(base.parameter_names) - n * sum(counts)
    for part, count in zip(parts, counts, strict=True):
        if isinstance(part, _DISSIPATIVE):
            dissipative.append((start, count, isinstance(part, StribeckFriction)))
        start += n * count
    return dissipative
