"""All IK solutions of a general six-joint arm, up to 16, by Raghavan and Roth's elimination.

The method needs no special geometry and becomes inaccurate near it: with a spherical wrist or
three parallel axes its equations become dependent. Pieper's and Paul's methods serve those arms;
a self-test decides whether elimination may serve an arm. Where two solutions are one within
rounding all forms are tried; self-motions are not followed.

Of the loop of six joints any may be the one that drops out, its two neighbours to one side the pair
that is eliminated linearly, and of the other three an outer one gives the eigenvalues: 24 forms.
They are equal in theory, but differ much in rounding errors: all are tried on random poses, and
the best are kept.

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

from .. import se3
from .._arrays import Array, read_only
from .chain import canonical_frames
from .check import checked
from .closed_form import prepare_closed_form
from .loop import JointChain
from .motion import jacobians, random_postures, tool_poses
from .postures import Postures, difference
from .solver import Prepare, Solver, Tolerances, postures, prepare_alike

MOST = 16  # solutions a six-joint arm can have at one pose
CHUNK = 256  # poses worked on at a time: 2 MB of equations
TESTS = 48  # random poses of the self-test
TOLERANCE = 1e-13  # residual of a solution [m, or the arm's length if that is more; rad]
POOR = 1e-9  # quality of the elimination below which another form is tried as well
ROUGH = 1e-4  # distance by which polishing moved a solution above which another form is tried [rad]
ROOM = 48  # rows while solving: a self-motion takes any number, and must leave some
KEPT = 12  # forms kept


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """One form of the loop. Shapes: joints, kinds (6,)."""

    joints: NDArray[np.int64]
    kinds: NDArray[np.int64]
    direction: int
    swapped: bool


def all_forms(sigma: NDArray[np.int64]) -> list[Form]:
    """The 24 forms without those that put a prismatic joint where none may be."""
    found = []
    for direction in (1, -1):
        for start in range(6):
            joints = (start + direction * np.arange(6)) % 6
            kinds = sigma[joints]
            # the eigenvalue is an angle, and only a revolute joint leaves a line in place
            if kinds[2] == 0 and kinds[5] == 0:
                joints, kinds = read_only(joints, np.int64), read_only(kinds, np.int64)
                found += [Form(joints, kinds, direction, swapped) for swapped in (False, True)]
    return found


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
    arm = replace(arm, forms=_ranked_forms(arm, tool_poses(arm.scaled, few)))
    if not arm.forms:
        return None
    q, count = _solved(arm, tool_poses(arm.scaled, many))
    away = np.abs(difference(chain.sigma, q, many[:, None])).max(axis=2)
    nearest = np.min(away, axis=1, where=_present(count), initial=np.inf)
    return replace(arm, missed=int(np.sum((nearest > 1e-5) | (count % 2 == 1))))


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
        found, count = _solved(arm, poses[rows])
        for n in np.flatnonzero(count > MOST):
            # the most singular solutions are dropped first
            s = np.linalg.svd(jacobians(arm.scaled, found[n, : count[n]]))[1][:, -1]
            found[n, :MOST] = found[n, np.sort(np.argsort(-s, kind="stable")[:MOST])]
        valid[rows] = _present(count)[:, :MOST]
        q[rows][valid[rows]] = found[:, :MOST][valid[rows]]
    q[:, :, arm.chain.sigma == 1] *= arm.unit
    return q, valid


@prepare_alike.register
def _(known: EliminationArm, chain: JointChain, prepare: Prepare) -> Solver | None:
    return prepare_closed_form(chain) or with_forms_of(known.forms, chain)


@postures.register
def _(solver: EliminationArm, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    q, valid = elimination_solutions(solver, U)
    return checked(solver.chain, U, q, valid, tolerances, double=np.zeros_like(valid))


def _present(count: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Rows in use, shape (N, 48)."""
    return np.arange(ROOM) < count[:, None]


