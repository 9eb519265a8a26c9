"""What was brought home, put together: merged, turned, ordered, with the outcome of each start."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...geometry import REVOLUTE
from ...igm.solutions import IGMSolutions, posture_distance
from ...igm.status import IGMStatus
from ...model import RobotModel
from ..calibrated_robot.calibrated import CalibratedRobot
from .corrected_solutions import CorrectedSolutions, CorrectionStatus
from .homing import Flags, Home, Postures

CALIBRATED_ONLY = "of the calibrated robot only"
MERGE = 1e-6
"""Postures closer than this are one [rad, m], as in `igm`."""


def same_as(postures: Postures, robot: CalibratedRobot) -> NDArray[np.bool_]:
    """Whether a candidate converged to the same posture as an earlier one. Shapes: -> (N, C, C)."""
    turns = robot.model.table.sigma[robot.model.table.joint_rows] == REVOLUTE
    N, C = postures.met.shape
    # joint by joint: few are left after the first
    near = postures.met[:, :, None] & postures.met[:, None]
    near &= np.tri(C, k=-1, dtype=np.bool_)
    i, c, k = np.nonzero(near)
    for joint, turn in enumerate(turns):
        way = np.abs(postures.q[i, c, joint] - postures.q[i, k, joint])
        if turn:
            way = np.minimum(way, 2.0 * pi - way)
        close = way < MERGE
        i, c, k = i[close], c[close], k[close]
    same = np.zeros((N, C, C), np.bool_)
    same[i, c, k] = True
    return same


def put_together(
    robot: CalibratedRobot,
    batch: tuple[int, ...],
    starts: IGMSolutions,
    first: Postures,
    more: Postures,
    nominal: Array,
    targets: Array,
    references: Array,
    given: bool,
    limits: bool,
    home: Home,
    status: NDArray[np.int8],
    closest: Array,
    missing: Array,
) -> CorrectedSolutions:
    """Merge the candidates of all poses into the result of `corrected_igm`.

    Shapes: nominal (N, C, n); targets (N, 4, 4); references, closest (N, n); status (N,); missing
    (N, 6).
    """
    model, n, N = robot.model, robot.model.n, len(targets)
    C = first.q.shape[1]
    every = first.and_also(more)
    every.free[:, :C] |= starts.free_joints & home.is_redundant
    every.family[:, :C] |= starts.family_joints & home.is_redundant
    same = same_as(every, robot)
    merged: Flags = np.asarray(same.any(axis=-1), np.bool_)
    kept = every.met & ~merged
    readable = every.readable
    reading = np.where(readable[..., None], every.reading, 0.0)
    reading = _turned(home, every.q, reading, references[:, None], given, limits)
    inside = _within(reading, model)
    residual = every.residual
    if not robot.bending.is_zero:
        # a gain makes a turn of a joint no whole turn of its reading, which bends otherwise
        held = every.free | home.locked
        reading, residual = home.settled(targets, reading, residual, kept & readable, held)
        inside = _within(reading, model)
        kept &= residual <= home.tolerance
    chosen = kept & readable & (inside | (not limits))
    into = np.broadcast_to(np.arange(same.shape[1]), merged.shape)
    if same.size:
        into = np.where(merged, same.argmax(axis=-1), into)
    # a double root, or what is free, is known of either of two that are one
    for name in ("double", "free", "family"):
        values = getattr(every, name)
        for c in range(C, into.shape[1]):
            at = np.flatnonzero(merged[:, c])
            values[at, into[at, c]] |= values[at, c]

    correction = np.full((N, C), int(CorrectionStatus.NO_POSTURE), np.int8)
    for code, where in (
        (CorrectionStatus.VANISHED, starts.valid),
        (CorrectionStatus.ARRIVED, first.met),
        (CorrectionStatus.NO_READING, first.met & ~readable[:, :C]),
        (CorrectionStatus.OUTSIDE_LIMITS, (first.met & ~inside[:, :C]) if limits else False),
        (CorrectionStatus.MERGED, merged[:, :C]),
    ):
        correction[where & starts.valid] = int(code)

    distance = posture_distance(reading, references[:, None], home.turns & (not limits))
    key = distance if given else np.broadcast_to(np.arange(float(into.shape[1])), distance.shape)
    order = np.argsort(np.where(chosen, key, np.inf), axis=1, kind="stable")
    S = int(chosen.sum(axis=1).max(initial=0))
    rank = np.argsort(order, axis=1)
    row = np.where(np.take_along_axis(chosen, into, 1), np.take_along_axis(rank, into, 1), -1)

    def packed(values: NDArray[Any], empty: Any) -> NDArray[Any]:
        at = order[:, :S].reshape(N, S, *(1,) * (values.ndim - 2))
        rows = np.take_along_axis(values, at, axis=1)
        absent = ~np.take_along_axis(chosen, order[:, :S], axis=1)
        rows[absent] = empty
        return rows.reshape(*batch, *rows.shape[1:])

    codes = np.full(into.shape, len(starts.labels), np.int16)
    codes[:, :C] = starts.code
    found: Flags = np.asarray(chosen.any(axis=1), np.bool_)
    loose = (every.free & chosen[..., None]).any(axis=(1, 2)) | (found & home.is_redundant)
    beyond = (kept & readable).any(axis=1) & ~found
    # the calibrated table alone may meet a pose less closely than was asked
    wrong = np.isin(status, (IGMStatus.REACHED, IGMStatus.REACHED_FAMILY)) & ~found
    status = np.where(wrong, IGMStatus.NOT_CONVERGED, status)
    status = np.where(beyond, IGMStatus.OUTSIDE_LIMITS, status)
    status = np.where(found, np.where(loose, IGMStatus.REACHED_FAMILY, IGMStatus.REACHED), status)
    solutions = IGMSolutions(
        q=packed(reading, np.nan),
        valid=packed(chosen, False),
        residual=packed(residual, np.nan),
        within_limits=packed(inside & chosen, False),
        code=packed(codes, -1),
        labels=(*starts.labels, CALIBRATED_ONLY),
        status=status.astype(np.int8).reshape(batch),
        double=packed(every.double, False),
        free_joints=packed(every.free, False),
        family_joints=packed(every.family, False),
        method=f"{starts.method}; brought to the calibrated table by Newton steps",
        periodic=home.turns & (not limits),
        mask=home.mask,
        closest=np.where(found[:, None], np.nan, closest).reshape(*batch, n),
        missing=np.where(found[:, None], np.nan, missing).reshape(*batch, 6),
    )
    return CorrectedSolutions(
        solutions,
        packed(home.errors.actual(reading), np.nan),
        nominal.reshape(*batch, C, n),
        correction.reshape(*batch, C),
        row[:, :C].reshape(*batch, C),
    )


def _turned(
    home: Home, q: Array, reading: Array, references: Array, given: bool, limits: bool
) -> Array:
    """Readings with whole turns of the joints added.

    Nearest to the reference (else to mid-range) inside the limits, or in (-pi, pi].
    """
    turns, errors = home.turns, home.errors
    if limits:
        low, high = home.robot.model.lower, home.robot.model.upper
        both = np.isfinite(low) & np.isfinite(high)
        with np.errstate(invalid="ignore"):
            middle = np.where(both, 0.5 * (low + high), 0.0)
        aim = references if given else np.broadcast_to(middle, references.shape)
    else:
        low, high = np.full(len(turns), -pi), np.full(len(turns), pi)
        aim = np.zeros_like(references)
    count = np.zeros(q.shape)
    turned = reading
    for _ in range(4):
        # the turn nearest to the aim; inside the limits if one is
        step = np.round((aim - turned) / (2.0 * pi))
        with np.errstate(invalid="ignore"):
            least = np.ceil((low - turned) / (2.0 * pi) - 1e-15)
            most = np.floor((high - turned) / (2.0 * pi) + 1e-15)
        step = np.where(least <= most, np.clip(step, least, most), 0.0) * turns
        if not step.any():
            break
        count += step
        turned = reading + 2.0 * pi * count
        if not errors.is_zero:
            known = errors.reading(q + 2.0 * pi * count)
            turned = np.where(np.isfinite(known), known, turned)
    return turned


def _within(reading: Array, model: RobotModel) -> Flags:
    """Whether readings are inside the limits, (N, C)."""
    inside = (reading >= model.lower) & (reading <= model.upper)
    return np.asarray(inside.all(axis=-1), np.bool_)
