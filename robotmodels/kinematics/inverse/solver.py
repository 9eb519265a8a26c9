"""Solution of a request: one compiled pass, or levels where tasks or limits are given."""

from __future__ import annotations

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
from ...model import RobotModel
from ..jacobians import COMPONENTS, Reference, jacobian
from ..lengths import ModelCache, characteristic_length
from ..singular.events import random_postures
from ..velocities import dkm_second_order
from .bounds import JointBounds
from .criteria import Criterion
from .methods import InverseMethod, as_method
from .solution import IKMSolution, IKMStatus
from .tasks import Level, Task

Secondary: TypeAlias = "ArrayLike | Criterion | Sequence[ArrayLike | Criterion]"

_LARGEST = 1e100
"""Entries of a twist beyond which squares of them, and of what they need, may overflow."""
_MOST_ROWS = 127
"""Largest count that fits int8."""
_KEPT = 1.0 - 1e-9
"""Scale of the twist below which limits have slowed it, but for rounding."""
_SAMPLES, _RANK = 24, 1e-10
_SINGULAR, _TOO_FEW = int(IKMStatus.SINGULAR), int(IKMStatus.TOO_FEW_JOINTS)


class Scaling(NamedTuple):
    """Rows requested, and the factors that make rows and columns comparable."""

    mask: NDArray[np.bool_]
    selected: NDArray[np.int64]
    rows: Array
    columns: Array


_SCALINGS, _RANKS = ModelCache(), ModelCache()


def _scaling(
    model: RobotModel,
    frame: str | int | None,
    mask: ArrayLike | str | None = None,
    weights: ArrayLike | None = None,
    length: float | None = None,
) -> Scaling:
    """Scaling of the arguments of a call."""
    size = characteristic_length(model, frame)
    if length is not None:
        size = as_number(length, "length", above=0.0)
    if weights is None:
        slides = model.table.sigma[model.table.joint_rows] == PRISMATIC
        weights = np.where(slides, 1.0 / size**2, 1.0)
    weights = as_exact(weights, (model.n,), "joint_weights")
    if not (weights > 0.0).all():
        raise InvalidValueError(
            f"joint_weights: expected positive numbers, got {weights}; a joint that should hardly "
            "move has a large weight."
        )
    selected = as_mask(mask, COMPONENTS)
    return Scaling(
        mask=read_only(selected, np.bool_),
        selected=np.flatnonzero(selected),
        rows=np.repeat([1.0 / size, 1.0], 3),
        columns=1.0 / np.sqrt(weights),
    )


def _usual_scaling(model: RobotModel, frame: str | int | None) -> Scaling:
    """Scaling of a call without mask, weights and length."""
    key = model.twin.frame(frame).pin_id
    return _SCALINGS(model, key, lambda: _scaling(model, frame))


def check_size(rate: Array, name: str) -> None:
    """Refuse rates whose squares would overflow."""
    largest = max(map(abs, rate.tolist())) if rate.ndim == 1 else np.abs(rate).max(initial=0.0)
    if largest > _LARGEST:
        raise InvalidValueError(
            f"{name}: expected entries up to {_LARGEST:g}, got {largest:.3g}; check the units."
        )


