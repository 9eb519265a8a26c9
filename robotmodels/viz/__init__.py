"""Pictures of robots: `show` and `animate` give a `Scene`, a meshcat page that needs no network."""

from .animate import animate
from .camera import Camera
from .motion import Motion
from .scene import Scene
from .show import show

__all__ = ["Camera", "Motion", "Scene", "animate", "show"]
