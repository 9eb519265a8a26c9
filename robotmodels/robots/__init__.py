"""The catalogue: robots by name, each built in code with the source of every number.

One file per maker (or group). `robotmodels.load` and `robotmodels.robots` are its door.
"""

from .catalogue import CATALOGUE, load, robots, title

__all__ = ["CATALOGUE", "load", "robots", "title"]
