"""What inverse kinematic models ask of the joints, and miss, across a singular position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_floats, as_reals
from ..errors import InvalidValueError, ShapeError
from ..kinematics.inverse.solution import IKMSolution
from ..model import RobotModel
from ..trajectories.limits import MotionLimits
from .figures import (
    COLUMN,
    PAGE,
    LineStyle,
    heading,
    legend_above,
    limit_lines,
    line_style,
    new_figure,
    panels,
    texts,
    wrapped,
)
from .palette import INK
from .plot_trajectory import as_limits, draw_line, limit_handles
from .plot_units import Unit, as_unit, joint_names, joint_units

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DECADES = 30.0  # from this ratio on a scale of powers shows more
_LEAST = 1e-6  # beside the greatest: what is smaller is as good as zero


@dataclass(frozen=True, slots=True, eq=False)
class _Method:
    """What one method gives along the way: speeds (N, n), the norms of what it misses (N,)."""

    name: str
    v: Array
    linear: Array | None
    angular: Array | None
    least: Array | None

    @property
    def missing(self) -> list[tuple[str, str, Array | None]]:
        """Quantity, unit and values of the rows below the speeds."""
        return [
            ("missing linear\nvelocity", "m/s", self.linear),
            ("missing angular\nvelocity", "rad/s", self.angular),
            ("least singular\nvalue", "", self.least),
        ]


def plot_inverse_velocities(
    distance: ArrayLike,
    solutions: Mapping[str, Any] | Sequence[Any],
    names: Sequence[str] | None = None,
    *,
    model: RobotModel | None = None,
    units: Unit | str | Sequence[Unit | str] | None = None,
    limits: MotionLimits | None = None,
    each_joint: bool = False,
    distance_unit: Unit | str = Unit.DEGREE,
    distance_name: str = "distance from the singular position",
    logarithmic: bool | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Joint speeds and task error of several methods across a singular position.

    Parameters
    ----------
    distance : array_like, shape (N,)
        Distance from the singular position, rad or m, ascending; it may have a sign.
    solutions : mapping of str to IKMSolution, or sequence
        What each method gave at these distances, by its name: an `IKMSolution` of N rows, or a
        pair of arrays, the joint velocities (N, n) and the error of the twist (N, 6) or None,
        linear then angular. NaN rows leave a gap.
    names : sequence of str, optional
        Of the methods of a sequence; default ``method 1`` and so on.
    model : RobotModel, optional
        The robot, n joints: their names and units.
    units : Unit or str, or sequence of them, length n, optional
        Of the joints, as in `plot_trajectory`; joints of different units have panels of their own.
    limits : MotionLimits, optional
        Whose velocities are drawn as dashed lines (the greater of both directions).
    each_joint : bool
        Whether each method has a column with the speeds of all joints, instead of lines for the
        greatest speed of each method.
    distance_unit : Unit or str
        ``deg``, ``rad``, ``m`` or ``mm`` for the axis.
    distance_name : str
        What the axis is.
    logarithmic : bool, optional
        Whether the distance is on a scale of powers, linear around zero where it has a sign;
        default where most of the samples are near zero.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        Speeds; below them what is missing of the linear and the angular velocity, in those rows
        that were asked for; below that the least singular value, where it is known.

    Raises
    ------
    InvalidValueError, ShapeError
        Distances that do not ascend; rows that do not fit them; no methods, or methods for
        different numbers of joints; names, units, limits or a model that do not fit.
    MissingExtraError
        Matplotlib is not installed.

    Examples
    --------
    >>> d = np.linspace(-0.1, 0.1, 11)
    >>> bounded = d[:, None] / (d[:, None] ** 2 + 1e-3)
    >>> missing = np.c_[np.zeros((11, 5)), 1e-3 / (d**2 + 1e-3)]
    >>> figure = plot_inverse_velocities(d, {"damped": (bounded, missing)}, units="rad")
    >>> [" ".join(axes.get_ylabel().split()) for axes in figure.axes][::2]
    ['greatest joint speed (rad/s)', 'missing angular velocity (rad/s)']
    """
    x = as_floats(distance, "distance")
    if x.ndim != 1 or not x.size or (np.diff(x) <= 0.0).any():
        raise InvalidValueError("distance: expected a vector of distances that ascend.")
    methods = _methods(solutions, names, x.size)
    n = methods[0].v.shape[1]
    labels, kinds = joint_names(names=None, n=n, model=model), joint_units(units, n, model)
    bounds, unit = as_limits(limits, n), as_unit(distance_unit)
    x = unit.factor * x
    speeds = list(dict.fromkeys(kinds))
    below = [k for k in range(3) if any(method.missing[k][2] is not None for method in methods)]
    columns = len(methods) if each_joint else 1
    wide = COLUMN if columns == 1 else PAGE
    figure = new_figure(wide, 0.75 + 1.05 * (len(speeds) + len(below)), size)
    grid = panels(figure, len(speeds) + len(below), columns, sharex=True, sharey="row")
    for m, method in enumerate(methods):
        column = m if each_joint else 0
        own = LineStyle(INK, (0, ())) if each_joint else line_style(m)
        for row, kind in enumerate(speeds):
            joints = [j for j in range(n) if kinds[j] is kind]
            v = kind.factor * np.abs(method.v[:, joints])
            if each_joint:
                for j, speed in zip(joints, v.T, strict=True):
                    draw_line(grid[row, column], x, speed, line_style(j), labels[j])
            else:
                draw_line(grid[row, column], x, v.max(axis=1), own, method.name)
        for row, k in enumerate(below, start=len(speeds)):
            values = method.missing[k][2]
            if values is not None:
                name = f"_{method.name}" if each_joint else method.name
                draw_line(grid[row, column], x, values, own, name)
        if each_joint:
            heading(grid[0, column], method.name, wide / columns)
    for row, kind in enumerate(speeds):
        joints = [j for j in range(n) if kinds[j] is kind]
        grid[row, 0].set_ylabel(
            f"joint speed\n({kind.of(1)})"
            if each_joint
            else f"greatest joint\nspeed ({kind.of(1)})"
        )
        for axes in grid[row]:
            _powers(axes, "y", _data(axes))
            if bounds is not None:
                _limits(axes, bounds, joints, kind, labels, each_joint)
    for row, k in enumerate(below, start=len(speeds)):
        what, of, _ = methods[0].missing[k]
        grid[row, 0].set_ylabel(f"{what} ({of})" if of else what)
        if k == 2:
            for axes in grid[row]:
                _powers(axes, "y", _data(axes))
    near = np.median(np.abs(x)) < 0.25 * np.abs(x).max()
    for axes in grid[-1]:
        axes.set_xlabel(wrapped(f"{distance_name} ({unit.value})", wide / columns))
        if near if logarithmic is None else logarithmic:
            _powers(axes, "x", x)
    figure.align_ylabels()
    handles = [line for axes in grid[: len(speeds), 0] for line in axes.get_lines()
               if not str(line.get_label()).startswith("_")]  # fmt: skip
    unique = {str(line.get_label()): line for line in reversed(handles)}
    ordered = labels if each_joint else [method.name for method in methods]
    shown = [unique[label] for label in ordered if len(ordered) > 1 or each_joint]
    legend_above(figure, shown + limit_handles(figure), title)
    return figure