def solved(
    model: RobotModel,
    q: Array,
    rate: Array,
    v: Array | None,
    frame: str | int | None,
    reference: Reference,
    mask: ArrayLike | str | None,
    method: InverseMethod | None,
    joint_weights: ArrayLike | None,
    length: float | None,
    secondary: Secondary | None,
    augmented: Sequence[Task],
    tasks: Sequence[Task],
    limits: JointBounds | bool | None,
) -> IKMSolution:
    """The inverse kinematic model, of the first order or, with velocities v, of the second."""
    from ...kernels.inverse_velocity import inverse_velocities

    scaling = _scaling(model, frame, mask, joint_weights, length)
    method = as_method(method)
    given = {"q": q, "twist": rate} if v is None else {"q": q, "acceleration": rate, "v": v}
    if secondary is not None:
        given["secondary"] = secondary_motion(model, q, secondary)
    batch, laid = batch_rows(tuple(given.values()), tuple(given))
    q, rate, *rest = laid
    z = rest.pop() if secondary is not None else None
    v = rest.pop() if v is not None else None
    above = _levels(model, q, v, batch, augmented, "augmented")
    lower = _levels(model, q, v, batch, tasks, "tasks")
    bounds = _bounds(model, q, v, limits)
    N, n = q.shape
    drift = np.zeros((N, 6))
    if v is not None:
        drift = dkm_second_order(model, q, v, np.zeros((N, n)), frame, reference)
    J = jacobian(model, q, frame, reference)
    first = _stacked([Level(J, rate, drift, scaling.rows), *above])
    M = first.rate.shape[1]
    selected = np.concatenate([scaling.selected, np.arange(6, M)])
    k = min(selected.size, n)
    if k > _MOST_ROWS:
        raise InvalidValueError(
            f"augmented: expected at most {_MOST_ROWS} rows together with the twist, got "
            f"{selected.size}; give some of them as tasks of lower priority."
        )
    wanted = first.rate - first.drift
    out, codes = np.empty((N, n + 3 * M + k + 1)), np.empty((N, 2), np.int8)
    inverse_velocities(
        first.J, wanted if z is None else np.hstack([wanted, z]), first.weights, scaling.columns,
        selected, *method.kernel_arguments, out, codes,
    )  # fmt: skip
    motion, achieved, error, reachable, values, damping = np.split(
        out, np.cumsum([n, M, M, M, k]), axis=1
    )
    status, rank = codes[:, 0].copy(), codes[:, 1].copy()
    _set_structure(model, frame, reference, scaling.selected, status, rank, M - 6)
    scale, limited = np.ones((N, 1 + len(lower))), np.zeros((N, n), np.bool_)
    errors: tuple[Array, ...] = ()
    if lower or bounds is not None:
        parts = (part[:, selected] for part in first[:3])
        levels = [Level(*parts, weights=first.weights[selected]), *lower]
        wish = np.zeros((N, n)) if z is None else z
        motion, scale, mixed, found = by_levels(levels, wish, bounds, scaling.columns, method)
        if bounds is not None:
            limited = (motion <= bounds[0]) | (motion >= bounds[1])
        error = np.zeros((N, M))
        error[:, selected] = found[0]
        achieved = np.where(np.isin(np.arange(M), selected), wanted - error, 0.0)
        errors = found[1:]
        status[(scale[:, 0] < _KEPT) | (mixed[:, 0] > 0.0)] = IKMStatus.LIMITED
    start = drift * scaling.mask
    ends = np.cumsum([6, *(level.rate.shape[1] for level in above)])

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
        tuple(frozen(part) for part in (*(error[:, a:b] for a, b in pairwise(ends)), *errors)),
        frozen(scale[:, 1:]),
        None if v is None else frozen(motion),
    )


def by_levels(
    levels: Sequence[Level],
    wish: Array,
    bounds: tuple[Array, Array] | None,
    columns: Array,
    method: InverseMethod,
) -> tuple[Array, Array, Array, tuple[Array, ...]]:
    """Joint motion for levels in strict order: itself, scales and marks of levels, their errors.

    B. Siciliano and J.-J. Slotine 1991; the bounds by the dual method of D. Goldfarb and A. Idnani
    1983. The motion of a marked level has not the direction of its rate.
    """
    from ...kernels.level_velocities import level_velocities

    N, n = wish.shape
    starts = np.cumsum([0, *(level.J.shape[1] for level in levels)])
    first = _stacked(levels)
    v, error = np.empty((N, n)), np.empty((N, starts[-1]))
    scale, mixed = np.empty((2, N, len(levels)))
    low, high = (np.ascontiguousarray(b) for b in bounds or (wish, wish))
    level_velocities(
        first.J, first.rate, first.drift, first.weights, starts, np.ascontiguousarray(wish), low,
        high, int(bounds is not None), 1.0 / columns, np.array(method.kernel_arguments), v, scale,
        mixed, error,
    )  # fmt: skip
    return v, scale, mixed, tuple(error[:, a:b] for a, b in pairwise(starts))


