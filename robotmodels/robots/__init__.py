"""The catalogue: robots by name, one file of numbers with their sources for each.

`robotmodels.load` builds a robot of it, `robotmodels.robots` lists their names.
"""

from .. import _docs
from .catalogue import CATALOGUE, load, robots, source, title

__all__ = ["CATALOGUE", "load", "robots", "source", "title"]

_docs.document(__name__)
