"""Viewpoints from which the drawn points fill the picture."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin, tan

import numpy as np

from .._arrays import Array

FIELD_OF_VIEW = 30.0
"""Vertical angle of the picture in degrees: narrow, so that an arm looks undistorted."""

ASPECT = 1.15
"""Width over height that the camera is placed for: narrower than most windows."""

_MARGIN = 0.88


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera that looks at a point.

    Parameters
    ----------
    target, position : ndarray, shape (3,)
        Centre of the view and of its rotation, and position of the camera, world axes, metres.
    depth : float
        Extent of the drawn points behind the target, metres.
    """

    target: Array
    position: Array
    depth: float = 0.0

    @property
    def distance(self) -> float:
        """From the camera to its target, metres."""
        return float(np.linalg.norm(self.position - self.target))


def default_view(points: Array) -> tuple[float, float]:
    """Azimuth and elevation that show a robot well. Shapes: points (k, 3)."""
    x, y, z = np.ptp(points, axis=0)
    # a planar arm lies on the floor: look down on it
    elevation = radians(55.0 if z < 0.2 * max(x, y) else 18.0)
    # face the wider side, yet obliquely
    azimuth = radians(-60.0 if x >= y else -30.0)
    return azimuth, elevation


def framed(points: Array, view: tuple[float, float] | None = None) -> Camera:
    """The camera from which points fill the picture.

    Shapes: points (k, 3), view (azimuth, elevation).
    """
    azimuth, elevation = default_view(points) if view is None else view
    back = np.array((cos(elevation) * cos(azimuth), cos(elevation) * sin(azimuth), sin(elevation)))
    right = np.array((-sin(azimuth), cos(azimuth), 0.0))
    up = np.cross(back, right)
    x, y, z = points @ right, points @ up, points @ back
    # |x - x0| <= (distance - z) slope for every point, likewise y: the tightest ones decide
    slope = tan(radians(0.5 * FIELD_OF_VIEW)) * _MARGIN
    x0, across = _tightest(x, z, slope * ASPECT)
    y0, high = _tightest(y, z, slope)
    middle = 0.5 * (z.min() + z.max())
    target = x0 * right + y0 * up + middle * back
    distance = max(across - middle, high - middle, 0.05)
    return Camera(target, target + distance * back, float(0.5 * (z.max() - z.min())))


def _tightest(x: Array, z: Array, slope: float) -> tuple[float, float]:
    """Centre and distance of the narrowest wedge that holds all points."""
    right, left = (x + z * slope).max(), (z * slope - x).max()
    return float(0.5 * (right - left)), float(0.5 * (right + left) / slope)
