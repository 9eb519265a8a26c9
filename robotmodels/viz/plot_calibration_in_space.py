"""Where in space a robot errs, before and after its calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact
from ..calibration.report import MeasuredResiduals, measured_residuals
from ..calibration.result import CalibrationResult
from ..errors import InvalidValueError
from .figures import LABEL_SIZE, PAGE, new_figure
from .palette import ALERT, INK
from .plot_calibration_cells import Cell, far_apart, fill_cells
from .plot_calibration_residuals import AFTER, BEFORE, as_result
from .plot_pose_path import _across, _box, _style
from .plot_units import Unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NEAR = 0.3
"""Extent from which the axes are in metres."""
_LONGEST = 0.16
"""Length of the longest arrow beside the longest edge of the box."""
_TALLEST, _TALLEST_OF_MANY = 0.56 * PAGE, 2.6
"""Height of a row of panels, inches, of one and of several."""
_FAR, _SPOT = 0.2, 0.03
"""Distances of places and of spots where arrows start, beside the longest edge of the box."""
_ROUND = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)
_MOST_PLACES, _FEWEST = 12, 4
"""Of panels one below the other; points in each."""


def plot_calibration_in_space(
    result: CalibrationResult,
    *,
    magnification: float | None = None,
    view: ArrayLike | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Errors of position as arrows where the end was, before (left) and after (right).

    Arrows go from where the robot says that its end is towards where it was measured or touched;
    they are magnified as it stands over each panel. Crosses are outliers, without arrows. Places
    that are small and far from each other, such as sockets around the robot, have a row of panels
    each, with limits and a magnification of their own.

    Parameters
    ----------
    result : CalibrationResult
        Of `calibration.fit`.
    magnification : float, optional
        Of the arrows in all panels; default for each panel so that they can be seen.
    view : array_like, shape (2,), optional
        Azimuth and elevation of the eye, rad; default for each place across its longest
        horizontal direction.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches; default as wide as a page and as high as its panels need.

    Returns
    -------
    matplotlib.figure.Figure
        Measurements without three coordinates of a position are left out.

    Raises
    ------
    InvalidValueError
        Not a result; nothing in it that has a position; a magnification that is not positive.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book section 1.4.4.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> arm = rm.load("rx90")
    >>> real = arm.with_tool(rm.se3.translation(0.0, 0.0, 0.1))
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> result = calibration.fit(arm, calibration.Pose(q, rm.dgm(real, q)), folds=0, held_out=0.0)
    >>> plot_calibration_in_space(result, magnification=100).axes[0].get_title().split(",")[-1]
    ' arrows x 100'
    """
    parts = [part for part in measured_residuals(as_result(result)) if _has_position(part)]
    if not parts:
        raise InvalidValueError(
            "result: none of its measurements has the three coordinates of a position; see "
            "plot_calibration_residuals."
        )
    if magnification is not None and float(as_exact(magnification, (), "magnification")) <= 0.0:
        raise InvalidValueError(f"magnification: expected a positive number, got {magnification}.")
    p = np.concatenate([part.p for part in parts])
    outlier = np.concatenate([part.outlier for part in parts])
    usual = ~outlier if not outlier.all() else outlier
    sides = [np.concatenate([-_position(part, x) for part in parts]) for x in range(2)]
    names = np.repeat([part.measurement.name for part in parts], [len(part.p) for part in parts])
    place = _places(p, usual)
    titles = _titles(names, place)
    figure = new_figure(PAGE, _TALLEST, size)
    figure.set_layout_engine("none")
    cells = []
    for row, place_title in enumerate(titles):
        here, gone = usual & (place == row), ~usual & (place == row)
        angles = _across(p[here]) if view is None else as_exact(view, (2,), "view")
        for column, style in enumerate((BEFORE, AFTER)):
            axes: Any = figure.add_subplot(len(titles), 2, 2 * row + column + 1, projection="3d")
            error = sides[column][here]
            edges, scale = _arrows(
                axes, p[here], error, p[gone], magnification, style.color, angles
            )
            every = sides[column][place == row]  # outliers count, as in the report
            rms = float(np.sqrt(np.mean(np.sum(every**2, axis=1))))
            side = ("before" if place_title else "before (base and tool fitted)", "after")[column]
            heading = f"{place_title}{side}: rms {1e3 * rms:.3g} mm, arrows x {scale:g}"
            axes.set_title(heading, size=LABEL_SIZE, color=INK)
            cells.append(Cell(axes, edges, heading, row, column))
    if title is None and len(titles) > 1:
        title = "before: base and tool fitted"
    tallest = _TALLEST if len(titles) == 1 else _TALLEST_OF_MANY
    fill_cells(figure, cells, tallest if size is None else None, 0.3 if title is not None else 0.02)
    if title is not None:
        at = 1.0 - 0.06 / figure.get_figheight()
        figure.suptitle(title, size=LABEL_SIZE + 1.0, color=INK, y=at, va="top")
    return figure


