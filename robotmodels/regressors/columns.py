"""Which columns a regressor has, and which of them are asked for."""

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

Blocks = Mapping[str, tuple[str, ...]]
"""Names of the columns, by kind: the ten of each link, then one kind of the drives at a time."""


@runtime_checkable
class KeptColumns(Protocol):
    """What is asked of base parameters; `BaseParameters` has it."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the kept standard parameters."""
        ...

    @property
    def kept(self) -> NDArray[np.int64]:
        """Their numbers."""
        ...

    def check(self, model: RobotModel) -> None:
        """Refuse a robot that they do not belong to."""
        ...


Columns = Sequence[int] | Sequence[str] | NDArray[np.int64] | NDArray[np.bool_] | KeptColumns


@dataclass(frozen=True, slots=True, eq=False)
class ChosenColumns:
    """Columns of a regressor and where each standard parameter goes."""

    names: tuple[str, ...]
    places: Mapping[str, NDArray[np.int64]]

    @property
    def count(self) -> int:
        """Number of columns."""
        return len(self.names)

    def column(self, kind: str, number: int) -> int:
        """Column of one parameter of a kind, -1 if it is not chosen."""
        return int(self.places[kind][number]) if kind in self.places else -1

    def has(self, *kinds: str) -> bool:
        """Whether any column of these kinds is chosen."""
        return any((self.places[kind] >= 0).any() for kind in kinds if kind in self.places)


def coupled_motors(model: RobotModel) -> tuple[int, ...]:
    """Numbers of the motors that more than one joint turns."""
    return () if model.transmission is None else model.transmission.coupled_motors


def friction_of(model: RobotModel, friction: Friction | None) -> LinearFriction | None:
    """The friction model, checked for regressors."""
    return None if friction is None else check_linear(check_friction(friction, model.n))


def standard_blocks(model: RobotModel, drive: Drives, friction: Friction | None) -> Blocks:
    """Columns of the torque and of what is derived from it."""
    kinds = drive_kinds(drive)
    frames = tuple((model.table.joint_rows + 1).tolist())
    blocks = dict(_named_blocks(model.f, frames, coupled_motors(model), tuple(kinds)))
    if (linear := friction_of(model, friction)) is not None:
        for kind in linear.kinds:
            if kind in blocks:
                rest = tuple(k.value for k in kinds if k.value not in linear.kinds)
                raise InvalidValueError(
                    f"friction: there are {kind} columns already, of the drives or of another part "
                    "of the friction model; leave out what repeats them, of the drives with "
                    f"drive={rest}."
                )
            blocks[kind] = tuple(f"{kind}{j}" for j in frames)
    return blocks


@lru_cache(maxsize=64)
def _named_blocks(
    f: int, frames: tuple[int, ...], motors: tuple[int, ...], kinds: tuple[DriveKind, ...]
) -> Blocks:
    """Names without friction models: robots of one structure share them, call after call."""
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
    """Find the columns that are asked for."""
    if columns is None:
        return _all_columns(tuple(blocks.items()))
    every = tuple(name for names in blocks.values() for name in names)
    if isinstance(columns, KeptColumns):
        columns.check(model)
    chosen = np.array(_numbers(every, columns), dtype=np.int64).reshape(-1)
    if np.unique(chosen).size != chosen.size:
        raise InvalidValueError("columns: a column is asked for twice; give each once.")
    place = np.full(len(every), -1, dtype=np.int64)
    place[chosen] = np.arange(chosen.size)
    return ChosenColumns(tuple(every[k] for k in chosen), _placed(place, blocks))


@lru_cache(maxsize=64)
def _all_columns(blocks: tuple[tuple[str, tuple[str, ...]], ...]) -> ChosenColumns:
    every = tuple(name for _, names in blocks for name in names)
    return ChosenColumns(every, _placed(np.arange(len(every)), dict(blocks)))


def _placed(place: NDArray[np.int64], blocks: Blocks) -> Mapping[str, NDArray[np.int64]]:
    """The column of each parameter, kind by kind; read-only, since calls share them."""
    ends = np.cumsum([len(names) for names in blocks.values()])[:-1]
    pieces = (read_only(piece, np.int64) for piece in np.split(place, ends))
    return dict(zip(blocks, pieces, strict=True))


def _numbers(every: tuple[str, ...], columns: Columns) -> list[int]:
    if isinstance(columns, KeptColumns):
        missing = [name for name in columns.names if name not in every]
        if missing:
            few = ", ".join(missing[:6]) + (", ..." if len(missing) > 6 else "")
            raise InvalidValueError(
                f"columns: of these base parameters, {len(missing)} have no column here: {few}. "
                "Friction and offsets have none in an energy, for which base parameters with "
                "drive=('Ia',) or without drives are made; elsewhere ask for the same drives and "
                "friction as they have."
            )
        return [_number(every, name) for name in columns.names]
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
    """The standard name of a parameter that is given as it is printed, ``ZZ1R`` for ``ZZ1``."""
    return name[:-1] if name not in known and name[-1:] == "R" and name[:-1] in known else name


def _number(every: tuple[str, ...], column: object) -> int:
    if isinstance(column, str):
        name = plain_name(column, every)
        if name not in every:
            near = nearest_names(column, every)
            raise InvalidValueError(
                f"columns: there is no column {column!r} here"
                + (f"; the nearest are {', '.join(near)}." if near else ".")
                + " Friction and offsets have none in an energy, and drives those of the kinds"
                " that drive= asks for."
            )
        return every.index(name)
    if isinstance(column, (bool, np.bool_)) or not isinstance(column, (int, np.integer)):
        raise InvalidValueError(f"columns: expected numbers or names, got {column!r:.80}.")
    if not 0 <= column < len(every):
        raise InvalidValueError(
            f"columns: numbers are from 0 to {len(every) - 1} here, got {int(column)}."
        )
    return int(column)
