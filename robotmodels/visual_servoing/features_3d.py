"""Features in space: pose, point, plane, and the features of 2 1/2-D servoing.

Their measurement comes from an estimated pose, or from stereo or range cameras.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._arrays import Array, as_exact, as_number, read_only
from ..se3 import as_single_pose, inverse
from ..se3.orientation import rotation_vectors_of
from .features import Feature, Sight, inner, placed, unit
from .matrices import interaction_point_3d, interaction_theta_u, plane_rows, point_rows


class _InSpace(Feature):
    """A feature whose rows need its measurement alone."""

    __slots__ = ()
    depends_on_depth = False


def _sight(s: Array, point: Array | None) -> Sight:
    """Sight of a feature in space; a point (..., 3) has to be in the image if it is in front."""
    exists = np.ones(s.shape[:-1], bool)
    if point is None or not (point[..., 2] > 0.0).all():
        return Sight(exists, s, None)
    return Sight(exists, s, None, (point[..., :2] / point[..., 2:])[..., None, :])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PoseError(_InSpace):
    """Pose of the camera in the desired camera: translation, m, and rotation vector theta u, rad.

    ``desired`` is the pose of the object in the desired camera, by default the identity: the
    desired camera is at the frame of the object. In a `Task` it is the pose of the task.

    Examples
    --------
    >>> from robotmodels.se3 import rotation
    >>> PoseError().measure(rotation("z", 0.3)).round(3) + 0.0
    array([ 0. ,  0. ,  0. ,  0. ,  0. , -0.3])
    """

    desired: Array | None = None
    _period = (0.0,) * 6

    def __post_init__(self) -> None:
        if self.desired is not None:
            desired = read_only(as_single_pose(self.desired, "desired"))
            object.__setattr__(self, "desired", desired)

    def _see(self, T: Array) -> Sight:
        M = inverse(T) if self.desired is None else self.desired @ inverse(T)
        s = np.concatenate((M[..., :3, 3], rotation_vectors_of(M[..., :3, :3])), axis=-1)
        return _sight(s, T[..., :3, 3])

    def _rows(self, s: Array, depth: Any, image: Any = None) -> Array:
        L = np.zeros((*s.shape, 6))
        L[..., :3, :3] = rotations(s[..., 3:])
        L[..., 3:, :] = interaction_theta_u(s[..., 3:])
        return L


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Point3D(_InSpace):
    """Coordinates X, Y, Z of ``point (3,)`` in the camera, m."""

    point: Array
    _period = (0.0,) * 3

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", read_only(as_exact(self.point, (3,), "point")))

    def _see(self, T: Array) -> Sight:
        X = placed(T, self.point[None])[..., 0, :]
        return _sight(X, X)

    def _rows(self, s: Array, depth: Any, image: Any = None) -> Array:
        return interaction_point_3d(s)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Plane3D(_InSpace):
    """A plane ``normal . X = distance``: its unit normal and its distance in the camera, m."""

    normal: Array
    distance: float
    _period = (0.0,) * 4

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", unit(self.normal, "normal"))
        object.__setattr__(self, "distance", as_number(self.distance, "distance", least=-np.inf))

    def _see(self, T: Array) -> Sight:
        n = T[..., :3, :3] @ self.normal
        return _sight(np.concatenate((n, self.distance + inner(n, T[..., :3, 3])), axis=-1), None)

    def _rows(self, s: Array, depth: Any, image: Any = None) -> Array:
        return plane_rows(s[..., :3])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PointAndRotation(_InSpace):
    """Features of 2 1/2-D servoing: x, y, log(Z) of ``point (3,)``, and theta u as in `PoseError`.

    Their interaction matrix is block triangular: the rotation alone moves theta u, and the image
    of the point goes straight to its goal (E. Malis, F. Chaumette and S. Boudet, "2 1/2 D visual
    servoing", IEEE Trans. Robotics and Automation 15(2), 1999).
    """

    point: Array
    desired: Array
    _period = (0.0,) * 6

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", read_only(as_exact(self.point, (3,), "point")))
        object.__setattr__(self, "desired", read_only(as_single_pose(self.desired, "desired")))

    def _see(self, T: Array) -> Sight:
        X = placed(T, self.point[None])[..., 0, :]
        R = self.desired[:3, :3] @ np.swapaxes(T[..., :3, :3], -1, -2)
        image = X[..., :2] / X[..., 2:]
        s = np.concatenate((image, np.log(X[..., 2:]), rotation_vectors_of(R)), axis=-1)
        return Sight(X[..., 2] > 0.0, s, None, image[..., None, :])

    def _rows(self, s: Array, depth: Any, image: Any = None) -> Array:
        x, y, w = s[..., 0], s[..., 1], np.exp(-s[..., 2])
        L = np.zeros((*s.shape, 6))
        L[..., :2, :] = point_rows(x, y, w)
        L[..., 2, 2], L[..., 2, 3], L[..., 2, 4] = -w, -y, x
        L[..., 3:, :] = interaction_theta_u(s[..., 3:])
        return L


def rotations(vectors: Array) -> Array:
    """Rotation matrices of rotation vectors. Shapes: (..., 3) -> (..., 3, 3)."""
    from scipy.spatial.transform import Rotation

    matrices = Rotation.from_rotvec(np.array(vectors).reshape(-1, 3)).as_matrix()
    return matrices.reshape(*vectors.shape, 3)
