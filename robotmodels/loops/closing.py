"""Closing of the cut loops: the passive joints at given positions of the actuated ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, Value, as_vector, batch_rows
from .._outcomes import Outcome
from ..errors import ShapeError
from ..geometry import REVOLUTE
from .robot import LoopedRobot, check_looped

_STARTS = 12  # random starts for rows that do not close from the guess


class ClosingStatus(Outcome):
    """Outcome of closing a posture; fits int8."""

    CLOSED = 0, "The loops are closed."
    CANNOT_CLOSE = (
        1,
        "The loops cannot be closed at these positions of the actuated joints: the residual is the "
        "least one that was found.",
    )
    NOT_CONVERGED = 2, "The iterations were used up before the loops were closed."
    SINGULAR_THERE = (
        3,
        "The loops are closed, but the actuated joints do not determine the motion of the passive "
        "ones there.",
    )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ClosedPostures(Frozen, Value):
    """Postures with closed loops, or as nearly closed as was found. Read-only, picklable.

    Parameters
    ----------
    q : ndarray, shape (..., n)
        Joint variables of all joints, rad or m; where the status is neither ``CLOSED`` nor
        ``SINGULAR_THERE``, those of the least residual.
    residual : ndarray, shape (...)
        Largest distance (m) or angle (rad) between the frames of a closure.
    status : ndarray of int8, shape (...)
        Codes of `ClosingStatus`.

    Examples
    --------
    >>> ClosedPostures(np.zeros(3), np.zeros(()), np.zeros((), np.int8)).reason()
    'The loops are closed.'
    """

    q: Array
    residual: Array
    status: NDArray[np.int8]

    def __post_init__(self) -> None:
        Frozen.__post_init__(self)
        if not self.q.shape[:-1] == self.residual.shape == self.status.shape:
            raise ShapeError(
                f"q, residual, status: expected shapes (..., n), (...), (...), got {self.q.shape}, "
                f"{self.residual.shape}, {self.status.shape}."
            )

    @property
    def is_closed(self) -> NDArray[np.bool_]:
        """Whether the loops are closed, shape (...)."""
        return np.isin(self.status, (ClosingStatus.CLOSED, ClosingStatus.SINGULAR_THERE))

    def reason(self, index: int | tuple[int, ...] = ()) -> str:
        """Sentence of the status of one posture."""
        status = ClosingStatus(int(self.status[index]))
        if status in (ClosingStatus.CLOSED, ClosingStatus.SINGULAR_THERE):
            return status.sentence
        return f"{status.sentence} Residual: {self.residual[index]:.3g} m or rad."

    def __repr__(self) -> str:
        counts = [(s, int((self.status == s).sum())) for s in ClosingStatus]
        listed = ", ".join(f"{count} {s.name}" for s, count in counts if count)
        return f"<ClosedPostures {self.q.shape}: {listed or 'empty'}>"


def close(
    robot: LoopedRobot, q_actuated: ArrayLike, q_guess: ArrayLike | None = None
) -> ClosedPostures:
    """Close the loops: posture of all joints at given positions of the actuated ones.

    Damped Newton iterations of the passive joints from the guess, which thereby chooses the
    assembly among several; rows are independent of each other, and angles are given within half a
    turn of the guess. Only a row that does not close from
    its guess is started again, at random positions of the passive joints.

    Parameters
    ----------
    robot : LoopedRobot
        The robot, n joints, n_a of them actuated.
    q_actuated : array_like, shape (..., n_a)
        Positions of the actuated joints, rad or m.
    q_guess : array_like, shape (..., n) or (..., n - n_a), optional
        Posture of all joints, or positions of the passive ones, to start from; default zero.

    Returns
    -------
    ClosedPostures
        ``.q (..., n)``, ``.residual (...)``, ``.status (...)``.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book section 2.4; K. Levenberg 1944, D. Marquardt 1963, for the damping.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.loops import Closure
    >>> from robotmodels.model import RobotModel
    >>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
    >>> robot = LoopedRobot(RobotModel.from_table(table), [Closure("cut", (4, 5))], actuated=[0])
    >>> close(robot, [1.0], [1.0, 0.8, -0.8]).q.round(12)
    array([ 1.,  1., -1.])
    """
    check_looped(robot)
    n, passive = robot.n, robot.passive
    given = as_vector(q_actuated, len(robot.actuated), "q_actuated")
    guess = np.zeros(n) if q_guess is None else np.asarray(q_guess)
    size = n if guess.shape[-1:] != passive.shape else len(passive)
    guess = as_vector(guess, size, "q_guess")
    batch, (rows, start) = batch_rows((given, guess), ("q_actuated", "q_guess"))
    q = np.empty((len(rows), n))
    q[:, passive] = start[:, passive] if size == n else start
    q[:, robot.actuated] = rows
    guess, residual, status = q.copy(), np.empty(len(q)), np.empty(len(q))
    _close(robot, q, residual, status)
    _start_again(robot, q, residual, status)
    turns = robot.tree.table.sigma[robot.tree.table.joint_rows] == REVOLUTE
    q -= turns * 2.0 * np.pi * np.round((q - guess) / (2.0 * np.pi))
    return ClosedPostures(
        q.reshape(*batch, n), residual.reshape(batch), status.astype(np.int8).reshape(batch)
    )


def _close(robot: LoopedRobot, q: Array, residual: Array, status: Array) -> None:
    """Close the postures in the rows of q in place."""
    from .kernels import closed_postures

    closed_postures(robot.tree.chain, robot.cuts, robot.passive, q, residual, status)


def _start_again(robot: LoopedRobot, q: Array, residual: Array, status: Array) -> None:
    """Close rows that are still open from random starts, and keep the least residual."""
    rng = np.random.default_rng(0)
    passive = robot.passive
    spread = np.pi * robot.cuts.units[passive]
    for _ in range(_STARTS):
        failed = np.isin(status, (ClosingStatus.CANNOT_CLOSE, ClosingStatus.NOT_CONVERGED))
        rows = np.flatnonzero(failed)
        if not rows.size:
            return
        again, least, code = q[rows].copy(), residual[rows].copy(), status[rows].copy()
        again[:, passive] = rng.uniform(-spread, spread)
        _close(robot, again, least, code)
        better = least < residual[rows]
        kept = rows[better]
        q[kept], residual[kept], status[kept] = again[better], least[better], code[better]
