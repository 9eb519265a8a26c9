"""From a request to a solution: one compiled pass, and levels where tasks or limits are given."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import (
    Array,
    as_exact,
    as_mask,
    as_number,
    as_vector,
    batch_rows,
    batch_shape,
    read_only,
)
from ...errors import InvalidValueError
from ...geometry import PRISMATIC
from ...model import FrameOfInterest, RobotModel
from ..jacobians import reference_of
from ..lengths import characteristic_length
from .bounds import JointBounds
from .criteria import Criterion
from .levels import level_velocities
from .methods import InverseMethod, as_method
from .solution import IKMSolution, IKMStatus
from .tasks import Level, Task

Secondary: TypeAlias = "ArrayLike | Criterion | Sequence[ArrayLike | Criterion]"

_LARGEST = 1e100
"""Entries of a twist beyond which squares of them, and of what they need, may overflow."""
_MOST_ROWS = 127
"""What an int8 can count."""
_KEPT = 1.0 - 1e-9
"""Scale of the twist below which limits have slowed it, but for rounding."""
_SAMPLES, _RANK = 24, 1e-10
_SINGULAR, _TOO_FEW = int(IKMStatus.SINGULAR), int(IKMStatus.TOO_FEW_JOINTS)
_WHOLE_TWIST = read_only(np.ones(6), np.bool_)


class Request(NamedTuple):
    """Arguments of a call, ``q``, ``rate`` and ``v`` checked."""

    q: Array
    rate: Array
    v: Array | None
    frame: str | int | None
    reference: str
    mask: ArrayLike | str | None
    method: InverseMethod | None
    joint_weights: ArrayLike | None
    length: float | None
    secondary: Secondary | None
    augmented: Sequence[Task]
    tasks: Sequence[Task]
    limits: JointBounds | bool | None


class Scaling(NamedTuple):
    """Rows asked for, and the factors that make rows and columns comparable."""

    mask: NDArray[np.bool_]
    asked: NDArray[np.int64]
    rows: Array
    columns: Array


class PreparedFrame:
    """Data of a robot's frame that every call needs."""

    __slots__ = ("length", "packed", "point", "ranks", "usual")

    def __init__(self, model: RobotModel, frame: str | int | None) -> None:
        self.point = model.twin.frame(frame)
        self.length = characteristic_length(model, frame)
        self.usual = _scaling(model, self.length, None, None)
        self.packed = packed(model, self.point, self.usual.asked, *self.usual[2:])
        self.ranks: dict[tuple[int, ...], int] = {}


# by identity: a model's hash reads all of its numbers
_PREPARED: dict[int, tuple[weakref.ref[RobotModel], dict[str | int | None, PreparedFrame]]] = {}


def prepared_frame(model: RobotModel, frame: str | int | None) -> PreparedFrame:
    """Cached data of a frame, created on first use."""
    key = id(model)
    entry = _PREPARED.get(key)
    if entry is None or entry[0]() is not model:
        entry = (weakref.ref(model, lambda _: _PREPARED.pop(key, None)), {})
        _PREPARED[key] = entry
    # True and 1.0 are equal to 1 as keys, but they are not frame numbers
    if frame is not None and frame.__class__ not in (str, int):
        model.twin.frame(frame)
        frame = int(frame)
    prepared = entry[1].get(frame)
    if prepared is None:
        prepared = entry[1][frame] = PreparedFrame(model, frame)
    return prepared


def packed(
    model: RobotModel, point: FrameOfInterest, asked: NDArray[np.int64], rows: Array, columns: Array
) -> tuple[NDArray[np.int64], Array, Array, Array]:
    """Robot, frame, rows and factors for the kernel: each array costs 0.3 us of a single call."""
    chain, (path, rotation, position) = model.chain, point.kernel_arguments
    whole = [(chain.sigma.size, path.size, asked.size), *chain[:3], path, asked]
    return (
        np.concatenate(whole).astype(np.int64),
        np.concatenate([chain.rotation, [chain.base_rotation, rotation]]),
        np.concatenate([chain.position, [chain.base_position, position]]),
        np.concatenate([rows, columns]),
    )


