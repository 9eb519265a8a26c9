"""Fewer constraints or joints than six: virtual joints make a chain of six that has a closed form.

A freed translation is a prismatic joint along its axis, one freed rotation a revolute joint, three
a spherical joint at the tool. Joints that are still missing are placed where they give a closed
form, and their values must come out as zero; where that chain is singular and the arm is not,
another extension is used. With two freed rotations the permitted orientations cannot be written as
joint motions: such poses are solved by numeric search, unless the arm turns its tool about the
constrained axis only.

Source: Section 1.2.3 of the book: fewer than six degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .. import se3
from .._arrays import Array
from ..se3.orientation import quaternions_of
from .chain import VirtualJoint, with_virtual_joints
from .check import checked
from .constraints import WHOLE, Components, constraints, mask_axes
from .loop import JointChain
from .motion import axes_of, jacobians, lever, random_postures, scaled, singular_rows, tool_poses
from .position import prepare_position
from .postures import MERGE, Postures, assembled, difference, no_postures, side_by_side
from .search import classified, prepare_many_starts
from .solver import Prepare, Solver, Tolerances, postures, prepare_alike
from .virtual_joints import Placement, loose_placements, placements, virtual_joints

KEPT = 3  # extensions kept
TESTS = 32  # random configurations of the self-test
TRIED = 12  # extensions with a closed form that are tested, best conditioned first
TRIED_LOOSE = 4  # the same of those without, which take a second each to prepare
SINGULAR = 1e-6  # singular values of the Jacobian beside the largest that count as zero
EXACT = 1e-8  # tolerances up to which every extension has the solutions near its folds
SAME = 30.0  # solutions that differ by so many tolerances are one
LOOSER = 30.0  # tolerances of the extended arm beside those of the call
ROUGH = 1e-2  # how far virtual joints may be from zero before the solution is refined

PrepareTask = Callable[[JointChain, Components], "Solver | None"]

_ONTO = (se3.rotation("y", np.pi / 2), se3.rotation("x", -np.pi / 2), np.eye(4))
"""Rotations that bring z onto x, y, z."""
_SKEW = se3.from_rpy((0.5, -1.1, 2.3))[:3, :3]


class Extension(NamedTuple):
    """Six joints, some of them virtual. Shapes: places (k,)."""

    solver: Solver
    places: NDArray[np.int64]
    placement: Placement


@dataclass(frozen=True, slots=True, eq=False)
class FewerJoints:
    """Arm of one to five joints, solved with virtual joints."""

    chain: JointChain
    ways: tuple[Extension, ...]
    length: float

    @property
    def method(self) -> str:
        """The method in words."""
        k = self.chain.k
        joints = "1 joint" if k == 1 else f"{k} joints"
        return f"{joints} and {6 - k} virtual at zero: {self.ways[0].solver.method}"


@dataclass(frozen=True, slots=True, eq=False)
class Masked:
    """Arm with the freed components as virtual joints, a chain of its own for each freed axis."""

    chain: JointChain
    components: Components
    inner: Solver
    places: NDArray[np.int64]
    prepare: Prepare
    by_position: bool = False

    @property
    def method(self) -> str:
        """The method in words."""
        return f"freed components as virtual joints: {self.inner.method}"


@dataclass(frozen=True, slots=True, eq=False)
class OneAxis:
    """Arm that turns its tool about the requested axis only: its angle gives the orientation."""

    chain: JointChain
    components: Components
    axis: Array
    inner: Solver
    search: Solver

    @property
    def method(self) -> str:
        """The method in words."""
        return f"one axis of rotation; {self.inner.method}"


def prepare_reduced(
    chain: JointChain, components: Components, prepare: PrepareTask, structured: Prepare
) -> Solver | None:
    """Prepare an arm that is not redundant for a task of fewer than six components or joints."""
    if len(components.freed_rotations) == 2:
        return _with_one_rotation(chain, components, prepare)
    if all(components.requested):
        return prepare_fewer(chain, lambda six: prepare(six, WHOLE), structured)
    if len(components.freed_rotations) == 3:
        solver = _for_position(chain, components)
        if solver is not None:
            return solver
    longer, places = with_virtual_joints(chain, _freed_joints(chain, components, _SKEW))
    inner = prepare(longer, WHOLE)
    return inner and Masked(chain, components, inner, places, lambda six: prepare(six, WHOLE))


def _for_position(chain: JointChain, components: Components) -> Solver | None:
    """Three joints for a position, among them the slides of freed translations; None for others."""
    slides = components.freed_translations
    if slides and components.in_tool_axes:
        return None
    joints = _joints(0, _world_frame(chain), slides, 1)
    longer, places = with_virtual_joints(chain, joints)
    inner = prepare_position(longer)
    if inner is None or not slides:
        return inner
    return Masked(chain, components, inner, places, prepare_position, by_position=True)


# --- masks ----------------------------------------------------------------------------------------


@postures.register
def _(solver: Masked, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    chain, components, parts = solver.chain, solver.components, []
    wanted = constraints(chain, components)
    for inner, rows in _inner_solvers(solver, U):
        if inner is None:
            continue
        goals, near = np.ascontiguousarray(U[rows]), references[rows]
        longer = np.zeros((len(rows), inner.chain.k))
        longer[:, solver.places] = near
        found = postures(inner, goals, longer, tolerances)
        # a spherical joint has two ways to one configuration, and is singular where the arm is not
        part = no_postures(len(rows), found.q.shape[1], chain.k)
        part.q[...] = found.q[..., solver.places]
        n, s = np.nonzero(found.valid)
        part.residual[n, s], part.valid[n, s] = wanted.met(goals[n], part.q[n, s], tolerances)
        part = part.merge(chain.sigma)
        parts.append((rows, classified(wanted, goals, part, near, tolerances)))
    return assembled(len(U), chain.k, parts)


@prepare_alike.register
def _(known: Masked, chain: JointChain, prepare: Prepare) -> Solver | None:
    if known.by_position:
        return _for_position(chain, known.components)
    longer, _ = with_virtual_joints(chain, _freed_joints(chain, known.components, _SKEW))
    inner = prepare_alike(known.inner, longer, known.prepare)
    return inner and replace(known, chain=chain, inner=inner)


def _inner_solvers(solver: Masked, U: Array) -> list[tuple[Solver | None, NDArray[np.int64]]]:
    """Solvers of the chains with virtual joints, and the poses of each."""
    chain, components = solver.chain, solver.components
    if not _moves_with_the_pose(components):
        return [(solver.inner, np.arange(len(U)))]
    # poses whose freed axis is the same direction of the tool share a chain
    along = np.einsum("nji,j->ni", U[:, :3, :3], chain.base[components.freed_rotations[0], :3])
    distinct, group = np.unique(along.round(12) + 0.0, axis=0, return_inverse=True)
    out = []
    for i in range(len(distinct)):
        rows = np.flatnonzero(group.reshape(-1) == i)
        joints = _freed_joints(chain, components, U[rows[0], :3, :3])
        longer = with_virtual_joints(chain, joints)[0]
        out.append((prepare_alike(solver.inner, longer, solver.prepare), rows))
    return out


def _moves_with_the_pose(components: Components) -> bool:
    """Whether the freed axis has a different direction in the tool frame at every pose."""
    if components.in_tool_axes or len(components.freed_rotations) != 1:
        return False
    axis = components.freed_rotations[0]
    # where the position across the axis is free, turning about a fixed one is as good
    return not set(range(3)) - {axis} <= set(components.freed_translations)


def _freed_joints(chain: JointChain, components: Components, R: Array) -> list[VirtualJoint]:
    """Virtual joints for the freed components of desired orientations R."""
    slides, turns, k = components.freed_translations, components.freed_rotations, chain.k
    tool, world = np.array(chain.D[k]), _world_frame(chain)
    if components.in_tool_axes or (len(turns) == 3 and len(slides) == 3):
        # the axes are those of the desired pose: behind the rotation that is freed
        return _joints(k, tool, turns, 0) + _joints(k, tool, slides, 1)
    if _moves_with_the_pose(components):
        seen = np.eye(4)
        seen[:3, :3] = R.T @ world[:3, :3]
        return _joints(0, world, slides, 1) + _joints(k, tool @ seen, turns, 0)
    if len(turns) == 1:
        return _joints(0, world, slides, 1) + _joints(0, world, turns, 0)
    return _joints(0, world, slides, 1) + _joints(k, tool, turns, 0)


def _world_frame(chain: JointChain) -> Array:
    """The axes of the world at the origin of R_0."""
    world = np.eye(4)
    world[:3, :3] = chain.base[:3, :3].T
    return world


def _joints(gap: int, frame: Array, axes: tuple[int, ...], sigma: int) -> list[VirtualJoint]:
    """Virtual joints along axes of a frame; three revolute joints turn about z, x and y."""
    order = (2, 0, 1) if sigma == 0 and len(axes) == 3 else axes
    return [VirtualJoint(gap, frame @ _ONTO[axis], sigma) for axis in order]


# --- one rotation ---------------------------------------------------------------------------------


def _with_one_rotation(
    chain: JointChain, components: Components, prepare: PrepareTask
) -> Solver | None:
    """Prepare for a mask that frees two rotations."""
    search = prepare_many_starts(constraints(chain, components))
    # with all joints at zero: axes of parallel joints do not move
    zero = np.zeros((1, chain.k))
    axes, R = axes_of(chain, zero)[0][chain.sigma == 0, 0], tool_poses(chain, zero)[0]
    index = int(np.flatnonzero(components.requested[3:])[0])
    requested = R[:3, index] if components.in_tool_axes else chain.base[index, :3]
    slides = set(components.freed_translations)
    if (
        not len(axes)
        or np.linalg.norm(np.cross(axes, requested), axis=1).max() > 1e-9
        or (components.in_tool_axes and not slides <= {index})
    ):
        return search
    whole = Components((*components.requested[:3], True, True, True), components.in_tool_axes)
    inner = prepare(chain, whole)
    return search if inner is None else OneAxis(chain, components, requested, inner, search)


@postures.register
def _(solver: OneAxis, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    chain, a, aligned = solver.chain, solver.axis, is_aligned(solver, U)
    R = tool_poses(chain, np.zeros((1, chain.k)))[0, :3, :3]
    # the rotation about the axis that leaves no component of the error along it
    Q = quaternions_of(U[:, :3, :3] @ R.T)
    angle = 2.0 * np.arctan2(Q[:, 1:] @ a, Q[:, 0])
    goals = U.copy()
    goals[:, :3, :3] = Rotation.from_rotvec(angle[:, None] * a).as_matrix() @ R
    parts = []
    for inner, rows, poses in (
        (solver.inner, np.flatnonzero(aligned), goals),
        (solver.search, np.flatnonzero(~aligned), U),
    ):
        if rows.size:
            there = np.ascontiguousarray(poses[rows])
            parts.append((rows, postures(inner, there, references[rows], tolerances)))
    return assembled(len(U), chain.k, parts)


def is_aligned(solver: OneAxis, U: Array) -> NDArray[np.bool_]:
    """Whether the requested axis of poses is that of the arm, (N,)."""
    index = int(np.flatnonzero(solver.components.requested[3:])[0])
    requested = mask_axes(solver.chain, U, solver.components)[:, :, index]
    return np.linalg.norm(np.cross(requested, solver.axis), axis=1) <= 1e-9


# --- fewer joints ---------------------------------------------------------------------------------


def prepare_fewer(chain: JointChain, prepare: Prepare, structured: Prepare) -> FewerJoints | None:
    """Find extensions of an arm of one to five joints that serve it, and test them."""
    if not 1 <= chain.k <= 5:
        return None
    q = random_postures(chain, TESTS, np.random.default_rng(0))
    ways = _chosen(chain, q, list(placements(chain.k)), TRIED, structured)
    if not ways:
        ways = _chosen(chain, q, list(loose_placements(chain.k)), TRIED_LOOSE, prepare)
    return FewerJoints(chain, tuple(ways), lever(chain)) if ways else None


@postures.register
def _(solver: FewerJoints, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    chain, N = solver.chain, len(U)
    gathered = [no_postures(N, 0, chain.k)]
    unsure = np.ones(N, np.bool_)
    for way in solver.ways:
        rows = np.flatnonzero(unsure)
        if rows.size == 0:
            break
        part, doubtful = _of_extension(solver, way, U[rows], references[rows], tolerances)
        gathered.append(assembled(N, chain.k, [(rows, part)]))
        # an error beyond rounding may miss a fold of this extension and not of others
        unsure[rows] = doubtful | (max(tolerances) > EXACT)
    candidates = side_by_side(gathered)
    q, there = candidates.q, candidates.valid
    found = checked(chain, U, q, there, tolerances, rough=_rough(tolerances))
    if SAME * max(tolerances) > MERGE:
        # a pose that is met only nearly is met nearly as well beside: the best is kept
        order = np.argsort(found.residual, axis=1)
        found = found.take((np.arange(N)[:, None], order))
        found = found.merge(chain.sigma, SAME * max(tolerances))
    return found


@prepare_alike.register
def _(known: FewerJoints, chain: JointChain, prepare: Prepare) -> Solver | None:
    ways = []
    for way in known.ways:
        joints = virtual_joints(chain, known.length, way.placement)
        if joints is not None:
            longer, places = with_virtual_joints(chain, joints)
            solver = prepare_alike(way.solver, longer, prepare)
            if solver is not None:
                ways.append(Extension(solver, places, way.placement))
    return FewerJoints(chain, tuple(ways), known.length) if ways else prepare(chain)


def _rough(tolerances: Tolerances) -> float:
    """Largest error of candidates: near a fold the square root of the error of the pose."""
    return max(ROUGH, 10.0 * float(np.sqrt(max(tolerances))))


def _of_extension(
    solver: FewerJoints, way: Extension, U: Array, references: Array, tolerances: Tolerances
) -> tuple[Postures, NDArray[np.bool_]]:
    """Solutions of an extension with virtual joints near zero; where it is singular or has none."""
    six = np.zeros((len(U), 6))
    six[:, way.places] = references
    wide = Tolerances(LOOSER * tolerances.position, LOOSER * tolerances.orientation)
    found = postures(way.solver, U, six, wide)
    virtual = np.setdiff1d(np.arange(6), way.places)
    near = np.abs(np.where(found.valid[..., None], found.q[..., virtual], 0.0)).max(axis=-1)
    kept = found.valid & (near <= _rough(tolerances) * max(1.0, solver.length))
    part = no_postures(len(U), found.q.shape[1], way.places.size)
    part.q[...], part.valid[...] = found.q[..., way.places], kept
    n, s = np.nonzero(found.valid)
    J = scaled(jacobians(way.solver.chain, found.q[n, s]), solver.length)
    unsure = ~kept.any(axis=1)
    unsure[n[singular_rows(J, SINGULAR)[0]]] = True
    return part, unsure


def _chosen(
    chain: JointChain, q: Array, candidates: list[Placement], tried: int, prepare: Prepare
) -> list[Extension]:
    """The best conditioned extensions that give back the configurations of a self-test."""
    length, ranked = lever(chain), []
    for placement in candidates:
        joints = virtual_joints(chain, length, placement)
        if joints is None:
            continue
        longer, places = with_virtual_joints(chain, joints)
        six = np.zeros((len(q), 6))
        six[:, places] = q
        sizes = np.linalg.svd(scaled(jacobians(longer, six), length), compute_uv=False)
        worth = float(np.mean(np.log10(sizes[:, -1] / sizes[:, 0] + 1e-16)))
        if worth > -6.0:
            ranked.append((worth, placement, longer, places))
    ranked.sort(key=lambda row: -row[0])
    # the best of every kind first: others like it are singular in much the same configurations
    kinds: dict[tuple[int, ...], int] = {}
    for number, row in enumerate(ranked):
        kinds.setdefault(row[1][:4], number)
    leaders = set(kinds.values())
    order = sorted(range(len(ranked)), key=lambda i: (i not in leaders, i))
    U, ways = tool_poses(chain, q), []
    for _, placement, longer, places in (ranked[i] for i in order):
        if tried == 0 or len(ways) == KEPT:
            break
        solver = prepare(longer)
        if solver is None:
            continue
        tried -= 1
        way = Extension(solver, places, placement)
        if _gives_back(FewerJoints(chain, (way,), length), U, q):
            ways.append(way)
    return ways


def _gives_back(solver: FewerJoints, U: Array, q: Array) -> bool:
    """Whether the configurations are among the solutions of their poses."""
    found = postures(solver, U, np.zeros_like(q), Tolerances())
    gap = np.abs(difference(solver.chain.sigma, found.q, q[:, None])).max(axis=-1)
    return bool(np.all(np.where(found.valid, gap, np.inf).min(axis=1, initial=np.inf) < 1e-6))
