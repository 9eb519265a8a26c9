"""Residuals of a calibration row by row, before and after, for figures and further tests."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .folds import suited_fixtures
from .measurements import Measurement
from .problem import evaluations, linearised

if TYPE_CHECKING:
    from .result import CalibrationResult


class MeasuredResiduals(NamedTuple):
    """Residuals of one measurement.

    Shapes: before, after, whitened (B, k); p (B, 3); blocks, outlier (B,).
    """

    measurement: Measurement
    before: Array
    after: Array
    whitened: Array
    p: Array
    blocks: NDArray[np.int64]
    outlier: NDArray[np.bool_]


def measured_residuals(result: CalibrationResult) -> tuple[MeasuredResiduals, ...]:
    """Residuals of every measurement of a calibration.

    Parameters
    ----------
    result : CalibrationResult
        Of `fit`.

    Returns
    -------
    tuple of MeasuredResiduals
        In the order of the measurements.

    References
    ----------
    Seed book section 1.4.4.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> arm = rm.load("rx90")
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> result = calibration.fit(arm, calibration.Pose(q, rm.dgm(arm, q)), folds=0, held_out=0.0)
    >>> measured_residuals(result)[0].after.shape
    (40, 6)
    """
    solution = result.solution
    problem, fit = solution.problem, solution.fit
    nothing = np.zeros(problem.P)
    before = linearised(problem, nothing, suited_fixtures(problem, nothing, {}))
    after = linearised(problem, solution.deviation, solution.fixtures)
    seen = evaluations(problem, solution.deviation)
    found, row, block = [], 0, 0
    for m, old, new, views in zip(problem.measurements, before, after, seen, strict=True):
        count = m.blocks * len(m.axes)
        numbers = np.arange(block, block + m.blocks)
        found.append(
            MeasuredResiduals(
                m, old.residual, new.residual,
                fit.whitened[row : row + count].reshape(m.blocks, -1),
                views[0].T[:, :3, 3] if views else np.full((m.blocks, 3), np.nan),
                numbers, np.isin(numbers, fit.outliers),
            )
        )  # fmt: skip
        row, block = row + count, block + m.blocks
    return tuple(found)
