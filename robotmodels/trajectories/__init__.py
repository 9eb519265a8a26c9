"""Trajectories: motion between poses or postures, with time laws within limits.

Book sections 4.2 to 4.4. Every generator of joint motion returns a `Trajectory`; but
`cartesian_trajectory` and `joint_trajectory` return plain arrays, as ``ctraj`` and ``jtraj`` do.
Inconsistent or infeasible requests raise `ShapeError` or `InvalidValueError`, whose message gives
the least duration, limit or factor that is feasible.

Parameters
----------
model : RobotModel
    The robot, n joints, with its drives.
q0, q1 : array_like, shape () or (n,)
    Positions at the ends, rad or m.
v0, v1, a0, a1 : array_like, shape () or (n,)
    Velocities and accelerations at the ends, rad or m, per s and s^2.
duration : float, optional
    Seconds, by default the least; a longer one slows the quickest motion down evenly.
limits : MotionLimits, optional
    Of the joints, kept everywhere on the motion.
law : TimeLaw or str
    A member or its name.
synchronisation : Synchronisation or str
    How the joints are kept in step.
torque : array_like, shape () or (n,), optional
    Largest torques in both directions, N m or N; default those of the model's table.
rng : Generator or int, optional
    Random numbers or their seed; default a fixed one.
"""

from .. import _docs
from .blends import blended_lines
from .candidates import Cost, ProfileLaw, random_profile
from .cartesian import blended_poses, cartesian_trajectory, circle, circular_arc, straight_line
from .harmonics import FourierSeries, fourier, fourier_basis
from .jerk import jerk_limited
from .joint_path import JointPath, joint_path
from .kinodynamic import Plan, PlanMethod, PlanStatus, Pose, Timing, kinodynamic
from .laws import TimeLaw
from .limits import LimitsReport, MotionLimits
from .path_events import PathEvent, PathEventKind
from .point_to_point import (
    Synchronisation,
    along_line,
    bang_bang,
    cubic,
    joint_trajectory,
    linear,
    quintic,
    smoothed_trapezoidal,
    trapezoidal,
)
from .pose_trajectory import PoseSamples, PoseTrajectory
from .resolved_motion import ResolvedMotion, resolved_motion
from .splines import SplineEnds, cubic_spline, quintic_spline
from .time_optimal import TimedPath, TimingStatus, time_optimal
from .time_scaling import ScaledTrajectory, ScalingStatus, time_scaled
from .trajectory import Samples, Trajectory

__all__ = [
    "Cost",
    "FourierSeries",
    "JointPath",
    "LimitsReport",
    "MotionLimits",
    "PathEvent",
    "PathEventKind",
    "Plan",
    "PlanMethod",
    "PlanStatus",
    "Pose",
    "PoseSamples",
    "PoseTrajectory",
    "ProfileLaw",
    "ResolvedMotion",
    "Samples",
    "ScaledTrajectory",
    "ScalingStatus",
    "SplineEnds",
    "Synchronisation",
    "TimeLaw",
    "TimedPath",
    "Timing",
    "TimingStatus",
    "Trajectory",
    "along_line",
    "bang_bang",
    "blended_lines",
    "blended_poses",
    "cartesian_trajectory",
    "circle",
    "circular_arc",
    "cubic",
    "cubic_spline",
    "fourier",
    "fourier_basis",
    "jerk_limited",
    "joint_path",
    "joint_trajectory",
    "kinodynamic",
    "linear",
    "quintic",
    "quintic_spline",
    "random_profile",
    "resolved_motion",
    "smoothed_trapezoidal",
    "straight_line",
    "time_optimal",
    "time_scaled",
    "trapezoidal",
]

_docs.document(__name__)
