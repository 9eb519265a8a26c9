"""Constraints of physical robots, affine in the standard parameters x: drives, masses, centres.

Sources: P. Wensing, S. Kim and J.-J. Slotine, IEEE RA-L 3(1), 2018; C. Sousa and R. Cortesao, IJRR
33(6), 2014.

Parameters
----------
link : int
    Frame number of a link, 1..f.
low, high : array_like, shape (3,)
    Corners in frame R_j, metres; infinite where there is no bound, equal where it is known.
center, semi_axes : array_like, shape (3,)
    Centre in frame R_j and half lengths, metres.
rotation : array_like, shape (3, 3), optional
    Its columns are the directions of the axes in R_j; default the axes of R_j.

Examples
--------
>>> CenterOfMassBox(2, [0, -0.1, -0.1], [0.4, 0.1, 0.1]).link
2
>>> CenterOfMassEllipsoid(1, [0.1, 0, 0], [0.2, 0.1, 0.1]).semi_axes
array([0.2, 0.1, 0.1])
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_each, as_exact, as_reals, read_only
from ..errors import InvalidValueError, ShapeError
from ..regressors.columns import standard_blocks
from .result import BaseParameters

_INSIDE = 1e-9
"""Smallest eigenvalue of matrices in the solver's units: margin for its rounding."""
_POSITIVE = ("Ia", "Fv", "Fc", "Fvp", "Fcp", "Fvn", "Fcn", "Fs")
"""Kinds of drive and friction parameters that are not negative."""


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """Standard parameters x with ``rows @ x + offset`` in a cone. Shapes: rows (k, p), offset (k,).

    The cone: zero, non-negative numbers, or a positive semidefinite matrix, row by row. A sentence
    for each number, or one for the matrix, whose eigenvalues may be negative up to the allowance.
    """

    cone: Literal["zero", "nonnegative", "semidefinite"]
    rows: Array
    offset: Array
    sentences: tuple[str, ...]
    allowance: float = 0.0

    def about(self, x: Array, scale: Array) -> Constraint:
        """The same on ``z``, for the parameters ``x + scale @ z``."""
        return replace(self, rows=self.rows @ scale, offset=self.rows @ x + self.offset)

    def slack(self, x: Array) -> Array:
        """Distance to the boundary, one for each sentence; negative outside."""
        s = self.rows @ x + self.offset
        if self.cone == "semidefinite":
            k = round(len(s) ** 0.5)
            return np.asarray(np.linalg.eigvalsh(s.reshape(k, k))[:1], dtype=np.float64)
        return s if self.cone == "nonnegative" else -np.abs(s)

    def inside(self, x: Array) -> Array:
        """Parameters with a multiple of 1 added to the matrix where its slack is negative."""
        slack = float(self.slack(x)[0])
        if slack >= -self.allowance:
            return x
        one = np.eye(round(len(self.offset) ** 0.5)).ravel()
        return x - slack * np.linalg.lstsq(self.rows, one, rcond=None)[0]

    def stated(self, cp: Any, x: Any, size: float, part: float) -> Any:
        """The constraint on ``size * x``, divided by size; matrices with a part of allowance."""
        s = self.rows @ x + self.offset / size
        if self.cone == "semidefinite":
            k = round(len(self.offset) ** 0.5)
            least = _INSIDE + part * self.allowance / size
            return cp.reshape(s, (k, k), order="C") >> least * np.eye(k)
        return s >= 0 if self.cone == "nonnegative" else s == 0


# --- drives --------------------------------------------------------------------------------------


def numbers_by_kind(base: BaseParameters) -> dict[str, NDArray[np.int64]]:
    """Numbers of the standard parameters of each kind: links, ``Ia``, ``Iam``, ``Fs``, ..."""
    blocks = standard_blocks(base.model, base.drive, base.friction)
    ends = np.cumsum([len(names) for names in blocks.values()])
    kinds = zip(blocks.items(), ends.tolist(), strict=True)
    return {kind: np.arange(end - len(names), end) for (kind, names), end in kinds}


