"""Inverse kinematic models with more tasks than the twist, or with limits.

The twist and the tasks that augment it are the first level of `level_velocities`, the others
follow in their order. Seed book section 1.3.2.4.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from ..._arrays import Array, batch_shape
from ...errors import InvalidValueError
from ...model import RobotModel
from .levels import Level, level_velocities, stacked
from .methods import InverseMethod, as_method
from .request import Request
from .scaling import KnownFrame, Scaling
from .solution import IKMSolution
from .solve import drift_rows, frozen, tell_structure
from .status import IKMStatus

_KEPT = 1.0 - 1e-9
"""Scale of the twist below which limits have slowed it, but for rounding."""

_MOST_ROWS = 127
"""What an int8 can count."""


def solved_by_levels(
    model: RobotModel,
    request: Request,
    known: KnownFrame,
    scaling: Scaling,
    reference: int,
    extra: Array | None,
) -> IKMSolution:
    """The inverse kinematic model with tasks or limits."""
    given = {"q": request.q, request.rate_name: request.rate, "v": request.v, "secondary": extra}
    given = {name: part for name, part in given.items() if part is not None}
    batch = batch_shape(tuple(given.values()), tuple(given))
    q, rate, v, extra = (
        None if part is None else np.broadcast_to(part, (*batch, part.shape[-1]))
        for part in (request.q, request.rate, request.v, extra)
    )
    assert q is not None
    assert rate is not None
    asked = scaling.asked
    rows, rates = _rows(q), _rows(rate)
    N = rows.shape[0]
    method = as_method(request.method)
    J = _jacobians(model, known, rows, reference)
    drift = None if v is None else drift_rows(model, known, rows, _rows(v), reference)
    main = Level(
        np.ascontiguousarray(J[:, asked]),
        rates[:, asked],
        None if drift is None else drift[:, asked],
        scaling.rows[asked],
    )
    augmented = [_level(model, q, v, task, "augmented") for task in _each(request.augmented)]
    lower = [_level(model, q, v, task, "tasks") for task in _each(request.tasks)]
    first = stacked([main, *augmented])
    if min(first.m, model.n) > _MOST_ROWS:
        raise InvalidValueError(
            f"augmented: expected at most {_MOST_ROWS} rows together with the twist, got "
            f"{first.m}; give some of them as tasks of lower priority."
        )
    found = level_velocities(
        [first, *lower],
        None if extra is None else _rows(extra),
        *_bounds(model, q, v, request.limits),
        scaling.weights,
        method,
    )
    size = np.linalg.norm(J * scaling.rows[:, None] * scaling.columns, axis=(1, 2))
    code, reachable, values, rank, damping = _told(first, size, scaling, method)
    tell_structure(model, known, scaling, reference, code, rank, first.m - asked.size)
    slowed = (found.scale[:, 0] < _KEPT) | found.mixed[:, 0]
    code[slowed] = IKMStatus.LIMITED

    def whole(part: Array) -> Array:
        out = np.zeros((N, 6))
        out[:, asked] = part
        return frozen(out, batch)

    m = asked.size
    error = found.error[0][:, :m]
    start = 0.0 if main.drift is None else main.drift
    sizes = np.cumsum([m, *(level.m for level in augmented)])
    task_errors = [found.error[0][:, a:b] for a, b in pairwise(sizes)]
    motion = frozen(np.array(found.v), batch)
    return IKMSolution.checked_before(
        motion if v is None else frozen(_rows(v).copy(), batch),
        frozen(code, batch),
        whole(main.rate - error),
        whole(error),
        whole(reachable[:, :m] / scaling.rows[asked] + start),
        frozen(values, batch),
        frozen(rank, batch),
        frozen(damping, batch),
        frozen(found.scale[:, 0].copy(), batch),
        frozen(np.array(found.limited), batch),
        scaling.mask,
        tuple(frozen(np.array(part), batch) for part in (*task_errors, *found.error[1:])),
        frozen(found.scale[:, 1:].copy(), batch),
        None if v is None else motion,
    )


def _rows(array: Array) -> Array:
    """Rows (N, n) of an array with leading axes."""
    n = array.shape[-1]
    return np.ascontiguousarray(array).reshape(int(np.prod(array.shape[:-1])), n)


def _jacobians(model: RobotModel, known: KnownFrame, q: Array, reference: int) -> Array:
    from ...kernels.poses import jacobians

    J = np.empty((q.shape[0], 6, model.n))
    jacobians(q, model.chain, *known.point.kernel_arguments, reference, J)
    return J


def _each(tasks: Any) -> Any:
    """A single task is a sequence of one."""
    return [tasks] if hasattr(tasks, "level") else tasks


def _level(model: RobotModel, q: Array, v: Array | None, task: Any, name: str) -> Level:
    """Rows of a task at the configurations of a call."""
    wanted = "level" if v is None else "acceleration_level"
    if not callable(getattr(task, wanted, None)) or isinstance(task, type):
        raise InvalidValueError(
            f"{name}: expected tasks, such as TwistTask or JointTask, got {task!r:.80}."
        )
    return task.level(model, q) if v is None else task.acceleration_level(model, q, v)


def _bounds(
    model: RobotModel, q: Array, v: Array | None, limits: Any
) -> tuple[Array | None, Array | None]:
    """Lower and upper bounds of the joint velocities or accelerations, (N, n) each."""
    if limits is None or limits is False:
        return None, None
    from .bounds import JointBounds

    if limits is True:
        limits = JointBounds()
    if not isinstance(limits, JointBounds):
        raise InvalidValueError(
            f"limits: expected JointBounds(...), True or None, got {limits!r:.80}."
        )
    both = (
        limits.velocity_bounds(model, q) if v is None else limits.acceleration_bounds(model, q, v)
    )
    low, high = (_rows(np.broadcast_to(bound, q.shape)) for bound in both)
    return low, high


def _told(
    level: Level, size: Array, scaling: Scaling, method: InverseMethod
) -> tuple[Any, Array, Array, Any, Array]:
    """Status, reachable rates, singular values, rank and damping of the first level alone."""
    from ...kernels.inverse_velocity import inverse_of_rows

    N, m, n = level.J.shape
    weights = np.ones(m) if level.weights is None else level.weights
    rate = level.rate if level.drift is None else level.rate - level.drift
    J = level.J * weights[:, None]
    # rows of tasks are a part of the whole as well
    size = np.maximum(size, np.linalg.norm(J * scaling.columns, axis=(1, 2)))
    k = min(m, n)
    out, codes = np.empty((N, n + m + k + 1)), np.empty((N, 2), np.int8)
    inverse_of_rows(J, rate * weights, size, scaling.columns, *method.kernel_arguments, out, codes)
    reachable, values = out[:, n : n + m], out[:, n + m : n + m + k]
    return codes[:, 0].copy(), reachable, values.copy(), codes[:, 1].copy(), out[:, -1].copy()
