"""Numeric search on a chain: one configuration for a pose, or the closest one and the reason.

Levenberg-Marquardt descents start from a given configuration and from some spread over the joint
ranges, those first whose pose is nearest. Where none meets the pose, the same descents without
joint limits, for the position alone, and for the orientation at that position give the reason.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, read_only
from .loop import JointChain
from .motion import cross, jacobians, tool_poses
from .solver import Tolerances
from .status import IGMStatus

CHUNK = 1024  # poses worked on at a time
RANK_STARTS = 8  # random configurations whose Jacobians give the rank of a task
GIVE_UP = 0.7  # share of the cost left after five steps above which another start is better
STIFF = (1e3, 1e5)  # weights of the position while the least orientation error is looked for
SIDE_STARTS = 16  # spread starts for the reason why a pose is not met
SPREAD = 0.5  # weight of the orientation in the choice of the next start
MOVES = 1e-10  # squared component of a null-space motion from which a joint moves
ANYWHERE = np.array([[-inf], [inf]])


@dataclass(frozen=True, slots=True, eq=False)
class SearchSpace:
    """Starts of the search and the lengths of a chain.

    Shapes: limits, bounds (2, k); middle, unit (k,); starts (S, k); poses (S, 4, 4).
    """

    chain: JointChain
    limits: Array
    """Where configurations must lie; infinite without limits."""
    bounds: Array
    """The same for descents: joints with a whole turn are shifted inside afterwards."""
    middle: Array
    unit: Array
    length: float
    reach: float
    starts: Array
    poses: Array


@dataclass(frozen=True, slots=True, eq=False)
class SearchTask:
    """Components and tolerances asked for, and the effort."""

    mask: NDArray[np.bool_]
    in_tool_axes: bool
    tolerances: Tolerances
    restarts: int
    iterations: int


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Configurations that meet their poses, or come closest.

    Shapes: q, family (N, k); error (N, 6); residual, valid, status (N,).
    """

    q: Array
    error: Array
    residual: Array
    valid: NDArray[np.bool_]
    family: NDArray[np.bool_]
    status: NDArray[np.int8]


def search_space(
    chain: JointChain, lower: Array, upper: Array, limited: bool, restarts: int, rng: object
) -> SearchSpace:
    """Random starts within the joint ranges (k,): the limits, a whole turn, or the arm's length."""
    generator = np.random.default_rng(rng)  # pyright: ignore[reportArgumentType]
    revolute = chain.sigma == 0
    reach = float(np.linalg.norm(chain.D[1:, :3, 3], axis=1).sum())
    length = reach or 1.0
    span = np.where(revolute, 2.0 * pi, 2.0 * length)
    limits = np.array([lower, upper]) if limited else np.repeat(ANYWHERE, chain.k, axis=1)
    bounds = np.where(revolute & (limits[1] - limits[0] >= 2.0 * pi), ANYWHERE, limits)
    low, high = np.where(revolute & (not limited), ANYWHERE, [lower, upper])
    low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - span, -span / 2))
    high = np.where(np.isfinite(high), high, low + span)
    # of more than a turn the one around mid-range is taken
    wide, middle = revolute & (high - low > span), 0.5 * (low + high)
    low, high = np.where(wide, middle - span / 2, low), np.where(wide, middle + span / 2, high)
    starts = low + generator.random((max(restarts, RANK_STARTS), chain.k)) * (high - low)
    strokes = float(np.abs(limits[:, ~revolute]).max(axis=0).sum())
    return SearchSpace(
        chain=chain,
        limits=read_only(limits),
        bounds=read_only(bounds),
        middle=read_only(0.5 * (low + high)),
        unit=read_only(np.where(revolute, 1.0, 1.0 / length)),
        length=length,
        reach=(reach + strokes) * (1.0 + 1e-12),
        starts=read_only(starts),
        poses=read_only(tool_poses(chain, starts)),
    )


