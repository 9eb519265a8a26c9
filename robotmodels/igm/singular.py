"""Singular poses: candidates that a solver may miss, double roots, self-motions at the reference.

Near a singular posture a closed form loses digits: candidates with an overshoot are refined by
Newton's method on the chain itself. Where two singularities come together, the solver is asked at
perturbed poses too, and `q_ref` itself is refined.

Where a pose lets the arm move while the tool stands still, a posture is a member of a self-motion.
The first joint, from the base, that moves takes its reference value, or the nearest value that it
reaches; in self-motions of more dimensions then the next joint, given the ones before. Curves are
continued all round, so that every posture at that value is returned. Branch points of curves are
not looked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .chain import canonical_frames
from .check import bits_of, checked
from .loop import JointChain
from .motion import jacobians, lever
from .postures import Postures, difference
from .solver import Tolerances

PERTURBED = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
"""Distances of perturbed poses, beside the length of the arm and in radians."""
TWICE = 1e-3
"""Second smallest singular value below which two singularities come together."""
MET = 1e-12
"""Error up to which a pose is met to rounding [m, rad]."""
SAME = 1e-6
"""Postures closer than this in every joint are equal; joints that move less stand still."""
MOST = 64
"""Rows kept for a pose before self-motions are completed."""
STARTS = 16
"""Random starts of the search for other curves of the same joints."""
POINTS = 4000
"""Points of a curve: one that still goes on then passes beside itself without closing."""

Candidates = Callable[[Array, Array], tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]]
"""Poses (N, 4, 4), references (N, k) -> candidates (N, C, k), which exist (N, C), free joints."""


def solve_singular(
    chain: JointChain,
    candidates: Candidates,
    U: Array,
    references: Array,
    tolerances: Tolerances,
) -> Postures:
    """All postures of poses that are singular or nearly so, from a solver's candidates.

    Shapes: U (N, 4, 4), references (N, k).
    """
    q, there, free = candidates(U, references)
    first = checked(chain, U, _filled(q, there), there, tolerances, free=free, rough=np.inf)
    met = np.where(first.valid, first.residual, 0.0).max(axis=1, initial=0.0) <= MET
    rest = np.flatnonzero(two_singularities(chain, first) | ~met)
    if rest.size == 0:
        return first
    from scipy.spatial.transform import Rotation

    size, rng = lever(chain), np.random.default_rng(0)
    parts = [(q[rest], there[rest]), (references[rest, None], np.ones((rest.size, 1), np.bool_))]
    for away in PERTURBED:
        # the same change for all poses, so that a batch gives the same as its poses one by one
        directions = rng.normal(size=(2, 3))
        directions *= away / np.linalg.norm(directions, axis=1)[:, None]
        moved = U[rest]
        moved[:, :3, :3] = Rotation.from_rotvec(directions[0]).as_matrix() @ moved[:, :3, :3]
        moved[:, :3, 3] += size * directions[1]
        parts.append(candidates(moved, references[rest])[:2])
    q, there = (np.concatenate([part[i] for part in parts], axis=1) for i in range(2))
    part = checked(
        chain, U[rest], _filled(q, there), there, tolerances, double=np.zeros_like(there),
        most=MOST, rough=np.inf, singular=True,
    )  # fmt: skip
    return first.put(rest, part.pack(part.valid))


def _filled(q: Array, there: NDArray[np.bool_]) -> Array:
    return np.where(there[..., None], q, 0.0)


def two_singularities(chain: JointChain, found: Postures) -> NDArray[np.bool_]:
    """Whether a pose has a posture with two small singular values, or no posture."""
    n, s = np.nonzero(found.valid)
    out = ~np.any(found.valid, axis=1)
    J = jacobians(chain, found.q[n, s])
    J[:, :3] /= lever(chain)
    if chain.k > 1:
        out[n[np.linalg.svd(J, compute_uv=False)[:, -2] < TWICE]] = True
    return out


def complete(
    chain: JointChain, U: Array, found: Postures, references: Array, tolerances: Tolerances
) -> Postures:
    """Mark double roots; bring every self-motion to the reference.

    Shapes: U (N, 4, 4), references (N, k). ``found.family``: members that the solver knows of; of
    six joints all are found.
    """
    k = chain.k
    sigma, D, lengths, goals, q = _in_units(chain, U, found)
    double, member, moving = _classified(chain, U, found)
    out = replace(found, double=found.double | double, family=member, moving=_flags(moving, k))
    rows = np.flatnonzero(np.any(member & (moving == 0), axis=1))
    if rows.size == 0:
        return out
    kept, free = [], bits_of(found.free)
    for n in rows:
        motion = SelfMotions(sigma, D, goals[n], references[n] / lengths)
        kept.append([])
        for r in np.flatnonzero(found.valid[n]):
            ends = [(q[n, r], int(free[n, r]), int(moving[n, r]), bool(out.double[n, r]))]
            if member[n, r] and moving[n, r] == 0:
                ends = motion.at_reference(q[n, r], max(MET, found.residual[n, r]))
            kept[-1] += ends
    there = np.zeros((rows.size, max(map(len, kept))), np.bool_)
    candidates, marks = np.zeros((*there.shape, k)), np.zeros((3, *there.shape), np.int64)
    for i, ends in enumerate(kept):
        there[i, : len(ends)] = True
        candidates[i, : len(ends)] = [end[0] for end in ends]
        marks[:, i, : len(ends)] = np.transpose([end[1:] for end in ends])
    part = checked(
        chain, U[rows], candidates * lengths, there, tolerances, free=_flags(marks[0], k),
        moving=_flags(marks[1], k), double=marks[2] == 1, singular=True,
    )  # fmt: skip
    return out.put(rows, part)


def singular_postures(
    chain: JointChain, found: Postures
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Flags (N, S) of double roots and of members of self-motions, from the Jacobians."""
    U = np.broadcast_to(np.eye(4), (len(found.q), 4, 4))
    bare = replace(found, free=np.zeros_like(found.free), family=np.zeros_like(found.family))
    return _classified(chain, U, bare)[:2]


