"""Self-motions of one pose: the arm moves while the tool stands still.

Where a pose lets the arm move while the tool stands still, a posture is a member of a self-motion.
The first joint, from the base, that moves takes its reference value, or the nearest value that it
reaches; in self-motions of more dimensions then the next joint, given the ones before. Curves are
continued all round, so that every posture at that value is returned. Branch points of curves are
not looked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .check import bits_of
from .constraints import Constraints
from .postures import difference
from .search import nearest_value

SAME = 1e-6
"""Postures closer than this in every joint are equal; joints that move less stand still."""
SINGULAR = 1e-6
"""Singular values that count as zero."""
MEMBER = 1e-11
"""Error up to which a posture belongs to a self-motion, lengths in units of the arm."""
PROBE = 0.02
"""Step that distinguishes a self-motion from a double root [rad]."""
STARTS = 16
"""Random starts of the search for other curves of the same joints."""
POINTS = 4000
"""Points of a curve: one that still goes on then passes beside itself without closing."""


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

    wanted: Constraints
    U: Array
    references: Array
    curves: list[tuple[int, Array, Array]] = field(default_factory=list)
    queue: list[Member] = field(default_factory=list)

    def at_reference(self, q: Array, accepted: float) -> list[tuple[Array, int, int, bool]]:
        """Members at the reference of the self-motions through q: held, moving, double root.

        Those found before are left out; q itself where the pose is only nearly singular: no member
        at the reference meets it as ``accepted``.
        """
        from .kernels.singular import move_to_fold

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
                if error > MEMBER:
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

    @property
    def sigma(self) -> NDArray[np.int64]:
        """Types of the joints."""
        return self.wanted.chain.sigma

    @property
    def D(self) -> Array:
        """Constants between the joints."""
        return self.wanted.chain.D

    # --- compiled steps ---

    def corrected(self, q: Array, held: int, spare: int) -> tuple[Array, float]:
        """Refined posture, the ``spare`` flattest directions left alone, and its error."""
        from .kernels.singular import corrected

        out = np.array(q)
        return out, corrected(self.sigma, self.D, self.U, out, held, spare)

    def null_space(self, q: Array, held: int, rank: int = 0) -> Array:
        """Flattest directions (d, k): ``rank`` of them, or those of zero singular values."""
        from .kernels.singular import decomposed

        k = q.size
        rows, sizes = np.empty((k, 6 + k)), np.zeros(k)
        f = decomposed(self.sigma, self.D, q, held, rows, sizes)
        # with slides run out far beyond the arm, small angles matter more than their size shows
        limit = SINGULAR * min(1.0, (10.0 / max(sizes[0], 1e-300)) ** 2)
        first = f - rank if rank else int(np.sum(sizes[:f] >= limit))
        return rows[first:f, 6:]

    def directions(self, q: Array, held: int) -> tuple[Array, int]:
        """Directions (d, k) in which a self-motion goes on, and the null space's dimension."""
        null, found = self.null_space(q, held), []
        for v in _null_directions(null):
            for attempt in range(2):
                ahead, y, error = q, q, np.inf
                for step in (PROBE, -PROBE):
                    ahead = q + step * v
                    y, error = self.corrected(ahead, held, 1)
                    if error <= MEMBER:
                        break
                if error > MEMBER:
                    break
                if np.linalg.norm(y - ahead) < 0.2 * PROBE:
                    found.append(v)
                    break
                # beside a fold it came to the self-motion all the same: try that direction
                if attempt == 1 or np.linalg.norm(y - q) < 0.2 * PROBE:
                    break
                v = null.T @ (null @ (y - q))
                v /= max(float(np.linalg.norm(v)), 1e-300)
        return _distinct(found, q.size), len(null)

    def moving_joints(self, q: Array, free: int) -> int:
        """Bits of the joints that move along a self-motion, if the free ones are the first; else 0.

        A self-motion with a fold beside it is not judged here.
        """
        null = self.null_space(q, 0) if free else np.empty((0, q.size))
        d = len(null)
        if d == 0 or free.bit_count() != d:
            return 0
        ahead = q + PROBE * np.cos(1.0 + 2.3 * np.arange(d)) @ null
        y, error = self.corrected(ahead, 0, d)
        if error > MEMBER or np.linalg.norm(y - ahead) > 0.2 * PROBE:
            return 0
        # at a turning point a joint's part of the null space is zero, at a neighbour it is not
        beside = self.null_space(y, 0, d)
        moves = np.max(np.abs(np.concatenate([null, beside])), axis=0) > SAME
        first = np.argmax(np.abs(_eliminated(beside, 0)) > SAME, axis=1)
        return _bits(moves) if sum(1 << int(m) for m in first) == free else 0

    def is_double(self, q: Array, null: int) -> bool:
        """Whether a fold is so near that the two postures beside it are one double root."""
        from .kernels.singular import fold

        if null > 1 or q.size < 6:
            return True
        size, slope = fold(self.sigma, self.D, q, 0, 0, np.empty(q.size))
        # the other root is twice as far as the singularity, if there is one near
        return 2.0 * size < 2.0 * SAME * abs(slope) or size <= 1e-12

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
            if error <= MEMBER:
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
                if error <= MEMBER and np.max(np.abs(exact - q)) < 1e-2:
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
        """Queue the member at the reference of the first joint that moves, or nearest to it."""
        moves = np.max(np.abs(basis), axis=0) > SAME
        joint = int(np.argmax(moves))
        held = [m for m in range(q.size) if (item.held >> m) & 1 == 1]
        value = self.references[[joint]]
        end = nearest_value(self.wanted, self.U[None], q[None], joint, value, held)[0]
        away = abs(self.offset(end, joint))
        self.add_nearest(item, [(end, away if away > SAME else 0.0)], moves)


def _eliminated(basis: Array, start: int) -> Array:
    """Combined rows such that some joints, from ``start`` on, are in one row only; unit vectors."""
    B, done = np.array(basis), 0
    for m in (np.arange(B.shape[1]) + start) % B.shape[1]:
        if done == len(B):
            break
        pivot = done + int(np.argmax(np.abs(B[done:, m])))
        if abs(B[pivot, m]) > SAME:
            B[[done, pivot]] = B[[pivot, done]]
            shares = B[:, m] / B[done, m]
            shares[done] = 0.0
            B -= shares[:, None] * B[done]
            done += 1
    return B / np.linalg.norm(B, axis=1)[:, None]


def _null_directions(null: Array) -> Array:
    """Directions of the null space that may be those of a curve.

    A fold beside a self-motion adds a direction that it does not have; its own often leave some
    joints at rest, which elimination brings out.
    """
    d, k = null.shape
    if d < 2:
        return null
    mixed = np.cos(1.0 + 2.3 * np.arange(d) + 1.7 * np.arange(2)[:, None]) @ null
    mixed /= np.linalg.norm(mixed, axis=1)[:, None]
    return _distinct([*(v for start in range(k) for v in _eliminated(null, start)), *mixed], k)


def _distinct(directions: list[Array], k: int) -> Array:
    """Each direction once, either way round (d, k)."""
    out = np.empty((0, k))
    for v in directions:
        if not np.any(np.abs(out @ v) > 1.0 - 1e-9):
            out = np.concatenate([out, v[None]])
    return out


def _bits(moves: NDArray[np.bool_]) -> int:
    return int(bits_of(moves))
