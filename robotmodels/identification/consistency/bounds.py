"""Bounds on masses and centres of mass that a physically consistent fit keeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_exact, as_reals, read_only
from ...errors import InvalidValueError, ShapeError
from ...estimation.conic import Cone, Constraint

_AXES = "xyz"
_ROTATED = 1e-9
"""Deviation from a rotation that is rounding."""


@dataclass(frozen=True, slots=True, eq=False, init=False)
class CentreBox(Rebuilt):
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
    >>> CentreBox(2, [0, -0.1, -0.1], [0.4, 0.1, 0.1]).link
    2
    """

    link: int
    low: Array
    high: Array

    def __init__(self, link: int, low: ArrayLike, high: ArrayLike) -> None:
        object.__setattr__(self, "link", int(link))
        for name, given in (("low", low), ("high", high)):
            value = as_reals(given, name)
            if value.shape != (3,):
                raise ShapeError(f"{name}: expected shape (3,), got {value.shape}.")
            object.__setattr__(self, name, read_only(value))
        finite = (self.low < np.inf).all() and (self.high > -np.inf).all()
        if not (finite and (self.low <= self.high).all()):
            raise InvalidValueError(
                f"CentreBox of link {self.link}: low must not be above high, got {self.low} and "
                f"{self.high}; both in metres, in frame R_{self.link}."
            )

    def constraints(self, unit: Array) -> list[Constraint]:
        """``low M <= [MX MY MZ] <= high M`` for parameters of these natural sizes (p,)."""
        first = 10 * (self.link - 1)
        found = []
        said = f"centre of mass of link {self.link}"
        for k, axis in enumerate(_AXES):
            low, high = float(self.low[k]), float(self.high[k])
            sides = [(low, -1.0, "lower"), (high, 1.0, "upper")]
            if low == high:
                sides = [(low, 1.0, "known")]
            for value, sign, side in sides:
                if not np.isfinite(value):
                    continue
                row = np.zeros(len(unit))
                row[first + 6 + k], row[first + 9] = sign, -sign * value
                known = side == "known"
                where = "known" if known else f"at its {side} bound"
                sentence = f"The {said} along {axis} is {where}, {value:.6g} m."
                cone = Cone.ZERO if known else Cone.NONNEGATIVE
                found.append(_row(cone, row, 0.0, unit, sentence))
        return found


@dataclass(frozen=True, slots=True, eq=False, init=False)
class CentreEllipsoid(Rebuilt):
    """The centre of mass of a link lies in an ellipsoid.

    Parameters
    ----------
    link : int
        Frame number, 1..f.
    centre : array_like, shape (3,)
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
    >>> CentreEllipsoid(1, [0.1, 0, 0], [0.2, 0.1, 0.1]).semi_axes
    array([0.2, 0.1, 0.1])
    """

    link: int
    centre: Array
    semi_axes: Array
    rotation: Array

    def __init__(
        self,
        link: int,
        centre: ArrayLike,
        semi_axes: ArrayLike,
        rotation: ArrayLike | None = None,
    ) -> None:
        object.__setattr__(self, "link", int(link))
        for name, given in (("centre", centre), ("semi_axes", semi_axes)):
            object.__setattr__(self, name, read_only(as_exact(given, (3,), name)))
        if (self.semi_axes <= 0.0).any():
            raise InvalidValueError(
                f"semi_axes: expected positive lengths in metres, got {self.semi_axes}; a "
                "CentreBox holds a coordinate at a known value."
            )
        R = np.eye(3) if rotation is None else as_exact(rotation, (3, 3), "rotation")
        if np.abs(R.T @ R - np.eye(3)).max() > _ROTATED:
            raise InvalidValueError(
                f"rotation: expected perpendicular unit vectors in its columns, got\n{R}"
            )
        object.__setattr__(self, "rotation", read_only(R))

    def constraints(self, unit: Array) -> list[Constraint]:
        """``|diag(1/a) R^T ([MX MY MZ] - c M)| <= M`` for parameters of these sizes (p,)."""
        first = 10 * (self.link - 1)
        rows = np.zeros((4, len(unit)))
        rows[0, first + 9] = -1.0
        inward = (self.rotation / self.semi_axes).T
        rows[1:, first + 6 : first + 9] = -inward
        rows[1:, first + 9] = inward @ self.centre
        rows /= unit[first + 9]
        said = f"The centre of mass of link {self.link} is on the surface of its ellipsoid."
        return [Constraint(Cone.SECOND_ORDER, rows, np.zeros(4), (said,))]


