"""Equations reduced to triangular factors: memory that does not grow with the log."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sized
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, read_only
from ...errors import InvalidValueError
from ...estimation.merging import merged_tree
from ..equations import Block, Equations
from .piece_tasks import piece_reductions


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
        R : ndarray, shape (b, b)
            Triangular.
        y : ndarray, shape (b,)
            Its right side.
        rest : float
            Sum of squares that no parameters explain: ``|R x - y|^2 + rest`` is the whole.
        """
        from ...kernels.triangles import fold_rows

        b = len(self.names)
        whole = np.zeros((b + 1, b + 1))
        for k, R in enumerate(self.factors):
            fold_rows(np.ascontiguousarray(R if weights is None else weights[k] * R), whole)
        return whole[:b, :b], whole[:b, b], float(whole[b, b] ** 2)


def reduce_equations(
    system: Equations | Iterable[Equations],
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
    window: int | None = None,
) -> Reduction:
    """Reduce equations to one triangular factor for each kind of rows.

    Pieces of the logs are fixed, their factors are merged in a fixed tree, and the order of every
    sum is fixed, so that the result has the same bits for any number of workers and threads (of
    processors of one make).

    Parameters
    ----------
    system : Equations or iterable of Equations
        One log, or several of the same robot and parameters; an iterator may open one file at a
        time, which is let go when its pieces are done.
    executor : concurrent.futures.Executor, optional
        Who computes the pieces: threads, processes, or a cluster that offers this interface (such
        as ``client.get_executor()`` of Dask); default this thread. A task is given the rows of its
        piece and of the filters' reach beside it, not the log. After an error no piece that waits
        is begun, and the executor can be used on.
    progress : callable, optional
        Called with the fraction done, which never falls. Of an iterator whose length is not known
        only its end is told.
    window : int, optional
        Pieces that are at work or wait at a time, default twice the processors and 2: memory does
        not grow with the log. Give more for a cluster of more workers.

    Returns
    -------
    Reduction
        Its size is the square of the number of parameters, whatever the length of the log.

    Raises
    ------
    InvalidValueError
        No equations; logs of different parameters or kinds of equations; a window below 1.

    References
    ----------
    Seed book section 1.6.2.1; J. Demmel, L. Grigori, M. Hoemmen and J. Langou,
    "Communication-optimal parallel and sequential QR and LU factorizations", SIAM J. Scientific
    Computing 34(1), 2012.

    Examples
    --------
    >>> from robotmodels.identification import Log, choose_processing, equations
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> system = equations(base, log, choose_processing(log))
    >>> found = reduce_equations(system)
    >>> len(found.names), found.rows > 100
    (8, True)
    """
    systems = (system,) if isinstance(system, Equations) else system
    logs = len(systems) if isinstance(systems, Sized) else None
    leaves = piece_reductions(systems, executor, progress, window, logs)
    found = merged_tree(leaves, merge)
    if found is None:
        raise InvalidValueError("system: expected the equations of at least one log, got none.")
    return found


def block_reduction(names: tuple[str, ...], block: Block) -> Reduction:
    """Factors of one block."""
    from ...kernels.triangles import fold_equations

    W, y = np.ascontiguousarray(block.W), np.ascontiguousarray(block.y)
    seen = np.any(W, axis=0, keepdims=True)[0]
    factors = []
    for j, used in enumerate(block.use.T):
        columns, rows = np.flatnonzero(seen[j]), np.flatnonzero(used)
        R = np.zeros((len(columns) + 1, len(columns) + 1))
        fold_equations(W, y, j, rows, columns, R)
        factors.append(_widened(R, np.append(columns, len(names)), len(names) + 1))
    counts = block.use.sum(axis=0)
    return Reduction(names, tuple(factors), counts, len(block) - counts)


def merge(first: Reduction, second: Reduction) -> Reduction:
    """Merge two reductions."""
    if first.names != second.names or len(first.factors) != len(second.factors):
        raise InvalidValueError(
            f"system: expected logs of the same parameters and kinds of equations, got "
            f"{len(first.names)} parameters of {len(first.factors)} kinds and {len(second.names)} "
            f"of {len(second.factors)}; make all with the same base parameters and form."
        )
    return Reduction(
        first.names,
        tuple(_merged(a, b) for a, b in zip(first.factors, second.factors, strict=True)),
        first.counts + second.counts,
        first.left_out + second.left_out,
    )


def _merged(first: Array, second: Array) -> Array:
    """A factor R of both, in the columns that are not zero: ``R^T R = A^T A + B^T B``."""
    from ...kernels.triangles import fold_rows

    columns = np.flatnonzero(first.any(axis=0) | second.any(axis=0))
    R = np.zeros((len(columns), len(columns)))
    for rows in (first, second):
        fold_rows(np.ascontiguousarray(rows[:, columns]), R)
    return _widened(R, columns, first.shape[1])


def _widened(R: Array, columns: NDArray[np.int64], width: int) -> Array:
    """Columns at their places among others that are zero."""
    whole = np.zeros((len(R), width))
    whole[:, columns] = R
    return whole
