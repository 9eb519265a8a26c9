"""Equations of one or several logs in common unknowns: parameters of the robot and of its loads.

Source: W. Khalil, M. Gautier and P. Lemoine, "Identification of the payload inertial parameters of
industrial manipulators", IEEE ICRA 2007, (8)-(12).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .._arrays.tasks import Task, results
from ..errors import InvalidValueError
from ..estimation.estimate import NamedValues
from ..estimation.factor import TriangularFactors, merged_all, reduced
from ..logs import Log
from ..logs.log import check_is_log
from ..minimal_parameters import BaseParameters
from ..table_text import boxed
from .equations import Block, Equations, equations
from .forms import RowForm, torque_block
from .processing import checked_processing, choose_processing
from .reduction import parts
from .signals import Piece, Processing

UNIDENTIFIABLE = 1e-7
"""Rank tolerance: residual column norm relative to the largest."""
_DEPENDENT = 1e-10
"""Rank tolerance: singular value relative to the largest."""


def equations_of(
    base: BaseParameters, logs: Sequence[Log], processing: Processing | None
) -> tuple[Equations, ...]:
    """Equations of logs with common processing, by default chosen for the first log."""
    for log in logs:
        check_is_log(log)
    given = checked_processing(processing, logs[0])
    choices = given if isinstance(given, Processing) else choose_processing(logs[0], **given)
    if any(abs(log.dt - choices.dt) > 1e-9 * choices.dt for log in logs):
        slowest = max(log.dt for log in logs)
        raise InvalidValueError(
            "log: the logs have different sampling periods; read all with read_log(..., "
            f"dt={slowest:g})."
        )
    return tuple(equations(base, log, choices) for log in logs)


@dataclass(frozen=True, slots=True, eq=False)
class CommonEquations:
    """Equations of several logs: rows formed at the rate of the log, then mapped to p unknowns.

    Shapes: maps (columns of the rows, p), None for the identity.
    """

    systems: tuple[Equations, ...]
    names: tuple[str, ...]
    maps: tuple[Array | None, ...]
    form: RowForm | None = None

    def blocks(self) -> Iterator[Block]:
        """Equations of all logs in the common unknowns, piece by piece."""
        return map(self._block, self._pieces())

    def reduced(self, executor: Executor | None = None) -> TriangularFactors:
        """Triangular factors of all logs; a task has the samples of its piece alone."""

        def tasks() -> Iterator[Task]:
            for system, M in zip(self.systems, self.maps, strict=True):
                for part, piece in parts(system, executor is not None):
                    own = replace(self, systems=(part,), maps=(M,))
                    yield partial(own._factors, piece), 0.0

        return merged_all(factors for factors, _ in results(tasks(), executor))

    def columns(self, kept: NDArray[np.int64]) -> CommonEquations:
        """The same equations in some of the unknowns."""
        maps = tuple(None if M is None else M[:, kept] for M in self.maps)
        return replace(self, names=tuple(self.names[k] for k in kept), maps=maps)

    def _pieces(self) -> Iterator[tuple[int, Piece]]:
        return ((k, piece) for k, system in enumerate(self.systems) for piece in system.pieces())

    def _factors(self, piece: Piece) -> TriangularFactors:
        """Triangular factors of a piece of the first log."""
        return reduced(self.names, (self._block((0, piece)),))

    def _block(self, number: tuple[int, Piece]) -> Block:
        k, piece = number
        block, M = torque_block(self.systems[k], piece, self.form), self.maps[k]
        return block if M is None else replace(block, W=block.W @ M)


def column_lengths(R: Array) -> Array:
    """Lengths of columns, 1 for those that are zero."""
    lengths = np.linalg.norm(R, axis=0)
    return np.where(lengths > 0.0, lengths, 1.0)


def scaled_inverse(R: Array) -> Array:
    """Pseudo-inverse of a matrix, its rank decided for columns of unit length."""
    lengths = column_lengths(R)
    return np.linalg.pinv(R / lengths, rcond=_DEPENDENT) / lengths[:, None]


class NamedEstimate(NamedValues):
    """Base of results with names, values, covariance and status that print as a table."""

    __slots__ = ()

    def __str__(self) -> str:
        if not np.isfinite(self.values).all():
            return self.reason()
        numbers = (("value", self.values, ".4g"), ("standard error", self.standard_errors, ".2g"))
        columns = [(head, [format(x, digits) for x in row]) for head, row, digits in numbers]
        return f"{boxed([('parameter', list(self.names)), *columns])}\n{self.reason()}"

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self.names)} parameters, {self.status.name}>"
