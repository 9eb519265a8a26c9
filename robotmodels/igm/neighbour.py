"""Six-joint arms that have a closed form but for calibration errors or rounded numbers.

A calibrated wrist has axes that miss each other by a tenth of a millimetre, a URDF writes 1.5708:
the closed forms do not hold for such an arm, and the elimination for general arms is at its worst.
So the structured arm next to it is built, every posture of that arm found in closed form, and
brought home to the arm itself branch by branch.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array, read_only
from . import _neighbour_arm as arm
from ._neighbour_arm import OFFSET_TOLERANCE, TILT_TOLERANCE
from .check import checked
from .closed_form import closed_form_postures
from .elimination import EliminationArm, elimination_solutions, prepare_elimination
from .loop import JointChain
from .solver import Found, Tolerances, nothing_found, postures
from .structure import Family, LoopPlan

__all__ = ["OFFSET_TOLERANCE", "TILT_TOLERANCE", "Neighbour", "prepare_neighbour"]

SHARE = 0.04
"""Offset beside half the length of the arm above which it is no error any more."""

REACH = 6.0  # deviations by which a best approach of the neighbour may miss
NEARLY_SINGULAR = 3.0  # deviations up to which a singular value may hide more postures
JUMP = 6.0  # deviations by which a joint of a regular branch may move
VALLEY = 1.5  # roots of the deviation up to which the Jacobian is singular enough for a valley
FAR = 6.0  # deviations missing in a valley beyond which it is left
ASIDE = 24  # poses nearby that are asked where doubts are left
SPREAD = 0.25  # distance of starts nearby above which both are followed [rad]
FEW = 8  # and where three parallel axes may be next to others
MOST = 16  # postures of one pose
CHUNK = 1024


@dataclass(frozen=True, slots=True, eq=False)
class Neighbour:
    """Six-joint arm and its nearest arm with a closed form. Shapes: path (17, 7, 4, 4)."""

    chain: JointChain
    near: JointChain
    plan: LoopPlan
    offset: float
    tilt: float
    unit: float
    deviation: float
    abrupt: bool
    path: Array

    @property
    def method(self) -> str:
        """The family in words."""
        return (
            f"{self.plan.family.value}, to within {1e3 * self.offset:.2g} mm and "
            f"{np.rad2deg(self.tilt):.2g} deg; solved on that arm and brought home by Newton steps"
        )


def prepare_neighbour(chain: JointChain) -> Neighbour | None:
    """Nearest arm with a closed form to a six-joint arm."""
    if chain.k != 6:
        return None
    own = arm.slid(chain.D)
    unit = max(0.5 * float(np.linalg.norm(own[1:, :3, 3], axis=1).sum()), 1e-3)
    best: tuple[float, arm.Change, LoopPlan] | None = None
    for first in range(4):
        if chain.sigma[first : first + 3].any():
            continue
        for family, make in (
            (Family.CONCURRENT, arm.meeting),
            (Family.PARALLEL, arm.parallel),
        ):
            change = make(own, first)
            if change is None or not change.small or change.offset > SHARE * unit:
                continue
            found = arm.planned(chain, change, family)
            if found is not None and (best is None or found[0].size < best[0]):
                best = found[0].size, *found
    if best is None:
        return None
    _, change, plan = best
    deviation = arm.deviation(chain.sigma, change.D, own, unit)
    return Neighbour(
        chain=chain,
        near=replace(chain, D=read_only(change.D)),
        plan=plan,
        offset=change.offset,
        tilt=change.tilt,
        unit=unit,
        deviation=deviation,
        abrupt=arm.abrupt(plan),
        path=read_only(arm.path_between(change.D, own, unit)),
    )


@postures.register
def _(solver: Neighbour, U: Array, references: Array, tolerances: Tolerances) -> Found:
    N = U.shape[0]
    out = nothing_found(N, MOST, 6)
    wanted = np.zeros((N, 6))
    wanted[:] = references
    for start in range(0, N, CHUNK):
        rows = slice(start, start + CHUNK)
        _solve(solver, np.ascontiguousarray(U[rows]), wanted[rows], tolerances, rows, out)
    return out


# --- solving ------------------------------------------------------------------------------------


def _solve(
    solver: Neighbour,
    U: Array,
    references: Array,
    tolerances: Tolerances,
    rows: slice,
    out: Found,
) -> None:
    """Postures of some poses into rows of the result."""
    from . import _neighbour as kernels

    N = U.shape[0]
    goals, scaled = _scaled(solver, U, references)
    candidates, there = _candidates(solver, U, references)
    finite = np.asarray(np.isfinite(goals).all(axis=(1, 2)))
    there &= finite[:, None]
    state = _Search(
        goals=goals,
        references=scaled,
        candidates=candidates,
        there=there,
        arrived=np.zeros(there.shape, np.bool_),
        doubtful=np.zeros(there.shape, np.bool_),
        moved=np.zeros(there.shape),
        exact=np.zeros(N, np.int64),
        found=np.zeros((N, MOST, 6)),
        count=np.zeros(N, np.int64),
        double=np.zeros((N, MOST), np.bool_),
        free=np.zeros((N, MOST), np.int64),
    )
    doubt = np.zeros(N, np.bool_)
    sigma = np.ascontiguousarray(solver.chain.sigma)
    kernels.arrivals(
        sigma, solver.path[0], solver.path[-1], goals, candidates, there,
        max(REACH * solver.deviation, 1e-7), _small(solver), min(JUMP * solver.deviation, 0.2),
        state.found, state.count, state.arrived, state.exact, state.doubtful, state.moved, doubt,
    )  # fmt: skip
    if solver.abrupt:
        doubt |= finite & (there.sum(axis=1) < 8)
    chosen = np.flatnonzero(doubt)
    if chosen.size:
        part = state.rows(chosen)
        _search(solver, U[chosen], part, tolerances)
        state.put(chosen, part)
    q = state.found
    q[:, :, sigma == 1] *= solver.unit
    found = checked(
        solver.chain,
        U,
        q,
        np.arange(MOST) < state.count[:, None],
        tolerances,
        free=state.free[:, :, None] == np.arange(1, 7),
        double=state.double,
    )
    out.q[rows], out.valid[rows], out.residual[rows] = found.q, found.valid, found.residual
    out.double[rows], out.free[rows], out.family[rows] = found.double, found.free, found.family


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """What is known of the postures of N poses; lengths in units of the arm."""

    goals: Array
    references: Array
    candidates: Array
    there: NDArray[np.bool_]
    arrived: NDArray[np.bool_]
    doubtful: NDArray[np.bool_]
    moved: Array
    exact: NDArray[np.int64]
    found: Array
    count: NDArray[np.int64]
    double: NDArray[np.bool_]
    free: NDArray[np.int64]

    def rows(self, chosen: NDArray[np.int64]) -> _Search:
        """Some of the poses, copied."""
        return _Search(
            **{field.name: np.ascontiguousarray(getattr(self, field.name)[chosen])
               for field in fields(self)}
        )  # fmt: skip

    def put(self, chosen: NDArray[np.int64], part: _Search) -> None:
        """Write the postures of some of the poses back."""
        self.found[chosen], self.count[chosen] = part.found, part.count
        self.double[chosen], self.free[chosen] = part.double, part.free


def _small(solver: Neighbour) -> float:
    """Singular value below which the arm may have postures that its neighbour has not."""
    return min(max(NEARLY_SINGULAR * solver.deviation, 1e-6), 0.3)


def _scaled(solver: Neighbour, U: Array, references: Array) -> tuple[Array, Array]:
    goals, scaled = U.copy(), references.copy()
    goals[:, :3, 3] /= solver.unit
    scaled[:, solver.chain.sigma == 1] /= solver.unit
    return goals, scaled


def _candidates(solver: Neighbour, U: Array, references: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Postures of the neighbour, or its best approach; lengths in units of the arm."""
    slack = max(3.0 * solver.deviation * max(1.0, solver.unit / solver.plan.size), 1e-9)
    q, there, _ = closed_form_postures(
        solver.plan, solver.near, U, references, slack=slack, accepted=np.inf
    )
    q[:, :, solver.chain.sigma == 1] /= solver.unit
    return q, there


