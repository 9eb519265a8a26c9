"""What every kind of measurement tells a calibration: predicted minus measured, and derivatives.

A kind asks for poses of ends of the robot at configurations (its views), may have unknown
fixtures of its own (a touched point, a plane, a target), and gives rows of residuals in blocks: one
block for each measurement, of a fixed number of rows.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ..extended_table import Frame


class View(NamedTuple):
    """Poses that a measurement needs: an end and the configurations. Shapes: q (N, n)."""

    frame: Frame
    q: Array


class Evaluation(NamedTuple):
    """Poses of a view and their derivatives by the parameters.

    Shapes: T (N, 4, 4), psi (N, 6, P).
    """

    T: Array
    psi: Array


class Fixture(NamedTuple):
    """Unknown that is not a robot parameter; equal names are the same unknown."""

    name: str
    unit: str


class Linearised(NamedTuple):
    """Residuals of a kind and their derivatives.

    Shapes: residual (B, k), by_parameters (B, k, P), by_fixtures (B, k, F).
    """

    residual: Array
    by_parameters: Array
    by_fixtures: Array


class FileRows(NamedTuple):
    """Name and number of rows of a file."""

    name: str
    rows: int

    def __str__(self) -> str:
        return f"{self.name} ({self.rows} rows)"


class FileRow(NamedTuple):
    """Row of a file, counted from 1 without the header."""

    name: str
    row: int

    def __str__(self) -> str:
        return f"{self.name} row {self.row}"


class Measurement(ABC):
    """Base of the kinds of measurement; frozen dataclasses with B blocks of k rows."""

    __slots__ = ("_origin",)

    name: str
    sigma: Array | None
    covariance: Array | None

    @property
    def files(self) -> tuple[FileRows, ...]:
        """Files that it was read from, with their numbers of rows; none if it was not."""
        return tuple(
            FileRows(*item) for item in Counter(row.name for row in origin_of(self)).items()
        )

    @property
    def _arguments(self) -> tuple[Any, ...]:
        """What it is made again from."""
        return tuple(getattr(self, f.name) for f in fields(self) if f.init)  # type: ignore[arg-type]

    def __reduce__(self) -> tuple[Any, ...]:
        return _made_again, (type(self), self._arguments, origin_of(self))

    @property
    @abstractmethod
    def blocks(self) -> int:
        """Number of blocks B."""

    @property
    @abstractmethod
    def axes(self) -> tuple[str, ...]:
        """Label of each of the k rows of a block."""

    @property
    @abstractmethod
    def units(self) -> tuple[str, ...]:
        """``"m"`` or ``"rad"`` for each of the k rows of a block."""

    @property
    @abstractmethod
    def views(self) -> tuple[View, ...]:
        """Poses that are needed; block b uses row b of each view."""

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Unknowns besides the robot's."""
        return ()

    @property
    def is_constraint(self) -> bool:
        """Whether the measurement is a contact or another constraint.

        Ranks are then judged at readings that satisfy the constraint exactly.
        """
        return False

    @property
    @abstractmethod
    def knows_length(self) -> bool:
        """Whether a length is measured or given, so that the scale of the robot is seen."""

    @property
    @abstractmethod
    def sees_base(self) -> bool:
        """Whether the base pose matters."""

    @property
    def dilation_centres(self) -> tuple[Array, Array]:
        """Linear conditions ``A c = b`` on centres of dilation, shapes (m, 3) and (m,).

        A contact is still satisfied when robot and base are dilated from a place c, as long as
        the points, lines and planes that are known contain c.
        """
        return np.zeros((0, 3)), np.zeros(0)

    @property
    def groups(self) -> NDArray[np.int64]:
        """Number of the group of each block, shape (B,): blocks that share their own fixtures."""
        return np.zeros(self.blocks, dtype=np.int64)

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """First values of the fixtures from the poses of the nominal robot, shape (F,).

        None where the kind cannot say and another that shares the fixtures must.
        """
        return np.zeros(0)

    @abstractmethod
    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Residuals and derivatives at given poses and fixtures."""

    @abstractmethod
    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same measurement with other readings, one array for each view."""

    @abstractmethod
    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Only some of the blocks."""


def origin_of(measurement: Measurement) -> tuple[FileRow, ...]:
    """Row of a file that each block was read from; empty if it was not read."""
    return getattr(measurement, "_origin", ())


def of_files(measurement: Measurement, origin: tuple[FileRow, ...]) -> Measurement:
    """The same measurement with the rows of files that its blocks were read from."""
    kind, arguments, _ = measurement.__reduce__()[1]
    return _made_again(kind, arguments, origin)


_M = TypeVar("_M", bound=Measurement)


def remade(measurement: _M, blocks: NDArray[np.int64] | None = None, /, **changes: Any) -> _M:
    """The same measurement, or some of its blocks, with other fields and the files it is of."""
    made, origin = replace(measurement, **changes), origin_of(measurement)  # type: ignore[type-var]
    if origin and blocks is not None:
        origin = tuple(origin[b] for b in np.arange(len(origin))[blocks])
    object.__setattr__(made, "_origin", origin)
    return made


def _made_again(
    kind: Callable[..., Any], arguments: tuple[Any, ...], origin: tuple[FileRow, ...]
) -> Any:
    made = kind(*arguments)
    object.__setattr__(made, "_origin", origin)
    return made


POSE_AXES = ("x", "y", "z", "rx", "ry", "rz")
POSE_UNITS = ("m", "m", "m", "rad", "rad", "rad")
