"""Visual servoing (chapter 6): image features, interaction matrices, tasks, pose, simulation."""

from .camera import Camera
from .features import Circle, Cylinder, Feature, Lines, Points, Segments, Sphere
from .features_3d import Plane3D, Point3D, PointAndRotation, PoseError
from .homography import PlaneMotions, decompose_homography, homography
from .matrices import (
    broyden,
    estimate_interaction,
    interaction_ellipse,
    interaction_line,
    interaction_moment,
    interaction_plane_3d,
    interaction_point,
    interaction_point_3d,
    interaction_segment,
    interaction_theta_u,
)
from .moments import Moments
from .pose import PoseSolutions, PoseStatus, p3p, pnp, refine_pose
from .servo import EyeInHand, EyeToHand, ServoMotion, servo
from .tasks import Hybrid, Task, task_2_1_2d, task_3d
from .tracking import TargetEstimate, TargetMotion
from .velocity import ServoStatus, ServoStep, VirtualLink, camera_velocity, virtual_link

__all__ = [
    "Camera",
    "Circle",
    "Cylinder",
    "EyeInHand",
    "EyeToHand",
    "Feature",
    "Hybrid",
    "Lines",
    "Moments",
    "Plane3D",
    "PlaneMotions",
    "Point3D",
    "PointAndRotation",
    "Points",
    "PoseError",
    "PoseSolutions",
    "PoseStatus",
    "Segments",
    "ServoMotion",
    "ServoStatus",
    "ServoStep",
    "Sphere",
    "TargetEstimate",
    "TargetMotion",
    "Task",
    "VirtualLink",
    "broyden",
    "camera_velocity",
    "decompose_homography",
    "estimate_interaction",
    "homography",
    "interaction_ellipse",
    "interaction_line",
    "interaction_moment",
    "interaction_plane_3d",
    "interaction_point",
    "interaction_point_3d",
    "interaction_segment",
    "interaction_theta_u",
    "p3p",
    "pnp",
    "refine_pose",
    "servo",
    "task_2_1_2d",
    "task_3d",
    "virtual_link",
]
