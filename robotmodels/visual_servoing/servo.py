"""Simulation of visual servoing: a free camera, eye in hand, eye to hand.

A free camera without noise follows its law in continuous time (Runge-Kutta-Munthe-Kaas, order 4).
With a robot, noise or tracking the law is sampled: every velocity is held for one step.

Parameters
----------
task : Task or Hybrid
    The task, k components.
T0 : array_like, shape (4, 4)
    Pose of the object in the camera at the start.
camera : Camera, optional
    Whose image has to contain the object.
robot, q0 : RobotModel, and array_like of shape (n,), optional
    The robot that carries the camera or the object; its joint variables at the start, rad or m.
mounting : EyeInHand or EyeToHand, optional
    Default ``EyeInHand()``.
duration, step, noise : float
    Seconds; standard deviation of every component of the measurement, in its unit.
rng : Generator or int, optional
    Source of the noise, default 0.
target : array_like, shape (6,), or function of t -> (6,), optional
    Twist [v; w] of the object in its own axes.
tracking : TargetMotion, optional
    Estimates and compensates the motion of the target.
limits : JointBounds or bool
    Limits of the joints, see `ikm`, for the step of the simulation; True takes those of the robot.
T_tool_camera, T_world_camera : array_like, shape (4, 4), optional
    Pose of the camera in the tool or in the world, by default the identity.

Returns
-------
ServoMotion
    Poses, measurements, errors, velocities and the status.

References
----------
Book sections 6.2.2, 6.2.3, 6.3.2 to 6.3.4.

Examples
--------
>>> from robotmodels.se3 import rotation, translation
>>> from robotmodels.visual_servoing import Points
>>> square = Points([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]])
>>> start = translation(0.1, 0.0, 1.0) @ rotation("z", 0.5)
>>> run = servo(Task(square, translation(0, 0, 0.5), gain=1.0), start)
>>> run.status, bool(abs(run.error[-1]).max() < 1e-4)
(<ServoStatus.CONVERGES: 0>, True)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_number
from .._outcomes import Result
from ..errors import InvalidValueError
from ..kinematics import IKMStatus, JointBounds, dgm, ikm
from ..kinematics.singular.task import generator_of
from ..model import RobotModel, check_model
from ..se3 import as_pose, as_single_pose, inverse
from .camera import Camera
from .features import sight_of
from .results import Checked
from .tasks import Hybrid, TargetMotion, Task
from .velocity import ServoStatus, check_kinds, law, moved

_MOST = 1_000_000  # steps of a simulation
_MET = 1e-6  # error that counts as none


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EyeInHand(Checked):
    """A camera on the tool of a robot (section 6.2.2)."""

    T_tool_camera: Array = None  # type: ignore[assignment]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EyeToHand(Checked):
    """A camera fixed in the world that sees the object on the tool (section 6.2.3)."""

    T_world_camera: Array = None  # type: ignore[assignment]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ServoMotion(Result):
    """A simulated motion under visual servoing, N samples. Read-only.

    Times ``t`` (N,), s, which end early where the object is behind the camera or out of sight;
    ``T`` and ``cameras`` (N, 4, 4), poses of the object in the camera and of the camera in the
    world, which without a robot is the object at the start; joints ``q`` (N, n) or None;
    measurements ``s`` and ``error`` (N, k); ``velocity`` (N, 6) of the law; ``codes`` (N,)
    of `ServoStatus`; ``task`` and ``camera`` of the call.
    """

    task: Task | Hybrid
    t: Array
    T: Array
    cameras: Array
    q: Array | None
    s: Array
    error: Array
    velocity: Array
    codes: NDArray[np.int8]
    camera: Camera | None = None

    @property
    def status(self) -> ServoStatus:
        """Outcome at the end; STEADY_ERROR if an error stays although the law gives velocities."""
        size, middle = np.linalg.norm(self.error, axis=1), len(self.t) // 2
        k = max(1, (len(size) - middle) // 2)
        # the third and the last quarter: single samples of a noisy error differ at random
        before, after = (np.sqrt(np.mean(x**2)) for x in (size[middle:][:k], size[-k:]))
        rate = 0.1 * self.task.regulated.gain  # the law would reduce the error ten times as fast
        least = before * np.exp(-rate * (self.t[-k] - self.t[middle]))
        followed = self.codes[-1] == ServoStatus.CONVERGES and size[-1] > _MET
        stays = followed and after > max(_MET, least)
        return ServoStatus.STEADY_ERROR if stays else ServoStatus(int(self.codes[-1]))

    def reason(self, i: Any = ()) -> str:
        """Sentence of the status, with the errors at both ends."""
        first, last = np.abs(self.error[[0, -1]]).max(axis=1)
        sentence = "The law was followed to the end: no proof of convergence."
        sentence = self.status.sentence if self.status else sentence
        return f"{sentence} Largest error {first:.3g} at the start, {last:.3g} at the end."


def servo(
    task: Task | Hybrid,
    T0: ArrayLike,
    camera: Camera | None = None,
    robot: RobotModel | None = None,
    q0: ArrayLike | None = None,
    mounting: EyeInHand | EyeToHand | None = None,
    duration: float = 10.0,
    step: float = 0.02,
    noise: float = 0.0,
    rng: np.random.Generator | int | None = None,
    *,
    target: Callable[[float], ArrayLike] | ArrayLike | None = None,
    tracking: TargetMotion | None = None,
    limits: JointBounds | bool = True,
) -> ServoMotion:
    """Simulate visual servoing."""
    bounds = None if isinstance(limits, bool) else limits
    check_kinds(
        task,
        camera=(camera, Camera),
        tracking=(tracking, TargetMotion),
        limits=(bounds, JointBounds),
    )
    primary = task.regulated
    T = as_single_pose(as_pose(T0, "T0"), "T0")
    h, total = as_number(step, "step", above=0.0), as_number(duration, "duration", least=0.0)
    sigma = as_number(noise, "noise", least=0.0)
    if total > _MOST * h:
        raise InvalidValueError(f"step: {total:g} s in steps of {h:g} s are more than {_MOST}.")
    if robot is None and (q0 is not None or mounting is not None):
        raise InvalidValueError("robot: q0 and mounting need the robot that they belong to.")
    arm = None if robot is None else _Arm(robot, q0, mounting, h, limits)
    place = np.eye(4) if arm is None else arm.object_at(T)  # of the object in the world
    shift = np.eye(4)  # of the object in a step
    source = generator_of(rng)
    feature, sampled = primary.feature, arm is not None or sigma > 0.0 or tracking is not None
    estimate, own = None, np.zeros(feature.size)
    rows: list[Any] = []
    for k in range(int(np.floor(total / h + 1e-9)) + 1):
        sight = sight_of(feature, T)
        s = sight.s + sigma * source.normal(size=own.size) if sigma else None
        v, error, _, code, pseudo = law(task, s, T, camera, sight)
        s, lost = error + primary.s_desired, code >= ServoStatus.OUT_OF_SIGHT
        if tracking is not None and not lost:
            estimate = tracking.update(estimate, s, own, h) if estimate else tracking.start(s)
            v = v - pseudo @ estimate.rate
            own = primary.matrix(s, sight) @ v
        rows.append([k * h, T, place, None if arm is None else arm.q, s, error, v, code])
        if lost:
            break
        given: Any = target(k * h) if callable(target) else target
        if given is not None:
            shift = moved(np.eye(4), -h * as_exact(given, (6,), "target"))
        if arm is None:
            T = (moved(T, h * v) if sampled else _continued(task, T, v, h)) @ shift
            place = place @ shift
        else:
            T, place, met = arm.follow(v, T, place, shift)
            rows[-1][-1] = code if met else ServoStatus.LIMITED
    t, T, place, q, s, error, velocity, codes = map(np.array, zip(*rows, strict=True))
    joints, codes = None if arm is None else q, codes.astype(np.int8)
    return ServoMotion(task, t, T, place @ inverse(T), joints, s, error, velocity, codes, camera)


class _Arm:
    """The robot of a simulation; it carries the camera, or the object in view of a fixed camera."""

    def __init__(self, robot: Any, q0: Any, mounting: Any, h: float, limits: Any) -> None:
        check_model(robot)
        if q0 is None:
            raise InvalidValueError("q0: expected the joint variables of the robot at the start.")
        mounting = EyeInHand() if mounting is None else mounting
        if not isinstance(mounting, EyeInHand | EyeToHand):
            got = type(mounting).__name__
            raise InvalidValueError(f"mounting: expected EyeInHand or EyeToHand, got {got}.")
        self.model, self.h, self.q = robot, h, as_exact(q0, (robot.n,), "q0")
        bounds = replace(limits if isinstance(limits, JointBounds) else JointBounds(), step=h)
        self.limits = None if limits is False else bounds
        lower = robot.lower if bounds.lower is None else bounds.lower
        upper = robot.upper if bounds.upper is None else bounds.upper
        if self.limits is not None and not ((lower <= self.q) & (self.q <= upper)).all():
            raise InvalidValueError(f"q0: expected joints inside the limits, got {self.q}.")
        self.tool, self.mounting = dgm(robot, self.q), mounting

    def object_at(self, T: Array) -> Array:
        """Place of the object in the world, of a pose in the camera."""
        mounting = self.mounting
        if isinstance(mounting, EyeToHand):
            return mounting.T_world_camera @ T
        return self.tool @ mounting.T_tool_camera @ T

    def follow(self, v: Array, T: Array, place: Array, shift: Array) -> tuple[Array, Array, bool]:
        """Move for one step, the target by a shift: its pose and place, whether v was met."""
        camera = inverse(self.tool) @ place @ inverse(T)
        linear, angular = np.reshape(v, (2, 3)) @ camera[:3, :3].T
        twist = np.concatenate((linear + np.cross(camera[:3, 3], angular), angular))
        to_hand = isinstance(self.mounting, EyeToHand)
        twist = -twist if to_hand else twist  # the object moves in the other sense
        found = ikm(self.model, self.q, twist, reference="local", limits=self.limits)
        self.q = self.q + self.h * found.v
        before, self.tool = self.tool, dgm(self.model, self.q)
        place = (self.tool @ inverse(before) @ place if to_hand else place) @ shift
        T = inverse(self.object_at(np.eye(4))) @ place
        return T, place, bool(np.abs(v).max() < 1e-9 or found.status == IKMStatus.MET)


def _continued(task: Task | Hybrid, T: Array, v: Array, h: float) -> Array:
    """Pose after a step of the continuous law: order 4, by Runge-Kutta-Munthe-Kaas on poses."""

    def at(twist: Array) -> Array:
        return h * law(task, None, moved(T, twist))[0]

    a = h * v
    b = at(0.5 * a)
    c = at(0.5 * b + 0.125 * _bracket(a, b))
    d = at(c)
    return moved(T, (a + 2.0 * (b + c) + d + 0.5 * _bracket(a, d)) / 6.0)


def _bracket(a: Array, b: Array) -> Array:
    """Lie bracket of twists."""
    linear = np.cross(a[3:], b[:3]) - np.cross(b[3:], a[:3])
    return np.concatenate((linear, np.cross(a[3:], b[3:])))
