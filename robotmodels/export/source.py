"""A program: a model of a robot as straight-line code that needs nothing of this package."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, batch_shape
from ..errors import InvalidValueError
from .languages import LANGUAGES, Text, file_text, lines_of
from .tape import OperationCount, Operations, Port


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
        return tuple(lines_of(self._text, LANGUAGES["python"])[0])

    @property
    def _text(self) -> Text:
        """What is printed."""
        return Text(
            self.name, self.inputs, self.elements, self.outputs, self.notes, self.operations
        )

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
        return file_text(self._text, language)

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
