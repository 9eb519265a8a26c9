"""Parts of the dynamic model: masses, Coriolis and centrifugal torques, gravity, energies.

Returns
-------
ndarray
    Of the shape (..., core) that each names; SI units.

Raises
------
ShapeError, InvalidValueError
    Arguments of the wrong length, or with NaN or infinity.

References
----------
Book sections 1.5.1.1 to 1.5.1.3 and 1.5.1.5; S. Echeandia and P. M. Wensing, "Numerical
methods to compute the Coriolis matrix and Christoffel symbols for rigid-body systems", ASME JCND
16(9), 2021.

Examples
--------
>>> from robotmodels.geometry import DHTable
>>> from robotmodels.inertia import InertialParameters
>>> link = InertialParameters.from_com([2.0], [[0.1, 0, 0]], [np.zeros((3, 3))])
>>> lift = RobotModel.from_table(DHTable(antecedent=[0], sigma=[1]), link)
>>> mass_matrix(lift, [0.5]), gravity_torque(lift, [0.5])
(array([[2.]]), array([19.62]))
>>> float(kinetic_energy(lift, [0.5], [2.0])), round(float(potential_energy(lift, [0.5])), 12)
(4.0, 9.81)
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..drive import check_all_or_none
from ..model import RobotModel, check_model
from .inverse import batched, rigid_torques, warn_without_masses


def mass_matrix(model: RobotModel, q: ArrayLike, drive: bool = True) -> Array:
    """Joint-space inertia matrix M(q), also called A(q) or generalised inertia.

    Shapes: q (..., n) -> (..., n, n), symmetric, kg m^2 (kg m, kg for prismatic joints).
    """
    check_model(model)
    check_all_or_none(drive)
    q = as_vector(q, model.n, "q")
    twin = model.twin
    if q.ndim == 1 and twin.serves_dynamics:
        M = _in_table_order(model, pin.crba(twin.model, twin.data(), twin.to_pin(q)))
    else:
        from ..kernels.mass import mass_matrices

        M = batched(mass_matrices, model, {"q": q}, (model.n, model.n))
    if drive and (drives := model.drive_matrices) is not None:
        M = M + drives.rotor
    return M


def coriolis_matrix(model: RobotModel, q: ArrayLike, v: ArrayLike) -> Array:
    """Matrix C(q, v) of Christoffel symbols; ``dM/dt - 2 C`` is skew-symmetric.

    Shapes: q, v (..., n) -> (..., n, n). ``C v`` are the Coriolis and centrifugal torques.
    """
    check_model(model)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    twin = model.twin
    if q.ndim == v.ndim == 1 and twin.serves_dynamics:
        C = pin.computeCoriolisMatrix(twin.model, twin.data(), twin.to_pin(q), twin.to_pin(v))
        return _in_table_order(model, C)
    from ..kernels.mass import coriolis_matrices

    return batched(coriolis_matrices, model, {"q": q, "v": v}, (model.n, model.n))


def christoffel_blocks(model: RobotModel, q: ArrayLike) -> tuple[Array, Array]:
    """Blocks B and C of the book: ``C(q, v) v = B [v v] + C [v^2]``.

    Shapes: q (..., n) -> B (..., n, n (n - 1) / 2), C (..., n, n). With the Christoffel symbols
    ``c_{i,jk}`` of the mass matrix, ``B_{i,jk} = 2 c_{i,jk}`` for the products ``v_j v_k``, j < k
    in lexical order (``numpy.triu_indices(n, 1)``), and ``C_{ij} = c_{i,jj}``.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> arm, q, v = load("puma560"), *np.ones((2, 6))
    >>> (B, C), (j, k) = christoffel_blocks(arm, q), np.triu_indices(6, 1)
    >>> bool(np.allclose(B @ (v[j] * v[k]) + C @ v**2, coriolis_matrix(arm, q, v) @ v))
    True
    """
    from ..kernels.mass import coriolis_matrices

    check_model(model)
    n = model.n
    q = as_vector(q, n, "q")
    # C(q, v) is linear in v and made of Christoffel symbols: column k of them is C(q, e_k)
    arrays = {"q": q[..., None, :], "v": np.eye(n)}
    symbols = batched(coriolis_matrices, model, arrays, (n, n))  # (..., k, i, j)
    j, k = np.triu_indices(n, 1)
    B = 2.0 * np.moveaxis(symbols[..., k, :, j], 0, -1)
    C = np.einsum("...jij->...ij", symbols)
    return np.ascontiguousarray(B), np.ascontiguousarray(C)


def gravity_torque(model: RobotModel, q: ArrayLike) -> Array:
    """Gravity torques Q(q), also ``gravload``.

    Shapes: q (..., n) -> (..., n), N m or N.
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    if model.twin.torques_warn:
        warn_without_masses(model)
    twin = model.twin
    if q.ndim == 1 and twin.serves_dynamics:
        g = pin.computeGeneralizedGravity(twin.model, twin.data(), twin.to_pin(q))
        return twin.from_pin(g)
    zero = np.zeros(model.n)
    return rigid_torques(model, q, zero, zero)


def kinetic_energy(model: RobotModel, q: ArrayLike, v: ArrayLike, drive: bool = True) -> Array:
    """Kinetic energy ``v^T M v / 2``.

    Shapes: q, v (..., n) -> (...), joules.
    """
    check_model(model)
    check_all_or_none(drive)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    twin = model.twin
    if q.ndim == v.ndim == 1 and twin.serves_dynamics:
        x, dx = twin.to_pin(q), twin.to_pin(v)
        energy = np.float64(pin.computeKineticEnergy(twin.model, twin.data(), x, dx))
    else:
        energy = _energies(model, q, v)[..., 0].copy()
    if drive and (drives := model.drive_matrices) is not None:
        energy = energy + 0.5 * np.einsum("...i,ij,...j->...", v, drives.rotor, v)
    return np.asarray(energy)


def potential_energy(model: RobotModel, q: ArrayLike) -> Array:
    """Potential energy in the gravity field, zero for masses at the world's origin.

    Shapes: q (..., n) -> (...), joules.
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    # Pinocchio leaves out bodies that are fixed to the base
    twin = model.twin
    if q.ndim == 1 and twin.serves_dynamics and twin.base_is_massless:
        energy = pin.computePotentialEnergy(twin.model, twin.data(), twin.to_pin(q))
        return np.asarray(energy, dtype=np.float64)
    return _energies(model, q, np.zeros(model.n))[..., 1].copy()


def _in_table_order(model: RobotModel, M: Array) -> Array:
    """A copy of a matrix (n, n) in Pinocchio's order of joints, in that of the table."""
    twin = model.twin
    return np.array(M if twin.in_table_order else M[np.ix_(twin.order, twin.order)], order="C")


def _energies(model: RobotModel, q: Array, v: Array) -> Array:
    """Kinetic energy of the links, and potential energy. Shapes: q, v (..., n) -> (..., 2)."""
    from ..kernels.torques import energies

    return batched(energies, model, {"q": q, "v": v}, (2,), model.gravity)
