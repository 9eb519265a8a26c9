"""The result of an inverse kinematic model: joint velocities, and a status for each row."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ..._outcomes import Outcome, Result


class IKMStatus(Outcome):
    """Outcome of an inverse kinematic model for one row; fits int8.

    Joint velocities come with every status; the missing twist is the ``error`` of the result.

    Attributes
    ----------
    sentence : str
        The meaning of the code.
    """

    MET = 0, "The requested motion is achieved."
    IN_PART = (
        1, "Near a singular position: the components along nearly lost directions are damped.",
    )  # fmt: skip
    SINGULAR = 2, "Singular position: a component of the requested motion cannot be produced."
    TOO_FEW_JOINTS = (
        3, "Too few degrees of freedom: a component of the requested motion cannot be produced.",
    )  # fmt: skip
    LIMITED = 4, "Joint limits do not allow the requested motion: it is scaled down."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class IKMSolution(Result):
    """Joint velocities of twists, or joint accelerations. Read-only, picklable.

    The leading axes are those of the call. Six-vectors are linear then angular; rows that were
    not requested are zero. From `ikm_second_order` twists are accelerations, m/s^2 and rad/s^2.

    Parameters
    ----------
    v, a : ndarray, shape (..., n)
        Joint velocities, rad/s or m/s; accelerations, rad/s^2 or m/s^2, of the second order only,
        where ``v`` are the velocities that were given.
    status : ndarray of int8, shape (...)
        Codes of `IKMStatus`.
    achieved, error : ndarray, shape (..., 6)
        ``J v``, the part that was requested [m/s, rad/s], and the twist minus it.
    reachable : ndarray, shape (..., 6)
        The projection of the twist onto the range of J (metres and radians compared by the
        length): the part that joint velocities can produce.
    singular_values, rank : ndarray, shapes (..., k) and (...)
        Of the scaled Jacobian, rows of ``augmented`` included, descending, and the number of them
        above 1e-10 of its norm.
    damping, scale : ndarray, shape (...)
        Largest damping of any direction, and the part of the twist that is kept under limits.
    limited : ndarray of bool, shape (..., n)
        Joints that are at a limit of their velocity or acceleration.
    mask : ndarray of bool, shape (6,)
        Rows that were requested.
    task_errors : tuple of ndarray, shapes (..., m_i)
        The rates of the tasks minus those achieved: ``augmented`` in their order, then ``tasks``.
    task_scales : ndarray, shape (..., t)
        Part of the rates of ``tasks`` that is kept under limits.
    """

    v: Array
    status: NDArray[np.int8]
    achieved: Array
    error: Array
    reachable: Array
    singular_values: Array
    rank: NDArray[np.int8]
    damping: Array
    scale: Array
    limited: NDArray[np.bool_]
    mask: NDArray[np.bool_]
    task_errors: tuple[Array, ...]
    task_scales: Array
    a: Array | None = None
    outcomes = IKMStatus

    def __post_init__(self) -> None:
        """Arrays are read-only already."""

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Sentence of the status of row i (left out for a single one), with the twist missing."""
        status = self.outcome(i)
        if status is IKMStatus.MET:
            return status.sentence
        error = self.error[i if self.status.ndim else ()]
        per = "s" if self.a is None else "s^2"
        missing = [f"{hypot(*error[:3]):.4g} m/{per}"] * bool(self.mask[:3].any())
        missing += [f"{hypot(*error[3:]):.4g} rad/{per}"] * bool(self.mask[3:].any())
        return f"{status.sentence} The error is {' and '.join(missing)}."
