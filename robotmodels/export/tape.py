"""A tape of scalar operations, written by ordinary arithmetic on arrays of numbers and scalars.

Equal operations share one line (value numbering), operations on constants are done at once, zeros
and ones disappear, signs are carried along (``-x`` costs nothing), and lines that no result needs
are dropped when the tape is frozen. Constants are plain floats.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import prod
from typing import Any, NamedTuple, Union

import numpy as np

Node = tuple[str, tuple[int, ...], float]
"""An operation, its operands (node numbers from 1, negative for the opposite), a constant."""
Number = Union[float, "Scalar"]

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

    Sums and differences are additions; sines, cosines, square roots and others are functions.

    Examples
    --------
    >>> OperationCount(3, 2, 1, 0).multiplications
    3
    """

    multiplications: int
    additions: int
    functions: int
    divisions: int


class Operations(NamedTuple):
    """A frozen tape: its nodes, and the signed numbers of the elements of each result."""

    nodes: tuple[Node, ...]
    results: tuple[tuple[int, ...], ...]

    def count(self) -> OperationCount:
        """Numbers of operations."""
        n = [node[0] for node in self.nodes].count
        return OperationCount(n("mul"), n("add") + n("sub"), sum(map(n, _FUNCTIONS)), n("div"))


class Port(NamedTuple):
    """An input or output of a program: its name and shape."""

    name: str
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of elements."""
        return prod(self.shape)


class Scalar:
    """A value on a tape that is not a constant; arrays of them stand on the left of an operator."""

    __slots__ = ("number", "tape")

    def __init__(self, tape: Tape, number: int) -> None:
        self.tape, self.number = tape, number

    def __neg__(self) -> Scalar:
        return Scalar(self.tape, -self.number)

    def __add__(self, other: Number) -> Number:
        if not isinstance(other, Scalar) and other == 0.0:
            return self
        low, high = sorted((self.number, self.tape.number(other)), key=abs)
        if low == -high:
            return 0.0
        # one sign for both terms, or the difference of an ordered pair
        operation = "add" if (low < 0) == (high < 0) else "sub"
        return self.tape.scalar(operation, abs(low), abs(high), is_negative=low < 0)

    def __mul__(self, other: Number) -> Number:
        if not isinstance(other, Scalar):
            if other in (0.0, 1.0, -1.0):
                return 0.0 if other == 0.0 else (self if other > 0.0 else -self)
            operation, operands, _ = self.tape.nodes[abs(self.number) - 1]
            for k, x in zip(operands, operands[::-1], strict=True) if operation == "mul" else ():
                if self.tape.nodes[k - 1][0] == "constant":  # a constant times a constant times x
                    factor = self.tape.nodes[k - 1][2]
                    return Scalar(self.tape, x) * (factor * (other if self.number > 0 else -other))
        a, b = sorted((self.number, self.tape.number(other)), key=abs)
        return self.tape.scalar("mul", abs(a), abs(b), is_negative=(a < 0) != (b < 0))

    def __truediv__(self, other: Number) -> Number:
        if not isinstance(other, Scalar):
            return self * (1.0 / other)
        a, b = self.number, other.number
        return self.tape.scalar("div", abs(a), abs(b), is_negative=(a < 0) != (b < 0))

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

    def scalar(self, operation: str, *operands: int, is_negative: bool = False) -> Scalar:
        """The result of an operation, or its opposite."""
        node = self.add(operation, operands)
        return Scalar(self, -node if is_negative else node)

    def number(self, x: Number) -> int:
        """Signed number of an operand."""
        if isinstance(x, Scalar):
            return x.number
        node = self.add("constant", value=abs(float(x)))
        return node if x >= 0.0 else -node

    def frozen(self, results: Iterable[Iterable[Number]]) -> Operations:
        """The operations that the results need, renumbered, and the results."""
        wanted = [[self.number(x) for x in row] for row in results]
        needed = {abs(k) for row in wanted for k in row}
        for number in range(len(self.nodes), 0, -1):
            operation, operands, _ = self.nodes[number - 1]
            if number in needed and operation != "input":
                needed.update(map(abs, operands))
        place: dict[int, int] = {}
        for new, old in enumerate(sorted(needed), start=1):
            place[old], place[-old] = new, -new
        kept = (self.nodes[k - 1] for k in sorted(needed))
        nodes = ((o, x if o == "input" else tuple(place[k] for k in x), c) for o, x, c in kept)
        return Operations(tuple(nodes), tuple(tuple(place[k] for k in row) for row in wanted))


def function(name: str, *x: Number) -> Number:
    """A function of constants or of values on a tape; sines and signs are odd, cosines even."""
    tape = next((y.tape for y in x if isinstance(y, Scalar)), None)
    if tape is None:
        return float(RUN[name](*x))
    numbers = tuple(map(tape.number, x))
    if name not in ("sin", "cos", "sign"):
        return tape.scalar(name, *numbers)
    return tape.scalar(name, abs(numbers[0]), is_negative=numbers[0] < 0 and name != "cos")


def pick(a: Number, b: Number, x: Number, y: Number) -> Number:
    """``x`` where ``a > b``, else ``y``."""
    tape = next((z.tape for z in (a, b) if isinstance(z, Scalar)), None)
    if tape is None:
        return x if a > b else y  # type: ignore[operator]
    four = tuple(map(tape.number, (a, b, x, y)))
    return x if four[2] == four[3] else tape.scalar("pick", *four)
