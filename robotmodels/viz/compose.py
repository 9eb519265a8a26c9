"""What `show`, `animate` and `jog` share: reading their arguments and putting a scene together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_floats
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel
from ..visual import Color
from .camera import framed
from .motion import Motion
from .nodes import Node
from .palette import Legend
from .robot import DrawnRobot
from .scene import Scene
from .sliders import SliderPanel
from .surroundings import floor_grid, workspace_box


def as_models(model: object) -> tuple[RobotModel, ...]:
    """One model or several, as a tuple."""
    models = (model,) if isinstance(model, RobotModel) else model
    if not isinstance(models, (tuple, list)) or not models:
        raise InvalidValueError(
            f"model: expected a RobotModel or a list of them, got {type(model).__name__}."
        )
    for item in models:
        if not isinstance(item, RobotModel):
            raise InvalidValueError(
                f"model: expected a RobotModel, got {type(item).__name__} in the list."
            )
    return tuple(models)


def as_many(value: Any, model: object, count: int, name: str) -> tuple[Any, ...]:
    """One entry for each robot: the value itself for one model, its items for several."""
    if isinstance(model, RobotModel):
        return (value,)
    if value is None:
        return (None,) * count
    if not hasattr(value, "__len__") or len(value) != count:
        raise ShapeError(f"{name}: expected a list with one entry for each of the {count} robots.")
    return tuple(value)


def as_color(value: ArrayLike, name: str = "color") -> Color:
    """Check a colour. Shapes: value (3,) or (4,)."""
    numbers = as_floats(value, name)
    if numbers.shape not in ((3,), (4,)):
        raise ShapeError(f"{name}: expected (r, g, b) or (r, g, b, a), got shape {numbers.shape}.")
    if numbers.min() < 0 or numbers.max() > 1:
        raise InvalidValueError(f"{name}: expected numbers from 0 to 1, got {numbers.tolist()}.")
    r, g, b, a = (*numbers.tolist(), 1.0)[:4]
    return r, g, b, a


def as_opacity(value: float) -> float:
    """Check an opacity: a number in [0, 1]."""
    opacity = float(as_exact(value, (), "opacity"))
    if not 0 <= opacity <= 1:
        raise InvalidValueError(f"opacity: expected a number from 0 to 1, got {opacity}.")
    return opacity


def unique_names(models: Sequence[RobotModel]) -> tuple[str, ...]:
    """A name for each robot in the scene: its own, with a number if another one has it."""
    names: list[str] = []
    for model in models:
        name = own = model.name.replace("/", "_")
        k = 1
        while name in names:
            k += 1
            name = f"{own}_{k}"
        names.append(name)
    return tuple(names)


def compose(
    title: str,
    robots: Sequence[DrawnRobot],
    extra: Sequence[Node],
    box: ArrayLike | None,
    grid: bool,
    view: ArrayLike | None,
    height: int,
    motion: Motion | None = None,
    legend: Legend = (),
    sliders: SliderPanel | None = None,
) -> Scene:
    """Put robots and what stands around them into a scene that they fill."""
    points: Array = np.concatenate([robot.points for robot in robots])
    nodes = [node for robot in robots for node in robot.nodes]
    nodes += extra
    if box is not None:
        box_nodes, corners = workspace_box(box)
        nodes += box_nodes
        points = np.concatenate((points, corners))
    if grid:
        nodes += floor_grid(points)
    angles = None
    if view is not None:
        azimuth, elevation = as_exact(view, (2,), "view").tolist()
        angles = (azimuth, elevation)
    return Scene(title, tuple(nodes), framed(points, angles), motion, height, legend, sliders)
