"""A tape of scalar operations, written by ordinary arithmetic.

Equal operations share one line (value numbering), operations on constants are done at once, zeros
and ones disappear, signs are carried along (``-x`` costs nothing), and lines that no result needs
are dropped when the tape is frozen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple, Union

import numpy as np

from .._arrays import Array

Node = tuple[str, tuple[int, ...], float]
"""An operation, its operands (node numbers from 1, negative for the opposite), a constant."""
Number = Union[float, "Scalar"]
Vector = tuple[Number, Number, Number]

FUNCTIONS: dict[str, tuple[Callable[..., float], int]] = {
    "sin": (math.sin, -1),
    "cos": (math.cos, 1),
    "sqrt": (math.sqrt, 0),
    "sign": (lambda x: float((x > 0.0) - (x < 0.0)), -1),
    "floor": (math.floor, 0),
    "atan2": (math.atan2, 0),
}
"""Value of a function, and its symmetry: -1 odd, 1 even, 0 none."""


class OperationCount(NamedTuple):
    """Operations of a program; signs and comparisons are not counted.

    Parameters
    ----------
    multiplications, additions : int
        Products of two numbers; sums and differences.
    functions : int
        Sines, cosines, square roots and others.
    divisions : int
        Quotients.

    Examples
    --------
    >>> OperationCount(3, 2, 1, 0).multiplications
    3
    """

    multiplications: int
    additions: int
    functions: int
    divisions: int


class Port(NamedTuple):
    """An input or output of a program: its name and shape."""

    name: str
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)


class Scalar:
    """A value on a tape that is not a constant; constants are plain floats."""

    __slots__ = ("number", "tape")
    __array_ufunc__ = None  # NumPy's numbers leave the arithmetic to this class

    def __init__(self, tape: Tape, number: int) -> None:
        self.tape, self.number = tape, number

    def __neg__(self) -> Scalar:
        return Scalar(self.tape, -self.number)

    def __add__(self, other: Number) -> Number:
        if not isinstance(other, Scalar):
            if other == 0.0:
                return self
            other = self.tape.constant(other)
        a, b = self.number, other.number
        if a == -b:
            return 0.0
        if (a < 0) == (b < 0):  # one sign for both terms, else the difference of an ordered pair
            sign = -1 if a < 0 else 1
            a, b = sorted((abs(a), abs(b)))
            return Scalar(self.tape, sign * self.tape.add("add", (a, b)))
        plus, minus = (a, -b) if a > 0 else (b, -a)
        sign = 1 if plus < minus else -1
        return Scalar(self.tape, sign * self.tape.add("sub", tuple(sorted((plus, minus)))))

    def __sub__(self, other: Number) -> Number:
        return self + -other

    def __rsub__(self, other: float) -> Number:
        return -self + other

    def __mul__(self, other: Number) -> Number:
        if not isinstance(other, Scalar):
            if other == 0.0:
                return 0.0
            if abs(other) == 1.0:
                return self if other > 0.0 else -self
            other = self.tape.constant(other)
        a, b = self.number, other.number
        sign = -1 if (a < 0) != (b < 0) else 1
        return Scalar(self.tape, sign * self.tape.add("mul", tuple(sorted((abs(a), abs(b))))))

    def __truediv__(self, other: Number) -> Number:
        if not isinstance(other, Scalar):
            return self * (1.0 / other)
        return quotient(self, other)

    def __rtruediv__(self, other: float) -> Number:
        return quotient(other, self)

    __radd__, __rmul__ = __add__, __mul__


class Tape:
    """Operations in the order in which they were asked for first."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._numbers: dict[Node, int] = {}

    def add(self, operation: str, operands: tuple[int, ...], value: float = 0.0) -> int:
        """Number of a node, a new one if there is none like it."""
        node = operation, operands, value
        number = self._numbers.get(node)
        if number is None:
            self.nodes.append(node)
            number = self._numbers[node] = len(self.nodes)
        return number

    def constant(self, value: float) -> Scalar:
        """A constant as an operand."""
        number = self.add("constant", (), abs(float(value)))
        return Scalar(self, number if value >= 0.0 or value != value else -number)

    def inputs(self, port: int, size: int) -> list[Number]:
        """The elements of an input."""
        return [Scalar(self, self.add("input", (port + 1, k + 1))) for k in range(size)]

    def frozen(self, results: Iterable[Iterable[Number]]) -> Operations:
        """Only what the results need, renumbered."""
        wanted = [
            [(x if isinstance(x, Scalar) else self.constant(x)).number for x in row]
            for row in results
        ]
        needed = [False] * (len(self.nodes) + 1)
        for row in wanted:
            for number in row:
                needed[abs(number)] = True
        for number in range(len(self.nodes), 0, -1):
            if needed[number] and self.nodes[number - 1][0] != "input":
                for operand in self.nodes[number - 1][1]:
                    needed[abs(operand)] = True
        place = np.cumsum(needed).tolist()

        def moved(numbers: Sequence[int]) -> tuple[int, ...]:
            return tuple(place[k] if k > 0 else -place[-k] for k in numbers)

        kept = tuple(
            node if node[0] == "input" else (node[0], moved(node[1]), node[2])
            for number, node in enumerate(self.nodes, start=1)
            if needed[number]
        )
        return Operations(kept, tuple(map(moved, wanted)))


