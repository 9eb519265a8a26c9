"""A program, a model of a robot as straight-line code, and its printers.

A `Language` holds the syntax; the list of assignments is the same for all languages. Products and
sums that are used once are written into the line that uses them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, batch_shape
from ..errors import InvalidValueError, nearest_names
from .tape import OperationCount, Operations, Port

_WIDEST = 60  # columns of what is written into another line
_LEVEL = {"add": 1, "sub": 1, "mul": 2, "div": 2}
_SIGN = {"add": " + ", "sub": " - ", "mul": "*", "div": "/"}


@dataclass(frozen=True, slots=True, repr=False)
class Program:
    """A model as straight-line code, made by `program`. Read-only, picklable, equal by value.

    Parameters
    ----------
    name : str
        Name of the function in generated code.
    kind : str
        The model, such as ``"idm"``.
    inputs : tuple of (name, shape)
        In the order of the arguments.
    elements, values : tuple of tuple
        Names of the elements of inputs that are parameters, and their values in the model.
    outputs : tuple of (name, shape)
        In the order of the results.
    notes : tuple of str
        The header: conventions, units, identifiers that differ from the names given.
    operations : Operations
        The tape.

    Examples
    --------
    >>> from robotmodels.export import program
    >>> from robotmodels.robots import load
    >>> arm = program(load("planar_2r"), "gravity_torque", parameters="base", drive=False)
    >>> arm.inputs[-1], arm.elements[-1]
    (Port(name='parameters', shape=(4,)), ('ZZ1', 'ZZ2', 'MX2', 'MY2'))
    >>> arm.count.divisions
    0
    """

    name: str
    kind: str
    inputs: tuple[Port, ...]
    elements: tuple[tuple[str, ...], ...]
    values: tuple[tuple[float, ...], ...]
    outputs: tuple[Port, ...]
    notes: tuple[str, ...]
    operations: Operations

    @property
    def count(self) -> OperationCount:
        """Numbers of operations in the way of the book: signs and comparisons are free."""
        return self.operations.count()

    @property
    def lines(self) -> tuple[str, ...]:
        """The assignments, one by one, in Python."""
        return tuple(lines_of(self, LANGUAGES["python"])[0])

    def __call__(self, *inputs: ArrayLike) -> Array | tuple[Array, ...]:
        """Run the tape, for checks; leading axes of the inputs are batch axes.

        Parameters
        ----------
        *inputs : array_like
            In the order of `inputs`.

        Returns
        -------
        ndarray or tuple of ndarray
            The output, or the outputs in their order.
        """
        if len(inputs) != len(self.inputs):
            names = ", ".join(f"{p.name} {p.shape}" for p in self.inputs)
            raise InvalidValueError(
                f"inputs: {self.name} takes {len(self.inputs)} ({names}), got {len(inputs)}."
            )
        flat = []
        for value, port in zip(inputs, self.inputs, strict=True):
            x = as_core(value, port.shape, port.name)
            flat.append(x.reshape((*x.shape[: x.ndim - len(port.shape)], port.size)))
        batch = batch_shape(tuple(flat), tuple(port.name for port in self.inputs))
        with np.errstate(all="ignore"):
            rows = self.operations.run([np.moveaxis(x, -1, 0) for x in flat])
        out = []
        for port, row in zip(self.outputs, rows, strict=True):
            result = np.empty((*batch, port.size))
            for k, x in enumerate(row):
                result[..., k] = x
            out.append(result.reshape((*batch, *port.shape)))
        return out[0] if len(out) == 1 else tuple(out)

    def code(self, language: str = "c") -> str:
        """Source text of one file.

        Parameters
        ----------
        language : {"c", "python", "numpy", "casadi", "matlab"}
            C99; plain Python; NumPy with batch axes; CasADi; MATLAB.

        Returns
        -------
        str
            One function, self-contained, the same text every time.
        """
        return file_text(self, language)

    def __repr__(self) -> str:
        ports = [", ".join(f"{p.name} {p.shape}" for p in of) for of in (self.inputs, self.outputs)]
        counted = ", ".join(f"{n} {word}" for word, n in self.count._asdict().items())
        return f"<Program {self.name}: {ports[0]} -> {ports[1]}; {counted}>"


def write(program: Program, path: str | Path, language: str | None = None) -> None:
    """Write a program as one self-contained source file.

    Parameters
    ----------
    program : Program
        The program.
    path : str or Path
        The file; ``.c``, ``.py`` and ``.m`` are C, plain Python and MATLAB.
    language : str, optional
        One of those of `Program.code`; needed for NumPy, CasADi and other suffixes.

    Raises
    ------
    InvalidValueError
        Neither a known suffix nor a language; a file that cannot be written.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from robotmodels.export import program
    >>> from robotmodels.robots import load
    >>> with TemporaryDirectory() as folder:
    ...     write(program(load("planar_2r"), "dgm"), Path(folder) / "planar.c")
    """
    if not isinstance(program, Program):
        raise InvalidValueError(f"program: expected a Program, got {type(program).__name__}.")
    if not isinstance(path, (str, Path)):
        raise InvalidValueError(f"path: expected a str or Path, got {type(path).__name__}.")
    path = Path(path)
    suffixes = {kind.suffix: name for name, kind in reversed(LANGUAGES.items())} | {".py": "python"}
    if language is None and path.suffix.lower() not in suffixes:
        raise InvalidValueError(
            f"path: expected a file named {', '.join(sorted(suffixes))}, or a language, got "
            f"{path.name!r}."
        )
    text = program.code(suffixes[path.suffix.lower()] if language is None else language)
    try:
        path.write_bytes(text.encode("ascii"))
    except (OSError, ValueError) as error:  # the latter for a zero in the name
        words = getattr(error, "strerror", None) or error
        raise InvalidValueError(f"path: cannot write {str(path)!r}: {words}.") from None


class Language(NamedTuple):
    """How a language writes elements ``name(i, j)``, assignments, functions and comments."""

    name: str
    suffix: str
    comment: str
    brackets: tuple[str, str, str]
    first: int  # index
    assignment: str
    functions: str
    sign: str
    pick: str
    nan: str

    def element(self, port: Port, k: int) -> str:
        """Element k of an input, counted row by row; in C all are in one row."""
        flat = len(port.shape) == 1 or self.name == "c"
        indices = (k,) if flat else divmod(k, port.shape[-1])
        opening, between, closing = self.brackets
        return port.name + opening + between.join(str(i + self.first) for i in indices) + closing


LANGUAGES = {
    language.name: language
    for language in (
        Language(
            "c", ".c", "//", ("[", "", "]"), 0, "const double {} = {};", "",
            "(double)(({0} > 0.0) - ({0} < 0.0))", "({} > {} ? {} : {})", "NAN",
        ),
        Language(
            "python", ".py", "#", ("[", "][", "]"), 0, "{} = {}", "math.",
            "float(({0} > 0.0) - ({0} < 0.0))", "({2} if {0} > {1} else {3})", "math.nan",
        ),
        Language(
            "numpy", ".py", "#", ("[..., ", ", ", "]"), 0, "{} = {}", "np.",
            "np.sign({})", "np.where({} > {}, {}, {})", "np.nan",
        ),
        Language(
            "casadi", ".py", "#", ("[", ", ", "]"), 0, "{} = {}", "casadi.",
            "_sign({}, smooth)", "casadi.if_else({} > {}, {}, {})", 'float("nan")',
        ),
        Language(
            "matlab", ".m", "%", ("(", ", ", ")"), 1, "{} = {};", "",
            "sign({})", "select_({} > {}, {}, {})", "NaN",
        ),
    )
}  # fmt: skip
"""By name, in the order of the documentation."""


def file_text(program: Program, language: str) -> str:
    """A whole file."""
    of = LANGUAGES.get(str(language).lower())
    if of is None:
        near = nearest_names(str(language), LANGUAGES)
        meant = f" Did you mean {near[0]!r}?" if near else ""
        words = ", ".join(map(repr, LANGUAGES))
        raise InvalidValueError(f"language: expected one of {words}, got {language!r:.60}.{meant}")
    inputs, outputs = [port.name for port in program.inputs], []
    lines, results = lines_of(program, of)
    for port, elements in zip(program.outputs, results, strict=True):
        outputs.append(f"{port.name}_out" if port.name in inputs else port.name)
        lines += _result(of, outputs[-1], port.shape, elements)
    head = [f"{of.comment} {note}" for note in program.notes]
    return "\n".join([*head, *_framed(program, of, inputs, outputs, lines), ""])


def lines_of(program: Program, language: Language) -> tuple[list[str], list[list[str]]]:
    """Assignments, and the elements of the results."""
    nodes, results = program.operations
    uses = [0] * (len(nodes) + 1)
    operands_of = (operands for operation, operands, _ in nodes if operation != "input")
    for k in (k for row in (*operands_of, *results) for k in row):
        uses[abs(k)] += 1
    known: list[tuple[str, int]] = [("", 0)]  # text of each node, and how tightly it binds
    lines: list[str] = []

    def operand(number: int, level: int) -> str:
        own, binds = known[abs(number)]
        if number < 0:
            own, binds = f"-{own if binds >= 2 else f'({own})'}", 1
        return own if binds >= level else f"({own})"

    count = 0
    for number, (operation, operands, value) in enumerate(nodes, start=1):
        name, level, is_short = "", _LEVEL.get(operation, 3), False
        if operation in ("constant", "nan"):
            expression, is_short = repr(value) if operation == "constant" else language.nan, True
        elif operation == "input":
            port, k = operands
            expression = language.element(program.inputs[port], k)
            name = program.elements[port][k] if program.elements[port] else ""
            is_short = not name
        elif operation in _SIGN:
            a, b = operands
            first = known[b][0][0].isdigit() or known[b][1] == level  # constants, sums in sums
            if operation in ("add", "mul") and first:
                a, b = b, a
            expression = operand(a, level) + _SIGN[operation] + operand(b, level + 1)
            is_short = uses[number] == 1 and len(expression) <= _WIDEST
        elif operation in ("pick", "sign"):
            form = language.pick if operation == "pick" else language.sign
            expression = form.format(*(operand(k, 3) for k in operands))
        else:
            arguments = ", ".join(operand(k, 0) for k in operands)
            expression = f"{language.functions}{operation}({arguments})"
            of, place, _ = nodes[abs(operands[0]) - 1]
            if (
                operation in ("sin", "cos")
                and of == "input"
                and program.inputs[place[0]].name == "q"
            ):
                name = f"{operation[0].upper()}{place[1] + 1}"
        if is_short:
            known.append((expression, level))
            continue
        count += not name
        name = name or f"t{count}"
        lines.append(language.assignment.format(name, expression))
        known.append((name, 3))
    return lines, [[operand(k, 0) for k in row] for row in results]


def _result(of: Language, name: str, shape: tuple[int, ...], elements: Sequence[str]) -> list[str]:
    """Lines that put the elements of a result together."""
    rows, columns = (shape * 2)[:2] if shape else (1, 1)
    is_matrix, after = len(shape) == 2, []
    if of.name == "c":
        return [f"{name}[{k}] = {x};" for k, x in enumerate(elements)]
    opening, mark, closing = "[", ",", "]"
    if of.name == "python":
        if not shape:
            return [f"{name} = {elements[0]}"]
        if is_matrix:
            at = [k * columns for k in range(rows)]
            elements = [f"[{', '.join(elements[k : k + columns])}]" for k in at]
    elif of.name == "numpy":
        opening, closing = "np.array([", "])"
        elements = [f"batch + ({x})" for x in elements]
        after = [f"{name} = np.moveaxis({name}, 0, -1).reshape(batch.shape + {shape})"]
    elif of.name == "casadi":
        opening, closing = "casadi.vertcat(", ")"
        after = [f"{name} = {name}.reshape(({columns}, {rows})).T"] * is_matrix
    else:
        mark, closing = "", "];"
        after = [f"{name} = reshape({name}, {columns}, {rows}).';"] * is_matrix
    return [f"{name} = {opening}", *(f"    {x}{mark}" for x in elements), closing, *after]


def _framed(
    program: Program, of: Language, inputs: list[str], outputs: list[str], lines: list[str]
) -> list[str]:
    """The function around the lines."""
    operations = {node[0] for node in program.operations.nodes}
    used = {node[1][0] for node in program.operations.nodes if node[0] == "input"}
    before, after, arguments = [], [], [*inputs]
    if of.name == "c":
        unused = [name for k, name in enumerate(inputs) if k not in used]
        unused += [
            name for name, port in zip(outputs, program.outputs, strict=True) if not port.size
        ]
        lines = [*(f"(void){name};" for name in unused), *lines]
        given = [*(f"const double *{x}" for x in inputs), *(f"double *{x}" for x in outputs)]
        head = ["#include <math.h>", "", f"void {program.name}({', '.join(given)})", "{"]
        return [*head, *(f"    {line}" for line in lines), "}"]
    if of.name == "matlab":
        head = [f"function [{', '.join(outputs)}] = {program.name}({', '.join(inputs)})"]
        choice = ["", "function z = select_(condition, x, y)"]
        choice += ["    z = y;", "    if condition", "        z = x;", "    end", "end"]
        after = choice if "pick" in operations else []
        return [*head, *(f"    {line}" for line in lines), "end", *after]
    if of.name == "numpy":
        before = [f"{name} = np.asarray({name}, dtype=np.float64)" for name in inputs]
        shapes = (f"{port.name}.shape[:-{len(port.shape)}]" for port in program.inputs)
        before.append(f"batch = np.zeros(np.broadcast_shapes({', '.join(shapes)}))")
    library = {"python": "math", "numpy": "numpy as np", "casadi": "casadi"}[of.name]
    head = [f"import {library}", "", ""]
    if of.name == "casadi" and "sign" in operations:
        arguments.append("smooth=0.0")
        smooth = "    return casadi.tanh(x / smooth) if smooth else casadi.sign(x)"
        head += ["def _sign(x, smooth):", smooth, "", ""]
    body = [*before, *lines, f"return {', '.join(outputs)}"]
    head.append(f"def {program.name}({', '.join(arguments)}):")
    return [*head, *(f"    {line}" for line in body)]
