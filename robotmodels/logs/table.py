"""A file of a log as columns with names, whatever its format."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from .._arrays import Array
from ..csv_table import Column
from ..errors import InvalidValueError, nearest_names


class LogFormat(Enum):
    """Format of a file; the value are the suffixes that say so.

    Examples
    --------
    >>> LogFormat.of(Path("run.npz"))
    <LogFormat.NPZ: ('.npz',)>
    """

    CSV = (".csv", ".tsv", ".txt", ".dat", ".log")
    NPZ = (".npz",)
    PARQUET = (".parquet", ".pq")
    MAT = (".mat",)

    @classmethod
    def of(cls, path: Path) -> LogFormat:
        """The format that a file's name says.

        Parameters
        ----------
        path : Path
            The file.

        Returns
        -------
        LogFormat
            By its suffix.

        Raises
        ------
        InvalidValueError
            No format has this suffix.
        """
        for kind in cls:
            if path.suffix.lower() in kind.value:
                return kind
        words = ", ".join(repr(kind.lower()) for kind in cls.__members__)
        known = ", ".join(suffix for kind in cls for suffix in kind.value)
        raise InvalidValueError(
            f"{path}: its suffix is none of {known}; say format= one of {words}."
        )


@dataclass(frozen=True, slots=True)
class LogTable:
    """Columns of a file."""

    path: Path
    names: tuple[str, ...]
    width: int
    groups: Mapping[str, tuple[int, ...]]
    read: Callable[[Sequence[int]], Array]
    words: Callable[[int], str]
    alike: int | None = None
    transposed: frozenset[str] = frozenset()

    def choice(self, given: Column | Sequence[Column], what: str) -> tuple[int, ...]:
        """Columns that an argument names."""
        if isinstance(given, str) and "*" in given and given not in self.names:
            return self._pattern(given, what)
        if isinstance(given, str) and given in self.groups:
            return self.groups[given]
        each = [given] if isinstance(given, int | str) else list(given)
        found: list[int] = []
        for column in each:
            if isinstance(column, str) and column in self.groups:
                found += self.groups[column]
            else:
                found.append(self.number(column, what))
        if len(set(found)) < len(found):
            twice = next(column for column in found if found.count(column) > 1)
            raise InvalidValueError(
                f"{what}: {self.called([twice])} of {self.path} is there twice."
            )
        if not found:
            raise InvalidValueError(f"{what}: expected columns, got none.")
        return tuple(found)

    def number(self, column: Column, what: str) -> int:
        """Number of one column."""
        if isinstance(column, str):
            lower = [name.lower() for name in self.names]
            exact = [i for i, name in enumerate(self.names) if name == column]
            found = exact or [i for i, name in enumerate(lower) if name == column.lower()]
            if len(found) == 1:
                return found[0]
            if not self.names:
                raise InvalidValueError(
                    f"{what}: {self.path} has no header, so that {column!r} says nothing; give "
                    f"numbers of columns, from 0 to {self.width - 1}."
                )
            if found:
                raise InvalidValueError(
                    f"{what}: {self.path} has several columns {column!r}; give their numbers, "
                    "from 0."
                )
            known = (*self.names, *self.groups)
            near = ", ".join(nearest_names(column, known)) or "none"
            raise InvalidValueError(
                f"{what}: {self.path} has no column {column!r}; near it: {near}. It has "
                f"{self.described()}."
            )
        if isinstance(column, bool) or not isinstance(column, int):
            raise InvalidValueError(
                f"{what}: expected numbers or names of columns, got {column!r:.60}."
            )
        if not -self.width <= column < self.width:
            raise InvalidValueError(
                f"{what}: {self.path} has columns 0 to {self.width - 1}, got {column}."
            )
        return column % self.width

    def called(self, columns: Sequence[int]) -> str:
        """Columns in words."""
        if not self.names:
            return f"columns {', '.join(map(str, columns))}"
        return ", ".join(self.names[column] for column in columns)

    def described(self) -> str:
        """All that it has, in words."""
        if not self.names:
            return f"{self.width} columns without names"
        return f"the columns {', '.join(self.names)}"

    def _pattern(self, pattern: str, what: str) -> tuple[int, ...]:
        head, _, tail = pattern.partition("*")
        stars = {
            i: name[len(head) : len(name) - len(tail)]
            for i, name in enumerate(self.names)
            if name.startswith(head) and name.endswith(tail) and len(name) > len(head) + len(tail)
        }
        numbered = [i for i, star in stars.items() if star.isdecimal()]
        if not numbered:
            raise InvalidValueError(
                f"{what}: no column of {self.path} is {pattern!r} with a number in place of the "
                f"star; give a list of names. It has {self.described()}."
            )
        return tuple(sorted(numbered, key=lambda i: int(stars[i])))
