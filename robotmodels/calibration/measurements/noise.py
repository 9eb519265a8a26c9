"""Standard deviations and covariances of the rows of a measurement."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_core, as_floats, read_only
from ...errors import InvalidValueError, ShapeError
from .measurement import Measurement


def as_noise(
    sigma: ArrayLike | None, covariance: ArrayLike | None, blocks: int, k: int
) -> tuple[Array | None, Array | None]:
    """Check standard deviations or covariances of a measurement.

    Shapes: covariance (k, k) or (B, k, k).
    """
    if sigma is not None and covariance is not None:
        raise InvalidValueError("Give sigma or covariance, not both.")
    if sigma is not None:
        values = as_floats(sigma, "sigma")
        if values.shape not in ((), (k,), (blocks, k)):
            raise ShapeError(
                f"sigma: expected a number, shape ({k},) or ({blocks}, {k}), got {values.shape}."
            )
        if not (values > 0.0).all():
            raise InvalidValueError(f"sigma: expected positive numbers, got {sigma!r:.80}.")
        return read_only(np.broadcast_to(values, (blocks, k))), None
    if covariance is not None:
        values = as_core(covariance, (k, k), "covariance")
        if values.shape not in ((k, k), (blocks, k, k)):
            raise ShapeError(
                f"covariance: expected shape ({k}, {k}) or ({blocks}, {k}, {k}), got "
                f"{values.shape}."
            )
        if not np.allclose(values, values.swapaxes(-1, -2), rtol=1e-9, atol=0.0) or (
            np.linalg.eigvalsh(values).min() <= 0.0
        ):
            raise InvalidValueError(
                "covariance: expected symmetric positive definite matrices; give a row that is "
                "not measured by leaving it out, not by a zero variance."
            )
        return None, read_only(np.broadcast_to(values, (blocks, k, k)))
    return None, None


def part_of_noise(
    measurement: Measurement, blocks: NDArray[np.int64]
) -> tuple[Array | None, Array | None]:
    """Sigma and covariance of some of the blocks."""
    sigma, covariance = measurement.sigma, measurement.covariance
    return (
        None if sigma is None else sigma[blocks],
        None if covariance is None else covariance[blocks],
    )


def whitened(measurement: Measurement, rows: Array, scale: Array) -> Array:
    """Rows whitened by their standard deviations or covariances.

    Shapes: rows (B, k) or (B, k, m), scale (k,).
    """
    extra = (...,) + (None,) * (rows.ndim - 2)
    if measurement.covariance is not None:
        factor = np.linalg.cholesky(measurement.covariance)
        columns = rows if rows.ndim == 3 else rows[..., None]
        return np.linalg.solve(factor, columns).astype(np.float64).reshape(rows.shape)
    sigma = scale if measurement.sigma is None else measurement.sigma
    return rows / sigma[extra]