def _search(solver: Neighbour, U: Array, part: _Search, tolerances: Tolerances) -> None:
    """Find the postures of poses in doubt, in place."""
    from . import _neighbour as kernels

    sigma = np.ascontiguousarray(solver.chain.sigma)
    kernels.followed(
        sigma, solver.path, part.goals, part.candidates, part.there, part.arrived,
        part.found, part.count,
    )  # fmt: skip
    # near singular postures the reference may be all that leads to the posture that is meant
    ones = np.ones((len(U), 1), np.bool_)
    kernels.tried(
        sigma, solver.path[-1], part.goals, np.ascontiguousarray(part.references[:, None]), ones,
        np.zeros_like(ones), part.found, part.count,
    )  # fmt: skip
    _walk(solver, part, part.candidates, part.doubtful, part.moved, tolerances)
    uneven = (part.count + part.double.sum(axis=1)) % 2 == 1
    own = part.there.sum(axis=1)
    # a family within the tolerance stands for all of its members
    settled = (part.free > 0).any(axis=1)
    unsure = (uneven | (np.minimum(part.count, part.exact) < own)) & ~settled
    _ask_aside(solver, U, part, np.flatnonzero(unsure), ASIDE, False, tolerances)
    if solver.abrupt:
        chosen = np.flatnonzero(~unsure & ~settled & (own < 8))
        shifts = FEW if solver.plan.family is Family.PARALLEL else ASIDE
        _ask_aside(solver, U, part, chosen, shifts, True, tolerances)


