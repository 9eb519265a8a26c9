"""Tasks: regulation of a feature with an interaction matrix, tracking of a target (section 6.3).

The rate of s by a moving target is ``(s_k - s_{k-1}) / step - L [v; w]``.

Parameters
----------
feature : Points, Lines, Segments, Circle, Sphere, Cylinder, Moments, PoseError, ...
    Feature of k components.
desired : array_like, shape (k,) or (4, 4)
    Desired measurement s*, or the desired pose of the object in the camera, which is also the
    reference of `PoseError` and `PointAndRotation`.
gain : float
    Above 0, 1/s.
interaction : {"current", "desired", "mean"}
    Matrix of the law; "mean" is half the sum of the pseudo-inverses of the other two.
depth : {"true", "desired"} or float
    Of the object in the current matrix: of its pose, of the desired pose, or of an object parallel
    to the image at this depth, m; of a sphere the depth of its centre.
points : array_like, shape (k, 3) or (3,)
    Points of the object, m; the first is the reference point.
primary, secondary, weight : Task; Task, array_like (6,) or function (4, 4) -> (6,); float
    The task that is kept; another task, a constant twist of the camera in its own axes, or a
    function of the pose of the object, such as minus the gradient of a cost; and its weight.
kalman, process, noise : bool, float, float
    Whether a Kalman filter with constant slope filters the differences; standard deviations: of
    the change of the slope in one second, 1/s^2 per root second, and of a component of s.
s, rate, slope, covariance : ndarray, shapes (k,) and (2, 2)
    Last measurement, its rate by the target per s, the slope of the rate per s^2, and covariance
    of both, the same for all components.

Returns
-------
Task or TargetEstimate
    Of `task_3d` with `PoseError`, whose two errors decay by themselves; of `task_2_1_2d` with
    `PointAndRotation`, which moves the image of a point straight to its goal.

References
----------
Book sections 6.3.1 to 6.3.3; F. Chaumette, "Potential problems of stability and convergence
in image-based and position-based visual servoing", 1998; E. Malis, "Improving vision-based control
using efficient second-order minimization techniques", ICRA 2004; C. Samson, M. Le Borgne and
B. Espiau, "Robot control: the task function approach", 1991; P. Corke and M. Good, "Dynamic
effects in visual closed-loop systems", IEEE Trans. Robotics and Automation 12(5), 1996.

Examples
--------
>>> from robotmodels.se3 import translation
>>> from robotmodels.visual_servoing import Lines, camera_velocity
>>> line = Task(Lines([[0, 0, 0], [1, 0, 0]]), desired=translation(0, 0, 0.5))
>>> along = Hybrid(line, [0.1, 0, 0, 0, 0, 0])
>>> camera_velocity(along, translation(0, 0, 0.5)).v.round(6) + 0.0
array([0.1, 0. , 0. , 0. , 0. , 0. ])
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, Value, as_exact, as_floats, as_number
from .._choices import as_instance
from ..errors import InvalidValueError, ShapeError
from ..se3 import as_pose, as_single_pose
from .features import Feature, Sight, as_sensed
from .features_3d import PointAndRotation, PoseError
from .results import Checked, as_points


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Task(Checked):
    """Regulation of a feature: ``[v; w] = -gain L^+ (s - s*)``."""

    feature: Feature
    desired: Any
    gain: float = 0.5
    interaction: str = "current"
    depth: str | float = "true"
    s_desired: Array = field(init=False)
    periods: Array | None = field(init=False)
    T_desired: Array | None = field(init=False)
    L_desired: Array | None = field(init=False)
    _w: Any = field(init=False)

    def __post_init__(self) -> None:
        self._check("gain", "interaction", "depth")
        feature: Any = as_instance(self.feature, Feature, "feature", " such as Points(...)")
        if isinstance(self.desired, Feature | Task):
            raise InvalidValueError(
                f"desired: expected the measurement ({feature.size},) of {type(feature).__name__} "
                f"or a pose (4, 4), got {type(self.desired).__name__}; give its measure(T)."
            )
        s, is_pose = as_sensed(self.desired, feature, "desired")
        T, w, L = None, None, None
        if is_pose:
            T = as_single_pose(s, "desired")
            if isinstance(feature, PoseError | PointAndRotation):
                feature = replace(feature, desired=T)
            s = feature.measure(T)
        elif s.ndim > 1:
            raise ShapeError(f"desired: expected one measurement, got shape {s.shape}.")
        if not isinstance(self.depth, str):
            w = feature._parallel(self.depth)
        needs_pose = self.depth == "desired" or (self.interaction != "current" and w is None)
        if T is None and needs_pose and feature.depends_on_depth:
            raise InvalidValueError(
                f"desired: interaction={self.interaction!r} with depth={self.depth!r} needs the "
                "depth of the desired pose; give desired as a pose (4, 4), or depth in metres."
            )
        if self.depth == "desired" and T is not None:
            w = feature._see(T).depth
        if self.interaction != "current":
            L = feature._rows(s, w) if T is None else feature.interaction(T)
        periods = feature._periods() if feature._periods().any() else None
        derived = {"s_desired": s, "T_desired": T, "L_desired": L, "periods": periods, "_w": w}
        given = {"feature": feature, "desired": s if T is None else T}
        for name, value in (given | derived).items():
            self._set(name, value)

    @property
    def regulated(self) -> Task:
        """The task itself; of a `Hybrid` its primary task."""
        return self

    def error(self, s: Array) -> Array:
        """Difference of a measurement (k,) from the desired one, angles in their period."""
        error = s - self.s_desired
        if self.periods is None:
            return error
        whole = np.where(self.periods > 0.0, self.periods, 1.0)
        return error - self.periods * np.round(error / whole)

    def matrix(self, s: Array, sight: Sight | None) -> Array:
        """Current interaction matrix (k, 6) of a measurement, and of the sight if it is known."""
        w, image = self._w, None if sight is None else sight.image
        if w is None and self.feature.depends_on_depth:
            if sight is None:
                raise InvalidValueError(
                    'measurement: depth="true" needs the pose (4, 4); or give the task a depth.'
                )
            w = sight.depth
        return self.feature._rows(s, w, image)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Hybrid(Checked):
    """A primary task, and a secondary motion z in the kernel of its matrix.

    ``[v; w] = primary + weight (I - L^+ L) z``.
    """

    primary: Task
    secondary: Any
    weight: float = 1.0

    def __post_init__(self) -> None:
        self._check("weight")
        as_instance(self.primary, Task, "primary")
        if not isinstance(self.secondary, Task | Callable):
            self._set("secondary", as_exact(self.secondary, (6,), "secondary"))

    @property
    def regulated(self) -> Task:
        """The primary task."""
        return self.primary


def task_3d(desired: ArrayLike, gain: float = 0.5) -> Task:
    """Position-based (3-D) visual servoing."""
    return Task(PoseError(), as_pose(desired, "desired"), gain)


def task_2_1_2d(points: ArrayLike, desired: ArrayLike, gain: float = 0.5) -> Task:
    """2 1/2-D visual servoing."""
    T = as_pose(desired, "desired")
    return Task(PointAndRotation(as_points(points, "points")[0], T), T, gain)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TargetEstimate(Frozen, Value):
    """Estimate of the motion of a target."""

    s: Array
    rate: Array
    slope: Array
    covariance: Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TargetMotion(Checked):
    """Estimation of the rate of a measurement by a moving target."""

    kalman: bool = True
    process: float = 1.0
    noise: float = 1e-4

    def start(self, s: ArrayLike) -> TargetEstimate:
        """Estimate before any motion was seen, of a measurement s (k,)."""
        s = as_floats(s, "s")
        return TargetEstimate(s, 0.0 * s, 0.0 * s, np.eye(2))

    def update(
        self, last: TargetEstimate, s: ArrayLike, own: ArrayLike, step: float
    ) -> TargetEstimate:
        """Estimate with the next measurement s (k,); ``own`` (k,) is the rate by the camera."""
        as_instance(last, TargetEstimate, "last", " of start or update")
        s, own = (as_exact(x, last.s.shape, name) for x, name in ((s, "s"), (own, "own")))
        h = as_number(step, "step", above=0.0)
        seen = (s - last.s) / h - own
        if not self.kalman:
            return TargetEstimate(s, seen, 0.0 * s, last.covariance)
        F = np.array(((1.0, h), (0.0, 1.0)))
        Q = self.process**2 * np.array(((h**3 / 3.0, h**2 / 2.0), (h**2 / 2.0, h)))
        P = F @ last.covariance @ F.T + Q
        K = P[:, 0] / (P[0, 0] + 2.0 * (self.noise / h) ** 2)
        rate = last.rate + h * last.slope
        missing = seen - rate
        kept = np.eye(2) - np.outer(K, (1.0, 0.0))
        return TargetEstimate(s, rate + K[0] * missing, last.slope + K[1] * missing, kept @ P)
