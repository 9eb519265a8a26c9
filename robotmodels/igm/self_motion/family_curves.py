"""Families of postures of one pose walked from end to end, and cut at the reference values.

Curves are walked all round and cut where the first joint that moves has its reference value;
families of more dimensions are first driven to the reference of that joint, and what is left has
one dimension less. Lengths are in units of the arm; held joints are bits of a number.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array

SAME = 1e-6  # postures closer than this in every joint are one
STILL = 1e-6  # range, or part of a direction, below which a joint does not move
STARTS = 16  # starts of the search for other curves
POINTS = 4000  # points of a curve, doubled until it fits
MOST_POINTS = 16000  # but not beyond this


@dataclass(slots=True)
class Curve:
    """A piece of a curve: points, directions (M, k), second flattest singular values (M,)."""

    held: int
    points: Array
    tangents: Array
    flat: Array


@dataclass(slots=True)
class Waiting:
    """A posture to be looked at: joints held, joints that were seen to move, both as bits."""

    q: Array
    held: int
    moving: int
    turned: bool  # a held joint is not at its reference but turns round there


@dataclass(slots=True)
class Family:
    """Infinite families of one pose. Shapes: references (k,)."""

    sigma: NDArray[np.int64]
    D: Array
    U: Array
    references: Array
    curves: list[Curve] = field(default_factory=list)
    waiting: list[Waiting] = field(default_factory=list)

    def difference(self, a: Array, b: Array) -> Array:
        """``a - b`` the short way round, shape (..., k)."""
        d = a - b
        return np.where(self.sigma == 0, np.remainder(d + np.pi, 2.0 * np.pi) - np.pi, d)

    def offset(self, q: Array, joint: int) -> float:
        """How far a joint is from its reference, the short way round."""
        g = float(q[joint] - self.references[joint])
        if self.sigma[joint] == 0:
            g = float(np.remainder(g + np.pi, 2.0 * np.pi) - np.pi)
        return g

    def corrected(self, q: Array, held: int, spare: int) -> tuple[Array, float]:
        """The posture brought back to the pose, and its error."""
        from ._correction import corrected

        out = np.array(q)
        return out, corrected(self.sigma, self.D, self.U, out, held, spare)

    def directions(self, q: Array, held: int) -> tuple[Array, int]:
        """Directions (d, k) in which the family goes on, and the dimension of the null space."""
        from ._directions import directions

        rows = np.empty((24, q.size))
        count, null = directions(self.sigma, self.D, self.U, q, held, rows)
        return rows[:count], null

    def tangent(self, q: Array, held: int, before: Array) -> tuple[Array, float]:
        """Direction of a curve at a posture, and the second flattest singular value."""
        from ._directions import tangent

        out = np.empty(q.size)
        return out, tangent(self.sigma, self.D, q, held, before, out)[1]

    def add(self, q: Array, held: int, moving: int, turned: bool) -> None:
        """Let a posture wait, unless it did so before."""
        for other in self.waiting:
            if other.held == held and np.max(np.abs(self.difference(other.q, q))) < SAME:
                other.moving |= moving
                return
        self.waiting.append(Waiting(np.array(q), held, moving, turned))


def settled_members(family: Family, q: Array) -> list[tuple[Waiting, bool]]:
    """Family members through q with free joints at their reference values. Shapes: q (k,)."""
    from ._correction import MET, on_fold
    from ._directions import PROBE

    head = len(family.waiting)
    family.add(q, 0, 0, False)
    settled = []
    while head < len(family.waiting):
        item = family.waiting[head]
        head += 1
        rows, null = family.directions(item.q, item.held)
        if len(rows) == 0:
            on_fold(family.sigma, family.D, family.U, item.q, item.held, 0)
            settled.append((item, null > 0 and not item.turned))
        for row in rows:
            # a member beside this one tells how many dimensions the family has
            aside, error = family.corrected(item.q + PROBE * row, item.held, 1)
            if error > MET:
                aside, error = family.corrected(item.q - PROBE * row, item.held, 1)
            basis = _independent(family.directions(aside, item.held)[0])
            if len(basis) > 1:
                # where joints happen to be at rest others seem to be the first that move
                mixed = np.cos(1.0 + 2.3 * np.arange(len(basis))) @ basis
                y, error = family.corrected(aside + PROBE * mixed, item.held, len(basis))
                further = _independent(family.directions(y, item.held)[0])
                if error <= MET and len(further) == len(basis):
                    aside, basis = y, further
                _drive(family, item, aside, basis)
                if len(basis) == null:
                    break  # no fold and no crossing: one surface through this posture
            else:
                _follow(family, item, row)
    return settled


def _independent(rows: Array) -> Array:
    """Orthonormal vectors that span the rows, shape (d, k)."""
    if len(rows) < 2:
        return rows
    _, s, Vt = np.linalg.svd(rows, full_matrices=False)
    return Vt[s > 0.1]


def _bits(moves: NDArray[np.bool_]) -> int:
    return int(np.sum(1 << np.flatnonzero(moves)))


# --- one dimension -------------------------------------------------------------------------------


def _follow(family: Family, item: Waiting, along: Array) -> None:
    """Walk a curve all round; its postures at the reference of its first joint wait."""
    if _is_walked(family, item.q, along, item.held):
        return
    pieces = [_walk(family, item.q, along, item.held)]
    if not pieces[0][1]:
        pieces.append(_walk(family, item.q, -along, item.held))
    curves = [curve for curve, _ in pieces]
    family.curves += curves
    points = np.concatenate([curve.points for curve in curves])
    moves = np.ptp(points, axis=0) > STILL
    if not moves.any():
        return
    joint = int(np.argmax(moves))
    found = [one for curve in curves for one in _cuts(family, curve, joint)]
    least = min(away for _, away in found)
    for q, away in found:
        # of the turning points those that come nearest
        if away <= least + 1e-9:
            family.add(
                q, item.held | 1 << joint, item.moving | _bits(moves), item.turned or least > 0.0
            )
    for q in _elsewhere(family, item, points, moves, joint):
        family.add(q, item.held | 1 << joint, item.moving | _bits(moves), item.turned)
    # where the Jacobian loses one more dimension another curve may cross this one
    for curve in curves:
        for q in _branchings(family, curve):
            family.add(q, item.held, item.moving, item.turned)


def _elsewhere(
    family: Family, item: Waiting, points: Array, moves: NDArray[np.bool_], joint: int
) -> list[Array]:
    """Postures at the reference on other curves that the same joints make, from many starts.

    A linkage of four bars may be put together in two ways that no motion joins.
    """
    from ._correction import MET, sought

    rng = np.random.default_rng(0)
    centre, spread = np.mean(points, axis=0), np.ptp(points, axis=0)
    turns = family.sigma == 0
    held = item.held | 1 << joint | _bits(~moves)
    found = []
    for _ in range(STARTS):
        spin = rng.uniform(-1.0, 1.0, moves.size)
        q = np.where(turns, np.pi * spin, centre + np.minimum(spread, 4.0) * spin)
        q = np.where(moves, q, item.q)
        q[joint] = family.references[joint]
        if sought(family.sigma, family.D, family.U, q, held) <= MET:
            found.append(q)
    return found


def _walk(family: Family, start: Array, along: Array, held: int) -> tuple[Curve, bool]:
    """A curve one way from the start; whether it came back."""
    from ._directions import walked

    room, k = POINTS, start.size
    while True:
        points, tangents, flat = np.empty((room, k)), np.empty((room, k)), np.empty(room)
        n, closed = walked(
            family.sigma, family.D, family.U, start, along, held, points, tangents, flat
        )
        # one that still runs on then winds beside itself: rounding keeps it from closing
        if n < room or room >= MOST_POINTS:
            return Curve(held, points[:n], tangents[:n], flat[:n]), bool(closed)
        room *= 2


def _is_walked(family: Family, q: Array, along: Array, held: int) -> bool:
    """Whether a posture lies on a curve that was walked, in its direction."""
    for curve in family.curves:
        if curve.held != held or len(curve.points) < 2:
            continue
        chords = np.diff(curve.points, axis=0)
        d = family.difference(q, curve.points[:-1])
        lengths = np.sum(chords**2, axis=1)
        shares = np.sum(d * chords, axis=1) / lengths
        off = np.sum(d**2, axis=1) - shares**2 * lengths
        near = (off < 0.01 + 0.02 * lengths) & (shares > -0.2) & (shares < 1.2)
        near &= np.abs(curve.tangents[:-1] @ along) > 0.7
        for i in np.flatnonzero(near):
            share = float(shares[i])
            left = np.inf
            for _ in range(6):
                p, _ = family.corrected(curve.points[i] + share * chords[i], held, 1)
                gap = family.difference(q, p)
                left = np.max(np.abs(gap))
                if left < 1e-5:
                    return True
                share += float(gap @ chords[i]) / lengths[i]
                if not -0.3 < share < 1.3:
                    break
    return False


def _between(family: Family, a: Array, b: Array, share: float, held: int) -> Array:
    """A point of a curve between two of its points."""
    return family.corrected(a + share * (b - a), held, 1)[0]


def _cuts(family: Family, curve: Curve, joint: int) -> list[tuple[Array, float]]:
    """Where a joint has its reference along a curve, with 0, and where it turns, with how near."""
    points, slopes = curve.points, curve.tangents[:, joint]
    found = []
    g = points[:, joint] - family.references[joint]
    if family.sigma[joint] == 0:
        g = np.remainder(g + np.pi, 2.0 * np.pi) - np.pi
    # steps are far shorter than half a turn, so that g of the next point follows from the step
    ahead = g[:-1] + np.diff(points[:, joint])
    at_point = (np.abs(g) <= 1e-12) | (np.abs(slopes) < 1e-7)
    at_point[[0, -1]] = True  # ends of curves without end; harmless where it is closed
    found += [(points[i], float(abs(g[i])) if abs(g[i]) > 1e-12 else 0.0)
              for i in np.flatnonzero(at_point)]  # fmt: skip
    for i in np.flatnonzero(g[:-1] * ahead < 0.0):
        value = points[i, joint] - g[i]
        q = _crossing(family, points[i], points[i + 1], joint, value, curve.held)
        if q is not None:
            found.append((q, 0.0))
    for i in np.flatnonzero((g[:-1] * ahead > 0.0) & (slopes[:-1] * slopes[1:] < 0.0)):
        value = points[i, joint] - g[i]
        turn = _turning_point(family, curve, int(i), joint)
        away = float(turn[joint] - value)
        if away * g[i] < 0.0 and abs(away) > 1e-12:
            for end in (points[i], points[i + 1]):
                q = _crossing(family, end, turn, joint, value, curve.held)
                if q is not None:
                    found.append((q, 0.0))
        else:
            # touching within what half of the digits can tell is touching
            found.append((turn, abs(away) if abs(away) > 1e-12 else 0.0))
    return found


def _crossing(
    family: Family, a: Array, b: Array, joint: int, value: float, held: int
) -> Array | None:
    """The point between two of a curve at which a joint has a value."""
    from ._correction import MET

    near = a
    low, high, f_low, f_high = 0.0, 1.0, a[joint] - value, b[joint] - value
    for _ in range(60):
        share = low + (high - low) * f_low / (f_low - f_high)
        near = _between(family, a, b, share, held)
        f = near[joint] - value
        if abs(f) < 1e-9 or high - low < 1e-12:
            break
        # regula falsi; the end that stays is weighed less, so that it moves at last
        if (f > 0.0) == (f_low > 0.0):
            low, f_low, f_high = share, f, 0.5 * f_high
        else:
            high, f_high, f_low = share, f, 0.5 * f_low
    start = near.copy()
    start[joint] = value
    q, error = family.corrected(start, held | 1 << joint, 0)
    if error <= MET and np.max(np.abs(q - near)) < 1e-2:
        return q
    # beside a turning point that rounding put short of the value
    return near if abs(near[joint] - value) < SAME else None


def _turning_point(family: Family, curve: Curve, i: int, joint: int) -> Array:
    """The point between two of a curve at which a joint turns round."""
    a, b, before = curve.points[i], curve.points[i + 1], curve.tangents[i]
    low, high = 0.0, 1.0
    f_low, f_high = before[joint], curve.tangents[i + 1, joint]
    q = a
    for _ in range(60):
        share = (low * f_high - high * f_low) / (f_high - f_low)
        q = _between(family, a, b, share, curve.held)
        f = family.tangent(q, curve.held, before)[0][joint]
        if abs(f) < 1e-13 or high - low < 1e-12:
            break
        if (f > 0.0) == (f_low > 0.0):
            low, f_low, f_high = share, f, 0.5 * f_high
        else:
            high, f_high, f_low = share, f, 0.5 * f_low
    return q


def _branchings(family: Family, curve: Curve) -> list[Array]:
    """Postures at which another curve crosses this one: a second singular value vanishes."""
    from ._directions import SINGULAR

    flat, found = curve.flat, []
    low = np.minimum(flat[:-2], flat[2:])
    ratio = 0.5 * (np.sqrt(5.0) - 1.0)
    for i in np.flatnonzero((low > 1e-5) & (flat[1:-1] <= low) & (flat[1:-1] < 0.1)) + 1:
        for a, b in (
            (curve.points[i - 1], curve.points[i]),
            (curve.points[i], curve.points[i + 1]),
        ):

            def flatness(share: float, a: Array = a, b: Array = b) -> tuple[float, Array]:
                q = _between(family, a, b, share, curve.held)
                return family.tangent(q, curve.held, b - a)[1], q

            start, end = 0.0, 1.0
            x, y = 1.0 - ratio, ratio
            at_x, at_y = flatness(x), flatness(y)
            for _ in range(40):
                if at_x[0] < at_y[0]:
                    end, y, at_y = y, x, at_x
                    x = end - ratio * (end - start)
                    at_x = flatness(x)
                else:
                    start, x, at_x = x, y, at_y
                    y = start + ratio * (end - start)
                    at_y = flatness(y)
                if min(at_x[0], at_y[0]) < 0.1 * SINGULAR:
                    break
            best = min(at_x, at_y, key=lambda pair: pair[0])
            if best[0] < SINGULAR:
                found.append(best[1])
    return found


# --- more dimensions -----------------------------------------------------------------------------


def _drive(family: Family, item: Waiting, q: Array, basis: Array) -> None:
    """Drive the first joint that moves to its reference both ways; what is reached waits."""
    moves = np.max(np.abs(basis), axis=0) > STILL
    joint = int(np.argmax(moves))
    ends = [_driven(family, q, basis, joint, item.held, sense) for sense in (1.0, -1.0)]
    least = min(away for _, away in ends)
    for end, away in ends:
        if away <= least + 1e-9:
            family.add(
                end, item.held | 1 << joint, item.moving | _bits(moves), item.turned or least > 0.0
            )


def _driven(
    family: Family, q: Array, basis: Array, joint: int, held: int, sense: float
) -> tuple[Array, float]:
    """Move until a joint has its reference, or turns round; how far from it it stopped."""
    from ._correction import MET, decomposed
    from ._directions import SINGULAR, STRIDE

    k, rank = q.size, len(basis)
    left = -sense * family.offset(q, joint)
    if left < -1e-12:
        if family.sigma[joint] == 1:
            return q, abs(left)
        left += 2.0 * np.pi
    W, s, V = np.empty((6, k)), np.empty(k), np.empty((k, k))
    h = STRIDE
    while left > 1e-9:
        v = basis.T @ basis[:, joint]
        size = float(np.linalg.norm(v))
        if size < 1e-7 or h < 1e-7:
            break
        step = min(h, left / size)
        ahead = q + sense * step / size * v
        y, error = family.corrected(ahead, held, rank)
        gone = sense * float(y[joint] - q[joint])
        if error > MET or gone <= 0.0 or np.linalg.norm(y - ahead) > 0.25 * step:
            h = 0.5 * step
            continue
        q, left = y, left - gone
        h = min(1.5 * h, STRIDE if family.sigma[joint] == 0 else 1.0)
        f = decomposed(family.sigma, family.D, q, held, W, s, V)
        first = f - max(rank, int(np.sum(s[:f] < SINGULAR)))
        null = V[:, first:f]
        basis = np.linalg.qr(null @ (null.T @ basis.T))[0].T
    away = abs(family.offset(q, joint))
    if away <= SAME:
        start = np.array(q)
        start[joint] -= family.offset(q, joint)
        y, error = family.corrected(start, held | 1 << joint, rank - 1)
        if error <= MET:
            return y, 0.0
    return q, away
