"""Names of the singular sets at and near a configuration, by the events that hold on them.

At one configuration axes may be aligned or parallel by accident. The singular set near q is sampled
by Newton's iteration from perturbed configurations: an event that holds at all samples names the
set. The events are those that name the factors of the formulas.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._arrays import Array
from .events import ArmGeometry, Event, SingularityKind
from .search import SearchSpace, normals_of, on_set, to_set
from .task import SingularTask, task_jacobians

_STARTS = 24
_PERTURBATION = 0.03
_AWAY = 0.5
_ON_SET = 1e-11
_STEP = 1e-6
_FLAT = 1e-4
_TIGHT, _LOOSE = 1e-7, 1e-5
_TAKES_PART = 1e-4
_TWICE = 2.0
_UNNAMED = SingularityKind.OTHER, "other: the motions of the joints depend on each other"
_NOTHING_SPECIAL = "axes and points show nothing special, but the columns become dependent"


Name = tuple[SingularityKind, str]


@dataclass(frozen=True, slots=True)
class SingularSet:
    """Singular set at or near a configuration, and the geometric conditions that hold on it."""

    events: tuple[Name, ...]
    codimension: int
    weak: float
    known: bool


def arm_geometry(task: SingularTask) -> ArmGeometry:
    """Axes and points of the arm that a task is about."""
    numbers = [int(row) + 1 for row in task.model.table.joint_rows[task.moving]]
    return ArmGeometry(task.model, task.frame, numbers, not task.mask[3:].any())


def singular_sets(
    task: SingularTask, q: Array, dimension: int, arm: ArmGeometry
) -> tuple[SingularSet, ...]:
    """Singular sets at or near a configuration, the nearest first."""
    n = len(q)
    start, free = q / task.joint_scale, np.full(n, np.inf)
    space = SearchSpace(task, dimension, task.joint_scale, start, -free, free)
    perturbation = _PERTURBATION * np.random.default_rng(0).normal(size=(_STARTS, n))
    x = to_set(space, start + perturbation * task.moving, 25)
    away = np.linalg.norm(x - start, axis=1)
    _, weakest, G = on_set(space, x)
    keep = (weakest < _ON_SET) & (away < _AWAY)
    x, G = x[keep][order := np.argsort(away[keep])], G[keep][order]
    if not len(x):
        return ()
    normals, codimension = normals_of(G)
    off = [np.abs(arm.residuals(event, x * task.joint_scale)).max(axis=1) for event in arm.events]
    residual = np.reshape(off, (len(arm.events), len(x))).T
    # where the set is touched twice, its points are known to half of the digits
    flat = np.linalg.norm(G, axis=(1, 2)) < _FLAT
    holding = residual <= np.where(flat, _LOOSE, _TIGHT)[:, None]
    taking = (np.abs(normals) > _TAKES_PART).any(axis=1)
    signature = np.column_stack([codimension, holding, taking])
    _, first = np.unique(signature, axis=0, return_index=True)
    made = [
        (_cause(space, arm, x[i], normals[i, : codimension[i]], holding[i], G[i]), residual[i])
        for i in np.sort(first)
    ]
    return _minimal(arm, made)


def names_at(sets: tuple[SingularSet, ...], tolerance: float) -> tuple[Name, ...]:
    """Kinds of the singular sets on which the configuration is, each with a sentence."""
    here = [s for s in sets if s.known and s.weak <= _zero(tolerance)]
    return _ordered(here or [s for s in sets if not s.known][:1]) or (_UNNAMED,)


def names_near(
    sets: tuple[SingularSet, ...], named: tuple[Name, ...], tolerance: float, near: float
) -> tuple[Name, ...]:
    """Kinds of the singular sets nearby that make a freedom weak, each with a sentence."""
    lost = {kind for kind, _ in named}
    away = [s for s in sets if s.weak > _zero(tolerance)]
    nearby = [s for s in away if s.known and s.weak <= _TWICE * near]
    # where none is that near to first order, the nearest makes it weak
    return tuple(name for name in _ordered(nearby or away[:1]) if name[0] not in lost)


def _ordered(sets: list[SingularSet]) -> tuple[Name, ...]:
    """Names of the sets, each once, from the shoulder to the wrist."""
    order = list(SingularityKind)
    events = dict.fromkeys(event for s in sets for event in s.events)
    names = sorted(events, key=lambda event: order.index(event[0]))
    return tuple((kind, f"{kind.value}: {text}") for kind, text in names)


def _zero(tolerance: float) -> float:
    """First-order estimates below this are zero."""
    return max(10.0 * tolerance, 1e-7)


def _minimal(arm: ArmGeometry, made: list[tuple[SingularSet, Array]]) -> tuple[SingularSet, ...]:
    """Sets that are not intersections of other sets, each once, the nearest first."""
    found: dict[tuple[Name, ...], SingularSet] = {}
    for cause, residual in sorted(made, key=_specialty):
        here = {arm.events[k].sentence for k in np.flatnonzero(residual <= _LOOSE)}
        if cause.events in found:
            nearer = cause.weak < found[cause.events].weak
        else:
            nearer = not any({text for _, text in other} <= here for other in found)
        if nearer:
            found[cause.events] = cause
    return tuple(sorted(found.values(), key=lambda cause: cause.weak))


def _specialty(made: tuple[SingularSet, Array]) -> tuple[int, bool, int, float]:
    cause = made[0]
    return cause.codimension, not cause.known, -len(cause.events), cause.weak


def _cause(
    space: SearchSpace, arm: ArmGeometry, x: Array, normals: Array, holding: Any, G: Array
) -> SingularSet:
    """Events of the set at one of its points, and the distance of the configuration from it."""
    sigma = np.linalg.svd(task_jacobians(space.task, x * space.unit), compute_uv=False)
    top = float(sigma[0]) or 1.0
    named: list[Name] = []
    distances: list[float] = []
    spanned: Array = np.zeros((0, len(x)))
    for k in np.flatnonzero(holding):
        event = arm.events[k]
        D = _gradient(space, arm, event, x)
        size = float(np.linalg.norm(D, 2))
        if size < _STEP:
            continue
        new = _span(D - D @ spanned.T @ spanned, 1e-3 * size)
        # a folded elbow may bring the wrist centre to the shoulder as well: both have their name
        kinds = [kind for kind, _ in named]
        twice = arm.whole_arm and bool(kinds) and SingularityKind.OTHER not in kinds
        twice = twice and event.kind not in (None, SingularityKind.OTHER, *kinds)
        if not twice and (not len(new) or len(spanned) == len(normals)):
            continue
        kind = event.kind or arm.kind_of_joints(_joints(space, arm, new))
        named.append((kind, event.sentence))
        off = arm.residuals(event, (space.start * space.unit)[None])[0]
        distances.append(float(np.linalg.norm(off)) / size)
        spanned = np.vstack([spanned, new])
    known = len(spanned) == len(normals)
    if len(spanned) < len(normals):
        others = _span(normals - normals @ spanned.T @ spanned, 1e-3)
        named.append((arm.kind_of_joints(_joints(space, arm, others)), _NOTHING_SPECIAL))
        distances.append(float(np.linalg.norm(others @ (space.start - x))))
    slope, away = float(np.linalg.norm(G, 2)) / top, float(np.linalg.norm(distances))
    weak = away**2 if slope < _FLAT else slope * away
    return SingularSet(tuple(named), len(normals), weak, known)


def _span(rows: Array, least: float) -> Array:
    """Orthonormal rows."""
    _, size, Vt = np.linalg.svd(rows, full_matrices=False)
    return Vt[size > least]


def _gradient(space: SearchSpace, arm: ArmGeometry, event: Event, x: Array) -> Array:
    """Derivatives (r, n) of the residuals of an event, per unit of distance."""
    shifts = _STEP * np.eye(len(x))
    points = np.concatenate([x + shifts, x - shifts]) * space.unit
    values = arm.residuals(event, points)
    return ((values[: len(x)] - values[len(x) :]) / (2.0 * _STEP)).T


def _joints(space: SearchSpace, arm: ArmGeometry, directions: Array) -> tuple[int, ...]:
    """Numbers of the frames whose joints some directions move."""
    taking = (np.abs(directions) > _TAKES_PART).any(axis=0)
    rows = space.task.model.table.joint_rows
    return tuple(int(row) + 1 for row in rows[taking] if int(row) + 1 in arm.numbers)
