"""Velocity and force ellipsoids in a figure: their shadows on the planes of the world."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array
from ..errors import InvalidValueError
from ..kinematics.ellipsoid import Ellipsoid, EllipsoidQuantity
from .ellipsoid import as_ellipsoids
from .figures import (
    PAGE,
    THIN_WIDTH,
    LineStyle,
    legend_above,
    line_style,
    new_figure,
    panels,
    texts,
)
from .palette import INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PLANES = ((0, 1), (0, 2), (1, 2))
_SYMBOLS = {
    EllipsoidQuantity.LINEAR_VELOCITY: "v",
    EllipsoidQuantity.ANGULAR_VELOCITY: "ω",
    EllipsoidQuantity.FORCE: "f",
    EllipsoidQuantity.MOMENT: "m",
}
_MARGIN = 1.15
_LONGEST = 8.0  # the picture holds so many times the least radius of an open ellipsoid
_FAR = 1e3  # of what is shown: to there lines without an end are drawn
_FLAT = 1e-9


def plot_ellipsoids(
    ellipsoids: Ellipsoid | Sequence[Ellipsoid],
    *,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Shadows of ellipsoids on the planes xy, xz and yz of the world, a row for each quantity.

    A shadow shows the largest component along every direction of the plane. The principal axes
    are drawn in it, those that have no end as dashes to the border of the picture.

    Parameters
    ----------
    ellipsoids : Ellipsoid or sequence of Ellipsoid
        One, several, or batches, which are taken apart.
    labels : sequence of str, optional
        Texts of the legend: the first is for the first ellipsoid of every quantity, and so on.
        Default numbers, if a quantity has several.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        Its axes are in the units of the quantities, equal in x and y.

    Raises
    ------
    InvalidValueError, ShapeError
        No ellipsoids; not as many labels as the quantity with the most of them has ellipsoids.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Khalil and Dombre, section 5.8.2.

    Examples
    --------
    >>> egg = Ellipsoid(EllipsoidQuantity.FORCE, np.zeros(3), np.eye(3), [20.0, 10.0, 5.0], 3)
    >>> figure = plot_ellipsoids(egg)
    >>> [(a.get_xlabel(), a.get_ylabel()) for a in figure.axes][1]
    ('$f_x$ (N)', '$f_z$ (N)')
    """
    given = as_ellipsoids(ellipsoids)
    if not given:
        raise InvalidValueError("ellipsoids: expected at least one, got none.")
    rows = [[e for e in given if e.quantity is quantity] for quantity in EllipsoidQuantity]
    rows = [own for own in rows if own]
    count = max(len(own) for own in rows)
    numbers = [str(k + 1) for k in range(count)]
    names = numbers if labels is None else texts(labels, count, "labels", "ellipsoids of a kind")
    figure = new_figure(PAGE, 0.35 + 2.35 * len(rows), size)
    places = panels(figure, len(rows), len(_PLANES))
    handles = dict[str, Any]()
    for place, own in zip(places, rows, strict=True):
        quantity = own[0].quantity
        half = _shown(np.array([e.radii for e in own]))
        for axes, plane in zip(place, _PLANES, strict=True):
            for k, ellipsoid in enumerate(own):
                line = _shadow(axes, ellipsoid, plane, half, line_style(k), names[k])
                handles.setdefault(names[k], line)
            x, y = (f"${_SYMBOLS[quantity]}_{'xyz'[i]}$ ({quantity.unit})" for i in plane)
            axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal", xlabel=x, ylabel=y)
            axes.locator_params(nbins=5)
    several = count > 1 or labels is not None
    legend_above(figure, list(handles.values()) if several else [], title)
    return figure


def _shown(radii: Array) -> float:
    """Half the width of a picture that holds what is finite."""
    finite = radii[np.isfinite(radii) & (radii > 0)]
    if not finite.size:
        return 1.0
    longest = float(finite.max())
    if not np.isfinite(radii).all():
        longest = min(longest, _LONGEST * float(finite.min()))
    return _MARGIN * longest


def _shadow(
    axes: Axes,
    ellipsoid: Ellipsoid,
    plane: tuple[int, int],
    half: float,
    style: LineStyle,
    label: str,
) -> Any:
    """The shadow's border, its surface, and the principal axes; returns the border."""
    far = _FAR * half
    U, r = ellipsoid.axes[list(plane)], ellipsoid.radii
    endless = ~np.isfinite(r)
    points = _border(U, r, endless, half, far)
    (line,) = axes.plot(
        *points.T, color=style.color, linewidth=1.2, linestyle=style.dashes, label=label, zorder=3
    )
    axes.fill(*points.T, facecolor=style.color, alpha=0.10, linewidth=0.0, zorder=2)
    for u, radius, no_end in zip(U.T, r, endless, strict=True):
        if np.linalg.norm(u) < 1e-6 or radius == 0.0:
            continue
        end = u * (far if no_end else radius)
        axes.plot(
            (-end[0], end[0]), (-end[1], end[1]), color=style.color, linewidth=THIN_WIDTH,
            linestyle=(0, (6.0, 3.0)) if no_end else "-", alpha=0.8, zorder=2.5,
            label="_axis without end" if no_end else "_axis",
        )  # fmt: skip
    if not (r > 0).any():
        axes.plot(0.0, 0.0, marker="o", markersize=3.0, color=INK, label="_nothing moves")
    return line


def _border(U: Array, r: Array, endless: NDArray[np.bool_], half: float, far: float) -> Array:
    """Border of the shadow (k, 2): an ellipse, or the strip or plane that endless axes make of it.

    The point of the border with the normal (cos t, sin t) is ``Q n / sqrt(n^T Q n)``, where Q is
    the sum of ``r_i^2 u_i u_i^T`` over the axes' shadows u_i.
    """
    t = np.linspace(0.0, 2.0 * np.pi, 181)
    n = np.stack((np.cos(t), np.sin(t)), axis=-1)
    finite = np.where(endless, 0.0, r)
    Q = (U * finite**2) @ U.T
    long = [u / np.linalg.norm(u) for u, e in zip(U.T, endless, strict=True)
            if e and np.linalg.norm(u) > 1e-6]  # fmt: skip
    if not long:
        width = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", n, Q, n), 0.0))
        floor = _FLAT * half
        return (n @ Q) / np.maximum(width, floor)[:, None]
    across = np.array((-long[0][1], long[0][0]))
    others = [abs(float(across @ u)) for u in long[1:]]
    wide = far if max(others, default=0.0) > 1e-6 else float(np.sqrt(max(across @ Q @ across, 0.0)))
    corners = np.array(((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)), float)
    return corners * (far, wide) @ np.array((long[0], across))