def _methods(solutions: Any, names: Sequence[str] | None, N: int) -> list[_Method]:
    """The methods with their names, checked."""
    if isinstance(solutions, Mapping):
        given, known = list(solutions.values()), [str(name) for name in solutions]
        if names is not None:
            raise InvalidValueError("names: a mapping of solutions has its own names.")
    elif isinstance(solutions, Sequence) and not isinstance(solutions, str):
        given = list(solutions)
        known = [f"method {k + 1}" for k in range(len(given))]
        if names is not None:
            known = texts(names, len(given), "names", "methods")
    else:
        raise InvalidValueError(
            "solutions: expected solutions by the names of their methods, or a list of them, got "
            f"{type(solutions).__name__}."
        )
    if not given:
        raise InvalidValueError("solutions: expected at least one method, got none.")
    if len(set(known)) < len(known):
        raise InvalidValueError(f"names: expected a different one for each method, got {known}.")
    methods = [_method(each, name, N) for each, name in zip(given, known, strict=True)]
    counts = {method.v.shape[1] for method in methods}
    if len(counts) > 1:
        raise ShapeError(f"solutions: expected one robot, got {sorted(counts)} joints.")
    return methods


def _method(solution: Any, name: str, N: int) -> _Method:
    mask: NDArray[np.bool_] = np.ones(6, dtype=bool)
    values = None
    if isinstance(solution, IKMSolution):
        v, error, mask = solution.v, solution.error, solution.mask
        if solution.a is not None:
            raise InvalidValueError(f"{name!r}: these are accelerations, not velocities.")
        if solution.singular_values.size:
            values = solution.singular_values[..., -1]
    elif isinstance(solution, tuple) and len(solution) == 2:
        v, error = solution
    else:
        raise InvalidValueError(
            f"{name!r}: expected an IKMSolution or a pair (velocities, error), got "
            f"{type(solution).__name__}."
        )
    v = as_reals(v, f"velocities of {name!r}")
    if v.ndim != 2 or len(v) != N or not v.shape[1]:
        raise ShapeError(f"{name!r}: expected velocities of shape ({N}, n), got {v.shape}.")
    parts: list[Array | None] = [None, None]
    if error is not None:
        error = as_reals(error, f"error of {name!r}")
        if error.shape != (N, 6):
            raise ShapeError(f"{name!r}: expected errors of shape ({N}, 6), got {error.shape}.")
        rows = (slice(0, 3), slice(3, 6))
        parts = [np.linalg.norm(error[:, r], axis=1) if mask[r].any() else None for r in rows]
    return _Method(name, v, parts[0], parts[1], values)


