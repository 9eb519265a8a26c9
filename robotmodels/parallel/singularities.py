"""Singular configurations: kinds, motions gained, Grassmann varieties of the legs' lines.

Parameters
----------
robot, T, mode
    See `robotmodels.parallel`; one pose (4, 4).
tolerance : float
    Singular values below this fraction of the largest are zero, and sines of elbows.

Returns
-------
Singularity
    ``kind``; ``motion`` (k, 6), twists [v; w] of the platform that locked actuators do not prevent,
    norm 1 with angles times the characteristic length; ``legs``, the smallest set of legs whose
    lines depend on each other, at serial singularities the straight ones, from 0; ``variety``, the
    class of these lines in Grassmann geometry, "1" to "4", "5a", "5b", empty where they are
    independent, and ``form``, the same with Merlet's letter; ``least``, the smallest singular value
    of the unit lines, relative to the largest.

References
----------
Book section 2.3.3.3; J.-P. Merlet, Int. J. of Robotics Research 8(5), 1989.

Examples
--------
>>> from robotmodels.parallel import gough_symmetric
>>> robot = gough_symmetric(1.0)
>>> turned = classify_singularity(robot, robot.pose([0, 0, 1.2, 0, 0, np.pi / 2]))
>>> turned.kind.name, turned.variety, turned.motion.shape
('PARALLEL', '5a', (1, 6))
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_number
from .._outcomes import Outcome, Result
from ..errors import ShapeError
from .legs import Mode, Robot, is_looped, leg_states, modes_of
from .looped import null_space
from .robot import Family
from .velocities import states

_WORDS = {
    "": "the lines are independent",
    "1": "two lines coincide",
    "2b": "a flat pencil: lines in one plane through one point, or parallel",
    "3a": "a regulus: lines of one family of a hyperboloid",
    "3b": "two flat pencils with a line in common",
    "3c": "a bundle: lines through one point, or parallel",
    "3d": "lines in one plane",
    "4a": "an elliptic congruence",
    "4b": "a hyperbolic congruence: lines that meet two skew lines",
    "4c": "a parabolic congruence: flat pencils with a line in common",
    "4d": "a degenerate congruence: lines in a plane or through one of its points",
    "5a": "a general linear complex",
    "5b": "a special linear complex: lines that meet one line",
}


class SingularityKind(Outcome):
    """Kinds of positions of a parallel robot."""

    REGULAR = 0, "The pose is regular."
    SERIAL = 1, "Serial singularity: an actuator moves without the platform, a leg is straight."
    PARALLEL = 2, "Parallel singularity: the platform moves with locked actuators."
    BOTH = 3, "Serial and parallel singularity at once."
    CONSTRAINT = 4, "Constraint singularity: the legs no longer constrain the platform's motion."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Singularity(Result):
    """Kind of a pose, and what the platform gains there. Read-only."""

    kind: SingularityKind
    motion: Array
    legs: tuple[int, ...]
    variety: str
    form: str
    least: float

    @property
    def status(self) -> SingularityKind:
        """The kind."""
        return self.kind

    def reason(self) -> str:
        """Kind of the position and form of the lines as a sentence."""
        if not self.form:
            return self.kind.sentence
        names = ", ".join(str(i + 1) for i in self.legs)
        words = f"Legs {names} (from 1), class {self.form}: {_WORDS[self.form]}."
        return f"{self.kind.sentence} {words}"


def classify_singularity(
    robot: Robot, T: ArrayLike, mode: Mode = None, tolerance: float = 1e-8
) -> Singularity:
    """Kind of a pose, motions gained, dependent legs and their Grassmann variety."""
    epsilon = as_number(tolerance, "tolerance", above=0.0, below=1.0)
    if np.ndim(getattr(T, "homogeneous", T)) != 2:
        raise ShapeError(f"T: expected one pose, shape (4, 4), got {np.shape(T)}; loop over poses.")
    if is_looped(robot, mode):
        code, motion = robot.singular_motions(T, epsilon)
        least = 0.0 if len(motion) else 1.0
        return Singularity(SingularityKind(code), motion, (), "", "", least)
    pose = robot.checked(T)[None]
    legs = leg_states(robot, pose, modes_of(robot, mode, (1,)))
    if not legs.reached.all():
        states(robot, mode, pose[0])  # raises with the sentence
    size = robot.crank if robot.has_cranks else np.ones(robot.m)
    straight = np.flatnonzero(np.abs(legs.speed[0]) <= epsilon * size)
    unit, columns = np.repeat([1.0, 1.0 / robot.length], 3), list(robot.columns)
    rows = legs.rows[0] * unit
    s = np.linalg.svd(rows[:, columns], compute_uv=False)
    motion = null_space(rows[:, columns], epsilon)
    gained = np.zeros((len(motion), 6))
    gained[:, columns] = motion * unit[columns]
    dependent, form = (), ""
    if len(motion):
        if 5 not in columns:  # rods of a platform that does not turn act as if they met in a point
            rows[:, 3:] = 0.0
        dependent, form = grassmann(rows, epsilon)
    kind = SingularityKind((1 if straight.size else 0) + (2 if len(motion) else 0))
    if robot.family is Family.DELTA:  # rotations that the pairs of rods do not prevent
        hips = np.cross(robot.outward, robot.downward)
        turning = null_space(np.cross(hips, legs.direction[0]), epsilon)
        if len(turning):
            kind = SingularityKind.CONSTRAINT
            gained = np.vstack((gained, np.pad(turning / robot.length, ((0, 0), (3, 0)))))
    chosen = dependent or tuple(int(i) for i in straight)
    variety = form if form.startswith("5") else form[:1]
    return Singularity(kind, gained, chosen, variety, form, float(s[-1] / s[0]))


def grassmann(lines: Array, epsilon: float = 1e-8) -> tuple[tuple[int, ...], str]:
    """Smallest dependent set of lines and the variety that it spans.

    Shapes: lines (m, 6), unit directions and moments in one unit -> numbers from 0, form.
    """
    m = len(lines)
    for k in range(2, m + 1):
        # sets of fewer lines are independent by now, so that rank k - 1 is all there can be
        for chosen in combinations(range(m), k):
            L = lines[list(chosen)]
            s = np.linalg.svd(L, compute_uv=False)
            if k > 6 or s[-1] <= epsilon * s[0]:
                return chosen, _form(L, k - 1, epsilon)
    return (), ""


def _form(L: Array, rank: int, epsilon: float) -> str:
    """Merlet's class of lines that span a space of this dimension, one fewer than lines."""
    if rank == 1:
        return "1"
    if rank == 2:
        return "2b"  # three lines of which none coincide
    u = L[:, :3]
    flat = np.linalg.svd(u, compute_uv=False)[-1] <= np.sqrt(epsilon)
    mutual = L[:, :3] @ L[:, 3:].T  # their sums with the transposed: zero where two lines meet
    meet = np.abs(mutual + mutual.T) <= 100.0 * epsilon
    if rank == 3:
        if not meet.all():
            return "3a" if not (meet & ~np.eye(4, dtype=bool)).any() else "3b"
        parallel = np.linalg.svd(u, compute_uv=False)[1] <= np.sqrt(epsilon)
        return "3d" if flat and not parallel else "3c"
    # reciprocal screws: what meets all lines, if it is a line itself
    _, _, Vt = np.linalg.svd(L)
    others = Vt[rank:][:, [3, 4, 5, 0, 1, 2]]
    if rank == 5:
        w = others[0]
        pitch = 2.0 * w[:3] @ w[3:] / (w @ w)
        return "5b" if abs(pitch) <= np.sqrt(epsilon) else "5a"
    # two screws: the lines among them are the roots of a quadratic
    a, c = others[0, :3] @ others[0, 3:], others[1, :3] @ others[1, 3:]
    b = 0.5 * (others[0, :3] @ others[1, 3:] + others[0, 3:] @ others[1, :3])
    if max(abs(a), abs(b), abs(c)) <= np.sqrt(epsilon):
        return "4d"
    square = b * b - a * c
    if abs(square) <= epsilon:
        return "4c"
    return "4b" if square > 0.0 else "4a"
