"""Kinetic and potential energy."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows
from ..drive import check_all_or_none
from ..model import RobotModel, check_model


def kinetic_energy(model: RobotModel, q: ArrayLike, v: ArrayLike, drive: bool = True) -> Array:
    """Kinetic energy ``v^T M v / 2``.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; the leading axes broadcast.
    drive : bool
        Whether the rotors' energy is included.

    Returns
    -------
    ndarray, shape (...)
        Joules.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.2.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.drive import DriveParameters
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]),
    ...                             drive=DriveParameters(Ia=[0.5]))
    >>> float(kinetic_energy(one, [0.0], [2.0]))
    1.0
    """
    check_model(model)
    check_all_or_none(drive)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    twin = model.twin
    if q.ndim == v.ndim == 1 and twin.serves_dynamics:
        energy = np.float64(
            pin.computeKineticEnergy(twin.model, twin.data(), twin.to_pin(q), twin.to_pin(v))
        )
    else:
        from ..kernels.energies import kinetic_energies

        batch, rows = batch_rows((q, v), ("q", "v"))
        energy = np.empty(rows[0].shape[0])
        kinetic_energies(*rows, *model.chain, model.inertia.values, energy)
        energy = energy.reshape(batch)
    if drive and (drives := model.drive_matrices) is not None:
        energy = energy + 0.5 * np.einsum("...i,ij,...j->...", v, drives.rotor, v)
    return np.asarray(energy)


def potential_energy(model: RobotModel, q: ArrayLike) -> Array:
    """Potential energy in the gravity field, zero for masses at the world's origin.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m.

    Returns
    -------
    ndarray, shape (...)
        Joules.

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.2.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.inertia import InertialParameters
    >>> slide = InertialParameters.from_com([2.0], [[0, 0, 0]], [np.zeros((3, 3))])
    >>> lift = RobotModel.from_table(DHTable(antecedent=[0], sigma=[1]), slide)
    >>> round(float(potential_energy(lift, [0.5])), 12)
    9.81
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    twin = model.twin
    # Pinocchio leaves out what is fixed to the base
    if q.ndim == 1 and twin.serves_dynamics and twin.base_is_massless:
        return np.asarray(
            pin.computePotentialEnergy(twin.model, twin.data(), twin.to_pin(q)), dtype=np.float64
        )
    from ..kernels.energies import potential_energies

    batch, (rows,) = batch_rows((q,), ("q",))
    energy = np.empty(rows.shape[0])
    potential_energies(rows, *model.chain, model.inertia.values, model.gravity, energy)
    return energy.reshape(batch)
