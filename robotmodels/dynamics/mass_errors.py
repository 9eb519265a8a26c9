"""Errors and warnings for mass matrices that are singular or not positive definite."""

from __future__ import annotations

import warnings

import numpy as np

from .._arrays import Array
from ..errors import InertiaError, SingularMassMatrixError
from ..inertia import InertiaWarning
from ..model import RobotModel

_PART = 0.05  # least share of the largest joint motion of a named joint


def mass_matrix_error(
    model: RobotModel, M: Array, drive: bool, where: str = "", free: Array | None = None
) -> InertiaError | SingularMassMatrixError:
    """Exception for a mass matrix that is singular or not positive definite.

    Shapes: M (m, m), free (n, m).
    """
    title = f"the mass matrix of {model.name!r} is"
    advice = (
        "Give inertial parameters with model.with_inertia(...), or rotor inertias Ia with "
        "model.with_drive(...)."
    )
    if not np.isfinite(M).all():
        return SingularMassMatrixError(f"{title} singular{where}: its entries overflow. {advice}")
    m, size = len(M), unit_sizes(M)
    values, vectors = np.linalg.eigh(M / (size[:, None] * size))
    if values[0] < -rounding(m):
        links = model.inertia.consistency().not_physical
        rotors = f"Check the rotor inertias Ia = {model.drive.Ia.tolist()}" if drive else ""
        if drive and model.transmission is not None and model.transmission.Iam.any():
            rotors += f" and, of coupled motors, Iam = {model.transmission.Iam.tolist()}"
        return InertiaError(
            f"{title} not positive definite{where}: {(values < 0.0).sum()} of its {m} eigenvalues "
            f"are negative. {f'Not physical: {links}. ' * bool(links)}{rotors + '. ' * drive}"
            "Correct these parameters; standard_parameters(...) finds the nearest physical ones."
        )
    null = vectors[:, values <= max(rounding(m), values[0])] / size[:, None]
    motion = np.abs(null if free is None else free @ null).max(axis=1)
    joints = [str(j + 1) for j in np.flatnonzero(motion > _PART * motion.max())]
    return SingularMassMatrixError(
        f"{title} singular{where}: it has rank {m - null.shape[1]} of {m}, and a motion of "
        f"joint{'s' * (len(joints) > 1)} {', '.join(joints)} moves no inertia. {advice}"
    )


def unit_sizes(M: Array) -> Array:
    """Units (..., m) in which mass matrices (..., m, m) have unit (or zero) diagonals."""
    size = np.sqrt(np.abs(np.diagonal(M, axis1=-2, axis2=-1)))
    return np.where(size > 0.0, size, 1.0)


def rounding(m: int) -> float:
    """Relative rounding of the eigenvalues of a mass matrix of unit diagonal."""
    return 4 * m * float(np.finfo(np.float64).eps)


def warn_of_negative_mass(model: RobotModel) -> None:
    """Warn the caller of the caller of links with negative masses."""
    if (model.inertia.mass < 0.0).any():
        links = ", ".join(
            f"link {j + 1} ({model.table.names[j]}) {mass:g} kg"
            for j, mass in enumerate(model.inertia.mass)
            if mass < 0.0
        )
        warnings.warn(
            f"negative mass in {model.name!r}: {links}. The mass matrix is positive definite here, "
            "and the accelerations are those of the equations, but these links are not physical; "
            "see model.inertia.consistency().",
            InertiaWarning,
            stacklevel=3,
        )
