"""Inverse static model: the wrench that joint torques hold in equilibrium."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_exact, as_vector, batch_shape, read_only
from .._outcomes import Outcome
from ..errors import InvalidValueError, ShapeError
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model
from .jacobians import Reference, jacobian
from .lengths import length_of
from .statics import weight_torque

_EPS = float(np.finfo(np.float64).eps)


class StaticStatus(Outcome):
    """What joint torques say about the wrench they hold; fits int8.

    Attributes
    ----------
    sentence : str
        What a person reads.

    Examples
    --------
    >>> StaticStatus(2).sentence
    'No wrench balances the torques: the residual would move joints while the tool rests.'
    """

    DETERMINED = 0, "One wrench balances the torques."
    UNDETERMINED = (
        1, "Many wrenches balance the torques, as the structure carries some alone; the smallest.",
    )  # fmt: skip
    UNBALANCED = (
        2, "No wrench balances the torques: the residual would move joints while the tool rests.",
    )  # fmt: skip
    UNBALANCED_UNDETERMINED = (
        3, "No wrench balances the residual, which would move joints while the tool rests; many "
        "balance the other torques, as the structure carries some alone; the smallest.",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class StaticWrench(Rebuilt):
    """The wrench that joint torques hold, and what they leave open. Read-only.

    Parameters
    ----------
    wrench : ndarray, shape (..., 6)
        Force and moment ``[f; m]`` (N, N m) exerted on the environment: of all that come nearest to
        the torques the smallest.
    status : ndarray of int8, shape (...)
        Codes of `StaticStatus`.
    undetermined : ndarray of int64, shape (...)
        Number k of independent wrenches that need no torque at all: 6 minus the rank of J.
    directions : ndarray, shape (..., 6, 6)
        Its first k rows are such wrenches (N, N m), the others are zero; any multiple of them may
        be added to the wrench. They are orthonormal once moments are divided by the length.
    residual : ndarray, shape (..., n)
        Part of the torques that no wrench balances (N m, N).

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> pendulum = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> found = static_wrench(pendulum, [0.0], [2.0])
    >>> found.wrench[5], int(found.undetermined)
    (np.float64(2.0), 5)
    """

    wrench: Array
    status: NDArray[np.int8]
    undetermined: NDArray[np.int64]
    directions: Array
    residual: Array

    def __post_init__(self) -> None:
        *batch, n = np.shape(self.residual)
        shapes = {
            "wrench": (np.float64, (*batch, 6)),
            "status": (np.int8, tuple(batch)),
            "undetermined": (np.int64, tuple(batch)),
            "directions": (np.float64, (*batch, 6, 6)),
            "residual": (np.float64, (*batch, n)),
        }
        for name, (dtype, shape) in shapes.items():
            array = read_only(getattr(self, name), dtype)
            if array.shape != shape:
                raise ShapeError(f"{name}: expected shape {shape}, got {array.shape}.")
            object.__setattr__(self, name, array)

    def reason(self, index: int | tuple[int, ...] = ()) -> str:
        """The sentence of one row's status.

        Parameters
        ----------
        index : int or tuple of int
            Of the row; ``()`` for a single one.

        Returns
        -------
        str
            What a person reads.
        """
        return StaticStatus(int(self.status[index])).sentence


def static_wrench(
    model: RobotModel,
    q: ArrayLike,
    tau: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
    gravity: bool = False,
    length: float | None = None,
    tolerance: float = 1e-9,
) -> StaticWrench:
    """Wrench on the environment that joint torques hold in equilibrium, the inverse static model.

    It solves ``J^T w = tau``. Where J has less than six independent rows, some wrenches need no
    torque, because the structure carries them; where the robot can move while the frame rests,
    some torques are balanced by no wrench. Both are reported row by row.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, tau : array_like, shape (..., n)
        Joint variables (rad or m) and torques (N m or N); the leading axes broadcast.
    frame : str or int, optional
        Name or number of the frame that exerts the wrench; default the tool.
    reference : {"world_aligned", "local", "world"}
        Where the wrench is taken and in which axes, as in `static_torque`.
    gravity : bool
        Whether ``tau`` holds the links against gravity too. Drive friction is never taken off.
    length : float, optional
        Metres that make forces comparable with moments, ``[f; m / length]``, and forces of
        prismatic joints with torques: they decide which wrench is the smallest. Default the
        reach of the frame, `characteristic_length`, as in `jacobian_rank`.
    tolerance : float
        Singular values of the dimensionless Jacobian below this part of the largest count as
        zero; a residual below this part of the torques, or what rounding leaves, as balanced.

    Returns
    -------
    StaticWrench
        The wrench, its status, what is not determined and what is not balanced.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity; a length that is not positive; a
        tolerance outside of (0, 1).
    FrameNotFoundError
        No such frame.

    References
    ----------
    Khalil and Dombre, sections 5.8.1 (singular value decomposition) and 5.9.

    Examples
    --------
    Stretched out, a planar arm carries any force along itself without torque.

    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.se3 import translation
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]),
    ...                             tool=translation(0.2, 0, 0))
    >>> found = static_wrench(arm, [0.0, 0.0], [5.0, 2.0])
    >>> found.wrench[[1, 5]].round(9), found.status == StaticStatus.UNDETERMINED
    (array([10., 0.]), np.True_)
    """
    check_model(model)
    n = model.n
    q, tau = as_vector(q, n, "q"), as_vector(tau, n, "tau")
    batch = batch_shape((q, tau), ("q", "tau"))
    L = length_of(model, frame, length)
    threshold = as_tolerance(tolerance)
    weight = weight_torque(model, q) if gravity else np.zeros(n)
    # All in N m: joint forces times the length, forces times the length
    joints = np.where(model.table.sigma[model.table.joint_rows] == PRISMATIC, L, 1.0)
    rows = np.repeat((1.0 / L, 1.0), 3)
    J = rows[:, None] * jacobian(model, q, frame, reference) * joints
    asked = np.broadcast_to(joints * (tau - weight), (*batch, n))
    J = np.broadcast_to(J, (*batch, 6, n))
    # at least six columns, so that U is complete and every row has six singular values
    padded = np.concatenate((J, np.zeros((*batch, 6, max(6 - n, 0)))), axis=-1)
    U, s, Vt = np.linalg.svd(padded, full_matrices=False)
    kept = s > threshold * s[..., :1]
    along = np.where(kept, np.einsum("...ki,...i->...k", Vt[..., :n], asked), 0.0)
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=kept)
    wrench = np.einsum("...ik,...k->...i", U, inverse * along) * rows
    balanced = np.einsum("...ki,...k->...i", Vt[..., :n], along)
    rank = kept.sum(axis=-1)
    # free wrenches first; moments come back with the length, so that [f; m / length] is the norm
    carried = np.where(kept[..., None, :], 0.0, U)[..., ::-1] * (L * rows)[:, None]
    residual = asked - balanced
    least = np.min(np.where(kept, s, np.inf), axis=-1, initial=np.inf)
    condition = np.where(rank > 0, s[..., 0] / least, 0.0)
    allowed = np.maximum(threshold, 16 * n * _EPS * np.maximum(condition, 1.0))
    # torques that only hold the weight leave no more than rounding of it
    size = np.linalg.norm(joints * tau, axis=-1) + np.linalg.norm(joints * weight, axis=-1)
    unbalanced = np.linalg.norm(residual, axis=-1) > allowed * size
    status = (rank < 6).astype(np.int8) + 2 * unbalanced.astype(np.int8)
    return StaticWrench(
        wrench, status, 6 - rank, np.swapaxes(carried, -1, -2) + 0.0, residual / joints
    )


def as_tolerance(value: float) -> float:
    """Check a relative tolerance: a number in (0, 1)."""
    tolerance = float(as_exact(value, (), "tolerance"))
    if not 0 < tolerance < 1:
        raise InvalidValueError(f"tolerance: expected a number between 0 and 1, got {tolerance:g}.")
    return tolerance
