"""Controllers of the joints: what makes a simulated robot follow the references of a log."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_exact, as_floats, as_reals, read_only
from ...errors import InertiaError, InvalidValueError, ShapeError
from ...model import RobotModel

_SAMPLED = 0.25
"""Largest rate at which the sampled velocity loop may act, in its sampling rates."""
_POSTURES = 200
"""Postures of a log that inertia is looked at in."""


@dataclass(frozen=True, slots=True, init=False, eq=False)
class Controller(Rebuilt):
    """A sampled controller of each joint. Read-only.

    ``tau = kp (q_ref - q) + kd (v_ref - v) + ki * integral(q_ref - q) + feed forward``, held over
    each period. Where the torque is at its limit the integral rests.

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
                "kp, kd, ki, limit: expected numbers or arrays of one length (n,), one of them "
                f"given joint by joint, got {sorted(lengths)}."
            )
        if not (gains["limit"] > 0.0).all():
            raise InvalidValueError(f"limit: expected torques above 0, got {limit!r:.60}.")
        for name, array in gains.items():
            whole = np.broadcast_to(array, next(iter(lengths)))
            object.__setattr__(self, name, read_only(whole))
        if period is not None and not float(as_floats(period, "period")) > 0.0:
            raise InvalidValueError(f"period: expected seconds above 0, got {period!r:.60}.")
        object.__setattr__(self, "feed_forward", feed_forward)
        object.__setattr__(self, "period", None if period is None else float(period))

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
    """Proportional and derivative gains for a bandwidth, from the inertia of each joint.

    A joint's inertia is that which it shows while the others are free, ``1 / (M^-1)_jj``, the least
    over the postures: whatever the other joints do, the loop is then no faster than asked. The
    bandwidth is lowered where the sampling period does not allow it.

    Parameters
    ----------
    robot : RobotModel
        The robot, its rotors included.
    q : array_like, shape (N, n)
        Postures; 200 of them are looked at.
    bandwidth : float
        Of the position loop, Hz.
    damping : float
        Of the loop, 1 for no overshoot.
    period : float
        Sampling period of the controller, seconds.
    feed_forward : bool
        Whether the robot's torques on the references are added.

    Returns
    -------
    Controller
        ``kp = J w^2`` and ``kd = 2 damping J w``.

    Raises
    ------
    InertiaError
        A mass matrix that is not positive definite.
    InvalidValueError
        A bandwidth, damping or period that is not positive.

    References
    ----------
    Seed book chapter 5; A. Janot, P.-O. Vandanjon and M. Gautier, "A generic instrumental variable
    approach for industrial robot identification", IEEE T-CST 22(1), 2014, section III (gains that
    follow the parameters).

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> tuned_controller(load("rx90"), np.zeros((1, 6)), bandwidth=5.0).kp.shape
    (6,)
    """
    for name, value in (("bandwidth", bandwidth), ("damping", damping), ("period", period)):
        if not float(as_floats(value, name)) > 0.0:
            raise InvalidValueError(f"{name}: expected a number above 0, got {value!r:.60}.")
    inverse = inverse_masses(robot, as_floats(q, "q"))
    if inverse is None:
        raise InertiaError(
            f"robot: the mass matrix of {robot.name!r} is not positive definite in these postures; "
            "give parameters of a robot that moves inertia in every joint."
        )
    J = 1.0 / np.diagonal(inverse, axis1=1, axis2=2).max(axis=0)
    # rates of the velocity loops together, per unit of 2 damping w
    fastest = float(np.abs(np.linalg.eigvals(inverse * J)).max())
    w = min(2.0 * np.pi * bandwidth, _SAMPLED / (damping * fastest * period))
    return Controller(J * w**2, 2.0 * damping * w * J, feed_forward=robot if feed_forward else None)


def inverse_masses(robot: RobotModel, q: Array) -> Array | None:
    """Inverses of the mass matrices, rotors included, or None where one is not definite.

    Shapes: q (N, n) -> (k, n, n).
    """
    from ...kernels.mass_matrix import mass_matrices

    rows = as_exact(q, (len(q), robot.n), "q")[:: max(1, len(q) // _POSTURES)]
    M = np.empty((len(rows), robot.n, robot.n))
    mass_matrices(np.ascontiguousarray(rows), *robot.chain, robot.inertia.values, M)
    if (drives := robot.drive_matrices) is not None:
        M += drives.rotor
    diagonal = np.diagonal(M, axis1=1, axis2=2)
    if not (diagonal > 0.0).all():
        return None
    size = np.sqrt(diagonal)
    scaled = M / size[:, :, None] / size[:, None, :]
    if not (np.linalg.eigvalsh(scaled)[:, 0] > 1e-12).all():
        return None
    return np.linalg.inv(scaled) / size[:, :, None] / size[:, None, :]
