"""Linear equations of an identification: blocks of regressor and torque, reduced to factors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sized
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from .._arrays import as_count
from .._arrays.tasks import Progress, Task, Workers, results
from ..drive import Drives
from ..errors import InvalidValueError
from ..estimation.factor import TriangularFactors, factors_of, merged, merged_all
from ..friction import Friction
from ..logs import Log
from ..minimal_parameters import BaseParameters, base_parameters
from ..model import RobotModel
from .forms import FORMS, Block, EquationForm, EquationSource
from .signals import Piece, Processing, pieces, slice_with_margin

_KEPT_BYTES = 2**26  # largest size of the block cache, bytes; other blocks are recomputed


@dataclass(slots=True)
class _Cache:
    """Blocks of the first pieces of some equations, in all columns of these."""

    whole: Equations
    blocks: dict[Piece, Block] = field(default_factory=dict)
    size: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Equations(EquationSource):
    """Equations of a log in b parameters of a robot, made piece by piece; `cached` keeps blocks.

    ``names`` are the base parameters that have columns, ``form`` is the balanced quantity.
    """

    form: EquationForm = EquationForm.TORQUE
    cache: Any = None

    @property
    def model(self) -> RobotModel:
        """The robot."""
        return self.base.model

    @property
    def groups(self) -> int:
        """Equations at one instant: the number of joints, or 1 for the whole robot."""
        return self.model.n if self.form.by_joint else 1

    def with_names(self, names: tuple[str, ...], base: BaseParameters | None = None) -> Equations:
        """The same equations in fewer parameters."""
        return replace(self, names=names, base=self.base if base is None else base)

    def with_log(self, log: Log) -> Equations:
        """Equations of another log with the same processing."""
        return replace(self, log=log, cache=None)

    def cached(self) -> Equations:
        """The same equations with a cache of blocks."""
        return replace(self, cache=_Cache(self.uncached()))

    def uncached(self) -> Equations:
        """The same equations without a cache."""
        return replace(self, cache=None)

    def pieces(self) -> list[Piece]:
        """Fixed pieces of the log."""
        return list(pieces(self.log, self.processing))

    def block(self, piece: Piece) -> Block:
        """Equations of a piece; read-only."""
        cache = self.cache
        if cache is None or cache.whole._rows != self._rows:
            return FORMS[self.form](self, piece)
        block = cache.blocks.get(piece)
        if block is None:
            block = FORMS[self.form](cache.whole, piece)
            size = sum(x.nbytes for x in (block.t, block.W, block.y, block.use, block.v))
            if cache.size + size <= _KEPT_BYTES:
                cache.size += size
                cache.blocks[piece] = block
        if self.names == cache.whole.names:
            return block
        columns = [cache.whole.names.index(name) for name in self.names]
        return replace(block, W=np.take(block.W, columns, axis=2))

    @property
    def _rows(self) -> tuple[Any, ...]:
        """All that the equations depend on: robot, drives and friction, not the regrouping."""
        base = self.base
        return base.model, base.friction, base.drive, self.log, self.processing, self.form

    def blocks(self) -> Iterator[Block]:
        """Equations of the whole log, piece by piece."""
        return map(self.block, self.pieces())

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.base, self.names, self.log, self.processing, self.form)


def equations(
    base: BaseParameters,
    log: Log,
    processing: Processing,
    form: EquationForm = EquationForm.TORQUE,
) -> Equations:
    """Equations of a log for a robot (book section 1.6.2).

    Parameters
    ----------
    base, log, processing, form
        Base parameters of the robot; a log with its joints; such as from `choose_processing`;
        quantity that is balanced.

    Returns
    -------
    Equations
        In all base parameters.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import choose_processing
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> arm, log = example_log()
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> block = next(equations(base, log, choose_processing(log)).blocks())
    >>> block.W.shape[1:], block.y.shape[1:] == (2,)
    ((2, 8), True)
    """
    if log.n != base.model.n:
        raise InvalidValueError(
            f"log: it has {log.n} joints and {base.model.name!r} has {base.model.n}; give read_log "
            "the columns of the robot's joints, in its order."
        )
    return Equations(base, base.names, log, processing, form)


def parameters_of(
    model: RobotModel, base: BaseParameters | None, drive: Drives, friction: Friction | None = None
) -> BaseParameters:
    """The given base parameters of the robot, or those with drives and friction."""
    if base is None:
        return base_parameters(model, drive=drive, friction=friction)
    if not isinstance(base, BaseParameters):
        raise InvalidValueError(
            f"base: expected base_parameters(model), got {type(base).__name__}."
        )
    base.check(model)
    return base


def reduce_equations(
    system: Equations | Iterable[Equations],
    executor: Executor | None = None,
    progress: Progress = None,
    window: int | None = None,
) -> TriangularFactors:
    """Reduce equations to one triangular factor for each group (joint).

    Pieces are fixed and merged in a fixed tree: the result does not depend on the workers.

    Parameters
    ----------
    system : Equations or iterable of Equations
        One log, or several of the same robot and parameters; an iterator may open one file at a
        time.
    executor, progress
        As for `fit`; also a cluster (``client.get_executor()`` of Dask). A task contains the
        samples of its piece and the margin of the filters, not the whole log.

    window : int, optional
        Largest number of pieces in work at a time, default twice the processors and 2.

    Returns
    -------
    TriangularFactors
        Its size depends on the number of parameters alone.

    References
    ----------
    J. Demmel, L. Grigori, M. Hoemmen and J. Langou, SIAM J. Scientific Computing 34(1), 2012.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import choose_processing, equations
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> arm, log = example_log()
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> len(reduce_equations(equations(base, log, choose_processing(log))).names)
    8
    """
    systems = (system,) if isinstance(system, Equations) else system
    window = None if window is None else as_count(window, "window")
    work = Workers(executor, progress)

    def leaves() -> Iterator[TriangularFactors]:
        fraction = 0.0
        for factors, fraction in results(_tasks(systems, executor is not None), executor, window):
            yield factors
            if fraction > 0.0:
                work.done(fraction)
        if fraction < 1.0:
            work.done()

    return merged_all(leaves())


def parts(system: Equations, sent: bool) -> Iterator[tuple[Equations, Piece]]:
    """Pieces and their equations; what is sent to a worker has the samples of its piece alone."""
    for piece in system.pieces():
        if sent:
            log, inner = slice_with_margin(system.log, system.processing, piece)
            yield system.with_log(log), inner
        else:
            yield system, piece


def _tasks(systems: Iterable[Equations], sent: bool) -> Iterator[Task[TriangularFactors]]:
    """One task per piece."""
    logs = len(systems) if isinstance(systems, Sized) else 0
    for k, system in enumerate(systems):
        count = len(system.pieces())
        for i, (part, piece) in enumerate(parts(system, sent)):
            fraction = (k + (i + 1) / count) / logs if logs else 0.0
            yield partial(_piece_factors, part, piece), fraction


def _piece_factors(system: Equations, piece: Piece) -> TriangularFactors:
    block = system.block(piece)
    return factors_of(system.names, block.W, block.y, block.use)


def segments(system: Equations, count: int) -> tuple[TriangularFactors, ...]:
    """Factors of contiguous segments of a log, as folds: neighbouring equations are correlated."""
    total = sum(len(block) for block in system.blocks())
    if not 2 <= count <= total:
        raise InvalidValueError(f"count: expected from 2 to {total} parts, got {count!r:.40}.")
    ends, first = np.linspace(0, total, count + 1).astype(int)[1:], 0
    parts: dict[int, TriangularFactors] = {}
    for block in system.blocks():
        place = np.searchsorted(ends, first + np.arange(len(block)), side="right")
        for k in np.unique(place).tolist():
            rows = place == k
            new = factors_of(system.names, block.W[rows], block.y[rows], block.use[rows])
            parts[k] = merged(parts[k], new) if k in parts else new
        first += len(block)
    return tuple(parts.values())
