"""Rows of the torque equations of a log, thinned out, to compare torques moved in time with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...errors import InvalidValueError
from ...logs import Log
from ...logs.stretches import SAMPLES, stretches
from ...model import RobotModel
from ...regressors import torque_regressor_chunks
from .filters import central_differences, zero_phase

_PER_CUTOFF = 2.5
"""Rows in a period of the cutoff frequency: what is filtered holds no more."""
_MOST = 6000
_STILL = 0.02
_STRETCHES = 20
_PERIODS = 50.0
"""Of the cutoff frequency in a stretch at least, since its ends are lost."""
_RANK = 1e-9
_SMOOTH = ("Ia", "Fv", "offset")


@dataclass(frozen=True, slots=True, eq=False)
class FilteredSamples:
    """A log through a zero-phase filter, and its thinned rows.

    Shapes: q, v, a, tau (N, n); places (T,).
    """

    q: Array
    v: Array
    a: Array
    tau: Array
    places: NDArray[np.int64]
    cutoff: float


@dataclass(frozen=True, slots=True, eq=False)
class ThinRows:
    """Equations of one joint at a time, from filtered and thinned samples.

    Shapes: bases (N_j, r_j), places (N_j,), tau (rows of the log, n).
    """

    bases: tuple[Array, ...]
    places: tuple[NDArray[np.int64], ...]
    tau: Array


def filtered_samples(log: Log, cutoff: float, margin: int, most: int = _MOST) -> FilteredSamples:
    """Filter and differentiate a log, and thin out its rows."""
    step = max(1, int(1.0 / (_PER_CUTOFF * cutoff * log.dt)))
    settled = margin + int(np.ceil(1.0 / (cutoff * log.dt)))
    v, a, q = np.zeros_like(log.q), np.zeros_like(log.q), np.zeros_like(log.q)
    tau = np.array(log.tau)
    taken = []
    for rows in log.recordings():
        if rows.stop - rows.start <= 2 * settled + step:
            continue
        q[rows] = zero_phase(log.q[rows], cutoff, log.dt)
        v[rows] = central_differences(q[rows], log.dt)
        a[rows] = central_differences(v[rows], log.dt)
        tau[rows] = zero_phase(log.tau[rows], cutoff, log.dt)
        taken.append(np.arange(rows.start + settled, rows.stop - settled, step))
    if not taken:
        raise InvalidValueError(
            f"log: no recording is longer than {2 * settled + step} samples, which the filter at "
            f"{cutoff:g} Hz and the delays that are tried need; give a higher cutoff or try fewer."
        )
    places = np.concatenate(taken)
    if len(places) > most:
        places = places[np.linspace(0, len(places) - 1, most).round().astype(int)]
    return FilteredSamples(q, v, a, tau, places, cutoff)


def thin_rows(log: Log, model: RobotModel, cutoff: float, margin: int) -> ThinRows:
    """Equations of each joint, without those near its standstill."""
    x = filtered_samples(log, cutoff, margin)
    places = x.places
    near = int(np.ceil(0.25 / (cutoff * log.dt)))
    moving = _moving(model, x.v, places, near)
    samples = (x.q[places], x.v[places], x.a[places])
    friction = _dry_friction(log, model, x.v, cutoff, places)
    regressors = _rows_by_joint(model, samples, friction, moving)
    bases = []
    for rows in regressors:
        U, s, _ = np.linalg.svd(rows / _sizes(rows), full_matrices=False)
        bases.append(np.ascontiguousarray(U[:, s > _RANK * s.max(initial=0.0)]))
    return ThinRows(tuple(bases), tuple(places[moving[:, j]] for j in range(log.n)), x.tau)


def _rows_by_joint(
    model: RobotModel,
    samples: tuple[Array, Array, Array],
    friction: Array,
    moving: NDArray[np.bool_],
) -> list[Array]:
    """Rows of each joint at which it may be looked at, links and drives, then dry friction."""
    found: list[Array] = []
    counts = np.zeros(model.n, dtype=np.int64)
    for part, W in torque_regressor_chunks(model, *samples, drive=_SMOOTH):
        if not found:
            width = W.shape[2] + friction.shape[2]
            found = [np.empty((int(k), width)) for k in moving.sum(axis=0)]
        for j, rows in enumerate(found):
            use = moving[part, j]
            here = slice(counts[j], counts[j] + int(use.sum()))
            rows[here, : W.shape[2]] = W[use, j]
            rows[here, W.shape[2] :] = friction[part][use, j]
            counts[j] = here.stop
    return found


def looked_at(log: Log, cutoff: float) -> Log:
    """Subset of a long log: at most 1e5 samples in up to 20 evenly spread stretches."""
    length = max(SAMPLES // _STRETCHES, int(_PERIODS / (cutoff * log.dt)))
    return stretches(log, length, max(SAMPLES, length))


def _dry_friction(
    log: Log, model: RobotModel, v: Array, cutoff: float, places: NDArray[np.int64]
) -> Array:
    """Columns of Coulomb friction, whose steps pass the filter as those of the torques do."""
    n, shared = log.n, shared_motors(model)
    steps = np.sign(np.concatenate([v, v @ shared.T], axis=1))
    for rows in log.recordings():
        if rows.stop - rows.start > 1:
            steps[rows] = zero_phase(steps[rows], cutoff, log.dt)
    kept = steps[places]
    columns = np.zeros((len(places), n, n + len(shared)))
    columns[:, range(n), range(n)] = kept[:, :n]
    for k, weights in enumerate(shared):
        columns[:, :, n + k] = kept[:, n + k, None] * weights
    return columns


def shared_motors(model: RobotModel) -> Array:
    """Weights of the joints in the speeds of motors that they share, shape (k, n)."""
    if model.transmission is None:
        return np.zeros((0, model.n))
    motors = np.array(model.transmission.coupled_motors, dtype=int) - 1
    return model.transmission.weights[motors]


def _sizes(rows: Array) -> Array:
    size = np.sqrt((rows**2).sum(axis=0))
    return np.where(size > 0.0, size, 1.0)


def _moving(
    model: RobotModel, v: Array, places: NDArray[np.int64], near: int
) -> NDArray[np.bool_]:  # fmt: skip
    """Rows at which joints, and motors that they share, keep the sign of their velocity."""
    weights = shared_motors(model)
    speed = np.concatenate([v, v @ weights.T], axis=1)
    owner = np.concatenate([np.eye(v.shape[1], dtype=bool), weights != 0.0])
    least = _STILL * np.abs(speed).max(axis=0)
    good = np.abs(speed[places]) > least
    for side in (-near, near):
        good &= np.sign(speed[np.clip(places + side, 0, len(v) - 1)]) == np.sign(speed[places])
    still = ~good | (least == 0.0)
    # a joint that never moves has no friction to be wrong about
    still[:, np.abs(speed).max(axis=0) < 1e-9] = False
    return ~(still @ owner)
