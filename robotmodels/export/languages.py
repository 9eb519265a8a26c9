"""Printers of a tape: C99, Python, NumPy, CasADi and MATLAB.

A language is what its elements, functions and results look like; the lines are made once for all.
Products and sums that are used once are written into the line that uses them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from ..errors import InvalidValueError, nearest_names
from .tape import Operations, Port

_WIDEST = 60  # columns of what is written into another line
_LEVEL = {"add": 1, "sub": 1, "mul": 2, "div": 2}
_SIGN = {"add": " + ", "sub": " - ", "mul": "*", "div": "/"}


class Text(NamedTuple):
    """What is printed: name, inputs with the names of their elements, outputs, header, tape."""

    name: str
    inputs: tuple[Port, ...]
    elements: tuple[tuple[str, ...], ...]
    outputs: tuple[Port, ...]
    notes: tuple[str, ...]
    operations: Operations


class Language(NamedTuple):
    """How a language writes comments, elements of inputs, assignments, functions and results.

    ``result`` takes name, shape and elements; ``frame`` the text, the names of inputs and outputs
    and the lines between.
    """

    suffix: str
    comment: str
    element: Callable[[str, Sequence[int]], str]
    assignment: str
    functions: str
    sign: str
    pick: str
    nan: str
    result: Callable[[str, tuple[int, ...], Sequence[str]], list[str]]
    frame: Callable[[Text, list[str], list[str], list[str]], list[str]]


def file_text(text: Text, language: str) -> str:
    """A whole file."""
    if language not in LANGUAGES:
        near = nearest_names(str(language), LANGUAGES)
        meant = f" Did you mean {near[0]!r}?" if near else ""
        words = ", ".join(map(repr, LANGUAGES))
        raise InvalidValueError(f"language: expected one of {words}, got {language!r:.60}.{meant}")
    of = LANGUAGES[language]
    head = [f"{of.comment} {note}".rstrip() for note in text.notes]
    inputs, outputs = [port.name for port in text.inputs], []
    lines, results = lines_of(text, of)
    for port, elements in zip(text.outputs, results, strict=True):
        outputs.append(f"{port.name}_out" if port.name in inputs else port.name)
        lines += of.result(outputs[-1], port.shape, elements)
    return "\n".join([*head, *of.frame(text, inputs, outputs, lines), ""])


def lines_of(text: Text, language: Language) -> tuple[list[str], list[list[str]]]:
    """Assignments, and the elements of the results."""
    nodes, results = text.operations
    uses = [0] * (len(nodes) + 1)
    for k in (k for operation, operands, _ in nodes if operation != "input" for k in operands):
        uses[abs(k)] += 1
    for k in (k for row in results for k in row):
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
        if operation == "constant" or operation == "nan":
            expression, is_short = repr(value) if operation == "constant" else language.nan, True
        elif operation == "input":
            port, k = text.inputs[operands[0]], operands[1]
            indices = (k,) if len(port.shape) == 1 else divmod(k, port.shape[1])
            expression = language.element(port.name, indices)
            name = text.elements[operands[0]][k] if text.elements[operands[0]] else ""
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
            if operation in ("sin", "cos") and of == "input" and text.inputs[place[0]].name == "q":
                name = f"{operation[0].upper()}{place[1] + 1}"
        if is_short:
            known.append((expression, level))
            continue
        count += not name
        name = name or f"t{count}"
        lines.append(language.assignment.format(name, expression))
        known.append((name, 3))
    return lines, [[operand(k, 0) for k in row] for row in results]


def _indented(lines: Sequence[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def _listed(start: str, elements: Sequence[str], end: str) -> list[str]:
    return [start, *(f"    {element}," for element in elements), end]


def _rows(shape: tuple[int, ...], elements: Sequence[str]) -> list[str]:
    """Elements row by row, in brackets if there are several to a row."""
    if len(shape) < 2:
        return list(elements)
    step = max(shape[1], 1)
    return [f"[{', '.join(elements[k : k + step])}]" for k in range(0, len(elements), step)]


def _python_result(name: str, shape: tuple[int, ...], elements: Sequence[str]) -> list[str]:
    if not shape:
        return [f"{name} = {elements[0]}"]
    return _listed(f"{name} = [", _rows(shape, elements), "]")


def _numpy_result(name: str, shape: tuple[int, ...], elements: Sequence[str]) -> list[str]:
    lines = _listed(f"{name} = np.array([", [f"batch + ({x})" for x in elements], "])")
    return [*lines, f"{name} = np.moveaxis({name}, 0, -1).reshape(batch.shape + {shape})"]


def _casadi_result(name: str, shape: tuple[int, ...], elements: Sequence[str]) -> list[str]:
    end = f").reshape(({shape[1]}, {shape[0]})).T" if len(shape) == 2 else ")"
    return _listed(f"{name} = casadi.vertcat(", elements, end)


def _matlab_result(name: str, shape: tuple[int, ...], elements: Sequence[str]) -> list[str]:
    lines = [f"{name} = [", *(f"    {element}" for element in elements), "];"]
    reshaped = f"{name} = reshape({name}, {shape[-1]}, {shape[0]}).';" if len(shape) == 2 else ""
    return [*lines, *[reshaped] * bool(reshaped)]


def _c(text: Text, inputs: list[str], outputs: list[str], lines: list[str]) -> list[str]:
    arguments = [f"const double *{name}" for name in inputs]
    arguments += [f"double *{name}" for name in outputs]
    unused = [f"(void){name};" for name in (*inputs, *outputs)]
    return [
        "#include <math.h>", "", f"void {text.name}({', '.join(arguments)})", "{",
        *_indented([*unused, *lines]), "}",
    ]  # fmt: skip


def _python(text: Text, inputs: list[str], outputs: list[str], lines: list[str]) -> list[str]:
    head = f"def {text.name}({', '.join(inputs)}):"
    return ["import math", "", "", head, *_indented([*lines, f"return {', '.join(outputs)}"])]


def _numpy(text: Text, inputs: list[str], outputs: list[str], lines: list[str]) -> list[str]:
    arrays = [f"{name} = np.asarray({name}, dtype=np.float64)" for name in inputs]
    shapes = (f"{p.name}.shape[:-{len(p.shape)}]" for p in text.inputs)
    arrays.append(f"batch = np.zeros(np.broadcast_shapes({', '.join(shapes)}))")
    return ["import numpy as np", *_python(text, inputs, outputs, [*arrays, *lines])[1:]]


def _casadi(text: Text, inputs: list[str], outputs: list[str], lines: list[str]) -> list[str]:
    smooth = any(node[0] == "sign" for node in text.operations.nodes)
    helper = [
        "", "", "def _sign(x, smooth):",
        "    return casadi.tanh(x / smooth) if smooth else casadi.sign(x)",
    ]  # fmt: skip
    arguments = [*inputs, *["smooth=0.0"] * smooth]
    body = _python(text, arguments, outputs, lines)[1:]
    return ["import casadi", *(helper if smooth else ()), *body]


def _matlab(text: Text, inputs: list[str], outputs: list[str], lines: list[str]) -> list[str]:
    head = f"function [{', '.join(outputs)}] = {text.name}({', '.join(inputs)})"
    select = [
        "", "function z = select_(condition, x, y)", "    z = y;", "    if condition",
        "        z = x;", "    end", "end",
    ]  # fmt: skip
    uses = any(node[0] == "pick" for node in text.operations.nodes)
    return [head, *_indented(lines), "end", *(select if uses else ())]


def _between(
    opening: str, middle: str, closing: str, first: int = 0
) -> Callable[[str, Sequence[int]], str]:
    return lambda name, at: name + opening + middle.join(str(k + first) for k in at) + closing


LANGUAGES = {
    "c": Language(
        ".c", "//", lambda name, at: f"{name}[{sum(x * 4**i for i, x in enumerate(at[::-1]))}]",
        "const double {} = {};", "", "(double)(({0} > 0.0) - ({0} < 0.0))", "({} > {} ? {} : {})", "NAN",
        lambda name, _, elements: [f"{name}[{k}] = {x};" for k, x in enumerate(elements)], _c,
    ),
    "python": Language(
        ".py", "#", _between("[", "][", "]"), "{} = {}",
        "math.", "float(({0} > 0.0) - ({0} < 0.0))", "({2} if {0} > {1} else {3})", "math.nan",
        _python_result, _python,
    ),
    "numpy": Language(
        ".py", "#", _between("[..., ", ", ", "]"), "{} = {}",
        "np.", "np.sign({})", "np.where({} > {}, {}, {})", "np.nan", _numpy_result, _numpy,
    ),
    "casadi": Language(
        ".py", "#", _between("[", ", ", "]"), "{} = {}", "casadi.", "_sign({}, smooth)",
        "casadi.if_else({} > {}, {}, {})", 'float("nan")', _casadi_result, _casadi,
    ),
    "matlab": Language(
        ".m", "%", _between("(", ", ", ")", 1), "{} = {};",
        "", "sign({})", "select_({} > {}, {}, {})", "NaN", _matlab_result, _matlab,
    ),
}  # fmt: skip
"""By name, in the order of the documentation."""
