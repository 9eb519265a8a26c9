"""Entries of lists as expressions: parsed to a tree of arithmetic, then given numbers."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import ParFileError

_LONGEST = 1000
_OPERATORS: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_SIGNS: dict[type, float] = {ast.UAdd: 1.0, ast.USub: -1.0}
_FUNCTIONS: dict[str, tuple[int, Callable[..., float]]] = {
    "sqrt": (1, math.sqrt),
    "cos": (1, math.cos),
    "sin": (1, math.sin),
    "tan": (1, math.tan),
    "atan2": (2, math.atan2),
}


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry of a list: an expression, and the place that a message can point at."""

    text: str
    place: str
    tree: ast.expr
    symbols: tuple[str, ...]

    def value(self, numbers: Mapping[str, float]) -> float:
        """The number, with a number for every symbol."""
        try:
            value = _evaluate(self.tree, numbers)
        except (ArithmeticError, ValueError, RecursionError) as error:
            raise ParFileError(
                f"{self.place}: {self.text!r} has no value ({error}); write a number."
            ) from None
        if not isinstance(value, float) or not math.isfinite(value):
            raise ParFileError(
                f"{self.place}: {self.text!r} is {value}; expected a finite real number."
            )
        return value


def parsed(text: str, place: str) -> Entry:
    """An entry from its text; what is not arithmetic is refused."""
    text = " ".join(text.split())
    problem = "" if text else "is empty"
    if len(text) > _LONGEST:
        problem = f"is longer than {_LONGEST} letters"
    tree: ast.expr | None = None
    symbols: list[str] = []
    if not problem:
        try:
            tree = ast.parse(text.replace("^", "**"), mode="eval").body
            symbols = list(dict.fromkeys(_symbols(tree)))
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            problem = "is not an expression"
    if problem or tree is None:
        raise ParFileError(
            f"{place}: {text[:60]!r} {problem}. Numbers, symbols, pi, + - * / **, parentheses and "
            f"{', '.join(_FUNCTIONS)} can be read."
        )
    return Entry(text, place, tree, tuple(symbols))


def _symbols(node: ast.expr) -> Iterator[str]:
    """Every symbol of an expression; anything else than arithmetic is a ValueError."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return
    if isinstance(node, ast.Name):
        if node.id.lower() != "pi":
            yield node.id
    elif isinstance(node, ast.UnaryOp) and type(node.op) in _SIGNS:
        yield from _symbols(node.operand)
    elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        yield from _symbols(node.left)
        yield from _symbols(node.right)
    elif isinstance(node, ast.Call) and _is_function(node):
        for argument in node.args:
            yield from _symbols(argument)
    else:
        raise ValueError(ast.dump(node))


def _is_function(node: ast.Call) -> bool:
    if not isinstance(node.func, ast.Name) or node.keywords:
        return False
    arity, _ = _FUNCTIONS.get(node.func.id.lower(), (-1, None))
    return arity == len(node.args)


def _evaluate(node: Any, numbers: Mapping[str, float]) -> float:
    """Value of a tree that `_symbols` has accepted."""
    if isinstance(node, ast.Constant):
        return float(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return math.pi if node.id.lower() == "pi" else numbers[node.id]
    if isinstance(node, ast.UnaryOp):
        return _SIGNS[type(node.op)] * _evaluate(node.operand, numbers)
    if isinstance(node, ast.BinOp):
        left, right = _evaluate(node.left, numbers), _evaluate(node.right, numbers)
        return _OPERATORS[type(node.op)](left, right)
    _, function = _FUNCTIONS[node.func.id.lower()]
    return function(*(_evaluate(argument, numbers) for argument in node.args))
