"""Several laws of motion of one joint, over each other or side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import index
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from ..errors import InvalidValueError
from ..trajectories.limits import MotionLimits
from ..trajectories.trajectory import Samples, Trajectory
from .figures import COLUMN, PAGE, heading, legend_above, line_style, new_figure, panels, texts
from .plot_sampling import drawn
from .plot_trajectory import (
    QUANTITIES,
    as_limits,
    as_orders,
    draw_limits,
    draw_line,
    limit_handles,
)
from .plot_units import Unit, as_unit, joint_names

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_profiles(
    profiles: Mapping[str, Trajectory | Samples] | Sequence[Trajectory | Samples],
    names: Sequence[str] | None = None,
    joint: int = 0,
    limits: MotionLimits | None = None,
    unit: Unit | str = Unit.UNSTATED,
    *,
    side_by_side: bool = False,
    orders: Sequence[int] = (0, 1, 2, 3),
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """One joint's position, velocity, acceleration and jerk under several laws of motion.

    Parameters
    ----------
    profiles : mapping of str to Trajectory, or sequence of Trajectory
        The motions by their names; `Samples` may stand for a trajectory.
    names : sequence of str, optional
        Of the motions of a sequence; default ``motion 1`` and so on.
    joint : int
        Which joint, from 0.
    limits : MotionLimits, optional
        Drawn as dashed lines; what lies beyond them is underlaid in red. Of as many joints as
        the motions have, or the same for all.
    unit : Unit or str
        ``rad``, ``deg``, ``m`` or ``mm`` for the axes.
    side_by_side : bool
        Whether each motion stands in a column of its own, with common scales, instead of all
        motions over each other.
    orders : sequence of int
        Which rows: 0 position, 1 velocity, 2 acceleration, 3 jerk.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        The names stand with the durations.

    Raises
    ------
    InvalidValueError, ShapeError
        No motions, batches of motions, not one name for each; no such joint.
    MissingExtraError
        Matplotlib is not installed.

    Examples
    --------
    >>> from robotmodels.trajectories import bang_bang, cubic
    >>> laws = {"bang-bang": bang_bang(0, 1, duration=1.0), "cubic": cubic(0, 1, duration=1.2)}
    >>> figure = plot_profiles(laws, unit="rad")
    >>> [line.get_label() for line in figure.axes[0].get_lines()]
    ['bang-bang, 1 s', 'cubic, 1.2 s']
    """
    given, labels = _named(profiles, names)
    motions = [drawn(motion, repr(name)) for motion, name in zip(given, labels, strict=True)]
    j = _joint(joint, min(motion.n for motion in motions))
    bounds = [as_limits(limits, motion.n) for motion in motions]
    shown, kind = as_orders(orders), as_unit(unit)
    wide = PAGE if side_by_side and len(motions) > 1 else COLUMN
    figure = new_figure(wide, 0.75 + 1.05 * len(shown), size)
    columns = len(motions) if side_by_side else 1
    grid = panels(figure, len(shown), columns, sharex=True, sharey="row")
    for k, (motion, name) in enumerate(zip(motions, labels, strict=True)):
        column = k if side_by_side else 0
        label = f"{name}, {motion.duration:.4g} s"
        for row, order in enumerate(shown):
            axes = grid[row, column]
            draw_line(
                axes, motion.t, kind.factor * motion.values[order, :, j], line_style(k), label
            )
            bound = bounds[k]
            if bound is not None:
                draw_limits(axes, motion, order, [j], bound, kind, joint_names(None, motion.n))
    for row, order in enumerate(shown):
        grid[row, 0].set_ylabel(f"{QUANTITIES[order]}\n({kind.of(order)})")
    for axes in grid[-1]:
        axes.set_xlabel("time (s)")
    figure.align_ylabels()
    handles: list[Any] = []
    for axes in grid[0]:
        lines = [line for line in axes.get_lines() if not str(line.get_label()).startswith("_")]
        if side_by_side:
            name, _, time = str(lines[0].get_label()).rpartition(", ")
            heading(axes, f"{name}\n{time}", wide / columns)
        else:
            handles += lines
    legend_above(figure, handles + limit_handles(figure), title)
    return figure


def _named(profiles: Any, names: Sequence[str] | None) -> tuple[list[Any], list[str]]:
    """The motions and their names."""
    if isinstance(profiles, Mapping):
        given, known = list(profiles.values()), [str(name) for name in profiles]
        if names is not None:
            raise InvalidValueError("names: a mapping of motions has its own names.")
    elif isinstance(profiles, Sequence) and not isinstance(profiles, str):
        given = list(profiles)
        known = [f"motion {k + 1}" for k in range(len(given))]
        if names is not None:
            known = texts(names, len(given), "names", "motions")
    else:
        raise InvalidValueError(
            "profiles: expected motions by their names, or a list of them, got "
            f"{type(profiles).__name__}."
        )
    if not given:
        raise InvalidValueError("profiles: expected at least one motion, got none.")
    return given, known


def _joint(joint: Any, n: int) -> int:
    try:
        j = index(joint)
    except TypeError:
        j = -1
    if isinstance(joint, bool) or not 0 <= j < n:
        raise InvalidValueError(
            f"joint: expected a number from 0 to {n - 1}, as all motions have that joint, got "
            f"{joint!r}."
        )
    return j
