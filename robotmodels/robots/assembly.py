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
    """Rows for `DHTable.from_rows` or `DHTable.from_standard` from columns.

    Parameters
    ----------
    **given : iterables of equal length
        Columns by their key, such as ``alpha=(0, 90, 0)``.

    Returns
    -------
    list of dict
        One mapping per row.

    Examples
    --------
    >>> columns(d=(0, 0.4), alpha=(0, 90))
    [{'d': 0, 'alpha': 0}, {'d': 0.4, 'alpha': 90}]
    """
    return [dict(zip(given, row, strict=True)) for row in zip(*given.values(), strict=True)]


def symmetric(values: ArrayLike) -> Array:
    """Tensors from six numbers in the order of a URDF: xx, xy, xz, yy, yz, zz.

    Parameters
    ----------
    values : array_like, shape (..., 6)
        kg m^2; the products of inertia are the tensor's entries (minus the integrals).

    Returns
    -------
    ndarray, shape (..., 3, 3)
        The same numbers as matrices.

    Examples
    --------
    >>> symmetric([1, 0, 0, 2, 0, 3])
    array([[1., 0., 0.],
           [0., 2., 0.],
           [0., 0., 3.]])
    """
    return np.asarray(values, dtype=float)[..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]


@dataclass(frozen=True, slots=True)
class PublishedLink:
    """A joint's placement and its link's inertia as a URDF states them.

    Parameters
    ----------
    xyz, rpy : tuple of 3 floats
        ``<origin>`` of the joint in the link before, metres and radians.
    mass : float
        Kilograms.
    com : tuple of 3 floats
        Centre of mass in the link's frame, metres.
    inertia : tuple of 6 floats
        About the centre of mass: xx, xy, xz, yy, yz, zz, kg m^2.
    inertia_yaw : float
        Rotation about z of the axes of ``inertia`` in the link's frame, radians.

    Examples
    --------
    >>> PublishedLink((0, 0, 0.4), (0, 0, 0), 2.0, (0, 0, 0.1), (1, 0, 0, 1, 0, 1)).mass
    2.0
    """

    xyz: Vector
    rpy: Vector
    mass: float
    com: Vector
    inertia: Products
    inertia_yaw: float = 0.0


def inertia_in_table_frames(
    table: DHTable, links: Sequence[PublishedLink], q_zero: ArrayLike | None = None
) -> InertialParameters:
    """Move inertia that was published in a URDF's link frames to the frames of a table.

    Parameters
    ----------
    table : DHTable
        A chain of n joints and no fixed frames, R_0 being the root frame of the URDF.
    links : sequence of PublishedLink, length n
        In order from the base.
    q_zero : array_like, shape (n,), optional
        Joint variables of the table at which all joints of the URDF are at zero, default zero.

    Returns
    -------
    InertialParameters
        About the origins and in the axes of the table's frames.

    Examples
    --------
    >>> table = DHTable.from_rows([{"sigma": 0, "r": 0.4}])
    >>> link = PublishedLink((0, 0, 0.3), (0, 0, 0), 2.0, (0.1, 0, 0.1), (1, 0, 0, 1, 0, 1))
    >>> inertia_in_table_frames(table, [link]).first_moments[0, 0]
    np.float64(0.2)
    """
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
