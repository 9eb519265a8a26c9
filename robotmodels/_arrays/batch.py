"""The one rule for batches: leading axes broadcast, rows are contiguous."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..errors import ShapeError
from .border import Array


def batch_shape(arrays: tuple[Array, ...], names: tuple[str, ...]) -> tuple[int, ...]:
    """Broadcast the leading axes of vectors. Shapes: arrays (..., n_i)."""
    shapes = [a.shape[:-1] for a in arrays]
    try:
        return shapes[0] if len(set(shapes)) == 1 else np.broadcast_shapes(*shapes)
    except ValueError:
        got = ", ".join(f"{n} {a.shape}" for n, a in zip(names, arrays, strict=True))
        raise ShapeError(
            f"The leading (batch) axes do not broadcast against each other: {got}. "
            "Give each the same number of rows, or a single row."
        ) from None


def batch_rows(
    arrays: tuple[Array, ...], names: tuple[str, ...]
) -> tuple[tuple[int, ...], list[Array]]:
    """Broadcast the leading axes of vectors and lay each out as contiguous rows.

    Shapes: arrays (..., n_i) -> rows (N, n_i).
    """
    batch = batch_shape(arrays, names)
    rows = [
        np.ascontiguousarray(np.broadcast_to(a, (*batch, a.shape[-1]))).reshape(-1, a.shape[-1])
        if a.shape[-1]
        else np.empty((int(np.prod(batch)), 0))
        for a in arrays
    ]
    return batch, rows


def check_same_length(arrays: Mapping[str, Array], what: str) -> int:
    """Number of joints of arrays that have one number for each."""
    shape = next(iter(arrays.values())).shape
    if len(shape) != 1 or any(array.shape != shape for array in arrays.values()):
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ShapeError(f"{what} parameters are all of shape (n,), got {shapes}.")
    return shape[0]
