"""Numerical base parameters: independent columns of a regressor, in Khalil's order.

Source: M. Gautier, "Numerical calculation of the base inertial parameters of robots", Journal of
Robotic Systems 8(4), 1991.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import ceil, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import DriveKind, Drives, drive_kinds
from ..estimation import ColumnBasis, column_basis
from ..estimation.columns import NOTHING
from ..estimation.factor import triangles_of
from ..friction import Friction, check_linear
from ..friction.protocols import basis_at
from ..geometry import PRISMATIC
from ..model import RobotModel
from ..regressors import parameter_names, torque_regressor, torque_regressor_chunks
from .motion_span import EARTH, reach
from .result import BaseMethod, BaseParameters

Samples = tuple[Array, Array, Array]
"""Positions, velocities and accelerations, each (N, n)."""

_ROWS_A_COLUMN, _PIECE, _FRESH = 3, 1024, 40
"""Rows of random motion per column; samples per piece, and of the final check."""
_DECADES = 6.0
"""Number of velocity decades at which friction is evaluated."""
_SMALL_TORQUE = 1e-3
"""Zero tolerance of the torque of a friction parameter, SI units."""
_CLEAR = 100.0
"""Least ratio of smallest kept to largest dropped residual norm for a clear rank gap."""
_BAND = 30.0
"""Factor around the tolerance in which the widest rank gap of a log is searched."""
_ROUNDING, _MISSED = 1e-16, 1e-9
"""Rounding tolerances: residual norm of a column, relative torque error."""
_FEW = 8
"""Names listed in a note."""


class NumericColumns(NamedTuple):
    """Independent columns, and the names of those neglected by the tolerance."""

    basis: ColumnBasis
    neglected: tuple[str, ...]


def base_by_numbers(
    model: RobotModel,
    drive: Drives,
    samples: Samples | None = None,
    constraint: Array | None = None,
    tolerance: float = NOTHING,
    friction: Friction | None = None,
    notes: tuple[str, ...] = (),
) -> BaseParameters:
    """Base parameters from the columns of the regressor on random or given motion.

    Shapes: samples (N, n), constraint (n, u).
    """
    kinds = drive_kinds(drive)
    columns = base_columns(model, kinds, samples, constraint, tolerance, friction)
    basis, names = columns.basis, parameter_names(model, kinds, friction)
    notes = (*notes, *rank_warnings(names, basis, tolerance, samples is not None))
    if samples is not None:
        whole = base_columns(model, kinds, None, constraint, tolerance, friction).basis.kept
        notes = (*notes, *_unidentifiable(names, basis.kept, whole))
    base = BaseParameters(
        model=model,
        drive=kinds,
        kept=basis.kept,
        matrix=basis.coefficients,
        method=BaseMethod.NUMERIC,
        gap=basis.gap,
        friction=friction,
        tolerance=tolerance,
        neglected=columns.neglected,
    )
    missed = residual_torque(base, samples, constraint)
    return replace(base, notes=(*notes, *residual_warning(missed, tolerance)), missed=missed)


def base_columns(
    model: RobotModel,
    drive: Drives,
    samples: Samples | None = None,
    constraint: Array | None = None,
    tolerance: float = NOTHING,
    friction: Friction | None = None,
) -> NumericColumns:
    """Independent columns of the torque regressor; arguments as `base_by_numbers`."""
    kinds = drive_kinds(drive)
    scale = natural_sizes(model, kinds, friction)
    W = torque_factor(model, kinds, samples, constraint, friction)
    basis = column_basis(W, scale=scale, nothing=tolerance)
    if samples is not None:
        basis = rank_gap(W, scale, tolerance, basis)
    names = parameter_names(model, kinds, friction)
    neglected = np.flatnonzero(_acts(W, scale) & ~basis.coefficients.any(axis=0))
    return NumericColumns(basis, tuple(names[k] for k in neglected))


def acting_parameters(
    model: RobotModel,
    drive: Drives,
    samples: Samples | None = None,
    constraint: Array | None = None,
    friction: Friction | None = None,
) -> NDArray[np.bool_]:
    """Mask of standard parameters with an effect on torques; arguments as `base_by_numbers`."""
    W = torque_factor(model, drive, samples, constraint, friction)
    return _acts(W, natural_sizes(model, drive, friction))


def _acts(W: Array, scale: Array) -> NDArray[np.bool_]:
    length = np.sqrt((W * W).sum(axis=0)) * scale
    return length > NOTHING * length.max(initial=0.0)


def torque_factor(
    model: RobotModel,
    drive: Drives,
    samples: Samples | None = None,
    constraint: Array | None = None,
    friction: Friction | None = None,
) -> Array:
    """Rows of the regressor (r, p), or a matrix with the same products of columns."""
    size = reach(model)
    p = len(parameter_names(model, drive, friction))
    slides = model.table.sigma[model.table.joint_rows] == PRISMATIC
    units = np.where(slides, size, 1.0)
    if samples is None:
        samples = _random_motion(model, p, size, units, constraint, friction is not None)
    chunks = torque_regressor_chunks(model, *samples, drive=drive, size=_PIECE, friction=friction)
    pieces = (
        W * units[:, None] if constraint is None else np.einsum("iu,kip->kup", constraint, W)
        for _, W in chunks
    )
    return triangles_of(pieces, p)


def _random_motion(
    model: RobotModel, p: int, size: float, units: Array, constraint: Array | None, slow: bool
) -> Samples:
    """Random motion with balanced gravity, centrifugal and inertia torques."""
    rng = np.random.default_rng(0)
    G = np.eye(model.n) if constraint is None else constraint
    u = G.shape[1]
    rate = sqrt(EARTH / size)
    N = ceil(_ROWS_A_COLUMN * p / max(u, 1))
    # revolute joints turn by any angle, prismatic ones move by the robot's size
    spread = np.diag(units) if constraint is None else np.eye(u) * units.max(initial=0.0)
    q, v, a = (
        scale * rng.uniform(-1.0, 1.0, (N, u)) @ spread @ G.T for scale in (np.pi, rate, rate**2)
    )
    if slow:  # half of the samples over all decades: friction may change near zero velocity
        v[::2] *= 10.0 ** (-_DECADES * rng.uniform(size=v[::2].shape))
    return q, v, a


def natural_sizes(model: RobotModel, drive: Drives, friction: Friction | None = None) -> Array:
    """Natural sizes of the parameters: robot of this size, unit mass, torques of its weight."""
    size = reach(model)
    link = [size**2] * 6 + [size] * 3 + [1.0]
    slides = model.table.sigma[model.table.joint_rows] == PRISMATIC
    unit = np.where(slides, size, 1.0)
    rotor = np.where(slides, 1.0, size**2)
    rate = sqrt(EARTH / size)
    torque = rotor * unit * rate**2
    joints = {
        DriveKind.IA: rotor,
        DriveKind.FV: rotor * rate,
        DriveKind.FC: torque,
        DriveKind.OFFSET: torque,
    }
    couplings = {DriveKind.IA: size**2, DriveKind.FV: size**2 * rate, DriveKind.FC: size * EARTH}
    kinds = drive_kinds(drive)
    motors = 0 if model.transmission is None else len(model.transmission.coupled_motors)
    joined = [np.full(motors, couplings[kind]) for kind in kinds if kind.coupling is not None]
    extra: list[Array] = []
    if friction is not None:
        linear = check_linear(friction)
        speeds = unit * rate * 10.0 ** -np.arange(0.0, _DECADES + 1.0)[:, None]
        speeds = np.concatenate((speeds, -speeds))
        angles = np.linspace(-np.pi, np.pi, len(speeds))[:, None] * np.ones(model.n)
        basis = np.abs(basis_at(linear, speeds, angles))
        extra = list(torque / np.maximum(_SMALL_TORQUE, basis.max(axis=0)))
    drives = [joints[kind] for kind in kinds]
    return np.concatenate((np.tile(link, model.f), *drives, *joined, *extra))


def residual_torque(
    base: BaseParameters, samples: Samples | None = None, constraint: Array | None = None
) -> float:
    """Largest relative torque error of the base parameters."""
    model = base.model
    rng = np.random.default_rng(1)
    if samples is None:
        G = np.eye(model.n) if constraint is None else constraint
        u = rng.uniform(-1.0, 1.0, (3, _FRESH, G.shape[1]))
        samples = np.pi * u[0] @ G.T, 2.0 * u[1] @ G.T, 2.0 * u[2] @ G.T
    else:
        some = np.unique(np.linspace(0, len(samples[0]) - 1, _FRESH).astype(np.int64))
        samples = samples[0][some], samples[1][some], samples[2][some]
    W = torque_regressor(model, *samples, drive=base.drive, friction=base.friction)
    if constraint is not None:
        W = np.einsum("iu,kip->kup", constraint, W)
    pi = rng.normal(size=W.shape[-1])
    torque = W @ pi
    missed = W[..., base.kept] @ (base.matrix @ pi) - torque
    largest = float(np.abs(torque).max(initial=0.0))
    return float(np.abs(missed).max(initial=0.0)) / largest if largest > 0.0 else 0.0


def rank_gap(W: Array, scale: Array, tolerance: float, basis: ColumnBasis) -> ColumnBasis:
    """Column basis with the tolerance moved to the widest gap near it.

    Shapes: W (N, p), scale (p,).
    """
    if _ratio(basis) >= _CLEAR:
        return basis
    left = np.maximum(np.append(np.sort(basis.distance)[::-1], 0.0), _ROUNDING)
    lowest, highest = tolerance / _BAND, min(tolerance * _BAND, 0.5)
    cuts = [
        (above / below, min(max(sqrt(above * below), lowest), highest))
        for above, below in pairwise(left)
        if above > lowest and below < highest and above >= _CLEAR * below
    ]
    for _, cut in sorted(cuts, reverse=True):
        again = column_basis(W, scale=scale, nothing=cut)
        if _ratio(again) >= _CLEAR:
            return again
    return basis


def _ratio(basis: ColumnBasis) -> float:
    """Ratio of the smallest kept to the largest dropped residual norm."""
    kept, other = basis.gap
    return kept / max(other, _ROUNDING)


def rank_warnings(
    names: Sequence[str], basis: ColumnBasis, tolerance: float, logged: bool
) -> tuple[str, ...]:
    """Note where the rank has no clear gap, with the parameters concerned."""
    kept, other = basis.gap
    if _ratio(basis) >= _CLEAR:
        return ()
    is_kept = np.zeros(len(names), dtype=bool)
    is_kept[basis.kept] = True
    near = np.where(
        is_kept, basis.distance < _CLEAR * other, basis.distance > max(kept / _CLEAR, _ROUNDING)
    )
    least = names[int(np.flatnonzero(is_kept & (basis.distance == kept))[0])]
    most = names[int(np.flatnonzero(~is_kept & (basis.distance == other))[0])]
    advice = "Use a richer motion, or state" if logged else "State"
    return (
        f"No clear gap: {least} is kept with {kept:.1e} of the largest torque beyond the others, "
        f"{most} left out with {other:.1e}. Uncertain: {_listed(names, np.flatnonzero(near))}. "
        f"{advice} the zero tolerance= (here {tolerance:.0e}).",
    )


def _unidentifiable(
    names: Sequence[str], kept: NDArray[np.int64], whole: NDArray[np.int64]
) -> tuple[str, ...]:
    """Note on a log that excites fewer parameters than random motion."""
    if len(kept) >= len(whole):
        return ()
    missing = np.setdiff1d(whole, kept)
    return (
        f"This motion excites {len(kept)} of the {len(whole)} base parameters; not kept: "
        f"{_listed(names, missing)}.",
    )


def residual_warning(missed: float, tolerance: float) -> tuple[str, ...]:
    """Note where the base parameters do not reproduce the torques."""
    if missed <= max(_MISSED, _CLEAR * tolerance):
        return ()
    return (
        f"NOT TO BE USED: these base parameters have torque errors of {missed:.1e} on another "
        "motion. Lengths or angles of the table lie where rounding decides; check them.",
    )


def _listed(names: Sequence[str], numbers: NDArray[np.int64]) -> str:
    few = ", ".join([names[int(k)] for k in numbers[:_FEW]])
    return few + (f" and {len(numbers) - _FEW} more" if len(numbers) > _FEW else "")
