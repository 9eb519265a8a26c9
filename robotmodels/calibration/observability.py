"""Observability indices of an identification matrix: five functions of its singular values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, as_exact, as_floats
from ..errors import InvalidValueError, ShapeError
from .identifiable import IdentifiableParameters

_RANK_TOLERANCE = 1e-14  # A singular value below this part of the largest is zero


class Criterion(Enum):
    """The index to maximise; the value is its formula."""

    O1 = "(s_1 ... s_L)^(1/L) / sqrt(m)"
    O2 = "s_L / s_1"
    O3 = "s_L"
    O4 = "s_L^2 / s_1"
    O5 = "1 / (1/s_1 + ... + 1/s_L)"


@dataclass(frozen=True, slots=True, eq=False)
class Observability(Frozen):
    """The five observability indices (`Criterion`), of m configurations; larger is better for all.

    Parameters
    ----------
    o1, o2, o3, o4, o5 : float
        Volume of the ellipsoid of the effects of errors; its inverse condition (its shape); its
        shortest axis, the worst combination of parameters; noise amplification index; the harmonic
        mean of the axes, divided by L.
    singular_values : ndarray, shape (L,)
        s_1 >= ... >= s_L, of the scaled matrix.
    configurations : int
        m.
    """

    o1: float
    o2: float
    o3: float
    o4: float
    o5: float
    singular_values: Array
    configurations: int

    @property
    def condition(self) -> float:
        """``s_1 / s_L``; infinite if a combination of the parameters is unidentifiable."""
        return 1.0 / self.o2 if self.o2 > 0.0 else np.inf

    def value(self, criterion: Criterion) -> float:
        """Index of a criterion."""
        return float(getattr(self, criterion.name.lower()))

    def __str__(self) -> str:
        return ", ".join(f"{c.name} {self.value(c):.4g}" for c in Criterion) + (
            f" ({len(self.singular_values)} parameters, {self.configurations} configurations)"
        )


def observability(
    psi: ArrayLike | IdentifiableParameters,
    configurations: int | None = None,
    *,
    scales: ArrayLike | None = None,
) -> Observability:
    """Observability indices O1 to O5 of an identification matrix (also: excitation indices).

    O1 orders sets of configurations in the same way whatever the units of the parameters; the
    others do not, so give comparable columns: ``scales`` are sizes of the parameters that count as
    equal (their expected errors, for instance), by which columns are multiplied. Rows of different
    units should be divided by their standard errors before.

    Parameters
    ----------
    psi : array_like, shape (m, k, L) or (M, L), or IdentifiableParameters
        Rows of m configurations, k each, or all rows together. For identifiable parameters: those
        kept, fixtures eliminated.
    configurations : int, optional
        m; default the first axis of ``psi`` (M rows count as M configurations).
    scales : array_like, shape (L,), optional
        Sizes of the parameters; default 1.

    Returns
    -------
    Observability
        The indices.

    References
    ----------
    O1: J.-H. Borm, C.-H. Menq, Int. J. Robotics Research 10(1), 1991. O2: M. R. Driels, U. S.
    Pathre, J. Robotic Systems 7(2), 1990. O3, O4: A. Nahvi, J. M. Hollerbach, IEEE ICRA 1996. O5:
    Y. Sun, J. M. Hollerbach, IEEE ICRA 2008. Seed book section 1.4.4.

    Examples
    --------
    >>> found = observability(np.diag([4.0, 2.0, 1.0]), 1)
    >>> found.o1, found.o2, found.o3, found.o4, round(found.o5, 4)
    (2.0, 0.25, 1.0, 0.25, 0.5714)
    """
    if isinstance(psi, IdentifiableParameters):
        configurations = psi.configurations if configurations is None else configurations
        psi = psi.factor
    W = as_floats(psi, "psi")
    if W.ndim not in (2, 3) or not W.size:
        raise ShapeError(f"psi: expected shape (M, L) or (m, k, L), none of them 0, got {W.shape}.")
    m = len(W) if configurations is None else configurations
    if isinstance(m, bool) or int(m) != m or m < 1:
        raise InvalidValueError(f"configurations: expected a whole number from 1, got {m!r}.")
    W = W.reshape(-1, W.shape[-1])
    if scales is not None:
        sizes = as_exact(scales, (W.shape[1],), "scales")
        if not (sizes > 0.0).all():
            raise InvalidValueError("scales: expected positive sizes of the parameters.")
        W = W * sizes
    s = np.zeros(W.shape[1])
    values = np.linalg.svd(W, compute_uv=False)
    s[: len(values)] = values
    s[s <= _RANK_TOLERANCE * s[0]] = 0.0
    return of_singular_values(s, int(m))


def of_singular_values(s: Array, configurations: int) -> Observability:
    """Observability indices of given singular values. Shapes: s (L,)."""
    first, last = float(s[0]), float(s[-1])
    regular = last > 0.0
    return Observability(
        o1=float(np.exp(np.log(s).mean()) / np.sqrt(configurations)) if regular else 0.0,
        o2=last / first if regular else 0.0,
        o3=last,
        o4=last**2 / first if regular else 0.0,
        o5=float(1.0 / (1.0 / s).sum()) if regular else 0.0,
        singular_values=s,
        configurations=configurations,
    )