def _solved(arm: EliminationArm, poses: Array) -> tuple[Array, NDArray[np.int64]]:
    """Solutions (N, 48, 6) by the first form, and by others where some may be missing; counts."""
    q, count = np.zeros((len(poses), ROOM, 6)), np.zeros(len(poses), np.int64)
    doubtful = np.ones(len(poses), np.bool_)
    for form in arm.forms:
        rows = np.flatnonzero(doubtful)
        if rows.size == 0:
            break
        found = q[rows], count[rows]
        doubtful[rows] = _solve_form(arm, form, poses[rows], *found)[0]
        q[rows], count[rows] = found
    return q, count


def _solve_form(
    arm: EliminationArm, form: Form, poses: Array, q: Array, count: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], Array]:
    """Add the solutions that a form finds; whether some may be missing, and its errors (N,)."""
    from .kernels.elimination import eigenproblems
    from .kernels.elimination_roots import solutions_of_eigenvalues

    N, D = poses.shape[0], arm.scaled.D
    # the link behind each joint; where the loop closes it holds the pose
    last = 5 if form.direction == 1 else 0
    links = np.empty((N, 6, 4, 4))
    for place, j in enumerate(form.joints):
        links[:, place] = D[j + 1] if form.direction == 1 else se3.inverse(D[j])
        if j == last and form.direction == 1:
            links[:, place] = D[6] @ se3.inverse(poses) @ D[0]
        elif j == last:
            links[:, place] = se3.inverse(D[0]) @ poses @ se3.inverse(D[6])
    M, report, quality = np.zeros((N, 16, 16)), np.empty((N, 2)), np.empty(N)
    parts = np.empty((N, 14, 27)), np.empty((N, 14, 8)), np.empty((N, 8), np.int64), np.empty(N)
    loop = form.kinds, form.joints, float(form.direction), int(form.swapped)
    eigenproblems(form.kinds, links, loop[3], M, (*parts, quality))
    failed = ~np.all(np.isfinite(M), axis=(1, 2))
    M[failed] = 0.0
    eigenvalues = np.linalg.eigvals(M).astype(np.complex128)
    eigenvalues[failed] = 1j
    tolerance = np.array([TOLERANCE / min(arm.unit, 1.0), TOLERANCE])
    solutions_of_eigenvalues(
        arm.scaled.sigma, D, poses, tolerance, loop, links, eigenvalues, (*parts, quality),
        (q, count, report),
    )  # fmt: skip
    missing = (count != report[:, 0]) | (quality < POOR) | failed
    return missing | (report[:, 1] > ROUGH), report[:, 1]


def _ranked_forms(arm: EliminationArm, poses: Array) -> tuple[Form, ...]:
    """The best forms first, by solutions missed and by the errors before polishing.

    The solutions of each at a few poses are compared with those of all together.
    """
    forms, counts, errors = all_forms(arm.chain.sigma), [], []
    empty = np.zeros((len(poses), ROOM, 6)), np.zeros(len(poses), np.int64)
    union = empty[0].copy(), empty[1].copy()
    for form in forms:
        alone = empty[0].copy(), empty[1].copy()
        _, moved = _solve_form(arm, form, poses, *alone)
        _solve_form(arm, form, poses, *union)
        counts.append(int(alone[1].sum()))
        # 1e-16 keeps the logarithm finite
        errors.append(np.mean(np.log10(np.minimum(moved, 10.0) + 1e-16)))
    most = int(union[1].sum())
    if most == 0:
        return ()
    # a solution missed weighs more than any error
    score = 100.0 * (most - np.array(counts)) + np.array(errors)
    first = int(np.argmin(score))
    # eigenvalues of another joint fail at other poses: worth two digits
    score += [2.0 * (form.joints[2] == forms[first].joints[2]) for form in forms]
    score[first] = -np.inf
    return tuple(forms[i] for i in np.argsort(score, kind="stable")[:KEPT])
