"""Inertial parameters of the links, in Khalil's order and frames.

Book section 1.5.2.1: the ten standard parameters of link j are the inertia tensor about the
origin O_j, the first moments and the mass, all in the axes of frame R_j.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import LARGEST, Array, Value, as_bounded, as_exact, read_only
from ..errors import InertiaError, ShapeError
from ..geometry import DHTable
from ..table_text import boxed
from .consistency import ConsistencyReport, link_finding

PARAMETERS = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
"""Names of the ten standard parameters of a link, in order."""


@dataclass(frozen=True, slots=True, init=False, eq=False)
class InertialParameters(Value):
    """Standard inertial parameters of every frame.

    Any real values are allowed: base parameters have first moments with zero mass, identified ones
    may not be physical. `is_physical` and `consistency` check the physical consistency;
    ``print`` shows them as a table with the problems of the links below.

    Parameters
    ----------
    values : array_like, shape (f, 10)
        Rows ``XX XY XZ YY YZ ZZ MX MY MZ M``: inertia about the origin O_j in the axes of R_j
        (kg m^2; products with the sign of the tensor's entries), first moments (kg m), mass (kg).
    """

    values: Array

    def __init__(self, values: ArrayLike) -> None:
        rows = as_bounded(values, "values", LARGEST)
        if rows.ndim != 2 or rows.shape[1] != 10:
            raise ShapeError(
                f"values: expected one row of ten parameters ({' '.join(PARAMETERS)}) for each "
                f"frame, shape (f, 10), got {rows.shape}."
            )
        object.__setattr__(self, "values", read_only(rows))

    @classmethod
    def zeros(cls, f: int) -> Self:
        """Parameters of ``f`` links without any inertia."""
        return cls(np.zeros((f, 10)))

    @classmethod
    def from_com(cls, mass: ArrayLike, com: ArrayLike, inertia: ArrayLike) -> Self:
        """Parameters from masses (f,), centres of mass (f, 3) and central tensors (f, 3, 3).

        All in the frames R_j, in kg, m and kg m^2. A negative mass and a tensor that is not
        symmetric are an `InertiaError`.

        Examples
        --------
        >>> InertialParameters.from_com([2.0], [[0.1, 0, 0]], [np.diag([0.1, 0.2, 0.3])]).values
        array([[0.1 , 0.  , 0.  , 0.22, 0.  , 0.32, 0.2 , 0.  , 0.  , 2.  ]])
        """
        mass = as_bounded(mass, "mass", LARGEST)
        if mass.ndim != 1:
            raise ShapeError(f"mass: expected shape (f,), got {mass.shape}.")
        f = mass.size
        com, tensor = as_exact(com, (f, 3), "com"), as_exact(inertia, (f, 3, 3), "inertia")
        for j in np.flatnonzero(mass < 0)[:1]:
            raise InertiaError(
                f"Link {j + 1}: a mass cannot be negative, got {mass[j]} kg. Identified sets that "
                "are not physical are given as InertialParameters(values)."
            )
        skewness = np.abs(tensor - np.swapaxes(tensor, 1, 2)).max(initial=0.0)
        if skewness > 1e-9 * np.abs(tensor).max(initial=0.0):
            raise InertiaError("inertia: tensors must be symmetric; check products of inertia.")
        S = se3.skew(com)
        about_origin = tensor - mass[:, None, None] * (S @ S)
        return cls(_vectors(about_origin, mass[:, None] * com, mass))

    @classmethod
    def from_standard(
        cls,
        rows: Iterable[Mapping[str, Any]],
        mass: ArrayLike,
        com: ArrayLike,
        inertia: ArrayLike,
        degrees: bool = False,
    ) -> Self:
        """Parameters published in classical (distal) link frames, moved to this table's frames.

        The classical frame of link j is ``R_j Trans(x, a_j) Rot(x, alpha_j)``, its table ``rows``
        as for `DHTable.from_standard`; masses, centres and tensors as for `from_com`, in it.
        """
        X = np.array([DHTable.from_standard([row], degrees)[1] for row in rows])
        return cls.from_com(mass, com, inertia).moved(X.reshape(-1, 4, 4))

    @property
    def f(self) -> int:
        """Number of frames."""
        return self.values.shape[0]

    @property
    def mass(self) -> Array:
        """Masses, shape (f,), kg."""
        return self.values[:, 9]

    @property
    def first_moments(self) -> Array:
        """First moments ``M * com``, shape (f, 3), kg m."""
        return self.values[:, 6:9]

    @property
    def tensors(self) -> Array:
        """Inertia tensors about the origins O_j, shape (f, 3, 3), kg m^2."""
        return self.values[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]

    @property
    def is_physical(self) -> NDArray[np.bool_]:
        """Physical consistency of each link, shape (f,): see `consistency`."""
        return np.array([finding.is_physical for finding in self.consistency().links], dtype=bool)

    def consistency(self) -> ConsistencyReport:
        """Check each link: mass, moments, triangle inequality, pseudo-inertia; print the report."""
        return ConsistencyReport(tuple(link_finding(j, row) for j, row in enumerate(self.values)))

    def __str__(self) -> str:
        report = self.consistency()
        columns = [("link", [str(link.link) for link in report.links])]
        columns += [
            (name, [f"{x:.4g}" for x in column + 0.0])
            for name, column in zip(PARAMETERS, self.values.T, strict=True)
        ]
        problems = [str(link) for link in report.links if not link.is_physical]
        return "\n".join([boxed(columns), *problems])

    def moved(self, T: ArrayLike) -> Self:
        """The same bodies in other frames; T (f, 4, 4) are the poses of the present ones in them.

        Linear in the values, so that M = 0 is allowed.
        """
        X = se3.as_pose(T, "T")
        if X.shape != (self.f, 4, 4):
            raise ShapeError(f"T: expected one pose per frame ({self.f}, 4, 4), got {X.shape}.")
        R, p = X[:, :3, :3], X[:, :3, 3]
        h = (R @ self.first_moments[:, :, None])[:, :, 0]
        P, H = se3.skew(p), se3.skew(h)
        m = self.mass[:, None]
        tensor = R @ self.tensors @ np.swapaxes(R, 1, 2) - (P @ H + H @ P) - m[:, :, None] * (P @ P)
        return type(self)(_vectors(tensor, h + m * p, self.mass))


def _vectors(tensor: Array, first: Array, mass: Array) -> Array:
    values = np.empty((mass.size, 10))
    values[:, :6] = tensor[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    values[:, 6:9] = first
    values[:, 9] = mass
    return values
