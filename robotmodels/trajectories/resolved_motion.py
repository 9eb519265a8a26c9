"""Following poses by joint velocities: the inverse kinematic model, step after step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact
from .._choices import as_instance
from ..errors import InvalidValueError
from ..kinematics.inverse.bounds import JointBounds
from ..kinematics.inverse.ikm import ikm
from ..kinematics.inverse.methods import InverseMethod
from ..kinematics.inverse.solution import IKMSolution
from ..kinematics.inverse.solver import Secondary
from ..kinematics.inverse.tasks import Task
from ..kinematics.poses import dgm
from ..model import RobotModel, check_model
from ..se3.orientation import rotation_vectors_of
from .limits import ROUNDING, least_shown
from .pose_trajectory import PoseTrajectory
from .trajectory import Sampled

_MOVE, _TURN = slice(0, 3), slice(3, 6)


@dataclass(frozen=True, slots=True, eq=False)
class ResolvedMotion(Sampled):
    """Joints that follow a trajectory of poses by their velocities.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Times, s.
    q, v : ndarray, shape (N, n)
        Postures, rad or m, and velocities from each time to the next, per s.
    status : ndarray of int8, shape (N,)
        Codes of `IKMStatus`.
    position_error, orientation_error : ndarray, shape (N,)
        Errors of the tool in the requested components, m and rad.
    """

    t: Array
    q: Array
    v: Array
    status: NDArray[np.int8]
    position_error: Array
    orientation_error: Array


def resolved_motion(
    model: RobotModel,
    poses: PoseTrajectory,
    q_start: ArrayLike,
    samples: int = 400,
    feedback: float = 10.0,
    mask: ArrayLike | None = None,
    method: InverseMethod | None = None,
    joint_weights: ArrayLike | None = None,
    secondary: Secondary | None = None,
    augmented: Sequence[Task] = (),
    tasks: Sequence[Task] = (),
    limits: JointBounds | bool | None = None,
) -> ResolvedMotion:
    """Follow a trajectory of the tool by joint velocities.

    Also called resolved motion rate control, closed-loop inverse kinematics, ``rrmc``. Each step
    takes the velocity of `ikm` half a step ahead plus ``feedback`` times the error of the tool,
    which decreases with the square of the step. With ``limits`` it is taken where the joints are,
    so that no bound is passed, and the error decreases with the step.

    Parameters
    ----------
    poses : PoseTrajectory
        A motion of the tool: `straight_line`, `circle` ...
    q_start : array_like, shape (n,)
        Posture to begin with, rad or m; it need not be on the trajectory.
    samples : int
        Postures, from the start to the end.
    feedback : float
        Rate at which errors die out, 1/s; at most one over the time of a step.
    mask, method, joint_weights, secondary, augmented, tasks, limits
        As in `ikm`, world axes; the step of the limits is that of the motion.

    References
    ----------
    Book section 1.3.2; D. E. Whitney, "Resolved motion rate control of manipulators and human
    prostheses", IEEE Trans. Man-Machine Systems 10(2), 1969.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.trajectories import straight_line
    >>> arm, q = load("panda"), np.array([0.1, -0.3, 0.2, -2.0, 0.1, 1.8, 0.5])
    >>> start = dgm(arm, q)
    >>> goal = start + np.eye(4, k=3) * 0.1  # 0.1 m along x
    >>> motion = resolved_motion(arm, straight_line(start, goal, duration=2.0), q)
    >>> bool(motion.position_error.max() < 1e-5)
    True
    """
    check_model(model)
    as_instance(poses, PoseTrajectory, "poses", " (joint_path follows arrays of poses)")
    q = np.array(as_exact(q_start, (model.n,), "q_start"))
    if samples < 2:
        raise InvalidValueError(f"samples: expected at least 2, got {samples}.")
    t = np.linspace(0.0, float(poses.duration), samples)
    step = float(t[1])
    if not 0.0 <= feedback * step <= 1.0 + ROUNDING:
        fastest = least_shown(-1.0 / step, 4)[1:] if step > 0 else "infinity"
        raise InvalidValueError(
            f"feedback: expected between 0 and {fastest} 1/s, one over the step of {step:.4g} s, "
            f"got {feedback}; take more samples, or a smaller feedback."
        )
    bounds = _bounds_of_steps(limits, step)
    requested = np.ones(6) if mask is None else np.asarray(mask, dtype=np.float64)
    goals, twists, halfway = poses.pose(t), poses.twist(t), poses.twist(t[:-1] + 0.5 * step)

    def asked_of(posture: Array, twist: Array) -> IKMSolution:
        return ikm(
            model, posture, twist, None, "world_aligned", mask, method, joint_weights, None,
            secondary, augmented, tasks, bounds,
        )  # fmt: skip

    Q, V = np.empty((samples, model.n)), np.empty((samples, model.n))
    status, behind = np.zeros(samples, dtype=np.int8), np.empty((samples, 6))
    for k in range(samples):
        Q[k], behind[k] = q, _behind(goals[k], dgm(model, q))
        if k == samples - 1:
            break
        posture = q
        if bounds is None:
            posture = q + 0.5 * step * asked_of(q, twists[k] + feedback * behind[k]).v
        found = asked_of(posture, halfway[k] + feedback * behind[k])
        V[k], status[k] = found.v, found.status
        q = q + step * found.v
    V[-1], status[-1] = V[-2], status[-2]
    errors = (np.linalg.norm((behind * requested)[:, part], axis=1) for part in (_MOVE, _TURN))
    return ResolvedMotion(t, Q, V, status, *errors)


def _bounds_of_steps(limits: JointBounds | bool | None, step: float) -> JointBounds | None:
    """The bounds for joints that keep a velocity for one step of the motion."""
    if limits is None or limits is False:
        return None
    bounds = JointBounds() if limits is True else as_instance(limits, JointBounds, "limits")
    if bounds.step is not None and bounds.step < step * (1.0 - 1e-9):
        raise InvalidValueError(
            f"limits: their step of {bounds.step:.4g} s is shorter than that of the motion, "
            f"{step:.4g} s, in which joints could pass a limit; leave it out, or take more samples."
        )
    return replace(bounds, step=step) if bounds.step is None else bounds


def _behind(goal: Array, now: Array) -> Array:
    """Translation and rotation vector from where the tool is to where it should be."""
    turn = rotation_vectors_of(goal[:3, :3] @ now[:3, :3].T)
    return np.concatenate((goal[:3, 3] - now[:3, 3], turn))
