"""Visual servoing (chapter 6): image features, interaction matrices, tasks, pose, simulation.

Throughout, image coordinates are normalised, x = X / Z and y = Y / Z; twists [v; w] are those of
the camera in its own axes, m/s and rad/s; ``T`` (..., 4, 4) are poses of the object in the camera.
Arguments of the wrong shape, with NaN or out of range, matrices that are not poses, and objects at
or behind the plane of the camera raise ShapeError, InvalidValueError or NotARotationError.
"""

from .. import _docs
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
from .tasks import Hybrid, TargetEstimate, TargetMotion, Task, task_2_1_2d, task_3d
from .velocity import ServoStatus, ServoStep, VirtualLink, camera_velocity, virtual_link

__all__ = ["Camera", "Circle", "Cylinder", "EyeInHand", "EyeToHand", "Feature", "Hybrid", "Lines"]
__all__ += ["Moments", "Plane3D", "PlaneMotions", "Point3D", "PointAndRotation", "Points"]
__all__ += ["PoseError", "PoseSolutions", "PoseStatus", "Segments", "ServoMotion", "ServoStatus"]
__all__ += ["ServoStep", "Sphere", "TargetEstimate", "TargetMotion", "Task", "VirtualLink"]
__all__ += ["broyden", "camera_velocity", "decompose_homography", "estimate_interaction"]
__all__ += ["homography", "interaction_ellipse", "interaction_line", "interaction_moment"]
__all__ += ["interaction_plane_3d", "interaction_point", "interaction_point_3d"]
__all__ += ["interaction_segment", "interaction_theta_u", "p3p", "pnp", "refine_pose", "servo"]
__all__ += ["task_2_1_2d", "task_3d", "virtual_link"]

_docs.document(__name__)