CentreBound = CentreBox | CentreEllipsoid


def mass_constraints(
    f: int, unit: Array, mass_bounds: ArrayLike | None, total_mass: ArrayLike | None
) -> list[Constraint]:
    """Bounds on the masses of links and on their sum.

    Shapes: unit (p,), mass_bounds (f, 2), total_mass (2,).
    """
    found: list[Constraint] = []
    if mass_bounds is not None:
        bounds = as_reals(mass_bounds, "mass_bounds")
        if bounds.shape != (f, 2):
            raise ShapeError(
                f"mass_bounds: expected shape ({f}, 2), the least and the greatest mass of each "
                f"link in kg (-inf and inf where there is none), got {bounds.shape}."
            )
        for j, (low, high) in enumerate(bounds.tolist()):
            row = np.zeros(len(unit))
            row[10 * j + 9] = 1.0
            found += _interval(row, low, high, unit, f"mass of link {j + 1}", "mass_bounds")
    if total_mass is not None:
        total = as_reals(total_mass, "total_mass")
        if total.shape not in ((), (2,)):
            raise ShapeError(
                "total_mass: expected a number, or the least and the greatest in kg, got shape "
                f"{total.shape}."
            )
        low, high = np.broadcast_to(total, (2,)).tolist()
        row = np.zeros(len(unit))
        row[9 : 10 * f : 10] = 1.0
        found += _interval(row, low, high, unit, "mass of all links", "total_mass")
    return found


def centre_constraints(f: int, unit: Array, bounds: Sequence[CentreBound]) -> list[Constraint]:
    """Bounds on the centres of mass. Shapes: unit (p,)."""
    found: list[Constraint] = []
    for bound in bounds:
        if not isinstance(bound, (CentreBox, CentreEllipsoid)):
            raise InvalidValueError(
                f"centre_bounds: expected CentreBox or CentreEllipsoid, got {type(bound).__name__}."
            )
        if not 1 <= bound.link <= f:
            raise InvalidValueError(
                f"centre_bounds: there is no link {bound.link}; they are numbered 1 to {f}."
            )
        found += bound.constraints(unit)
    return found


def _interval(
    row: Array, low: float, high: float, unit: Array, what: str, name: str
) -> list[Constraint]:
    if not (low <= high and high > 0.0 and low < np.inf):
        raise InvalidValueError(
            f"{name}: expected a least {what} that is not above the greatest, and that one "
            f"positive, got {low} and {high} kg."
        )
    if low == high:
        return [_row(Cone.ZERO, row, low, unit, f"The {what} is known, {low:.6g} kg.")]
    found = []
    if np.isfinite(low):
        said = f"The {what} is at its lower bound, {low:.6g} kg."
        found.append(_row(Cone.NONNEGATIVE, -row, -low, unit, said))
    if np.isfinite(high):
        said = f"The {what} is at its upper bound, {high:.6g} kg."
        found.append(_row(Cone.NONNEGATIVE, row, high, unit, said))
    return found


def _row(cone: Cone, row: Array, right: float, unit: Array, sentence: str) -> Constraint:
    """One row in units that make its largest term of order one."""
    scale = 1.0 / float(np.abs(row * unit).max())
    return Constraint(cone, row[None] * scale, np.array([right * scale]), (sentence,))
