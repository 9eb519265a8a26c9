"""Points as fixtures: three unknown coordinates for each label."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..._arrays import Array, as_exact, read_only
from .labelled import Labelled
from .measurement import Fixture


def as_point(value: Any, name: str) -> Array:
    """A known point at the border of a kind of measurement.

    Parameters
    ----------
    value : array_like, shape (3,)
        Metres.
    name : str
        Used in error messages.

    Returns
    -------
    ndarray, shape (3,)
        Read-only.

    Raises
    ------
    ShapeError, InvalidValueError
        Another shape, NaN.
    """
    return read_only(as_exact(value, (3,), name))


def point_fixtures(kind: Labelled) -> tuple[Fixture, ...]:
    """Coordinates of the unknown points of a kind of measurement.

    Parameters
    ----------
    kind : Labelled
        Whose labels.

    Returns
    -------
    tuple of Fixture
        ``name:label.x`` and so on, label by label.
    """
    return tuple(
        Fixture(f"{kind.name}:{label}.{axis}", "m") for label in kind.unknown for axis in "xyz"
    )


def labelled_points(kind: Labelled, values: Array) -> tuple[Array, Array]:
    """Point of the label of each block.

    Parameters
    ----------
    kind : Labelled
        Whose labels; what it knows are points of shape (3,).
    values : ndarray, shape (F,)
        Of `point_fixtures`, metres.

    Returns
    -------
    points : ndarray, shape (B, 3)
        Metres.
    derivative : ndarray, shape (B, 3, F)
        By the values.
    """
    place = {**dict(zip(kind.unknown, values.reshape(-1, 3), strict=True)), **kind.known}
    derivative = np.zeros((kind.blocks, 3, len(values)))
    group = kind.unknown_groups
    for g in range(len(kind.unknown)):
        derivative[group == g, :, 3 * g : 3 * g + 3] = np.eye(3)
    return np.array([place[label] for label in kind.label]), derivative


def known_points(kind: Labelled) -> tuple[Array, Array]:
    """Places from which a robot can be dilated without leaving the known points.

    Parameters
    ----------
    kind : Labelled
        What it knows are points of shape (3,).

    Returns
    -------
    A : ndarray, shape (m, 3)
        As `Measurement.dilation_centres`.
    b : ndarray, shape (m,)
        Metres.
    """
    places = list(kind.known.values())
    return np.tile(np.eye(3), (len(places), 1)), np.array(places).reshape(-1)
