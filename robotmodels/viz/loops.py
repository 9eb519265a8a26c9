"""Closures of looped robots in a scene: a ring on the first frame and a ball on the second.

The ball lies in the ring where the loop is closed; a link without shape towards either is a rod.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..loops import LoopedRobot
from ..model import RobotModel
from ..visual import (
    Color,
    Cylinder,
    Sphere,
    Visual,
    characteristic_length,
    link_rod,
    skeleton,
    z_along,
)
from .robot import with_strokes

_FIRST: Color = (0.85, 0.15, 0.20, 0.55)
_SECOND: Color = (0.85, 0.15, 0.20, 1.0)


def with_closures(model: Any, q: Any) -> Any:
    """A looped robot as its tree with shapes for the closures; lists of robots; others as given."""
    if isinstance(model, LoopedRobot):
        return _drawn(model, q)
    if isinstance(model, (list, tuple)):
        many = q if isinstance(q, (list, tuple)) and len(q) == len(model) else [None] * len(model)
        return [with_closures(item, values) for item, values in zip(model, many, strict=True)]
    return model


def _drawn(robot: LoopedRobot, q: Any) -> RobotModel:
    """The tree with the shapes of its links, as long as the motion needs, and of its closures."""
    tree = robot.tree
    table = tree.table
    if isinstance(q, (list, tuple, np.ndarray)) and np.shape(q)[-1:] == (tree.n,):
        table = with_strokes(table, np.reshape(np.asarray(q, np.float64), (-1, tree.n)))
    size = characteristic_length(table, tree.tool)
    shapes = list(tree.visuals or skeleton(table, tree.tool, tree.tip, axes=False))
    for closure in robot.closures:
        for number, frame in enumerate(closure.frames):
            place = tree.twin.frame(frame)
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = place.rotation, place.position
            reach = float(np.linalg.norm(place.position))
            if reach > 0.0:
                start = z_along(place.position / reach)
                shapes += link_rod(place.parent, start, reach, 0.012 * size, size)
            shape = Sphere(0.03 * size) if number else Cylinder(0.045 * size, 0.02 * size)
            shapes.append(Visual(place.parent, pose, shape, _SECOND if number else _FIRST))
    return replace(tree, visuals=tuple(shapes))
