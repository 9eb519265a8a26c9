"""Redundant arms with linear relations between their joints: ``A q = b``.

The second of the two ways to make a redundant arm definite; the first, to lock joints, is the case
of relations with one joint each. With one relation, samples of the self-motion (one joint locked
at values on a grid, the others solved) start Newton's method on pose and relation together; with
more relations random configurations do. Solutions may be missing.

Source: Section 1.2.3 of the book, redundant robots: additional relations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError, ShapeError
from .closed_form import ClosedForm
from .constraints import WHOLE, Constraints
from .loop import JointChain
from .motion import jacobians, lever
from .postures import Postures, assembled
from .redundant import Redundant, at_values, prepare_redundant
from .search import prepare_many_starts, solutions_from
from .solver import Prepare, Solver, Tolerances, postures

GRID = 120
"""Values of the locked joint at which self-motions are sampled."""
REACH = 0.4
"""Distance along a self-motion within which a sample starts Newton's method [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Related:
    """A redundant arm whose joints obey one relation, and the arm with a joint locked."""

    wanted: Constraints
    sampled: Redundant

    @property
    def chain(self) -> JointChain:
        """The arm that is solved."""
        return self.wanted.chain

    @property
    def method(self) -> str:
        """The method in words."""
        number = self.sampled.joint + 1
        return (
            f"relation between joints: Newton's method from {GRID} values of joint {number}, "
            f"which may miss some; {self.sampled.inner.method}"
        )


def prepare_related(chain: JointChain, A: Array, b: Array, prepare: Prepare) -> Solver | None:
    """Prepare a redundant arm for as many relations as it has joints more than six."""
    m = chain.k - 6
    if A.shape != (m, chain.k):
        raise ShapeError(
            f"relations: an arm of {chain.k} joints takes {m} relation{'s' * (m > 1)}, A of shape "
            f"{(m, chain.k)} and b of {(m,)}; got {A.shape} and {b.shape}."
        )
    if np.linalg.matrix_rank(A) < m:
        raise InvalidValueError(
            "relations: rows of A are dependent, so they are fewer relations than rows."
        )
    single = np.flatnonzero(np.count_nonzero(A, axis=1) == 1)
    if single.size:
        # a row with one joint is a lock; the other rows are relations of the shorter chain
        row = int(single[0])
        joint = int(A[row].nonzero()[0][0])
        value = float(b[row] / A[row, joint])
        rest = np.delete(A, row, axis=0)
        right = np.delete(b, row) - rest[:, joint] * value
        rest = np.delete(rest, joint, axis=1)

        def inner(shorter: JointChain) -> Solver | None:
            if len(rest) == 0:
                return prepare(shorter)
            return prepare_related(shorter, rest, right, prepare)

        return prepare_redundant(chain, WHOLE, joint, inner, value)
    wanted = Constraints(chain, WHOLE, A, b, lever(chain))
    if m > 1:
        return prepare_many_starts(wanted)
    sampled = _sampled(chain, prepare)
    return sampled and Related(wanted, sampled)


def _sampled(chain: JointChain, prepare: Prepare) -> Redundant | None:
    """The arm without a joint that moves along its self-motions, with a closed form if it can."""
    rng = np.random.default_rng(0)
    along = np.linalg.svd(jacobians(chain, rng.uniform(-2.0, 2.0, (7, chain.k))))[2][:, -1]
    moving = np.flatnonzero(np.median(np.abs(along), axis=0) > 1e-6).tolist()
    first = None
    # a joint at an end leaves one chain for all its values
    for joint in sorted(moving, key=lambda j: j not in (0, chain.k - 1)):
        arm = prepare_redundant(chain, WHOLE, joint, prepare)
        if arm is not None and isinstance(arm.inner, ClosedForm):
            return arm
        first = first or arm
    return first


@postures.register
def _(solver: Related, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    chain, joint = solver.chain, solver.sampled.joint
    wanted, parts = solver.wanted, []
    grid = ((np.arange(GRID) + 0.5) / GRID * 2.0 - 1.0) * (
        np.pi if chain.sigma[joint] == 0 else np.linalg.norm(chain.D[:, :3, 3], axis=1).sum()
    )
    for n in range(len(U)):
        goals = np.repeat(U[n : n + 1], GRID, axis=0)
        wide = np.repeat(references[n : n + 1], GRID, axis=0)
        samples = at_values(solver.sampled, grid, goals, wide, tolerances)
        q = samples.q[samples.valid]
        slope = np.abs(np.linalg.svd(jacobians(chain, q))[2][:, -1] @ wanted.A[0])
        off = np.abs(wanted.relation_errors(q)[:, 0])
        # at a turning point of the relation its change is of second order
        q = q[(off <= REACH * slope) | (off <= REACH**2)]
        pose = np.zeros(len(q), np.int64)
        row = slice(n, n + 1)
        part = solutions_from(wanted, U[row], q, pose, references[row], tolerances)
        parts.append((np.array([n]), part))
    return assembled(len(U), chain.k, parts)