def _scaling(
    model: RobotModel, length: float, mask: ArrayLike | str | None, weights: ArrayLike | None
) -> Scaling:
    if weights is None:
        weights = np.where(_slides(model), 1.0 / length**2, 1.0)
    weights = as_exact(weights, (model.n,), "joint_weights")
    if not (weights > 0.0).all():
        raise InvalidValueError(
            f"joint_weights: expected positive numbers, got {weights}; a joint that should hardly "
            "move has a large weight."
        )
    asked_for = as_mask(mask, ("vx", "vy", "vz", "wx", "wy", "wz"))
    return Scaling(
        mask=read_only(asked_for, np.bool_),
        asked=np.flatnonzero(asked_for),
        rows=np.repeat([1.0 / length, 1.0], 3),
        columns=1.0 / np.sqrt(weights),
    )


def _slides(model: RobotModel) -> NDArray[np.bool_]:
    return model.table.sigma[model.table.joint_rows] == PRISMATIC


def check_size(rate: Array, name: str) -> None:
    """Refuse rates whose squares would overflow."""
    largest = max(map(abs, rate.tolist())) if rate.ndim == 1 else np.abs(rate).max(initial=0.0)
    if largest > _LARGEST:
        raise InvalidValueError(
            f"{name}: expected entries up to {_LARGEST:g}, got {largest:.3g}; check the units."
        )


def solved(model: RobotModel, request: Request) -> IKMSolution:
    """The inverse kinematic model, of the first or the second order."""
    from ...kernels.inverse_velocity import inverse_velocities

    reference = reference_of(request.reference)[1]
    frame = prepared_frame(model, request.frame)
    scaling = frame.usual
    if not (request.mask is None and request.joint_weights is None and request.length is None):
        length = frame.length
        if request.length is not None:
            length = as_number(request.length, "length", above=0.0)
        scaling = _scaling(model, length, request.mask, request.joint_weights)
    method = as_method(request.method)
    second = request.v is not None
    names = ["q", "acceleration" if second else "twist", "v", "secondary"]
    extra = None
    if request.secondary is not None:
        extra = secondary_motion(model, request.q, request.secondary)
    given = {
        name: part
        for name, part in zip(names, (request.q, request.rate, request.v, extra), strict=True)
        if part is not None
    }
    batch, laid = batch_rows(tuple(given.values()), tuple(given))
    q, rate, v, z = (dict(zip(given, laid, strict=True)).get(name) for name in names)
    assert q is not None
    assert rate is not None
    augmented = [_level(model, q, v, batch, task, "augmented") for task in _each(request.augmented)]
    lower = [_level(model, q, v, batch, task, "tasks") for task in _each(request.tasks)]
    bounds = _bounds(model, q, v, request.limits)
    N, n = q.shape
    drift = np.zeros((N, 6))
    if v is not None:
        drift = _drift(model, frame.point, q, v, reference)
    numbers, rows, asked = frame.packed, np.empty((0, 6, n)), scaling.asked
    first = Level(rows, rate, drift, scaling.rows)
    if augmented or lower or bounds is not None:
        J = _jacobians(model, frame.point, q, reference)
        first = _stacked([Level(J, rate, drift, scaling.rows), *augmented])
        asked = np.concatenate([asked, np.arange(6, first.rate.shape[1])])
        rows = first.J
        if min(asked.size, n) > _MOST_ROWS:
            raise InvalidValueError(
                f"augmented: expected at most {_MOST_ROWS} rows together with the twist, got "
                f"{asked.size}; give some of them as tasks of lower priority."
            )
    if scaling is not frame.usual or rows.size:
        numbers = packed(model, frame.point, asked, first.weights, scaling.columns)
    M, k = first.rate.shape[1], min(asked.size, n)
    wanted = first.rate - first.drift
    out, codes = np.empty((N, n + 3 * M + k + 1)), np.empty((N, 2), np.int8)
    inverse_velocities(
        *numbers, q, rows, wanted if z is None else np.hstack([wanted, z]), reference,
        *method.kernel_arguments, out, codes,
    )  # fmt: skip
    cuts = np.cumsum([n, M, M, M, k])
    motion, achieved, error, reachable, values, damping = np.split(out, cuts, axis=1)
    status, rank = codes[:, 0].copy(), codes[:, 1].copy()
    _set_structure(model, frame, scaling, reference, status, rank, asked.size - scaling.asked.size)
    scale, limited = np.ones((N, 1 + len(lower))), np.zeros((N, n), np.bool_)
    errors: tuple[Array, ...] = ()
    if lower or bounds is not None:
        top = Level(rows[:, asked], first.rate[:, asked], first.drift[:, asked],
                    first.weights[asked])  # fmt: skip
        found = level_velocities(
            [top, *lower], np.zeros((N, n)) if z is None else z, bounds, scaling.columns**-2, method
        )
        motion, scale, limited = found.v, found.scale, found.limited
        error = np.zeros((N, M))
        error[:, asked] = found.error[0]
        achieved = np.where(np.isin(np.arange(M), asked), wanted - error, 0.0)
        errors = found.error[1:]
        status[(scale[:, 0] < _KEPT) | found.mixed[:, 0]] = IKMStatus.LIMITED
    start = drift * scaling.mask
    ends = np.cumsum([6, *(level.rate.shape[1] for level in augmented)])
    parts = [error[:, a:b] for a, b in pairwise(ends)]

    def frozen(array: NDArray[Any]) -> NDArray[Any]:
        array = np.array(array, order="C").reshape((*batch, *array.shape[1:]))
        array.setflags(write=False)
        return array

    return IKMSolution(
        frozen(motion if v is None else v),
        frozen(status),
        frozen(achieved[:, :6] + start),
        frozen(error[:, :6]),
        frozen(reachable[:, :6] + start),
        frozen(values),
        frozen(rank),
        frozen(damping[:, 0]),
        frozen(scale[:, 0]),
        frozen(limited),
        scaling.mask,
        tuple(frozen(part) for part in (*parts, *errors)),
        frozen(scale[:, 1:]),
        None if v is None else frozen(motion),
    )


