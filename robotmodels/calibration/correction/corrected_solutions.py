"""Postures of a calibrated robot, and what became of those of the nominal one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Rebuilt, read_only
from ..._outcomes import Outcome
from ...igm.solutions import IGMSolutions


class CorrectionStatus(Outcome):
    """What became of a posture of the nominal robot; fits int8.

    Attributes
    ----------
    sentence : str
        What a person reads.

    Examples
    --------
    >>> CorrectionStatus.MERGED.sentence
    'It arrives where another nominal posture arrived already.'
    """

    ARRIVED = 0, "It was brought to a posture of the calibrated robot."
    MERGED = 1, "It arrives where another nominal posture arrived already."
    VANISHED = 2, "Newton steps from it do not meet the pose: the calibrated robot has lost it."
    OUTSIDE_LIMITS = 3, "It was brought to a posture outside the joint limits."
    NO_READING = 4, "It was brought to a posture that no readings of the joints lead to."
    NO_POSTURE = 5, "The nominal robot has no more postures for the pose."


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedSolutions(Rebuilt):
    """Postures that bring a calibrated robot to the poses of one call.

    Parameters
    ----------
    solutions : IGMSolutions
        ``q (..., S, n)`` are what the joints must read; ``residual`` is that of the calibrated
        robot at these readings.
    actual : ndarray, shape (..., S, n)
        Variables of the calibrated table there, rad or m; NaN where there is no solution.
    nominal : ndarray, shape (..., C, n)
        Postures of the nominal robot from which they were found, rad or m; NaN where there are
        none.
    correction : ndarray of int8, shape (..., C)
        Codes of `CorrectionStatus`, one for each nominal posture.
    row : ndarray of int, shape (..., C)
        Which of the S rows a nominal posture became; -1 if none.

    References
    ----------
    Seed book section 1.4.6.

    Examples
    --------
    See `corrected_igm`.
    """

    solutions: IGMSolutions
    actual: Array
    nominal: Array
    correction: NDArray[np.int8]
    row: NDArray[np.int64]

    def __post_init__(self) -> None:
        for name, kind in (("actual", np.float64), ("nominal", np.float64),
                           ("correction", np.int8), ("row", np.int64)):  # fmt: skip
            object.__setattr__(self, name, read_only(getattr(self, name), kind))

    @property
    def q(self) -> Array:
        """Readings, shape (..., S, n), rad or m; NaN where there is no solution."""
        return self.solutions.q

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Whether a row is a solution, shape (..., S)."""
        return self.solutions.valid

    @property
    def residual(self) -> Array:
        """The larger of what is missing in metres and in radians, shape (..., S)."""
        return self.solutions.residual

    @property
    def within_limits(self) -> NDArray[np.bool_]:
        """Whether the readings of a solution are inside the limits, shape (..., S)."""
        return self.solutions.within_limits

    @property
    def status(self) -> NDArray[np.int8]:
        """Codes of `IGMStatus`, one for each pose."""
        return self.solutions.status

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of solutions of each pose."""
        return self.solutions.count

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """What became of one pose, in a sentence; see `IGMSolutions.reason`."""
        return self.solutions.reason(i)

    def nearest(self, q: ArrayLike) -> Array:
        """Readings of the solution nearest to a posture; see `IGMSolutions.nearest`."""
        return self.solutions.nearest(q)
