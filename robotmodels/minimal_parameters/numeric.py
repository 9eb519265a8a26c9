"""Numerical base parameters: independent columns of a regressor, in Khalil's order.

Source: M. Gautier, "Numerical calculation of the base inertial parameters of robots", Journal of
Robotic Systems 8(4), 1991.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import DriveKind
from ..estimation import ColumnBasis, column_basis
from ..estimation.columns import NEGLIGIBLE
from ..estimation.factor import triangles_of
from ..friction import Friction, check_linear
from ..friction.protocols import basis_at
from ..geometry import PRISMATIC
from ..model import RobotModel
from ..regressors import parameter_names, torque_regressor, torque_regressor_chunks
from .rules import EARTH, reach

Samples = tuple[Array, Array, Array]
"""Positions, velocities and accelerations, each (N, n)."""

_ROWS_A_COLUMN, _PIECE, _CHECKED = 3, 1024, 40
"""Rows of random motion per column; samples per piece, and of the final check."""
_DECADES = 6.0
"""Number of velocity decades at which friction is evaluated."""
_SMALL_TORQUE = 1e-3
"""Zero tolerance of the torque of a friction parameter, SI units."""
_CLEAR = 100.0
"""Least ratio of smallest kept to largest dropped residual norm for a clear rank gap."""
_BAND = 30.0
"""Factor around the tolerance in which the widest rank gap of a log is searched."""
_ROUNDING, _WRONG = 1e-16, 1e-9
"""Rounding tolerances: residual norm of a column, relative torque error."""
_FEW = 8
"""Names listed in a note."""


@dataclass(frozen=True, eq=False)
class TorqueColumns:
    """Columns of the torques of a robot, on random motion or on samples.

    The torques are those of the free variables of a constraint, shape (n, u), where there is one.
    """

    model: RobotModel
    drive: tuple[DriveKind, ...]
    friction: Friction | None = None
    tolerance: float = NEGLIGIBLE
    samples: Samples | None = None
    constraint: Array | None = None

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The p standard parameters."""
        return parameter_names(self.model, self.drive, self.friction)

    @cached_property
    def sizes(self) -> Array:
        """Natural sizes (p,): robot of this size, unit mass, torques of its weight."""
        model, size = self.model, reach(self.model)
        slides = model.table.sigma[model.table.joint_rows] == PRISMATIC
        unit, rotor = np.where(slides, size, 1.0), np.where(slides, 1.0, size**2)
        rate = sqrt(EARTH / size)
        torque = rotor * unit * rate**2
        kinds = {"Ia": rotor, "Fv": rotor * rate, "Fc": torque, "offset": torque}
        couplings = {"Ia": size**2, "Fv": size**2 * rate, "Fc": size * EARTH}
        motors = 0 if model.transmission is None else len(model.transmission.coupled_motors)
        parts = [np.tile([size**2] * 6 + [size] * 3 + [1.0], model.f)]
        parts += [kinds[kind.value] for kind in self.drive]
        parts += [np.full(motors, couplings[k.value]) for k in self.drive if k.coupling is not None]
        if self.friction is not None:
            speeds = unit * rate * 10.0 ** -np.arange(0.0, _DECADES + 1.0)[:, None]
            speeds = np.concatenate((speeds, -speeds))
            angles = np.linspace(-np.pi, np.pi, len(speeds))[:, None] * np.ones(model.n)
            basis = np.abs(basis_at(check_linear(self.friction), speeds, angles))
            parts += list(torque / np.maximum(_SMALL_TORQUE, basis.max(axis=0)))
        return np.concatenate(parts)

    @cached_property
    def factor(self) -> Array:
        """Rows of the regressor (r, p), or a matrix with the same products of columns."""
        slides = self.model.table.sigma[self.model.table.joint_rows] == PRISMATIC
        units = np.where(slides, reach(self.model), 1.0)
        samples = self._random_motion(units) if self.samples is None else self.samples
        chunks = torque_regressor_chunks(
            self.model, *samples, drive=self.drive, size=_PIECE, friction=self.friction
        )
        G = self.constraint
        pieces = (
            W * units[:, None] if G is None else np.einsum("iu,kip->kup", G, W) for _, W in chunks
        )
        return triangles_of(pieces, len(self.names))

    def _random_motion(self, units: Array) -> Samples:
        """Random motion with balanced gravity, centrifugal and inertia torques."""
        rng = np.random.default_rng(0)
        # revolute joints turn by any angle, prismatic ones move by the robot's size
        spread = np.diag(units) if self.constraint is None else self.constraint.T * units.max()
        rate = sqrt(EARTH / reach(self.model))
        N = ceil(_ROWS_A_COLUMN * len(self.names) / max(len(spread), 1))
        q, v, a = (
            scale * rng.uniform(-1.0, 1.0, (N, len(spread))) @ spread
            for scale in (np.pi, rate, rate**2)
        )
        if self.friction is not None:  # half of the samples over all decades: near zero velocity
            v[::2] *= 10.0 ** (-_DECADES * rng.uniform(size=v[::2].shape))
        return q, v, a

    @cached_property
    def basis(self) -> ColumnBasis:
        """Independent columns; on samples the tolerance moves to the widest gap near it."""
        basis = column_basis(self.factor, scale=self.sizes, negligible=self.tolerance)
        if self.samples is None or _ratio(basis) >= _CLEAR:
            return basis
        left = np.maximum(np.append(np.sort(basis.distance)[::-1], 0.0), _ROUNDING)
        lowest, highest = self.tolerance / _BAND, min(self.tolerance * _BAND, 0.5)
        for above, below in sorted(pairwise(left), key=lambda pair: pair[1] / pair[0]):
            if above > lowest and below < highest and above >= _CLEAR * below:
                cut = min(max(sqrt(above * below), lowest), highest)
                again = column_basis(self.factor, scale=self.sizes, negligible=cut)
                if _ratio(again) >= _CLEAR:
                    return again
        return basis

    def neglected(self, matrix: Array) -> tuple[str, ...]:
        """Parameters with an effect on the torques that have no coefficient. Shapes: (b, p)."""
        length = np.sqrt((self.factor * self.factor).sum(axis=0)) * self.sizes
        acting = length > NEGLIGIBLE * length.max(initial=0.0)
        return tuple(self.names[k] for k in np.flatnonzero(acting & ~matrix.any(axis=0)))

    def torque_error(self, kept: NDArray[np.int64], matrix: Array) -> float:
        """Largest relative torque error of base parameters. Shapes: (b,), (b, p)."""
        model, rng = self.model, np.random.default_rng(1)
        if self.samples is None:
            free = np.eye(model.n) if self.constraint is None else self.constraint
            u = rng.uniform(-1.0, 1.0, (3, _CHECKED, free.shape[1])) @ free.T
            samples = np.pi * u[0], 2.0 * u[1], 2.0 * u[2]
        else:
            some = np.linspace(0, len(self.samples[0]) - 1, _CHECKED).astype(np.int64)
            samples = tuple(x[np.unique(some)] for x in self.samples)
        W = torque_regressor(model, *samples, drive=self.drive, friction=self.friction)
        if self.constraint is not None:
            W = np.einsum("iu,kip->kup", self.constraint, W)
        pi = rng.normal(size=W.shape[-1])
        torque = W @ pi
        error = float(np.abs(W[..., kept] @ (matrix @ pi) - torque).max(initial=0.0))
        return error / (float(np.abs(torque).max(initial=0.0)) or 1.0)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on an uncertain rank, and on samples that excite too few parameters."""
        basis, names, notes = self.basis, np.array(self.names), ()
        kept, other = basis.gap
        if _ratio(basis) < _CLEAR:
            uncertain = basis.distance > max(kept / _CLEAR, _ROUNDING)
            uncertain[basis.kept] = basis.distance[basis.kept] < _CLEAR * other
            notes += (
                f"No clear gap: a parameter is kept with {kept:.1e} of the largest torque beyond "
                f"the others, one left out with {other:.1e}. Uncertain: "
                f"{_listed(names[uncertain])}. Use a richer motion, or state the zero tolerance= "
                f"(here {self.tolerance:.0e}).",
            )
        if self.samples is not None:
            whole = replace(self, samples=None).basis.kept
            if basis.rank < len(whole):
                missing = _listed(names[np.setdiff1d(whole, basis.kept)])
                notes += (
                    f"This motion excites {basis.rank} of the {len(whole)} base parameters; not "
                    f"kept: {missing}.",
                )
        return notes


def _ratio(basis: ColumnBasis) -> float:
    """Ratio of the smallest kept to the largest dropped residual norm."""
    kept, other = basis.gap
    return kept / max(other, _ROUNDING)


def residual_warning(error: float, tolerance: float) -> tuple[str, ...]:
    """Note where the base parameters do not reproduce the torques."""
    if error <= max(_WRONG, _CLEAR * tolerance):
        return ()
    return (
        f"NOT TO BE USED: these base parameters have torque errors of {error:.1e} on another "
        "motion. Lengths or angles of the table lie where rounding decides; check them.",
    )


def _listed(names: NDArray[np.str_]) -> str:
    few = ", ".join(names[:_FEW].tolist())
    return few + (f" and {len(names) - _FEW} more" if len(names) > _FEW else "")
