"""Statuses of configurations in batch: regular, near singular, singular."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Rebuilt, as_vector, read_only
from ..._outcomes import Outcome
from ...model import RobotModel
from .frames import frame_words
from .rank import TOLERANCE, operational_dimension, task_rank
from .task import MaskAxes, above_zero, counting_lines, deciding_mask, singular_task


class SingularityStatus(Outcome):
    """What a configuration is; fits int8.

    Attributes
    ----------
    sentence : str
        What a person reads.

    Examples
    --------
    >>> SingularityStatus.SINGULAR.sentence
    'Singular: the robot has lost freedoms.'
    """

    REGULAR = 0, "Regular: all freedoms of the robot are there."
    NEAR_SINGULAR = 1, "Near a singular configuration: one freedom is weak."
    SINGULAR = 2, "Singular: the robot has lost freedoms."


@dataclass(frozen=True, slots=True, eq=False)
class SingularityFlags(Rebuilt):
    """Statuses of the configurations of one call. Read-only.

    Parameters
    ----------
    status : ndarray of int8, shape (...)
        Codes of `SingularityStatus`.
    rank : ndarray of int, shape (...)
        Local number of degrees of freedom.
    order : ndarray of int, shape (...)
        Order of the singularity, ``M - rank``.
    weakest : ndarray, shape (...)
        The M-th singular value over the first: how far from singular, no unit.
    dimension : int
        M, the global number of degrees of freedom.
    mask : ndarray of bool, shape (6,)
        Components that count.
    frame : str
        What the frame is called, such as ``"the tool"``.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> singularity_flags(load("rx90"), np.zeros((2, 6))).order
    array([1, 1])
    """

    status: NDArray[np.int8]
    rank: NDArray[np.int64]
    order: NDArray[np.int64]
    weakest: Array
    dimension: int
    mask: NDArray[np.bool_]
    frame: str

    def __repr__(self) -> str:
        counts = ", ".join(
            f"{int((self.status == s).sum())} {s.name.lower().replace('_', ' ')}"
            for s in SingularityStatus
        )
        what = "".join(f"; {line}" for line in counting_lines(self.mask, self.frame))
        return f"<SingularityFlags {self.status.shape}: {counts}; dimension {self.dimension}{what}>"

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """What one configuration is, in a sentence.

        Parameters
        ----------
        i : int or tuple of int
            Which; left out for a single one.

        Returns
        -------
        str
            The sentence of its status.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> singularity_flags(load("rx90"), np.zeros(6)).reason()
        'Singular: the robot has lost freedoms.'
        """
        return SingularityStatus(int(self.status[i])).sentence


def singularity_flags(
    model: RobotModel,
    q: ArrayLike,
    frame: str | int | None = None,
    length: float | None = None,
    tolerance: float = TOLERANCE,
    near: float = 1e-2,
    mask: ArrayLike | None = None,
    mask_axes: MaskAxes = "world",
) -> SingularityFlags:
    """Status of configurations in batch: regular, near singular, singular.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Configurations, rad or m.
    frame, length, tolerance, near, mask, mask_axes
        As `classify_singularity`.

    Returns
    -------
    SingularityFlags
        Status, rank, order and measure of each.

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        As `classify_singularity`.

    References
    ----------
    Seed book section 1.3.1.4.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> q = [[0.1, 0.2, 0.3, 0.4, x, 0.6] for x in (0.5, 1e-3, 0.0)]
    >>> singularity_flags(load("rx90"), q).status
    array([0, 1, 2], dtype=int8)
    """
    mask = deciding_mask(model, frame, mask)
    task = singular_task(model, frame, mask, mask_axes, length)
    q = as_vector(q, model.n, "q")
    tolerance, near = above_zero(tolerance, "tolerance"), above_zero(near, "near")
    whole = operational_dimension(model, frame, None, task.length, TOLERANCE, mask, mask_axes)
    M = whole.dimension
    found = task_rank(task, q, tolerance)
    rank = np.minimum(found.rank, M)
    sigma = found.singular_values
    weakest = np.zeros(rank.shape)
    if M:
        top = sigma[..., 0]
        weakest = np.divide(sigma[..., M - 1], top, out=weakest, where=top > 0.0)
    status = np.where(rank < M, SingularityStatus.SINGULAR, SingularityStatus.REGULAR)
    status = np.where(
        (rank == M) & (weakest < near) & (M > 0), SingularityStatus.NEAR_SINGULAR, status
    )
    return SingularityFlags(
        status=read_only(status, np.int8),
        rank=read_only(rank, np.int64),
        order=read_only(M - rank, np.int64),
        weakest=read_only(weakest),
        dimension=M,
        mask=task.mask,
        frame=frame_words(frame),
    )
