"""Numbers for the symbols of a file, and which symbols are the variables of joints."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from .._arrays import as_floats
from ..errors import InvalidValueError, ParFileError, nearest_names
from .expressions import Entry
from .statements import ParFile


class Numbers:
    """Turns entries into numbers and gathers the symbols that have none."""

    def __init__(self, file: ParFile, values: Mapping[str, float]) -> None:
        self.values = dict(values)
        self.variables: dict[str, int] = {}
        self._file = file
        self._missing: dict[str, str] = {}

    def free(self, entry: Entry) -> list[str]:
        """Symbols of an entry that have no number."""
        return [symbol for symbol in entry.symbols if symbol not in self.values]

    def number(self, entry: Entry, zero: Iterable[str] = ()) -> float:
        """The entry's value; with ``zero`` symbols taken as 0, with missing ones remembered."""
        zero = set(zero)
        missing = [symbol for symbol in self.free(entry) if symbol not in zero]
        for symbol in missing:
            if symbol in self.variables:
                raise ParFileError(
                    f"{entry.place}: {symbol!r} is the variable of joint {self.variables[symbol]} "
                    "and cannot stand here as well; replace it by a number."
                )
            self._missing.setdefault(symbol, entry.place)
        return 0.0 if missing else entry.value({**self.values, **dict.fromkeys(zero, 0.0)})

    def integer(self, entry: Entry) -> int:
        """The entry's value, which must be whole."""
        value = self.number(entry)
        if not value.is_integer():
            raise ParFileError(f"{entry.place}: expected a whole number, got {entry.text!r}.")
        return int(value)

    def offset(self, entry: Entry, j: int) -> float:
        """The constant part of the own column of joint j; its symbol becomes a variable."""
        free = self.free(entry)
        if not free:
            if entry.symbols:  # a file that is read for one posture is another robot
                raise ParFileError(
                    f"{entry.place}: {entry.text!r} has no symbol left to be the variable of joint "
                    f"{j}; take that one ({', '.join(entry.symbols)}) out of values."
                )
            return entry.value({})
        # R4 and RL4 are lengths, r4 is a variable
        likely = [s for s in entry.symbols if re.fullmatch(rf"((?i:th|theta|t|q)|r)_?{j}", s)]
        if likely and not {*likely} & {*free}:
            raise ParFileError(
                f"{entry.place}: {likely[0]!r} is the variable of joint {j}; take it out of values."
            )
        likely = [s for s in likely if s in free]
        variable = free if len(free) == 1 else likely
        if len(variable) != 1:
            raise ParFileError(
                f"{entry.place}: which of {', '.join(free)} is the variable of joint {j}? Pass "
                "numbers for the others: values={...}."
            )
        q = variable[0]
        if self.variables.setdefault(q, j) != j:
            raise ParFileError(
                f"{entry.place}: {q!r} is already the variable of joint {self.variables[q]}: give "
                "each joint its own symbol and couple them with a Transmission."
            )
        others = [s for s in free if s != q]
        for symbol in others:
            self._missing.setdefault(symbol, entry.place)
        if others:
            return 0.0
        at_0, at_1, at_3 = (entry.value({**self.values, q: x}) for x in (0.0, 1.0, 3.0))
        slope = at_1 - at_0
        rounding = 1e-12 * max(1.0, abs(at_0))
        if abs(slope - 1.0) > rounding or abs(at_3 - at_0 - 3.0) > 3.0 * rounding:
            raise ParFileError(
                f"{entry.place}: {entry.text!r} is not its variable plus a constant; the table "
                f"keeps the sign and scale of q: write it as {q} + constant."
            )
        return at_0

    def check_complete(self) -> None:
        """Refuse a file some of whose symbols have no number."""
        if self._missing:
            names = list(self._missing)
            example = ", ".join(f"{name!r}: ..." for name in names)
            raise ParFileError(
                f"{self._missing[names[0]]}: no number for {', '.join(names)}. Pass "
                f"values={{{example}}} to read_par, in metres and radians."
            )


def checked_values(values: Mapping[str, float] | None, file: ParFile) -> dict[str, float]:
    """Numbers for symbols, of symbols that stand in the file."""
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise InvalidValueError(
            "values: expected a mapping from symbols to numbers such as {'D3': 0.45}, got "
            f"{type(values).__name__}."
        )
    checked = {}
    for symbol, value in values.items():
        if symbol not in file.names:
            close = nearest_names(str(symbol), file.names)
            raise file.error(
                f"values has a number for {symbol!r}, but no such symbol stands in the file"
                + (f". Did you mean {', '.join(map(repr, close))}?" if close else ".")
            )
        number = as_floats(value, f"values[{symbol!r}]")
        if number.ndim:
            raise InvalidValueError(f"values[{symbol!r}]: expected one number, got {value!r}.")
        checked[symbol] = float(number)
    return checked
