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


def check_log(samples: int, name: str = "q, v", least: int = 1) -> None:
    """Refuse a log with too few samples; batches of single calls may be empty, logs are not."""
    if samples < 1:
        raise InvalidValueError(f"{name}: the log is empty; expected at least {_counted(least)}.")
    if samples < least:
        raise InvalidValueError(
            f"{name}: the log has {samples} sample; expected at least {least}, since the rows are "
            "what happens between samples."
        )


def _counted(samples: int) -> str:
    return "one sample" if samples == 1 else f"{samples} samples"


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
    W = np.empty((min(size, N), *core))
    for piece in pieces(N, W.shape[0]):
        part = W[: piece.stop - piece.start]
        fill([array[piece] for array in rows], part)
        yield piece, part
