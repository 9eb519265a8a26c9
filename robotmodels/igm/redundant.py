"""More joints than the task has components: joints take their reference until six are left.

The joint nearest to the base that moves along the infinite family of a pose takes its reference
value, then the next one that moves given those before, until six joints are left, which their own
family solves. Where no posture exists at the reference, members of the family are looked for on a
grid and walked along it to the nearest value at which one does.

Virtual joints, which stand for components that a task leaves open, are never set.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations, islice
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array, read_only
from .arm_angle import prepare_arm_angle
from .check import checked
from .lock import at_ends, locked_chain, stacked, whole_postures
from .loop import JointChain
from .motion import jacobians
from .self_motion import settle_families
from .solver import Found, Prepare, Solver, Tolerances, nothing_found, postures

__all__ = [
    "LockedArms",
    "Redundant",
    "at_an_end",
    "locked_postures",
    "members",
    "prepare_redundant",
]

TRIALS = 40
"""Choices of joints that are tried when an arm is prepared."""
GRID = 48
"""Values of the last free joint at which members of a family are looked for."""
KEPT = 128
"""Chains with locked joints that an arm remembers."""
MANY = 256
"""Values, of several free joints together, at which members are looked for."""
WALKED = 8, 3
"""Members of a pose that are walked along their family: of one dimension, of more."""
_MOVES = 1e-6  # part of a null space below which a joint stands still
_SAME = 1e-7  # values of free joints closer than this are one [rad, m]
_CHUNK = 64  # poses that are searched at a time


class LockedArms:
    """Chains with locked joints that were prepared: the most recent ones of one arm."""

    def __init__(self, chain: JointChain, prepare: Prepare) -> None:
        self.chain, self.prepare = chain, prepare
        self._known: OrderedDict[tuple[int | float, ...], Solver | None] = OrderedDict()
        self._lock = Lock()

    def solver(self, positions: tuple[int, ...], values: tuple[float, ...]) -> Solver | None:
        """What serves the other joints, None if nothing does.

        Parameters
        ----------
        positions : tuple of int
            Locked joints, ascending.
        values : tuple of float
            Their values; left out (empty) when they are the first or the last joints of the
            chain, whose values only move the poses.

        Returns
        -------
        Solver or None
            Of the chain without them.
        """
        key = (*positions, *values)
        with self._lock:
            if key in self._known:
                self._known.move_to_end(key)
                return self._known[key]
        if values:
            rest = locked_chain(self.chain, dict(zip(positions, values, strict=True)))
        else:
            first, last = _ends(positions, np.zeros((1, len(positions))))
            rest, _ = at_ends(self.chain, np.eye(4)[None], first, last)
        solver = self.prepare(rest)
        with self._lock:
            self._known[key] = solver
            while len(self._known) > KEPT:
                self._known.popitem(last=False)
        return solver

    def __reduce__(self) -> tuple[type, tuple[JointChain, Prepare]]:
        return type(self), (self.chain, self.prepare)


@dataclass(frozen=True, slots=True, eq=False)
class Redundant:
    """An arm with more joints than its task needs.

    Parameters
    ----------
    chain : JointChain
        The arm, virtual joints among its joints.
    order : tuple of int
        Joints that take the reference, ascending.
    sampled : tuple of int
        Joints by which members of a family are found: the same if the arm without them has a
        family of its own.
    last : tuple of int
        The last joints that may be set, by which members are found as well: what stands at the
        reference may leave few poses in reach, a wrist leaves most. Empty where they are the same
        or have no family without them.
    inner : str
        Method of the joints that are left.
    arms : LockedArms
        Chains prepared so far.
    """

    chain: JointChain
    order: tuple[int, ...]
    sampled: tuple[int, ...]
    last: tuple[int, ...]
    inner: str
    arms: LockedArms = field(repr=False)

    @property
    def method(self) -> str:
        """The family in words."""
        numbers = ", ".join(str(j + 1) for j in self.order)
        joints = f"joint{'' if len(self.order) == 1 else 's'} {numbers} at the reference"
        if self.order == self.sampled:
            return f"{joints}; {self.inner}"
        others = ", ".join(str(j + 1) for j in self.sampled)
        return f"{joints}, found from joint{'' if len(self.sampled) == 1 else 's'} {others}; " + (
            self.inner
        )


def prepare_redundant(
    chain: JointChain, prepare: Prepare, lockable: Sequence[int] | None = None
) -> Solver | None:
    """Choose the joints of a redundant arm that take their reference, and prepare the others.

    Parameters
    ----------
    chain : JointChain
        More than six joints.
    prepare : callable
        Chooses the family of a shorter chain.
    lockable : sequence of int, optional
        Positions of joints that may take their reference. Default: those with a column, which
        virtual joints have not.

    Returns
    -------
    Solver or None
        `ArmAngle` for an arm with spherical shoulder and wrist, else `Redundant`. None if there
        are six joints or less, if virtual joints alone make the arm redundant, or if no choice of
        locked joints leaves an arm with a family.

    Notes
    -----
    Which joints move is asked at random postures: it is the same at almost all. Postures of a pose
    without one at the reference come from a walk along the families found on a grid; a piece of a
    family that lies between its points altogether is not seen.

    Examples
    --------
    >>> from robotmodels.igm.families import prepare
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.robots import load
    >>> prepare_redundant(joint_chain(load("panda")), prepare).order
    (0,)
    """
    if chain.k <= 6:
        return None
    real = np.flatnonzero(chain.columns >= 0) if lockable is None else np.unique(lockable)
    if real.size == chain.k == 7:
        angle = prepare_arm_angle(chain)
        if angle is not None:
            return angle
    order, dimension = _moving_in_order(chain, real)
    if len(order) < dimension:
        return None
    arms = LockedArms(chain, prepare)
    # a value that is special for no arm: at 0 axes may be aligned that are not elsewhere
    typical = tuple(0.5 + 0.1 * i for i in range(dimension))
    # joints that swing far along the family first: an elbow hardly moves
    swing = _swings(chain)
    choices = sorted(
        islice(combinations(real.tolist(), dimension), TRIALS),
        key=lambda joints: -min(swing[list(joints)]),
    )
    for sampled in (order, *choices):
        inner = arms.solver(sampled, () if at_an_end(sampled, chain.k) else typical)
        if inner is not None:
            last = tuple(real[-dimension:].tolist())
            if last == sampled or arms.solver(last, typical) is None:
                last = ()
            return Redundant(chain, order, sampled, last, inner.method, arms)
    return None


@postures.register
def _(solver: Redundant, U: Array, references: Array, tolerances: Tolerances) -> Found:
    N, k = U.shape[0], solver.chain.k
    found = nothing_found(N, 1, k)
    if solver.order == solver.sampled:
        values = references[:, list(solver.order)]
        found = locked_postures(solver.arms, solver.order, values, U, references, tolerances)
    elif len(solver.order) == 1:
        found = _from_other_joints(solver, U, references, tolerances)
    missing = np.flatnonzero(~found.valid.any(axis=1))
    parts, rows = [found], [np.arange(N)]
    for start in range(0, missing.size, _CHUNK):
        chosen = missing[start : start + _CHUNK]
        parts.append(_nearest(solver, U[chosen], references[chosen], tolerances))
        rows.append(chosen)
    found = stacked(parts, rows, N)
    found.free[..., list(solver.order)] = found.valid[..., None]
    found.family[...] = found.valid
    return found


def locked_postures(
    arms: LockedArms,
    positions: tuple[int, ...],
    values: Array,
    U: Array,
    references: Array,
    tolerances: Tolerances,
) -> Found:
    """Postures of the whole arm with joints locked at values that differ from pose to pose.

    Parameters
    ----------
    arms : LockedArms
        The arm.
    positions : tuple of int
        Locked joints, ascending.
    values : ndarray, shape (N, m)
        Their values [rad or m].
    U : ndarray, shape (N, 4, 4)
        Poses of the tool in R_0 [m].
    references : ndarray, shape (N, k)
        For joints that a pose leaves free [rad or m].
    tolerances : Tolerances
        When a pose counts as met.

    Returns
    -------
    Found
        Nothing for poses whose values leave an arm without a family.
    """
    N, chain = U.shape[0], arms.chain
    rest = np.setdiff1d(np.arange(chain.k), positions)
    parts, rows = [nothing_found(0, 1, rest.size)], [np.zeros(0, np.int64)]
    if at_an_end(positions, chain.k):
        inner = arms.solver(positions, ())
        if inner is not None:
            _, moved = at_ends(chain, U, *_ends(positions, values))
            parts.append(postures(inner, moved, references[:, rest], tolerances))
            rows.append(np.arange(N))
    else:
        distinct, group = np.unique(values, axis=0, return_inverse=True)
        for v, row in enumerate(distinct):
            inner = arms.solver(positions, tuple(row.tolist()))
            at = np.flatnonzero(group.reshape(-1) == v)
            if inner is not None:
                parts.append(postures(inner, U[at], references[at][:, rest], tolerances))
                rows.append(at)
    found = stacked(parts, rows, N)
    return whole_postures(chain, U, np.array(positions), values, found, tolerances)


def members(
    solver: Redundant, U: Array, references: Array, tolerances: Tolerances
) -> tuple[Array, NDArray[np.bool_]]:
    """Postures of each pose wherever they stand on its infinite family.

    Parameters
    ----------
    solver : Redundant
        The arm.
    U : ndarray, shape (N, 4, 4)
        Poses of the tool in R_0 [m].
    references : ndarray, shape (N, k)
        For joints that are free besides [rad or m].
    tolerances : Tolerances
        When a pose counts as met.

    Returns
    -------
    q : ndarray, shape (N, C, k)
        Postures at many values of the joints ``solver.sampled`` and ``solver.last`` [rad or m].
    valid : ndarray of bool, shape (N, C)
        Rows in use.
    """
    N, k = U.shape[0], solver.chain.k
    parts = []
    for joints in (solver.sampled, solver.last):
        if not joints:
            continue
        grid = _samples(solver.chain, joints, U)
        G = len(grid)
        found = locked_postures(
            solver.arms, joints, np.tile(grid, (N, 1)), np.repeat(U, G, axis=0),
            np.repeat(references, G, axis=0), tolerances,
        )  # fmt: skip
        S = found.q.shape[1]
        parts.append((found.q.reshape(N, G * S, k), found.valid.reshape(N, G * S)))
    q, valid = zip(*parts, strict=True)
    return np.concatenate(q, axis=1), np.concatenate(valid, axis=1)


# --- which joints --------------------------------------------------------------------------------


def at_an_end(positions: tuple[int, ...], k: int) -> bool:
    """Whether joints are the first or the last of a chain.

    Parameters
    ----------
    positions : tuple of int
        Joints, ascending.
    k : int
        Joints of the chain.

    Returns
    -------
    bool
        If so, their values only move the poses.

    Examples
    --------
    >>> at_an_end((0, 1), 8), at_an_end((6,), 7), at_an_end((1, 2), 8)
    (True, True, False)
    """
    m = len(positions)
    return positions in (tuple(range(m)), tuple(range(k - m, k)))


def _ends(positions: tuple[int, ...], values: Array) -> tuple[Array, Array]:
    """Values of joints at the first and at the last end of a chain."""
    none = values[:, :0]
    return (values, none) if positions[0] == 0 else (none, values)


def _moving_in_order(chain: JointChain, real: NDArray[np.int64]) -> tuple[tuple[int, ...], int]:
    """Joints that move along the family, each given those before; dimension of the family."""
    rng = np.random.default_rng(0)
    J = jacobians(chain, rng.uniform(-2.0, 2.0, (7, chain.k)))
    rank = int(np.median(np.linalg.matrix_rank(J, tol=_MOVES)))
    dimension = chain.k - rank
    kept, order = np.ones(chain.k, np.bool_), []
    for j in real.tolist():
        if len(order) == dimension:
            break
        # the joint moves if its column depends on those that are left
        kept[j] = False
        others = int(np.median(np.linalg.matrix_rank(J[:, :, kept], tol=_MOVES)))
        if others == rank:
            order.append(j)
        else:
            kept[j] = True
    return tuple(order), dimension


def _from_other_joints(
    solver: Redundant, U: Array, references: Array, tolerances: Tolerances
) -> Found:
    """Postures at the reference of the free joint where the arm without it has no family."""
    from .crossings import Relations
    from .relations import Related

    (joint,) = solver.order
    row = np.eye(solver.chain.k)[[joint]]
    period = np.where(solver.chain.sigma[[joint]] == 0, 2.0 * np.pi, 0.0)
    wanted = Relations(row, references[:, [joint]], period)
    related = Related(solver.chain, wanted, solver.sampled[0], solver.inner, solver.arms)
    found = postures(related, U, references, tolerances)
    found.q[..., joint] = np.where(found.valid, references[:, [joint]], np.nan)
    return found


def _swings(chain: JointChain) -> Array:
    """How much joints move along the family, on average over random postures, shape (k,)."""
    rng = np.random.default_rng(1)
    J = jacobians(chain, rng.uniform(-2.0, 2.0, (40, chain.k)))
    along = np.linalg.svd(J)[2][:, 6:]
    return np.linalg.norm(along, axis=1).mean(axis=0)


# --- where no posture exists at the reference ----------------------------------------------------


def _samples(chain: JointChain, joints: tuple[int, ...], U: Array) -> Array:
    """Values of joints at which members of families are looked for, shape (G, m)."""
    reach = np.linalg.norm(chain.D[:, :3, 3], axis=1).sum()
    reach += float(np.linalg.norm(U[:, :3, 3], axis=1).max(initial=0.0))
    m = len(joints)
    ends = at_an_end(joints, chain.k)
    spread = np.arange(GRID if m == 1 or not ends else MANY) + 0.5
    if m == 1:
        unit = spread[:, None] / GRID
    else:
        # points of an additive recurrence fill the cube evenly; joints inside the chain take few
        # values, because each is a chain to prepare
        steps = np.sqrt(np.array([2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0])[:m])
        unit = np.mod(spread[:, None] * 4.0 * steps, 1.0)
        if not ends:
            unit = (np.floor(unit * 4) + 0.5) / 4
            unit = np.unique(unit, axis=0)
    turning = chain.sigma[list(joints)] == 0
    return np.where(turning, np.pi, reach) * (2.0 * unit - 1.0)


def _nearest(solver: Redundant, U: Array, references: Array, tolerances: Tolerances) -> Found:
    """Postures whose free joints are as near to their references as they can be."""
    chain, order = solver.chain, list(solver.order)
    N = U.shape[0]
    q, valid = members(solver, U, references, tolerances)
    # those are walked along their families that are nearest in the free joints, the first of all
    near = np.abs(_way(chain, q, references))[..., order]
    near = np.where(valid, near @ 0.1 ** np.arange(len(order)), np.inf)
    first = np.argsort(near, axis=1, kind="stable")[:, : WALKED[len(order) > 1]]
    q = np.take_along_axis(q, first[..., None], axis=1)
    valid = np.take_along_axis(valid, first, axis=1)
    out, rows = [nothing_found(0, 1, chain.k)], [np.zeros(0, np.int64)]
    for n in np.flatnonzero(valid.any(axis=1)):
        turned, pose, columns = _virtual_last(chain, U[n])
        one = nothing_found(1, valid.shape[1], chain.k)
        one.q[...], one.valid[...], one.family[...] = q[n][:, columns], valid[n], valid[n]
        settled = settle_families(
            turned, pose[None], one, references[n : n + 1, columns], tolerances
        )
        back = np.argsort(columns)
        found = Found(
            settled.q[..., back], settled.valid.copy(), settled.residual.copy(),
            settled.double.copy(), settled.free[..., back], settled.family.copy(),
        )  # fmt: skip
        keep = found.valid[0].copy()
        for j in order:
            # the nearest value of each joint, given the ones before
            away = np.abs(_way(chain, found.q[0], references[n]))[:, j]
            keep &= away <= np.min(away[keep], initial=np.inf) + _SAME
        if keep.any():
            out.append(
                _completed(solver, U[n : n + 1], references[n : n + 1], found, keep, tolerances)
            )
            rows.append(np.array([n]))
    found = stacked(out, rows, N)
    return found


def _completed(
    solver: Redundant,
    U: Array,
    references: Array,
    found: Found,
    keep: NDArray[np.bool_],
    tolerances: Tolerances,
) -> Found:
    """Chosen rows of a single pose, and all others that have their values of the free joints."""
    chain, order = solver.chain, list(solver.order)
    q = found.q[:, keep]
    if solver.order == solver.sampled:
        values = q[:, 0, order]
        others = locked_postures(solver.arms, solver.order, values, U, references, tolerances)
        q = np.concatenate((q, others.q[:, others.valid[0]]), axis=1)
    held = np.array(np.broadcast_to(np.isin(np.arange(chain.k), order), q.shape), order="C")
    return checked(chain, U, q, np.ones(q.shape[:2], np.bool_), tolerances, free=held)


def _way(chain: JointChain, q: Array, references: Array) -> Array:
    """From references ``(..., k)`` to postures ``(..., S, k)``, angles by the shorter way round."""
    d = q - references[..., None, :]
    return np.where(chain.sigma == 0, np.remainder(d + np.pi, 2.0 * np.pi) - np.pi, d)


def _virtual_last(chain: JointChain, U: Array) -> tuple[JointChain, Array, NDArray[np.int64]]:
    """The loop of chain and pose, opened behind the virtual joints that stand at the base.

    Returns the chain, its pose and which joint of the chain each of its joints is. The tool stays
    the last frame before the pose, so that real joints come first.
    """
    lead = 0
    while lead < chain.k and chain.columns[lead] < 0:
        lead += 1
    columns = np.roll(np.arange(chain.k), -lead)
    if lead == 0:
        return chain, U, columns
    D = np.concatenate(
        (
            chain.D[lead : chain.k],
            (chain.D[chain.k] @ se3.inverse(U) @ chain.D[0])[None],
            chain.D[1:lead],
            np.eye(4)[None],
        )
    )
    turned = JointChain(
        columns=read_only(chain.columns[columns], np.int64),
        sigma=read_only(chain.sigma[columns], np.int64),
        D=read_only(D),
        base=chain.base,
    )
    return turned, np.eye(4), columns
