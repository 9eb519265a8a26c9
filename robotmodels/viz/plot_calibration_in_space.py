"""Where in space a robot errs, before and after its calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact
from ..calibration.residuals import MeasuredResiduals, measured_residuals
from ..calibration.result import CalibrationResult
from ..errors import InvalidValueError
from .figures import ALERT, INK, LABEL_SIZE, PAGE, new_figure
from .plot_calibration_residuals import AFTER, BEFORE, as_result
from .plot_pose_path import _across, _box, _style, _taken
from .plot_units import Unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NEAR = 0.3
"""Extent from which the axes are in metres."""
_LONGEST = 0.16
"""Length of the longest arrow beside the longest edge of the box."""


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
    they are magnified as it stands over each side. Crosses are outliers, without arrows.

    Parameters
    ----------
    result : CalibrationResult
        Of `calibration.fit`.
    magnification : float, optional
        Of the arrows on both sides; default for each side so that they can be seen.
    view : array_like, shape (2,), optional
        Azimuth and elevation of the eye, rad.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

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
    sides = [np.concatenate([-_position(part, x) for part in parts])[usual] for x in range(2)]
    outside, p = p[~usual], p[usual]
    angles = _across(p) if view is None else as_exact(view, (2,), "view")
    figure = new_figure(PAGE, 0.56 * PAGE, size)
    figure.set_layout_engine("none")
    extent = float(np.ptp(p, axis=0).max()) or float(np.abs(p).max()) or 1.0
    unit = Unit.METRE if extent > _NEAR else Unit.MILLIMETRE
    k = unit.factor
    both: list[tuple[Any, Array]] = []
    names = ("before (base and tool fitted)", "after")
    for side, (error, style, name) in enumerate(zip(sides, (BEFORE, AFTER), names, strict=True)):
        length = np.linalg.norm(error, axis=1)
        most = float(length.max())
        scale = magnification or (_round(_LONGEST * extent / most) if most > 1e-12 else 1.0)
        axes: Any = figure.add_subplot(1, 2, side + 1, projection="3d")
        axes.quiver(
            *(k * p).T, *(k * scale * error).T, color=style.color, linewidth=1.0,
            arrow_length_ratio=0.3,
        )  # fmt: skip
        dot = 5.0 if len(p) <= 100 else 2.0
        axes.scatter(*(k * p).T, s=dot, color=INK, alpha=0.5, depthshade=False, linewidth=0.0)
        axes.scatter(
            *(k * outside).T, s=22.0, color=ALERT, marker="x", depthshade=False, linewidth=1.0
        )
        edges = _box(axes, k * np.concatenate([p, p + scale * error, outside]))
        _style(axes, unit, angles, edges)
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.labelpad = 2.5
        rms = float(np.sqrt(np.mean(length**2)))
        axes.set_title(
            f"{name}: rms {1e3 * rms:.3g} mm, arrows x {scale:g}", size=LABEL_SIZE, color=INK
        )
        both.append((axes, edges))
    if title is not None:
        figure.suptitle(title, size=LABEL_SIZE + 1.0, color=INK)
    for side, (axes, edges) in enumerate(both):
        _fill_side(figure, axes, edges, side, 0.84 if title is not None else 0.9)
    return figure


def _has_position(part: MeasuredResiduals) -> bool:
    m = part.measurement
    return len(m.views) == 1 and set("xyz") <= set(m.axes)


def _position(part: MeasuredResiduals, side: int) -> Array:
    columns = [part.measurement.axes.index(axis) for axis in "xyz"]
    return (part.before, part.after)[side][:, columns]


def _round(value: float) -> float:
    """The next smaller of 1, 2, 5 times a power of ten; 1 at least, for arrows as they are."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(1.0, power * max(k for k in (1.0, 2.0, 5.0) if k * power <= value * 1.0001)))


def _fill_side(figure: Figure, axes: Any, edges: Array, side: int, top: float) -> None:
    """Place the box so that it fills its half of the figure below the headings."""
    width, height = figure.bbox.size
    pad = 0.012 * width
    room = np.array((0.5 * width, top * height)) - 2.0 * pad
    middle = np.array(((0.25 + 0.5 * side) * width, 0.5 * top * height))
    zoom, shift = 1.0, np.zeros(2)
    for _ in range(6):
        axes.set_position((0.5 * side + shift[0] / width, shift[1] / height, 0.5, top))
        axes.set_box_aspect(edges, zoom=zoom)
        figure.draw_without_rendering()
        low, high = _taken(axes)
        fit, off = float((room / (high - low)).min()), middle - 0.5 * (low + high)
        if 0.98 < fit < 1.02 and np.abs(off).max() < pad:
            break
        zoom, shift = zoom * fit, shift + fit * off
    # the heading stays over its half wherever the box went
    axes.title.set_visible(False)
    figure.text(
        0.25 + 0.5 * side, top + 0.02, axes.get_title(), size=LABEL_SIZE, color=INK, ha="center"
    )
    for artist in axes.get_children():
        artist.set_clip_on(False)
