"""The generalised differential model: derivatives of the measured poses by every parameter."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_vector
from .extended_table import ExtendedTable, Frame
from .parameters import GeometricParameters

Actions = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]


class DifferentialModel(NamedTuple):
    """Poses T (..., 4, 4) of an end, and psi (..., 6, P), its [v; w] per unit of each parameter.

    World axes, at the end's origin; m and rad, per m, rad or the unit of the parameter.
    """

    T: Array
    psi: Array


def differential_model(
    parameters: GeometricParameters,
    q: ArrayLike,
    corrections: ArrayLike | None = None,
    frame: Frame = None,
    factors: Array | None = None,
) -> DifferentialModel:
    """Generalised differential model ``dX = Psi(q, xi) d xi`` (identification Jacobian).

    Parameters
    ----------
    parameters, q, corrections, frame
        See `robotmodels.calibration`; the frame is one that the parameters were made for.
    factors : ndarray, shape (N, A), optional
        ``parameters.factors(q)`` where it is known already.

    Returns
    -------
    DifferentialModel
        Poses and Psi.

    References
    ----------
    Book section 1.4.3.

    Examples
    --------
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.robots import load
    >>> T, psi = differential_model(candidate_parameters(load("rx90")), np.zeros((5, 6)))
    >>> T.shape, psi.shape
    ((5, 4, 4), (5, 6, 34))
    """
    table, P = parameters.table, len(parameters)
    q = as_vector(q, parameters.model.n, "q")
    xi = np.zeros(P) if corrections is None else as_exact(corrections, (P,), "corrections")
    rows = q.reshape(-1, q.shape[-1])
    factor = parameters.factors(rows) if factors is None else factors
    after = table.after[table.end_row(frame) - 1 - table.model.f]
    T, psi = screws_of(table, rows, table.path(frame), after, xi, parameters.actions, factor, P)
    return DifferentialModel(T.reshape(*q.shape[:-1], 4, 4), psi.reshape(*q.shape[:-1], 6, P))


def screws_of(
    table: ExtendedTable,
    q: Array,
    path: NDArray[np.int64],
    after: Array,
    values: Array,
    actions: Actions,
    factors: Array,
    columns: int,
) -> DifferentialModel:
    """Poses behind a path of rows, and the sum of factor times screw of each value.

    Shapes: q (N, n), after (4, 4), values (columns,), actions (A,), factors (N, A).
    """
    from ..kernels.erroneous_poses import erroneous_poses

    T, psi = np.empty((len(q), 4, 4)), np.empty((len(q), 6, columns))
    turns = [np.ascontiguousarray(part) for pose in (table.before, after)
             for part in (pose[:3, :3], pose[:3, 3])]  # fmt: skip
    erroneous_poses(
        np.ascontiguousarray(q), table.nominal, table.sigma, table.joint, path, *turns,
        np.ascontiguousarray(values), *actions, factors, T, psi,
    )  # fmt: skip
    return DifferentialModel(T, psi)
