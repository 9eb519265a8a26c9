"""Checks of the arguments of an inverse model: poses, mask, tolerances, locked joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from operator import index
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_floats, as_number
from ..errors import InvalidValueError, ShapeError, nearest_names
from ..model import RobotModel, check_model
from .loop import joint_chain
from .solver import Tolerances

WHOLE_POSE = (True,) * 6
FARTHEST = 1e6
"""Largest joint value of a reference [rad or m]: beyond it whole turns cost digits."""
FARTHEST_POSITION = 1e100
"""Largest coordinate of a position [m]: beyond it fourth powers of lengths overflow."""


@dataclass(frozen=True, slots=True)
class Task:
    """Mask, locks and options of a call, which select the solver."""

    mask: tuple[bool, ...] = WHOLE_POSE
    in_tool_axes: bool = False
    locks: tuple[tuple[int, float], ...] = ()
    by_arm_angle: bool = False
    relations: tuple[tuple[tuple[float, ...], float], ...] = ()


def poses_of(T: ArrayLike) -> Array:
    """Poses of the tool, checked."""
    poses = se3.as_pose(T)
    farthest = float(np.abs(poses[..., :3, 3]).max(initial=0.0))
    if farthest > FARTHEST_POSITION:
        raise InvalidValueError(
            f"T: expected positions within +-{FARTHEST_POSITION:g} m, got {farthest:g}; "
            "beyond this, rounding errors exceed the size of any arm."
        )
    return poses


def options_of(
    model: Any, mask_axes: Any, limits: Any, position_tolerance: Any, orientation_tolerance: Any
) -> Tolerances:
    """Tolerances of a call, whose options are checked."""
    check_model(model)
    if mask_axes not in ("world", "tool"):
        raise InvalidValueError(f"mask_axes: expected 'world' or 'tool', got {mask_axes!r}.")
    if not isinstance(limits, (bool, np.bool_)):
        raise InvalidValueError(f"limits: expected True or False, got {limits!r}.")
    return Tolerances(
        as_number(position_tolerance, "position_tolerance", above=0.0),
        as_number(orientation_tolerance, "orientation_tolerance", above=0.0),
    )


def locks_of(
    model: RobotModel, lock: Mapping[int | str, float] | None
) -> tuple[tuple[int, float], ...]:
    """Columns and values of locked joints."""
    if lock is None:
        return ()
    if not isinstance(lock, Mapping):
        raise InvalidValueError(
            f"lock: expected a mapping from joints to values, such as {{2: 0.5}}, got {lock!r}."
        )
    rows = model.table.joint_rows
    names = [str(model.table.names[row]) for row in rows]
    columns: dict[int, float] = {}
    for joint, value in lock.items():
        if isinstance(joint, str):
            if joint not in names:
                near = nearest_names(joint, names) or names
                raise InvalidValueError(
                    f"lock: no joint is called {joint!r}; there is {', '.join(near)}."
                )
            column = names.index(joint)
        else:
            try:
                column = index(joint)
            except TypeError:
                raise InvalidValueError(
                    f"lock: expected columns of q or names of joints, got {joint!r}."
                ) from None
            if isinstance(joint, (bool, np.bool_)) or not 0 <= column < model.n:
                raise InvalidValueError(
                    f"lock: columns of q run from 0 to {model.n - 1}, got {joint!r}."
                )
        if column in columns:
            raise InvalidValueError(f"lock: joint {joint!r} is given twice.")
        columns[column] = as_number(value, f"lock: joint {joint!r}")
    return tuple(sorted(columns.items()))


def relations_of(
    model: RobotModel, relations: tuple[ArrayLike, ArrayLike] | None
) -> tuple[tuple[tuple[int, float], ...], tuple[tuple[tuple[float, ...], float], ...]]:
    """Added relations between joints: those of one joint as locks, and rows of the others."""
    if relations is None:
        return (), ()
    if not isinstance(relations, tuple) or len(relations) != 2:
        raise InvalidValueError(
            "relations: expected a pair (A, b) of A q = b, A of shape (m, n) and b of shape (m,)."
        )
    A, b = as_floats(relations[0], "relations: A"), as_floats(relations[1], "relations: b")
    if A.ndim != 2 or A.shape[1] != model.n or b.shape != A.shape[:1]:
        raise ShapeError(
            f"relations: expected A of shape (m, {model.n}) and b of shape (m,), got {A.shape} "
            f"and {b.shape}."
        )
    columns = joint_chain(model).columns
    m = columns.size - 6
    if m < 1:
        raise InvalidValueError(
            f"relations: the tool is moved by {columns.size} joints; relations need more than six."
        )
    if np.delete(A, columns, axis=1).any():
        raise InvalidValueError(
            "relations: a joint that does not move the tool cannot be part of one."
        )
    if len(A) != m or np.linalg.matrix_rank(A) < m:
        raise InvalidValueError(
            f"relations: an arm of {columns.size} joints takes {m} independent "
            f"relation{'s' * (m > 1)}; A has {len(A)} rows, of rank {np.linalg.matrix_rank(A)}."
        )
    locks: dict[int, float] = {}
    while (single := np.flatnonzero(np.count_nonzero(A, axis=1) == 1)).size:
        joint = int(A[single[0]].nonzero()[0][0])
        locks[joint] = float(b[single[0]] / A[single[0], joint])
        b = np.delete(b - A[:, joint] * locks[joint], single[0])
        A = np.delete(A, single[0], axis=0)
        A[:, joint] = 0.0
    rows = tuple((tuple(row), right) for row, right in zip(A.tolist(), b.tolist(), strict=True))
    return tuple(sorted(locks.items())), rows
