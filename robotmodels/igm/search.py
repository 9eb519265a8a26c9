"""Numeric search: Levenberg-Marquardt iterations on all constraints, from many configurations.

It serves where no closed form does (masks that free two rotations, arms outside all families,
relations), completes self-motions at their reference, and finds the nearest value of a joint at
which a pose is reached. Budgets count evaluations; solutions may be missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .constraints import PATH, Constraints, in_half_open_turn
from .loop import JointChain
from .motion import random_postures, singular_rows
from .postures import Postures, assembled, difference, no_postures, side_by_side
from .solver import Tolerances, postures

STARTS = 200
"""Random starts of a pose."""
STEPS = 50
"""Iterations from one start."""
SLIDES = 60
"""Steps along a self-motion to the nearest value of a joint."""
ROWS = 4096  # configurations worked on at a time
PATIENCE = 0.9  # share of the cost left after five steps above which a start is given up
SINGULAR = 1e-6  # singular values of the Jacobian beside the largest that count as zero
CLOSE = 0.05  # the same below which a second root may be close
BESIDE = (0.01, 0.03, 0.1, 0.3)  # distances along the null direction at which it is looked for
REPEATS = 20  # singular rows in a row without a new member after which the others are left out
FOLD = 1e-3  # singular configurations closer than this may come from one root


@dataclass(frozen=True, slots=True, eq=False)
class ManyStarts:
    """Solver by Newton-like iterations from many starts. Shapes: starts (STARTS, k)."""

    wanted: Constraints
    starts: Array

    @property
    def chain(self) -> JointChain:
        """The arm that is solved."""
        return self.wanted.chain

    @property
    def method(self) -> str:
        """The method in words."""
        return f"Newton's method from {len(self.starts)} starts: postures may be missing"


def prepare_many_starts(wanted: Constraints) -> ManyStarts:
    """Draw the starts."""
    rng = np.random.default_rng(0)
    return ManyStarts(wanted, random_postures(wanted.chain, STARTS, rng))


@postures.register
def _(solver: ManyStarts, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    chunk, parts = max(ROWS // STARTS, 1), []
    for start in range(0, len(U), chunk):
        goals, wanted = U[start : start + chunk], references[start : start + chunk]
        starts = np.tile(solver.starts, (len(goals), 1, 1))
        q = np.concatenate([wanted[:, None], starts], axis=1).reshape(-1, solver.chain.k)
        pose = np.repeat(np.arange(len(goals)), len(solver.starts) + 1)
        part = solutions_from(solver.wanted, goals, q, pose, wanted, tolerances)
        parts.append((np.arange(start, start + len(goals)), part))
    return assembled(len(U), solver.chain.k, parts)


# --- iterations -----------------------------------------------------------------------------------


def refined(wanted: Constraints, U: Array, q: Array, held: Sequence[int] = ()) -> Array:
    """Levenberg-Marquardt iterations. Shapes: U (B, 4, 4), q (B, k) -> (B, k)."""
    return wanted.descents(U, q[:, None], STEPS, PATIENCE, held)[0]


def nearest_value(
    wanted: Constraints, U: Array, q: Array, joint: int, value: Array, held: Sequence[int] = ()
) -> Array:
    """Configurations of the same self-motions with a joint as near to a value as they reach.

    Shapes: U (B, 4, 4), q (B, k), value (B,) -> (B, k).
    """
    chain, q = wanted.chain, q.copy()
    period = 2.0 * np.pi if chain.sigma[joint] == 0 else np.inf
    active, longest = np.arange(len(q)), np.full(len(q), 0.2)
    along, slope = _gradient(wanted, U, q, joint, held)
    for _ in range(SLIDES):
        d = _wrapped(value[active] - q[active, joint], period)
        going = (np.abs(d) > 1e-13) & (longest > 1e-6)
        active, longest, d = active[going], longest[going], d[going]
        along, slope = along[going], slope[going]
        if active.size == 0:
            break
        length = np.minimum(longest, np.abs(d) / np.maximum(slope, 1e-9))
        trial = q[active] + (np.sign(d) * length)[:, None] * along
        arrives = length < longest
        trial[arrives, joint] = q[active[arrives], joint] + d[arrives]
        for rows, fixed in ((arrives, (*held, joint)), (~arrives, held)):
            trial[rows] = refined(wanted, U[active[rows]], trial[rows], fixed)
        closer = np.abs(_wrapped(value[active] - trial[:, joint], period)) < np.abs(d)
        kept = wanted.met(U[active], trial, PATH)[1] & closer
        # the slope ahead of the step, negative beyond a turning point: its zero by the secant
        onward, next_slope = _gradient(wanted, U[active], trial, joint, held)
        ahead = np.sign(np.sum(onward * along, axis=1)) * next_slope
        secant = np.where(ahead < slope, np.abs(ahead) / np.maximum(slope - ahead, 1e-12), 2.0)
        longest = np.clip(length * np.where(kept, np.clip(secant, 0.01, 2.0), 0.25), 0.0, 0.3)
        q[active[kept]] = trial[kept]
        along[kept], slope[kept] = onward[kept], next_slope[kept]
    return q


def _wrapped(d: Array, period: float) -> Array:
    return d if np.isinf(period) else d - period * np.round(d / period)


def _gradient(
    wanted: Constraints, U: Array, q: Array, joint: int, held: Sequence[int]
) -> tuple[Array, Array]:
    """Unit directions of self-motions along which a joint grows most, and by how much."""
    along = _null_projectors(wanted, U, q, held)[:, :, joint]
    slope = np.sqrt(np.maximum(along[:, joint], 0.0))
    return along / np.maximum(slope, 1e-12)[:, None], slope


def _null_projectors(wanted: Constraints, U: Array, q: Array, held: Sequence[int]) -> Array:
    """Projectors on the joint motions that keep the constraints to first order, (B, k, k)."""
    J = wanted.jacobians(U, q)
    at = list(held)
    fixed = np.zeros((len(J), len(at), J.shape[2]))
    fixed[:, range(len(at)), at] = 1.0
    _, sizes, rows = np.linalg.svd(np.concatenate([J, fixed], axis=1))
    padded = np.zeros(rows.shape[:2])
    padded[:, : sizes.shape[1]] = sizes
    null = np.where((padded <= SINGULAR * padded[:, :1])[..., None], rows, 0.0)
    return np.swapaxes(null, 1, 2) @ null


# --- solutions ------------------------------------------------------------------------------------


def collected(
    wanted: Constraints, U: Array, q: Array, pose: NDArray[np.int64], tolerances: Tolerances
) -> Postures:
    """Configurations ``(B, k)`` of poses ``(B,)`` that meet them, merged and packed."""
    chain, N = wanted.chain, len(U)
    q = in_half_open_turn(chain.sigma, q)
    residual, met = wanted.met(U[pose], q, tolerances)
    order = np.flatnonzero(met)
    order = order[np.lexsort((residual[order] > 1e-12, pose[order]))]
    pose, q, residual = pose[order], q[order], residual[order]
    counts = np.bincount(pose, minlength=N)
    out = no_postures(N, int(counts.max(initial=0)), chain.k)
    place = np.arange(len(pose)) - np.repeat(np.cumsum(counts) - counts, counts)
    out.q[pose, place], out.valid[pose, place], out.residual[pose, place] = q, True, residual
    return out.merge(chain.sigma)


def solutions_from(
    wanted: Constraints,
    U: Array,
    q: Array,
    pose: NDArray[np.int64],
    references: Array,
    tolerances: Tolerances,
) -> Postures:
    """Solutions reached from starts (B, k) of poses (B,), self-motions at their reference."""
    found = collected(wanted, U, refined(wanted, U[pose], q), pose, tolerances)
    n, s = np.nonzero(found.valid)
    q = found.q[n, s]
    _, sizes, rows = np.linalg.svd(wanted.jacobians(U[n], q))
    if sizes.shape[1] == wanted.chain.k:
        # zero singular values are of double roots and self-motions, which have no other root there
        least, most = sizes[:, -1], sizes[:, 0]
        close = np.flatnonzero((least > SINGULAR * most) & (least < CLOSE * most))
        distances = np.array(BESIDE + tuple(-d for d in BESIDE))
        beside = q[close, None] + distances[:, None] * rows[close, None, -1]
        more = np.repeat(n[close], len(distances))
        partners = refined(wanted, U[more], beside.reshape(-1, wanted.chain.k))
        pose, q = np.concatenate([n, more]), np.concatenate([q, partners])
        found = collected(wanted, U, q, pose, tolerances)
    return classified(wanted, U, found, references, tolerances)


def classified(
    wanted: Constraints, U: Array, found: Postures, references: Array, tolerances: Tolerances
) -> Postures:
    """Double roots merged and marked; self-motions brought to their reference."""
    chain = wanted.chain
    n, s = np.nonzero(found.valid)
    if n.size == 0:
        return found
    J = wanted.jacobians(U[n], found.q[n, s])
    # fewer constraints than joints: a self-motion everywhere
    flat = singular_rows(J, FOLD)[0] if J.shape[1] >= chain.k else np.arange(n.size)
    if flat.size == 0:
        return found
    poses = np.unique(n[flat])
    others = np.setdiff1d(np.arange(len(U)), poses)
    parts = [(others, found.take(others))]
    for i in poses:
        rows = s[flat][n[flat] == i]
        one = _singular_pose(
            wanted, U[i : i + 1], found.take(np.array([i])), rows, references[i], tolerances
        )
        parts.append((np.array([i]), one))
    return assembled(len(U), chain.k, parts).merge(chain.sigma)


def _singular_pose(
    wanted: Constraints,
    U: Array,
    found: Postures,
    rows: NDArray[np.int64],
    reference: Array,
    tolerances: Tolerances,
) -> Postures:
    """Solutions of one pose, some of whose rows are singular."""
    chain, members = wanted.chain, no_postures(1, 0, wanted.chain.k)
    order = rows[np.argsort(found.residual[0, rows], kind="stable")]
    for place, i in enumerate(order):
        if not found.valid[0, i]:
            continue
        others = order[place + 1 :]
        gaps = difference(chain.sigma, found.q[0, others], found.q[0, i])
        for k in np.flatnonzero((np.abs(gaps).max(axis=1) < FOLD) & found.valid[0, others]):
            # what lies between two copies of one root meets the pose as well
            between = (found.q[0, i] + 0.5 * gaps[k])[None]
            if wanted.met(U, between, tolerances)[1][0]:
                found.valid[0, others[k]], found.double[0, i] = False, True
    rows = rows[found.valid[0, rows]]
    goals, nothing_new = np.repeat(U, len(rows), axis=0), 0
    null = _null_projectors(wanted, goals, found.q[0, rows], ())
    for i in rows[null.any(axis=(1, 2))]:
        if nothing_new == REPEATS:  # the others are taken for members of the same self-motions
            found.valid[0, i] = False
            continue
        q, free = completed(wanted, U, found.q[0, i], reference)
        if free.any():
            found.valid[0, i] = False
            part = collected(wanted, U, q, np.zeros(len(q), np.int64), tolerances)
            part.free[0], part.family[0] = part.valid[0][:, None] & free, part.valid[0]
            # most rows lead to members that are known: merged at once they stay few
            before = members.valid.sum()
            members = side_by_side([members, part]).merge(chain.sigma)
            nothing_new = nothing_new + 1 if members.valid.sum() == before else 0
        else:
            found.double[0, i] = True
    return side_by_side([members, found]).merge(chain.sigma)


def completed(
    wanted: Constraints, U: Array, q: Array, reference: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Members of the self-motion through q with its free joints at the reference, (M, k), (k,)."""
    k, held = wanted.chain.k, []
    while len(held) < k:
        null = _null_projectors(wanted, U, q[None], held)[0]
        joint = _moving_joint(wanted, U, q, null, held)
        if joint is None:
            break
        q = nearest_value(wanted, U, q[None], joint, reference[[joint]], held)[0]
        held.append(joint)
    free = np.isin(np.arange(k), held)
    if not held or len(held) == k:
        return q[None], free
    # a closed curve passes the value more than once
    starts = random_postures(wanted.chain, STARTS // 4, np.random.default_rng(1))
    starts[:, free] = q[free]
    goals = np.repeat(U, len(starts), axis=0)
    others = refined(wanted, goals, starts, held)
    others = others[wanted.met(goals, others, PATH)[1]]
    return np.concatenate([q[None], others]), free


def _moving_joint(
    wanted: Constraints, U: Array, q: Array, null: Array, held: Sequence[int]
) -> int | None:
    """First joint that moves along a self-motion through q; None at a double root."""
    moves = np.flatnonzero(np.diag(null) > SINGULAR)
    for joint in moves:
        direction = null[:, joint] / np.sqrt(null[joint, joint])
        beside = refined(wanted, U, (q + 1e-2 * direction)[None], held)
        gone = np.abs(beside[0] - q)
        if wanted.met(U, beside, PATH)[1][0] and gone.max() > 1e-3:
            return int(joint)
    return None
