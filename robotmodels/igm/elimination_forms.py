"""The 24 forms of the loop of six joints for the elimination, and the choice among them.

Any joint may be the one that drops out, its two neighbours to one side the pair that is eliminated
linearly, and of the other three an outer one gives the eigenvalues. The forms are equal in theory
and far from it in rounding: all are tried on random poses, and the best are kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array, read_only
from .loop import JointChain

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


class Roots:
    """Solutions of N poses while they are gathered: q (N, 48, 6), count (N,)."""

    def __init__(self, N: int) -> None:
        self.q = np.zeros((N, ROOM, 6))
        self.count = np.zeros(N, np.int64)

    @property
    def present(self) -> NDArray[np.bool_]:
        """Rows in use, shape (N, 48)."""
        return np.arange(ROOM) < self.count[:, None]


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


def solve_form(
    chain: JointChain, unit: float, form: Form, poses: Array, found: Roots
) -> tuple[NDArray[np.bool_], Array]:
    """Add the solutions that a form finds; whether some may be missing, and its errors (N,).

    ``chain`` and ``poses (N, 4, 4)`` are in units of the arm; ``unit`` is that unit [m].
    """
    from .kernels.elimination import eigenproblems
    from .kernels.elimination_roots import solutions_of_eigenvalues

    N, D = poses.shape[0], chain.D
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
    tolerance = np.array([TOLERANCE / min(unit, 1.0), TOLERANCE])
    solutions_of_eigenvalues(
        chain.sigma, D, poses, tolerance, loop, links, eigenvalues, (*parts, quality),
        (found.q, found.count, report),
    )  # fmt: skip
    missing = (found.count != report[:, 0]) | (quality < POOR) | failed
    return missing | (report[:, 1] > ROUGH), report[:, 1]


def ranked_forms(chain: JointChain, unit: float, poses: Array) -> tuple[Form, ...]:
    """The best forms first, by solutions missed and by the errors before polishing.

    The solutions of each at a few poses are compared with those of all together.
    """
    forms = all_forms(chain.sigma)
    union, counts, errors = Roots(len(poses)), [], []
    for form in forms:
        alone = Roots(len(poses))
        _, moved = solve_form(chain, unit, form, poses, alone)
        solve_form(chain, unit, form, poses, union)
        counts.append(int(alone.count.sum()))
        # 1e-16 keeps the logarithm finite
        errors.append(np.mean(np.log10(np.minimum(moved, 10.0) + 1e-16)))
    most = int(union.count.sum())
    if most == 0:
        return ()
    # a solution missed weighs more than any error
    score = 100.0 * (most - np.array(counts)) + np.array(errors)
    first = int(np.argmin(score))
    # eigenvalues of another joint fail at other poses: worth two digits
    score += [2.0 * (form.joints[2] == forms[first].joints[2]) for form in forms]
    score[first] = -np.inf
    return tuple(forms[i] for i in np.argsort(score, kind="stable")[:KEPT])
