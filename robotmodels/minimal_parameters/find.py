"""Base parameters of a robot, by rules or by numbers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, as_floats, as_vector, batch_rows
from .._choices import chosen
from ..drive import Drives, Transmission, drive_kinds
from ..errors import InvalidValueError, ShapeError
from ..estimation import column_basis
from ..estimation.columns import NOTHING
from ..friction import Friction, check_friction, check_linear
from ..model import RobotModel, check_model
from .alignment import ALIGNED, aligned_robot
from .numeric import base_by_numbers, missed_torque, shown_parameters
from .result import BaseMethod, BaseParameters
from .symbolic import base_by_rules


@runtime_checkable
class SampledMotion(Protocol):
    """Positions, velocities and accelerations at some times; samples of a trajectory have them."""

    @property
    def q(self) -> ArrayLike:
        """Joint variables, shape (..., N, n)."""
        ...

    @property
    def v(self) -> ArrayLike:
        """Velocities."""
        ...

    @property
    def a(self) -> ArrayLike:
        """Accelerations."""
        ...


@runtime_checkable
class TimedMotion(Protocol):
    """A motion that can be sampled; a trajectory can."""

    def resample(self, samples: int | None = None, period: float | None = None) -> Any:
        """The motion at equal steps of time."""
        ...


Motion = tuple[ArrayLike, ArrayLike, ArrayLike] | SampledMotion | TimedMotion
_SAMPLES = 1000
_LARGEST = 1e-2


def base_parameters(
    model: RobotModel,
    method: Literal["symbolic", "numeric"] | BaseMethod = "symbolic",
    drive: Drives = ("Ia", "Fv", "Fc"),
    motion: Motion | None = None,
    constraint: ArrayLike | Transmission | None = None,
    tolerance: float | None = None,
    friction: Friction | None = None,
) -> BaseParameters:
    """Base inertial parameters: the fewest that give the same torques.

    Also called minimal, barycentric or identifiable parameters. Both methods keep Khalil's choice:
    the parameters of the frames nearest to the base before those behind them, link parameters
    before ``Ia`` before ``Fv``, ``Fc`` and ``offset`` before those of a friction model; what
    depends on others is regrouped into those that come before it. Only a parameter that hardly acts
    (less than 1e-4 of the largest) gives way to a later one that does.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints; serial or tree, any base and gravity.
    method : {"symbolic", "numeric"}
        By Khalil's rules, with formulas, or from the columns of the torque regressor.
    drive : bool or collection of DriveKind or str
        Which drive parameters are among the standard ones: kinds such as ``"Ia"``, True for all
        (the offsets too), False for none. What couples motors goes with its kind.
    motion : tuple of array_like, shapes (N, n), Samples or Trajectory, optional
        Joint variables (rad or m), velocities and accelerations that the regressor is taken on, of
        the numeric method; default random ones. A trajectory is taken at 1000 times. What logged
        motion does not show is not kept, and `BaseParameters.notes` says so.
    constraint : array_like, shape (n, u), or Transmission, optional
        Joints that are bound to each other, ``v = constraint u`` (mimic joints, a transmission):
        the torques are those of the u free variables. Of the numeric method.
    tolerance : float, optional
        What counts as nothing, by both methods: the part of the largest torque that a parameter
        may have without being kept, the angle in rad up to which axes are taken as parallel or
        perpendicular, and a coefficient (of parameters in their natural units); at most 0.01.
        By default axes within 1e-5 rad are taken as aligned (a file may write 1.5708 for a right
        angle), and of the robot with these axes the torques of each parameter are kept to 1e-11 of
        the largest. The torques of the robot as given differ by about the angle;
        `BaseParameters.notes` says which axes these are, their angles, and by how much the torques
        differ. ``tolerance=1e-11`` takes every digit of the table as meant. On logged motion the
        limit of the torques goes to the widest gap within a factor of 30.
    friction : Friction, optional
        A friction model that is linear in its parameters (`robotmodels.friction`), whose columns
        come after those of the drives.

    Returns
    -------
    BaseParameters
        ``.names``, ``.regrouping``, ``.matrix``, ``.no_effect``; prints as the book's table.

    Raises
    ------
    InvalidValueError
        Another method; motion or a constraint for the symbolic one; NaN; an empty log; friction
        that is not linear or repeats columns of the drives; a tolerance above 0.01.
    ShapeError
        Arrays of the wrong shape.

    References
    ----------
    Seed book section 1.5.3; M. Gautier and W. Khalil, "Direct calculation of minimum set of
    inertial parameters of serial robots", IEEE T-RA 6(3), 1990; W. Khalil and F. Bennis, "Comments
    on ...", IEEE T-RA 10(1), 1994.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> base = base_parameters(load("rx90"), drive=False)
    >>> len(base), dict(base.regrouping["ZZ4"])
    (36, {'ZZ4': 1.0, 'YY5': 1.0})
    """
    check_model(model)
    way = chosen(BaseMethod, method, "method")
    kinds = drive_kinds(drive)
    angle, least = (ALIGNED, NOTHING) if tolerance is None else (_part(tolerance),) * 2
    if friction is not None:
        check_linear(check_friction(friction, model.n))
    aligned, notes = aligned_robot(model, angle)
    notes = (*notes, *_transmission_notes(model, constraint))
    if way is BaseMethod.SYMBOLIC:
        given = {"motion": motion, "constraint": constraint}
        names = [name for name, value in given.items() if value is not None]
        if names:
            raise InvalidValueError(
                f"{names[0]}: the symbolic method knows the table alone; use method='numeric'."
            )
        base = base_by_rules(aligned, kinds, least, friction, notes)
        return _as_given(base, model, angle)
    samples = None if motion is None else _samples(model, motion)
    bound = None
    if constraint is not None:
        bound, columns = _bound(model, constraint)
        notes = (*notes, *_constraint_notes(bound, columns))
    base = base_by_numbers(aligned, kinds, samples, bound, least, friction, notes)
    return _as_given(base, model, angle, samples, bound)


def _as_given(
    base: BaseParameters, model: RobotModel, angle: float,
    samples: tuple[Array, Array, Array] | None = None, bound: Array | None = None,
) -> BaseParameters:  # fmt: skip
    """Base parameters of the robot with aligned axes as those of the robot as given."""
    if base.model is model:
        return replace(base, angle=angle)
    base = replace(base, model=model, angle=angle)
    shown = shown_parameters(model, base.drive, samples, bound, base.friction)
    neglected = np.array(base.parameter_names)[shown & ~base.matrix.any(axis=0)].tolist()
    missed = missed_torque(base, samples, bound)
    sentence = (
        "The torques of the robot as given differ from those of the aligned robot by up to "
        f"{missed:.0e} of the largest."
    )
    notes = (base.notes[0], sentence, *base.notes[1:])
    return replace(base, neglected=tuple(neglected), missed=missed, notes=notes)


def _part(tolerance: Any) -> float:
    """A tolerance: more than a part in a hundred of the torque is no nothing."""
    value = as_floats(tolerance, "tolerance")
    if value.ndim != 0 or not 0.0 < value <= _LARGEST:
        raise InvalidValueError(
            f"tolerance: expected a number above 0 and up to {_LARGEST:g}, the part of the largest "
            f"torque that counts as nothing, got {tolerance!r:.60}."
        )
    return float(value)


def _samples(model: RobotModel, motion: Motion) -> tuple[Array, Array, Array]:
    if not isinstance(motion, (tuple, list)) and isinstance(motion, TimedMotion):
        motion = motion.resample(_SAMPLES)
    if not isinstance(motion, (tuple, list)) and isinstance(motion, SampledMotion):
        motion = (motion.q, motion.v, motion.a)
    if not isinstance(motion, (tuple, list)) or len(motion) != 3:
        raise InvalidValueError(
            "motion: expected three arrays (q, v, a), each of shape (N, n), or a trajectory, got "
            f"{type(motion).__name__}."
        )
    names = ("motion q", "motion v", "motion a")
    arrays = tuple(as_vector(x, model.n, s) for x, s in zip(motion, names, strict=True))
    _, rows = batch_rows(arrays, names)
    if rows[0].shape[0] == 0:
        raise InvalidValueError(
            "motion: the log is empty; give at least one sample, or none for random motion."
        )
    return rows[0], rows[1], rows[2]


def _constraint_notes(G: Array, columns: int) -> tuple[str, ...]:
    """That joints are constrained; G has independent columns, of so many that were given."""
    n, rank = G.shape
    if rank == n:
        return ()
    free = "one free variable" if rank == 1 else f"{rank} free variables"
    sentence = (
        f"Joint variables are constrained: rank {rank} of {n}, so that the torques are those of "
        f"{free}."
    )
    if rank < columns:
        sentence += (
            f" The {columns} columns of the constraint depend on each other; if no joint is meant "
            "to follow others, the matrix is wrong."
        )
    return (sentence,)


def _transmission_notes(
    model: RobotModel, constraint: ArrayLike | Transmission | None
) -> tuple[str, ...]:
    if model.transmission is None or model.transmission.is_invertible or constraint is not None:
        return ()
    rank = model.transmission.rank
    return (
        f"The transmission of {model.name} is singular, rank {rank} of {model.n}: its joint "
        "variables are constrained, which these parameters of independent joints leave out; with "
        "constraint=model.transmission they are those of the free variables.",
    )


def _bound(model: RobotModel, constraint: ArrayLike | Transmission) -> tuple[Array, int]:
    """Independent columns of a constraint, and how many it has that are not zero."""
    matrix = constraint.matrix if isinstance(constraint, Transmission) else constraint
    G = as_core(matrix, (), "constraint")
    if G.ndim != 2 or G.shape[0] != model.n or G.shape[1] == 0:
        raise ShapeError(
            f"constraint: expected shape ({model.n}, u), a row for each joint, got {G.shape}."
        )
    if not np.any(G):
        raise InvalidValueError("constraint: all zero, so nothing moves.")
    kept = column_basis(G, scale=_inverse_lengths(G)).kept
    return np.ascontiguousarray(G[:, kept]), int(G.any(axis=0).sum())


def _inverse_lengths(G: Array) -> Array:
    lengths = np.linalg.norm(G, axis=0)
    return 1.0 / np.where(lengths > 0.0, lengths, 1.0)
