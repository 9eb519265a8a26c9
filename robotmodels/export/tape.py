"""A tape of scalar operations, written by ordinary arithmetic.

Equal operations share one line (value numbering), operations on constants are done at once, zeros
and ones disappear, signs are carried along (``-x`` costs nothing), and lines that no result needs
are dropped when the tape is frozen. Constants are plain floats.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import prod
from typing import Any, NamedTuple, Union

import numpy as np

from .._arrays import Array

Node = tuple[str, tuple[int, ...], float]
"""An operation, its operands (node numbers from 1, negative for the opposite), a constant."""
Number = Union[float, "Scalar"]
Vector = tuple[Number, ...]

RUN: dict[str, Callable[..., Any]] = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide,
    "sin": np.sin, "cos": np.cos, "exp": np.exp, "log": np.log,
    "sqrt": np.sqrt, "sign": np.sign, "floor": np.floor,
    "atan2": np.arctan2, "pick": lambda a, b, x, y: np.where(a > b, x, y),
    "nan": lambda: np.float64(np.nan),
}  # fmt: skip
_FUNCTIONS = ("sin", "cos", "exp", "log", "sqrt", "sign", "floor", "atan2")


class OperationCount(NamedTuple):
    """Operations of a program; signs and comparisons are not counted.

    Parameters
    ----------
    multiplications, additions, functions, divisions : int
        Products; sums and differences; sines, cosines, square roots and others; quotients.

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
        return prod(self.shape)


class Scalar:
    """A value on a tape that is not a constant."""

    __array_ufunc__ = None  # NumPy's numbers leave the arithmetic to this class
    __slots__ = ("number", "tape")

    def __init__(self, tape: Tape, number: int) -> None:
        self.tape, self.number = tape, number

    def __neg__(self) -> Scalar:
        return Scalar(self.tape, -self.number)

    def __add__(self, other: Number) -> Number:
        if not isinstance(other, Scalar) and other == 0.0:
            return self
        a, b = self.number, self.tape.number(other)
        if a == -b:
            return 0.0
        # one sign for both terms, or the difference of an ordered pair
        operation, first = ("add", a) if (a < 0) == (b < 0) else ("sub", min(a, b, key=abs))
        low, high = sorted((abs(a), abs(b)))
        return Scalar(self.tape, (1 if first > 0 else -1) * self.tape.add(operation, (low, high)))

    def __mul__(self, other: Number) -> Number:
        if not isinstance(other, Scalar) and other in (0.0, 1.0, -1.0):
            return 0.0 if other == 0.0 else (self if other > 0.0 else -self)
        if not isinstance(other, Scalar):  # a constant times a constant times x
            operation, operands, _ = self.tape.nodes[abs(self.number) - 1]
            for k, x in zip(operands, operands[::-1], strict=True) if operation == "mul" else ():
                factor = self.tape.nodes[k - 1]
                if factor[0] == "constant":
                    return Scalar(self.tape, x) * (
                        (other if self.number > 0 else -other) * factor[2]
                    )
        a, b = self.number, self.tape.number(other)
        node = self.tape.add("mul", tuple(sorted((abs(a), abs(b)))))
        return Scalar(self.tape, node if (a < 0) == (b < 0) else -node)

    def __truediv__(self, other: Number) -> Number:
        if not isinstance(other, Scalar):
            return self * (1.0 / other)
        a, b = self.number, other.number
        node = self.tape.add("div", (abs(a), abs(b)))
        return Scalar(self.tape, node if (a < 0) == (b < 0) else -node)

    def __rtruediv__(self, other: float) -> Number:
        return other if other == 0.0 else Scalar(self.tape, self.tape.number(other)) / self

    def __sub__(self, other: Number) -> Number:
        return self + -other

    def __rsub__(self, other: float) -> Number:
        return -self + other

    __radd__, __rmul__ = __add__, __mul__


