"""Redundant arms: a joint at its reference, or at the nearest value at which a pose is reached.

The first joint whose motion the others can always undo takes its reference; the others are solved
as an arm of their own, which may be redundant again. Where the pose is not reached with that
value, configurations of the whole arm found by Newton's method move along their self-motions until
the joint is as near to its reference as it gets. A nearer value may exist.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from .._arrays import Array
from .chain import locked_chain, without_end
from .constraints import PATH, WHOLE, Components, constraints, mask_axes
from .loop import JointChain
from .motion import jacobians, random_postures, scaled, tool_poses
from .postures import Postures, assembled, difference, side_by_side
from .search import collected, nearest_value, refined
from .solver import Prepare, Solver, Tolerances, postures, prepare_alike

DEPENDENT = 1e-9  # singular values beside the largest that count as zero at any configuration
SHARE = 1e-6  # part of a joint in a null direction that counts
STARTS = 64  # random starts for a pose that the reference does not reach
MEMBERS = 16  # configurations of a pose that move to the nearest value
CHUNK = 32  # poses searched at a time
MEMORY = 128  # chains with a value of the joint that are kept
FOLD = 1e-3  # solutions closer than this at a turning point are one
SAME = 1e-7  # values of the joint closer than this are one [rad, m]


@dataclass(frozen=True, slots=True, eq=False)
class Redundant:
    """Arm with a joint whose motion the others can always undo."""

    chain: JointChain
    components: Components
    joint: int
    inner: Solver
    prepare: Prepare
    _known: dict[float | None, Solver | None] = field(default_factory=dict)

    @property
    def method(self) -> str:
        """The method in words."""
        number = self.chain.columns[self.joint] + 1
        return f"joint {number} at its reference; {self.inner.method}"


def redundant_joint(chain: JointChain, components: Components) -> int | None:
    """First joint whose column of the Jacobian depends on the others everywhere, or None."""
    q = random_postures(chain, 16, np.random.default_rng(3))
    wanted = constraints(chain, components)
    U = tool_poses(chain, q)
    if len(components.freed_rotations) == 2:
        # they leave an orientation error: pair each configuration with another pose
        J = wanted.jacobians(U[::-1], q)
    else:  # rows of the Jacobian: a first call has no search to compile
        axes = np.swapaxes(mask_axes(chain, U, components), 1, 2)
        J = scaled(jacobians(chain, q), wanted.length)
        J = np.concatenate([axes @ J[:, :3], axes @ J[:, 3:]], axis=1)
        J = J[:, np.array(components.requested)]
    _, sizes, rows = np.linalg.svd(J)
    padded = np.zeros((len(q), chain.k))
    padded[:, : sizes.shape[1]] = sizes
    null = padded <= DEPENDENT * np.maximum(padded[:, :1], 1e-3)
    # a null space that is larger at some configurations only is a singularity
    least = int(null.sum(axis=1).min())
    if least == 0:
        return None
    usual = null.sum(axis=1) == least
    part = np.sqrt(np.sum(np.where(null[usual][..., None], rows[usual], 0.0) ** 2, axis=1))
    moves = (part.max(axis=0) > SHARE) & (chain.columns >= 0)
    return int(np.argmax(moves)) if moves.any() else None


def prepare_redundant(
    chain: JointChain, components: Components, joint: int, prepare: Prepare
) -> Redundant | None:
    """Prepare the arm without a joint, which takes its reference."""
    rest, value = _typical_rest(chain, components, joint)
    inner = prepare(rest)
    if inner is None:
        return None
    return Redundant(chain, components, joint, inner, prepare, {value: inner})


def _typical_rest(
    chain: JointChain, components: Components, joint: int
) -> tuple[JointChain, float | None]:
    """The chain with the joint locked, and that value (None: valid for all values)."""
    if _at_an_end(chain, components, joint):
        return without_end(chain, joint, np.zeros(1), np.eye(4)[None])[0], None
    # 0.5, because axes are often aligned at 0
    return locked_chain(chain, {joint: 0.5}), 0.5


def _at_an_end(chain: JointChain, components: Components, joint: int) -> bool:
    """Whether a joint moves the poses and nothing else: one chain for all its values."""
    return joint in (0, chain.k - 1) and components == WHOLE


@prepare_alike.register
def _(known: Redundant, chain: JointChain, prepare: Prepare) -> Solver | None:
    rest, value = _typical_rest(chain, known.components, known.joint)
    inner = prepare_alike(known.inner, rest, known.prepare)
    return inner and replace(known, chain=chain, inner=inner, _known={value: inner})


@postures.register
def _(solver: Redundant, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    return _solutions(solver, U, references, tolerances, searched=True)


def _solutions(
    solver: Redundant, U: Array, references: Array, tolerances: Tolerances, searched: bool
) -> Postures:
    """Solutions with the joints at their references, else at the nearest values if searched."""
    found = at_values(solver, references[:, solver.joint], U, references, tolerances, searched)
    parts = [(np.arange(len(U)), found)]
    if searched:
        empty = np.flatnonzero(~found.valid.any(axis=1) & ~_too_far(solver, U))
        for start in range(0, empty.size, CHUNK):
            rows = empty[start : start + CHUNK]
            parts.append((rows, _nearest(solver, U[rows], references[rows], tolerances)))
        found = assembled(len(U), solver.chain.k, parts)
    found.free[..., free_joints(solver)] |= found.valid[..., None]
    found.family[...] = found.valid
    return found


def free_joints(solver: Redundant) -> list[int]:
    """The joints that take a reference, as places in the chain."""
    if not isinstance(solver.inner, Redundant):
        return [solver.joint]
    return [solver.joint, *(j + (j >= solver.joint) for j in free_joints(solver.inner))]


def _too_far(solver: Redundant, U: Array) -> np.ndarray:
    """Whether positions are farther away than the arm is long."""
    chain = solver.chain
    if chain.sigma.any() or not all(solver.components.requested[:3]):
        return np.zeros(len(U), np.bool_)
    reach = np.linalg.norm(chain.D[1:, :3, 3], axis=1).sum()
    return np.linalg.norm(U[:, :3, 3] - chain.D[0, :3, 3], axis=1) > 1.001 * reach


def at_values(
    solver: Redundant,
    values: Array,
    U: Array,
    references: Array,
    tolerances: Tolerances,
    searched: bool = True,
) -> Postures:
    """Solutions with the joint at a value for each pose, (N,)."""
    chain, joint = solver.chain, solver.joint
    others = np.delete(np.arange(chain.k), joint)
    parts = []
    if _at_an_end(chain, solver.components, joint):
        rest, poses = without_end(chain, joint, values, U)
        groups = [(_known(solver, None, rest), np.arange(len(U)), poses)]
    else:
        distinct, group = np.unique(values, return_inverse=True)
        groups = []
        for i, value in enumerate(distinct.tolist()):
            rows = np.flatnonzero(group.reshape(-1) == i)
            rest = locked_chain(chain, {joint: value})
            groups.append((_known(solver, value, rest), rows, U[rows]))
    for inner, rows, poses in groups:
        if inner is None or rows.size == 0:
            continue
        request = np.ascontiguousarray(poses), references[np.ix_(rows, others)], tolerances
        if isinstance(inner, Redundant):
            part = _solutions(inner, *request, searched)
        else:
            part = postures(inner, *request)
        q = np.insert(part.q, joint, 0.0, axis=2)
        q[..., joint] = values[rows, None]
        if chain.sigma[joint] == 0:
            q[..., joint] = np.pi - (np.pi - q[..., joint]) % (2.0 * np.pi)
        q[~part.valid] = np.nan
        free = np.insert(part.free, joint, False, axis=2)
        found = Postures(q, part.valid, part.residual, part.double, free, part.family)
        parts.append((rows, found))
    return assembled(len(U), chain.k, parts)


def _known(solver: Redundant, value: float | None, chain: JointChain) -> Solver | None:
    """Solver of the chain with the joint at a value; the most recent ones are kept."""
    known = solver._known
    if value not in known:
        if len(known) >= MEMORY:
            known.pop(next(iter(known)), None)
        known[value] = prepare_alike(solver.inner, chain, solver.prepare)
    return known[value]


def _nearest(solver: Redundant, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    """Solutions with the joint as near to its reference as it gets."""
    chain, joint, N = solver.chain, solver.joint, len(U)
    wanted = constraints(chain, solver.components)
    starts = random_postures(chain, STARTS, np.random.default_rng(2))
    q = np.concatenate([references[:, None], np.tile(starts, (N, 1, 1))], axis=1)
    pose = np.repeat(np.arange(N), STARTS + 1)
    q = refined(wanted, U[pose], q.reshape(-1, chain.k))
    met = wanted.met(U[pose], q, PATH)[1]
    d = np.abs(difference(chain.sigma, q, references[pose]))[:, joint]
    order = np.lexsort((d, pose))
    order = order[met[order]]
    rank = np.arange(order.size) - np.searchsorted(pose[order], pose[order])
    chosen = order[rank < MEMBERS]
    pose, q = pose[chosen], q[chosen]
    held: list[int] = []
    for joint in free_joints(solver):
        q = nearest_value(wanted, U[pose], q, joint, references[pose, joint], held)
        d = np.abs(difference(chain.sigma, q, references[pose]))[:, joint]
        best = np.full(N, np.inf)
        np.minimum.at(best, pose, d)
        there = d <= best[pose] + SAME
        pose, q = pose[there], q[there]
        held.append(joint)
    members = collected(wanted, U, q, pose, tolerances)
    if members.q.shape[1] == 0:
        return members
    # and all others with the same values of these joints
    rows, first = np.unique(pose, return_index=True)
    values = q[first]
    more = at_values(solver, values[:, solver.joint], U[rows], values, tolerances, False)
    # at a turning point two solutions meet: those next to a member are the member
    gap = difference(chain.sigma, more.q[:, :, None], members.q[rows][:, None])
    more.valid[np.any(np.abs(gap).max(axis=-1) < FOLD, axis=-1)] = False
    more = assembled(N, chain.k, [(rows, more)])
    return side_by_side([members, more]).merge(chain.sigma)
