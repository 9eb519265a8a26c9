"""Coriolis and centrifugal torques, as a matrix and as the blocks of the book."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows
from ..model import RobotModel, check_model


def coriolis_matrix(model: RobotModel, q: ArrayLike, v: ArrayLike) -> Array:
    """Matrix C(q, v) of Christoffel symbols: ``C v`` are the Coriolis and centrifugal torques.

    ``dM/dt - 2 C`` is skew-symmetric.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; the leading axes broadcast.

    Returns
    -------
    ndarray, shape (..., n, n)
        The matrix, torque per velocity.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book sections 1.5.1.1 and 1.5.1.3; S. Echeandia and P. M. Wensing, "Numerical methods to
    compute the Coriolis matrix and Christoffel symbols for rigid-body systems", ASME JCND 16(9),
    2021.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> coriolis_matrix(arm, [0.0, 0.0], [1.0, 1.0]).shape
    (2, 2)
    """
    check_model(model)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    twin = model.twin
    if q.ndim == v.ndim == 1 and twin.serves_dynamics:
        C = pin.computeCoriolisMatrix(twin.model, twin.data(), twin.to_pin(q), twin.to_pin(v))
        return np.array(C if twin.in_table_order else C[np.ix_(twin.order, twin.order)], order="C")
    from ..kernels.coriolis import coriolis_matrices

    batch, rows = batch_rows((q, v), ("q", "v"))
    out = np.empty((rows[0].shape[0], model.n, model.n))
    coriolis_matrices(*rows, *model.chain, model.inertia.values, out)
    return out.reshape(*batch, model.n, model.n)


def christoffel_blocks(model: RobotModel, q: ArrayLike) -> tuple[Array, Array]:
    """Blocks B and C of the book: Coriolis and centrifugal torques apart.

    ``C(q, v) v = B [v v] + C [v^2]`` with the products ``v_1 v_2, v_1 v_3, ..., v_{n-1} v_n`` and
    the squares of the joint velocities. Their entries are Christoffel symbols ``c_{i,jk}`` of the
    mass matrix: ``B_{i,jk} = 2 c_{i,jk}`` and ``C_{ij} = c_{i,jj}``.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m.

    Returns
    -------
    B : ndarray, shape (..., n, n (n - 1) / 2)
        Of the products, pairs (j, k) with j < k in lexical order (``numpy.triu_indices(n, 1)``).
    C : ndarray, shape (..., n, n)
        Of the squares.

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.3 (elements of A, B, C and Q).

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.inertia import InertialParameters
    >>> links = InertialParameters.from_com([1, 1], [[0.1, 0, 0]] * 2, [np.zeros((3, 3))] * 2)
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.5]), links)
    >>> B, C = christoffel_blocks(arm, [0.0, np.pi / 2])
    >>> B.round(12), C.round(12)
    (array([[-0.1], [ 0. ]]), array([[ 0.  , -0.05], [ 0.05,  0.  ]]))
    """
    check_model(model)
    n = model.n
    batch, (rows,) = batch_rows((as_vector(q, n, "q"),), ("q",))
    from ..kernels.coriolis import coriolis_matrices

    # C(q, v) is linear in v and made of Christoffel symbols: column k of them is C(q, e_k)
    symbols = np.empty((n, rows.shape[0], n, n))
    for k in range(n):
        unit = np.zeros_like(rows)
        unit[:, k] = 1.0
        coriolis_matrices(rows, unit, *model.chain, model.inertia.values, symbols[k])
    j, k = np.triu_indices(n, 1)
    B = 2.0 * np.moveaxis(symbols[k, :, :, j], 0, -1)
    C = np.einsum("jkij->kij", symbols)
    return (
        np.ascontiguousarray(B).reshape(*batch, n, j.size),
        np.ascontiguousarray(C).reshape(*batch, n, n),
    )
