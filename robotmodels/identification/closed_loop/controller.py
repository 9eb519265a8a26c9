"""Controllers of the joints, which make a simulated robot follow the references of a log."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_floats, as_reals, read_only
from ...dynamics import mass_matrix
from ...errors import InertiaError, InvalidValueError, ShapeError
from ...model import RobotModel

_SAMPLED = 0.25
"""Largest velocity loop rate relative to the sampling rate."""
_POSTURES = 200
"""Largest number of postures for mass matrices."""


@dataclass(frozen=True, slots=True, eq=False)
class Controller(Rebuilt):
    """A sampled controller of each joint. Read-only.

    ``tau = kp (q_ref - q) + kd (v_ref - v) + ki * integral(q_ref - q) + feed forward``, held over
    each period. The integral stops while the torque is at its limit.

    Parameters
    ----------
    kp, kd, ki : array_like, scalar or shape (n,)
        Gains of position (N m/rad or N/m), velocity, and the integral of the position error (per
        second, default none); at least one of the arrays has shape (n,).
    limit : array_like, scalar or shape (n,), optional
        Largest torque, N m or N; default none.
    feed_forward : RobotModel, optional
        The robot whose torques on the references are added, its drives included.
    period : float, optional
        Seconds from one torque to the next; default that of the log.

    References
    ----------
    Seed book chapter 5 (position control).

    Examples
    --------
    >>> Controller(kp=[100.0, 50.0], kd=[10.0, 5.0]).n
    2
    """

    kp: Array
    kd: Array
    ki: ArrayLike = 0.0
    limit: ArrayLike = np.inf
    feed_forward: RobotModel | None = None
    period: float | None = None

    def __post_init__(self) -> None:
        gains = {name: as_floats(getattr(self, name), name) for name in ("kp", "kd", "ki")}
        gains["limit"] = as_reals(self.limit, "limit")
        shapes = {array.shape for array in gains.values() if array.ndim}
        if self.feed_forward is not None:
            shapes.add((self.feed_forward.n,))
        if len(shapes) != 1 or len(shape := shapes.pop()) != 1:
            raise ShapeError(
                "kp, kd, ki, limit: expected numbers or arrays of one length (n,), at least one of "
                f"them an array, got shapes {[array.shape for array in gains.values()]}."
            )
        if not (gains["limit"] > 0.0).all():
            raise InvalidValueError(f"limit: expected torques above 0, got {self.limit!r:.60}.")
        for name, array in gains.items():
            object.__setattr__(self, name, read_only(np.broadcast_to(array, shape)))
        if self.period is not None:
            object.__setattr__(self, "period", _positive(self.period, "period"))

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(np.asarray(self.kp))


def tuned_controller(
    robot: RobotModel,
    q: ArrayLike,
    bandwidth: float,
    damping: float = 1.0,
    period: float = 1e-3,
    feed_forward: bool = True,
) -> Controller:
    """PD gains for a bandwidth, from the least inertia of each joint over postures.

    Parameters
    ----------
    robot : RobotModel
        The robot, which is also the feed-forward model.
    q : array_like, shape (N, n)
        Postures.
    bandwidth, damping, period : float
        Hz (less where the velocity loop would be too fast for the period), damping ratio, and
        seconds from one torque to the next.
    feed_forward : bool
        Whether the torques of the robot on the references are added.

    Returns
    -------
    Controller
        Without integral and limit.

    Raises
    ------
    InertiaError, InvalidValueError
        A mass matrix that is not positive definite; a number that is not positive.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> tuned_controller(load("rx90"), [[0.0] * 6], bandwidth=8.0).n
    6
    """
    w, damping = 2.0 * np.pi * _positive(bandwidth, "bandwidth"), _positive(damping, "damping")
    inverse = inverse_masses(robot, as_floats(q, "q"))
    if inverse is None:
        raise InertiaError(
            f"robot: the mass matrix of {robot.name!r} is not positive definite in these postures; "
            "give parameters of a robot that moves inertia in every joint."
        )
    J = 1.0 / np.diagonal(inverse, axis1=1, axis2=2).max(axis=0)
    # largest coupled velocity loop rate, per unit of 2 damping w
    fastest = float(np.abs(np.linalg.eigvals(inverse * J)).max())
    w = min(w, _SAMPLED / (damping * fastest * _positive(period, "period")))
    return Controller(J * w**2, 2.0 * damping * w * J, feed_forward=robot if feed_forward else None)


def _positive(value: float, name: str) -> float:
    if not float(as_floats(value, name)) > 0.0:
        raise InvalidValueError(f"{name}: expected a number above 0, got {value!r:.60}.")
    return float(value)


def inverse_masses(robot: RobotModel, q: Array) -> Array | None:
    """Inverses of the mass matrices, or None where one is not positive definite.

    Shapes: q (N, n) -> (k, n, n).
    """
    M = mass_matrix(robot, q[:: max(1, len(q) // _POSTURES)])
    size = np.sqrt(np.maximum(np.abs(np.diagonal(M, axis1=1, axis2=2)), 1e-300))
    scale = size[:, :, None] * size[:, None, :]
    if not (np.linalg.eigvalsh(M / scale)[:, 0] > 1e-12).all():
        return None
    return np.linalg.inv(M / scale) / scale
