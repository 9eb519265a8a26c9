"""Points as fixtures: three unknown coordinates for each label."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..._arrays import Array, as_exact, read_only
from .labelled import Labelled
from .measurement import Fixture


def as_point(value: Any, name: str) -> Array:
    """Check a known point."""
    return read_only(as_exact(value, (3,), name))


def point_fixtures(kind: Labelled) -> tuple[Fixture, ...]:
    """Coordinates of the unknown points of a kind of measurement."""
    return tuple(
        Fixture(f"{kind.name}:{label}.{axis}", "m") for label in kind.unknown for axis in "xyz"
    )


def labelled_points(kind: Labelled, values: Array) -> tuple[Array, Array]:
    """Point of the label of each block.

    Shapes: values (F,) -> points (B, 3), derivative (B, 3, F).
    """
    place = {**dict(zip(kind.unknown, values.reshape(-1, 3), strict=True)), **kind.known}
    derivative = np.zeros((kind.blocks, 3, len(values)))
    group = kind.unknown_groups
    for g in range(len(kind.unknown)):
        derivative[group == g, :, 3 * g : 3 * g + 3] = np.eye(3)
    return np.array([place[label] for label in kind.label]), derivative


def known_points(kind: Labelled) -> tuple[Array, Array]:
    """Places from which a robot can be dilated without leaving the known points.

    Shapes: -> A (m, 3), b (m,).
    """
    places = list(kind.known.values())
    return np.tile(np.eye(3), (len(places), 1)), np.array(places).reshape(-1)
