"""Rows of the identification matrix that each group of configurations brings."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_floats
from ...errors import InvalidValueError, ShapeError
from ...kinematics.lengths import characteristic_length
from ..extended_table.parameters import GeometricParameters
from ..extended_table.skeleton import Frame
from ..measurements import Measurement, whitened
from ..measurements.kinds import Kind, groups_of, measurement_of
from ..problem import linearised, problem_of

LENGTH_NOISE = 1e-4
"""Standard deviation of a length where none is given, m."""
_CHUNK = 32


def group_rows(
    parameters: GeometricParameters,
    kind: Kind | str,
    q: Array,
    sigma: ArrayLike | None = None,
    frame: Frame = None,
) -> Array:
    """Whitened rows of each group with its own fixtures eliminated.

    Shapes: q (G, m, n), sigma (k,) -> (G, k', P).
    """
    parts = []
    none = np.zeros(len(parameters))
    for first in range(0, len(q), _CHUNK):
        part = q[first : first + _CHUNK]
        G = len(part)
        measurement = measurement_of(parameters, kind, groups_of(part), frame=frame)
        problem = problem_of(parameters, [measurement])
        fixtures = measurement.guess(_seen(problem, none)) if problem.F else np.zeros(0)
        if fixtures is None:
            raise InvalidValueError("kind: its fixtures cannot be guessed.")
        scale = _noise(measurement, sigma, parameters, frame)
        (found,) = linearised(problem, none, fixtures)
        A = whitened(measurement, found.by_parameters, scale).reshape(G, -1, len(parameters))
        if problem.F:
            F = whitened(measurement, found.by_fixtures, scale)
            F = F.reshape(G, A.shape[1], G, -1)[np.arange(G), :, np.arange(G)]
            Q = np.linalg.qr(F, mode="complete")[0]
            A = Q[:, :, F.shape[-1] :].swapaxes(-1, -2) @ A
        parts.append(A)
    return np.concatenate(parts)


def _seen(problem: Any, xi: Array) -> Any:
    from ..problem import evaluations

    return evaluations(problem, xi)[0]


def _noise(
    measurement: Measurement,
    sigma: ArrayLike | None,
    parameters: GeometricParameters,
    frame: Frame,
) -> Array:
    """Standard deviations of the rows of a block."""
    units = measurement.units
    if sigma is None:
        turn = LENGTH_NOISE / characteristic_length(parameters.model, frame)
        return np.array([LENGTH_NOISE if unit == "m" else turn for unit in units])
    values = as_floats(sigma, "sigma")
    if values.shape not in ((), (len(units),)):
        raise ShapeError(
            f"sigma: expected a number or one for each of {measurement.axes}, got shape "
            f"{values.shape}."
        )
    if not (values > 0.0).all():
        raise InvalidValueError(f"sigma: expected positive numbers, got {sigma!r:.80}.")
    return np.broadcast_to(values, (len(units),))
