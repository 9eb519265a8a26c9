"""A still picture of robots."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..errors import InvalidValueError, ShapeError
from ..kinematics.ellipsoid import Ellipsoid
from ..model import RobotModel
from ..visual import Color
from .beside import FROM_THE_FRONT, beside
from .compose import as_color, as_many, as_models, as_opacity, compose, unique_names
from .ellipsoid import as_ellipsoids, draw_ellipsoids
from .nodes import Node
from .palette import PALETTE, as_legend
from .robot import DrawnRobot, Look, draw_robot
from .scene import Scene


def show(
    model: RobotModel | Sequence[RobotModel],
    q: ArrayLike | Sequence[ArrayLike] | None = None,
    *,
    frames: bool = False,
    names: bool = False,
    tool: bool = True,
    meshes: bool = True,
    color: ArrayLike | Sequence[ArrayLike] | None = None,
    opacity: float = 1.0,
    box: ArrayLike | None = None,
    grid: bool = True,
    view: ArrayLike | None = None,
    height: int = 480,
    columns: int | None = None,
    legend: Sequence[str] | None = None,
    ellipsoids: Ellipsoid | Sequence[Ellipsoid] | None = None,
    ellipsoid_scale: float | None = None,
) -> Scene:
    """Draw a robot, several postures of it over each other, or several robots; also called plot.

    Parameters
    ----------
    model : RobotModel or sequence of RobotModel
        The robot, or R robots that stand where their bases are.
    q : array_like, shape (n,) or (N, n), optional
        Joint variables in radians or metres; with N > 1 the postures are drawn together, each in
        a colour of its own. For several robots a list with an entry for each. Default zero.
    frames : bool
        Whether the axes of every frame R_j are drawn (x red, y green, z blue).
    names : bool
        Whether the names of the frames are written beside them.
    tool : bool
        Whether the axes of the tool are drawn.
    meshes : bool
        Whether the shapes of the source URDF are used; otherwise a skeleton sized from the table
        is drawn, as for robots that have none.
    color : array_like, shape (3,) or (4,), optional
        Of the links: red, green, blue and opacity in [0, 1]. For several postures or robots also
        a list with an entry for each.
    opacity : float
        Of the links, in [0, 1].
    box : array_like, shape (6,), optional
        Workspace to draw: ``xmin, xmax, ymin, ymax, zmin, zmax`` in world axes, metres.
    grid : bool
        Whether the floor z = 0 and the axes of the world are drawn.
    view : array_like, shape (2,), optional
        Azimuth and elevation of the camera seen from the robot, radians; default obliquely.
    height : int
        Of the picture in a notebook, pixels.
    columns : int, optional
        Postures of one robot beside each other, so many in a row, numbered from 1; without it
        they stand over each other, where those that differ only by the turn of a link hide one
        another.
    legend : sequence of str, optional
        A text for each posture drawn (those of the first robot first), listed in a corner of the
        picture with its colour.
    ellipsoids : Ellipsoid or sequence of Ellipsoid, optional
        Of velocities or forces, drawn at the tools they belong to; a batch gives one for each
        posture. Flat ones are discs or bars; infinite ones are cut, with dashes where they go on.
    ellipsoid_scale : float, optional
        Metres drawn for 1 m/s, 1 rad/s, 1 N or 1 N m. By default a round number for each quantity
        that fits the robot. The legend tells it.

    Returns
    -------
    Scene
        Shows itself in a notebook; ``.save("arm.html")`` writes one offline page.

    Raises
    ------
    ShapeError, InvalidValueError
        Wrong joint variables or options.
    MeshNotFoundError
        A mesh of the source URDF is not where it was looked for.
    MissingExtraError
        A package that draws is not installed.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> show(arm, [[0.0, 0.5], [0.4, -0.5]], frames=True)
    <Scene 'robot': 29 shapes>
    """
    models = as_models(model)
    postures = [
        _as_postures(value, item)
        for item, value in zip(models, as_many(q, model, len(models), "q"), strict=True)
    ]
    colors = _colors(color, [len(p) for p in postures])
    look = Look(bool(frames), bool(names), bool(tool), bool(meshes), as_opacity(opacity))
    title = ", ".join(unique_names(models))
    key = as_legend(legend, [c for each in colors for c in each])
    drawn, numbers = list(models), list[Node]()
    if columns is not None:
        if len(drawn) > 1:
            raise InvalidValueError(
                "columns: the postures of one robot stand beside each other; several robots stand "
                "where their bases are, see RobotModel.with_base."
            )
        drawn, numbers = beside(drawn[0], postures[0], columns)
        if ellipsoids is not None:
            raise InvalidValueError(
                "ellipsoids: they are where the robot is, not beside it; leave columns out."
            )
        view = FROM_THE_FRONT if view is None else view
        postures, colors = [p[None] for p in postures[0]], [[c] for c in colors[0]]
    robots = [
        draw_robot(item, p, f"robots/{label}", look, c)
        for item, p, label, c in zip(drawn, postures, unique_names(drawn), colors, strict=True)
    ]
    shown = draw_ellipsoids(
        as_ellipsoids(ellipsoids), max(robot.size for robot in robots), ellipsoid_scale
    )
    robots.append(DrawnRobot(shown.nodes, shown.points, (), 0.0))
    return compose(title, robots, numbers, box, grid, view, height, legend=(*key, *shown.legend))


def _as_postures(value: ArrayLike | None, model: RobotModel) -> Array:
    """Joint variables as (N, n), N at least 1."""
    if value is None:
        return model.configurations["zero"].reshape(1, model.n)
    q = as_vector(value, model.n, "q")
    if q.ndim > 2 or not q.shape[0]:
        raise ShapeError(
            f"q: expected one posture ({model.n},) or several (N, {model.n}), got {q.shape}."
        )
    return q.reshape(-1, model.n)


def _colors(
    color: ArrayLike | Sequence[ArrayLike] | None, counts: list[int]
) -> list[list[Color | None]]:
    """A colour, or None for the links' own, for each posture of each robot."""
    if color is None:
        return [
            [None] if count == 1 else [PALETTE[k % len(PALETTE)] for k in range(count)]
            for count in counts
        ]
    if hasattr(color, "__len__") and len(color) and hasattr(color[0], "__len__"):  # type: ignore[arg-type,index]
        each = [as_color(c, f"color[{i}]") for i, c in enumerate(color)]  # type: ignore[arg-type]
        if len(counts) > 1 and len(each) == len(counts):
            return [[c] * count for c, count in zip(each, counts, strict=True)]
        if len(counts) == 1 and len(each) == counts[0]:
            return [list(each)]
        wanted = f"{len(counts)} robots" if len(counts) > 1 else f"{counts[0]} postures"
        raise ShapeError(f"color: expected one, or one for each of the {wanted}, got {len(each)}.")
    same = as_color(color)  # type: ignore[arg-type]
    return [[same] * count for count in counts]
