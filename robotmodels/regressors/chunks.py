"""Long logs in pieces of bounded size."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError


def check_size(size: int) -> None:
    """Refuse pieces of no sample."""
    if size < 1:
        raise InvalidValueError(f"size: expected at least one sample in a piece, got {size}.")


def pieces(N: int, size: int) -> Iterator[slice]:
    """Slices of ``size`` that cover ``N``, the last one shorter."""
    for start in range(0, N, size):
        yield slice(start, min(start + size, N))


def stream(
    fill: Callable[[Sequence[Array], Array], None],
    rows: Sequence[Array],
    size: int,
    core: tuple[int, ...],
) -> Iterator[tuple[slice, Array]]:
    """Fill one buffer for piece after piece of the samples."""
    N = rows[0].shape[0]
    W = np.empty((min(size, max(N, 1)), *core))
    for piece in pieces(N, W.shape[0]):
        part = W[: piece.stop - piece.start]
        fill([array[piece] for array in rows], part)
        yield piece, part