def solved_alone(
    model: RobotModel,
    q: Array,
    twist: Array,
    frame: str | int | None,
    reference: str,
    method: InverseMethod | None,
) -> IKMSolution:
    """Fast path for a single twist without further options."""
    number = reference_of(reference)[1]
    prepared = prepared_frame(model, frame)
    n = q.size
    k = min(6, n)
    out, codes = np.empty((1, n + 19 + k)), np.empty((1, 2), np.int8)
    kernel, none, scale, limited, empty = _constants(n)
    kernel(
        *prepared.packed, q.reshape(1, n), none, twist.reshape(1, 6), number,
        *as_method(method).kernel_arguments, out, codes,
    )  # fmt: skip
    out, codes = out[0], codes[0]
    if codes[0] == _SINGULAR:
        _set_structure(model, prepared, prepared.usual, number, codes[:1], codes[1:])
    out.setflags(write=False)
    codes.setflags(write=False)
    return IKMSolution(
        out[:n], codes[0, ...], out[n : n + 6], out[n + 6 : n + 12], out[n + 12 : n + 18],
        out[n + 18 : n + 18 + k], codes[1, ...], out[n + 18 + k, ...], scale, limited,
        _WHOLE_TWIST, (), empty,
    )  # fmt: skip


@lru_cache(maxsize=64)
def _constants(n: int) -> tuple[Any, ...]:
    """Kernel, no rows, and the scale, limited joints and task scales of a row without limits."""
    from ...kernels.inverse_velocity import inverse_velocities

    arrays = np.empty((0, 6, n)), np.ones(()), np.zeros(n, np.bool_), np.empty(0)
    for array in arrays:
        array.setflags(write=False)
    return inverse_velocities, *arrays


