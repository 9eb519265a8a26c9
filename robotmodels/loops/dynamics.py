"""Dynamic models of looped robots: torques of the actuated joints, accelerations, closure forces.

With ``v = G v_a``, torques of the spanning tree do the work of ``G^T tau_tree`` at the actuated
joints; drives of passive joints, such as their friction, are among those of the tree.

Parameters
----------
robot : LoopedRobot
    The robot: n joints, n_a of them actuated, c constraint rows.
q, v, a : array_like, shape (..., n)
    Joint variables of all joints (rad or m), which close the loops, velocities, accelerations.
tau : array_like, shape (..., n_a)
    Torques (N m) or forces (N) of the actuated joints.
wrench : array_like, shape (..., 6), optional
    Wrench ``[f; m]`` of the tool of the tree on the environment, as for `robotmodels.idm`.
drive : bool
    Whether the drives of all joints take part.

Raises
------
ShapeError, InvalidValueError
    Arguments of the wrong length, or with NaN or infinity.
LoopError
    Loops that are open at q (which `ddm` does not check); actuated joints that do not determine the
    others; velocities that violate the closures (which `idm` does not check).
SingularMassMatrixError
    Free motions without inertia.

References
----------
W. Khalil and E. Dombre, *Modeling, Identification and Control of Robots*, chapter 10; seed book
section 1.5; J. Carpentier, R. Budhiraja and N. Mansard, "Proximal and sparse resolution of
constrained dynamic equations", RSS 2021, for the direct model.

Examples
--------
A parallelogram in a horizontal plane, driven by one of its cranks.

>>> from robotmodels import RobotModel, InertialParameters
>>> from robotmodels.geometry import DHTable
>>> from robotmodels.loops import Closure
>>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
>>> bars = InertialParameters.from_com(np.ones(5), np.zeros((5, 3)), [np.eye(3)] * 5)
>>> tree = RobotModel.from_table(table, bars)
>>> robot = LoopedRobot(tree, [Closure("cut", (4, 5))], actuated=[0])
>>> q, v = [1.0, 1.0, -1.0], np.zeros(3)
>>> a = ddm(robot, q, v, [2.0])
>>> (a / a[0]).round(9), idm(robot, q, v, a).round(9), closure_forces(robot, q, v, [2.0]).shape
(array([ 1.,  1., -1.]), array([2.]), (5,))
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import dynamics
from .._arrays import Array, as_vector
from ..drive import check_all_or_none
from ..dynamics.inverse import wrench_torque
from ..errors import LoopError
from .constraints import checked, closure_rows, maps
from .engine import accelerations, engine_of
from .robot import LoopedRobot, check_looped

_OPEN = 1e-3  # largest residual of closed loops, relative to the robot's size, or rad


def idm(
    robot: LoopedRobot,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
) -> Array:
    """Inverse dynamic model: torques of the actuated joints, ``G^T tau_tree``.

    Returns
    -------
    ndarray, shape (..., n_a)
        Torques (N m) or forces (N).
    """
    q, v, a = checked(robot, q=q, v=v, a=a)
    G = maps(robot, closed(robot, q))[0]
    tau = dynamics.idm(robot.tree, q, v, a, wrench=wrench, drive=drive)
    return np.einsum("...ij,...i->...j", G, tau)


def ddm(
    robot: LoopedRobot,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
) -> Array:
    """Direct dynamic model: accelerations of all joints, the inverse of `idm`.

    Dead points of the actuated joints are no obstacle.

    Returns
    -------
    ndarray, shape (..., n)
        Accelerations, rad/s^2 or m/s^2.
    """
    quick = getattr(getattr(robot, "scratch", None), "quick", None)
    if quick is not None and drive is True and wrench is None:
        a = quick(q, v, tau)
        if a is not None:
            return a
    check_looped(robot)
    q, v = as_vector(q, robot.n, "q"), as_vector(v, robot.n, "v")
    tau = as_vector(tau, len(robot.actuated), "tau")
    full = tree_torques(robot, q, v, tau, wrench, drive)
    return accelerations(engine_of(robot, drive), q, v, full)


def closure_forces(
    robot: LoopedRobot,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
) -> Array:
    """Forces f of the closures: ``tau_tree(q, v, a) = tau + J^T f`` with J of `closure_jacobian`.

    Force and moment of the first frame of each closure on the second, at the second's origin, in
    the axes of the first. Of redundant rows they are not determined: the shortest vector is given.

    Returns
    -------
    ndarray, shape (..., c)
        In the order of ``robot.rows``, N and N m.
    """
    a = ddm(robot, q, v, tau, wrench, drive)
    q, v = checked(robot, q=q, v=v)
    given = tree_torques(robot, q, v, as_vector(tau, len(robot.actuated), "tau"), wrench, drive)
    drives = robot.tree.drive_matrices if drive else None
    rotors = 0.0 if drives is None else a @ drives.rotor
    J = np.sqrt(robot.cuts.weight)[:, None] * closure_rows(robot, q)[1] * robot.units
    missing = (dynamics.idm(robot.tree, q, v, a, drive=False) + rotors - given) * robot.units
    inverse = np.linalg.pinv(J, rcond=1e-8)
    return np.einsum("...jk,...j->...k", inverse, missing) * np.sqrt(robot.cuts.weight)


def tree_torques(
    robot: LoopedRobot, q: Array, v: Array, tau: Array, wrench: ArrayLike | None, drive: bool
) -> Array:
    """Torques on the bodies of all joints (..., n): actuators less friction, offsets and wrench."""
    if not (drive is True or drive is False):
        check_all_or_none(drive)
    full = np.zeros((*tau.shape[:-1], robot.n))
    full[..., robot.actuated] = tau
    if drive and (drives := robot.tree.drive_matrices) is not None:
        full = full - drives.torque(v, None)
    if wrench is not None:
        full = full - wrench_torque(robot.tree, q, as_vector(wrench, 6, "wrench"))
    return full


def closed(robot: LoopedRobot, q: Array) -> Array:
    """The same posture, refused where a loop is open."""
    residual = np.abs(closure_rows(robot, q)[0] * np.sqrt(robot.cuts.weight))
    residual = residual.reshape(int(np.prod(q.shape[:-1])), len(robot.rows))
    for i in np.flatnonzero((residual > _OPEN).any(axis=-1))[:1]:
        row = robot.rows[int(np.argmax(residual[i]))]
        where = f" of sample {i}" if q.ndim > 1 else ""
        raise LoopError(
            f"q: the loops of {robot.name!r} are open in the posture{where}: {row} is off by "
            f"{residual[i].max():.3g} of the robot's size, or rad. Close them: "
            "close(robot, q_actuated, q_guess).q."
        )
    return q