def positive_drives(base: BaseParameters) -> NDArray[np.int64]:
    """Numbers of the nonnegative standard parameters of drives. Shapes: -> (k,)."""
    numbers = [kind for name, kind in numbers_by_kind(base).items() if name in _POSITIVE]
    return np.sort(np.concatenate(numbers)) if numbers else np.zeros(0, dtype=np.int64)


def drive_constraints(base: BaseParameters, unit: Array) -> Iterator[Constraint]:
    """Dissipativity of drives, for parameters of these natural sizes (p,)."""
    names, kinds, K = base.parameter_names, numbers_by_kind(base), base.model.transmission
    rows: list[dict[int, float]] = [{k: 1.0} for k in positive_drives(base).tolist()]
    sentences = [f"{names[k]} is zero." for row in rows for k in row]
    weights = np.zeros((0, base.model.n))
    if K is not None and K.coupled_motors:
        weights = K.weights[np.array(K.coupled_motors) - 1]
    if "Fcm" in kinds:  # dry friction of coupled motors
        for m, j in zip(*np.nonzero(weights), strict=True):
            rows.append({int(kinds["Fc"][j]): 1.0, int(kinds["Fcm"][m]): abs(float(weights[m, j]))})
            both = " and ".join(names[k] for k in rows[-1])
            sentences.append(f"Dry friction of {both} together dissipates no energy.")
    if "Fs" in kinds:  # the Stribeck curve decreases from Fs
        for static, coulomb in zip(kinds["Fs"].tolist(), kinds["Fc"].tolist(), strict=True):
            rows.append({static: 1.0, coulomb: -1.0})
            sentences.append(f"{names[static]} of Stribeck's curve is its {names[coulomb]}.")
    if rows:
        matrix = np.zeros((len(rows), len(unit)))
        for i, row in enumerate(rows):
            matrix[i, list(row)] = list(row.values())
        matrix /= np.abs(matrix * unit).max(axis=1)[:, None]
        yield Constraint("nonnegative", matrix, np.zeros(len(rows)), tuple(sentences))
    # matrices of rotor inertia and of viscous friction of the joints that motors couple
    joints = np.flatnonzero(weights.any(axis=0))
    for kind in ("Ia", "Fv"):
        if f"{kind}m" in kinds:
            numbers, motors, k = kinds[kind][joints], kinds[f"{kind}m"], len(joints)
            D = np.diag(unit[numbers] ** -0.5)
            matrix = np.zeros((k * k, len(unit)))
            matrix[np.arange(k) * (k + 1), numbers] = 1.0 / unit[numbers]
            for motor, w in zip(motors.tolist(), weights[:, joints], strict=True):
                matrix[:, motor] = (D @ (np.outer(w, w) - np.diag(w**2)) @ D).ravel()
            several = ", ".join(names[number] for number in (*numbers, *motors))
            sentence = f"The matrix of coupled motors with {several} is singular."
            yield Constraint("semidefinite", matrix, np.zeros(k * k), (sentence,))


# --- masses and centres of mass ------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class CenterOfMassBox(Rebuilt):
    """The centre of mass of a link lies in a box along the axes of its frame."""

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
        if not all(_is_interval(*ends) for ends in zip(self.low, self.high, strict=True)):
            raise InvalidValueError(
                f"CenterOfMassBox of link {self.link}: low must not be above high, got {self.low} "
                f"and {self.high}; both in metres, in frame R_{self.link}."
            )

    def constraints(self, unit: Array) -> Iterator[Constraint]:
        """``low M <= [MX MY MZ] <= high M`` for parameters of these natural sizes (p,)."""
        *moments, mass = np.eye(len(unit))[10 * self.link - 4 : 10 * self.link]
        for row, axis, low, high in zip(moments, "xyz", self.low, self.high, strict=True):
            name = f"centre of mass of link {self.link} along {axis}"
            yield from _interval(row, low, high, unit, name, mass)


