"""Loads of a robot, and equations of several logs in common unknowns.

Source: W. Khalil, M. Gautier and P. Lemoine, "Identification of the payload inertial parameters of
industrial manipulators", IEEE ICRA 2007, section III.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_exact, read_only
from .._arrays.tasks import Task, results
from ..errors import InvalidValueError
from ..estimation.estimate import NamedValues
from ..estimation.factor import TriangularFactors, merged_all, reduced
from ..inertia import PARAMETERS, InertialParameters
from ..logs import Log
from ..logs.log import check_is_log
from ..minimal_parameters import BaseParameters
from ..table_text import boxed
from .equations import Block, Equations, equations, parts
from .forms import RowForm, torque_block
from .processing import checked_processing, choose_processing
from .signals import Piece, Processing

UNIDENTIFIABLE = 1e-7
"""Rank tolerance: residual column norm relative to the largest."""
DEPENDENT = 1e-10  # rank tolerance: singular value relative to the largest


def equations_of(
    base: BaseParameters, logs: Sequence[Log], processing: Processing | None
) -> tuple[Equations, ...]:
    """Equations of logs with common processing, by default chosen for the first log."""
    for log in logs:
        check_is_log(log)
    given = checked_processing(processing, logs[0])
    choices = given if isinstance(given, Processing) else choose_processing(logs[0], **given)
    if any(abs(log.dt - choices.dt) > 1e-9 * choices.dt for log in logs):
        slowest = max(log.dt for log in logs)
        raise InvalidValueError(
            "log: the logs have different sampling periods; read all with read_log(..., "
            f"dt={slowest:g})."
        )
    return tuple(equations(base, log, choices) for log in logs)


@dataclass(frozen=True, slots=True, eq=False)
class CommonEquations:
    """Equations of several logs: rows formed at the rate of the log, then mapped to p unknowns.

    Shapes: maps (columns of the rows, p), None for the identity.
    """

    systems: tuple[Equations, ...]
    names: tuple[str, ...]
    maps: tuple[Array | None, ...]
    form: RowForm | None = None

    def blocks(self) -> Iterator[Block]:
        """Equations of all logs in the common unknowns, piece by piece."""
        return map(self._block, self._pieces())

    def reduced(self, executor: Executor | None = None) -> TriangularFactors:
        """Triangular factors of all logs; a task has the samples of its piece alone."""

        def tasks() -> Iterator[Task]:
            for system, M in zip(self.systems, self.maps, strict=True):
                for part, piece in parts(system, executor is not None):
                    own = replace(self, systems=(part,), maps=(M,))
                    yield partial(own._factors, piece), 0.0

        return merged_all(factors for factors, _ in results(tasks(), executor))

    def columns(self, kept: NDArray[np.int64]) -> CommonEquations:
        """The same equations in some of the unknowns."""
        maps = tuple(None if M is None else M[:, kept] for M in self.maps)
        return replace(self, names=tuple(self.names[k] for k in kept), maps=maps)

    def _pieces(self) -> Iterator[tuple[int, Piece]]:
        return ((k, piece) for k, system in enumerate(self.systems) for piece in system.pieces())

    def _factors(self, piece: Piece) -> TriangularFactors:
        """Triangular factors of a piece of the first log."""
        return reduced(self.names, (self._block((0, piece)),))

    def _block(self, number: tuple[int, Piece]) -> Block:
        k, piece = number
        block, M = torque_block(self.systems[k], piece, self.form), self.maps[k]
        return block if M is None else replace(block, W=block.W @ M)


def column_lengths(R: Array) -> Array:
    """Lengths of columns, 1 for those that are zero."""
    lengths = np.linalg.norm(R, axis=0)
    return np.where(lengths > 0.0, lengths, 1.0)


def scaled_inverse(R: Array) -> Array:
    """Pseudo-inverse of a matrix, its rank decided for columns of unit length."""
    lengths = column_lengths(R)
    return np.linalg.pinv(R / lengths, rcond=DEPENDENT) / lengths[:, None]


class NamedEstimate(NamedValues):
    """Base of results with names, values, covariance and status that print as a table."""

    __slots__ = ()

    def __str__(self) -> str:
        if not np.isfinite(self.values).all():
            return self.reason()
        numbers = (("value", self.values, ".4g"), ("standard error", self.standard_errors, ".2g"))
        columns = [(head, [format(x, digits) for x in row]) for head, row, digits in numbers]
        return f"{boxed([('parameter', list(self.names)), *columns])}\n{self.reason()}"

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self.names)} parameters, {self.status.name}>"


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
