"""Obstacles in the workspace and the clearance of a robot from them.

Links are straight segments between the origins of frames, with a radius.
"""

from .. import _docs
from .clearance import clearance
from .shapes import Box, Capsule, Plane, Sphere

__all__ = ["Box", "Capsule", "Plane", "Sphere", "clearance"]

_docs.document(__name__)