def _ask_aside(
    solver: Neighbour,
    U: Array,
    part: _Search,
    chosen: NDArray[np.int64],
    shifts: int,
    at_edges: bool,
    tolerances: Tolerances,
) -> None:
    """Start from the neighbour's postures at poses nearby, in place.

    ``at_edges`` asks only poses with another number of postures: without those there is no edge of
    the neighbour's reach nearby.
    """
    from . import _neighbour as kernels

    if chosen.size == 0:
        return
    rest = part.rows(chosen)
    starts, there = _aside(solver, U[chosen], rest.references, shifts)
    if at_edges:
        there[there.sum(axis=2) == rest.there.sum(axis=1)[:, None]] = False
    starts, there = starts.reshape(chosen.size, -1, 6), there.reshape(chosen.size, -1)
    arrived = np.zeros_like(there)
    sigma = np.ascontiguousarray(solver.chain.sigma)
    kernels.tried(
        sigma, solver.path[-1], rest.goals, starts, there, arrived, rest.found, rest.count
    )
    still = np.zeros(there.shape)
    _walk(solver, rest, starts, there & ~arrived, still, tolerances, SPREAD)
    _ask_general(solver, U[chosen], rest, tolerances)
    part.put(chosen, rest)


def _ask_general(solver: Neighbour, U: Array, part: _Search, tolerances: Tolerances) -> None:
    """Add what the elimination finds where the postures are still odd in number, in place."""
    from . import _neighbour as kernels

    chosen = np.flatnonzero((part.count + part.double.sum(axis=1)) % 2 == 1)
    general = _general(solver.chain) if chosen.size else None
    if general is None:
        return
    rest = part.rows(chosen)
    starts, there, _ = elimination_solutions(general, U[chosen])
    starts[:, :, solver.chain.sigma == 1] /= solver.unit
    arrived = np.zeros_like(there)
    kernels.tried(
        np.ascontiguousarray(solver.chain.sigma), solver.path[-1], rest.goals, starts, there,
        arrived, rest.found, rest.count,
    )  # fmt: skip
    _walk(solver, rest, starts, np.zeros_like(there), np.zeros(there.shape), tolerances)
    part.put(chosen, rest)


def _aside(
    solver: Neighbour, U: Array, references: Array, count: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Postures of the neighbour at poses nearby ``(N, count, 8, 6)``, lengths in arm units."""
    shifts = _shifts(solver)[:count]
    aside = (U[:, None] @ shifts).reshape(-1, 4, 4)
    scale = np.where(solver.chain.sigma == 1, solver.unit, 1.0)
    q, there = _candidates(solver, aside, np.repeat(scale * references, count, axis=0))
    return q.reshape(len(U), count, 8, 6), there.reshape(len(U), count, 8)


def _walk(
    solver: Neighbour,
    part: _Search,
    starts: Array,
    there: NDArray[np.bool_],
    moved: Array,
    tolerances: Tolerances,
    spread: float = 0.0,
) -> None:
    """Search the valleys through starts and nearly singular postures, in place."""
    from . import _neighbour_valley as kernels

    limits = np.array([tolerances.position / solver.unit, tolerances.orientation])
    kernels.valleys(
        np.ascontiguousarray(solver.chain.sigma), solver.path[-1], part.goals, starts, there,
        moved, part.references, limits,
        solver.deviation, _small(solver), VALLEY, FAR,
        spread, part.found, part.count, part.double, part.free,
    )  # fmt: skip


def _shifts(solver: Neighbour) -> Array:
    """Small motions of the tool, some of which bring it into the neighbour's reach."""
    rng = np.random.default_rng(0)
    shifts = np.tile(np.eye(4), (ASIDE, 1, 1))
    for k in range(ASIDE):
        # every other one goes twice as far
        size = solver.deviation * (1.0 if k % 2 == 0 else 2.0)
        K = se3.skew(size * rng.normal(size=3))
        shifts[k, :3, :3] = np.linalg.solve(np.eye(3) - 0.5 * K, np.eye(3) + 0.5 * K)
        shifts[k, :3, 3] = size * solver.unit * rng.normal(size=3)
    return shifts


@lru_cache(maxsize=16)
def _general(chain: JointChain) -> EliminationArm | None:
    """The elimination for the arm itself, where it is well conditioned."""
    solver = prepare_elimination(chain)
    return solver if solver is not None and solver.well_conditioned else None