def _data(axes: Any) -> Array:
    return np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()]
                          or [np.empty(0)])  # fmt: skip


def _powers(axes: Any, which: str, values: Array) -> None:
    """A scale of powers where values differ by more than a decade or two; around zero linear."""
    from matplotlib.ticker import FixedLocator, LogFormatterMathtext, NullLocator

    sizes = np.abs(values[np.isfinite(values)])
    most = float(sizes.max(initial=0.0))
    some = sizes[sizes > _LEAST * most]
    if not some.size or most < _DECADES * some.min():
        return
    if sizes.min() > _LEAST * most and (values[np.isfinite(values)] > 0.0).all():
        axes.set(**{f"{which}scale": "log"})
        return
    least = 10.0 ** np.floor(np.log10(float(some.min())))
    signed = bool((values < 0.0).any())
    getattr(axes, f"set_{which}scale")("symlog", linthresh=least, linscale=1.0 if signed else 0.5)
    # as many powers as there is room for, and zero
    lowest, highest = round(np.log10(least)) + signed, int(np.floor(np.log10(most)))
    step = -(-(highest - lowest + 1) // (3 if signed else 5))
    powers = 10.0 ** np.arange(highest, lowest - 1, -step)
    axis = getattr(axes, f"{which}axis")
    axis.set_major_locator(FixedLocator(sorted({*powers, 0.0, *(-powers if signed else ())})))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(LogFormatterMathtext(linthresh=least))
    if not signed:
        axes.set(**{f"{which}lim": (0.0, 1.5 * most)})


def _limits(
    axes: Any,
    limits: MotionLimits,
    joints: Sequence[int],
    unit: Unit,
    names: Sequence[str],
    each_joint: bool,
) -> None:
    """The velocities of these joints; of one joint after the other in its colour."""
    some = list(joints)
    most = unit.factor * np.maximum(limits.velocity[some], -limits.velocity_lower[some])
    none = np.full(len(some), -np.inf)
    if each_joint:
        colors = [line_style(j).color for j in some]
        limit_lines(axes, none, most, colors, [names[j] for j in some])
        return
    for value in np.unique(most[np.isfinite(most)]):
        sharing = [names[j] for j, own in zip(some, most, strict=True) if own == value]
        limit_lines(axes, none[:1], np.array([value]), [INK], [" and ".join(sharing)])
