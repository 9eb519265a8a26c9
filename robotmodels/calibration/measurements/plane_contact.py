"""The end touches planes: a probe on a table, on the faces of a block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_exact, read_only
from ...errors import InvalidValueError
from ..extended_table import Frame
from .contact import Contact
from .labelled import Labels
from .measurement import Evaluation, Fixture, Linearised
from .rotation_vectors import tilt_of, tilted_axes, unit_vector

_UNIT = 1e-6


@dataclass(frozen=True, slots=True, init=False, eq=False)
class PlaneContact(Contact):
    """Touches of planes by the end's origin.

    A plane is ``normal . p = offset``. Unknown planes are estimated along: the normal as the turn
    of the world's z about x and y, rad, and the offset, m. How flat they are is part of sigma.

    The end of a ball touches a plane beside the centre of the ball: an unknown offset takes the
    radius with it as long as the plane is touched from one side; to a known one it is added.

    One inclined plane touched in many postures tells as much as touched points do. A single plane
    at right angles to the axis of the first joint (a table under an upright robot) does not see
    that joint turn, nor what moves the whole arm along the plane; `identifiable_parameters` says
    what is left out. Lay it aslant, or touch a second plane that is not parallel to it.

    Parameters
    ----------
    q : array_like, shape (N, n)
        Readings of the joints at each touch, rad or m.
    plane : array_like of int or str, shape (N,), optional
        Which plane each touch is of; default: all of the same.
    known : mapping of label to array_like, shape (4,), optional
        Planes that are known in the world: the normal (of length 1) and the offset in metres.
    sigma : array_like, shape (), (1,) or (N, 1), optional
        Standard deviations, m; default: estimated from the data.
    covariance : array_like, shape (1, 1) or (N, 1, 1), optional
        Instead of sigma.
    frame : str, int or None
        The end; None is the tool.
    name : str
        In reports, and in front of the labels: the same name and label in two measurements is the
        same plane.

    Raises
    ------
    ShapeError, InvalidValueError
        Shapes that do not fit, NaN, a normal that is not of length 1, a known plane that nobody
        touches.

    References
    ----------
    Seed book section 1.4.5.

    Examples
    --------
    >>> [fixture.name for fixture in PlaneContact(np.zeros((5, 6)), name="table").fixtures]
    ['table:0.rx', 'table:0.ry', 'table:0.offset']
    """

    _met: ClassVar[str] = "plane"

    q: Array
    plane: tuple[str, ...]
    known: Mapping[str, Array]
    sigma: Array | None
    covariance: Array | None
    frame: Frame
    name: str

    def __init__(
        self,
        q: ArrayLike,
        plane: Labels | None = None,
        known: Mapping[int | str, ArrayLike] | None = None,
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "plane",
    ) -> None:
        self._settle(q, plane, known, _as_plane, sigma, covariance, frame, name)

    @property
    def axes(self) -> tuple[str, ...]:
        """Along the normal."""
        return ("normal",)

    @property
    def units(self) -> tuple[str, ...]:
        """Metres."""
        return ("m",)

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Two turns and the offset of each unknown plane."""
        return tuple(
            Fixture(f"{self.name}:{label}.{what}", unit)
            for label in self.unknown
            for what, unit in (("rx", "rad"), ("ry", "rad"), ("offset", "m"))
        )

    @property
    def dilation_centres(self) -> tuple[Array, Array]:
        """The known planes."""
        planes = np.array(list(self.known.values())).reshape(-1, 4)
        return planes[:, :3], planes[:, 3]

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """Mean plane of the touches of each: normal where they spread least."""
        p = evaluations[0].T[:, :3, 3]
        group = self.unknown_groups
        found = np.zeros((len(self.unknown), 3))
        for g in range(len(found)):
            mine = p[group == g]
            mean = mine.mean(axis=0)
            normal = np.linalg.svd(mine - mean, full_matrices=True)[2][-1]
            # of its two normals the one that is not below the horizon: see tilted_axes
            normal = normal if normal[2] >= 0.0 else -normal
            found[g] = *tilt_of(normal), normal @ mean
        return found.ravel()

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Distance of the end from the plane."""
        T, psi = evaluations[0]
        values = fixtures.reshape(-1, 3)
        R, by_tilt = tilted_axes(values[:, :2])
        planes = {label: (R[g, :, 2], values[g, 2]) for g, label in enumerate(self.unknown)}
        planes |= {label: (plane[:3], plane[3]) for label, plane in self.known.items()}
        normal = np.array([planes[label][0] for label in self.plane])
        offset = np.array([planes[label][1] for label in self.plane])
        p = T[:, :3, 3]
        by_fixtures = np.zeros((len(T), 1, len(fixtures)))
        group = self.unknown_groups
        for g in range(len(values)):
            mine = group == g
            by_fixtures[mine, 0, 3 * g : 3 * g + 2] = p[mine] @ by_tilt[g, :, 2]
            by_fixtures[mine, 0, 3 * g + 2] = -1.0
        return Linearised(
            ((normal * p).sum(axis=1) - offset)[:, None], normal[:, None] @ psi[:, :3], by_fixtures
        )


def _as_plane(value: Any, name: str) -> Array:
    plane = as_exact(value, (4,), name)
    length = float(np.linalg.norm(plane[:3]))
    if abs(length - 1.0) > _UNIT:
        raise InvalidValueError(
            f"{name}: expected a normal of length 1 and an offset in metres, got a normal of "
            f"length {length:.6g}. Divide all four numbers by it."
        )
    return read_only(np.append(unit_vector(plane[:3]), plane[3]))