@dataclass(frozen=True, slots=True)
class Operations:
    """A frozen tape: its nodes, and the signed numbers of the elements of each result."""

    nodes: tuple[Node, ...]
    results: tuple[tuple[int, ...], ...]

    def count(self) -> OperationCount:
        """Numbers of operations."""
        names = [node[0] for node in self.nodes]
        additions = names.count("add") + names.count("sub")
        functions = sum(map(names.count, FUNCTIONS))
        return OperationCount(names.count("mul"), additions, functions, names.count("div"))

    def run(self, inputs: Sequence[Array]) -> list[list[Array]]:
        """Elements of the results for the elements of the inputs, arrays (k, ...) each."""
        values: list[Array] = [np.zeros(())]
        for operation, operands, value in self.nodes:
            if operation == "input":
                values.append(inputs[operands[0] - 1][operands[1] - 1])
            elif operation == "constant":
                values.append(np.float64(value))
            else:
                x = [values[k] if k > 0 else -values[-k] for k in operands]
                values.append(_RUN[operation](*x))
        return [[values[k] if k > 0 else -values[-k] for k in row] for row in self.results]


def _pick(a: Array, b: Array, x: Array, y: Array) -> Array:
    return np.where(a > b, x, y)


_RUN: dict[str, Callable[..., Array]] = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "sin": np.sin,
    "cos": np.cos, "sqrt": np.sqrt, "sign": np.sign, "floor": np.floor, "atan2": np.arctan2,
    "pick": _pick, "nan": lambda: np.float64(np.nan),
}  # fmt: skip


def quotient(x: Number, y: Number) -> Number:
    """``x / y``."""
    if not isinstance(y, Scalar):
        return x * (1.0 / y)
    if not isinstance(x, Scalar):
        if x == 0.0:
            return 0.0
        x = y.tape.constant(x)
    sign = -1 if (x.number < 0) != (y.number < 0) else 1
    return Scalar(y.tape, sign * y.tape.add("div", (abs(x.number), abs(y.number))))


def function(name: str, *x: Number) -> Number:
    """A function of `FUNCTIONS` of constants or of values on a tape."""
    value, symmetry = FUNCTIONS[name]
    tape = next((y.tape for y in x if isinstance(y, Scalar)), None)
    if tape is None:
        return float(value(*x))
    numbers = tuple((y if isinstance(y, Scalar) else tape.constant(y)).number for y in x)
    if symmetry == 0:
        return Scalar(tape, tape.add(name, numbers))
    sign = symmetry if numbers[0] < 0 else 1
    return Scalar(tape, sign * tape.add(name, (abs(numbers[0]),)))


def pick(a: Number, b: Number, x: Number, y: Number) -> Number:
    """``x`` where ``a > b``, else ``y``."""
    if x is y or (isinstance(x, Scalar) and isinstance(y, Scalar) and x.number == y.number):
        return x
    if not isinstance(a, Scalar) and not isinstance(b, Scalar):
        return x if a > b else y
    if not isinstance(x, Scalar) and not isinstance(y, Scalar) and x == y:
        return x
    tape = a.tape if isinstance(a, Scalar) else b.tape  # type: ignore[union-attr]
    four = (z if isinstance(z, Scalar) else tape.constant(z) for z in (a, b, x, y))
    return Scalar(tape, tape.add("pick", tuple(z.number for z in four)))


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def plus(a: Vector, b: Vector) -> Vector:
    """Sum of vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def times(M: Sequence[Vector], a: Vector) -> Vector:
    """Matrix, given by its rows, times a vector."""
    return tuple(r[0] * a[0] + r[1] * a[1] + r[2] * a[2] for r in M)  # type: ignore[return-value]


def minus(a: Vector, b: Vector) -> Vector:
    """Difference of vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]
