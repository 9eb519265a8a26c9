"""Kinds of measurement before anything is measured: configurations that each of them admits.

Configurations come in groups: one posture for what is measured from outside, several postures of
the same contact for what the robot measures on itself. Each group has its own unknown point, pose
or plane.
"""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, read_only
from ..._choices import chosen
from ...errors import InvalidValueError
from ...geometry import REVOLUTE
from ...kinematics.lengths import spread_configurations
from .. import measurements as m
from ..differential import differential_model
from ..extended_table import Frame
from ..parameters import GeometricParameters
from . import Measurement
from .satisfied import satisfied_measurement

_STARTS = 6
"""Starts of the search for each posture that is asked for."""
_SAME = 1e-4
"""Postures nearer than that (rad or m) are the same."""


class Kind(Enum):
    """What could be measured; the value is the sentence.

    Examples
    --------
    >>> Kind.POINT_CONTACT.postures
    4
    """

    POSE = "poses of the end, from outside"
    POSITION = "positions of the end, from outside"
    ORIENTATION = "orientations of the end, from outside"
    FRAME_CONTACT = "the same pose reached in several postures"
    POINT_CONTACT = "the same point touched in several postures"
    PLANE_CONTACT = "the same plane touched in several postures"

    @property
    def postures(self) -> int:
        """Postures of a group, by default."""
        return _POSTURES.get(self, 1)

    @property
    def is_contact(self) -> bool:
        """Whether the postures of a group must meet."""
        return self in (Kind.FRAME_CONTACT, Kind.POINT_CONTACT, Kind.PLANE_CONTACT)


_POSTURES = {Kind.FRAME_CONTACT: 2, Kind.POINT_CONTACT: 4, Kind.PLANE_CONTACT: 6}


def as_kind(value: Any, name: str = "kind") -> Kind:
    """A kind given as a member of `Kind`, by its name, or as the class of its measurements."""
    if isinstance(value, type) and issubclass(value, Measurement):
        words = "".join(f"_{c}" if c.isupper() else c for c in value.__name__).strip("_")
        if words.upper() in Kind.__members__:
            return Kind[words.upper()]
        raise InvalidValueError(
            f"{name}: {value.__name__} alone does not say what is measured where; give measured "
            f"data, or one of {', '.join(kind.name for kind in Kind)}."
        )
    return chosen(Kind, value, name)


class Groups(NamedTuple):
    """Configurations with the group number of each. Shapes: q (N, n), label (N,)."""

    q: Array
    label: NDArray[np.int64]

    @property
    def count(self) -> int:
        """Number of groups."""
        return int(self.label[-1]) + 1 if len(self.label) else 0


def groups_of(q: Array) -> Groups:
    """Groups of the same size. Shapes: q (G, m, n)."""
    G, size, n = q.shape
    return Groups(q.reshape(-1, n), np.repeat(np.arange(G), size))


def drawn_groups(
    parameters: GeometricParameters,
    kind: Kind,
    groups: int,
    postures: int,
    rng: np.random.Generator,
    *,
    frame: Frame = None,
    deviation: Array | None = None,
    limits: bool = True,
) -> Groups:
    """Configurations spread over the joint ranges, those of a contact moved until they meet.

    Parameters
    ----------
    parameters : GeometricParameters
        Of the robot.
    kind : Kind
        What is measured.
    groups, postures : int
        How many, at most; contacts that cannot be reached in two postures are left out.
    rng : numpy.random.Generator
        Where chance comes from.
    frame : str, int or None
        The end.
    deviation : ndarray, shape (P,), optional
        Of the robot that meets the contacts; default the nominal one.
    limits : bool
        Whether postures of contacts beyond the limits of the joints are left out.

    Returns
    -------
    Groups
        Fewer than asked, or none, where few postures meet.
    """
    model = parameters.model
    if not kind.is_contact:
        return groups_of(
            spread_configurations(model, groups * postures, rng).reshape(groups, postures, -1)
        )
    first = spread_configurations(model, groups, rng)
    starts = spread_configurations(model, groups * postures * _STARTS, rng)
    label = np.repeat(np.arange(groups), postures * _STARTS)
    moving = parameters if deviation is not None else replace(parameters, entries=())
    xi = np.zeros(len(moving)) if deviation is None else deviation
    T = differential_model(moving, first, xi, frame).T
    target, group_of = _target(kind, T, starts, label, frame, rng, moving, xi)
    met = satisfied_measurement(moving, target, xi, np.zeros(0))
    found: dict[int, list[Array]] = {g: [first[g]] for g in range(groups)}
    if met is not None:
        q = _turned_inside(parameters, met.views[0].q)
        within = (q >= model.lower - 1e-9) & (q <= model.upper + 1e-9)
        inside = np.asarray(within.all(axis=1))
        for row, g, allowed in zip(q, group_of(met), inside, strict=True):
            members = found[g]
            new = len(members) < postures and all(_differ(row, other) for other in members)
            if new and (allowed or not limits):
                members.append(row)
    kept = [np.array(members) for members in found.values() if len(members) > 1]
    n = model.n
    return Groups(
        np.concatenate([np.zeros((0, n)), *kept]),
        np.repeat(np.arange(len(kept)), [len(members) for members in kept]).astype(np.int64),
    )


