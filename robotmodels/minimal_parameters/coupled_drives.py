"""What coupled motors must meet to be real: rotors that store energy, friction that takes it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import DriveKind, drive_kinds
from .result import BaseParameters


@dataclass(frozen=True, slots=True, eq=False)
class CoupledBlock:
    """A symmetric matrix of the joints that motors couple, linear in standard parameters."""

    diagonal: NDArray[np.int64]
    couplings: tuple[tuple[int, Array], ...]

    def matrix(self, x: Array) -> Array:
        """The matrix of standard parameters x, shape (k, k)."""
        return np.diag(x[self.diagonal]) + np.sum([x[i] * C for i, C in self.couplings], axis=0)

    def least(self, x: Array) -> float:
        """Its smallest eigenvalue."""
        return float(np.linalg.eigvalsh(self.matrix(x))[0])

    def largest(self, x: Array) -> float:
        """Its largest entry."""
        return float(np.abs(self.matrix(x)).max())

    def triangle(self, unit: Array) -> Array:
        """Its upper triangle over the parameters as the solver stacks it, in units of its joints.

        Shapes: unit (p,) -> (k (k + 1) / 2, p).
        """
        k = len(self.diagonal)
        size = 1.0 / np.sqrt(unit[self.diagonal])
        rows = np.zeros((k * (k + 1) // 2, len(unit)))
        for row, (i, m) in enumerate((a, b) for b in range(k) for a in range(b + 1)):
            weight = size[i] * size[m] * (1.0 if i == m else np.sqrt(2.0))
            for number, C in self.couplings:
                rows[row, number] = weight * C[i, m]
            if i == m:
                rows[row, self.diagonal[i]] = weight
        return rows


def coupled_blocks(base: BaseParameters) -> tuple[CoupledBlock, ...]:
    """Matrices that must be positive semidefinite, one for joints that couplings connect."""
    motors, weights = _motors(base)
    f, n = base.model.f, base.model.n
    blocks = []
    for kind, start, joined in _kinds(base, len(motors)):
        if kind is DriveKind.FC:
            continue
        for joints, members in _connected(weights != 0.0):
            couplings = []
            for m in members:
                w = weights[m, joints]
                couplings.append((joined + m, np.outer(w, w) - np.diag(w**2)))
            blocks.append(CoupledBlock(10 * f + n * start + joints, tuple(couplings)))
    return tuple(blocks)


def dry_rows(base: BaseParameters) -> Array:
    """Rows that must not be negative so that dry friction of coupled motors takes energy.

    Shapes: -> (r, p).
    """
    motors, weights = _motors(base)
    f, n, p = base.model.f, base.model.n, len(base.parameter_names)
    rows = [np.zeros((0, p))]
    for kind, start, joined in _kinds(base, len(motors)):
        if kind is not DriveKind.FC:
            continue
        for m in range(len(motors)):
            for j in np.flatnonzero(weights[m]):
                row = np.zeros((1, p))
                row[0, 10 * f + n * start + j], row[0, joined + m] = 1.0, abs(weights[m, j])
                rows.append(row)
    return np.concatenate(rows)


def drive_sizes(base: BaseParameters, prior: Array) -> Array:
    """Natural size of each parameter of drives and friction: its own beside others of its kind."""
    first = 10 * base.model.f
    coupling = {kind.coupling: kind.value for kind in DriveKind if kind.coupling is not None}
    letters = [name.rstrip("0123456789") for name in base.parameter_names[first:]]
    kinds = np.array([coupling.get(name, name) for name in letters])
    sizes = np.abs(prior[first:])
    for kind in set(kinds.tolist()):
        own = kinds == kind
        sizes[own] = np.maximum(sizes[own], 1e-2 * sizes[own].max())
    return np.where(sizes > 0, sizes, 1.0)


def _motors(base: BaseParameters) -> tuple[list[int], Array]:
    """Coupled motors, from 0, and their turns per turn of the joints (m, n)."""
    K = base.model.transmission
    if K is None:
        return [], np.zeros((0, base.model.n))
    motors = [m - 1 for m in K.coupled_motors]
    return motors, K.weights[motors]


def _kinds(base: BaseParameters, motors: int) -> list[tuple[DriveKind, int, int]]:
    """Kinds that couplings have: place among the kinds, and number of the first coupling."""
    asked = drive_kinds(base.drive)
    first = 10 * base.model.f + base.model.n * len(asked)
    joined = [kind for kind in asked if kind.coupling is not None] if motors else []
    return [(kind, asked.index(kind), first + motors * i) for i, kind in enumerate(joined)]


def _connected(turns: NDArray[np.bool_]) -> list[tuple[NDArray[np.int64], list[int]]]:
    """Joints that motors connect, each set with its motors."""
    left, found = list(range(len(turns))), []
    while left:
        members = [left.pop(0)]
        joints = turns[members[0]].copy()
        while more := [m for m in left if (turns[m] & joints).any()]:
            members += more
            left = [m for m in left if m not in more]
            joints = joints | turns[more].any(axis=0)
        found.append((np.flatnonzero(joints), sorted(members)))
    return found
