"""From a request to a solution: one compiled pass, or levels where tasks or limits are given."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, batch_rows
from ...errors import InvalidValueError
from ...model import RobotModel
from ..jacobians import reference_of
from .methods import InverseMethod, as_method
from .request import Request, secondary_motion
from .scaling import WHOLE_TWIST, KnownFrame, Scaling, general_rank, known_frame, scaling_of
from .solution import IKMSolution
from .status import IKMStatus

_LARGEST = 1e100
"""Entries of a twist beyond which squares of them, and of what they need, may overflow."""

_SINGULAR, _TOO_FEW = int(IKMStatus.SINGULAR), int(IKMStatus.TOO_FEW_JOINTS)


def solved(model: RobotModel, request: Request) -> IKMSolution:
    """The inverse kinematic model, of the first or the second order."""
    from ...kernels.inverse_velocity import inverse_velocities, packed

    reference = reference_of(request.reference)[1]
    known = known_frame(model, request.frame)
    scaling = scaling_of(model, known, request.mask, request.joint_weights, request.length)
    method = as_method(request.method)
    q, rate, v = request.q, request.rate, request.v
    extra = None
    if request.secondary is not None:
        extra = secondary_motion(model, q, request.secondary)
    if request.augmented or request.tasks or request.limits not in (None, False):
        from .by_levels import solved_by_levels

        return solved_by_levels(model, request, known, scaling, reference, extra)
    parts = {"q": q, request.rate_name: rate, "v": v, "secondary": extra}
    given = {name: part for name, part in parts.items() if part is not None}
    batch, laid = batch_rows(tuple(given.values()), tuple(given))
    rows = dict(zip(given, laid, strict=True))
    q, rate, v, extra = (rows.get(name) for name in parts)
    assert q is not None
    assert rate is not None
    N, n = q.shape
    k = min(scaling.asked.size, n)
    drift = None
    if v is not None:
        drift = drift_rows(model, known, q, v, reference)
        rate = rate - drift
    out, codes = np.empty((N, n + 19 + k)), np.empty((N, 2), np.int8)
    numbers = known.whole, known.numbers
    if scaling is not known.usual:
        numbers = packed(
            model.chain, known.point.kernel_arguments, scaling.asked, scaling.rows, scaling.columns
        )
    inverse_velocities(
        *numbers, q, rate, _none(n) if extra is None else extra, reference,
        *method.kernel_arguments, out, codes,
    )  # fmt: skip
    cuts = np.split(out, [n, n + 6, n + 12, n + 18, n + 18 + k], axis=1)
    out, achieved, error, reachable, values, damping = (part.copy() for part in cuts)
    damping, status, rank = damping[:, 0], codes[:, 0].copy(), codes[:, 1].copy()
    if drift is not None:
        drift *= scaling.mask
        achieved += drift
        reachable += drift
    tell_structure(model, known, scaling, reference, status, rank)
    limits = np.ones(N), np.zeros((N, n), np.bool_), np.empty((N, 0))
    out, status, achieved, error, reachable, values, rank, damping, scale, limited, still = (
        frozen(array, batch)
        for array in (
            out, status, achieved, error, reachable, values, rank, damping, *limits,
        )
    )  # fmt: skip
    accelerations = None
    if v is not None:
        accelerations, out = out, frozen(v.copy(), batch)
    return IKMSolution.checked_before(
        out, status, achieved, error, reachable, values, rank, damping, scale, limited,
        scaling.mask, (), still, accelerations,
    )  # fmt: skip


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
    known = known_frame(model, frame)
    n = q.size
    k = min(6, n)
    out, codes = np.empty((1, n + 19 + k)), np.empty((1, 2), np.int8)
    _kernel()(
        known.whole, known.numbers, q.reshape(1, n), twist.reshape(1, 6), _none(n), number,
        *as_method(method).kernel_arguments, out, codes,
    )  # fmt: skip
    out, codes = out[0], codes[0]
    if codes[0] == _SINGULAR:
        tell_structure(model, known, known.usual, number, codes[:1], codes[1:])
    out.setflags(write=False)
    codes.setflags(write=False)
    scale, limited, still = _unlimited(n)
    return IKMSolution.checked_before(
        out[:n], codes[0, ...], out[n : n + 6], out[n + 6 : n + 12], out[n + 12 : n + 18],
        out[n + 18 : n + 18 + k], codes[1, ...], out[n + 18 + k, ...], scale, limited,
        WHOLE_TWIST, (), still, None,
    )  # fmt: skip


def drift_rows(model: RobotModel, known: KnownFrame, q: Array, v: Array, reference: int) -> Array:
    """Velocity-dependent acceleration of the frame, ``dJ/dt v``. Shapes: q, v (N, n) -> (N, 6)."""
    from ...kernels.poses import accelerations

    out = np.empty((q.shape[0], 6))
    accelerations(
        q, v, np.zeros_like(q), model.chain, *known.point.kernel_arguments, reference, out
    )
    return out


def tell_structure(
    model: RobotModel,
    known: KnownFrame,
    scaling: Scaling,
    reference: int,
    status: NDArray[np.int8],
    rank: NDArray[np.int8],
    added: int = 0,
) -> None:
    """Set TOO_FEW_JOINTS instead of SINGULAR where the rank is always deficient."""
    if status.size == 1 and status.item() != _SINGULAR:
        return
    lacking = status == _SINGULAR
    if lacking.any():
        usual = min(general_rank(model, known, scaling, reference) + added, model.n)
        status[lacking & (rank >= usual)] = _TOO_FEW


def check_size(rate: Array, name: str) -> None:
    """Refuse rates whose squares would overflow."""
    largest = max(map(abs, rate.tolist())) if rate.ndim == 1 else np.abs(rate).max(initial=0.0)
    if largest > _LARGEST:
        raise InvalidValueError(
            f"{name}: expected entries up to {_LARGEST:g}, got {largest:.3g}; check the units."
        )


def frozen(array: NDArray[Any], batch: tuple[int, ...]) -> NDArray[Any]:
    """Rows of a result in the shape of the call, read-only.

    Shapes: array (N, ...) -> (*batch, ...).
    """
    array = array.reshape((*batch, *array.shape[1:]))
    array.setflags(write=False)
    return array


@cache
def _kernel() -> Callable[..., None]:
    from ...kernels.inverse_velocity import inverse_velocities

    return inverse_velocities


@lru_cache(maxsize=64)
def _none(n: int) -> Array:
    return np.empty((0, n))


@lru_cache(maxsize=64)
def _unlimited(n: int) -> tuple[Array, NDArray[np.bool_], Array]:
    """Scale, limited and task scales of a single row without limits."""
    arrays = np.ones(()), np.zeros(n, np.bool_), np.empty(0)
    for array in arrays:
        array.setflags(write=False)
    return arrays
