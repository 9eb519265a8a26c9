"""Redundant arms with added relations between their joints: ``A q = b``.

The second of the two ways to make a redundant arm definite; the first, to lock joints, is the case
of relations with one joint each. With one relation the infinite family of a pose is sampled by
locking one joint on a grid, each value solved by the family of the other six joints, and the curves
through the samples are walked. Where the relation changes sign along them, or turns round, and
where a sample is within its reach, Newton's method on pose and relation together starts. With more
relations it starts from random postures, which may miss some.

Source: Section 1.2.3 of the book, redundant robots: additional relations.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, read_only
from ..errors import InvalidValueError, ShapeError
from .check import checked
from .closed_form import ClosedForm
from .crossings import Relations, relations, solved_with_relations, within_reach
from .elimination import EliminationArm
from .lock import Locked, locked_chain
from .loop import JointChain
from .motion import jacobians
from .redundant import LockedArms, at_an_end, locked_postures
from .self_motion import MemberCurve, curves_through
from .solver import Found, Prepare, Solver, Tolerances, nothing_found, postures

__all__ = ["Related", "prepare_related"]

GRID = 120
"""Values of the locked joint at which families are sampled."""
STARTS = 400
"""Random postures from which Newton's method starts where there is more than one relation."""
MOST = 64
"""Postures of a pose that are kept: there may be any number, or infinitely many."""
MET = 1e-9
"""Error of a relation up to which it holds."""
_MOVES = 1e-6  # part of the null space below which a joint stands still
_DOUBLE = 1e-6  # smallest singular value, of pose and relations together, at a double root
_CHUNK = 32  # poses searched at a time


@dataclass(frozen=True, slots=True, eq=False)
class Related:
    """A redundant arm whose joints obey relations."""

    chain: JointChain
    wanted: Relations
    sampled: int | None
    inner: str
    arms: LockedArms = field(repr=False)

    @property
    def method(self) -> str:
        """The family in words."""
        if self.sampled is None:
            return (
                "relations between joints: Newton's method from random postures, which may miss "
                "some"
            )
        return (
            f"relation between joints, found along the family of joint {self.sampled + 1}; "
            f"{self.inner}"
        )


def prepare_related(
    chain: JointChain, A: ArrayLike, b: ArrayLike, prepare: Prepare
) -> Solver | None:
    """Prepare a redundant arm for relations ``A q = b`` between its joints.

    Shapes: A (k - 6, k), b (k - 6,).
    """
    rows, right = np.array(A, dtype=np.float64), np.array(b, dtype=np.float64)
    m = chain.k - 6
    if m < 1:
        return None
    if rows.shape != (m, chain.k) or right.shape != (m,):
        raise ShapeError(
            f"A, b: a chain of {chain.k} joints takes {m} relation{'s' * (m > 1)}, A of shape "
            f"{(m, chain.k)} and b of {(m,)}; got {rows.shape} and {right.shape}."
        )
    if not (np.isfinite(rows).all() and np.isfinite(right).all()):
        raise InvalidValueError("A, b: expected finite numbers.")
    if np.linalg.matrix_rank(rows) < m:
        raise InvalidValueError("A: its rows are dependent, so they are less relations than rows.")
    single = np.count_nonzero(rows, axis=1) == 1
    if single.any():
        return _with_locks(chain, rows, right, single, prepare)
    return search_related(chain, rows, right, prepare)


def search_related(chain: JointChain, A: Array, b: Array, prepare: Prepare) -> Related | None:
    """Prepare the search along the families, also where rows name a single joint.

    Shapes: A (k - 6, k), b (k - 6,).
    """
    wanted = relations(chain, read_only(A), read_only(b))
    arms = LockedArms(chain, prepare)
    if chain.k > 7:
        return Related(chain, wanted, None, "", arms)
    best: tuple[float, int, str] | None = None
    for j in _moving(chain):
        solver = arms.solver((j,), () if at_an_end((j,), chain.k) else (0.5,))
        if solver is None:
            continue
        cost = (
            2.0 if isinstance(solver, EliminationArm) else float(not isinstance(solver, ClosedForm))
        )
        # joints inside the chain make a chain of every value
        if not at_an_end((j,), chain.k):
            cost += 10.0 if isinstance(solver, EliminationArm) else 0.5
        if best is None or cost < best[0]:
            best = cost, j, solver.method
    return None if best is None else Related(chain, wanted, best[1], best[2], arms)


@postures.register
def _(solver: Related, U: Array, references: Array, tolerances: Tolerances) -> Found:
    N, chain = U.shape[0], solver.chain
    out = nothing_found(N, MOST, chain.k)
    for start in range(0, N, _CHUNK):
        rows = slice(start, start + _CHUNK)
        wanted = solver.wanted.of(rows)
        q, pose = _starts(solver, wanted, U[rows], references[rows], tolerances)
        q, converged = solved_with_relations(chain, U[rows], wanted, q, pose)
        q, pose = q[converged], pose[converged]
        # angles in (-pi, pi]: a relation without a period must hold for these
        turning = chain.sigma == 0
        q[:, turning] = np.pi - np.remainder(np.pi - q[:, turning], 2.0 * np.pi)
        held = np.abs(wanted.error(q, pose)).max(axis=1, initial=0.0) <= MET
        candidates, there = _gathered(q[held], pose[held], len(U[rows]))
        found = checked(chain, U[rows], candidates, there, tolerances, most=MOST)
        for name in ("q", "valid", "residual"):
            getattr(out, name)[rows] = getattr(found, name)
    _judge(solver, U, out)
    return out


