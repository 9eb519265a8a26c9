"""Features in space: pose, point, plane, and the features of 2 1/2-D servoing.

Their measurement comes from an estimated pose, or from stereo or range cameras; their rows need
the measurement alone. With a `Camera` their point has to be in its image if it is in front.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from .._arrays import Array
from ..se3 import inverse
from ..se3.orientation import rotation_vectors_of
from .features import Feature, Sight, inner, norm, placed
from .matrices import interaction_plane_3d, interaction_point_3d, interaction_theta_u, point_rows


class _InSpace(Feature):
    """A feature that exists at any pose and is measured with its depth."""

    __slots__ = ()
    depends_on_depth = False

    def _sight(self, s: Array, X: Array) -> Sight:
        """Sight with a point X (..., 3)."""
        image = (X[..., :2] / X[..., 2:])[..., None, :] if (X[..., 2] > 0.0).all() else None
        return Sight(np.ones(s.shape[:-1], bool), s, None, image)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PoseError(_InSpace):
    """Pose of the camera in the desired camera: translation, m, and rotation vector theta u, rad.

    ``desired`` is the pose of the object in the desired camera, by default the identity: the
    desired camera is at the frame of the object. In a `Task` it is the pose of the task.
    """

    desired: Array = None  # type: ignore[assignment]
    _period = (0.0,) * 6

    def _see(self, T: Array) -> Sight:
        M = self.desired @ inverse(T)
        s = np.concatenate((M[..., :3, 3], rotation_vectors_of(M[..., :3, :3])), axis=-1)
        return self._sight(s, T[..., :3, 3])

    def _rows(self, s: Array, depth: Any, image: Any = None) -> Array:
        turns = Rotation.from_rotvec(np.array(s[..., 3:]).reshape(-1, 3)).as_matrix()
        shifts = np.insert(turns, (3, 3, 3), 0.0, axis=-1).reshape(*s.shape[:-1], 3, 6)
        return np.concatenate((shifts, interaction_theta_u(s[..., 3:])), axis=-2)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Point3D(_InSpace):
    """Coordinates X, Y, Z of ``point (3,)`` in the camera, m."""

    point: Array
    _period = (0.0,) * 3

    def _see(self, T: Array) -> Sight:
        X = placed(T, self.point)
        return self._sight(X, X)

    def _rows(self, s: Array, depth: Any, image: Any = None) -> Array:
        return interaction_point_3d(s)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Plane3D(_InSpace):
    """A plane ``normal . X = distance``: its unit normal and its distance in the camera, m."""

    normal: Array
    distance: float
    _period = (0.0,) * 4

    def _see(self, T: Array) -> Sight:
        n = T[..., :3, :3] @ self.normal
        s = np.concatenate((n, self.distance + inner(n, T[..., :3, 3])), axis=-1)
        return Sight(np.ones(s.shape[:-1], bool), s)

    def _rows(self, s: Array, depth: Any, image: Any = None) -> Array:
        return interaction_plane_3d(s[..., :3] / norm(s[..., :3]))


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

    def _see(self, T: Array) -> Sight:
        X = placed(T, self.point)
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
