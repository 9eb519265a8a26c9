"""All IK solutions of a general six-joint arm, up to 16, by Raghavan and Roth's elimination.

The method needs no special axes, and is the worse the more special they are: with a spherical
wrist or three parallel axes its equations become dependent. Pieper's and Paul's methods serve
those arms; a self-test tells whether this one may. Where two solutions are one within rounding
all forms are tried; self-motions are not followed.

References
----------
M. Raghavan and B. Roth, "Inverse kinematics of the general 6R manipulator and related linkages",
J. Mechanical Design 115(3):502-508, 1993.
D. Manocha and J. F. Canny, "Efficient inverse kinematics for general 6R manipulators", IEEE
Trans. Robotics and Automation 10(5):648-657, 1994.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, read_only
from .chain import canonical_frames
from .check import checked
from .closed_form import prepare_closed_form
from .elimination_forms import Form, Roots, ranked_forms, solve_form
from .loop import JointChain
from .motion import jacobians, random_postures, tool_poses
from .postures import Postures
from .solver import Prepare, Solver, Tolerances, postures, prepare_alike

MOST = 16  # solutions a six-joint arm can have at one pose
CHUNK = 256  # poses worked on at a time: 2 MB of equations
TESTS = 48  # random poses of the self-test


@dataclass(frozen=True, slots=True, eq=False)
class EliminationArm:
    """Six-joint arm solved by elimination, and how many postures its self-test missed.

    ``scaled`` is the chain with frames slid together, in units of ``unit`` metres.
    """

    chain: JointChain
    scaled: JointChain
    unit: float
    forms: tuple[Form, ...]
    missed: int = 0

    @property
    def method(self) -> str:
        """The solver in words."""
        return (
            "six joints, at most one prismatic: elimination, up to 16 solutions (Raghavan and Roth)"
        )


def prepare_elimination(chain: JointChain) -> EliminationArm | None:
    """Choose the best forms of a six-joint arm and test them on random configurations."""
    if chain.k != 6 or int(np.sum(chain.sigma == 1)) > 1:
        return None
    rng = np.random.default_rng(0)
    arm = with_forms_of((), chain)
    few, many = (random_postures(arm.scaled, N, rng) for N in (8, TESTS))
    forms = ranked_forms(arm.scaled, arm.unit, tool_poses(arm.scaled, few))
    if not forms:
        return None
    arm, poses = replace(arm, forms=forms), tool_poses(arm.scaled, many)
    found = _solved(arm, poses)
    away = found.q - many[:, None]
    away -= 2.0 * np.pi * np.where(chain.sigma == 0, np.rint(away / (2.0 * np.pi)), 0.0)
    nearest = np.min(np.where(found.present, np.abs(away).max(axis=2), np.inf), axis=1)
    return replace(arm, missed=int(np.sum((nearest > 1e-5) | (found.count % 2 == 1))))


def with_forms_of(forms: tuple[Form, ...], chain: JointChain) -> EliminationArm:
    """An arm with forms that were chosen for another of the same structure."""
    D, unit = canonical_frames(chain)
    scaled = JointChain(chain.columns, read_only(chain.sigma, np.int64), read_only(D), chain.base)
    return EliminationArm(chain, scaled, unit, forms)


def elimination_solutions(arm: EliminationArm, U: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
    """All solutions of poses. Shapes: U (N, 4, 4) -> q (N, 16, 6), valid (N, 16)."""
    poses = np.array(U, dtype=np.float64, order="C")
    poses[:, :3, 3] /= arm.unit
    q, valid = np.full((len(poses), MOST, 6), np.nan), np.zeros((len(poses), MOST), np.bool_)
    for first in range(0, len(poses), CHUNK):
        rows = slice(first, first + CHUNK)
        found = _solved(arm, poses[rows])
        for n in np.flatnonzero(found.count > MOST):
            # the most singular solutions are dropped first
            s = np.linalg.svd(jacobians(arm.scaled, found.q[n, : found.count[n]]))[1][:, -1]
            found.q[n, :MOST] = found.q[n, np.sort(np.argsort(-s, kind="stable")[:MOST])]
        valid[rows] = found.present[:, :MOST]
        q[rows][valid[rows]] = found.q[:, :MOST][valid[rows]]
    q[:, :, arm.chain.sigma == 1] *= arm.unit
    return q, valid


@prepare_alike.register
def _(known: EliminationArm, chain: JointChain, prepare: Prepare) -> Solver | None:
    return prepare_closed_form(chain) or with_forms_of(known.forms, chain)


@postures.register
def _(solver: EliminationArm, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    q, valid = elimination_solutions(solver, U)
    return checked(solver.chain, U, q, valid, tolerances, double=np.zeros_like(valid))


def _solved(arm: EliminationArm, poses: Array) -> Roots:
    """Solutions by the first form, and by others where some may be missing."""
    found = Roots(len(poses))
    doubtful = np.ones(len(poses), np.bool_)
    for form in arm.forms:
        rows = np.flatnonzero(doubtful)
        if rows.size == 0:
            break
        part = Roots(0)
        part.q, part.count = found.q[rows], found.count[rows]
        doubtful[rows] = solve_form(arm.scaled, arm.unit, form, poses[rows], part)[0]
        found.q[rows], found.count[rows] = part.q, part.count
    return found
