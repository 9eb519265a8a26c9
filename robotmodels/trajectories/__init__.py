"""Trajectories: motion between poses or postures, with time laws within limits.

Book sections 4.2 to 4.4. Every generator of joint motion returns a `Trajectory`; but
`cartesian_trajectory` and `joint_trajectory` return plain arrays, as ``ctraj`` and ``jtraj`` do.
Inconsistent or infeasible requests raise `ShapeError` or `InvalidValueError`, whose message gives
the least duration, limit or factor that is feasible.

Common parameters: ``limits``, `MotionLimits` of the joints; ``torque`` (n,) or a number,
largest torques in both directions, N m or N, by default those of the model's table; ``rng``, random
numbers or their seed, by default a fixed one; ``law`` and ``synchronisation``, members of `TimeLaw`
and `Synchronisation` or their names; ``duration``, seconds, by default the least.
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
