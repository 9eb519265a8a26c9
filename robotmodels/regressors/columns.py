"""The columns of regressors, and the choice among them."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from .._arrays import read_only
from ..drive import DriveKind, Drives, drive_kinds
from ..errors import InvalidValueError, ShapeError, nearest_names
from ..friction import Friction, LinearFriction, check_friction, check_linear
from ..inertia import PARAMETERS
from ..model import RobotModel

LINKS = "links"
_NONE = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)

Blocks = Mapping[str, tuple[str, ...]]
"""Names of the columns, by kind: the ten of each link, then one kind of the drives at a time."""


@runtime_checkable
class KeptColumns(Protocol):
    """Interface of base parameters that choose columns, see `BaseParameters`."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the kept standard parameters."""
        ...

    @property
    def kept(self) -> NDArray[np.int64]:
        """Numbers of the kept standard parameters."""
        ...

    def check(self, model: RobotModel) -> None:
        """Raise for a robot of another structure."""
        ...


Columns = Sequence[int] | Sequence[str] | NDArray[np.int64] | NDArray[np.bool_] | KeptColumns


@dataclass(frozen=True, slots=True, eq=False)
class ChosenColumns:
    """Columns of a regressor: column of each parameter by kind, and the chosen parameters."""

    names: tuple[str, ...]
    places: Mapping[str, NDArray[np.int64]]
    used: Mapping[str, tuple[NDArray[np.int64], NDArray[np.int64]]]

    @property
    def count(self) -> int:
        """Number of columns."""
        return len(self.names)

    def column(self, kind: str, number: int) -> int:
        """Column of one parameter of a kind, -1 if it is not chosen."""
        return int(self.places[kind][number]) if kind in self.places else -1

    def parameters(self, kind: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Numbers of the chosen parameters of a kind, and their columns."""
        return self.used.get(kind, _NONE)

    def has(self, *kinds: str) -> bool:
        """Whether any column of these kinds is chosen."""
        return any(self.parameters(kind)[0].size for kind in kinds)


def coupled_motors(model: RobotModel) -> tuple[int, ...]:
    """Numbers of the coupled motors (turned by more than one joint)."""
    return () if model.transmission is None else model.transmission.coupled_motors


def friction_of(model: RobotModel, friction: Friction | None) -> LinearFriction | None:
    """The friction model, checked for regressors."""
    return None if friction is None else check_linear(check_friction(friction, model.n))


def standard_blocks(model: RobotModel, drive: Drives, friction: Friction | None) -> Blocks:
    """Columns of the torque, the power and the momentum."""
    kinds = drive_kinds(drive)
    frames = tuple((model.table.joint_rows + 1).tolist())
    blocks = dict(_named_blocks(model.f, frames, coupled_motors(model), tuple(kinds)))
    if (linear := friction_of(model, friction)) is not None:
        for kind in linear.kinds:
            if kind in blocks:
                rest = tuple(k.value for k in kinds if k.value not in linear.kinds)
                raise InvalidValueError(
                    f"friction: there are {kind} columns already, of the drives or of another part "
                    "of the friction model; leave out the repeated ones, of the drives with "
                    f"drive={rest}."
                )
            blocks[kind] = tuple(f"{kind}{j}" for j in frames)
    return blocks


@lru_cache(maxsize=64)
def _named_blocks(
    f: int, frames: tuple[int, ...], motors: tuple[int, ...], kinds: tuple[DriveKind, ...]
) -> Blocks:
    """Names without friction models, cached by structure."""
    blocks = {LINKS: tuple(f"{p}{j}" for j in range(1, f + 1) for p in PARAMETERS)}
    blocks |= {kind.value: tuple(f"{kind.value}{j}" for j in frames) for kind in kinds}
    if motors:
        coupled = (kind.coupling for kind in kinds if kind.coupling is not None)
        blocks |= {name: tuple(f"{name}{frames[m - 1]}" for m in motors) for name in coupled}
    return MappingProxyType(blocks)


def energy_blocks(model: RobotModel, drive: Drives) -> Blocks:
    """Columns of the energy: friction and offsets have none."""
    blocks = standard_blocks(model, drive, None)
    return {kind: blocks[kind] for kind in (LINKS, "Ia", "Iam") if kind in blocks}


def chosen_columns(blocks: Blocks, columns: Columns | None, model: RobotModel) -> ChosenColumns:
    """The requested columns."""
    if columns is None:
        return _all_columns(tuple(blocks.items()))
    every = tuple(name for names in blocks.values() for name in names)
    if isinstance(columns, KeptColumns):
        columns.check(model)
    chosen = np.array(_numbers(every, columns), dtype=np.int64).reshape(-1)
    if np.unique(chosen).size != chosen.size:
        raise InvalidValueError("columns: a column is given twice; give each once.")
    place = np.full(len(every), -1, dtype=np.int64)
    place[chosen] = np.arange(chosen.size)
    return _chosen(tuple(every[k] for k in chosen), place, blocks)


@lru_cache(maxsize=64)
def _all_columns(blocks: tuple[tuple[str, tuple[str, ...]], ...]) -> ChosenColumns:
    every = tuple(name for _, names in blocks for name in names)
    return _chosen(every, np.arange(len(every)), dict(blocks))


def _chosen(names: tuple[str, ...], place: NDArray[np.int64], blocks: Blocks) -> ChosenColumns:
    """Column of each parameter by kind; read-only (cached)."""
    ends = np.cumsum([len(kind) for kind in blocks.values()])[:-1]
    pieces = (read_only(piece, np.int64) for piece in np.split(place, ends))
    places = dict(zip(blocks, pieces, strict=True))
    numbers = {kind: np.flatnonzero(place >= 0) for kind, place in places.items()}
    return ChosenColumns(names, places, {k: (at, places[k][at]) for k, at in numbers.items()})


def _numbers(every: tuple[str, ...], columns: Columns) -> list[int]:
    """Numbers of the columns among the names of all."""
    if isinstance(columns, KeptColumns):
        columns = columns.names
    if isinstance(columns, str) or not isinstance(columns, (Sequence, np.ndarray)):
        raise InvalidValueError(
            "columns: expected numbers or names of columns, or base parameters, got "
            f"{columns!r:.80}."
        )
    if isinstance(columns, np.ndarray) and columns.dtype == bool:
        if columns.shape != (len(every),):
            raise ShapeError(f"columns: expected a mask of {len(every)}, got {columns.shape}.")
        return np.flatnonzero(columns).tolist()
    return [_number(every, column) for column in columns]


def plain_name(name: str, known: Container[str]) -> str:
    """Standard name of a parameter given by its printed name, ``ZZ1R`` for ``ZZ1``."""
    return name[:-1] if name not in known and name[-1:] == "R" and name[:-1] in known else name


def _number(every: tuple[str, ...], column: object) -> int:
    """Number of one column that is given by its number or name."""
    if isinstance(column, str):
        name = plain_name(column, every)
        if name in every:
            return every.index(name)
        near = ", ".join(nearest_names(column, every))
        raise InvalidValueError(
            f"columns: there is no column {column!r} here"
            f"{f'; the nearest are {near}' if near else ''}. Drives have columns of the kinds that "
            "drive= selects; an energy has none of friction and offsets, so that it needs base "
            "parameters made with drive=('Ia',) or without drives."
        )
    if isinstance(column, (bool, np.bool_)) or not isinstance(column, (int, np.integer)):
        raise InvalidValueError(f"columns: expected numbers or names, got {column!r:.80}.")
    if not 0 <= column < len(every):
        raise InvalidValueError(
            f"columns: numbers are from 0 to {len(every) - 1} here, got {int(column)}."
        )
    return int(column)