class Tape:
    """Operations in the order of their first use."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._numbers: dict[Node, int] = {}

    def add(self, operation: str, operands: tuple[int, ...] = (), value: float = 0.0) -> int:
        """Number of a node, a new one if there is none like it."""
        node = operation, operands, value
        if node not in self._numbers:
            self.nodes.append(node)
            self._numbers[node] = len(self.nodes)
        return self._numbers[node]

    def number(self, x: Number) -> int:
        """Signed number of an operand."""
        if isinstance(x, Scalar):
            return x.number
        node = self.add("constant", value=abs(float(x)))
        return node if x >= 0.0 else -node

    def inputs(self, port: int, size: int) -> list[Number]:
        """The elements of an input."""
        return [Scalar(self, self.add("input", (port, k))) for k in range(size)]

    def frozen(self, results: Iterable[Iterable[Number]]) -> Operations:
        """Only what the results need, renumbered."""
        wanted = [[self.number(x) for x in row] for row in results]
        needed = [False] * (len(self.nodes) + 1)
        for number in (k for row in wanted for k in row):
            needed[abs(number)] = True
        for number in range(len(self.nodes), 0, -1):
            operation, operands, _ = self.nodes[number - 1]
            for k in operands if needed[number] and operation != "input" else ():
                needed[abs(k)] = True
        place = np.cumsum(needed).tolist()

        def moved(numbers: Sequence[int]) -> tuple[int, ...]:
            return tuple(place[k] if k > 0 else -place[-k] for k in numbers)

        kept = [node for node, need in zip(self.nodes, needed[1:], strict=True) if need]
        nodes = ((o, k if o == "input" else moved(k), value) for o, k, value in kept)
        return Operations(tuple(nodes), tuple(map(moved, wanted)))


class Operations(NamedTuple):
    """A frozen tape: its nodes, and the signed numbers of the elements of each result."""

    nodes: tuple[Node, ...]
    results: tuple[tuple[int, ...], ...]

    def count(self) -> OperationCount:
        """Numbers of operations."""
        n = [node[0] for node in self.nodes].count
        return OperationCount(n("mul"), n("add") + n("sub"), sum(map(n, _FUNCTIONS)), n("div"))

    def run(self, inputs: Sequence[Array]) -> list[list[Array]]:
        """Elements of the results for the elements of the inputs, arrays (k, ...) each."""
        values: list[Any] = [np.zeros(())]
        for operation, operands, value in self.nodes:
            if operation == "input":
                values.append(inputs[operands[0]][operands[1]])
            elif operation == "constant":
                values.append(np.float64(value))
            else:
                x = (values[k] if k > 0 else -values[-k] for k in operands)
                values.append(RUN[operation](*x))
        return [[values[k] if k > 0 else -values[-k] for k in row] for row in self.results]


def function(name: str, *x: Number) -> Number:
    """A function of constants or of values on a tape; sines and signs are odd, cosines even."""
    tape = next((y.tape for y in x if isinstance(y, Scalar)), None)
    if tape is None:
        return float(RUN[name](*x))
    numbers = tuple(map(tape.number, x))
    if name not in ("sin", "cos", "sign"):
        return Scalar(tape, tape.add(name, numbers))
    node = tape.add(name, (abs(numbers[0]),))
    return Scalar(tape, -node if numbers[0] < 0 and name != "cos" else node)


def pick(a: Number, b: Number, x: Number, y: Number) -> Number:
    """``x`` where ``a > b``, else ``y``."""
    tape = next((z.tape for z in (a, b) if isinstance(z, Scalar)), None)
    if tape is None:
        return x if a > b else y  # type: ignore[operator]
    four = tuple(map(tape.number, (a, b, x, y)))
    return x if four[2] == four[3] else Scalar(tape, tape.add("pick", four))


def cross(x: Vector, y: Vector) -> Vector:
    """Vector product."""
    return tuple(x[i] * y[j] - x[j] * y[i] for i, j in ((1, 2), (2, 0), (0, 1)))


def plus(a: Vector, b: Vector) -> Vector:
    """Sum of vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def times(M: Sequence[Vector], a: Vector) -> Vector:
    """Matrix, given by its rows, times a vector."""
    return tuple(r[0] * a[0] + r[1] * a[1] + r[2] * a[2] for r in M)
