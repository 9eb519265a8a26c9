"""Base parameters of a robot, by symbolic rules or numerically."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_core, as_number, as_vector, batch_rows
from .._choices import chosen
from ..drive import Drives, Transmission, drive_kinds
from ..errors import InvalidValueError, ShapeError
from ..estimation import column_basis
from ..estimation.columns import NEGLIGIBLE
from ..friction import Friction, check_friction, check_linear
from ..model import RobotModel, check_model
from ..regressors.chunks import check_log
from .alignment import ALIGNED, aligned_robot
from .numeric import Samples, TorqueColumns, residual_warning
from .result import BaseMethod, BaseParameters
from .rules import EARTH, reach, regrouped, rows_of_numbers

Motion = tuple[ArrayLike, ArrayLike, ArrayLike] | Any
"""Arrays (q, v, a), samples that have them, or a trajectory that can be resampled."""
_SAMPLES = 1000
_LARGEST = 1e-2
_FINEST, _COARSEST = 1e-13, 1e-2
"""Range of relative sines and lengths that may be zero or not: the numeric method decides there."""


def base_parameters(
    model: RobotModel,
    method: Literal["symbolic", "numeric"] | BaseMethod = "symbolic",
    drive: Drives = ("Ia", "Fv", "Fc"),
    motion: Motion | None = None,
    constraint: ArrayLike | Transmission | None = None,
    tolerance: float | None = None,
    friction: Friction | None = None,
) -> BaseParameters:
    """Base inertial parameters: the minimal set that determines the torques.

    Also called minimal, barycentric or identifiable parameters. Both methods keep Khalil's choice:
    the parameters of the frames nearest to the base before those farther away, link parameters
    before ``Ia`` before ``Fv``, ``Fc`` and ``offset`` before those of a friction model; dependent
    parameters are regrouped into earlier ones. Only a parameter with little effect (less than 1e-4
    of the largest) is regrouped into a later one.

    Parameters
    ----------
    method : {"symbolic", "numeric"}
        Khalil's rules, with formulas, or the columns of the torque regressor.
    motion : tuple of array_like, shapes (N, n), Samples or Trajectory, optional
        Positions (rad or m), velocities and accelerations of the regressor of the numeric method;
        default random ones. Parameters that logged motion does not excite are not kept.
    constraint : array_like, shape (n, u), or Transmission, optional
        Joints that are bound to each other, ``v = constraint u`` (mimic joints, a transmission):
        the torques are those of the u free variables. Of the numeric method.
    tolerance : float, optional
        Zero tolerance, at most 0.01: the largest relative torque of a parameter that is not kept,
        the angle in rad up to which axes are taken as aligned, and a coefficient in natural units.
        Default 1e-5 rad for axes (a file may write 1.5708) and 1e-11 for torques; ``1e-11`` uses
        every digit. On logged motion the limit moves to the widest gap within a factor of 30.

    Returns
    -------
    BaseParameters
        ``.names``, ``.regrouping``, ``.matrix``, ``.no_effect``, ``.notes``; prints as the book's
        table.

    Raises
    ------
    InvalidValueError, ShapeError
        Motion or a constraint for the symbolic method; an empty log; friction that is not linear or
        repeats columns of the drives; a tolerance above 0.01; arrays of the wrong shape.

    References
    ----------
    Book section 1.5.3; M. Gautier and W. Khalil, "Direct calculation of minimum set of
    inertial parameters of serial robots", IEEE T-RA 6(3), 1990.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> base = base_parameters(load("rx90"), drive=False)
    >>> len(base), dict(base.regrouping["ZZ4"])
    (36, {'ZZ4': 1.0, 'YY5': 1.0})
    """
    check_model(model)
    kind = chosen(BaseMethod, method, "method")
    kinds = drive_kinds(drive)
    angle, least = (ALIGNED, NEGLIGIBLE) if tolerance is None else (_part(tolerance),) * 2
    if friction is not None:
        check_linear(check_friction(friction, model.n))
    if kind is BaseMethod.SYMBOLIC and not (motion is None and constraint is None):
        raise InvalidValueError(
            "motion, constraint: the symbolic method uses the table alone; use method='numeric'."
        )
    aligned, notes = aligned_robot(model, angle)
    samples = None if motion is None else _samples(model, motion)
    G = None
    if constraint is not None:
        G, note = _constraint(model, constraint)
        notes += note
    elif model.transmission is not None and not model.transmission.is_invertible:
        notes += (
            f"The transmission of {model.name} is singular, rank {model.transmission.rank} of "
            f"{model.n}; constraint=model.transmission gives the parameters of its free variables.",
        )
    columns = TorqueColumns(aligned, kinds, friction, least, samples, G)
    neglected, error, gap = (), None, None
    kept, matrix, numeric = _regrouping(columns, kind is BaseMethod.SYMBOLIC)
    if numeric:
        neglected, error = columns.neglected(matrix), columns.torque_error(kept, matrix)
        notes += (*columns.notes, *residual_warning(error, least))
        gap = columns.basis.gap if kind is BaseMethod.NUMERIC else None
    if aligned is not model:
        columns = replace(columns, model=model)
        neglected, error = columns.neglected(matrix), columns.torque_error(kept, matrix)
        sentence = (
            "The torques of the robot as given differ from those of the aligned robot by up to "
            f"{error:.0e} of the largest."
        )
        notes = (notes[0], sentence, *notes[1:])
    return BaseParameters(
        model, kinds, kept, matrix, kind, gap, friction, least, notes, neglected, error, angle
    )


def _regrouping(columns: TorqueColumns, symbolic: bool) -> tuple[NDArray[np.int64], Array, bool]:
    """Kept parameters (b,), combinations (b, p), and whether the numeric method decided.

    It decides cases that depend on a zero tolerance; couplings and friction have no rule.
    """
    if not symbolic:
        return columns.basis.kept, columns.basis.coefficients, True
    model, drive, zero, sizes = columns.model, columns.drive, columns.tolerance, columns.sizes

    def terms_at(small: float) -> dict[int, dict[int, float]]:
        """Combinations where lengths and angles up to ``small`` count as zero."""
        return regrouped(model, *rows_of_numbers(model, small), drive, small)

    fine, coarse = terms_at(_FINEST), terms_at(_COARSEST)
    table = model.table
    small = np.abs(np.concatenate((table.d, table.r, table.b))) / reach(model)
    has_rules = len(sizes) == 10 * model.f + model.n * len(drive)
    clear = has_rules and zero <= NEGLIGIBLE and fine.keys() == coarse.keys()
    clear = clear and not ((small > _FINEST) & (small < _COARSEST)).any()
    clear = clear and bool(np.linalg.norm(model.gravity) > _COARSEST * EARTH)
    terms = fine if clear else terms_at(zero)
    kept = np.array(sorted(terms), dtype=np.int64)
    matrix = np.zeros((len(kept), len(sizes)))
    for row, number in zip(matrix, kept.tolist(), strict=True):
        row[list(terms[number])] = list(terms[number].values())
    matrix[abs(matrix * sizes) <= zero * sizes[kept][:, None]] = 0.0
    if clear or (
        np.array_equal(kept, columns.basis.kept)
        and (matrix.any(axis=0) == columns.basis.coefficients.any(axis=0)).all()
        and columns.torque_error(kept, matrix) <= zero
    ):
        return kept, matrix, not clear
    return columns.basis.kept, columns.basis.coefficients, True


def _part(tolerance: Any) -> float:
    """Check a tolerance, a part of the largest torque."""
    value = as_number(tolerance, "tolerance", above=0.0)
    if value > _LARGEST:
        raise InvalidValueError(f"tolerance: expected at most {_LARGEST:g}, got {value:g}.")
    return value


def _samples(model: RobotModel, motion: Any) -> Samples:
    """Positions, velocities and accelerations of a motion, each (N, n)."""
    if hasattr(motion, "resample"):
        motion = motion.resample(_SAMPLES)
    if all(hasattr(motion, name) for name in "qva"):
        motion = (motion.q, motion.v, motion.a)
    if not isinstance(motion, (tuple, list)) or len(motion) != 3:
        got = type(motion).__name__
        raise InvalidValueError(
            f"motion: expected three arrays (q, v, a) of shape (N, n), or a trajectory, got {got}."
        )
    names = ("motion q", "motion v", "motion a")
    arrays = tuple(as_vector(x, model.n, s) for x, s in zip(motion, names, strict=True))
    q, v, a = batch_rows(arrays, names)[1]
    check_log(len(q), "motion")
    return q, v, a


def _constraint(
    model: RobotModel, constraint: ArrayLike | Transmission
) -> tuple[Array, tuple[str, ...]]:
    """Independent columns (n, u) of a constraint, and a note where there are fewer than joints."""
    n = model.n
    given = constraint.matrix if isinstance(constraint, Transmission) else constraint
    G = as_core(given, (), "constraint")
    if G.ndim != 2 or G.shape[0] != n or G.shape[1] == 0:
        raise ShapeError(
            f"constraint: expected shape ({n}, u), a row for each joint, got {G.shape}."
        )
    if not np.any(G):
        raise InvalidValueError("constraint: all zero, so that no joint moves.")
    lengths = np.linalg.norm(G, axis=0)
    kept = column_basis(G, scale=1.0 / np.where(lengths > 0.0, lengths, 1.0)).kept
    rank, columns = len(kept), np.count_nonzero(lengths)
    note = f"Joint variables are constrained: rank {rank} of {n}, torques of {rank} free variables."
    if rank < columns:
        note += f" The {columns} columns of the constraint depend on each other."
    return np.ascontiguousarray(G[:, kept]), (note,) if rank < n else ()
