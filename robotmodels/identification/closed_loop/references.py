"""What a controller is asked to follow, and what is fed forward."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array
from ...logs import Log
from ...model import RobotModel
from ..preparation.filters import central_differences
from ..preparation.processing import Processing
from ..preparation.signals import Piece, piece_signals


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """References of N samples and of the sample behind them. Shapes: q, v, feed (N + 1, n)."""

    q: Array
    v: Array
    feed: Array


def references(
    log: Log,
    processing: Processing,
    piece: Piece,
    first: int,
    last: int,
    feed_forward: RobotModel | None,
    width: Array,
) -> Targets:
    """References for rows of a recording."""
    if log.q_ref is None:
        stop = min(last + 1, piece.high)
        rows = Piece(first, stop, piece.low, piece.high, piece.begin, piece.end)
        found = piece_signals(log, processing, rows, 0)
        q, v, a = found.q, found.v, found.a
    else:
        stop = min(last + 1, piece.end)
        margin = 2 * processing.accuracy
        low, high = max(first - margin, piece.begin), min(stop + margin, piece.end)
        inner = slice(first - low, stop - low)
        q_ref = np.array(log.q_ref[low:high])
        if log.v_ref is not None:
            v_ref = np.array(log.v_ref[low:high])
        else:
            v_ref = _differences(q_ref, log.dt, processing.accuracy)
        a_ref = _differences(v_ref, log.dt, processing.accuracy)
        q, v, a = q_ref[inner], v_ref[inner], a_ref[inner]
    if stop == last:
        q, v, a = (np.vstack((x, x[-1:])) for x in (q, v, a))
    q, v, a = (np.ascontiguousarray(x) for x in (q, v, a))
    return Targets(q, v, _fed(feed_forward, q, v, a, width))


def _differences(x: Array, dt: float, accuracy: int) -> Array:
    return central_differences(x, dt, accuracy) if len(x) > 1 else np.zeros(x.shape)


def _fed(robot: RobotModel | None, q: Array, v: Array, a: Array, width: Array) -> Array:
    """Torques of a robot, which may be one of base parameters; it may come to rest."""
    if robot is None:
        return np.zeros(q.shape)
    from ...kernels.newton_euler import joint_torques

    tau = np.empty(q.shape)
    joint_torques(q, v, a, *robot.chain, robot.inertia.values, robot.gravity, tau)
    drives = robot.drive_matrices
    if drives is None:
        return tau
    tau += a @ drives.rotor + v @ drives.viscous + drives.offset
    tau += drives.coulomb * direction(v, width)
    if robot.transmission is not None and drives.coupling.size:
        motors = np.array(robot.transmission.coupled_motors) - 1
        turns = direction(v @ drives.coupling.T, width[motors])
        tau += (turns * drives.coupled_coulomb) @ drives.coupling
    return tau


def direction(v: Array, width: Array) -> Array:
    """Direction of dry friction: linear over the width on either side of rest, then the sign.

    Shapes: v (N, n), width (n,) -> (N, n).
    """
    return np.where(np.abs(v) > width, np.sign(v), v / np.where(width > 0.0, width, 1.0))
