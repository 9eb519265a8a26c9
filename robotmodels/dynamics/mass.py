"""Inertia matrix of the joints."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_vector, batch_rows
from ..drive import check_all_or_none
from ..model import RobotModel, check_model


def mass_matrix(model: RobotModel, q: ArrayLike, drive: bool = True) -> Array:
    """Joint-space inertia matrix M(q), also called A(q) or generalised inertia.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m.
    drive : bool
        Whether rotor inertia (and that of coupled motors) is included.

    Returns
    -------
    ndarray, shape (..., n, n)
        Symmetric, kg m^2 (kg m, kg for prismatic joints).

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book sections 1.5.1.1, 1.5.1.3 and 1.5.1.5.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.inertia import InertialParameters
    >>> link = InertialParameters.from_com([2.0], [[0.1, 0, 0]], [np.zeros((3, 3))])
    >>> mass_matrix(RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]), link), [0.0])
    array([[0.02]])
    """
    check_model(model)
    check_all_or_none(drive)
    q = as_vector(q, model.n, "q")
    twin = model.twin
    if q.ndim == 1 and twin.serves_dynamics:
        upper = pin.crba(twin.model, twin.data(), twin.to_pin(q))
        M = np.where(_upper_triangle(model.n), upper, upper.T)
        if not twin.in_table_order:
            M = M[np.ix_(twin.order, twin.order)]
    else:
        from ..kernels.mass_matrix import mass_matrices

        batch, (rows,) = batch_rows((q,), ("q",))
        M = np.empty((rows.shape[0], model.n, model.n))
        mass_matrices(rows, *model.chain, model.inertia.values, M)
        M = M.reshape(*batch, model.n, model.n)
    if drive and (drives := model.drive_matrices) is not None:
        M = M + drives.rotor
    return M


@lru_cache
def _upper_triangle(n: int) -> NDArray[np.bool_]:
    return np.triu(np.ones((n, n), dtype=bool))
