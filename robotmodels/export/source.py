"""A program: a model of a robot as straight-line code that needs nothing of this package."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, batch_shape
from ..errors import InvalidValueError
from .languages import LANGUAGES, body, language_of
from .tape import OperationCount, Operations, Port


@dataclass(frozen=True, slots=True)
class Program:
    """A model as straight-line code, made by `program`. Read-only, picklable, equal by value.

    Parameters
    ----------
    name : str
        Name of the function in generated code.
    model : str
        The model, such as ``"idm"``.
    inputs, outputs : tuple of (name, shape)
        In the order of the arguments and of the results.
    elements : tuple of tuple of str
        Names of the elements of each input; empty where they have only numbers.
    values : tuple of tuple of float
        For inputs with named elements their values in the model.
    notes : tuple of str
        What the header says: conventions, joints, identifiers that differ from the names given.
    operations : Operations
        The tape.

    Examples
    --------
    >>> from robotmodels.export import program
    >>> from robotmodels.robots import load
    >>> arm = program(load("planar_2r"), "gravity_torque", parameters="base", drive=False)
    >>> arm.inputs
    (Port(name='q', shape=(2,)), Port(name='parameters', shape=(4,)))
    >>> arm.count
    OperationCount(multiplications=5, additions=3, functions=4, divisions=0)
    """

    name: str
    model: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    elements: tuple[tuple[str, ...], ...]
    values: tuple[tuple[float, ...], ...]
    notes: tuple[str, ...]
    operations: Operations

    @property
    def count(self) -> OperationCount:
        """Numbers of operations in the way of the book: signs and comparisons are free."""
        return self.operations.count()

    @property
    def lines(self) -> tuple[str, ...]:
        """The assignments, one by one, in Python."""
        return tuple(body(self, LANGUAGES["python"]).lines)

    def __call__(self, *inputs: ArrayLike) -> Array | tuple[Array, ...]:
        """Run the tape, for checks.

        Parameters
        ----------
        *inputs : array_like
            In the order of `inputs`; leading axes are batch axes and broadcast.

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
        arrays = [as_core(x, p.shape, p.name) for x, p in zip(inputs, self.inputs, strict=True)]
        flat = [
            x.reshape((*x.shape[: x.ndim - len(p.shape)], p.size))
            for x, p in zip(arrays, self.inputs, strict=True)
        ]
        batch = batch_shape(tuple(flat), tuple(p.name for p in self.inputs))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
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
        return language_of(language).file(self)

    def __repr__(self) -> str:
        def ports(of: tuple[Port, ...]) -> str:
            return ", ".join(f"{p.name} {p.shape}" for p in of)

        counted = ", ".join(f"{n} {word}" for word, n in self.count._asdict().items())
        return f"<Program {self.name}: {ports(self.inputs)} -> {ports(self.outputs)}\n {counted}>"

    __str__ = __repr__


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
    except OSError as error:
        raise InvalidValueError(f"path: cannot write {str(path)!r}: {error.strerror}.") from None
