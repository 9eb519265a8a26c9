"""Equations reduced to triangular factors: memory that does not grow with the log."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt, read_only
from ..estimation.merging import merged_factor, merged_tree
from .equations import Block, Equations


@dataclass(frozen=True, slots=True, eq=False)
class Reduction(Rebuilt):
    """All that least squares need of the equations. Read-only.

    Parameters
    ----------
    names : tuple of str
        The b parameters.
    factors : tuple of ndarray, shapes (r, b + 1)
        Of each kind of equations (joint), R with ``R^T R = [W y]^T [W y]``.
    counts : ndarray of int, shape (m,)
        Equations of each kind that took part.
    left_out : ndarray of int, shape (m,)
        Equations in a dead band.
    """

    names: tuple[str, ...]
    factors: tuple[Array, ...]
    counts: NDArray[np.int64]
    left_out: NDArray[np.int64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "factors", tuple(read_only(R) for R in self.factors))
        for name in ("counts", "left_out"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.int64))

    @property
    def rows(self) -> int:
        """Number of equations that took part."""
        return int(self.counts.sum())

    def sums(self, values: Array) -> Array:
        """Sum of the squared residuals of each kind.

        Parameters
        ----------
        values : ndarray, shape (b,)
            Parameters.

        Returns
        -------
        ndarray, shape (m,)
            (N m)^2 or N^2.
        """
        e = [R[:, -1] - R[:, :-1] @ values for R in self.factors]
        return np.array([float(x @ x) for x in e])

    def stacked(self, weights: Array | None = None) -> tuple[Array, Array, float]:
        """One triangular system of all kinds.

        Parameters
        ----------
        weights : ndarray, shape (m,), optional
            What each kind's equations are multiplied by; default 1.

        Returns
        -------
        R : ndarray, shape (r, b)
            Triangular, r at most b.
        y : ndarray, shape (r,)
            Its right side.
        rest : float
            Sum of squares that no parameters explain: ``|R x - y|^2 + rest`` is the whole.
        """
        w = np.ones(len(self.factors)) if weights is None else weights
        whole = merged_tree((w[k] * R for k, R in enumerate(self.factors)), merged_factor)
        b = len(self.names)
        if whole is None:
            return np.zeros((0, b)), np.zeros(0), 0.0
        if len(whole):
            whole = np.asarray(np.linalg.qr(whole, mode="r"))
        top = whole[:b]
        return top[:, :b], top[:, b], float((whole[b:, b] ** 2).sum())


def reduce_equations(
    system: Equations | Iterable[Equations],
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
) -> Reduction:
    """Reduce equations to one triangular factor for each kind of rows.

    Pieces of the log are fixed and their factors merged in a fixed tree, so that the result has the
    same bits for any number of workers.

    Parameters
    ----------
    system : Equations or iterable of Equations
        One log, or several of the same robot and parameters; an iterator may read them as it goes.
    executor : concurrent.futures.Executor, optional
        Who computes the pieces: threads, processes, or a cluster that offers this interface;
        default this thread.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    Reduction
        Its size is the square of the number of parameters, whatever the length of the log.

    References
    ----------
    Seed book section 1.6.2.1; J. Demmel, L. Grigori, M. Hoemmen and J. Langou,
    "Communication-optimal parallel and sequential QR and LU factorizations", SIAM J. Scientific
    Computing 34(1), 2012.
    """
    systems = [system] if isinstance(system, Equations) else system
    leaves = _leaves(systems, progress) if executor is None else _submitted(systems, executor)
    found = merged_tree(leaves, merge)
    if found is None:
        raise ValueError("system: no equations.")
    return found


def _leaves(
    systems: Iterable[Equations], progress: Callable[[float], None] | None
) -> Iterator[Reduction]:
    for system in systems:
        parts = system.pieces()
        for k, piece in enumerate(parts):
            yield block_reduction(system.names, system.block(piece))
            if progress is not None:
                progress((k + 1) / len(parts))


def _submitted(systems: Iterable[Equations], executor: Executor) -> Iterator[Reduction]:
    for system in systems:
        yield from executor.map(_piece, *zip(*((system, p) for p in system.pieces()), strict=True))


def _piece(system: Equations, piece: object) -> Reduction:
    return block_reduction(system.names, system.block(piece))  # type: ignore[arg-type]


def block_reduction(names: tuple[str, ...], block: Block) -> Reduction:
    """Factors of one block.

    Parameters
    ----------
    names : tuple of str
        Its parameters.
    block : Block
        Equations.

    Returns
    -------
    Reduction
        Of this block alone.
    """
    factors = []
    for j in range(block.y.shape[1]):
        use = block.use[:, j]
        rows = np.column_stack((block.W[use, j], block.y[use, j]))
        factors.append(merged_factor(np.zeros((0, rows.shape[1])), rows))
    counts = block.use.sum(axis=0)
    return Reduction(names, tuple(factors), counts, len(block) - counts)


def merge(first: Reduction, second: Reduction) -> Reduction:
    """The reduction of both.

    Parameters
    ----------
    first, second : Reduction
        Of the same parameters and kinds.

    Returns
    -------
    Reduction
        Of all their equations.
    """
    return Reduction(
        first.names,
        tuple(merged_factor(a, b) for a, b in zip(first.factors, second.factors, strict=True)),
        first.counts + second.counts,
        first.left_out + second.left_out,
    )
