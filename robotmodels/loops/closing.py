"""Closing of the cut loops: the passive joints at given positions of the actuated ones.

Parameters
----------
q_actuated : array_like, shape (..., n_a)
    Positions of the actuated joints, rad or m.
q_guess : array_like, shape (..., n) or (..., n - n_a), optional
    Posture of all joints in the desired assembly, or positions of the passive joints; default
    passive joints at zero.

References
----------
Book section 2.4 (iterative method).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_floats, as_vector, batch_rows
from .._outcomes import Outcome, Result
from ..geometry import PRISMATIC
from .robot import LoopedRobot, check_looped

_STARTS = 5  # random starts for rows that do not close from the guess


class ClosingStatus(Outcome):
    """Outcome of closing a posture; fits int8."""

    CLOSED = 0, "The loops are closed."
    CANNOT_CLOSE = 1, "The loops cannot be closed at these positions of the actuated joints."
    NOT_CONVERGED = 2, "The iterations were used up before the loops were closed."
    SINGULAR_THERE = 3, "The loops are closed, but the actuated joints do not determine the others."


_OPEN = (ClosingStatus.CANNOT_CLOSE, ClosingStatus.NOT_CONVERGED)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ClosedPostures(Result):
    """Postures with closed loops, or the ones with the least residual. Read-only, picklable.

    ``q`` (..., n) of all joints, rad or m; ``residual`` (...), the largest distance (m) or angle
    (rad) between the frames of a closure; ``status`` (...), codes of `ClosingStatus`.
    """

    q: Array
    residual: Array
    status: NDArray[np.int8]
    outcomes = ClosingStatus

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Sentence of the status of one posture, with the residual where its loops are open."""
        status = self.outcome(i)
        if status not in _OPEN:
            return status.sentence
        return f"{status.sentence} Least residual: {np.ravel(self.residual[i])[0]:.3g} m or rad."


def close(
    robot: LoopedRobot, q_actuated: ArrayLike, q_guess: ArrayLike | None = None
) -> ClosedPostures:
    """Close the loops: posture of all joints at given positions of the actuated ones.

    From a guess of all joints, the actuated joints move straight to their positions while damped
    Newton iterations keep the loops closed, which keeps the assembly of the guess. Where that
    fails, and with a guess of the passive joints alone, the iterations start at the positions
    themselves, and last at random passive joints. Each row is independent of the others.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.loops import Closure
    >>> from robotmodels.model import RobotModel
    >>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
    >>> robot = LoopedRobot(RobotModel.from_table(table), [Closure("cut", (4, 5))], actuated=[0])
    >>> close(robot, [1.0], [0.5, 0.5, -0.5]).q.round(12)
    array([ 1.,  1., -1.])
    """
    check_looped(robot)
    n, passive = robot.n, robot.passive
    given = as_vector(q_actuated, len(robot.actuated), "q_actuated")
    guess = np.zeros(len(passive)) if q_guess is None else as_floats(q_guess, "q_guess")
    follow = guess.shape[-1:] != passive.shape
    guess = as_vector(guess, n if follow else len(passive), "q_guess")
    batch, (target, start) = batch_rows((given, guess), ("q_actuated", "q_guess"))
    if not follow:
        of_passive, start = start, np.empty((len(start), n))
        start[:, passive], start[:, robot.actuated] = of_passive, target
    q, residual, status = attempt(robot, target, start, follow)
    jumped = np.full(len(q), not follow)  # motions keep their turns
    rng = np.random.default_rng(0)
    for k in range(1 - follow, _STARTS + 1):
        rows = np.flatnonzero(np.isin(status, _OPEN))
        if not rows.size:
            break
        again = start[rows]
        if k:
            again[:, passive] = rng.uniform(-np.pi, np.pi, len(passive)) * robot.units[passive]
        again, least, code = attempt(robot, target[rows], again, False)
        better = (least < residual[rows]) | (k == 0)  # a motion may have ended on its way
        kept = rows[better]
        q[kept], residual[kept], status[kept] = again[better], least[better], code[better]
        jumped[kept] = True
    q[jumped] = without_turns(robot, q[jumped], start[jumped])
    return ClosedPostures(q.reshape(*batch, n), residual.reshape(batch), status.reshape(batch))


def attempt(
    robot: LoopedRobot, target: Array, start: Array, follow: bool
) -> tuple[Array, Array, NDArray[np.int8]]:
    """Close the postures in rows (N, n) once: those found, residuals and codes (N,).

    With ``follow`` the actuated joints move to the target (N, n_a), else they start there.
    """
    from .kernels import closed_postures

    q, residual, code = start.copy(), np.empty(len(start)), np.empty(len(start))
    closed_postures(target, robot.cuts, robot.actuated, robot.passive, follow, q, residual, code)
    return q, residual, code.astype(np.int8)


def without_turns(robot: LoopedRobot, q: Array, start: Array) -> Array:
    """The same postures (N, n), without whole turns that iterations added to the start."""
    table = robot.tree.table
    turns = np.round((q - start) / (2.0 * np.pi)) * (table.sigma[table.joint_rows] != PRISMATIC)
    turns[:, robot.actuated] = 0.0
    return q - 2.0 * np.pi * turns
