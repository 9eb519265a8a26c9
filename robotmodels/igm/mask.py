"""Tasks of fewer than six components: what a mask frees becomes virtual joints.

A freed translation is a prismatic joint along its axis, one freed rotation a revolute joint, three
a spherical joint at the tool; behind the arm they make a chain that has to meet the whole pose.
Two freed rotations leave the rotation vectors of a plane, which no joints produce: see `swing`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array
from .alike import prepare_alike
from .components import Components, asked_jacobians, missing_components
from .dependent import DependentJoints, prepare_dependent
from .fewer import prepare_fewer
from .gather import assembled, merged, rows_of
from .loop import JointChain
from .motion import lever, singular_rows, tool_poses
from .position import POSITION, prepare_position
from .self_motion import settle_families
from .solver import Found, Prepare, Solver, Tolerances, nothing_found, postures
from .swing import judged, prepare_swing
from .virtual import VirtualJoint, with_virtual_joints

SINGULAR = 1e-6  # singular values of the Jacobian beside the largest that count as zero

_ONTO = (se3.rotation("y", np.pi / 2), se3.rotation("x", -np.pi / 2), np.eye(4))
"""Rotations that bring z onto x, y, z."""


@dataclass(frozen=True, slots=True, eq=False)
class MaskedArm:
    """An arm with the freed components as virtual joints, one chain for all poses."""

    chain: JointChain
    components: Components
    inner: Solver
    places: NDArray[np.int64]
    length: float

    @property
    def method(self) -> str:
        """The family in words."""
        return f"freed components as virtual joints: {self.inner.method}"


@dataclass(frozen=True, slots=True, eq=False)
class MaskedByPose:
    """An arm whose virtual joint for a rotation about a world axis differs from pose to pose."""

    chain: JointChain
    components: Components
    first: Solver
    places: NDArray[np.int64]
    prepare: Prepare
    length: float

    @property
    def method(self) -> str:
        """The family in words."""
        return f"freed components as virtual joints: {self.first.method}"


_SKEW = se3.from_rpy((0.5, -1.1, 2.3))[:3, :3]


def prepare_masked(
    chain: JointChain, mask: tuple[bool, ...], in_tool_axes: bool, prepare: Prepare
) -> Solver | None:
    """Prepare an arm for tasks that leave components of the pose free."""
    components = Components(tuple(bool(asked) for asked in mask), in_tool_axes)
    if all(components.asked):
        return _prepared(chain, prepare)
    if components.asked == POSITION:
        solver = prepare_position(chain)
        if solver is not None:
            return solver
    if len(components.freed_rotations) == 2:
        places_only = (*components.asked[:3], False, False, False)
        return prepare_swing(
            chain,
            components,
            lambda part: prepare_masked(part, places_only, in_tool_axes, prepare),
        )
    if _moves_with_the_pose(components):
        # an orientation that has nothing special about it
        longer, places = with_virtual_joints(chain, _turned_joints(chain, components, _SKEW))
        first = _prepared(longer, prepare)
        return first and MaskedByPose(chain, components, first, places, prepare, lever(chain))
    longer, places = with_virtual_joints(chain, _fixed_joints(chain, components))
    inner = _prepared(longer, prepare)
    return inner and MaskedArm(chain, components, inner, places, lever(chain))


@prepare_alike.register
def _(known: MaskedArm, chain: JointChain, prepare: Prepare) -> Solver | None:
    joints = _fixed_joints(chain, known.components)
    inner = prepare_alike(known.inner, with_virtual_joints(chain, joints)[0], prepare)
    return inner and replace(known, chain=chain, inner=inner)


@postures.register
def _(solver: MaskedArm, U: Array, references: Array, tolerances: Tolerances) -> Found:
    longer = np.zeros((len(U), solver.inner.chain.k))
    longer[:, solver.places] = references
    found = postures(solver.inner, U, longer, tolerances)
    redundant = _is_redundant(solver.inner)
    return _of_the_arm(solver, U, references, tolerances, found, solver.places, redundant)


@postures.register
def _(solver: MaskedByPose, U: Array, references: Array, tolerances: Tolerances) -> Found:
    chain, components = solver.chain, solver.components
    # poses whose freed axis is the same direction of the tool share a chain
    axis = components.freed_rotations[0]
    along = np.einsum("nji,j->ni", U[:, :3, :3], chain.base[axis, :3])
    sameness, group = np.unique(along.round(12) + 0.0, axis=0, return_inverse=True)
    parts = []
    for i in range(len(sameness)):
        rows = np.flatnonzero(group.reshape(-1) == i)
        joints = _turned_joints(chain, components, U[rows[0], :3, :3])
        inner = _prepared_alike(solver, with_virtual_joints(chain, joints)[0])
        if inner is None:
            continue
        goals, wanted = np.ascontiguousarray(U[rows]), references[rows]
        longer = np.zeros((len(rows), inner.chain.k))
        longer[:, solver.places] = wanted
        found = postures(inner, goals, longer, tolerances)
        redundant = _is_redundant(inner)
        part = _of_the_arm(solver, goals, wanted, tolerances, found, solver.places, redundant)
        parts.append((rows, part))
    return assembled(len(U), chain.k, parts)


# --- the chains -----------------------------------------------------------------------------------


def _prepared(chain: JointChain, prepare: Prepare) -> Solver | None:
    """The family of a chain; real joints that others make superfluous are held before."""
    if chain.k <= 6:
        dependent = prepare_dependent(chain, lambda rest: _prepared(rest, prepare))
        if dependent is not None:
            return dependent
    return prepare_fewer(chain, prepare) if chain.k < 6 else prepare(chain)


def _prepared_alike(solver: MaskedByPose, chain: JointChain) -> Solver | None:
    """The chain of another pose, where it is like the first; some have superfluous joints."""
    if chain.k <= 6:
        prepare = solver.prepare
        dependent = prepare_dependent(chain, lambda rest: _prepared(rest, prepare))
        if dependent is not None:
            return dependent
        if isinstance(solver.first, DependentJoints):
            return _prepared(chain, prepare)
    return prepare_alike(solver.first, chain, solver.prepare)


def _moves_with_the_pose(components: Components) -> bool:
    """Whether the freed axes, seen from the tool, are others in every pose."""
    if components.in_tool_axes or len(components.freed_rotations) != 1:
        return False
    axis = components.freed_rotations[0]
    # where the position across the axis is free, turning about a fixed one is as good
    return not set(range(3)) - {axis} <= set(components.freed_translations)


def _slides(gap: int, seen_from: Array, axes: tuple[int, ...]) -> list[VirtualJoint]:
    """Prismatic joints along axes of a frame."""
    return [VirtualJoint(gap, seen_from @ _ONTO[axis], 1) for axis in axes]


def _turns(gap: int, seen_from: Array, axes: tuple[int, ...]) -> list[VirtualJoint]:
    """Revolute joints about axes of a frame; three with the outer ones square to each other."""
    order = axes if len(axes) < 3 else (2, 0, 1)
    return [VirtualJoint(gap, seen_from @ _ONTO[axis], 0) for axis in order]


def _fixed_joints(chain: JointChain, components: Components) -> list[VirtualJoint]:
    """Virtual joints that stand for the freed components in every pose."""
    slides, turns, k = components.freed_translations, components.freed_rotations, chain.k
    tool, world = np.asarray(chain.D[k]), _world(chain)
    if components.in_tool_axes:
        # the axes are those of the desired pose: behind the rotation that is freed
        return _turns(k, tool, turns) + _slides(k, tool, slides)
    if len(turns) == 1:
        return _slides(0, world, slides) + _turns(0, world, turns)
    if len(slides) == 3:
        return _turns(k, tool, turns) + _slides(k, tool, slides)
    return _slides(0, world, slides) + _turns(k, tool, turns)


def _turned_joints(chain: JointChain, components: Components, R: Array) -> list[VirtualJoint]:
    """The same where a world axis of rotation is another of the tool for orientations R."""
    seen = np.eye(4)
    seen[:3, :3] = R.T @ _world(chain)[:3, :3]
    slides = _slides(0, _world(chain), components.freed_translations)
    return slides + _turns(chain.k, chain.D[chain.k] @ seen, components.freed_rotations)


def _world(chain: JointChain) -> Array:
    """The world's axes in R_0."""
    world = np.eye(4)
    world[:3, :3] = chain.base[:3, :3].T
    return world


