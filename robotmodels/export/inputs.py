"""Inputs of a program: joint variables, and parameters that stay symbols under safe names."""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..drive import DriveKind
from ..minimal_parameters import BaseParameters, base_parameters
from ..model import RobotModel
from ..regressors import parameter_names, parameter_vector, torque_regressor
from .recursion import COLUMNS, Constant
from .tape import Number, Port, Scalar, Tape

_RESERVED = """
auto break case char const continue default do double else enum extern float for goto if inline int
long register restrict return short signed sizeof static struct switch typedef union unsigned void
volatile while asm main NULL NAN INFINITY end function elseif otherwise parfor persistent catch spmd
classdef reshape acos asin atan atan2 ceil cos cosh erf exp fabs floor fma fmax fmin fmod gamma
hypot j0 j1 jn log pow round sin sinh sqrt tan tanh tgamma y0 y1 yn abs sign pi inf nan np math
casadi smooth batch select_ q v a tau T wrench geometry parameters J M h Q W valid status
zeros a_out
"""
"""Words of the languages, names of their libraries and those that generated code uses."""
_WORDS = {*keyword.kwlist, *_RESERVED.split()}
_TAKEN = re.compile(r"[tCS]\d+|(FP|HUGE|MATH|M|math)_\w*|linux|unix")
"""Names of lines, cosines and sines, and macros of C's mathematics."""
_LETTERS: dict[str, str] = dict(zip(COLUMNS, ("G", "BL", "B", "A", "D", "TH", "RL"), strict=True))
_EXACT, _STATES = 1e-13, 10


@dataclass(slots=True)
class Draft:
    """A program that is being written: the tape, its inputs, notes of the header."""

    model: RobotModel
    kinds: tuple[DriveKind, ...]
    tape: Tape = field(default_factory=Tape)
    inputs: list[Port] = field(default_factory=list)
    elements: list[tuple[str, ...]] = field(default_factory=list)
    values: list[tuple[float, ...]] = field(default_factory=list)
    scalars: dict[str, list[Scalar]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def input(
        self, name: str, shape: tuple[int, ...], given: Mapping[str, float] | None = None
    ) -> dict[str, Number]:
        """A further input; the elements of parameters, given with their values, by name."""
        taken, names, given = {x for row in self.elements for x in row}, [], given or {}
        for old in given:
            new = identifier(old)
            while new in _WORDS or new in taken or _TAKEN.fullmatch(new):
                new += "_"
            taken.add(new)
            names.append(new)
            self.notes += [f"{comment(old)} is written {new}"] * (old != new)
        port, count = Port(name, shape), len(self.inputs)
        self.scalars[name] = [self.tape.scalar("input", count, k) for k in range(port.size)]
        self.inputs.append(port)
        self.elements.append(tuple(names))
        self.values.append(tuple(map(float, given.values())))
        return dict(zip(given, self.scalars[name], strict=False))

    def base(self, tolerance: float | None = None) -> BaseParameters:
        """The base parameters; with all drives as by default, without the offsets."""
        kinds = self.kinds[:-1] if self.kinds == tuple(DriveKind) else self.kinds
        return base_parameters(self.model, drive=kinds, tolerance=tolerance)


def dynamic_parameters(draft: Draft, choice: str, is_general: bool) -> dict[str, Number]:
    """Standard parameters by name; those that are missing are zero.

    Numbers are those of the base parameters if they give the same torques, to rounding; not where
    the geometry ``is_general``, for which these have no numbers.
    """
    model = draft.model
    names = parameter_names(model, draft.kinds)
    own: dict[str, float] = dict(
        zip(names, parameter_vector(model, draft.kinds).tolist(), strict=True)
    )
    if choice == "symbols":
        return draft.input("parameters", (len(names),), own)
    if choice == "numbers" and is_general:
        return {**own}
    # numbers use every digit of the table, symbols are those of `base_parameters` by default
    base = draft.base(_EXACT if choice == "numbers" else None)
    values = dict(zip(base.names, base.values(model).tolist(), strict=True))
    rest = {k: own[k] for k in names if k not in base.parameter_names}  # offsets
    if choice == "base":
        return {**rest, **draft.input("parameters", (len(values),), values)}
    fewer = {**rest, **values}
    states = np.random.default_rng(0).normal(size=(3, _STATES, model.n))
    W = torque_regressor(model, *states, drive=draft.kinds)
    tau, other = (W @ [x.get(name, 0.0) for name in names] for x in (own, fewer))
    is_same = np.abs(tau - other).max(initial=0.0) <= _EXACT * np.abs(tau).max(initial=0.0)
    return {**(fewer if is_same else own)}


def geometric_parameters(draft: Draft) -> Constant:
    """Lengths that are not zero and named constants as an input."""
    table = draft.model.table
    numbers = table_numbers(draft.model)
    names: dict[tuple[str, int], str] = {}
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
    values = {name: numbers[key] for key, name in names.items()}
    given = draft.input("geometry", (len(values),), values)
    of: dict[tuple[str, int], Number] = {**numbers, **{k: given[x] for k, x in names.items()}}
    return lambda column, row: of[column, row]


def table_numbers(model: RobotModel) -> dict[tuple[str, int], float]:
    """Geometric parameters as they are in the table, by column and row."""
    rows = range(1, model.table.f + 1)
    return {(c, k): float(getattr(model.table, c)[k - 1]) for k in rows for c in COLUMNS}


def identifier(text: str) -> str:
    """A name with what no identifier may contain replaced."""
    name = re.sub(r"[^A-Za-z0-9_]+", "_", text).strip("_")[:40]
    return name if name[:1].isalpha() else f"x{name}"


def comment(text: str) -> str:
    """Text that ends no comment of any language, in ASCII."""
    return re.sub(r"[^A-Za-z0-9 _.,:;()\[\]<>=+-]", "_", text)
