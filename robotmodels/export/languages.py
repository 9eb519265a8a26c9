"""Printers of a tape: C99, Python, NumPy, CasADi and MATLAB.

A language is what its elements and functions look like; the lines are made once for all. Products
and sums that are used once are written into the line that uses them.
"""

from __future__ import annotations

from collections.abc import Sequence
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


def file_text(text: Text, language: str) -> str:
    """A whole file."""
    if language not in LANGUAGES:
        near = nearest_names(str(language), LANGUAGES)
        meant = f" Did you mean {near[0]!r}?" if near else ""
        words = ", ".join(map(repr, LANGUAGES))
        raise InvalidValueError(f"language: expected one of {words}, got {language!r:.60}.{meant}")
    of = LANGUAGES[language]
    inputs, outputs = [port.name for port in text.inputs], []
    lines, results = lines_of(text, of)
    for port, elements in zip(text.outputs, results, strict=True):
        outputs.append(f"{port.name}_out" if port.name in inputs else port.name)
        lines += _result(of, outputs[-1], port.shape, elements)
    head = [f"{of.comment} {note}" for note in text.notes]
    return "\n".join([*head, *_framed(text, of, inputs, outputs, lines), ""])


def lines_of(text: Text, language: Language) -> tuple[list[str], list[list[str]]]:
    """Assignments, and the elements of the results."""
    nodes, results = text.operations
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
            expression = language.element(text.inputs[port], k)
            name = text.elements[port][k] if text.elements[port] else ""
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
            at = range(0, len(elements), max(columns, 1))
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
    text: Text, of: Language, inputs: list[str], outputs: list[str], lines: list[str]
) -> list[str]:
    """The function around the lines."""
    operations = {node[0] for node in text.operations.nodes}
    used = {node[1][0] for node in text.operations.nodes if node[0] == "input"}
    before, after, arguments = [], [], [*inputs]
    if of.name == "c":
        unused = [name for k, name in enumerate(inputs) if k not in used]
        unused += [name for name, port in zip(outputs, text.outputs, strict=True) if not port.size]
        lines = [*(f"(void){name};" for name in unused), *lines]
        given = [*(f"const double *{x}" for x in inputs), *(f"double *{x}" for x in outputs)]
        head = ["#include <math.h>", "", f"void {text.name}({', '.join(given)})", "{"]
        return [*head, *(f"    {line}" for line in lines), "}"]
    if of.name == "matlab":
        head = [f"function [{', '.join(outputs)}] = {text.name}({', '.join(inputs)})"]
        choice = ["", "function z = select_(condition, x, y)"]
        choice += ["    z = y;", "    if condition", "        z = x;", "    end", "end"]
        after = choice if "pick" in operations else []
        return [*head, *(f"    {line}" for line in lines), "end", *after]
    if of.name == "numpy":
        before = [f"{name} = np.asarray({name}, dtype=np.float64)" for name in inputs]
        shapes = (f"{port.name}.shape[:-{len(port.shape)}]" for port in text.inputs)
        before.append(f"batch = np.zeros(np.broadcast_shapes({', '.join(shapes)}))")
    library = {"python": "math", "numpy": "numpy as np", "casadi": "casadi"}[of.name]
    head = [f"import {library}", "", ""]
    if of.name == "casadi" and "sign" in operations:
        arguments.append("smooth=0.0")
        smooth = "    return casadi.tanh(x / smooth) if smooth else casadi.sign(x)"
        head += ["def _sign(x, smooth):", smooth, "", ""]
    body = [*before, *lines, f"return {', '.join(outputs)}"]
    head.append(f"def {text.name}({', '.join(arguments)}):")
    return [*head, *(f"    {line}" for line in body)]


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