def _task_chain(chain: JointChain, components: Components, R: Array) -> JointChain:
    """The arm with all virtual joints behind it, for desired poses of orientation R."""
    seen = np.eye(4)
    if not components.in_tool_axes:
        seen[:3, :3] = R.T @ _world(chain)[:3, :3]
    k = chain.k
    frame = chain.D[k] @ seen
    tool = np.asarray(chain.D[k])
    turns = components.freed_rotations
    # three rotations are a spherical joint in any axes
    joints = _turns(k, tool if len(turns) == 3 else frame, turns)
    return with_virtual_joints(chain, joints + _slides(k, frame, components.freed_translations))[0]


# --- back to the arm ------------------------------------------------------------------------------


def _of_the_arm(
    solver: MaskedArm | MaskedByPose,
    U: Array,
    references: Array,
    tolerances: Tolerances,
    found: Found,
    places: NDArray[np.int64],
    redundant: bool,
) -> Found:
    """Postures of the arm from those of the longer chain, judged by what is asked."""
    chain, components = solver.chain, solver.components
    # a spherical joint has two ways to one posture, and is singular where the arm is not
    arm = merged(
        chain.sigma,
        judged(
            replace(found, q=found.q[..., places], free=found.free[..., places],
                    moving=found.moving[..., places]),
            chain, U, components, tolerances,
        ),
    )  # fmt: skip
    n, s = np.nonzero(arm.valid)
    J = asked_jacobians(chain, U[n], arm.q[n, s], components)
    if J.shape[1] < chain.k or redundant:
        return arm
    arm.family[...], arm.free[...] = False, False
    if n.size == 0:
        return arm
    J[:, : 3 - len(components.freed_translations)] /= solver.length
    flat, _ = singular_rows(J, SINGULAR)
    if flat.size == 0:
        return arm
    singular = np.zeros(n.size, np.bool_)
    singular[flat] = True
    regular = np.setdiff1d(np.arange(len(U)), n[singular])
    parts = [(regular, rows_of(arm, regular))]
    for pose in np.unique(n[singular]):
        marked = np.zeros(arm.valid.shape[1], np.bool_)
        marked[s[singular & (n == pose)]] = True
        rows = np.array([pose])
        part = _settled(solver, U[rows], references[rows], tolerances, rows_of(arm, rows), marked)
        parts.append((rows, part))
    return assembled(len(U), chain.k, parts)


