"""Base parameters by Khalil's rules.

Source: Seed book section 1.5.3.
"""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import DriveKind, Drives, drive_kinds
from ..estimation import ColumnBasis, column_basis
from ..estimation.columns import NOTHING
from ..friction import Friction, check_linear
from ..friction.protocols import needs_position
from ..geometry import PRISMATIC
from ..model import RobotModel
from ..regressors import parameter_names
from .gap import doubts, miss
from .gravity import EARTH
from .numeric import base_columns, missed_torque, natural_sizes, torque_factors
from .restraint import reach
from .result import BaseMethod, BaseParameters
from .rules import regrouped, rows_of_numbers

_FINEST, _COARSEST = 1e-13, 1e-2
"""Between these, sines and lengths relative to the robot's are neither nothing nor clear."""


def base_by_rules(
    model: RobotModel,
    drive: Drives,
    tolerance: float = NOTHING,
    friction: Friction | None = None,
    notes: tuple[str, ...] = (),
) -> BaseParameters:
    """Base parameters by the rules of `robotmodels.minimal_parameters.rules`."""
    kinds = drive_kinds(drive)
    kept, matrix = _by_rules(model, kinds, tolerance, friction, _FINEST)
    if _is_clear(model, kinds, tolerance, kept):
        return BaseParameters(
            model, kinds, kept, matrix, BaseMethod.SYMBOLIC, None, friction, tolerance, notes
        )
    ruled, ruled_matrix = _by_rules(model, kinds, tolerance, friction, tolerance)
    found = base_columns(model, kinds, tolerance=tolerance, friction=friction)
    basis, names = found.basis, parameter_names(model, kinds, friction)
    kept, matrix = basis.kept, np.asarray(basis.coefficients)
    if _holds(model, kinds, tolerance, friction, basis, ruled, ruled_matrix):
        kept, matrix = ruled, ruled_matrix
    base = BaseParameters(
        model, kinds, kept, matrix, BaseMethod.SYMBOLIC, None, friction, tolerance, notes,
        found.neglected,
    )  # fmt: skip
    missed = missed_torque(base)
    notes = (*notes, *doubts(names, basis, tolerance, False), *miss(missed, tolerance))
    return replace(base, notes=notes, missed=missed)


def _by_rules(
    model: RobotModel,
    drive: tuple[DriveKind, ...],
    tolerance: float,
    friction: Friction | None,
    exact: float,
) -> tuple[NDArray[np.int64], Array]:
    """Kept parameters and their combinations, with angles up to ``exact`` taken as none."""
    found = regrouped(model, *rows_of_numbers(model, exact), drive, exact)
    p = len(parameter_names(model, drive))
    ruled = 10 * model.f + model.n * len(drive)
    kept = np.array(sorted(found), dtype=np.int64)
    matrix = np.zeros((len(kept), p))
    for row, number in zip(matrix, kept, strict=True):
        for k, coefficient in found[int(number)].items():
            row[k] = coefficient
    sizes = natural_sizes(model, drive)
    matrix[abs(matrix * sizes) <= tolerance * sizes[kept][:, None]] = 0.0
    placed = friction is not None and needs_position(friction)
    if p > ruled or placed:
        own = friction if placed else None
        kept, matrix = _with_numbers(model, drive, own, kept, matrix, ruled, tolerance)
    if friction is not None and not placed:
        kept, matrix = _with_friction(model, drive, friction, kept, matrix, tolerance)
    return kept, matrix


def _is_clear(
    model: RobotModel, drive: tuple[DriveKind, ...], tolerance: float, kept: NDArray[np.int64]
) -> bool:
    """Whether the same parameters are kept wherever a sine or a length begins to count."""
    if tolerance > NOTHING:
        return False
    table = model.table
    lengths = np.abs(np.concatenate((table.d, table.r, table.b))) / reach(model)
    weight = np.linalg.norm(model.gravity) / EARTH
    sizes = np.append(lengths, weight)
    if ((sizes > _FINEST) & (sizes < _COARSEST)).any():
        return False
    coarse = regrouped(model, *rows_of_numbers(model, _COARSEST), drive, _COARSEST)
    ruled = 10 * model.f + model.n * len(drive)
    return sorted(coarse) == kept[kept < ruled].tolist()


