"""Loads of a robot and the unknowns that logs with and without them have in common.

Source: W. Khalil, M. Gautier and P. Lemoine, "Identification of the payload inertial parameters of
industrial manipulators", IEEE ICRA 2007, section III.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_exact, read_only
from ..errors import InvalidValueError
from ..inertia import PARAMETERS, InertialParameters
from ..logs import Log
from ..logs.log import check_is_log
from ..minimal_parameters import BaseParameters


@dataclass(frozen=True, slots=True, eq=False)
class KnownPayload(Rebuilt):
    """Payload of known mass, and optionally known centre of mass and inertia.

    Parameters
    ----------
    mass : float
        Kilograms, positive.
    com : array_like, shape (3,), optional
        Centre of mass in the frame, metres; default not known.
    inertia : array_like, shape (3, 3), optional
        About the centre of mass, in the axes of the frame, kg m^2; it needs ``com``.
    frame : str or int, optional
        Frame that carries the load; default the tool.

    Examples
    --------
    >>> disc = KnownPayload(2.0, com=[0.0, 0.0, 0.1])
    >>> [name for name, known in zip(PARAMETERS, disc.known) if known]
    ['MX', 'MY', 'MZ', 'M']
    """

    mass: float
    com: ArrayLike | None = None
    inertia: ArrayLike | None = None
    frame: str | int | None = None

    def __post_init__(self) -> None:
        mass = float(as_exact(self.mass, (), "mass"))
        if not mass > 0.0:
            raise InvalidValueError(
                f"mass: expected a positive mass, got {mass} kg; a log without load is unloaded."
            )
        if self.inertia is not None and self.com is None:
            raise InvalidValueError(
                "com: an inertia is about the centre of mass; give com= with it, or neither."
            )
        object.__setattr__(self, "mass", mass)
        for name, shape in (("com", (3,)), ("inertia", (3, 3))):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, read_only(as_exact(value, shape, name)))
        _ = self.parameters  # raises for a tensor that is not symmetric

    @property
    def known(self) -> NDArray[np.bool_]:
        """Mask of the known ones among ``XX XY XZ YY YZ ZZ MX MY MZ M``, shape (10,)."""
        return np.array([self.inertia is not None] * 6 + [self.com is not None] * 3 + [True])

    @property
    def parameters(self) -> Array:
        """The ten parameters about the frame's origin, zero where they are not known."""
        point = np.zeros(3) if self.com is None else np.asarray(self.com)
        tensor = np.zeros((3, 3)) if self.inertia is None else np.asarray(self.inertia)
        row = InertialParameters.from_com([self.mass], point[None], tensor[None]).values[0]
        return np.where(self.known, row, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class LoadedLog:
    """A log of the robot with a load of known mass.

    Parameters
    ----------
    log, payload : Log, KnownPayload
        Logs that share one payload object share its unknown parameters.
    """

    log: Log
    payload: KnownPayload

    def __post_init__(self) -> None:
        check_is_log(self.log)
        if not isinstance(self.payload, KnownPayload):
            raise InvalidValueError(
                f"payload: expected KnownPayload(mass, ...), got {type(self.payload).__name__}."
            )


class UnknownPayload(NamedTuple):
    """Load without known parameters."""

    frame: str | int | None
    known: NDArray[np.bool_] = np.zeros(10, dtype=bool)
    parameters: Array = np.zeros(10)


def common_unknowns(
    base: BaseParameters,
    loads: Sequence[KnownPayload | UnknownPayload | None],
    changed: tuple[str, ...] = (),
) -> tuple[tuple[str, ...], tuple[Array, ...]]:
    """Names of the unknowns (known parts of the loads last), and the map of each log.

    Shapes: maps (b, p).
    """
    separate = [k for k, name in enumerate(base.names) if name.rstrip("0123456789") in changed]
    names = [*base.names, *(f"{base.names[k]} loaded" for k in separate)]
    first: dict[int, int] = {}
    for load in loads:
        if load is not None and id(load) not in first:
            first[id(load)] = len(names)
            unknown = (p for p, known in zip(PARAMETERS, load.known, strict=True) if not known)
            names += [f"{name} load {len(first)}" for name in unknown]
    maps = [np.eye(len(base), len(names) + 1) for _ in loads]
    for load, M in zip(loads, maps, strict=True):
        if load is not None:
            P = payload_columns(base, load.frame)
            unknown = P[:, ~load.known]
            M[:, first[id(load)] : first[id(load)] + unknown.shape[1]] = unknown
            M[:, -1] = P @ load.parameters
            for place, k in enumerate(separate, start=len(base)):
                M[k, [k, place]] = 0.0, 1.0
    return (*names, "known load"), tuple(maps)


def payload_columns(base: BaseParameters, frame: str | int | None) -> Array:
    """Base parameters of the ten inertial parameters of a body on a frame. Shapes: -> (b, 10)."""
    place = base.model.twin.frame(frame)
    if place.parent == 0:
        raise InvalidValueError(
            f"frame: {frame!r} is fixed to the base, where a body loads no joint; give a frame of "
            "a link."
        )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = place.rotation, place.position
    moved = InertialParameters(np.eye(10)).moved(np.broadcast_to(pose, (10, 4, 4))).values
    first = 10 * (place.parent - 1)
    return base.matrix[:, first : first + 10] @ moved.T
