"""Numeric search on a chain: one configuration for a pose, or the closest one and the reason.

Levenberg-Marquardt descents start from a given configuration and from some spread over the joint
ranges, those first whose pose is nearest. Where none meets the pose, the same descents without
joint limits, for the position alone, and for the orientation at that position give the reason.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, as_count, read_only
from ..kinematics.lengths import ModelCache
from ..model import RobotModel
from .chain import without_locked
from .constraints import Components, Constraints, mask_axes
from .loop import JointChain, joint_chain
from .motion import cross, jacobians, tool_poses
from .solver import Tolerances
from .status import IGMStatus

CHUNK = 1024  # poses worked on at a time
SEED = 20
RANK_STARTS = 8  # random configurations whose Jacobians give the rank of a task
GIVE_UP = 0.7  # share of the cost left after five steps above which another start is better
STIFF = (1e3, 1e5)  # weights of the position while the least orientation error is looked for
SIDE_STARTS = 16  # spread starts for the reason why a pose is not met
SIDE_STEPS = 200  # steps to the configuration closest to a position
SPREAD = 0.5  # weight of the orientation in the choice of the next start
MOVES = 1e-10  # squared component of a null-space motion from which a joint moves
ANYWHERE = np.array([[-np.inf], [np.inf]])


class SearchSpace(NamedTuple):
    """Starts of the search and the lengths of a chain.

    Shapes: limits, bounds (2, k); middle (k,); starts (S, k); poses (S, 4, 4). Descents stay
    within ``bounds``: joints with a whole turn are shifted inside their limits afterwards.
    """

    chain: JointChain
    limits: Array
    bounds: Array
    middle: Array
    length: float
    reach: float
    starts: Array
    poses: Array


class Outcome(NamedTuple):
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
        length=length,
        reach=(reach + strokes) * (1.0 + 1e-12),
        starts=read_only(starts),
        poses=read_only(tool_poses(chain, starts)),
    )


_SPACES = ModelCache()


def space_of(
    model: RobotModel,
    limits: bool,
    restarts: int,
    rng: object = None,
    locks: tuple[tuple[int, float], ...] = (),
) -> SearchSpace:
    """Starts of a model, some joints locked; those of the fixed seed are kept with the model."""

    def space(seed: object) -> SearchSpace:
        chain = without_locked(joint_chain(model), locks)
        lower, upper = model.lower[chain.columns], model.upper[chain.columns]
        return search_space(chain, lower, upper, limits, restarts, seed)

    if rng is None and not locks:
        return _SPACES(model, (limits, restarts), lambda: space(SEED))
    if rng is None or isinstance(rng, np.random.Generator):
        return space(SEED if rng is None else rng)
    return space(as_count(rng, "rng", 0))


def pose_search(
    space: SearchSpace,
    components: Components,
    effort: tuple[Tolerances, int, int],
    U: Array,
    first: Array,
    given: bool,
) -> Outcome:
    """Search for one configuration per pose. Shapes: U (N, 4, 4) in R_0, first (N, k).

    ``effort``: tolerances, starts, and iterations from each.
    """
    wanted = _wanted(space.chain, components, space.length)
    parts = []
    for n in range(0, max(len(U), 1), CHUNK):
        rows = slice(n, n + CHUNK)
        parts.append(_Search(space, wanted, *effort, U[rows], first[rows]).outcome(given))
    return Outcome(*map(np.concatenate, zip(*parts, strict=True)))


@lru_cache(maxsize=64)
def _wanted(chain: JointChain, components: Components, length: float) -> Constraints:
    """Constraints of a pose: the same for the same space, so that they are prepared once."""
    return Constraints(chain, components, np.zeros((0, chain.k)), np.zeros(0), length)


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """Search for the poses of one chunk. Shapes: U (N, 4, 4), first (N, k)."""

    space: SearchSpace
    wanted: Constraints
    tolerances: Tolerances
    restarts: int
    iterations: int
    U: Array
    first: Array

    def outcome(self, given: bool) -> Outcome:
        """Postures of the poses that are reached, and the reasons for the others."""
        space, whole, requested = self.space, self.wanted.weight, self.wanted.components.requested
        away = self.U[:, :3, 3] - space.chain.D[0, :3, 3]
        distance = np.hypot(np.hypot(away[:, 0], away[:, 1]), away[:, 2])
        beyond = (distance > space.reach + self.tolerances.position) & all(requested[:3])
        status = np.full(len(self.U), IGMStatus.NOT_CONVERGED, np.int8)
        q, limited = self.first.copy(), np.isfinite(space.limits).any()
        anywhere = np.broadcast_to(ANYWHERE, space.limits.shape)
        for limits, bounds, found in (
            (space.limits, space.bounds, IGMStatus.REACHED),
            (anywhere, anywhere, IGMStatus.OUTSIDE_LIMITS),
        ):
            rows = np.flatnonzero((status == IGMStatus.NOT_CONVERGED) & ~beyond)
            if rows.size == 0 or (found is IGMStatus.OUTSIDE_LIMITS and not limited):
                continue
            starts = self._starts(rows, whole, self.restarts)
            if given:
                starts = np.concatenate([self.first[rows, None], starts], axis=1)
            x = self._descents(rows, starts, whole, GIVE_UP, bounds)[0]
            x = self._in_range(rows, x, limits)
            met = self._met(self._errors(rows, x)[0])[2]
            status[rows[met]] = found
            # what comes closest within the limits, unless the pose is met outside
            kept = met | (found is IGMStatus.REACHED)
            q[rows[kept]] = x[kept]
        rest = np.flatnonzero(status == IGMStatus.NOT_CONVERGED)
        if rest.size and any(requested[:3]):
            q[rest], status[rest] = self._closest_position(rest, q[rest])
            status[beyond] = IGMStatus.TOO_FAR
        error, J = self._errors(np.arange(len(q)), q)
        position, angle, _ = self._met(error)
        valid, family = status == IGMStatus.REACHED, np.zeros(q.shape, np.bool_)
        if valid.any() and q.shape[1]:
            # joints that move along self-motions
            samples = np.zeros(RANK_STARTS, np.int64)
            rank = self._row_space(self._errors(samples, space.starts[:RANK_STARTS])[1])[0].max()
            if rank < q.shape[1]:
                own, moves = self._row_space(J[valid])
                family[valid] = (moves > MOVES) & (own == rank)[:, None]
                status[family.any(axis=1)] = IGMStatus.REACHED_FAMILY
        return Outcome(q, error, np.maximum(position, angle), valid, family, status)

    def _row_space(self, J: Array) -> tuple[NDArray[np.int64], Array]:
        """Rank of the task, and squared components of each joint in its null space."""
        unit = np.where(self.space.chain.sigma == 0, 1.0, 1.0 / self.space.length)
        _, s, rows = np.linalg.svd(self.wanted.weight[:, None] * J / unit, full_matrices=False)
        used = s > 1e-7 * np.maximum(s[:, :1], 1e-300)
        return used.sum(axis=1), 1.0 - np.sum((rows * used[..., None]) ** 2, axis=1)

    def _axes(self, rows: NDArray[np.int64]) -> Array:
        return mask_axes(self.space.chain, self.U[rows], self.wanted.components)

    def _starts(self, rows: NDArray[np.int64], weight: Array, count: int) -> Array:
        """The starts whose poses are nearest, in this order, shape (m, count, k)."""
        poses, U = self.space.poses, self.U[rows]
        away = (U[:, None, :3, 3] - poses[:, :3, 3]) @ self._axes(rows)
        with np.errstate(over="ignore"):
            score = np.sum((away * weight[:3]) ** 2, axis=-1)
        angular = weight[3:].max()
        if angular > 0.0:
            trace = U[:, :3, :3].reshape(-1, 9) @ poses[:, :3, :3].reshape(-1, 9).T
            score += SPREAD * angular**2 * (3.0 - trace)
        return self.space.starts[np.argsort(score, axis=1, kind="stable")[:, :count]]

    def _descents(
        self,
        rows: NDArray[np.int64],
        starts: Array,
        weight: Array,
        patience: float,
        bounds: Array,
        steps: int | None = None,
    ) -> tuple[Array, Array, Array]:
        """Configurations after descents, their errors and minus the derivative of these."""
        steps = self.iterations if steps is None else steps
        return self.wanted.descents(
            self.U[rows], starts, steps, patience, (), weight, bounds, self.tolerances
        )

    def _errors(self, rows: NDArray[np.int64], q: Array) -> tuple[Array, Array]:
        """Errors (m, 6) of configurations and minus their derivatives (m, 6, k)."""
        return self.wanted.descents(self.U[rows], q[:, None], 0, 1.0)[1:]

    def _met(self, error: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Missing part of the requested position and angle, and whether both are met."""
        position, angle = self.wanted.sizes(error)
        limits = self.tolerances
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
        space, m, tolerance = self.space, len(rows), self.tolerances.position
        whole, only = self.wanted.weight, np.arange(6) < 3
        place = np.where(only, whole, 0.0)
        starts = self._starts(rows, place, min(SIDE_STARTS, self.restarts))
        x = np.concatenate([q[:, None], self.first[rows, None], starts], axis=1)
        S = x.shape[1]
        x, tried = x.reshape(m * S, -1), np.repeat(rows, S)
        active = np.arange(m * S)
        # the position; the orientation with it, twice; again the position
        stiff = [whole * np.where(only, factor, 1.0) for factor in STIFF]
        for weight in (place, *stiff, place):
            patience = GIVE_UP if weight is place else 0.999
            x[active], error, _ = self._descents(
                tried[active], x[active, None], weight, patience, space.bounds
            )
            position, _, met = self._met(error)
            active = active[~met & ((position <= tolerance) | (weight is not place))]
            if active.size == 0:
                break
        x = self._in_range(tried, x, space.limits)
        position, angle, met = self._met(self._errors(tried, x)[0])
        # any configuration at the position comes before all that are not
        rank = np.where(position <= tolerance, angle, 10.0 + position).reshape(m, S)
        best = np.arange(m) * S + np.argmin(rank, axis=1)
        q = x[best]
        status = np.full(m, IGMStatus.ORIENTATION_NOT_AVAILABLE, np.int8)
        status[met[best]] = IGMStatus.REACHED
        short = np.flatnonzero(position[best] > tolerance)
        if short.size:
            q[short], status[short] = self._side(rows[short], q[short], place)
        return q, status

    def _side(
        self, rows: NDArray[np.int64], q: Array, place: Array
    ) -> tuple[Array, NDArray[np.int8]]:
        """Configurations closest to the position, and whether it is too far or too near.

        There the line from the tool to the position meets every axis that turns the tool. It is
        too near if one of them lies at the position or beyond: the tool comes no closer to it.
        """
        space, chain = self.space, self.space.chain
        q, error, J = self._descents(rows, q[:, None], place, 1.0, space.bounds, SIDE_STEPS)
        unit = np.where(chain.sigma == 0, 1.0, 1.0 / space.length)
        with np.errstate(over="ignore", invalid="ignore"):
            slope = np.einsum("c,nci,nc->ni", place**2, J, error)
            held = (q <= space.bounds[0]) & (slope <= 0.0)
            held |= (q >= space.bounds[1]) & (slope >= 0.0)
            size = np.linalg.norm(np.where(held, 0.0, slope / unit), axis=1)
            least = size <= 1e-3 * np.linalg.norm(place * error, axis=1)
        ahead = np.einsum("nij,nj->ni", self._axes(rows), error[:, :3] * (place[:3] > 0.0))
        distance = np.hypot(np.hypot(ahead[:, 0], ahead[:, 1]), ahead[:, 2])
        ahead /= np.maximum(distance, 1e-300)[:, None]
        columns = np.swapaxes(jacobians(chain, q), 1, 2)
        velocity, axis = columns[..., :3], columns[..., 3:]
        # the axis passes the line at z x (z x (P - O)) from the tool; a parallel axis is left out
        across = 1.0 - np.einsum("nki,ni->nk", axis, ahead) ** 2
        along = np.einsum("nki,ni->nk", cross(axis, velocity), ahead)
        turning = (chain.sigma == 0) & ~held & (across > 0.01)
        near = turning & (along > 0.5 * across * distance[:, None])
        status = np.where(near.any(axis=1), IGMStatus.TOO_NEAR, IGMStatus.TOO_FAR)
        status[~least] = IGMStatus.NOT_CONVERGED
        q = self._in_range(rows, q, space.limits)
        position, _, met = self._met(self._errors(rows, q)[0])
        status[position <= self.tolerances.position] = IGMStatus.NOT_CONVERGED
        status[met] = IGMStatus.REACHED
        return q, status.astype(np.int8)