def measurement_of(
    parameters: GeometricParameters,
    kind: Kind,
    groups: Groups,
    *,
    frame: Frame = None,
    deviation: Array | None = None,
    sigma: Array | float | None = None,
) -> Measurement:
    """Noise-free measurement of a robot at given configurations."""
    q, label = groups
    T = differential_model(parameters, q, deviation, frame).T
    more: dict[str, Any] = {"sigma": sigma, "frame": frame}
    match kind:
        case Kind.POSE:
            return m.Pose(q, T, **more)
        case Kind.ORIENTATION:
            return m.Pose(q, T, rows=[0, 0, 0, 1, 1, 1], name="orientation", **more)
        case Kind.POSITION:
            return m.Position(q, T[:, :3, 3], **more)
        case Kind.POINT_CONTACT:
            return m.PointContact(q, label, **more)
        case Kind.FRAME_CONTACT:
            return m.FrameContact(q, label, **more)
        case Kind.PLANE_CONTACT:
            return m.PlaneContact(q, label, **more)


def _target(
    kind: Kind, T: Array, starts: Array, label: NDArray[np.int64], frame: Frame,
    rng: np.random.Generator, moving: GeometricParameters, xi: Array,
) -> tuple[Measurement, Any]:  # fmt: skip
    """What the starts shall be moved to, and a function that says which group each row is of."""
    p = T[:, :3, 3]
    places = p[label]
    if kind is Kind.PLANE_CONTACT:
        # every start goes to the foot of its perpendicular on the plane of its group
        normal = rng.normal(size=p.shape)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        starting = differential_model(moving, starts, xi, frame).T[:, :3, 3]
        height = ((starting - places) * normal[label]).sum(axis=1)
        places = starting - height[:, None] * normal[label]
    number = {place.tobytes(): int(g) for place, g in zip(places, label, strict=True)}

    def group_of(met: Any) -> list[int]:
        found = met.T[:, :3, 3] if kind is Kind.FRAME_CONTACT else met.p
        return [number[np.ascontiguousarray(place).tobytes()] for place in found]

    if kind is Kind.FRAME_CONTACT:
        return m.Pose(starts, T[label], frame=frame), group_of
    return m.Position(starts, places, frame=frame), group_of


def _turned_inside(parameters: GeometricParameters, q: Array) -> Array:
    """Revolute joints by whole turns into their limits, or near the middle where there are none."""
    model = parameters.model
    turning = model.table.sigma[model.table.joint_rows] == REVOLUTE
    both = np.isfinite(model.lower) & np.isfinite(model.upper)
    middle = np.where(
        both, 0.5 * (np.where(both, model.lower, 0) + np.where(both, model.upper, 0)), 0.0
    )
    turned = middle + np.remainder(q - middle + np.pi, 2.0 * np.pi) - np.pi
    return read_only(np.where(turning, turned, q))


def _differ(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max() > _SAME)