def _holds(
    model: RobotModel, drive: tuple[DriveKind, ...], tolerance: float, friction: Friction | None,
    basis: ColumnBasis, kept: NDArray[np.int64], matrix: Array,
) -> bool:  # fmt: skip
    """Whether the combinations of the rules give the torques, from what the torques show."""
    if not np.array_equal(kept, basis.kept):
        return False
    if (matrix.any(axis=0) != basis.coefficients.any(axis=0)).any():
        return False
    W = np.vstack(torque_factors(model, drive, friction=friction))
    sizes = natural_sizes(model, drive, friction)
    W = W * sizes
    missed = W - W[:, kept] @ (matrix * sizes / sizes[kept][:, None])
    longest = np.sqrt((W * W).sum(axis=0)).max(initial=0.0)
    return bool(np.sqrt((missed * missed).sum(axis=0)).max(initial=0.0) <= tolerance * longest)


def _with_numbers(
    model: RobotModel, drive: tuple[DriveKind, ...], friction: Friction | None,
    kept: NDArray[np.int64], matrix: Array, ruled: int, tolerance: float,
) -> tuple[NDArray[np.int64], Array]:  # fmt: skip
    """Add columns that no rule knows: of coupled motors, of friction that depends on positions."""
    basis = base_columns(model, drive, tolerance=tolerance, friction=friction).basis
    own = basis.kept[basis.kept >= ruled]
    whole = basis.coefficients.copy()
    if np.array_equal(np.concatenate((kept, own)), basis.kept):
        whole[:, :ruled] = 0.0
        whole[: len(kept), :ruled] = matrix[:, :ruled]
    return basis.kept, whole


def _with_friction(
    model: RobotModel, drive: tuple[DriveKind, ...], friction: Friction,
    kept: NDArray[np.int64], matrix: Array, tolerance: float,
) -> tuple[NDArray[np.int64], Array]:  # fmt: skip
    """Add the columns of a friction model: functions of one velocity, as Fv, Fc and offset are."""
    linear = check_linear(friction)
    n, p, added = model.n, matrix.shape[1], len(linear.kinds)
    v = _velocities(model)
    columns = [linear.basis(v)[:, k] for k in range(added)]
    numbers = [p + n * k for k in range(added)]
    plain = {DriveKind.FV: v, DriveKind.FC: np.sign(v), DriveKind.OFFSET: np.ones_like(v)}
    own = [(kind, 10 * model.f + n * k) for k, kind in enumerate(drive) if kind in plain]
    columns = [*(plain[kind] for kind, _ in own), *columns]
    numbers = [*(start for _, start in own), *numbers]
    sizes = natural_sizes(model, drive, friction)
    whole = np.hstack((matrix, np.zeros((len(matrix), n * added))))
    rows: list[tuple[int, Array]] = []
    for i in range(n):
        own = np.array(numbers) + i
        basis = column_basis(
            np.stack([c[:, i] for c in columns], axis=1), None, sizes[own], tolerance
        )
        new = {int(own[k]): np.zeros(p + n * added) for k in basis.kept if own[k] >= p}
        for k, column in enumerate(own):
            if column < p:
                continue
            for j, coefficient in zip(own[basis.kept], basis.coefficients[:, k], strict=True):
                if j < p:  # Fv, Fc or offset, which may stand in another parameter
                    whole[:, column] += coefficient * matrix[:, j]
                else:
                    new[int(j)][column] = coefficient
        rows += new.items()
    rows.sort(key=lambda row: row[0])
    kept = np.concatenate((kept, np.array([number for number, _ in rows], dtype=np.int64)))
    return kept, np.vstack((whole, *[row for _, row in rows]))


def _velocities(model: RobotModel, samples: int = 300) -> Array:
    """Velocities of both signs, over all decades in which friction may change."""
    rng = np.random.default_rng(0)
    size = reach(model)
    slides = model.table.sigma[model.table.joint_rows] == PRISMATIC
    most = 2.0 * sqrt(EARTH / size) * np.where(slides, size, 1.0)
    signs = rng.choice([-1.0, 1.0], size=(samples, model.n))
    v = most * signs * rng.uniform(size=(samples, model.n))
    v[::2] *= 10.0 ** (-6.0 * rng.uniform(size=v[::2].shape))
    return v