def solved_alone(
    model: RobotModel,
    q: Array,
    twist: Array,
    frame: str | int | None,
    reference: Reference,
    method: InverseMethod | None,
) -> IKMSolution:
    """Fast path for a single twist without further options."""
    mask, selected, rows, columns = _usual_scaling(model, frame)
    J = jacobian(model, q, frame, reference)
    n = q.size
    k = min(6, n)
    out, codes = np.empty((1, n + 19 + k)), np.empty((1, 2), np.int8)
    kernel, scale, limited, empty = _constants(n)
    kernel(
        J[None], twist[None], rows, columns, selected, *as_method(method).kernel_arguments, out,
        codes,
    )  # fmt: skip
    out, codes = out[0], codes[0]
    if codes[0] == _SINGULAR:
        _set_structure(model, frame, reference, selected, codes[:1], codes[1:], 0)
    out.setflags(write=False)
    codes.setflags(write=False)
    return IKMSolution(
        out[:n], codes[0, ...], out[n : n + 6], out[n + 6 : n + 12], out[n + 12 : n + 18],
        out[n + 18 : n + 18 + k], codes[1, ...], out[n + 18 + k, ...], scale, limited,
        mask, (), empty,
    )  # fmt: skip


@lru_cache(maxsize=64)
def _constants(n: int) -> tuple[Any, ...]:
    """Kernel, and the scale, limited joints and task scales of a row without limits."""
    from ...kernels.inverse_velocity import inverse_velocities

    arrays = np.ones(()), np.zeros(n, np.bool_), np.empty(0)
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


def _levels(
    model: RobotModel, q: Array, v: Array | None, batch: tuple[int, ...], tasks: Any, name: str
) -> list[Level]:
    """Rows of tasks, or of a single one, at the configurations of a call."""
    tasks, shape = [tasks] if isinstance(tasks, Task) else tasks, (*batch, model.n)
    for task in tasks:
        if not isinstance(task, Task):
            raise InvalidValueError(
                f"{name}: expected tasks, such as TwistTask(...) or JointTask(...), got "
                f"{task!r:.80}."
            )
    speeds = None if v is None else v.reshape(shape)
    return [task.level(model, q.reshape(shape), speeds) for task in tasks]


def _stacked(levels: Sequence[Level]) -> Level:
    """One level of the rows of several."""
    J, rate, drift, weights = zip(*levels, strict=True)
    rows = (np.ascontiguousarray(np.concatenate(part, axis=1)) for part in (J, rate, drift))
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


def _set_structure(
    model: RobotModel,
    frame: str | int | None,
    reference: Reference,
    selected: NDArray[np.int64],
    status: NDArray[np.int8],
    rank: NDArray[np.int8],
    added: int,
) -> None:
    """Set TOO_FEW_JOINTS instead of SINGULAR where the rank is always deficient."""
    lacking = status == _SINGULAR
    if lacking.any():
        key = (model.twin.frame(frame).pin_id, reference, *map(int, selected))
        usual = _RANKS(model, key, lambda: _usual_rank(model, frame, reference, selected))
        status[lacking & (rank >= min(usual + added, model.n))] = _TOO_FEW


def _usual_rank(
    model: RobotModel, frame: str | int | None, reference: Reference, selected: NDArray[np.int64]
) -> int:
    """Rank that the rows requested have at nearly all configurations."""
    scaling = _usual_scaling(model, frame)
    q = random_postures(model, _SAMPLES, seed=0)
    J = jacobian(model, q, frame, reference) * (scaling.rows[:, None] * scaling.columns)
    size = np.linalg.norm(J, axis=(1, 2))
    values = np.linalg.svd(J[:, selected], compute_uv=False)
    return int((values > _RANK * size[:, None]).sum(axis=1).max(initial=0))
