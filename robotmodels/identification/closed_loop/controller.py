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


@dataclass(frozen=True, slots=True, init=False, eq=False)
class Controller(Rebuilt):
    """A sampled controller of each joint. Read-only.

    ``tau = kp (q_ref - q) + kd (v_ref - v) + ki * integral(q_ref - q) + feed forward``, held over
    each period. The integral stops while the torque is at its limit.

    Parameters
    ----------
    kp, kd : array_like, scalar or shape (n,)
        Gains of position (N m/rad or N/m) and velocity.
    ki : array_like, scalar or shape (n,), optional
        Gain of the integral of the position error, per second; default none.
    limit : array_like, scalar or shape (n,), optional
        Largest torque, N m or N; default none.
    feed_forward : RobotModel, optional
        The robot whose torques on the references are added, its drives included.
    period : float, optional
        Seconds from one torque to the next; default that of the log.

    Raises
    ------
    ShapeError, InvalidValueError
        Arrays that do not fit each other, NaN, a limit or a period that is not positive.

    References
    ----------
    Seed book chapter 5 (position control); M. Gautier, A. Janot and P.-O. Vandanjon, "A new
    closed-loop output error method for parameter identification of robot dynamics", IEEE T-CST
    21(2), 2013, section II.

    Examples
    --------
    >>> Controller(kp=[100.0, 50.0], kd=[10.0, 5.0]).n
    2
    """

    kp: Array
    kd: Array
    ki: Array
    limit: Array
    feed_forward: RobotModel | None
    period: float | None

    def __init__(
        self,
        kp: ArrayLike,
        kd: ArrayLike,
        ki: ArrayLike = 0.0,
        limit: ArrayLike = np.inf,
        feed_forward: RobotModel | None = None,
        period: float | None = None,
    ) -> None:
        gains = {"kp": as_floats(kp, "kp"), "kd": as_floats(kd, "kd"), "ki": as_floats(ki, "ki")}
        gains["limit"] = as_reals(limit, "limit")
        lengths = {array.shape for array in gains.values() if array.ndim}
        if feed_forward is not None:
            lengths.add((feed_forward.n,))
        if len(lengths) != 1 or len(next(iter(lengths))) != 1:
            raise ShapeError(
                "kp, kd, ki, limit: expected numbers or arrays of one length (n,), at least one of "
                f"them an array, got {sorted(lengths)}."
            )
        if not (gains["limit"] > 0.0).all():
            raise InvalidValueError(f"limit: expected torques above 0, got {limit!r:.60}.")
        for name, array in gains.items():
            object.__setattr__(self, name, read_only(np.broadcast_to(array, next(iter(lengths)))))
        object.__setattr__(self, "feed_forward", feed_forward)
        seconds = None if period is None else _positive(period, "period")
        object.__setattr__(self, "period", seconds)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.kp.size


def tuned_controller(
    robot: RobotModel,
    q: ArrayLike,
    bandwidth: float,
    damping: float = 1.0,
    period: float = 1e-3,
    feed_forward: bool = True,
) -> Controller:
    """PD gains for a bandwidth (Hz) from the least inertia of each joint over postures q (N, n)."""
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
