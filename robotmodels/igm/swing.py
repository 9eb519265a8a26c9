"""Tasks that free two rotations: what is asked is that the tool has no twist about one axis.

``log(R_desired R^T)`` may then be any vector of a plane. Such rotations are no group and no chain
of joints produces them; but they are those whose quaternion has no component along the asked axis,
one equation. With one joint held the arm places the asked translations in finitely many ways, in
closed form with a virtual spherical joint at the tool. Over a grid of values of that joint these
follow the arm's curves, and every change of sign, nearest approach and end on them starts a root
search on the arm itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..se3.orientation import quaternions_of
from .alike import prepare_alike
from .components import Components, asked_errors, mask_axes
from .dependent import DEPENDENT, held_chain, prepare_held
from .gather import assembled, merged, rows_of
from .loop import JointChain
from .motion import jacobians, lever, random_postures, tool_poses
from .solver import Found, Prepare, Solver, Tolerances, nothing_found, postures

GRID = 72  # values of the searched joint
CHUNK = 64  # poses worked on at a time
STEPS = 40  # of a root search
SINGULAR = 1e-6  # singular values of the Jacobian beside the largest that count as zero
CLOSE = 0.05  # the same below which a second root may be close
PARTNERS = (0.01, 0.03, 0.1, 0.3)  # ways along the null direction at which it is looked for
NEAR = 1e-3  # singular postures closer than this came from one root, to half the digits


@dataclass(frozen=True, slots=True, eq=False)
class SwingFilter:
    """Arm whose position leaves no joint free; its postures are filtered by the rotation."""

    chain: JointChain
    components: Components
    inner: Solver

    @property
    def method(self) -> str:
        """The family in words."""
        return f"{self.inner.method}; those without twist"


@dataclass(frozen=True, slots=True, eq=False)
class SwingSearch:
    """Arm with one joint more than its position needs, searched for the rotation."""

    chain: JointChain
    components: Components
    searched: int
    values: Array
    inner: tuple[Solver | None, ...]
    length: float
    second: SwingSearch | None = None

    @property
    def method(self) -> str:
        """The family in words."""
        others = next((solver.method for solver in self.inner if solver is not None), "no other")
        number = self.chain.columns[self.searched] + 1
        return f"roots of the twist along joint {number}; {others}"


def prepare_swing(chain: JointChain, components: Components, position: Prepare) -> Solver | None:
    """Prepare an arm for a task that asks for one rotation."""
    length, k = lever(chain), chain.k
    J = _sampled_jacobians(chain, components, length)
    place, all_rows = _rank(J[:, :-1]), _rank(J)
    if k == place or all_rows == place:
        inner = position(chain) if any(components.asked[:3]) else None
        return inner and SwingFilter(chain, components, inner)
    others = [np.delete(np.arange(k), joint) for joint in range(k)]
    if k > place + 1:
        for joint in range(k):
            rest = J[:, :, others[joint]]
            if _rank(rest[:, :-1]) == place and _rank(rest) == all_rows:
                return prepare_held(
                    chain, joint, lambda held: prepare_swing(held, components, position)
                )
        return None
    # the arm without the joint places the tool as well as it can
    worth = [_worth(J[:, :-1][:, :, others[joint]], place) for joint in range(k)]
    # an angle has an end, a length has none
    worth = np.array(worth) - 0.5 * chain.sigma
    searches: list[SwingSearch] = []
    for joint in np.argsort(-worth, kind="stable"):
        if worth[joint] < -6.0 or len(searches) == 2:
            break
        search = _search(chain, components, int(joint), position, length)
        if search is not None:
            searches.append(search)
    if not searches:
        return None
    return replace(searches[0], second=searches[1] if len(searches) == 2 else None)


@postures.register
def _(solver: SwingFilter, U: Array, references: Array, tolerances: Tolerances) -> Found:
    found = postures(solver.inner, U, references, tolerances)
    return merged(solver.chain.sigma, judged(found, solver.chain, U, solver.components, tolerances))


@postures.register
def _(solver: SwingSearch, U: Array, references: Array, tolerances: Tolerances) -> Found:
    parts = []
    for start in range(0, len(U), CHUNK):
        rows = np.arange(start, min(start + CHUNK, len(U)))
        parts.append((rows, _searched(solver, U[rows], references[rows], tolerances)))
    found = assembled(len(U), solver.chain.k, parts)
    empty = np.flatnonzero(~found.valid.any(axis=1))
    if solver.second is None or empty.size == 0:
        return found
    others = np.setdiff1d(np.arange(len(U)), empty)
    again = postures(solver.second, U[empty], references[empty], tolerances)
    return assembled(len(U), solver.chain.k, [(others, rows_of(found, others)), (empty, again)])


@prepare_alike.register
def _(known: SwingSearch, chain: JointChain, prepare: Prepare) -> Solver | None:
    inner = tuple(
        None
        if old is None
        else prepare_alike(old, held_chain(chain, known.searched, value), prepare)
        for old, value in zip(known.inner, known.values.tolist(), strict=True)
    )
    second = None if known.second is None else prepare_alike(known.second, chain, prepare)
    assert second is None or isinstance(second, SwingSearch)
    return replace(known, chain=chain, inner=inner, second=second)


def judged(
    found: Found, chain: JointChain, U: Array, components: Components, tolerances: Tolerances
) -> Found:
    """The rows that meet what is asked, on the arm itself, with what they miss of it."""
    n, s = np.nonzero(found.valid)
    away, turn = asked_errors(chain, U[n], found.q[n, s], components)
    met = (away <= tolerances.position) & (turn <= tolerances.orientation)
    valid, residual = np.zeros_like(found.valid), np.full_like(found.residual, np.nan)
    valid[n, s], residual[n, s] = met, np.where(met, np.maximum(away, turn), np.nan)
    return replace(found, valid=valid, residual=residual)


# --- the equations --------------------------------------------------------------------------------


def _equations(
    chain: JointChain, U: Array, q: Array, components: Components, length: float
) -> tuple[Array, Array]:
    """What is missing (n, a), and how the joints make up for it (n, a, k); the twist last.

    Translations in units of the arm; of the twist twice the component of the quaternion of
    ``R_desired R^T`` along the asked axis, the angle where it is small.
    """
    P, J = tool_poses(chain, q), jacobians(chain, q)
    axes = mask_axes(chain, U, components)
    asked = np.flatnonzero(components.asked[:3])
    across = np.swapaxes(axes[:, :, asked], 1, 2)
    away = (across @ (U[:, :3, 3] - P[:, :3, 3])[..., None])[..., 0] / length
    Q = quaternions_of(U[:, :3, :3] @ np.swapaxes(P[:, :3, :3], 1, 2))
    e = axes[:, :, int(np.flatnonzero(components.asked[3:])[0])]
    twist = 2.0 * np.sum(e * Q[:, 1:], axis=1)
    # (c, v) becomes (c, v) (1, -w/2) where the tool turns by w
    lever_of_twist = Q[:, :1] * e + np.cross(e, Q[:, 1:])
    rows = np.concatenate([across @ J[:, :3] / length, lever_of_twist[:, None] @ J[:, 3:]], axis=1)
    return np.concatenate([away, twist[:, None]], axis=1), rows


def _sampled_jacobians(chain: JointChain, components: Components, length: float) -> Array:
    """Of the equations at random postures and for poses swung away by random ways."""
    rng = np.random.default_rng(4)
    q = random_postures(chain, 12, rng)
    U = tool_poses(chain, random_postures(chain, 12, rng))
    return _equations(chain, U, q, components, length)[1]


def _rank(J: Array) -> int:
    """The usual rank of matrices (Q, a, k)."""
    if min(J.shape[1:]) == 0:
        return 0
    values = np.linalg.svd(J, compute_uv=False)
    return int(np.median(np.sum(values > DEPENDENT * np.maximum(values[:, :1], 1e-3), axis=1)))


def _worth(J: Array, rank: int) -> float:
    """How well a part of the arm places the tool: the smallest singular value that counts."""
    if rank == 0:
        return 0.0
    if min(J.shape[1:]) < rank:
        return -np.inf
    values = np.linalg.svd(J, compute_uv=False)
    return float(np.mean(np.log10(values[:, rank - 1] + 1e-16)))


# --- the search -----------------------------------------------------------------------------------


def _search(
    chain: JointChain, components: Components, joint: int, position: Prepare, length: float
) -> SwingSearch | None:
    """The grid of a joint, with what solves the others at each of its values."""
    turn = 2.0 * np.pi * (np.arange(GRID) + 0.5) / GRID - np.pi
    values = turn if chain.sigma[joint] == 0 else length * np.tan(0.5 * turn)
    inner: list[Solver | None] = [None] * GRID
    if chain.k > 1:
        middle = GRID // 3
        first = position(held_chain(chain, joint, float(values[middle])))
        if first is None:
            return None
        inner = [
            prepare_alike(first, held_chain(chain, joint, value), position)
            for value in values.tolist()
        ]
        inner[middle] = first
    return SwingSearch(chain, components, joint, values, tuple(inner), length)


def _searched(solver: SwingSearch, U: Array, references: Array, tolerances: Tolerances) -> Found:
    """Postures of a chunk of poses."""
    chain = solver.chain
    curve, there = _curves(solver, U, references, tolerances)
    start = _starts(solver, U, curve, there)
    n, g, s = np.nonzero(start)
    q = _root(solver, U[n], curve[n, g, s])
    found = _collected(solver, U, n, q, tolerances)
    n, s = np.nonzero(found.valid)
    q = found.q[n, s]
    _, values, rows = np.linalg.svd(_equations(chain, U[n], q, solver.components, solver.length)[1])
    if values.shape[1] == chain.k:
        close = np.flatnonzero(values[:, -1] < CLOSE * values[:, 0])
        ways = np.array(PARTNERS + tuple(-way for way in PARTNERS))
        trial = q[close, None] + ways[:, None] * rows[close, None, -1]
        pose = np.repeat(n[close], len(ways))
        partners = _root(solver, U[pose], trial.reshape(-1, chain.k))
        found = _collected(
            solver, U, np.concatenate([n, pose]), np.concatenate([q, partners]), tolerances
        )
    return _singular(solver, U, found, tolerances)


def _collected(
    solver: SwingSearch, U: Array, pose: NDArray[np.int64], q: Array, tolerances: Tolerances
) -> Found:
    """Roots (n, k), each of a pose, as packed postures of the poses U; false ones left out."""
    chain, N = solver.chain, len(U)
    order = np.argsort(pose, kind="stable")
    pose, q = pose[order], q[order]
    counts = np.bincount(pose, minlength=N)
    out = nothing_found(N, int(counts.max(initial=0)), chain.k)
    place = np.arange(len(pose)) - np.repeat(np.cumsum(counts) - counts, counts)
    out.q[pose, place], out.valid[pose, place] = q, True
    turning = chain.sigma == 0
    out.q[..., turning] = np.pi - (np.pi - out.q[..., turning]) % (2.0 * np.pi)
    return merged(chain.sigma, judged(out, chain, U, solver.components, tolerances))


def _curves(
    solver: SwingSearch, U: Array, references: Array, tolerances: Tolerances
) -> tuple[Array, NDArray[np.bool_]]:
    """Postures that place the tool, at each value of the grid: (N, G, S, k), and which rows."""
    chain, joint = solver.chain, solver.searched
    others = np.delete(np.arange(chain.k), joint)
    found = [
        None if inner is None else postures(inner, U, references[:, others], tolerances)
        for inner in solver.inner
    ]
    alone = chain.k == 1
    S = 1 if alone else max((part.q.shape[1] for part in found if part is not None), default=0)
    curve = np.zeros((len(U), GRID, S, chain.k))
    curve[..., joint] = solver.values[:, None]
    there = np.full((len(U), GRID, S), alone)
    for g, part in enumerate(found):
        if part is not None:
            width = part.q.shape[1]
            there[:, g, :width] = part.valid
            curve[:, g, :width][..., others] = np.where(part.valid[..., None], part.q, 0.0)
    return curve, there


def _starts(
    solver: SwingSearch, U: Array, curve: Array, there: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Where on the curves a root may be: changes of sign, nearest approaches and ends."""
    chain = solver.chain
    N, G, S, k = curve.shape
    twist = np.full((N, G, S), np.inf)
    n, g, s = np.nonzero(there)
    twist[n, g, s] = _equations(chain, U[n], curve[n, g, s], solver.components, solver.length)[0][
        :, -1
    ]
    others = np.delete(np.arange(k), solver.searched)
    start = np.zeros((N, G, S), np.bool_)
    if S == 0:
        return start
    least = there.copy()
    neighbours = []
    for side in (1, -1):
        beside, is_there = np.roll(curve, -side, axis=1), np.roll(there, -side, axis=1)
        gap = curve[:, :, :, None, others] - beside[:, :, None, :, others]
        turns = chain.sigma[others] == 0
        gap = np.where(turns, gap - 2 * np.pi * np.round(gap / (2 * np.pi)), gap / solver.length)
        far = np.where(is_there[:, :, None], np.abs(gap).max(axis=-1, initial=0.0), np.inf)
        nearest = np.argmin(far, axis=-1)
        ends = np.take_along_axis(far, nearest[..., None], -1)[..., 0] > 8.0 * np.pi / GRID
        next_twist = np.take_along_axis(np.roll(twist, -side, axis=1), nearest, axis=-1)
        neighbours.append((side, nearest, ends))
        start |= there & (ends | (np.sign(twist) != np.sign(next_twist)))
        least &= ends | (np.abs(twist) <= np.abs(next_twist))
    # beside a nearest approach two roots may lie: they are started from either side
    for side, nearest, ends in neighbours:
        n, g, s = np.nonzero(least & ~ends)
        start[n, (g + side) % G, nearest[n, g, s]] = True
    return (start | least) & there