def _classified(
    chain: JointChain, U: Array, found: Postures
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.int64]]:
    """Double roots and members of self-motions (N, S); joints that move, as bits: `classify`."""
    from .kernels.singular import classify

    sigma, D, _, goals, q = _in_units(chain, U, found)
    shape = found.valid.shape
    double, member = np.zeros(shape, np.bool_), np.zeros(shape, np.bool_)
    moving = np.zeros(shape, np.int64)
    classify(
        goals, sigma, D, q, found.valid, found.family & found.valid, bits_of(found.free), double,
        member, moving,
    )  # fmt: skip
    return double, member, moving


def _in_units(
    chain: JointChain, U: Array, found: Postures
) -> tuple[NDArray[np.int64], Array, Array, Array, Array]:
    """Joint types, constants, lengths of the joints' units, poses, postures in units of the arm."""
    D, unit = canonical_frames(chain)
    lengths, goals = np.where(chain.sigma == 1, unit, 1.0), np.array(U, order="C")
    goals[:, :3, 3] /= unit
    q = _filled(found.q, found.valid) / lengths
    return np.ascontiguousarray(chain.sigma), D, lengths, goals, q


def _flags(bits: NDArray[np.int64], k: int) -> NDArray[np.bool_]:
    """The lowest k bits of each number, one joint each, shape (..., k)."""
    return (bits[..., None] >> np.arange(k)) & 1 == 1


def _bits(moves: NDArray[np.bool_]) -> int:
    return int(bits_of(moves))


@dataclass(slots=True)
class Member:
    """Member of a self-motion: joints held, and joints seen to move, both as bits."""

    q: Array
    held: int
    moving: int
    turned: bool  # a held joint is not at its reference, but turns round there


