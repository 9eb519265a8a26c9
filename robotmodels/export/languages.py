"""Printers of a tape: C99, Python, NumPy, CasADi and MATLAB.

A printer says how elements, constants and functions are written, and what stands before and after
the lines; the lines themselves are made once for all languages. Products and sums that are used
once are written into the line that uses them, in the same order of operations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from ..errors import InvalidValueError, nearest_names
from .tape import Operations, Port

_WIDEST = 60  # columns of what is written into another line
_LEVEL = {"add": 1, "sub": 1, "mul": 2, "div": 2}
_SIGN = {"add": "+", "sub": "-", "mul": "*", "div": "/"}


class Source(Protocol):
    """What is printed, see `Program`."""

    @property
    def name(self) -> str: ...
    @property
    def inputs(self) -> tuple[Port, ...]: ...
    @property
    def outputs(self) -> tuple[Port, ...]: ...
    @property
    def elements(self) -> tuple[tuple[str, ...], ...]: ...
    @property
    def notes(self) -> tuple[str, ...]: ...
    @property
    def operations(self) -> Operations: ...


class Body(NamedTuple):
    """Assignments, elements of the results, and the inputs that are used."""

    lines: list[str]
    results: list[list[str]]
    used: list[bool]


@dataclass(frozen=True, slots=True)
class Language:
    """How a language writes elements of inputs, assignments and functions, and a whole file."""

    suffix: str
    comment: str
    element: Callable[[Port, int], str]
    assignment: str
    words: dict[str, str]
    function: Callable[[Source, Body], list[str]]

    def file(self, program: Source) -> str:
        """The text of a file."""
        head = [f"{self.comment} {note}".rstrip() for note in program.notes]
        if self.comment == "*":
            head = ["/*", *(f" {line}" for line in head), " */"]
        return "\n".join([*head, *self.function(program, body(program, self)), ""])


def language_of(name: str) -> Language:
    """A language by its name."""
    if isinstance(name, str) and name.lower() in LANGUAGES:
        return LANGUAGES[name.lower()]
    near = nearest_names(str(name), LANGUAGES)
    meant = f" Did you mean {near[0]!r}?" if near else ""
    words = ", ".join(map(repr, LANGUAGES))
    raise InvalidValueError(f"language: expected one of {words}, got {name!r:.60}.{meant}")


def body(program: Source, language: Language) -> Body:
    """The lines of a program."""
    nodes, results = program.operations.nodes, program.operations.results
    uses = [0] * (len(nodes) + 1)
    for operation, operands, _ in nodes:
        for k in () if operation == "input" else operands:
            uses[abs(k)] += 1
    for row in results:
        for k in row:
            uses[abs(k)] += 1
    texts: list[tuple[str, int]] = [("", 0)]  # of each node, and how tightly it binds
    lines: list[str] = []
    used = [False] * len(program.inputs)

    def text(number: int, level: int) -> str:
        """An operand, in brackets if it binds less than its place asks for."""
        own, binds = texts[abs(number)]
        if number < 0:
            own, binds = f"-{own if binds >= 2 else f'({own})'}", 1
        return own if binds >= level else f"({own})"

    def assigned(name: str, value: str) -> tuple[str, int]:
        lines.append(language.assignment.format(name, value))
        return name, 3

    count = 0
    for number, (operation, operands, value) in enumerate(nodes, start=1):
        if operation == "constant":
            texts.append((repr(value), 3))
            continue
        if operation == "nan":
            texts.append((language.words["nan"], 3))
            continue
        if operation == "input":
            port, k = operands[0] - 1, operands[1] - 1
            used[port] = True
            place = language.element(program.inputs[port], k)
            names = program.elements[port]
            texts.append(assigned(names[k], place) if names else (place, 3))
            continue
        level = _LEVEL.get(operation, 3)
        if operation in _SIGN:
            a, b = operands
            if operation != "sub" and operation != "div" and texts[b][1] <= level < texts[a][1]:
                a, b = b, a  # what is written in place stands first, without brackets
            space = " " if level == 1 else ""
            expression = f"{text(a, level)}{space}{_SIGN[operation]}{space}{text(b, level + 1)}"
        elif operation == "pick" or operation == "sign":
            expression = language.words[operation].format(*(text(k, 3) for k in operands))
        else:
            arguments = ", ".join(text(k, 0) for k in operands)
            expression = f"{language.words['functions']}{operation}({arguments})"
        once = uses[number] == 1 and operation in _SIGN and len(expression) <= _WIDEST
        if once:
            texts.append((expression, level))
            continue
        name = _trigonometric(program, operation, operands)
        if name is None:
            count += 1
            name = f"t{count}"
        texts.append(assigned(name, expression))
    return Body(lines, [[text(k, 0) for k in row] for row in results], used)


def _trigonometric(program: Source, operation: str, operands: tuple[int, ...]) -> str | None:
    """Names S1, C1 of the sine and cosine of a joint variable."""
    if operation not in ("sin", "cos"):
        return None
    of, place, _ = program.operations.nodes[abs(operands[0]) - 1]
    if of != "input" or program.inputs[place[0] - 1].name != "q":
        return None
    return f"{operation[0].upper()}{place[1]}"


def _indices(port: Port, k: int, first: int = 0) -> list[int]:
    """Indices of an element, row-major."""
    rest = [k + first] if len(port.shape) < 2 else [k // port.shape[1] + first]
    return rest + ([k % port.shape[1] + first] if len(port.shape) == 2 else [])


def _nested(port: Port, row: Sequence[str], opening: str = "[", closing: str = "]") -> list[str]:
    """Elements of a result as nested lists, a line for each."""
    if not port.shape:
        return [row[0]]
    if len(port.shape) == 1:
        return [opening + ", ".join(row) + closing]
    step = port.shape[1]
    rows = [
        opening + ", ".join(row[k : k + step]) + closing for k in range(0, len(row), max(step, 1))
    ]
    return [opening, *(f"    {line}," for line in rows), closing]


def _c(program: Source, code: Body) -> list[str]:
    arguments = [f"const double *{p.name}" for p in program.inputs]
    arguments += [f"double *{_result(program, p)}" for p in program.outputs]
    unused = [
        f"(void){p.name};" for p, used in zip(program.inputs, code.used, strict=True) if not used
    ]
    stores = [
        f"{_result(program, port)}[{k}] = {value};"
        for port, row in zip(program.outputs, code.results, strict=True)
        for k, value in enumerate(row)
    ]
    unused += [f"(void){_result(program, p)};" for p in program.outputs if not p.size]
    return [
        "#include <math.h>",
        "",
        f"void {program.name}({', '.join(arguments)})",
        "{",
        *(f"    {line}" for line in (*code.lines, *unused, *stores)),
        "}",
    ]


def _result(program: Source, port: Port) -> str:
    """Name of an output, another one where an input has it."""
    return port.name + "_out" * any(port.name == other.name for other in program.inputs)


def _python(program: Source, code: Body) -> list[str]:
    arguments = ", ".join(p.name for p in program.inputs)
    out = [
        "import math",
        "",
        "",
        f"def {program.name}({arguments}):",
        *(f"    {line}" for line in code.lines),
    ]
    return [*out, *_returned(program, [_nested(p, r) for p, r in _pairs(program, code)])]


def _pairs(program: Source, code: Body) -> list[tuple[Port, list[str]]]:
    return list(zip(program.outputs, code.results, strict=True))


def _returned(program: Source, values: list[list[str]]) -> list[str]:
    """The statements that return the results."""
    lines, names = [], []
    for port, value in zip(program.outputs, values, strict=True):
        name = _result(program, port)
        names.append(name)
        lines += [f"    {name} = {value[0]}", *(f"    {line}" for line in value[1:])]
    return [*lines, f"    return {', '.join(names)}"]


def _numpy(program: Source, code: Body) -> list[str]:
    lines = [
        "import numpy as np",
        "",
        "",
        f"def {program.name}({', '.join(p.name for p in program.inputs)}):",
    ]
    shapes = []
    for port in program.inputs:
        lines.append(f"    {port.name} = np.asarray({port.name}, dtype=np.float64)")
        shapes.append(f"{port.name}.shape[:{-len(port.shape)}]")
    lines.append(f"    shape = np.broadcast_shapes({', '.join(shapes)})")
    lines += [f"    {line}" for line in code.lines]
    names = []
    for port, row in _pairs(program, code):
        name = _result(program, port)
        names.append(name)
        lines.append(f"    {name} = np.empty(shape + {port.shape})")
        for k, value in enumerate(row):
            index = ", ".join(map(str, ("...", *_indices(port, k)))) if port.shape else "..."
            lines.append(f"    {name}[{index}] = {value}")
    return [*lines, f"    return {', '.join(names)}"]


def _casadi(program: Source, code: Body) -> list[str]:
    lines = [
        "import casadi",
        "",
        "",
        "def _sign(x, smooth):",
        "    return casadi.tanh(x / smooth) if smooth else casadi.sign(x)",
        "",
        "",
        f"def {program.name}({', '.join(p.name for p in program.inputs)}, smooth=0.0):",
        *(f"    {line}" for line in code.lines),
    ]
    if not any(node[0] == "sign" for node in program.operations.nodes):
        del lines[3:7]
        lines[3] = lines[3].replace(", smooth=0.0", "")
    values = []
    for port, row in _pairs(program, code):
        if len(port.shape) < 2:
            values.append([f"casadi.vertcat({', '.join(row)})"])
            continue
        rows = _nested(port, row, "casadi.horzcat(", ")")
        values.append(["casadi.vertcat(", *rows[1:-1], ")"])
    return [*lines, *_returned(program, values)]


def _matlab(program: Source, code: Body) -> list[str]:
    names = ", ".join(_result(program, p) for p in program.outputs)
    arguments = ", ".join(p.name for p in program.inputs)
    lines = [f"function [{names}] = {program.name}({arguments})"]
    lines += [f"    {line}" for line in code.lines]
    for port, row in _pairs(program, code):
        name = _result(program, port)
        rows, columns = (*port.shape, 1, 1)[:2]
        lines.append(f"    {name} = zeros({rows}, {columns});")
        for k, value in enumerate(row):
            index = ", ".join(map(str, _indices(port, k, 1))) if port.shape else "1"
            lines.append(f"    {name}({index}) = {value};")
    lines.append("end")
    if any(node[0] == "pick" for node in program.operations.nodes):
        lines += [
            "", "function z = select_(condition, x, y)", "    if condition", "        z = x;",
            "    else", "        z = y;", "    end", "end",
        ]  # fmt: skip
    return lines


def _bracketed(
    opening: str, between: str, closing: str, first: int = 0
) -> Callable[[Port, int], str]:
    def element(port: Port, k: int) -> str:
        return port.name + opening + between.join(map(str, _indices(port, k, first))) + closing

    return element


LANGUAGES = {
    "c": Language(
        ".c", "*", lambda port, k: f"{port.name}[{k}]", "const double {} = {};",
        {
            "functions": "", "sign": "(double)(({0} > 0.0) - ({0} < 0.0))", "nan": "NAN",
            "pick": "({} > {} ? {} : {})",
        },
        _c,
    ),
    "python": Language(
        ".py", "#", _bracketed("[", "][", "]"), "{} = {}",
        {
            "functions": "math.", "sign": "float(({0} > 0.0) - ({0} < 0.0))", "nan": "math.nan",
            "pick": "({2} if {0} > {1} else {3})",
        },
        _python,
    ),
    "numpy": Language(
        ".py", "#", _bracketed("[..., ", ", ", "]"), "{} = {}",
        {
            "functions": "np.", "sign": "np.sign({})", "nan": "np.nan",
            "pick": "np.where({} > {}, {}, {})",
        },
        _numpy,
    ),
    "casadi": Language(
        ".py", "#", _bracketed("[", ", ", "]"), "{} = {}",
        {
            "functions": "casadi.", "sign": "_sign({}, smooth)", "nan": 'float("nan")',
            "pick": "casadi.if_else({} > {}, {}, {})",
        },
        _casadi,
    ),
    "matlab": Language(
        ".m", "%", _bracketed("(", ", ", ")", 1), "{} = {};",
        {
            "functions": "", "sign": "sign({})", "nan": "NaN",
            "pick": "select_({} > {}, {}, {})",
        },
        _matlab,
    ),
}  # fmt: skip
"""By name, in the order of the documentation."""