def _root(solver: SwingSearch, U: Array, q: Array) -> Array:
    """Levenberg and Marquardt's steps on all equations, (n, k)."""
    chain, asked, length = solver.chain, solver.components, solver.length
    damping = np.full(len(q), 1e-4)
    missing, J = _equations(chain, U, q, asked, length)
    for _ in range(STEPS):
        square = np.sum(missing**2, axis=1)
        if not np.any(square > 1e-30):
            break
        Jt = np.swapaxes(J, 1, 2)
        normal = Jt @ J + damping[:, None, None] * np.eye(chain.k)
        step = np.linalg.solve(normal, Jt @ missing[..., None])[..., 0]
        trial = q + step
        next_missing, next_J = _equations(chain, U, trial, asked, length)
        better = np.sum(next_missing**2, axis=1) < square
        q = np.where(better[:, None], trial, q)
        missing = np.where(better[:, None], next_missing, missing)
        J = np.where(better[:, None, None], next_J, J)
        damping = np.clip(np.where(better, 0.05 * damping, 20.0 * damping), 1e-15, 1e3)
    return q


def _singular(solver: SwingSearch, U: Array, found: Found, tolerances: Tolerances) -> Found:
    """Double roots and infinite families marked; roots that fell apart by rounding made one."""
    chain, asked, length = solver.chain, solver.components, solver.length
    n, s = np.nonzero(found.valid)
    _, J = _equations(chain, U[n], found.q[n, s], asked, length)
    _, values, rows = np.linalg.svd(J)
    k = chain.k
    smallest = values[:, k - 1] if values.shape[1] >= k else np.zeros(len(n))
    flat = np.flatnonzero(smallest <= 1e-3 * np.maximum(values[:, 0], 1e-300))
    if flat.size == 0:
        return found
    for pose in np.unique(n[flat]):
        these = s[flat][n[flat] == pose]
        order = these[np.argsort(found.residual[pose, these], kind="stable")]
        for place, i in enumerate(order):
            if not found.valid[pose, i]:
                continue
            for j in order[place + 1 :]:
                gap = found.q[pose, j] - found.q[pose, i]
                gap[chain.sigma == 0] = (gap[chain.sigma == 0] + np.pi) % (2 * np.pi) - np.pi
                half_way = found.q[pose, i] + 0.5 * gap
                between = judged(
                    replace(
                        nothing_found(1, 1, k), q=half_way[None, None],
                        valid=np.ones((1, 1), np.bool_),
                    ),
                    chain, U[pose : pose + 1], asked, tolerances,
                )  # fmt: skip
                # what lies between them meets the pose as well: the same root
                if np.abs(gap).max() < NEAR and between.valid.all():
                    found.valid[pose, j] = False
                    found.double[pose, i] = True
    exact = smallest <= SINGULAR * np.maximum(values[:, 0], 1e-300)
    away = found.q[n[exact], s[exact]] + 1e-2 * rows[exact, k - 1]
    back = _root(solver, U[n[exact]], away)
    met, turned = asked_errors(chain, U[n[exact]], back, asked)
    gone = np.abs(back - found.q[n[exact], s[exact]]).max(axis=1, initial=0.0)
    moves = (met <= 1e-10) & (turned <= 1e-10) & (gone > 1e-3)
    found.family[n[exact], s[exact]] = moves
    found.double[n[exact], s[exact]] = ~moves
    return merged(chain.sigma, found)
