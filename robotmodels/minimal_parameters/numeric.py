"""Base parameters in numbers: independent columns of a regressor, in Khalil's order.

Source: M. Gautier, "Numerical calculation of the base inertial parameters of robots", Journal of
Robotic Systems 8(4), 1991.
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import DriveKind, Drives, drive_kinds
from ..estimation import column_basis
from ..estimation.columns import NOTHING
from ..estimation.triangles import factors_by_kind
from ..friction import Friction, check_linear
from ..friction.protocols import basis_at
from ..geometry import PRISMATIC
from ..model import RobotModel
from ..regressors import parameter_names, torque_regressor, torque_regressor_chunks
from .branches import columns_by_branches
from .gap import FoundColumns, doubts, miss, unseen, with_clear_gap
from .gravity import EARTH
from .restraint import reach
from .result import BaseMethod, BaseParameters

_ROWS_A_COLUMN = 3
_PIECE = 1024
_MANY = 250
"""Columns beyond which a tree is taken path by path."""
_SLOWEST = 6.0
"""Decades of velocities that friction is looked at on."""
_LEAST = 1e-3
"""Torque of a friction parameter, in SI units, below which it is none."""
_FRESH = 40
"""Samples on which the torques are compared at last."""


def base_by_numbers(
    model: RobotModel,
    drive: Drives,
    samples: tuple[Array, Array, Array] | None = None,
    constraint: Array | None = None,
    tolerance: float = NOTHING,
    friction: Friction | None = None,
    notes: tuple[str, ...] = (),
) -> BaseParameters:
    """Base parameters from the columns of the regressor on random or given motion.

    Shapes: samples (N, n), constraint (n, u).
    """
    kinds = drive_kinds(drive)
    found = base_columns(model, kinds, samples, constraint, tolerance, friction)
    basis, names = found.basis, parameter_names(model, kinds, friction)
    notes = (*notes, *doubts(names, basis, tolerance, samples is not None))
    if samples is not None:
        whole = base_columns(model, kinds, None, constraint, tolerance, friction).basis.kept
        notes = (*notes, *unseen(names, basis.kept, whole))
    base = BaseParameters(
        model, kinds, basis.kept, basis.coefficients, BaseMethod.NUMERIC, basis.gap, friction,
        tolerance, notes, found.neglected,
    )  # fmt: skip
    missed = missed_torque(base, samples, constraint)
    return replace(base, notes=(*notes, *miss(missed, tolerance)), missed=missed)


def base_columns(
    model: RobotModel,
    drive: Drives,
    samples: tuple[Array, Array, Array] | None = None,
    constraint: Array | None = None,
    tolerance: float = NOTHING,
    friction: Friction | None = None,
) -> FoundColumns:
    """Independent columns of the torque regressor; arguments as `base_by_numbers`."""
    kinds = drive_kinds(drive)
    factors = torque_factors(model, kinds, samples, constraint, friction)
    scale = natural_sizes(model, kinds, friction)
    coupled = model.transmission is not None and model.transmission.coupled_motors
    W = np.vstack([np.zeros((0, len(scale))), *factors])
    basis = None
    if len(scale) > _MANY and constraint is None and not coupled:
        alike = np.zeros(len(scale), dtype=np.int64)
        basis = columns_by_branches(model, factors, scale, alike, tolerance)
    if basis is None:
        basis = column_basis(W, None, scale, tolerance)
    if samples is not None:
        basis = with_clear_gap(W, scale, tolerance, basis)
    names = parameter_names(model, kinds, friction)
    neglected = np.flatnonzero(_shown(W, scale) & ~basis.coefficients.any(axis=0))
    return FoundColumns(basis, tuple(names[k] for k in neglected))


def shown_parameters(
    model: RobotModel,
    drive: Drives,
    samples: tuple[Array, Array, Array] | None = None,
    constraint: Array | None = None,
    friction: Friction | None = None,
) -> NDArray[np.bool_]:
    """Of each standard parameter, whether torques show it; arguments as `base_by_numbers`."""
    factors = torque_factors(model, drive, samples, constraint, friction)
    scale = natural_sizes(model, drive, friction)
    return _shown(np.vstack([np.zeros((0, len(scale))), *factors]), scale)


def _shown(W: Array, scale: Array) -> NDArray[np.bool_]:
    length = np.sqrt((W * W).sum(axis=0)) * scale
    return length > NOTHING * length.max(initial=0.0)


def torque_factors(
    model: RobotModel,
    drive: Drives,
    samples: tuple[Array, Array, Array] | None = None,
    constraint: Array | None = None,
    friction: Friction | None = None,
) -> list[Array]:
    """Rows of the regressor by joint (free variable), or matrices with the same products."""
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
    return factors_by_kind(pieces, p)


def _random_motion(
    model: RobotModel, p: int, size: float, units: Array, constraint: Array | None, slow: bool
) -> tuple[Array, Array, Array]:
    """Motion in which gravity, centrifugal forces and inertia weigh alike, whatever the size."""
    rng = np.random.default_rng(0)
    G = np.eye(model.n) if constraint is None else constraint
    u = G.shape[1]
    rate = sqrt(EARTH / size)
    N = ceil(_ROWS_A_COLUMN * p / max(u, 1))
    # joints may turn all round and slide by the robot's size
    spread = np.diag(units) if constraint is None else np.eye(u) * units.max(initial=0.0)
    q, v, a = (
        scale * rng.uniform(-1.0, 1.0, (N, u)) @ spread @ G.T for scale in (np.pi, rate, rate**2)
    )
    if slow:
        # half of the samples over all decades: friction may be another near zero velocity
        v[::2] *= 10.0 ** (-_SLOWEST * rng.uniform(size=v[::2].shape))
    return q, v, a


def natural_sizes(model: RobotModel, drive: Drives, friction: Friction | None = None) -> Array:
    """Parameters of a robot of this size and unit mass, with torques as its weight gives them."""
    size = reach(model)
    link = [size**2] * 6 + [size] * 3 + [1.0]
    slides = model.table.sigma[model.table.joint_rows] == PRISMATIC
    unit = np.where(slides, size, 1.0)
    rotor = np.where(slides, 1.0, size**2)
    rate = sqrt(EARTH / size)
    torque = rotor * unit * rate**2
    of_kind = {
        DriveKind.IA: (rotor, size**2), DriveKind.FV: (rotor * rate, size**2 * rate),
        DriveKind.FC: (torque, size**2 * rate**2), DriveKind.OFFSET: (torque, 0.0),
    }  # fmt: skip
    kinds = drive_kinds(drive)
    motors = () if model.transmission is None else model.transmission.coupled_motors
    joined = [np.full(len(motors), of_kind[k][1]) for k in kinds if k.coupling is not None]
    extra: list[Array] = []
    if friction is not None:
        linear = check_linear(friction)
        speeds = unit * rate * 10.0 ** -np.arange(0.0, _SLOWEST + 1.0)[:, None]
        speeds = np.concatenate((speeds, -speeds))
        angles = np.linspace(-np.pi, np.pi, len(speeds))[:, None] * np.ones(model.n)
        basis = np.abs(basis_at(linear, speeds, angles))
        extra = list(torque / np.maximum(_LEAST, basis.max(axis=0)))
    own = [of_kind[kind][0] for kind in kinds]
    return np.concatenate((np.tile(link, model.f), *own, *joined, *extra))


def missed_torque(
    base: BaseParameters,
    samples: tuple[Array, Array, Array] | None = None,
    constraint: Array | None = None,
) -> float:
    """Largest relative torque that the base parameters do not reproduce."""
    model = base.model
    rng = np.random.default_rng(1)
    if samples is None:
        G = np.eye(model.n) if constraint is None else constraint
        u = (
            rng.uniform(-1.0, 1.0, (3, _FRESH, G.shape[1]))
            * np.array([np.pi, 2.0, 2.0])[:, None, None]
        )
        samples = u[0] @ G.T, u[1] @ G.T, u[2] @ G.T
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
