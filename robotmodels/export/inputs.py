"""Inputs of a program: joint variables, and parameters that stay symbols under safe names."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from ..drive import DriveKind
from ..minimal_parameters import BaseParameters, base_parameters
from ..model import RobotModel
from ..regressors import parameter_names, parameter_vector
from .geometry import COLUMNS, Constant
from .tape import Number, Port, Tape

_RESERVED = """
auto break case char const continue default do double else enum extern float for goto if inline int
long register restrict return short signed sizeof static struct switch typedef union unsigned void
volatile while asm main NULL NAN INFINITY end function elseif otherwise parfor persistent catch spmd
classdef reshape acos asin atan atan2 ceil cos cosh erf exp fabs floor fma fmax fmin fmod gamma
hypot j0 j1 jn log pow round sin sinh sqrt tan tanh tgamma y0 y1 yn abs sign pi inf nan np math
casadi smooth batch select_ q v a tau T wrench geometry parameters J M h Q W valid status a_out
"""
"""Words of the languages, names of their libraries and those that generated code uses."""
_WORDS = {*keyword.kwlist, *_RESERVED.split()}
_TAKEN = re.compile(r"[tCS]\d+|(FP|HUGE|MATH|M|math)_\w*|linux|unix")
"""Names of lines, cosines and sines, and macros of C's mathematics."""
_LETTERS = dict(zip(COLUMNS, ("G", "BL", "B", "A", "D", "TH", "RL"), strict=True))
_EXACT = 1e-13


@dataclass(slots=True)
class Draft:
    """A program that is being written: the tape, its inputs, notes of the header."""

    model: RobotModel
    kinds: tuple[DriveKind, ...]
    tape: Tape = field(default_factory=Tape)
    inputs: list[Port] = field(default_factory=list)
    elements: list[tuple[str, ...]] = field(default_factory=list)
    values: list[tuple[float, ...]] = field(default_factory=list)
    scalars: dict[str, list[Number]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def input(
        self, name: str, shape: tuple[int, ...], given: Iterable[str] = (),
        values: Iterable[float] = (),
    ) -> list[Number]:  # fmt: skip
        """The elements of a further input; those of parameters have names and values."""
        taken = {element for row in self.elements for element in row}
        elements = {old: _mended(old, taken) for old in given}
        renamed = (
            f"{comment(old)} is written {new}" for old, new in elements.items() if old != new
        )
        self.notes += renamed
        port = Port(name, shape)
        self.scalars[name] = self.tape.inputs(len(self.inputs), port.size)
        self.inputs.append(port)
        self.elements.append(tuple(elements.values()))
        self.values.append(tuple(map(float, values)))
        return self.scalars[name]

    def base(self, tolerance: float | None = None) -> BaseParameters:
        """The base parameters; with all drives as by default, without the offsets."""
        kinds = self.kinds[:-1] if self.kinds == tuple(DriveKind) else self.kinds
        return base_parameters(self.model, drive=kinds, tolerance=tolerance)


def dynamic_parameters(
    draft: Draft, choice: str, is_general: bool
) -> tuple[dict[str, Number], dict[str, Number] | None]:
    """Standard parameters by name, and fewer equivalent ones that give the same torques.

    A missing name is zero. The fewer ones are base parameters; they have no numbers, so that there
    are none (None), where the geometry ``is_general``.
    """
    names = parameter_names(draft.model, draft.kinds)
    numbers = parameter_vector(draft.model, draft.kinds).tolist()
    standard: dict[str, Number] = dict(zip(names, numbers, strict=True))
    if choice == "symbols":
        given = draft.input("parameters", (len(names),), names, numbers)
        return dict(zip(names, given, strict=True)), None
    if choice == "numbers" and is_general:
        return standard, None
    # numbers use every digit of the table, symbols are those of `base_parameters` by default
    base = draft.base(_EXACT if choice == "numbers" else None)
    values: list[Number] = base.values(draft.model).tolist()
    if choice == "base":
        values = draft.input("parameters", (len(values),), base.names, values)  # type: ignore[arg-type]
    rest = {k: standard[k] for k in names if k not in base.parameter_names}  # offsets
    simpler = {**rest, **dict(zip(base.names, values, strict=True))}
    return (simpler, None) if choice == "base" else (standard, simpler)


def geometric_parameters(draft: Draft) -> Constant:
    """Lengths that are not zero and named constants as an input."""
    table = draft.model.table
    numbers = {
        (column, row): float(getattr(table, column)[row - 1])
        for row in range(1, table.f + 1)
        for column in COLUMNS
    }
    names: dict[tuple[str, int], str] = {}
    values: dict[str, float] = {}
    for (column, row), value in numbers.items():
        own = table.symbols.get((column, row))
        usual = f"{_LETTERS[column]}{row}"
        while usual in table.symbols.values() and usual != own:  # it means another number
            usual += "_"
        if own is not None:
            # a formula, or one name of different numbers: the usual name
            same = {numbers[key] for key, name in table.symbols.items() if name == own}
            names[column, row] = own if own.isidentifier() and len(same) == 1 else usual
            if names[column, row] != own:
                draft.notes.append(f"{comment(own)} is written {names[column, row]}")
        elif column in ("b", "d", "r") and value != 0.0:
            names[column, row] = usual
        if (column, row) in names:
            values[names[column, row]] = value
    given = draft.input("geometry", (len(values),), values, values.values())
    of = dict(zip(values, given, strict=True))
    return lambda column, row: (
        of[names[column, row]] if (column, row) in names else numbers[column, row]
    )


def identifier(text: str) -> str:
    """A name with what no identifier may contain replaced."""
    name = re.sub(r"[^A-Za-z0-9_]+", "_", text).strip("_")[:40]
    return name if name[:1].isalpha() else f"x{name}"


def _mended(name: str, taken: set[str]) -> str:
    """Make an unused identifier of a name, and reserve it."""
    name = identifier(name)
    while name in _WORDS or name in taken or _TAKEN.fullmatch(name):
        name += "_"
    taken.add(name)
    return name


def comment(text: str) -> str:
    """Text that ends no comment of any language, in ASCII."""
    return re.sub(r"[^A-Za-z0-9 _.,:;()\[\]<>=+-]", "_", text)
