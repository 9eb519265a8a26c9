"""A program, a model of a robot as straight-line code, and its printer.

A `Language` holds the syntax; assignments are the same for all languages. Products and sums that
are used once are written into the line that uses them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, batch_shape
from .._choices import one_of
from ..errors import InvalidValueError
from .tape import RUN, OperationCount, Operations, Port

_WIDEST = 60  # columns of what is written into another line
_LEVEL = {"add": 1, "sub": 1, "mul": 2, "div": 2}
_SIGN = {"add": " + ", "sub": " - ", "mul": "*", "div": "/"}


@dataclass(frozen=True, slots=True, repr=False)
class Program:
    """A model as straight-line code, made by `program`. Read-only, picklable, equal by value.

    ``name`` is that of the function in generated code, ``kind`` the model; ``inputs`` and
    ``outputs`` are (name, shape) in the order of arguments and results; ``elements`` and ``values``
    name the elements of inputs that are parameters, with their values in the model; ``notes`` are
    the header, ``operations`` the tape.

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
        return tuple(_lines(self, LANGUAGES["python"])[0])

    def __call__(self, *inputs: ArrayLike) -> Array | tuple[Array, ...]:
        """Outputs of the tape, for checks; leading axes of the inputs are batch axes."""
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
        values: list[Any] = [np.zeros(())]
        with np.errstate(all="ignore"):
            for operation, operands, constant in self.operations.nodes:
                if operation == "input":
                    values.append(flat[operands[0]][..., operands[1]])
                elif operation == "constant":
                    values.append(np.float64(constant))
                else:
                    x = (values[k] if k > 0 else -values[-k] for k in operands)
                    values.append(RUN[operation](*x))
        out = []
        for port, row in zip(self.outputs, self.operations.results, strict=True):
            result = np.empty((*batch, port.size))
            for i, k in enumerate(row):
                result[..., i] = values[k] if k > 0 else -values[-k]
            out.append(result.reshape((*batch, *port.shape)))
        return out[0] if len(out) == 1 else tuple(out)

    def code(self, language: str = "c") -> str:
        """Source text of one file.

        ``"c"`` (C99), ``"python"`` (plain), ``"numpy"`` (batch axes), ``"casadi"`` or ``"matlab"``:
        one function, self-contained, the same text every time.
        """
        return _file(self, one_of(str(language).lower(), tuple(LANGUAGES), "language"))

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

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from robotmodels.export import program
    >>> from robotmodels.robots import load
    >>> with TemporaryDirectory() as folder:
    ...     write(program(load("planar_2r"), "dgm"), Path(folder) / "planar.c")
    """
    path = Path(path)
    suffixes = {kind.suffix: name for name, kind in reversed(LANGUAGES.items())} | {".py": "python"}
    if language is None and path.suffix.lower() not in suffixes:
        raise InvalidValueError(
            f"path: expected *{', *'.join(sorted(suffixes))}, or a language, got {path.name!r}."
        )
    text = program.code(suffixes[path.suffix.lower()] if language is None else language)
    try:
        path.write_bytes(text.encode("ascii"))
    except (OSError, ValueError) as error:  # the latter for a zero in the name
        words = getattr(error, "strerror", None) or error
        raise InvalidValueError(f"path: cannot write {str(path)!r}: {words}.") from None


class Language(NamedTuple):
    """Syntax of a language: elements ``name(i, j)``, assignments, functions, results, a file."""

    suffix: str
    comment: str
    brackets: tuple[str, str, str]
    first: int  # index
    local: str  # assignment
    end: str  # of an assignment to an element
    functions: str
    sign: str
    pick: str
    nan: str
    file: str
    made: str = ""  # a result, before its elements are assigned one by one
    shaped: tuple[str, str, str] = ("", "", "")  # a scalar, vector, matrix of these elements
    helper: tuple[str, str] = ("", "")  # operation that needs it, and its text

    def element(self, port: Port, k: int) -> str:
        """Element k of an input, counted row by row; in C all are in one row."""
        opening, between, closing = self.brackets
        indices = divmod(k, port.shape[-1]) if len(port.shape) > 1 and between else (k,)
        return port.name + opening + between.join(str(i + self.first) for i in indices) + closing

    def result(self, port: Port, values: Sequence[str]) -> list[str]:
        """Lines that make a result of its elements, row by row."""
        one, (rows, columns) = Port(port.name, (port.size,)), (*port.shape, 1, 1)[:2]
        lines = [f"{self.element(one, k)} = {x}{self.end}" for k, x in enumerate(values)]
        before, after = (
            text.format(port.name, rows, columns, port.size)
            for text in (self.made, self.shaped[len(port.shape)])
        )
        return [line for line in (before, *lines, after) if line]


_PYTHON = "import {}\n\n\n{{helper}}def {{name}}({{arguments}}):\n{{body}}\n"
LANGUAGES = {
    "c": Language(
        ".c", "//", ("[", "", "]"), 0, "const double {} = {};", ";", "",
        "(double)(({0} > 0.0) - ({0} < 0.0))", "({} > {} ? {} : {})", "NAN",
        "#include <math.h>\n\nvoid {name}({arguments})\n{{\n{body}\n}}\n",
    ),
    "python": Language(
        ".py", "#", ("[", "][", "]"), 0, "{} = {}", "", "math.",
        "float(({0} > 0.0) - ({0} < 0.0))", "({2} if {0} > {1} else {3})", "math.nan",
        _PYTHON.format("math"), "{0} = [0.0] * {3}",
        ("{0} = {0}[0]", "", "{0} = [{0}[{2} * i : {2} * i + {2}] for i in range({1})]"),
    ),
    "numpy": Language(
        ".py", "#", ("[..., ", ", ", "]"), 0, "{} = {}", "", "np.",
        "np.sign({})", "np.where({} > {}, {}, {})", "np.nan",
        _PYTHON.format("numpy as np"), "{0} = np.zeros((*batch, {3}))",
        ("{0} = {0}[..., 0]", "", "{0} = {0}.reshape((*batch, {1}, {2}))"),
    ),
    "casadi": Language(
        ".py", "#", ("[", ", ", "]"), 0, "{} = {}", "", "casadi.",
        "_sign({}, smooth)", "casadi.if_else({} > {}, {}, {})", 'float("nan")',
        _PYTHON.format("casadi"), "{0} = [0.0] * {3}",
        ("{0} = {0}[0]", "{0} = casadi.vertcat(*{0})",
         "{0} = casadi.vertcat(*{0}).reshape(({2}, {1})).T"),
        ("sign", "def _sign(x, smooth):\n    return casadi.tanh(x / smooth) if smooth else "
         "casadi.sign(x)\n\n\n"),
    ),
    "matlab": Language(
        ".m", "%", ("(", ", ", ")"), 1, "{} = {};", ";", "",
        "sign({})", "select_({} > {}, {}, {})", "NaN",
        "function [{results}] = {name}({arguments})\n{body}\nend\n{helper}",
        "{0} = zeros({3}, 1);", ("", "", "{0} = reshape({0}, {2}, {1}).';"),
        ("pick", "\nfunction z = select_(condition, x, y)\n    z = y;\n    if condition\n"
         "        z = x;\n    end\nend\n"),
    ),
}  # fmt: skip
"""By name, in the order of the documentation."""


def _file(program: Program, language: str) -> str:
    """A whole file."""
    of, inputs = LANGUAGES[language], [port.name for port in program.inputs]
    outputs = [
        port._replace(name=f"{port.name}_out" if port.name in inputs else port.name)
        for port in program.outputs
    ]
    operations, (helper, text) = {node[0] for node in program.operations.nodes}, of.helper
    text = text if helper in operations else ""
    body, results = _lines(program, of)
    arguments, names = inputs, [port.name for port in outputs]
    if language == "c":
        arguments = [*(f"const double *{x}" for x in inputs), *(f"double *{x}" for x in names)]
        used = {node[1][0] for node in program.operations.nodes if node[0] == "input"}
        unused = [x for k, x in enumerate(inputs) if k not in used]
        unused += [port.name for port in outputs if not port.size]
        body = [*(f"(void){name};" for name in unused), *body]
    elif language == "numpy":
        shapes = (f"{port.name}.shape[:-{len(port.shape)}]" for port in program.inputs)
        before = [f"{name} = np.asarray({name}, dtype=np.float64)" for name in inputs]
        body = [*before, f"batch = np.broadcast_shapes({', '.join(shapes)})", *body]
    elif language == "casadi" and text:
        arguments = [*inputs, "smooth=0.0"]
    for port, values in zip(outputs, results, strict=True):
        body += of.result(port, values)
    body += [f"return {', '.join(names)}"] * (of.suffix == ".py")
    head = "".join(f"{of.comment} {note}\n" for note in program.notes)
    return head + of.file.format(
        name=program.name, arguments=", ".join(arguments), results=", ".join(names), helper=text,
        body="\n".join(f"    {line}" for line in body),
    )  # fmt: skip


def _lines(program: Program, language: Language) -> tuple[list[str], list[list[str]]]:
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
            is_joint = of == "input" and program.inputs[place[0]].name == "q"
            if operation in ("sin", "cos") and is_joint:
                name = f"{operation[0].upper()}{place[1] + 1}"
        if is_short:
            known.append((expression, level))
            continue
        count += not name
        name = name or f"t{count}"
        lines.append(language.local.format(name, expression))
        known.append((name, 3))
    return lines, [[operand(k, 0) for k in row] for row in results]
