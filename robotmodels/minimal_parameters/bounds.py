"""Bounds on masses and centres of mass, as constraints of a physically consistent fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Rebuilt, as_exact, as_reals, read_only
from ..errors import InvalidValueError, ShapeError
from .constraints import Constraint

_ROTATED = 1e-9
"""Tolerance of a rotation matrix."""


@dataclass(frozen=True, slots=True, eq=False)
class CenterOfMassBox(Rebuilt):
    """The centre of mass of a link lies in a box along the axes of its frame.

    Parameters
    ----------
    link : int
        Frame number, 1..f.
    low, high : array_like, shape (3,)
        Corners in frame R_j, metres; infinite where there is no bound, equal where it is known.

    Raises
    ------
    ShapeError, InvalidValueError
        Corners of the wrong shape, NaN, or the wrong way round.

    Examples
    --------
    >>> CenterOfMassBox(2, [0, -0.1, -0.1], [0.4, 0.1, 0.1]).link
    2
    """

    link: int
    low: Any
    high: Any

    def __post_init__(self) -> None:
        object.__setattr__(self, "link", int(self.link))
        for name in ("low", "high"):
            value = as_reals(getattr(self, name), name)
            if value.shape != (3,):
                raise ShapeError(f"{name}: expected shape (3,), got {value.shape}.")
            object.__setattr__(self, name, read_only(value))
        low, high = self.low, self.high
        if not ((low < np.inf).all() and (high > -np.inf).all() and (low <= high).all()):
            raise InvalidValueError(
                f"CenterOfMassBox of link {self.link}: low must not be above high, got {low} and "
                f"{high}; both in metres, in frame R_{self.link}."
            )

    def constraints(self, unit: Array) -> list[Constraint]:
        """``low M <= [MX MY MZ] <= high M`` for parameters of these natural sizes (p,)."""
        *moments, mass = np.eye(len(unit))[10 * self.link - 4 : 10 * self.link]
        name = f"centre of mass of link {self.link} along"
        return [
            one
            for row, axis, low, high in zip(moments, "xyz", self.low, self.high, strict=True)
            for one in _interval(row, low, high, unit, f"{name} {axis}", mass)
        ]


@dataclass(frozen=True, slots=True, eq=False)
class CenterOfMassEllipsoid(Rebuilt):
    """The centre of mass of a link lies in an ellipsoid.

    Parameters
    ----------
    link : int
        Frame number, 1..f.
    center : array_like, shape (3,)
        In frame R_j, metres.
    semi_axes : array_like, shape (3,)
        Half lengths, metres, positive.
    rotation : array_like, shape (3, 3), optional
        Its columns are the directions of the axes in R_j; default the axes of R_j.

    Raises
    ------
    ShapeError, InvalidValueError
        Wrong shapes, NaN, lengths that are not positive, or no rotation.

    Examples
    --------
    >>> CenterOfMassEllipsoid(1, [0.1, 0, 0], [0.2, 0.1, 0.1]).semi_axes
    array([0.2, 0.1, 0.1])
    """

    link: int
    center: Any
    semi_axes: Any
    rotation: Any = ((1, 0, 0), (0, 1, 0), (0, 0, 1))

    def __post_init__(self) -> None:
        object.__setattr__(self, "link", int(self.link))
        for name, shape in (("center", (3,)), ("semi_axes", (3,)), ("rotation", (3, 3))):
            object.__setattr__(self, name, read_only(as_exact(getattr(self, name), shape, name)))
        lengths, R = self.semi_axes, self.rotation
        if (lengths <= 0.0).any():
            raise InvalidValueError(
                f"semi_axes: expected positive lengths in metres, got {lengths}; a "
                "CenterOfMassBox fixes a coordinate at a known value."
            )
        if np.abs(R.T @ R - np.eye(3)).max() > _ROTATED:
            raise InvalidValueError(
                f"rotation: expected perpendicular unit vectors in its columns, got\n{R}"
            )

    def constraints(self, unit: Array) -> list[Constraint]:
        """``|diag(1/a) R^T ([MX MY MZ] - c M)| <= M`` for parameters of these sizes (p,)."""
        first = 10 * (self.link - 1)
        rows = np.zeros((4, len(unit)))
        rows[0, first + 9] = 1.0
        inward = (self.rotation / self.semi_axes).T
        rows[1:, first + 6 : first + 9] = inward
        rows[1:, first + 9] = -inward @ self.center
        sentence = f"The centre of mass of link {self.link} is on the surface of its ellipsoid."
        return [Constraint("second_order", rows / unit[first + 9], np.zeros(4), (sentence,))]


CenterOfMassBound = CenterOfMassBox | CenterOfMassEllipsoid


def mass_constraints(
    f: int, unit: Array, mass_bounds: ArrayLike | None, total_mass: ArrayLike | None
) -> list[Constraint]:
    """Bounds on the masses of links (f, 2) and on their sum (2,). Shapes: unit (p,)."""
    constraints: list[Constraint] = []
    if mass_bounds is not None:
        bounds = as_reals(mass_bounds, "mass_bounds")
        if bounds.shape != (f, 2):
            raise ShapeError(
                f"mass_bounds: expected shape ({f}, 2), the least and the greatest mass of each "
                f"link in kg (-inf and inf where there is none), got {bounds.shape}."
            )
        for j, (low, high) in enumerate(bounds.tolist()):
            constraints += _mass_interval([10 * j + 9], low, high, unit, f"mass of link {j + 1}")
    if total_mass is not None:
        total = as_reals(total_mass, "total_mass")
        if total.shape not in ((), (2,)):
            raise ShapeError(
                "total_mass: expected a number, or the least and the greatest in kg, got shape "
                f"{total.shape}."
            )
        low, high = np.broadcast_to(total, (2,)).tolist()
        constraints += _mass_interval(
            range(9, 10 * f, 10), low, high, unit, "total mass of all links"
        )
    return constraints


def center_constraints(
    f: int, unit: Array, bounds: Sequence[CenterOfMassBound]
) -> list[Constraint]:
    """Bounds on the centres of mass. Shapes: unit (p,)."""
    for bound in bounds:
        if not isinstance(bound, (CenterOfMassBox, CenterOfMassEllipsoid)):
            raise InvalidValueError(
                "centre_bounds: expected CenterOfMassBox or CenterOfMassEllipsoid, got "
                f"{type(bound).__name__}."
            )
        if not 1 <= bound.link <= f:
            raise InvalidValueError(
                f"centre_bounds: there is no link {bound.link}; they are numbered 1 to {f}."
            )
    return [one for bound in bounds for one in bound.constraints(unit)]


def _mass_interval(
    numbers: Sequence[int], low: float, high: float, unit: Array, name: str
) -> list[Constraint]:
    """Bounds of a sum of masses, kg."""
    if not (low <= high and high > 0.0 and low < np.inf):
        raise InvalidValueError(
            f"{name}: expected a least value that is not above the greatest, and that one "
            f"positive, got {low} and {high} kg."
        )
    row = np.zeros(len(unit))
    row[list(numbers)] = 1.0
    return _interval(row, low, high, unit, name)


def _interval(
    row: Array, low: float, high: float, unit: Array, name: str, mass: Array | None = None
) -> list[Constraint]:
    """``low <= row @ x <= high``, or relative to a mass; scaled to terms of order one."""
    sides = [(low, 1.0, "at its lower bound"), (high, -1.0, "at its upper bound")]
    if low == high:
        sides = [(low, 1.0, "known")]
    constraints = []
    for value, sign, side in sides:
        if np.isfinite(value):
            one, offset = (row, -value) if mass is None else (row - value * mass, 0.0)
            scale = sign / float(np.abs(one * unit).max())
            sentence = f"The {name} is {side}, {value:.6g} {'kg' if mass is None else 'm'}."
            cone = "zero" if low == high else "nonnegative"
            offsets = np.array([scale * offset])
            constraints.append(Constraint(cone, scale * one[None], offsets, (sentence,)))
    return constraints
