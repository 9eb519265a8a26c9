"""The camera: pixels to normalised image coordinates and back (section 6.2.4.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Value, as_core, as_exact, as_floats, read_only
from ..errors import InvalidValueError


@dataclass(frozen=True, slots=True, eq=False)
class Camera(Value):
    """A perspective camera without distortion; its z axis is the optical axis.

    Features and tasks use normalised coordinates ``x = X / Z``, ``y = Y / Z``; the camera turns
    them into pixels ``u = focal_u x + centre_u``. The view of a drawn scene is `viz.Camera`.

    Parameters
    ----------
    focal, centre, size : array_like, shape (2,)
        Focal lengths, not zero, or one for both; principal point; width and height of the image,
        above zero. Pixels.

    Examples
    --------
    >>> camera = Camera(focal=(800, 800), centre=(320, 240), size=(640, 480))
    >>> camera.project([0.1, -0.05, 2.0]), camera.normalise([360.0, 220.0])
    (array([360., 220.]), array([ 0.05 , -0.025]))
    """

    focal: Array = (800.0, 800.0)  # type: ignore[assignment]
    centre: Array = (320.0, 240.0)  # type: ignore[assignment]
    size: Array = (640.0, 480.0)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        focal = as_floats(self.focal, "focal")
        focal = np.broadcast_to(focal, (2,)) if focal.ndim == 0 else focal
        for name, value in (("focal", focal), ("centre", self.centre), ("size", self.size)):
            object.__setattr__(self, name, read_only(as_exact(value, (2,), name)))
        if not self.focal.all() or not (self.size > 0.0).all():
            raise InvalidValueError(
                f"focal, size: expected pixels, not zero, got {self.focal} and {self.size}."
            )

    def normalise(self, pixels: ArrayLike) -> Array:
        """Normalised coordinates (..., 2) of pixels (..., 2)."""
        return (as_core(pixels, (2,), "pixels") - self.centre) / self.focal

    def pixels(self, image: ArrayLike) -> Array:
        """Pixels (..., 2) of normalised coordinates (..., 2)."""
        return as_core(image, (2,), "image") * self.focal + self.centre

    def project(self, points: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3) in the axes of the camera, metres."""
        X = as_core(points, (3,), "points")
        if not (X[..., 2] > 0.0).all():
            raise InvalidValueError(
                f"points: expected points in front of the camera, got Z = {X[..., 2].min():.4g} m."
            )
        return self.pixels(X[..., :2] / X[..., 2:])

    def sees(self, image: ArrayLike) -> NDArray[np.bool_]:
        """Whether all of the normalised points (..., k, 2) are inside the image."""
        u = np.atleast_2d(self.pixels(image))
        return np.all((u >= 0.0) & (u <= self.size), axis=(-2, -1))