def _arrows(
    axes: Any, p: Array, error: Array, outside: Array, magnification: float | None, color: Any,
    view: Array,
) -> tuple[Array, float]:  # fmt: skip
    """Draw the errors of one place; edges of the box, and the magnification."""
    extent = float(np.ptp(p, axis=0).max()) or float(np.abs(p).max()) or 1.0
    unit = Unit.METRE if extent > _NEAR else Unit.MILLIMETRE
    k = unit.factor
    most = float(np.linalg.norm(error, axis=1).max())
    scale = magnification or (_round(_longest(p, extent) / most) if most > 1e-12 else 1.0)
    axes.quiver(
        *(k * p).T, *(k * scale * error).T, color=color, linewidth=1.0, arrow_length_ratio=0.3
    )
    dot = 5.0 if len(p) <= 100 else 2.0
    axes.scatter(*(k * p).T, s=dot, color=INK, alpha=0.5, depthshade=False, linewidth=0.0)
    axes.scatter(*(k * outside).T, s=22.0, color=ALERT, marker="x", depthshade=False, linewidth=1.0)
    edges = _box(axes, k * np.concatenate([p, p + scale * error, outside]))
    _style(axes, unit, view, edges)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.labelpad = 2.5
    return edges, scale


def _places(p: Array, usual: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Number of the place of each point; all the same unless places are small and far apart."""
    one = np.zeros(len(p), dtype=np.int64)
    group = far_apart(p[usual], _FAR)
    count = int(group.max()) + 1
    own = [p[usual][group == g] for g in range(count)]
    if not 1 < count <= _MOST_PLACES or min(len(x) for x in own) < _FEWEST:
        return one
    sizes = [float(np.ptp(x, axis=0).max()) for x in own]
    extent = float(np.ptp(p[usual], axis=0).max())
    if max(sizes) > _FAR / 3.0 * extent or max(sizes) < _SPOT * extent:
        return one
    centres = np.array([x.mean(axis=0) for x in own])
    return np.argmin(np.linalg.norm(p[:, None] - centres, axis=2), axis=1)


def _titles(names: NDArray[np.str_], place: NDArray[np.int64]) -> list[str]:
    """What stands before the heading of each place: the name of what was measured there alone."""
    count = int(place.max()) + 1
    if count == 1:
        return [""]
    own = [tuple(np.unique(names[place == row])) for row in range(count)]
    alone = all(len(some) == 1 for some in own) and len(set(own)) == count
    words = [some[0] if alone else f"place {row + 1}" for row, some in enumerate(own)]
    return [f"{word if len(word) <= 14 else word[:13] + '.'}, " for word in words]


def _longest(p: Array, extent: float) -> float:
    """Length of the longest arrow: longer where all arrows start in a few spots."""
    spot = far_apart(p, _SPOT)
    count = int(spot.max()) + 1
    if not 1 < count <= _MOST_PLACES or len(p) < _FEWEST * count:
        return _LONGEST * extent
    centres = np.array([p[spot == g].mean(axis=0) for g in range(count)])
    apart = np.linalg.norm(centres[:, None] - centres, axis=2)[np.triu_indices(count, 1)]
    return max(_LONGEST * extent, 0.45 * float(apart.min()))


def _has_position(part: MeasuredResiduals) -> bool:
    m = part.measurement
    return len(m.views) == 1 and set("xyz") <= set(m.axes)


def _position(part: MeasuredResiduals, side: int) -> Array:
    columns = [part.measurement.axes.index(axis) for axis in "xyz"]
    return (part.before, part.after)[side][:, columns]


def _round(value: float) -> float:
    """The next smaller round number; 1 at least, for arrows as they are."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(1.0, power * max(k for k in _ROUND if k * power <= value * 1.0001)))
