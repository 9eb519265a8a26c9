"""What drives and friction must meet to be real: they store and take energy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import DriveKind, drive_kinds
from ..estimation.conic import Cone, Constraint
from ..friction import (
    AsymmetricFriction,
    CoulombFriction,
    Friction,
    FrictionSum,
    StribeckFriction,
    ViscousFriction,
)
from .coupled_drives import coupled_blocks, dry_rows
from .result import BaseParameters

_DISSIPATIVE = (ViscousFriction, CoulombFriction, AsymmetricFriction, StribeckFriction)


def positive_drives(base: BaseParameters) -> NDArray[np.int64]:
    """Numbers of the standard parameters of drives that are not negative. Shapes: -> (k,)."""
    f, n = base.model.f, base.model.n
    kinds = drive_kinds(base.drive)
    own = [k for k, kind in enumerate(kinds) if kind is not DriveKind.OFFSET]
    starts = [np.arange(10 * f + n * k, 10 * f + n * k + n) for k in own]
    starts += [np.arange(start, start + n * count) for start, count, _ in _frictions(base)]
    return np.concatenate((*starts, np.zeros(0))).astype(np.int64)


def drive_constraints(base: BaseParameters, unit: Array) -> tuple[Constraint, ...]:
    """Constraints of drive and friction parameters. Shapes: unit (p,)."""
    p, names = len(unit), base.parameter_names
    positive = positive_drives(base)
    signs = np.zeros((len(positive), p))
    signs[np.arange(len(positive)), positive] = -1.0 / unit[positive]
    sentences = [f"{names[k]} is zero." for k in positive.tolist()]
    more = [-dry_rows(base)]
    for row in more[0]:
        joined = " and ".join(names[k] for k in np.flatnonzero(row))
        sentences.append(f"Dry friction of {joined} together takes no energy.")
    for start, _, stribeck in _frictions(base):
        if stribeck:  # its curve falls from Fs to Fc
            n = base.model.n
            falls = np.zeros((n, p))
            falls[np.arange(n), np.arange(start + n, start + 2 * n)] = 1.0
            falls[np.arange(n), np.arange(start + 2 * n, start + 3 * n)] = -1.0
            more.append(falls)
            sentences += [f"Fs{j + 1} of Stribeck's curve is its Fc{j + 1}." for j in range(n)]
    rows = np.concatenate(more)
    rows /= np.maximum(np.abs(rows * unit).max(axis=1, initial=0.0), 1e-300)[:, None]
    rows = np.concatenate((signs, rows))
    found = [Constraint(Cone.NONNEGATIVE, rows, np.zeros(len(rows)), tuple(sentences))]
    for block in coupled_blocks(base):
        rows = -block.triangle(unit)
        joined = ", ".join(
            names[k] for k in (*block.diagonal.tolist(), *(k for k, _ in block.couplings))
        )
        said = (f"The matrix of coupled motors with {joined} is singular.",)
        found.append(Constraint(Cone.SEMIDEFINITE, rows, np.zeros(len(rows)), said))
    return tuple(found)


def _frictions(base: BaseParameters) -> list[tuple[int, int, bool]]:
    """Of each part of the friction model that takes energy: start, kinds, whether Stribeck's."""
    if base.friction is None:
        return []
    n = base.model.n
    parts: tuple[Friction, ...] = (base.friction,)
    if isinstance(base.friction, FrictionSum):
        parts = base.friction.parts
    counts = [len(part.kinds) for part in parts]  # type: ignore[attr-defined]
    start, found = len(base.parameter_names) - n * sum(counts), []
    for part, count in zip(parts, counts, strict=True):
        if isinstance(part, _DISSIPATIVE):
            found.append((start, count, isinstance(part, StribeckFriction)))
        start += n * count
    return found