def _with_locks(
    chain: JointChain, A: Array, b: Array, single: NDArray[np.bool_], prepare: Prepare
) -> Solver | None:
    """Rows with one joint are locks; the others are relations of the shorter chain."""
    joints = A[single].nonzero()[1]
    values = b[single] / A[single, joints]
    order = np.argsort(joints)
    joints, values = joints[order], values[order]
    shorter = locked_chain(chain, dict(zip(joints.tolist(), values.tolist(), strict=True)))
    if single.all():
        inner = prepare(shorter)
    else:
        rest = np.setdiff1d(np.arange(chain.k), joints)
        right = b[~single] - A[~single][:, joints] @ values
        inner = prepare_related(shorter, A[~single][:, rest], right, prepare)
    if inner is None:
        return None
    return Locked(chain, read_only(joints, np.int64), read_only(values[None]), (inner,), None)


def _moving(chain: JointChain) -> list[int]:
    """Joints that move along the family of a chain of seven."""
    rng = np.random.default_rng(0)
    along = np.linalg.svd(jacobians(chain, rng.uniform(-2.0, 2.0, (7, chain.k))))[2][:, -1]
    return np.flatnonzero(np.median(np.abs(along), axis=0) > _MOVES).tolist()


def _starts(
    solver: Related, wanted: Relations, U: Array, references: Array, tolerances: Tolerances
) -> tuple[Array, NDArray[np.int64]]:
    """Postures from which Newton's method starts, and their poses."""
    chain, N = solver.chain, U.shape[0]
    reach = np.linalg.norm(chain.D[:, :3, 3], axis=1).sum()
    reach += np.linalg.norm(U[:, :3, 3], axis=1).max(initial=0.0)
    if solver.sampled is None:
        q = np.random.default_rng(0).uniform(-1.0, 1.0, (STARTS, chain.k))
        q *= np.where(chain.sigma == 0, np.pi, reach)
        return np.tile(q, (N, 1)), np.repeat(np.arange(N), STARTS)
    j = solver.sampled
    values = ((np.arange(GRID) + 0.5) / GRID * 2.0 - 1.0) * (
        np.pi if chain.sigma[j] == 0 else reach
    )
    found = locked_postures(
        solver.arms, (j,), np.tile(values, N)[:, None], np.repeat(U, GRID, axis=0),
        np.repeat(references, GRID, axis=0), tolerances,
    )  # fmt: skip
    pose = np.repeat(np.arange(N), GRID)[:, None].repeat(found.q.shape[1], axis=1)[found.valid]
    q = found.q[found.valid]
    near = within_reach(chain, wanted, q, pose)
    starts, poses_of = [q[near]], [pose[near]]
    for n in np.unique(pose):
        for curve in curves_through(chain, U[n], q[pose == n]):
            beside = _brackets(wanted, curve, int(n), chain.sigma)
            starts.append(beside)
            poses_of.append(np.full(len(beside), n))
    starts, poses_of = np.concatenate(starts), np.concatenate(poses_of)
    order = np.argsort(poses_of, kind="stable")
    return starts[order], poses_of[order]


def _brackets(wanted: Relations, curve: MemberCurve, pose: int, sigma: NDArray[np.int64]) -> Array:
    """Points of a curve beside which the relation holds: it changes sign, or turns round."""
    points, A = curve.points, wanted.A[0]
    turning = sigma == 0
    inside = np.where(turning, np.pi - np.remainder(np.pi - points, 2.0 * np.pi), points)
    off = wanted.error(inside, np.full(len(points), pose))[:, 0]
    # steps are far shorter than half a turn, so that the next value follows from the step
    step = np.diff(points, axis=0)
    ahead = off[:-1] + step @ A
    crossed = np.flatnonzero(off[:-1] * ahead <= 0.0)
    share = off[crossed] / np.where(
        off[crossed] == ahead[crossed], 1.0, off[crossed] - ahead[crossed]
    )
    starts = [points[crossed] + share[:, None] * step[crossed]]
    slope = curve.tangents @ A
    turned = np.flatnonzero((slope[:-1] * slope[1:] <= 0.0) & (off[:-1] * ahead > 0.0))
    starts += [points[turned], points[turned + 1]]
    return np.concatenate(starts)


def _gathered(q: Array, pose: NDArray[np.int64], N: int) -> tuple[Array, NDArray[np.bool_]]:
    """Rows ``(B, k)`` of poses ``(B,)``, ascending, as candidates ``(N, C, k)``."""
    count = np.bincount(pose, minlength=N)
    place = np.arange(len(q)) - np.repeat(np.cumsum(count) - count, count)
    candidates = np.full((N, max(int(count.max(initial=0)), 1), q.shape[1]), np.nan)
    candidates[pose, place] = q
    return candidates, np.arange(candidates.shape[1]) < count[:, None]


def _judge(solver: Related, U: Array, found: Found) -> None:
    """Mark double roots and members of families, in place."""
    chain, wanted = solver.chain, solver.wanted
    n, s = np.nonzero(found.valid)
    if n.size == 0:
        return
    q = found.q[n, s]
    J = jacobians(chain, q)
    G = np.concatenate((J, np.broadcast_to(wanted.A, (len(J), *wanted.A.shape))), axis=1)
    _, sizes, along = np.linalg.svd(G)
    flat = sizes[:, -1] < _DOUBLE * sizes[:, 0]
    if not flat.any():
        return
    # a double root lets go of pose and relations when it is left, a family does not
    step = 1e-3
    beside, _ = solved_with_relations(chain, U, wanted, q[flat] + step * along[flat, -1], n[flat])
    away = np.abs(beside - q[flat]).max(axis=1)
    family = away > 0.2 * step
    found.family[n[flat], s[flat]] = family
    found.double[n[flat], s[flat]] = ~family
