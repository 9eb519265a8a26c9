"""Arms of one to five joints: virtual joints make six of them, and stay at zero.

A pose asks for six components, so that an arm of fewer joints meets only some poses, and those
with few postures. The extended arm meets all of them; its postures whose virtual joints are at
zero are the arm's. Where the extended arm is singular and the arm is not, another extension is
asked, whose singular postures are different ones.

Source: Section 1.2.3 of the book: fewer than six degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .alike import prepare_alike
from .check import checked
from .dependent import DependentJoints, prepare_dependent
from .extensions import Layout, Triple, layout_like, layouts, loose_layouts
from .gather import MERGE, merged, rows_of
from .loop import JointChain
from .motion import jacobians, lever, random_postures, scaled, singular_rows, tool_poses
from .solver import Found, Prepare, Solver, Tolerances, nothing_found, postures
from .structure import plan_loop
from .virtual import with_virtual_joints

WAYS = 3  # extensions kept
TESTS = 32  # random postures of the self-test
TRIED = 12  # extensions with a closed form that are tested, best conditioned first
TRIED_LOOSE = 4  # the same of those without, which take a second each to prepare
SINGULAR = 1e-6  # singular values of the Jacobian beside the largest that count as zero
EXACT = 1e-8  # tolerances up to which every extension has the postures near its folds
SAME = 30.0  # postures that differ by so many tolerances are one
LOOSER = 30.0  # tolerances of the extended arm beside those of the call
ROUGH = 1e-2  # how far virtual joints may be from zero before the posture is improved


class Extension(NamedTuple):
    """Six joints, some of them virtual. Shapes: places (k,)."""

    solver: Solver
    places: NDArray[np.int64]
    layout: Layout


@dataclass(frozen=True, slots=True, eq=False)
class FewerJoints:
    """Arm of one to five joints, solved with virtual joints."""

    chain: JointChain
    ways: tuple[Extension, ...]
    length: float

    @property
    def method(self) -> str:
        """The family in words."""
        count = 6 - self.chain.k
        return f"{_joints(self.chain.k)} and {count} virtual at zero: {self.ways[0].solver.method}"


def prepare_fewer(chain: JointChain, prepare: Prepare) -> FewerJoints | DependentJoints | None:
    """Find extensions of an arm of one to five joints that serve it, and test them."""
    if not 1 <= chain.k <= 5:
        return None
    length = lever(chain)
    dependent = prepare_dependent(chain, lambda rest: prepare_fewer(rest, prepare))
    if dependent is not None:
        return dependent
    q = random_postures(chain, TESTS, np.random.default_rng(0))
    ways = _chosen(chain, length, q, list(layouts(chain, length)), TRIED, prepare)
    # three prismatic joints leave the orientation to the others, which is simpler than two do
    slides = int(chain.sigma.sum())
    for sigma in (1, 0) if slides == 2 else (0, 1):
        if not ways:
            loose = list(loose_layouts(chain, length, sigma))
            ways = _chosen(chain, length, q, loose, TRIED_LOOSE, prepare)
    return FewerJoints(chain, tuple(ways), length) if ways else None


@postures.register
def _(solver: FewerJoints, U: Array, references: Array, tolerances: Tolerances) -> Found:
    chain, N = solver.chain, len(U)
    gathered = nothing_found(N, 0, chain.k)
    doubt = np.ones(N, np.bool_)
    for way in solver.ways:
        asked = np.flatnonzero(doubt)
        if asked.size == 0:
            break
        part, unsure = _one_way(solver, way, U[asked], references[asked], tolerances)
        gathered = _joined(gathered, asked, part)
        # what is off by more than rounding may miss a fold of this extension and not of others
        doubt[asked] = unsure | (max(tolerances) > EXACT)
    found = checked(
        chain, U, gathered.q, gathered.valid, tolerances, double=np.zeros_like(gathered.valid),
        rough=_rough(tolerances),
    )  # fmt: skip
    return _judged(solver, U, _apart(chain, found, tolerances))


@prepare_alike.register
def _(known: FewerJoints, chain: JointChain, prepare: Prepare) -> Solver | None:
    ways = []
    for way in known.ways:
        layout = layout_like(chain, known.length, way.layout)
        if layout is not None:
            longer, places = with_virtual_joints(chain, layout.joints)
            solver = prepare_alike(way.solver, longer, prepare)
            if solver is not None:
                ways.append(Extension(solver, places, layout))
    if ways:
        return FewerJoints(chain, tuple(ways), known.length)
    return prepare_fewer(chain, prepare)


# --- solving --------------------------------------------------------------------------------------


def _rough(tolerances: Tolerances) -> float:
    """How far candidates may be off: near a fold the square root of what a pose is off by."""
    return max(ROUGH, 10.0 * float(np.sqrt(max(tolerances))))


def _one_way(
    solver: FewerJoints, way: Extension, U: Array, references: Array, tolerances: Tolerances
) -> tuple[Found, NDArray[np.bool_]]:
    """Postures of one extension with the virtual joints near zero; where doubts remain."""
    six = np.zeros((len(U), 6))
    six[:, way.places] = references
    wide = Tolerances(LOOSER * tolerances.position, LOOSER * tolerances.orientation)
    found = postures(way.solver, U, six, wide)
    virtual = np.setdiff1d(np.arange(6), way.places)
    near = np.abs(np.where(found.valid[..., None], found.q[..., virtual], 0.0)).max(axis=-1)
    # a length of the arm is one, a turn is another
    limit = _rough(tolerances) * max(1.0, solver.length)
    kept = found.valid & (near <= limit)
    part = Found(
        found.q[..., way.places], kept, found.residual, found.double,
        found.free[..., way.places] & kept[..., None], found.family,
    )  # fmt: skip
    singular = found.valid & (found.family | found.double | found.free.any(axis=-1))
    return part, ~kept.any(axis=1) | singular.any(axis=1)


def _joined(gathered: Found, rows: NDArray[np.int64], part: Found) -> Found:
    """Rows of some poses added behind those there are."""
    S = gathered.q.shape[1]
    out = nothing_found(len(gathered.q), S + part.q.shape[1], gathered.q.shape[2])
    out.q[:, :S], out.valid[:, :S], out.free[:, :S] = gathered.q, gathered.valid, gathered.free
    out.q[rows, S:], out.valid[rows, S:], out.free[rows, S:] = part.q, part.valid, part.free
    return out


def _apart(chain: JointChain, found: Found, tolerances: Tolerances) -> Found:
    """The best of postures that are one as far as the tolerances can tell.

    A pose that is met only nearly is met nearly as well a little aside.
    """
    within = SAME * max(tolerances)
    if within <= MERGE:
        return found
    order = np.argsort(found.residual, axis=1)
    best = rows_of(found, (np.arange(len(found.q))[:, None], order))
    return merged(chain.sigma, best, within)


def _judged(solver: FewerJoints, U: Array, found: Found) -> Found:
    """Mark double roots and infinite families."""
    n, s = np.nonzero(found.valid)
    J = scaled(jacobians(solver.chain, found.q[n, s]), solver.length)
    singular, null = singular_rows(J, SINGULAR)
    if singular.size == 0:
        return found
    n, s = n[singular], s[singular]
    moves = _moves(solver.chain, U[n], found.q[n, s], null)
    found.family[n, s], found.double[n, s] = moves, ~moves
    return found


def _moves(chain: JointChain, U: Array, q: Array, direction: Array) -> NDArray[np.bool_]:
    """Whether the arm can go on along a null direction without the tool moving."""
    step = 1e-3
    away = (q + step * direction)[:, None]
    there = np.ones((len(q), 1), np.bool_)
    # a fold leaves the second-order part of the step, 1e-6 of the arm's length, a family nothing
    reached = checked(chain, U, away, there, Tolerances(1e-10, 1e-10))
    gone = np.abs(reached.q[:, 0] - q).max(axis=1)
    return reached.valid[:, 0] & (gone > 0.1 * step)


# --- preparing ------------------------------------------------------------------------------------


def _joints(k: int) -> str:
    return "1 joint" if k == 1 else f"{k} joints"


def _chosen(
    chain: JointChain, length: float, q: Array, candidates: list[Layout], tried: int,
    prepare: Prepare,
) -> list[Extension]:  # fmt: skip
    """The best conditioned extensions that give back the postures of a self-test."""
    ranked = []
    for layout in candidates:
        longer, places = with_virtual_joints(chain, layout.joints)
        six = np.zeros((len(q), 6))
        six[:, places] = q
        values = np.linalg.svd(scaled(jacobians(longer, six), length), compute_uv=False)
        worth = float(np.mean(np.log10(values[:, -1] / values[:, 0] + 1e-16)))
        if worth > -6.0:
            ranked.append((worth, layout, longer, places))
    ranked.sort(key=lambda row: -row[0])
    # the best of every kind first: others like it are singular in much the same postures
    first: dict[tuple[Triple, int, int, int], int] = {}
    for place, row in enumerate(ranked):
        first.setdefault(row[1][:4], place)
    leaders = set(first.values())
    ranked = [row for i, row in enumerate(ranked) if i in leaders] + [
        row for i, row in enumerate(ranked) if i not in leaders
    ]
    U = tool_poses(chain, q)
    ways: list[Extension] = []
    for _, layout, longer, places in ranked:
        if tried == 0 or len(ways) == WAYS:
            break
        if layout.triple is not Triple.ANY and plan_loop(longer) is None:
            continue
        tried -= 1
        solver = prepare(longer)
        if solver is None:
            continue
        way = Extension(solver, places, layout)
        if _gives_back(FewerJoints(chain, (way,), length), U, q):
            ways.append(way)
    return ways


def _gives_back(solver: FewerJoints, U: Array, q: Array) -> bool:
    """Whether the postures are among those found for their poses."""
    found = postures(solver, U, np.zeros_like(q), Tolerances())
    gap = found.q - q[:, None]
    turning = solver.chain.sigma == 0
    gap = np.where(turning, gap - 2 * np.pi * np.round(gap / (2 * np.pi)), gap)
    nearest = np.where(found.valid, np.abs(gap).max(axis=-1), np.inf).min(axis=1, initial=np.inf)
    return bool(np.all(nearest < 1e-6))
