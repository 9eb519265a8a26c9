"""What makes rows in metres and radians, and joints that slide and turn, comparable."""

from __future__ import annotations

import weakref
from dataclasses import dataclass, field
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Rebuilt, as_exact, as_reals, read_only
from ...errors import InvalidValueError
from ...geometry import PRISMATIC
from ...model import FrameOfInterest, RobotModel
from ..lengths import characteristic_length

_SAMPLES = 24
_RANK = 1e-10

WHOLE_TWIST = read_only(np.ones(6), np.bool_)


@dataclass(frozen=True, slots=True, eq=False)
class Scaling(Rebuilt):
    """Rows asked for, and the factors of rows and columns."""

    mask: NDArray[np.bool_]
    asked: NDArray[np.int64]
    rows: Array
    weights: Array
    columns: Array


@dataclass(frozen=True, slots=True, eq=False)
class KnownFrame(Rebuilt):
    """Cached scaling and ranks of a robot's frame."""

    point: FrameOfInterest
    length: float
    usual: Scaling
    whole: NDArray[np.int64]
    numbers: Array
    ranks: dict[tuple[int, ...], int] = field(default_factory=dict)


_KINDS = frozenset((str, int, type(None)))
# by identity: a model's hash reads all of its numbers
_KNOWN: dict[int, tuple[weakref.ref[RobotModel], dict[str | int | None, KnownFrame]]] = {}


def known_frame(model: RobotModel, frame: str | int | None) -> KnownFrame:
    """Cached data of a frame, created on first use."""
    key = id(model)
    entry = _KNOWN.get(key)
    if entry is None or entry[0]() is not model:
        entry = (weakref.ref(model, lambda _: _KNOWN.pop(key, None)), {})
        _KNOWN[key] = entry
    frames = entry[1]
    # True and 1.0 are equal to 1 as keys, but they are not frame numbers
    if frame.__class__ not in _KINDS:
        model.twin.frame(frame)
        frame = int(frame)  # type: ignore[arg-type]
    known = frames.get(frame)
    if known is None:
        point = model.twin.frame(frame)
        from ...kernels.inverse_velocity import packed

        length = characteristic_length(model, frame)
        usual = _scaling(model, length, None, None)
        numbers = packed(
            model.chain, point.kernel_arguments, usual.asked, usual.rows, usual.columns
        )
        known = frames[frame] = KnownFrame(point, length, usual, *numbers)
    return known


def scaling_of(
    model: RobotModel,
    known: KnownFrame,
    mask: ArrayLike | None,
    joint_weights: ArrayLike | None,
    length: float | None,
) -> Scaling:
    """Rows and factors of a call."""
    if mask is None and joint_weights is None and length is None:
        return known.usual
    if length is None:
        length = known.length
    elif isinstance(length, (bool, str)) or np.ndim(length) or not _positive(length):
        raise InvalidValueError(
            f"length: expected a positive number of metres, got {length!r}; None takes the robot's."
        )
    if joint_weights is not None:
        joint_weights = as_exact(joint_weights, (model.n,), "joint_weights")
        if not (joint_weights > 0.0).all():
            raise InvalidValueError(
                f"joint_weights: expected positive numbers, got {joint_weights}; a joint that "
                "should hardly move has a large weight."
            )
    return _scaling(model, float(length), mask, joint_weights)


def general_rank(model: RobotModel, known: KnownFrame, scaling: Scaling, reference: int) -> int:
    """Rank that the rows asked for have at nearly all configurations."""
    key = (reference, *map(int, scaling.asked))
    if key not in known.ranks:
        from ...kernels.poses import jacobians

        rng = np.random.default_rng(0)
        sliding = _sliding(model)
        q = rng.uniform(-np.pi, np.pi, (_SAMPLES, model.n))
        q *= np.where(sliding, known.length / np.pi, 1.0)
        J = np.empty((_SAMPLES, 6, model.n))
        jacobians(q, model.chain, *known.point.kernel_arguments, reference, J)
        J *= known.usual.rows[:, None] * known.usual.columns
        size = np.linalg.norm(J, axis=(1, 2))
        values = np.linalg.svd(J[:, scaling.asked], compute_uv=False)
        known.ranks[key] = int((values > _RANK * size[:, None]).sum(axis=1).max(initial=0))
    return known.ranks[key]


def _scaling(
    model: RobotModel, length: float, mask: ArrayLike | None, joint_weights: Array | None
) -> Scaling:
    rows = np.ones(6)
    rows[:3] = 1.0 / length
    weights = np.ones(model.n)
    weights[_sliding(model)] = 1.0 / length**2
    if joint_weights is not None:
        weights = joint_weights
    asked_for = WHOLE_TWIST if mask is None else _mask(mask)
    return Scaling(
        mask=asked_for,
        asked=read_only(np.flatnonzero(asked_for), np.int64),
        rows=read_only(rows),
        weights=read_only(weights),
        columns=read_only(1.0 / np.sqrt(weights)),
    )


def _mask(mask: ArrayLike) -> NDArray[np.bool_]:
    values = np.asarray(mask)
    if values.dtype == np.bool_:
        values = values.astype(float)
    values = as_exact(values, (6,), "mask")
    if not np.isin(values, (0.0, 1.0)).all() or not values.any():
        raise InvalidValueError(
            "mask: expected six zeros or ones for vx vy vz wx wy wz, at least one of them a one, "
            f"got {mask!r}."
        )
    return read_only(values != 0.0, np.bool_)


def _sliding(model: RobotModel) -> NDArray[np.bool_]:
    return model.table.sigma[model.table.joint_rows] == PRISMATIC


def _positive(value: ArrayLike) -> bool:
    number = float(as_reals(value, "length"))
    return isfinite(number) and number > 0.0
