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
    """Independent columns, and what a great tolerance has left out.

    Parameters
    ----------
    basis : ColumnBasis
        Columns that are kept, with distances relative to the longest of all: what decided.
    neglected : tuple of str
        Parameters that torques show, though less than the tolerance.
    """

    basis: ColumnBasis
    neglected: tuple[str, ...]


def with_clear_gap(W: Array, scale: Array, tolerance: float, basis: ColumnBasis) -> ColumnBasis:
    """The columns with the line moved to the widest gap near the tolerance, if it is in none.

    Parameters
    ----------
    W : ndarray, shape (N, p)
        The regressor, or a factor of it.
    scale : ndarray, shape (p,)
        Natural sizes of the parameters.
    tolerance : float
        Where the line is by default.
    basis : ColumnBasis
        What that gives.

    Returns
    -------
    ColumnBasis
        Another one if there is a gap within a factor of 30 of the tolerance, else the same.

    Examples
    --------
    >>> W = np.diag([1.0, 1e-9, 3e-11, 8e-12, 1e-16])
    >>> at_tolerance = column_basis(W, nothing=1e-11)
    >>> len(at_tolerance.kept), len(with_clear_gap(W, np.ones(5), 1e-11, at_tolerance).kept)
    (3, 4)
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
    """A sentence where there is no clear gap, with the parameters that it concerns.

    Parameters
    ----------
    names : sequence of str, length p
        Standard parameters.
    basis : ColumnBasis
        Distances relative to the longest column.
    tolerance : float
        What counted as nothing.
    logged : bool
        Whether a richer motion could help.

    Returns
    -------
    tuple of str
        Empty where the gap is clear.

    Examples
    --------
    >>> basis = column_basis(np.diag([1.0, 3e-11, 8e-12]))
    >>> doubts(["ZZ1", "ZZ2", "ZZ3"], basis, 1e-11, True)[0][:60]
    'No clear gap: ZZ2 is kept with 3.0e-11 of the largest torque'
    """
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
    """A sentence where a log shows fewer parameters than motion can.

    Parameters
    ----------
    names : sequence of str, length p
        Standard parameters.
    kept, whole : ndarray of int
        What the log shows, and what random motion does.

    Returns
    -------
    tuple of str
        Empty where it shows all.

    Examples
    --------
    >>> unseen(["ZZ1", "Fv1"], np.array([1]), np.array([0, 1]))
    ('This motion shows 1 of the 2 base parameters; not kept: ZZ1.',)
    """
    if len(kept) >= len(whole):
        return ()
    missing = np.setdiff1d(whole, kept)
    return (
        f"This motion shows {len(kept)} of the {len(whole)} base parameters; not kept: "
        f"{_listed(names, missing)}.",
    )


def miss(missed: float, tolerance: float) -> tuple[str, ...]:
    """A sentence where torques are not kept.

    Examples
    --------
    >>> miss(1e-14, 1e-11)
    ()
    """
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