def pose_search(
    space: SearchSpace, task: SearchTask, U: Array, first: Array, given: bool
) -> Outcome:
    """Search for one configuration per pose. Shapes: U (N, 4, 4) in R_0, first (N, k)."""
    parts = [
        _Search(space, task, U[rows], first[rows], given).outcome()
        for rows in (slice(n, n + CHUNK) for n in range(0, max(len(U), 1), CHUNK))
    ]
    return Outcome(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in Outcome.__slots__)
    )


class _Search:
    """Search for the poses of one chunk."""

    def __init__(
        self, space: SearchSpace, task: SearchTask, U: Array, first: Array, given: bool
    ) -> None:
        self.space, self.task, self.U = space, task, np.ascontiguousarray(U)
        self.first, self.given = np.ascontiguousarray(first), given
        # components along the axes of the world or of the tool at its desired pose
        turn = U[:, :3, :3] if task.in_tool_axes else space.chain.base[:3, :3].T
        self.axes = np.ascontiguousarray(np.broadcast_to(turn, (len(U), 3, 3)))
        self.whole = np.where(task.mask, [1.0 / space.length] * 3 + [1.0] * 3, 0.0)
        self.place = np.where(np.arange(6) < 3, self.whole, 0.0)

    def outcome(self) -> Outcome:
        """Solve what can be solved, and give the reason for the rest."""
        space, task = self.space, self.task
        away = self.U[:, :3, 3] - space.chain.D[0, :3, 3]
        distance = np.hypot(np.hypot(away[:, 0], away[:, 1]), away[:, 2])
        beyond = (distance > space.reach + task.tolerances.position) & task.mask[:3].all()
        status = np.full(len(self.U), IGMStatus.NOT_CONVERGED, np.int8)
        q = self.first.copy()
        limited = np.isfinite(space.limits).any()
        for limits, bounds, found in (
            (space.limits, space.bounds, IGMStatus.REACHED),
            (ANYWHERE, ANYWHERE, IGMStatus.OUTSIDE_LIMITS),
        ):
            rows = np.flatnonzero((status == IGMStatus.NOT_CONVERGED) & ~beyond)
            if rows.size == 0 or (found is IGMStatus.OUTSIDE_LIMITS and not limited):
                continue
            order = self._order(rows, self.whole)[:, : task.restarts]
            if self.given:
                order = np.concatenate([np.full((rows.size, 1), -1), order], axis=1)
            x = self._descents(rows, self.first[rows], order, self.whole, GIVE_UP, bounds)[0]
            x = self._in_range(rows, x, limits)
            met = self._sizes(self._errors(rows, x)[0])[2]
            status[rows[met]] = found
            # what comes closest within the limits, unless the pose is met outside
            kept = met | (found is IGMStatus.REACHED)
            q[rows[kept]] = x[kept]
        rest = np.flatnonzero(status == IGMStatus.NOT_CONVERGED)
        if rest.size and self.place.any():
            q[rest], status[rest] = self._closest_position(rest, q[rest])
            status[beyond] = IGMStatus.TOO_FAR
        return self._checked(q, status)

    def _checked(self, q: Array, status: NDArray[np.int8]) -> Outcome:
        """Errors of the configurations, and the joints that move along self-motions."""
        k = self.space.chain.k
        error, J = self._errors(np.arange(len(q)), q)
        position, angle, _ = self._sizes(error)
        valid = status == IGMStatus.REACHED
        family = np.zeros((len(q), k), np.bool_)
        if valid.any() and k:
            samples = np.zeros(RANK_STARTS, np.int64)
            rank = self._row_space(self._errors(samples, self.space.starts[:RANK_STARTS])[1])[0]
            if rank.max() < k:
                own, moves = self._row_space(J[valid])
                family[valid] = (moves > MOVES) & (own == rank.max())[:, None]
                status[family.any(axis=1)] = IGMStatus.REACHED_FAMILY
        return Outcome(q, error, np.maximum(position, angle), valid, family, status)

    def _row_space(self, J: Array) -> tuple[NDArray[np.int64], Array]:
        """Rank of the task, and squared components of each joint in its null space."""
        _, s, rows = np.linalg.svd(self.whole[:, None] * J / self.space.unit, full_matrices=False)
        used = s > 1e-7 * np.maximum(s[:, :1], 1e-300)
        return used.sum(axis=1), 1.0 - np.sum((rows * used[..., None]) ** 2, axis=1)

    def _order(self, rows: NDArray[np.int64], weight: Array) -> NDArray[np.int64]:
        """Starts ordered by the distance of their poses, shape (m, S)."""
        poses, U = self.space.poses, self.U[rows]
        away = (U[:, None, :3, 3] - poses[:, :3, 3]) @ self.axes[rows]
        with np.errstate(over="ignore"):
            score = np.sum((away * weight[:3]) ** 2, axis=-1)
        angular = weight[3:].max()
        if angular > 0.0:
            trace = U[:, :3, :3].reshape(-1, 9) @ poses[:, :3, :3].reshape(-1, 9).T
            score += SPREAD * angular**2 * (3.0 - trace)
        return np.argsort(score, axis=1, kind="stable")

    def _descents(
        self,
        rows: NDArray[np.int64],
        first: Array,
        order: NDArray[np.int64] | None,
        weight: Array,
        patience: float,
        bounds: Array,
        iterations: int | None = None,
    ) -> tuple[Array, Array, Array]:
        """Configurations after descents, their errors and the derivatives of these."""
        from .kernels.damped import damped_searches

        chain, m = self.space.chain, len(rows)
        q, error, J = np.empty((m, chain.k)), np.empty((m, 6)), np.empty((m, 6, chain.k))
        damped_searches(
            chain.sigma,
            chain.D,
            self.U[rows],
            self.axes[rows],
            weight,
            np.array(self.task.tolerances),
            np.ascontiguousarray(np.broadcast_to(bounds, (2, chain.k))),
            self.space.unit,
            np.ascontiguousarray(first),
            self.space.starts,
            np.full((m, 1), -1) if order is None else np.ascontiguousarray(order),
            self.task.iterations if iterations is None else iterations,
            patience,
            q,
            error,
            J,
        )
        return q, error, J

    def _errors(self, rows: NDArray[np.int64], q: Array) -> tuple[Array, Array]:
        """Errors (m, 6) of configurations and their derivatives (m, 6, k)."""
        return self._descents(rows, q, None, self.whole, GIVE_UP, ANYWHERE, 0)[1:]

    def _sizes(self, error: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Position and angle missing of what is asked for, and whether both are met."""
        e = error * self.task.mask
        position, angle = (np.hypot(np.hypot(a, b), c) for a, b, c in (e[:, :3].T, e[:, 3:].T))
        limits = self.task.tolerances
        return position, angle, (position <= limits.position) & (angle <= limits.orientation)

    def _in_range(self, rows: NDArray[np.int64], q: Array, limits: Array) -> Array:
        """Angles shifted by whole turns: to (-pi, pi], or inside limits nearest to the start."""
        turn = 2.0 * pi
        near = np.rint((self.first[rows] - q) / turn)
        near = np.maximum(near, np.ceil((limits[0] - q) / turn))
        near = np.minimum(near, np.floor((limits[1] - q) / turn))
        wrapped = q - turn * np.rint(q / turn)
        wrapped = np.where(wrapped <= -pi, pi, wrapped)
        # at the ends of a range only rounding is clipped
        inside = np.clip(q + turn * near, limits[0], limits[1])
        shifted = np.where(np.isinf(limits).all(axis=0), wrapped, inside)
        return np.where(self.space.chain.sigma == 0, shifted, q)

    def _closest_position(
        self, rows: NDArray[np.int64], q: Array
    ) -> tuple[Array, NDArray[np.int8]]:
        """Configurations at the position with the least angle missing, else closest to it."""
        space, m = self.space, len(rows)
        tolerance = self.task.tolerances.position
        starts = space.starts[
            self._order(rows, self.place)[:, : min(SIDE_STARTS, self.task.restarts)]
        ]
        x = np.concatenate([q[:, None], self.first[rows, None], starts], axis=1)
        S = x.shape[1]
        x, tried = x.reshape(m * S, -1), np.repeat(rows, S)
        active = np.arange(m * S)
        # the position; the orientation with it, twice; again the position
        stiff = [self.whole * np.where(np.arange(6) < 3, factor, 1.0) for factor in STIFF]
        for weight in (self.place, *stiff, self.place):
            patience = GIVE_UP if weight is self.place else 0.999
            x[active], error, _ = self._descents(
                tried[active], x[active], None, weight, patience, space.bounds
            )
            position, _, met = self._sizes(error)
            keep = ~met & ((position <= tolerance) | (weight is not self.place))
            active = active[keep]
            if active.size == 0:
                break
        x = self._in_range(tried, x, space.limits)
        position, angle, met = self._sizes(self._errors(tried, x)[0])
        # any configuration at the position comes before all that are not
        rank = np.where(position <= tolerance, angle, 10.0 + position).reshape(m, S)
        best = np.arange(m) * S + np.argmin(rank, axis=1)
        q = x[best]
        status = np.full(m, IGMStatus.ORIENTATION_NOT_AVAILABLE, np.int8)
        status[met[best]] = IGMStatus.REACHED
        short = np.flatnonzero(position[best] > tolerance)
        if short.size:
            q[short], status[short] = self._side(rows[short], q[short])
        return q, status

    def _side(self, rows: NDArray[np.int64], q: Array) -> tuple[Array, NDArray[np.int8]]:
        """Configurations closest to the position, and whether it is too far or too near."""
        bounds = self.space.bounds
        status = np.full(len(rows), IGMStatus.NOT_CONVERGED, np.int8)
        active = np.arange(len(rows))
        for _ in range(20):
            q[active], error, J = self._descents(
                rows[active], q[active], None, self.place, GIVE_UP, bounds
            )
            with np.errstate(over="ignore", invalid="ignore"):
                slope = np.einsum("c,nci,nc->ni", self.place**2, J, error)
                held = (q[active] <= bounds[0]) & (slope <= 0.0)
                held |= (q[active] >= bounds[1]) & (slope >= 0.0)
                size = np.linalg.norm(np.where(held, 0.0, slope / self.space.unit), axis=1)
                cost = np.linalg.norm(self.place * error, axis=1)
            least = size <= 1e-3 * cost
            at = active[least]
            status[at] = self._side_of(rows[at], q[at], error[least], held[least])
            active = active[~least]
            if active.size == 0:
                break
        q = self._in_range(rows, q, self.space.limits)
        position, _, met = self._sizes(self._errors(rows, q)[0])
        status[position <= self.task.tolerances.position] = IGMStatus.NOT_CONVERGED
        status[met] = IGMStatus.REACHED
        return q, status

    def _side_of(
        self, rows: NDArray[np.int64], q: Array, error: Array, held: NDArray[np.bool_]
    ) -> NDArray[np.int8]:
        """Whether positions are too far or too near for the configurations closest to them.

        There the line from the tool to the position meets every axis that turns the tool. It is
        too near if one of them lies at the position or beyond: the tool comes no closer to it.
        """
        e = np.where(self.task.mask[:3], error[:, :3], 0.0)
        ahead = np.einsum("nij,nj->ni", self.axes[rows], e)
        distance = np.hypot(np.hypot(ahead[:, 0], ahead[:, 1]), ahead[:, 2])
        ahead /= np.maximum(distance, 1e-300)[:, None]
        J = np.swapaxes(jacobians(self.space.chain, q), 1, 2)
        velocity, axis = J[..., :3], J[..., 3:]
        # the axis passes the line at z x (z x (P - O)) from the tool; a parallel axis is left out
        slope = 1.0 - np.einsum("nki,ni->nk", axis, ahead) ** 2
        along = np.einsum("nki,ni->nk", cross(axis, velocity), ahead)
        turning = (self.space.chain.sigma == 0) & ~held & (slope > 0.01)
        near = turning & (along > 0.5 * slope * distance[:, None])
        return np.where(near.any(axis=1), IGMStatus.TOO_NEAR, IGMStatus.TOO_FAR).astype(np.int8)