@dataclass(frozen=True, slots=True, eq=False)
class CenterOfMassEllipsoid(Rebuilt):
    """The centre of mass of a link lies in an ellipsoid."""

    link: int
    center: Any
    semi_axes: Any
    rotation: Any = ((1, 0, 0), (0, 1, 0), (0, 0, 1))

    def __post_init__(self) -> None:
        object.__setattr__(self, "link", int(self.link))
        for name, shape in (("center", (3,)), ("semi_axes", (3,)), ("rotation", (3, 3))):
            object.__setattr__(self, name, read_only(as_exact(getattr(self, name), shape, name)))
        lengths, R = self.semi_axes, self.rotation
        if not ((lengths > 0.0).all() and np.allclose(R.T @ R, np.eye(3), rtol=0.0, atol=1e-9)):
            raise InvalidValueError(
                f"CenterOfMassEllipsoid of link {self.link}: expected positive semi_axes in metres "
                f"and perpendicular unit vectors as columns of rotation, got {lengths} and\n{R}"
            )

    def constraints(self, unit: Array) -> Iterator[Constraint]:
        """``|diag(1/a) R^T ([MX MY MZ] - c M)| <= M`` for parameters of these sizes (p,)."""
        mass, rows = 10 * self.link - 1, np.zeros((4, 4, len(unit)))
        inward = (self.rotation / self.semi_axes).T
        rows[3, :3, mass - 3 : mass] = inward
        rows[3, :3, mass] = -inward @ self.center
        rows += rows.swapaxes(0, 1)
        rows[range(4), range(4), mass] = 1.0  # smallest eigenvalue: M less the norm above
        sentence = f"The centre of mass of link {self.link} is on the surface of its ellipsoid."
        rows = rows.reshape(16, -1) / unit[mass]
        yield Constraint("semidefinite", rows, np.zeros(16), (sentence,))


CenterOfMassBound = CenterOfMassBox | CenterOfMassEllipsoid


def mass_constraints(
    f: int,
    unit: Array,
    mass_bounds: ArrayLike | None,
    total_mass: ArrayLike | None,
    centre_bounds: Sequence[CenterOfMassBound],
) -> Iterator[Constraint]:
    """Bounds on masses (f, 2), on their sum (2,) and on centres of mass. Shapes: unit (p,)."""
    masses = np.arange(9, 10 * f, 10)
    intervals = []
    if mass_bounds is not None:
        bounds = as_reals(mass_bounds, "mass_bounds")
        if bounds.shape != (f, 2):
            raise ShapeError(
                f"mass_bounds: expected shape ({f}, 2), the least and the greatest mass of each "
                f"link in kg (-inf and inf where there is none), got {bounds.shape}."
            )
        intervals += [(masses[[j]], *bounds[j], f"mass of link {j + 1}") for j in range(f)]
    if total_mass is not None:
        intervals.append((masses, *as_each(total_mass, 2, "total_mass"), "total mass of all links"))
    for numbers, low, high, name in intervals:
        if not (_is_interval(low, high) and high > 0.0):
            raise InvalidValueError(
                f"{name}: expected a least value that is not above the greatest, and a positive "
                f"greatest value, got {low} and {high} kg."
            )
        row = np.zeros(len(unit))
        row[numbers] = 1.0
        yield from _interval(row, low, high, unit, name)
    for bound in centre_bounds:
        if not (isinstance(bound, CenterOfMassBound) and 1 <= bound.link <= f):
            raise InvalidValueError(
                "centre_bounds: expected CenterOfMassBox or CenterOfMassEllipsoid of links 1 to "
                f"{f}, got {bound!r:.80}."
            )
        yield from bound.constraints(unit)


def _is_interval(low: float, high: float) -> bool:
    """Whether there are finite numbers between two, NaN excluded."""
    return bool(low <= high and low < np.inf and high > -np.inf)


def _interval(
    row: Array, low: float, high: float, unit: Array, name: str, mass: Array | None = None
) -> Iterator[Constraint]:
    """``low <= row @ x <= high``, or relative to a mass; scaled to terms of order one."""
    sides = [(low, 1.0, "at its lower bound"), (high, -1.0, "at its upper bound")]
    for value, sign, side in [(low, 1.0, "known")] if low == high else sides:
        if np.isfinite(value):
            one, offset = (row, -value) if mass is None else (row - value * mass, 0.0)
            scale = sign / float(np.abs(one * unit).max())
            sentence = f"The {name} is {side}, {value:.6g} {'kg' if mass is None else 'm'}."
            cone = "zero" if low == high else "nonnegative"
            yield Constraint(cone, scale * one[None], np.array([scale * offset]), (sentence,))
