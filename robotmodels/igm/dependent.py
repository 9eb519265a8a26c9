"""Arms of which a joint can always move while the others keep the tool still.

Such a joint takes its reference and the others are solved; where they have no posture for it,
values around it are tried. What is found belongs to an infinite family, which `settle_families`
brings to the value that is nearest to the reference.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .alike import prepare_alike
from .gather import assembled, rows_of
from .loop import JointChain
from .motion import jacobians, lever, random_postures, scaled
from .solver import Found, Prepare, Solver, Tolerances, nothing_found, postures

DEPENDENT = 1e-9  # singular values beside the largest that count as zero at any posture
SHARE = 1e-6  # part of a joint in a null direction that counts
GRID = 36  # values of the joint that are tried where the reference has no posture
MEMORY = 64  # chains with a value of the joint that are kept
_SHARES = np.linspace(-1.0, 1.0, 21)  # of the reach of a held slide, tried last


@dataclass(frozen=True, slots=True, eq=False)
class DependentJoints:
    """Arm with a joint whose screw always depends on the others; it is set to `q_ref`."""

    chain: JointChain
    held: int
    first: Solver
    prepare: Prepare
    length: float
    _known: dict[float, Solver | None] = field(default_factory=dict)

    @property
    def method(self) -> str:
        """The family in words."""
        number = self.chain.columns[self.held] + 1
        return f"joint {number} at its reference; {self.first.method}"


def dependent_joint(J: Array, choose: NDArray[np.bool_]) -> int | None:
    """First joint whose column depends on the others at all postures; None if there is none.

    Shapes: J (Q, a, k), choose (k,).
    """
    _, values, rows = np.linalg.svd(J)
    k = J.shape[2]
    padded = np.zeros((len(J), k))
    padded[:, : values.shape[1]] = values
    null = padded <= DEPENDENT * padded[:, :1]
    if not np.all(null.any(axis=1)):
        return None
    # a null space that grows at one of the postures only is a singularity
    least = int(null.sum(axis=1).min())
    usual = null.sum(axis=1) == least
    share = np.sqrt(np.sum(np.where(null[usual][..., None], rows[usual], 0.0) ** 2, axis=1))
    moves = (share.max(axis=0) > SHARE) & choose
    return int(np.argmax(moves)) if moves.any() else None


def prepare_dependent(chain: JointChain, prepare: Prepare) -> DependentJoints | None:
    """Solver of an arm with a dependent joint, which is held."""
    length = lever(chain)
    q = random_postures(chain, 8, np.random.default_rng(3))
    held = dependent_joint(scaled(jacobians(chain, q), length), chain.columns >= 0)
    if held is None:
        return None
    return prepare_held(chain, held, prepare)


def prepare_held(chain: JointChain, held: int, prepare: Prepare) -> DependentJoints | None:
    """Solver with joint ``held`` at its reference; None if the other joints have no solver."""
    first = prepare(held_chain(chain, held, 0.0))
    if first is None:
        return None
    return DependentJoints(chain, held, first, prepare, lever(chain), {0.0: first})


def held_chain(chain: JointChain, held: int, value: float) -> JointChain:
    """The chain with a joint that has become a constant."""
    M = np.eye(4)
    if chain.sigma[held] == 0:
        M[:2, :2] = [[np.cos(value), -np.sin(value)], [np.sin(value), np.cos(value)]]
    else:
        M[2, 3] = value
    joined = chain.D[held] @ M @ chain.D[held + 1]
    D = np.concatenate([chain.D[:held], joined[None], chain.D[held + 2 :]])
    others = np.delete(np.arange(chain.k), held)
    return JointChain(chain.columns[others], chain.sigma[others], D, chain.base)


@prepare_alike.register
def _(known: DependentJoints, chain: JointChain, prepare: Prepare) -> Solver | None:
    first = prepare_alike(known.first, held_chain(chain, known.held, 0.0), prepare)
    if first is None:
        return None
    return replace(known, chain=chain, first=first, _known={0.0: first})


@postures.register
def _(solver: DependentJoints, U: Array, references: Array, tolerances: Tolerances) -> Found:
    N = len(U)
    out = nothing_found(N, 0, solver.chain.k)
    empty = np.arange(N)
    wanted = references[:, solver.held]
    # around the reference, so that equal references share chains; of a slide around the pose too
    tried = [wanted + step for step in (0.0, *_steps(solver))]
    if solver.chain.sigma[solver.held] == 1:
        tried += [_reach(solver, U) * share for share in _SHARES]
    for values in tried:
        if empty.size == 0:
            break
        part = _at(solver, values[empty], U[empty], references[empty], tolerances)
        there = np.flatnonzero(part.valid.any(axis=1))
        rest = np.setdiff1d(np.arange(N), empty[there])
        new = empty[there], rows_of(part, there)
        out = assembled(N, solver.chain.k, [(rest, rows_of(out, rest)), new])
        empty = np.delete(empty, there)
    return out


def _steps(solver: DependentJoints) -> Array:
    """Ways from the reference to the other values, nearest first."""
    half = np.arange(1, GRID // 2 + 1) / (GRID // 2)
    if solver.chain.sigma[solver.held] == 0:
        far = np.pi * half
    else:  # lengths grow without end
        far = solver.length * np.tan(0.45 * np.pi * half)
    return np.stack([far, -far], axis=1).reshape(-1)


def _reach(solver: DependentJoints, U: Array) -> Array:
    """How far the held slide can be out at poses, as powers of two, which share chains, (N,)."""
    links = float(np.linalg.norm(solver.chain.D[:, :3, 3], axis=1).sum())
    far = links + np.linalg.norm(U[:, :3, 3], axis=1)
    return np.exp2(np.ceil(np.log2(np.maximum(far, 1e-9))))


def _at(
    solver: DependentJoints, values: Array, U: Array, references: Array, tolerances: Tolerances
) -> Found:
    """Postures with the held joint at a value of each pose."""
    chain, held = solver.chain, solver.held
    others = np.delete(np.arange(chain.k), held)
    parts = []
    distinct, group = np.unique(values, return_inverse=True)
    for i, value in enumerate(distinct.tolist()):
        rest = _rest(solver, value)
        if rest is None:
            continue
        rows = np.flatnonzero(group.reshape(-1) == i)
        part = postures(
            rest, np.ascontiguousarray(U[rows]), references[np.ix_(rows, others)], tolerances
        )
        q = np.insert(part.q, held, value, axis=2)
        if chain.sigma[held] == 0:
            q[..., held] = np.pi - (np.pi - q[..., held]) % (2.0 * np.pi)
        q[~part.valid] = np.nan
        free = np.insert(part.free, held, True, axis=2) & part.valid[..., None]
        parts.append(
            (rows, Found(q, part.valid, part.residual, part.double, free, part.valid.copy()))
        )
    return assembled(len(U), chain.k, parts)


def _rest(solver: DependentJoints, value: float) -> Solver | None:
    """What serves the other joints when the held one has a value; the last ones are kept."""
    known = solver._known
    if value not in known:
        if len(known) >= MEMORY:
            known.pop(next(iter(known)))
        chain = held_chain(solver.chain, solver.held, value)
        known[value] = prepare_alike(solver.first, chain, solver.prepare)
    return known[value]
