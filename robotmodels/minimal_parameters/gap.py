"""Where the line between kept columns and the others is drawn, and whether it is clear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..estimation import ColumnBasis, column_basis

CLEAR = 100.0
"""Ratio of the least that is kept to the most that is left out, from which there is a gap."""
_BAND = 30.0
"""Factor about the tolerance within which the line goes to the widest gap of a log."""
_ROUNDING = 1e-16
_FEW = 8
_MISSED = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class FoundColumns:
    """Independent columns, and the columns that a larger tolerance leaves out."""

    basis: ColumnBasis
    neglected: tuple[str, ...]


def with_clear_gap(W: Array, scale: Array, tolerance: float, basis: ColumnBasis) -> ColumnBasis:
    """Column basis with the tolerance moved to the widest gap near it.

    Shapes: W (N, p), scale (p,).
    """
    if ratio(basis) >= CLEAR:
        return basis
    left = np.sort(basis.distance)[::-1]
    left = np.maximum(np.append(left, 0.0), _ROUNDING)
    lowest, highest = tolerance / _BAND, min(tolerance * _BAND, 0.5)
    cuts = [
        (above / below, min(max(sqrt(above * below), lowest), highest))
        for above, below in pairwise(left)
        if above > lowest and below < highest and above > below
    ]
    for width, cut in sorted(cuts, reverse=True):
        if width < CLEAR:
            break
        again = column_basis(W, None, scale, cut)
        if ratio(again) >= CLEAR:
            return again
    return basis


def ratio(basis: ColumnBasis) -> float:
    """Least that is kept over most that is left out."""
    kept, other = basis.gap
    return kept / max(other, _ROUNDING)


def doubts(
    names: Sequence[str], basis: ColumnBasis, tolerance: float, logged: bool
) -> tuple[str, ...]:
    """Warning where the rank has no clear gap, with the parameters concerned."""
    kept, other = basis.gap
    if ratio(basis) >= CLEAR:
        return ()
    is_kept = np.zeros(len(names), dtype=bool)
    is_kept[basis.kept] = True
    near = np.where(
        is_kept, basis.distance < CLEAR * other, basis.distance > max(kept / CLEAR, _ROUNDING)
    )
    least = names[_first(is_kept, basis.distance == kept)]
    most = names[_first(~is_kept, basis.distance == other)]
    advice = "A richer motion tells; or say" if logged else "Say"
    return (
        f"No clear gap: {least} is kept with {kept:.1e} of the largest torque beyond the others, "
        f"{most} left out with {other:.1e}. In doubt: {_listed(names, np.flatnonzero(near))}. "
        f"{advice} by tolerance (here {tolerance:.0e}) what counts as nothing.",
    )


def unseen(
    names: Sequence[str], kept: NDArray[np.int64], whole: NDArray[np.int64]
) -> tuple[str, ...]:
    """Warning where a log shows fewer parameters than random motion."""
    if len(kept) >= len(whole):
        return ()
    missing = np.setdiff1d(whole, kept)
    return (
        f"This motion shows {len(kept)} of the {len(whole)} base parameters; not kept: "
        f"{_listed(names, missing)}.",
    )


def miss(missed: float, tolerance: float) -> tuple[str, ...]:
    """Warning where the base parameters do not reproduce the torques."""
    if missed <= max(_MISSED, CLEAR * tolerance):
        return ()
    return (
        f"NOT TO BE USED: these base parameters miss {missed:.1e} of the torques of another "
        "motion. Lengths or angles of the table lie where rounding decides; check them.",
    )


def _first(own: NDArray[np.bool_], wanted: NDArray[np.bool_]) -> int:
    return int(np.flatnonzero(own & wanted)[0])


def _listed(names: Sequence[str], numbers: NDArray[np.int64]) -> str:
    few = ", ".join([names[int(k)] for k in numbers[:_FEW]])
    return few + (f" and {len(numbers) - _FEW} more" if len(numbers) > _FEW else "")
