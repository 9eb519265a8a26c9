"""What is said of a mass matrix that no robot has: singular, or not positive definite."""

from __future__ import annotations

import warnings

import numpy as np

from .._arrays import Array
from ..errors import InertiaError, SingularMassMatrixError
from ..inertia import InertiaWarning
from ..model import RobotModel
from .mass import mass_matrix

_PART = 0.05  # of the largest joint of a motion: what moves less takes no part in it


def unit_diagonal(M: Array) -> tuple[Array, Array]:
    """A mass matrix in coordinates of unit diagonal, so that units and sizes do not matter.

    Shapes: M (m, m) -> scaled (m, m), size (m,).
    """
    size = np.abs(np.diag(M))
    size = np.sqrt(np.where(size > 0.0, size, np.abs(M).max(axis=1, initial=0.0)))
    if not (size.all() and np.isfinite(size).all()):
        return np.zeros_like(M), size
    return M / (size[:, None] * size), size


def is_definite(scaled: Array) -> bool:
    """Whether a matrix of unit diagonal is positive definite beyond rounding."""
    try:
        pivots = np.linalg.cholesky(scaled).diagonal()
    except np.linalg.LinAlgError:
        return False
    return bool((pivots * pivots).min(initial=1.0) > _rounding(scaled))


def no_answer(
    model: RobotModel, M: Array, drive: bool, where: str = "", free: Array | None = None
) -> InertiaError | SingularMassMatrixError:
    """Exception for a mass matrix that is singular or not positive definite.

    Shapes: M (m, m), free (n, m).
    """
    title = f"the mass matrix of {model.name!r} is"
    m = len(M)
    advice = (
        "Give inertial parameters with model.with_inertia(...), or rotor inertias Ia with "
        "model.with_drive(...)."
    )
    if not np.isfinite(M).all():
        return SingularMassMatrixError(f"{title} singular{where}: its entries overflow. {advice}")
    size = np.sqrt(np.abs(np.diag(M)))
    size = np.where(size > 0.0, size, np.sqrt(np.abs(M).max(axis=1)))
    size = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(M / (size[:, None] * size))
    if values[0] < -_rounding(M):
        count = int((values < 0.0).sum())
        return InertiaError(
            f"{title} not positive definite{where}: {count} of its {m} eigenvalues "
            f"{'is' if count == 1 else 'are'} negative, as of no robot. {_faults(model, drive)}"
            "Repair these parameters; standard_parameters(...) finds the nearest ones that real "
            "bodies have."
        )
    null = vectors[:, values <= max(_rounding(M), values[0])] / size[:, None]
    rank = m - null.shape[1]
    motion = np.abs(null if free is None else free @ null).max(axis=1)
    joints = [int(j) + 1 for j in np.flatnonzero(motion > _PART * motion.max())]
    who = f"joint {joints[0]}" if len(joints) == 1 else f"joints {', '.join(map(str, joints))}"
    return SingularMassMatrixError(
        f"{title} singular{where}: it has rank {rank} of {m}, and a motion of {who} moves no "
        f"inertia. {advice}"
    )


def warn_of_negative_mass(model: RobotModel) -> None:
    """Say that links have negative masses, to the caller of the caller."""
    mass = model.inertia.mass
    if (mass < 0.0).any():
        links = ", ".join(
            f"link {j + 1} ({model.table.names[j]}) {mass[j]:g} kg"
            for j in np.flatnonzero(mass < 0.0)
        )
        warnings.warn(
            f"negative mass in {model.name!r}: {links}. The mass matrix is positive definite all "
            "the same here, and the accelerations are those of the equations, but no real robot "
            "has these links; see model.inertia.consistency().",
            InertiaWarning,
            stacklevel=3,
        )


def _faults(model: RobotModel, drive: bool) -> str:
    """The links and rotors that no robot has, in sentences."""
    text = model.inertia.consistency().not_physical
    text = f"Not physical: {text}. " if text else ""
    if drive and (model.drive.Ia < 0.0).any():
        rotors = ", ".join(
            f"{model.drive.Ia[k]:g} of joint {k + 1}" for k in np.flatnonzero(model.drive.Ia < 0.0)
        )
        text += f"Rotor inertia Ia is negative: {rotors}. "
    if drive and model.transmission is not None and model.transmission.Iam.any():
        text += (
            "The coupling inertia Iam of a motor must fit the Ia of the joints that turn it: "
            f"Iam = {model.transmission.Iam.tolist()}, Ia = {model.drive.Ia.tolist()}. "
        )
    return text


def _rounding(M: Array) -> float:
    return 4 * len(M) * float(np.finfo(np.float64).eps)


def sample_error(
    model: RobotModel, q: Array, drive: bool, sample: int, several: bool
) -> InertiaError | SingularMassMatrixError:
    """The error of one of several samples ``q (N, n)``."""
    with np.errstate(over="ignore", invalid="ignore"):
        M = mass_matrix(model, q[sample], drive)
    return no_answer(model, M, drive, f" (first in sample {sample} of {len(q)})" * several)
