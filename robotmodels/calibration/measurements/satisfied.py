"""Readings at which a robot satisfies the constraint of a contact exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..._arrays import Array
from ...geometry import FIXED, PRISMATIC
from ..differential import differential_model
from ..extended_table import Element, Skeleton
from ..parameters import GeometricParameter, GeometricParameters
from . import Evaluation, Measurement

_SATISFIED = 1e-13
_STEPS = 40
_FURTHEST = 0.3
"""Longest step of a joint in one iteration, rad or m."""


def satisfied_measurement(
    parameters: GeometricParameters, measurement: Measurement, xi: Array, fixtures: Array
) -> Measurement | None:
    """The measurement with readings moved by the least step to zero residuals."""
    if not measurement.views:
        return measurement
    motions = _joint_motions(parameters.skeleton)
    none = np.zeros(len(motions))
    size = parameters.skeleton.size
    scale = np.array([size if unit == "m" else 1.0 for unit in measurement.units])
    both = replace(parameters, entries=parameters.entries + motions.entries)
    values = np.concatenate([xi, none])
    q = [view.q.copy() for view in measurement.views]
    count = len(motions)
    # ends that are seen at the same readings (two arms of a tree) move together
    views = measurement.views
    first = [next(i for i, v in enumerate(views) if v.q is view.q) for view in views]
    own = sorted(set(first))
    P = len(parameters)
    satisfied = np.zeros(measurement.blocks, dtype=bool)
    for _ in range(_STEPS):
        seen = []
        moving = measurement.with_configurations(q)
        for view in moving.views:
            # what depends on the readings goes with them, so a step of Newton's is not exact
            # for it; it converges all the same, as such errors are small
            found = differential_model(both, view.q, values, view.frame)
            seen.append(Evaluation(found.T, found.psi[..., P:]))
        blank = [Evaluation(e.T, np.zeros_like(e.psi)) for e in seen]
        parts = [
            measurement.linearise([*blank[:k], seen[k], *blank[k + 1 :]], fixtures)
            for k in range(len(seen))
        ]
        residual = parts[0].residual
        off = np.abs(residual / scale).max(axis=1)
        satisfied = off < _SATISFIED
        if satisfied.all():
            break
        together = [
            sum((p.by_parameters for p, f in zip(parts, first, strict=True) if f == g), 0.0)
            for g in own
        ]
        J = np.concatenate(together, axis=-1)
        step = -(np.linalg.pinv(J, rcond=1e-6) @ residual[..., None])[..., 0]
        step *= np.minimum(1.0, _FURTHEST / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
        for k, f in enumerate(first):
            at = own.index(f) * count
            q[k] = q[k] + step[:, at : at + count]
    kept = np.flatnonzero(satisfied | (off < 1e-10))
    if not len(kept):
        return None
    moved = measurement.with_configurations(q)
    return moved if len(kept) == measurement.blocks else moved.subset(kept)


def _joint_motions(skeleton: Skeleton) -> GeometricParameters:
    """The motion of every joint as a parameter, in the order of the joints."""
    rows = [r for r in range(skeleton.rows) if skeleton.sigma[r] != FIXED]
    return GeometricParameters(
        skeleton,
        tuple(
            GeometricParameter(
                r, Element.R if skeleton.sigma[r] == PRISMATIC else Element.THETA, source=r
            )
            for r in sorted(rows, key=lambda r: int(skeleton.joint[r]))
        ),
    )
