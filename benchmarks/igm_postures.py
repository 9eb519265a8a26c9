"""Postures for the accuracy tables: random ones, and singular ones exactly and nearly.

The first three joints of an arm with a spherical wrist, and those of a UR arm, are singular where
one of two scalar products vanishes: the elbow's (the arm is stretched or folded) and the
shoulder's (the meeting point of the wrist is on the first axis, or as near to it as the offset of
the shoulder lets it come). The roots are found by bisection to the last digit, so that the
singular postures are exact within rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

import robotmodels as rm

Array = NDArray[np.float64]

TINY = tuple(10.0**-k for k in range(12, 2, -1))  # 1e-12 ... 1e-3
EXACT = 0.3  # share of the singular postures that are singular to rounding
GRID = 41
REACH = 0.7  # of a prismatic joint without limits [m]


class Kind(Enum):
    """What is singular about a posture."""

    REGULAR = "regular"
    WRIST = "wrist"
    ELBOW = "elbow"
    SHOULDER = "shoulder"
    WRIST_ELBOW = "wrist + elbow"
    WRIST_SHOULDER = "wrist + shoulder"
    ELBOW_SHOULDER = "elbow + shoulder"
    ALL = "wrist + elbow + shoulder"
    DETERMINANT = "det J = 0"
    SQUARE = "joint 3 or 5 at a right or straight angle"


STRUCTURED = tuple(Kind)[1:8]
GENERAL = (Kind.DETERMINANT, Kind.SQUARE)


@dataclass(frozen=True)
class Sample:
    """Postures of one arm: ``q (N, n)``, what is singular in each and how far it is from it."""

    q: Array
    kind: NDArray[np.int64]
    away: Array


def sample(
    model: rm.RobotModel, general: bool, count: int, share: float, rng: np.random.Generator
) -> Sample:
    """Random postures over whole turns, a share of them singular or nearly so."""
    many = round(share * count)
    q = uniform(model, count, rng)
    kind, away = np.zeros(count, np.int64), np.zeros(count)
    kinds = GENERAL if general else STRUCTURED
    rows = np.arange(count - many, count)
    pick = rng.integers(len(kinds), size=many)
    tiny = np.where(
        rng.random(many) < EXACT, 0.0, rng.choice(TINY, many) * rng.choice([-1.0, 1.0], many)
    )
    for k, what in enumerate(kinds):
        chosen = rows[pick == k]
        q[chosen] = singular(model, what, chosen.size, tiny[pick == k], rng)
        kind[chosen], away[chosen] = tuple(Kind).index(what), tiny[pick == k]
    return Sample(q, kind, away)


def uniform(model: rm.RobotModel, count: int, rng: np.random.Generator) -> Array:
    """Random postures: whole turns, prismatic joints within their limits."""
    low, high = -np.pi * np.ones(model.n), np.pi * np.ones(model.n)
    slides = sigma_of(model) == 1
    low[slides] = np.maximum(model.lower[slides], -REACH)
    high[slides] = np.minimum(model.upper[slides], REACH)
    return rng.uniform(low, high, (count, model.n))


def sigma_of(model: rm.RobotModel) -> NDArray[np.int64]:
    """Types of the joints in the columns of q."""
    return model.table.sigma[model.table.joint_rows]


def singular(
    model: rm.RobotModel, what: Kind, count: int, away: Array, rng: np.random.Generator
) -> Array:
    """Postures ``(count, n)`` that are ``away`` from a singular one in each singular joint."""
    kept = np.empty((0, model.n))
    missing = np.empty((0, model.n))
    while kept.shape[0] < count:
        q = uniform(model, 2 * count + 50, rng)
        there = np.ones(len(q), np.bool_)
        step = np.zeros_like(q)
        if what is Kind.DETERMINANT:
            joint = rng.integers(1, 5, len(q))
            for j in range(1, 5):
                rows = joint == j
                q[rows], there[rows] = root(model, q[rows], j, determinant, rng)
                step[rows, j] = 1.0
        elif what is Kind.SQUARE:
            chosen = rng.integers(1, 4, len(q))
            angles = np.array([-np.pi / 2, 0.0, np.pi / 2, np.pi])
            for bit, j in ((1, 2), (2, 4)):
                rows = (chosen & bit) > 0
                q[rows, j], step[rows, j] = rng.choice(angles, int(rows.sum())), 1.0
        else:
            q, step, there = structured(model, what, q, rng)
        kept = np.vstack([kept, q[there]])
        missing = np.vstack([missing, step[there]])
    q = kept[:count] + away[:, None] * missing[:count]
    turns = sigma_of(model) == 0
    q[:, turns] = wrapped(q[:, turns])
    return q


def structured(
    model: rm.RobotModel, what: Kind, q: Array, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Wrist, elbow and shoulder singularities, the elbow first: the shoulder's depends on it."""
    step, there = np.zeros_like(q), np.ones(len(q), np.bool_)
    if "elbow" in what.value or what is Kind.ALL:
        q, found = root(model, q, 2, elbow, rng)
        step[:, 2], there = 1.0, there & found
    if "shoulder" in what.value:
        q, found = root(model, q, 1, shoulder, rng)
        step[:, 1], there = 1.0, there & found
    if "wrist" in what.value:
        q[:, 4] = rng.choice([0.0, np.pi], len(q))
        step[:, 4] = 1.0
    return q, step, there