def _is_redundant(inner: Solver) -> bool:
    """Whether its postures belong to infinite families at every pose."""
    return isinstance(inner, DependentJoints) or inner.chain.k > 6


def _settled(
    solver: MaskedArm | MaskedByPose,
    U: Array,
    references: Array,
    tolerances: Tolerances,
    arm: Found,
    marked: NDArray[np.bool_],
) -> Found:
    """One pose with singular postures: double roots, or members of a family at the reference."""
    chain, components = solver.chain, solver.components
    longer = _task_chain(chain, components, U[0, :3, :3])
    rows = np.flatnonzero(arm.valid[0])
    q = np.full((1, len(rows), longer.k), np.nan)
    q[0, :, : chain.k] = arm.q[0, rows]
    q[0, :, chain.k :] = _virtual_values(
        chain, np.broadcast_to(U, (len(rows), 4, 4)), arm.q[0, rows], components, longer
    )
    whole = nothing_found(1, len(rows), longer.k)
    whole.q[...], whole.valid[...], whole.residual[...] = q, True, arm.residual[:, rows]
    whole.family[...] = marked[rows]
    wanted = np.zeros((1, longer.k))
    wanted[:, : chain.k] = references
    settled = settle_families(longer, U, whole, wanted, tolerances)
    real = slice(0, chain.k)
    moves = settled.moving[..., real].any(axis=-1) & settled.valid
    out = Found(
        settled.q[..., real], settled.valid, settled.residual, settled.double & ~moves,
        settled.free[..., real] & moves[..., None], moves,
    )  # fmt: skip
    out = merged(chain.sigma, judged(out, chain, U, components, tolerances))
    # what is singular and cannot move is where postures fall together
    for s in np.flatnonzero(out.valid[0] & ~out.family[0]):
        near = np.abs(arm.q[0] - out.q[0, s]).max(axis=-1) < 1e-5
        out.double[0, s] |= bool(np.any(near & marked))
    return out


def _virtual_values(
    chain: JointChain, U: Array, q: Array, components: Components, longer: JointChain
) -> Array:
    """Values of the virtual joints of `_task_chain` at postures, shape (S, longer.k - k)."""
    translation, rotation = missing_components(chain, U, q, components)
    turns = components.freed_rotations
    if len(turns) == 3:
        P = tool_poses(chain, q)
        R = np.swapaxes(P[:, :3, :3], 1, 2) @ U[:, :3, :3]
        # Rz(a) Rx(b) Ry(c)
        angles = np.stack(
            [
                np.arctan2(-R[:, 0, 1], R[:, 1, 1]),
                np.arctan2(R[:, 2, 1], np.hypot(R[:, 0, 1], R[:, 1, 1])),
                np.arctan2(-R[:, 2, 0], R[:, 2, 2]),
            ],
            axis=1,
        )
    else:
        angles = rotation[:, list(turns)]
    return np.concatenate([angles, translation[:, list(components.freed_translations)]], axis=1)
