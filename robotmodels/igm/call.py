"""What `igm` does: arguments checked, the family of the arm asked, the result put together."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_core, as_vector, batch_rows, read_only
from ..errors import InvalidValueError
from ..model import RobotModel
from .asked import FARTHEST, Task, above_zero, locks_of, mask_of, poses_of, relations_of
from .by_plan import TOLERANCES
from .known import known_arm, solver_for
from .rows import Call, Rows, rows_by_family, rows_by_plan, rows_of_doubtful
from .solutions import IGMSolutions
from .solver import Tolerances

NO_FAMILY = "numeric search for one posture: no family of closed forms serves this arm"
"""What a result says of its method where there is none but the search."""

_WHOLE, _EXACT = Task(), Tolerances()
_FLOAT = np.dtype(np.float64)
_ALL = read_only(np.ones(6), np.bool_)


def solved(
    model: RobotModel,
    T: ArrayLike,
    q_ref: ArrayLike | None,
    mask: ArrayLike | None,
    mask_axes: str,
    limits: bool,
    lock: Mapping[int | str, float] | None,
    arm_angle: ArrayLike | None,
    position_tolerance: float,
    orientation_tolerance: float,
    relations: tuple[ArrayLike, ArrayLike] | None,
) -> IGMSolutions:
    """The inverse geometric model; see `igm`."""
    if (
        mask is lock is arm_angle is relations is None
        and limits is False
        and mask_axes == "world"
        and position_tolerance == 1e-9 == orientation_tolerance
        and type(T) is np.ndarray
        and T.shape == (4, 4)
        and type(model) is RobotModel
    ):
        found = _single(model, T, q_ref)
        if found is not None:
            return found
    if not isinstance(model, RobotModel):
        raise InvalidValueError(f"model: expected a RobotModel, got {type(model).__name__}.")
    if mask_axes not in ("world", "tool"):
        raise InvalidValueError(f"mask_axes: expected 'world' or 'tool', got {mask_axes!r}.")
    if not isinstance(limits, (bool, np.bool_)):
        raise InvalidValueError(f"limits: expected True or False, got {limits!r}.")
    extras = (mask, lock, arm_angle, relations)
    ordinary = all(extra is None for extra in extras)
    if ordinary and position_tolerance == 1e-9 == orientation_tolerance:
        task, tolerances = _WHOLE, _EXACT
    else:
        tolerances = Tolerances(
            above_zero(position_tolerance, "position_tolerance"),
            above_zero(orientation_tolerance, "orientation_tolerance"),
        )
        task = Task(
            mask=tuple(mask_of(mask).tolist()),
            in_tool_axes=mask_axes == "tool",
            locks=locks_of(model, lock),
            by_arm_angle=arm_angle is not None,
            relations=relations_of(model, relations),
        )
        if relations is not None and sum(extra is not None for extra in extras) > 1:
            raise InvalidValueError(
                "relations: not together with mask, lock or arm_angle; a locked joint is a "
                "relation too, with a single 1 in its row."
            )
    arm = known_arm(model, task == _WHOLE)
    given, limits = q_ref is not None, bool(limits)
    solver = arm.plan if task is _WHOLE else None
    rows = None
    if solver is not None:
        # proper arrays, which are nearly all, pass a quick look; others are told or mended
        batch, poses, references = _as_they_are(model, T, q_ref, limits)
        rows = rows_by_plan(arm, poses, references, given, limits)
    if rows is None:
        batch, poses, references = _checked(model, T, q_ref, limits)
        solver = solver_for(model, arm, task)
        if task is _WHOLE and solver is arm.plan is not None:
            rows = rows_by_plan(arm, poses, references, given, limits)
    if rows is None or rows.most < 0:
        call = Call(model, arm, task, solver, given, limits, tolerances)
        if rows is not None:
            rows = rows_of_doubtful(call, poses, references, rows)
        elif arm_angle is None:
            rows = rows_by_family(call, poses, references)
        else:
            # every pose once for every angle, the angles behind
            angles = as_core(arm_angle, (), "arm_angle")
            psi = np.tile(angles.ravel(), poses.shape[0])
            poses, references = (np.repeat(a, angles.size, axis=0) for a in (poses, references))
            batch = (*batch, *angles.shape)
            rows = rows_by_family(call, poses, references, psi)
    method = NO_FAMILY if solver is None else solver.method
    return _solutions(batch, rows, method, arm.never if limits else arm.turns, task)


def _single(model: RobotModel, T: Array, q_ref: ArrayLike | None) -> IGMSolutions | None:
    """One pose by the plan of the arm, in as few steps as can be; None if it takes more."""
    arm = known_arm(model)
    kernel = arm.kernel
    if kernel is None or T.dtype is not _FLOAT or not T.flags.c_contiguous:
        return None
    if q_ref is None:
        reference = arm.zero
    elif type(q_ref) is np.ndarray and q_ref.dtype is _FLOAT and q_ref.shape == arm.turns.shape:
        reference = np.ascontiguousarray(q_ref).reshape(1, -1)
    else:
        return None
    S, n = arm.most, arm.turns.size
    q, residual, flags = np.empty((1, S, n)), np.empty((1, S)), np.empty((2, 1, S), np.bool_)
    code, status = np.empty((1, S), np.int16), np.empty(1, np.int8)
    most = kernel(
        arm.instructions, arm.numbers, TOLERANCES, T.reshape(1, 4, 4), reference,
        q_ref is not None, arm.branch_of_way, arm.joints, False, q, residual, flags, code, status,
    )  # fmt: skip
    if most < 0:
        return None
    for array in (q, residual, flags, code, status):
        array.setflags(write=False)
    still = _small_still((most,))
    loose = _small_still((most, n))
    return IGMSolutions.checked_before(
        q[0, :most], flags[0, 0, :most], residual[0, :most], flags[1, 0, :most], code[0, :most],
        arm.labels, status.reshape(()), still, loose, loose, arm.method, arm.turns, _ALL, None,
        None, None,
    )  # fmt: skip


def _as_they_are(
    model: RobotModel, T: ArrayLike, q_ref: ArrayLike | None, limits: bool
) -> tuple[tuple[int, ...], Array, Array]:
    """Batch shape, poses (N, 4, 4), references (N, n); unchecked where that costs nothing."""
    if (
        not isinstance(T, np.ndarray)
        or T.dtype != np.float64
        or not T.flags.c_contiguous
        or T.shape[-2:] != (4, 4)
        or (q_ref is not None and T.ndim != 2)
    ):
        return _checked(model, T, q_ref, limits)
    poses = T.reshape(-1, 4, 4)
    if q_ref is None:
        return T.shape[:-2], poses, np.zeros((poses.shape[0], model.n))
    q = np.asarray(q_ref)
    if limits or q.dtype != np.float64 or q.shape != (model.n,) or not q.flags.c_contiguous:
        return _checked(model, T, q_ref, limits)
    return (), poses, q.reshape(1, -1)


def _checked(
    model: RobotModel, T: ArrayLike, q_ref: ArrayLike | None, limits: bool
) -> tuple[tuple[int, ...], Array, Array]:
    """The same, checked, or an error."""
    poses = poses_of(T)
    flat = poses.reshape(*poses.shape[:-2], 16)
    reference = np.zeros(model.n) if q_ref is None else as_vector(q_ref, model.n, "q_ref")
    if np.abs(reference).max(initial=0.0) > FARTHEST:
        raise InvalidValueError(
            f"q_ref: expected joint values within +-{FARTHEST:g} rad or m, got "
            f"{float(np.abs(reference).max()):g}; whole turns more say nothing."
        )
    batch, (rows, references) = batch_rows((flat, reference), ("T", "q_ref"))
    if limits:
        references = np.clip(references, model.lower, model.upper)
    return batch, rows.reshape(-1, 4, 4), references


def _solutions(
    batch: tuple[int, ...], rows: Rows, method: str, periodic: NDArray[np.bool_], task: Task
) -> IGMSolutions:
    """The result of a call."""
    most, n = rows.most, periodic.size

    def cut(array: NDArray[Any] | None, *core: int) -> NDArray[Any]:
        shape = (*batch, most, *core)
        if array is None:
            return _still(shape)
        if most < array.shape[1]:
            array = np.ascontiguousarray(array[:, :most])
        return frozen(array, shape)

    def frozen(array: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
        array = array.reshape(shape)
        array.setflags(write=False)
        return array

    return IGMSolutions.checked_before(
        cut(rows.q, n),
        cut(rows.valid),
        cut(rows.residual),
        cut(rows.inside),
        cut(rows.code),
        rows.labels,
        frozen(rows.status, batch),
        cut(rows.double),
        cut(rows.free, n),
        cut(rows.family, n),
        method,
        periodic,
        _mask_array(task.mask),
        None,
        None if rows.closest is None else frozen(rows.closest, (*batch, n)),
        None if rows.missing is None else frozen(rows.missing, (*batch, 6)),
    )


def _still(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Flags none of which is set; those of a single pose are kept."""
    return _small_still(shape) if len(shape) < 3 else _new_still(shape)


def _new_still(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    # zeros that nobody touches take no time
    flags = np.zeros(shape, np.bool_)
    flags.setflags(write=False)
    return flags


@lru_cache(maxsize=256)
def _small_still(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    return _new_still(shape)


@lru_cache(maxsize=64)
def _mask_array(mask: tuple[bool, ...]) -> NDArray[np.bool_]:
    return read_only(mask, np.bool_)