def wrapped(angles: Array) -> Array:
    """The same angles in (-pi, pi]; those that are there already stay to the last digit."""
    turned = np.pi - (np.pi - angles) % (2 * np.pi)
    return np.where((-np.pi < angles) & (angles <= np.pi), angles, turned)


# --- what vanishes -------------------------------------------------------------------------------


def elbow(model: rm.RobotModel, q: Array) -> Array:
    """(z_2 x O_2 W) x (z_3 x O_3 W) . z_2 for turning joints 2 and 3; z_2 x O_2 W along joint 3.

    W is the meeting point of the wrist, or, with axes 2, 3 and 4 parallel, a point of axis 4.
    """
    frames = rm.link_poses(model, q)
    z, o = frames[..., :3, 2], frames[..., :3, 3]
    W = o[:, 3] if is_parallel(model) else o[:, 4]
    first = np.cross(z[:, 1], W - o[:, 1])
    if sigma_of(model)[2] == 1:
        return np.sum(first * np.cross(z[:, 1], z[:, 2]), axis=1)
    second = np.cross(z[:, 2], W - o[:, 2])
    return np.sum(np.cross(first, second) * z[:, 1], axis=1)


def shoulder(model: rm.RobotModel, q: Array) -> Array:
    """(z_1 x O_1 W) . z_2 with W the meeting point of the last two or three axes."""
    frames = rm.link_poses(model, q)
    z, o = frames[..., :3, 2], frames[..., :3, 3]
    return np.sum(np.cross(z[:, 0], o[:, 4] - o[:, 0]) * z[:, 1], axis=1)


def determinant(model: rm.RobotModel, q: Array) -> Array:
    """det J."""
    return np.linalg.det(rm.jacobian(model, q))


def is_parallel(model: rm.RobotModel) -> bool:
    """Whether axes 2, 3 and 4 are parallel."""
    z = rm.link_poses(model, np.zeros(model.n))[:, :3, 2]
    return bool(np.abs(np.cross(z[1:3], z[2:4])).max() < 1e-9)


def root(
    model: rm.RobotModel,
    q: Array,
    joint: int,
    f: Callable[[rm.RobotModel, Array], Array],
    rng: np.random.Generator,
) -> tuple[Array, NDArray[np.bool_]]:
    """Move one joint to a root of ``f``, any of those there are; which postures have one."""
    if len(q) == 0:
        return q, np.zeros(0, np.bool_)
    slides = sigma_of(model)[joint] == 1
    grid = np.linspace(-REACH, REACH, GRID) if slides else np.linspace(-np.pi, np.pi, GRID)
    grid = grid + rng.uniform(0.0, grid[1] - grid[0])
    many = np.repeat(q[:, None], GRID, axis=1)
    many[..., joint] = grid
    values = f(model, many.reshape(-1, model.n)).reshape(len(q), GRID)
    change = values[:, :-1] * values[:, 1:] < 0.0
    there = np.asarray(change.any(axis=1), np.bool_)
    place = np.argmax(change * rng.random(change.shape), axis=1)
    low, high = grid[place], grid[place + 1]
    sign = np.sign(values[np.arange(len(q)), place])
    moved = q.copy()
    for _ in range(60):
        moved[:, joint] = 0.5 * (low + high)
        same = np.sign(f(model, moved)) == sign
        low, high = np.where(same, moved[:, joint], low), np.where(same, high, moved[:, joint])
    moved[:, joint] = high
    return moved, there
