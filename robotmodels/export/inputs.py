"""Inputs of a program: joint variables, and parameters that stay symbols under safe names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from ..drive import DriveKind
from ..geometry import FIXED, PRISMATIC, REVOLUTE
from ..minimal_parameters import BaseParameters, base_parameters
from ..model import RobotModel
from ..regressors import parameter_names, parameter_vector
from .geometry import Constant
from .tape import Number, Port, Tape

_WORDS = frozenset("""
auto break case char const continue default do double else enum extern float for goto if inline int
long register restrict return short signed sizeof static struct switch typedef union unsigned void
volatile while asm typeof bool true false main NULL NAN INFINITY
False None True and as assert async await class def del elif except finally from global import in is
lambda match nonlocal not or pass raise try with yield print
end function elseif otherwise parfor persistent catch spmd classdef properties methods events zeros
pi i j e eps inf nan NaN Inf ans varargin varargout nargin nargout select_
acos asin atan atan2 ceil cos cosh exp fabs floor fmax fmin fmod hypot log pow round sin sinh sqrt
tan tanh abs sign signum y0 y1 yn j0 j1 jn gamma lgamma tgamma erf index
np math casadi smooth shape
q v a tau T wrench geometry parameters J M h Q W valid status q_out a_out tau_out
""".split())  # fmt: skip
"""Words of the languages, names of their libraries and those that generated code uses."""
_TAKEN = re.compile(r"[tCS]\d+")  # of lines, cosines and sines
_EXACT = 1e-13
_LENGTHS = ("b", "d", "r")
_LETTERS = {"gamma": "G", "b": "BL", "beta": "B", "alpha": "A", "d": "D", "theta": "TH", "r": "RL"}


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

    def input(self, name: str, shape: tuple[int, ...]) -> list[Number]:
        """The elements of a further input."""
        return self._added(Port(name, shape), (), ())

    def symbols(self, name: str, given: Sequence[str], values: Sequence[float]) -> list[Number]:
        """A further input whose elements have names and the values of the model."""
        taken = {element for row in self.elements for element in row}
        elements = mended(given, taken)
        for old, new in zip(given, elements, strict=True):
            if old != new:
                self.notes.append(f"{comment(old)} is written {new}")
        return self._added(Port(name, (len(given),)), elements, values)

    def _added(self, port: Port, names: Sequence[str], values: Sequence[float]) -> list[Number]:
        self.scalars[port.name] = self.tape.inputs(len(self.inputs), port.size)
        self.inputs.append(port)
        self.elements.append(tuple(names))
        self.values.append(tuple(map(float, values)))
        return self.scalars[port.name]

    def base(self, tolerance: float | None = None) -> BaseParameters:
        """The base parameters; offsets have their own values."""
        kinds = _without_default_offset(self.kinds)
        return base_parameters(self.model, drive=kinds, tolerance=tolerance)


def _without_default_offset(kinds: tuple[DriveKind, ...]) -> tuple[DriveKind, ...]:
    """All kinds of drives as in the default of `base_parameters`, without the offsets."""
    every = tuple(DriveKind)
    return every[:-1] if kinds == every else kinds


def dynamic_parameters(
    draft: Draft, choice: str, is_general: bool
) -> tuple[dict[str, Number], dict[str, Number] | None]:
    """Standard parameters by name, those that are missing are zero; simpler ones of equal torques.

    The simpler ones are base parameters, which do not exist where geometric parameters are
    ``is_general``.
    """
    model, kinds = draft.model, draft.kinds
    names = parameter_names(model, kinds)
    standard = dict(zip(names, parameter_vector(model, kinds).tolist(), strict=True))
    if choice == "symbols":
        given = draft.symbols("parameters", names, tuple(standard.values()))
        return dict(zip(names, given, strict=True)), None
    if choice == "numbers" and is_general:
        return standard, None
    # numbers use every digit of the table, symbols are those of `base_parameters` by default
    base = draft.base(_EXACT if choice == "numbers" else None)
    values = base.values(model).tolist()
    given = draft.symbols("parameters", base.names, values) if choice == "base" else values
    offsets = {f"offset{row + 1}" for row in model.table.joint_rows}
    rest = {name: x for name, x in standard.items() if name in offsets - {*base.parameter_names}}
    simpler = {**rest, **dict(zip(base.names, given, strict=True))}
    return (simpler, None) if choice == "base" else (standard, simpler)


def geometric_parameters(draft: Draft) -> Constant:
    """Lengths that are not zero and named constants as an input."""
    table = draft.model.table
    own = {**table.symbols}
    for (column, row), name in table.symbols.items():
        # a formula, or one name for different numbers: the usual names
        same = {float(getattr(table, c)[j - 1]) for (c, j), o in own.items() if o == name}
        if not name.isidentifier() or len(same) > 1:
            own = {key: o for key, o in own.items() if o != name}
            draft.notes.append(f"{comment(name)} is written {_LETTERS[column]}{row}")
    values: dict[str, float] = {}
    names: dict[tuple[str, int], str] = {}
    for row in range(1, table.f + 1):
        for column, letter in _LETTERS.items():
            value = float(getattr(table, column)[row - 1])
            if (column, row) in table.symbols or (column in _LENGTHS and value != 0.0):
                name = names[column, row] = own.get((column, row), f"{letter}{row}")
                values[name] = value
    given = draft.symbols("geometry", tuple(values), tuple(values.values()))
    of = dict(zip(values, given, strict=True))

    def constant(column: str, row: int) -> Number:
        key = column, row
        return of[names[key]] if key in names else float(getattr(table, column)[row - 1])

    return constant


def joint_notes(model: RobotModel) -> list[str]:
    """Joints with their frames and units."""
    units = {REVOLUTE: "rad", PRISMATIC: "m"}
    table = model.table
    return [
        f"  {i}: joint of frame {row + 1}, {comment(table.names[row])} [{units[int(table.sigma[row])]}]"
        for i, row in enumerate(table.joint_rows.tolist())
        if table.sigma[row] != FIXED
    ]


def identifier(text: str) -> str:
    """A name with what no identifier may contain replaced."""
    name = re.sub(r"[^A-Za-z0-9_]+", "_", text).strip("_")[:40] or "x"
    return name if name[0].isalpha() else f"x{name}"


def mended(names: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """Identifiers of names in their order, different from each other and from those taken."""
    used = {*_WORDS, *taken}
    out: list[str] = []
    for name in names:
        candidate = identifier(name)
        while candidate in used or _TAKEN.fullmatch(candidate):
            candidate += "_"
        used.add(candidate)
        out.append(candidate)
    return out


def comment(text: str) -> str:
    """Text that ends no comment of any language, in ASCII."""
    return re.sub(r"[^A-Za-z0-9 _.,:;()\[\]<>=%+-]", "_", text)