def secondary_motion(model: RobotModel, q: Array, secondary: Secondary) -> Array:
    """Joint motion of lower priority: an array, a gradient, or the sum of several."""
    if isinstance(secondary, type):
        raise InvalidValueError(
            f"secondary: expected an array or a criterion, got the class {secondary.__name__}; a "
            f"class needs its parentheses, {secondary.__name__}(...)."
        )
    if hasattr(secondary, "gradient"):
        return as_vector(secondary.gradient(model, q), model.n, "secondary.gradient(model, q)")  # type: ignore[union-attr]
    if isinstance(secondary, (list, tuple)) and any(hasattr(s, "gradient") for s in secondary):
        parts = tuple(secondary_motion(model, q, part) for part in secondary)
        batch_shape(parts, tuple(f"secondary[{i}]" for i in range(len(parts))))
        return np.asarray(sum(parts[1:], parts[0]))
    return as_vector(secondary, model.n, "secondary")  # type: ignore[arg-type]


def _each(tasks: Any) -> Any:
    """A single task is a sequence of one."""
    return [tasks] if isinstance(tasks, Task) else tasks


def _level(
    model: RobotModel, q: Array, v: Array | None, batch: tuple[int, ...], task: Any, name: str
) -> Level:
    """Rows of a task at the configurations of a call."""
    if not isinstance(task, Task):
        raise InvalidValueError(
            f"{name}: expected tasks, such as TwistTask(...) or JointTask(...), got {task!r:.80}."
        )
    shape = (*batch, model.n)
    return task.level(model, q.reshape(shape), None if v is None else v.reshape(shape))


def _stacked(levels: Sequence[Level]) -> Level:
    """One level of the rows of several."""
    J, rate, drift, weights = zip(*levels, strict=True)
    rows = (np.concatenate(part, axis=1) for part in (J, rate, drift))
    return Level(*rows, weights=np.concatenate(weights))


def _bounds(
    model: RobotModel, q: Array, v: Array | None, limits: Any
) -> tuple[Array, Array] | None:
    """Lower and upper bounds of the joint velocities or accelerations, (N, n) each."""
    if limits is None or limits is False:
        return None
    limits = JointBounds() if limits is True else limits
    if not isinstance(limits, JointBounds):
        raise InvalidValueError(
            f"limits: expected JointBounds(...), True or None, got {limits!r:.80}."
        )
    return (
        limits.velocity_bounds(model, q) if v is None else limits.acceleration_bounds(model, q, v)
    )


def _jacobians(model: RobotModel, point: FrameOfInterest, q: Array, reference: int) -> Array:
    from ...kernels.poses import jacobians

    J = np.empty((len(q), 6, model.n))
    jacobians(q, model.chain, *point.kernel_arguments, reference, J)
    return J


def _drift(model: RobotModel, point: FrameOfInterest, q: Array, v: Array, reference: int) -> Array:
    """Velocity-dependent acceleration of the frame, ``dJ/dt v``. Shapes: q, v (N, n) -> (N, 6)."""
    from ...kernels.poses import accelerations

    out = np.empty((len(q), 6))
    accelerations(q, v, np.zeros_like(q), model.chain, *point.kernel_arguments, reference, out)
    return out


def _set_structure(
    model: RobotModel,
    frame: PreparedFrame,
    scaling: Scaling,
    reference: int,
    status: NDArray[np.int8],
    rank: NDArray[np.int8],
    added: int = 0,
) -> None:
    """Set TOO_FEW_JOINTS instead of SINGULAR where the rank is always deficient."""
    lacking = status == _SINGULAR
    if lacking.any():
        usual = min(_usual_rank(model, frame, scaling, reference) + added, model.n)
        status[lacking & (rank >= usual)] = _TOO_FEW


def _usual_rank(model: RobotModel, frame: PreparedFrame, scaling: Scaling, reference: int) -> int:
    """Rank that the rows asked for have at nearly all configurations."""
    key = (reference, *map(int, scaling.asked))
    if key not in frame.ranks:
        q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_SAMPLES, model.n))
        q *= np.where(_slides(model), frame.length / np.pi, 1.0)
        J = _jacobians(model, frame.point, q, reference)
        J *= frame.usual.rows[:, None] * frame.usual.columns
        size = np.linalg.norm(J, axis=(1, 2))
        values = np.linalg.svd(J[:, scaling.asked], compute_uv=False)
        frame.ranks[key] = int((values > _RANK * size[:, None]).sum(axis=1).max(initial=0))
    return frame.ranks[key]