@dataclass(slots=True)
class SelfMotions:
    """Self-motions of one pose, in units of the arm. Shapes: references (k,)."""

    sigma: NDArray[np.int64]
    D: Array
    U: Array
    references: Array
    curves: list[tuple[int, Array, Array]] = field(default_factory=list)
    queue: list[Member] = field(default_factory=list)

    def at_reference(self, q: Array, accepted: float) -> list[tuple[Array, int, int, bool]]:
        """Members at the reference of the self-motions through q: held, moving, double root.

        Those found before are left out; q itself where the pose is only nearly singular: no member
        at the reference meets it as ``accepted``.
        """
        from .kernels.singular import PROBE, move_to_fold

        head, ends, rejected = len(self.queue), [], False
        self.add(q, 0, 0, turned=False)
        while head < len(self.queue):
            item = self.queue[head]
            head += 1
            rows, null = self.directions(item.q, item.held)
            if len(rows) == 0:
                move_to_fold(self.sigma, self.D, self.U, item.q, item.held, 0)
                if self.corrected(item.q, item.held, 0)[1] <= accepted:
                    ends.append((item.q, item.held, item.moving, null > 0 and not item.turned))
                else:
                    rejected = True
            for row in rows:
                # a neighbouring member shows how many dimensions the self-motion has
                beside, error = self.corrected(item.q + PROBE * row, item.held, 1)
                if error > 1e-11:
                    beside = self.corrected(item.q - PROBE * row, item.held, 1)[0]
                basis = self.basis(beside, item.held)
                if len(basis) > 1:
                    # where joints turn round, others seem to be the first that move
                    mixed = PROBE * np.cos(1.0 + 2.3 * np.arange(len(basis))) @ basis
                    beside, _ = self.corrected(beside + mixed, item.held, len(basis))
                    basis = self.basis(beside, item.held)
                if len(basis) < 2:
                    self.continue_curve(item, row)
                    continue
                self.drive(item, beside, basis)
                if len(basis) == null:
                    break  # no fold and no crossing: one surface through this posture
        return ends or ([(q, 0, 0, False)] if rejected else [])

    # --- compiled steps ---

    def corrected(self, q: Array, held: int, spare: int) -> tuple[Array, float]:
        """Refined posture, the ``spare`` flattest directions left alone, and its error."""
        from .kernels.singular import corrected

        out = np.array(q)
        return out, corrected(self.sigma, self.D, self.U, out, held, spare)

    def directions(self, q: Array, held: int) -> tuple[Array, int]:
        """Directions (d, k) in which the self-motion goes on, and the null space's dimension."""
        from .kernels.singular import directions

        rows = np.empty((24, q.size))
        count, null = directions(self.sigma, self.D, self.U, q, held, rows)
        return rows[:count], null

    def tangent(self, q: Array, held: int, rank: int, before: Array) -> Array:
        """Part of ``before`` in the null space, a unit vector."""
        from .kernels.singular import tangent

        out = np.empty(q.size)
        tangent(self.sigma, self.D, q, held, rank, before, out)
        return out

    def offset(self, q: Array, joint: int) -> float:
        """How far a joint is from its reference, the shorter way round."""
        return float(difference(self.sigma, q, self.references)[joint])

    def add(self, q: Array, held: int, moving: int, turned: bool) -> None:
        """Queue a member, unless it was queued before."""
        for other in self.queue:
            if other.held == held and np.max(np.abs(difference(self.sigma, other.q, q))) < SAME:
                other.moving |= moving
                return
        self.queue.append(Member(np.array(q), held, moving, turned))

    def add_nearest(
        self, item: Member, found: list[tuple[Array, float]], moves: NDArray[np.bool_]
    ) -> None:
        """Queue the members whose first moving joint is at its reference, or comes nearest."""
        held, least = item.held | 1 << int(np.argmax(moves)), min(away for _, away in found)
        for q, away in found:
            if away <= least + 1e-9:
                self.add(q, held, item.moving | _bits(moves), item.turned or least > 0.0)

    # --- one dimension ---

    def continue_curve(self, item: Member, along: Array) -> None:
        """Continue a curve all round; queue its members at the reference of its first joint."""
        from .kernels.singular import curve

        if self.is_known(item.q, along, item.held):
            return
        pieces, k = [], item.q.size
        for sense in (1.0, -1.0):
            points, tangents = np.empty((POINTS, k)), np.empty((POINTS, k))
            n, closed = curve(
                self.sigma, self.D, self.U, item.q, sense * along, item.held, points, tangents
            )
            pieces.append((item.held, points[:n], tangents[:n]))
            if closed:
                break
        self.curves += pieces
        points = np.concatenate([points for _, points, _ in pieces])
        moves = np.ptp(points, axis=0) > SAME
        if not moves.any():
            return
        joint = int(np.argmax(moves))
        self.add_nearest(
            item,
            [end for part in pieces for end in self.cuts(part[0], part[1], part[2], joint)],
            moves,
        )
        # the same joints may make a curve that no motion joins with this one: a four-bar linkage
        # may be assembled in two ways
        rng, held = np.random.default_rng(0), item.held | 1 << joint
        centre, spread = np.mean(points, axis=0), np.minimum(np.ptp(points, axis=0), 4.0)
        for spin in rng.uniform(-1.0, 1.0, (STARTS, k)):
            start = np.where(self.sigma == 0, np.pi * spin, centre + spread * spin)
            start = np.where(moves, start, item.q)
            start[joint] = self.references[joint]
            q, error = self.corrected(start, held | _bits(~moves), 0)
            if error <= 1e-11:
                self.add(q, held, item.moving | _bits(moves), item.turned)

    def is_known(self, q: Array, along: Array, held: int) -> bool:
        """Whether a posture lies on a curve that was continued, in its direction."""
        for other, points, tangents in self.curves:
            if other != held or len(points) < 2:
                continue
            chords = np.diff(points, axis=0)
            lengths = np.sum(chords**2, axis=1)
            d = difference(self.sigma, q, points[:-1])
            shares = np.sum(d * chords, axis=1) / lengths
            off = np.sum(d**2, axis=1) - shares**2 * lengths
            near = (off < 0.01 + 0.02 * lengths) & (shares > -0.2) & (shares < 1.2)
            for i in np.flatnonzero(near & (np.abs(tangents[:-1] @ along) > 0.7)):
                share = float(shares[i])
                for _ in range(6):
                    p = self.corrected(points[i] + share * chords[i], held, 1)[0]
                    gap = difference(self.sigma, q, p)
                    if np.max(np.abs(gap)) < 1e-5:
                        return True
                    share += float(gap @ chords[i]) / lengths[i]
        return False

    def cuts(
        self, held: int, points: Array, tangents: Array, joint: int
    ) -> list[tuple[Array, float]]:
        """Where a joint has its reference along a curve, with 0, or turns, with how far from it."""
        slopes = tangents[:, joint]
        g = difference(self.sigma, points, self.references)[:, joint]
        # steps are far shorter than half a turn: g of the next point follows from the step
        ahead = g[:-1] + np.diff(points[:, joint])
        at_point = (np.abs(g) <= 1e-12) | (np.abs(slopes) < 1e-7)
        at_point[[0, -1]] = True  # ends of curves without end; harmless where it is closed
        found = [
            (points[i], float(abs(g[i])) if abs(g[i]) > 1e-12 else 0.0)
            for i in np.flatnonzero(at_point)
        ]
        for i in np.flatnonzero((g[:-1] * ahead < 0.0) | (slopes[:-1] * slopes[1:] < 0.0)):
            a, b, value = points[i], points[i + 1], points[i, joint] - g[i]
            ends = [(a, b)]
            if g[i] * ahead[i] >= 0.0:
                turn = self.between(
                    a, b, held, lambda q, i=i: self.tangent(q, held, 1, tangents[i])[joint]
                )
                away = float(turn[joint] - value)
                ends = [(a, turn), (turn, b)]
                if away * g[i] >= 0.0 or abs(away) <= 1e-12:
                    found.append((turn, abs(away) if abs(away) > 1e-12 else 0.0))
                    continue
            for low, high in ends:
                q = self.between(low, high, held, lambda q, value=value: q[joint] - value)
                start = np.array(q)
                start[joint] = value
                exact, error = self.corrected(start, held | 1 << joint, 0)
                if error <= 1e-11 and np.max(np.abs(exact - q)) < 1e-2:
                    found.append((exact, 0.0))
                elif abs(q[joint] - value) < SAME:
                    found.append((q, 0.0))  # beside a turning point that misses by rounding
        return found

    def between(self, a: Array, b: Array, held: int, f: Callable[[Array], float]) -> Array:
        """The point of a curve between two of its points at which a function is zero."""
        from scipy.optimize import brentq

        def point(share: float) -> Array:
            return self.corrected(a + share * (b - a), held, 1)[0]

        ends = [f(point(share)) for share in (0.0, 1.0)]
        if ends[0] * ends[1] >= 0.0:
            return point(float(abs(ends[1]) < abs(ends[0])))
        return point(brentq(lambda share: f(point(share)), 0.0, 1.0, xtol=1e-12))

    # --- more dimensions ---

    def basis(self, q: Array, held: int) -> Array:
        """Orthonormal directions of a self-motion (d, k)."""
        _, sizes, rows = np.linalg.svd(self.directions(q, held)[0], full_matrices=False)
        return rows[sizes > 0.3]

    def drive(self, item: Member, q: Array, basis: Array) -> None:
        """Drive the first joint that moves to its reference both ways; queue what is reached."""
        moves = np.max(np.abs(basis), axis=0) > SAME
        joint = int(np.argmax(moves))
        ends = [self.driven(q, item.held, len(basis), joint, sense) for sense in (1.0, -1.0)]
        self.add_nearest(item, ends, moves)

    def driven(
        self, q: Array, held: int, rank: int, joint: int, sense: float
    ) -> tuple[Array, float]:
        """Move until a joint has its reference, or turns round; how far from it this is."""
        slides, along = self.sigma[joint] == 1, np.zeros(q.size)
        left, h, along[joint] = -sense * self.offset(q, joint), 0.1, sense
        if left < -1e-12:
            if slides:
                return q, -left
            left += 2.0 * np.pi
        while left > 1e-9 and h > 1e-7:
            v = self.tangent(q, held, rank, along)
            speed = sense * float(v[joint])
            if speed < 1e-7:
                break
            step = min(h, left / speed)
            y, error = self.corrected(q + step * v, held, rank)
            gone = sense * float(y[joint] - q[joint])
            if error > 1e-11 or gone <= 0.0 or np.linalg.norm(y - q - step * v) > 0.25 * step:
                h = 0.5 * step
                continue
            q, left = y, left - gone
            h = min(1.5 * h, 1.0 if slides else 0.1)
        away = abs(self.offset(q, joint))
        if away <= SAME:
            start = np.array(q)
            start[joint] -= self.offset(q, joint)
            y, error = self.corrected(start, held | 1 << joint, rank - 1)
            if error <= 1e-11:
                return y, 0.0
        return q, away
