"""Small steps that several robots of the catalogue are put together with."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array
from ..geometry import DHTable, link_transforms
from ..inertia import InertialParameters

Vector = tuple[float, float, float]
Products = tuple[float, float, float, float, float, float]


def columns(**given: Iterable[Any]) -> list[dict[str, Any]]:
    """Rows for `DHTable.from_rows` or `DHTable.from_standard` from columns."""
    return [dict(zip(given, row, strict=True)) for row in zip(*given.values(), strict=True)]


def symmetric(values: ArrayLike) -> Array:
    """Tensors from six numbers in the order of a URDF: xx, xy, xz, yy, yz, zz."""
    return np.asarray(values, dtype=float)[..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]


@dataclass(frozen=True, slots=True)
class PublishedLink:
    """A joint's placement and its link's inertia as a URDF states them."""

    xyz: Vector
    rpy: Vector
    mass: float
    com: Vector
    inertia: Products
    inertia_yaw: float = 0.0


def inertia_in_table_frames(
    table: DHTable, links: Sequence[PublishedLink], q_zero: ArrayLike | None = None
) -> InertialParameters:
    """Move inertia that was published in a URDF's link frames to the frames of a table."""
    factors = link_transforms(table, np.zeros(table.n) if q_zero is None else q_zero)
    ours = theirs = np.eye(4)
    moved = np.empty((table.f, 4, 4))
    tensors = symmetric([link.inertia for link in links])
    for j, link in enumerate(links):
        ours = ours @ factors[j]
        theirs = theirs @ se3.from_rpy(link.rpy, link.xyz)
        moved[j] = se3.inverse(ours) @ theirs
        turn = se3.rotation("z", link.inertia_yaw)[:3, :3]
        tensors[j] = turn @ tensors[j] @ turn.T
    given = InertialParameters.from_com(
        [link.mass for link in links], [link.com for link in links], tensors
    )
    return given.moved(moved)
