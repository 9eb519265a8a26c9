"""Regressors: dynamics as a matrix times the standard parameters.

Seed book sections 1.5.2.1, 1.5.3 and 1.6.2: the dynamic model is linear in the inertial and drive
parameters.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Array, as_vector, batch_rows
from .errors import InvalidValueError
from .inertia import PARAMETERS
from .model import RobotModel, check_model

_DRIVE_PARAMETERS = ("Ia", "Fv", "Fc", "offset")
_COUPLED_PARAMETERS = ("Iam", "Fvm", "Fcm")


def parameter_names(model: RobotModel, drive: bool = True) -> tuple[str, ...]:
    """Names of the standard parameters, in the order of the regressor's columns.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints.
    drive : bool
        Whether the drive parameters are included.

    Returns
    -------
    tuple of str
        ``XX1 XY1 ... M1 XX2 ...``, then all ``Ia``, all ``Fv``, all ``Fc``, all ``offset``,
        numbered by frame; ``Iam``, ``Fvm``, ``Fcm`` of coupled motors at the end.

    References
    ----------
    Seed book section 1.5.2.1.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> names = parameter_names(RobotModel.from_table(DHTable(antecedent=[0], sigma=[0])))
    >>> names[5], names[-1], len(names)
    ('ZZ1', 'offset1', 14)
    """
    check_model(model)
    names = [f"{p}{j}" for j in range(1, model.f + 1) for p in PARAMETERS]
    if drive:
        frames = [int(row) + 1 for row in model.table.joint_rows]
        names += [f"{p}{j}" for p in _DRIVE_PARAMETERS for j in frames]
        names += [f"{p}{frames[m - 1]}" for p in _COUPLED_PARAMETERS for m in _coupled(model)]
    return tuple(names)


def parameter_vector(model: RobotModel, drive: bool = True) -> Array:
    """The model's own standard parameters, in the order of `parameter_names`.

    Parameters
    ----------
    model : RobotModel
        The robot.
    drive : bool
        Whether the drive parameters are included.

    Returns
    -------
    ndarray, shape (p,)
        Values such that ``torque_regressor(...) @ parameter_vector(...)`` is the torque.

    References
    ----------
    Seed book section 1.5.2.1.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> parameter_vector(RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))).shape
    (14,)
    """
    check_model(model)
    values = [model.inertia.values.ravel()]
    if drive:
        values += [getattr(model.drive, p) for p in _DRIVE_PARAMETERS]
        if model.transmission is not None:
            motors = np.array(_coupled(model), dtype=np.int64) - 1
            values += [getattr(model.transmission, p)[motors] for p in _COUPLED_PARAMETERS]
    return np.concatenate(values)


def torque_regressor(
    model: RobotModel, q: ArrayLike, v: ArrayLike, a: ArrayLike, drive: bool = True
) -> Array:
    """Matrix W of the inverse dynamic model: ``idm(model, q, v, a) = W @ parameters``.

    Also called the identification (observation) matrix; ``computeJointTorqueRegressor``.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints; its own inertia is not used.
    q, v, a : array_like, shape (..., n)
        Joint variables (rad or m), velocities and accelerations; the leading axes broadcast.
    drive : bool
        Whether the columns of the drive parameters are included.

    Returns
    -------
    ndarray, shape (..., n, p)
        p = 10 f + 4 n (10 f without drives), three more for each coupled motor; columns as
        `parameter_names`.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    See Also
    --------
    torque_regressor_chunks : the same for long logs, in pieces of bounded size.

    References
    ----------
    Seed book sections 1.5.2.1, 1.6.2 and 1.6.3.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> float(torque_regressor(one, [0.0], [0.0], [2.0])[0, 5])
    2.0
    """
    check_model(model)
    n = model.n
    arrays = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(a, n, "a")
    batch, rows = batch_rows(arrays, ("q", "v", "a"))
    W = np.zeros((rows[0].shape[0], n, _columns(model, drive)))
    if drive:
        rigid = np.empty((rows[0].shape[0], n, 10 * model.f))
        _fill(model, rows, rigid, W)
    else:
        _fill(model, rows, W, None)
    return W.reshape(*batch, n, W.shape[-1])


def torque_regressor_chunks(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    drive: bool = True,
    size: int = 256,
) -> Iterator[tuple[slice, Array]]:
    """The torque regressor of many samples, a piece at a time in one reused buffer.

    Memory does not grow with the number of samples, and a piece stays in the processor's cache.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v, a : array_like, shape (N, n)
        Joint variables (rad or m), velocities and accelerations.
    drive : bool
        Whether the columns of the drive parameters are included.
    size : int
        Samples in a piece.

    Yields
    ------
    rows : slice
        Which samples the piece is for.
    W : ndarray, shape (k, n, p)
        Their regressor. The next piece overwrites it: use or copy it before going on.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, with NaN or infinity, or ``size`` below 1.

    References
    ----------
    Seed book section 1.6.2.1.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> samples = np.zeros((1000, 1))
    >>> [W.shape[0] for _, W in torque_regressor_chunks(one, samples, samples, samples, size=400)]
    [400, 400, 200]
    """
    check_model(model)
    if size < 1:
        raise InvalidValueError(f"size: expected at least one sample in a piece, got {size}.")
    n = model.n
    arrays = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(a, n, "a")
    _, rows = batch_rows(arrays, ("q", "v", "a"))
    return _chunks(model, rows, drive, size)


def energy_regressor(model: RobotModel, q: ArrayLike, v: ArrayLike, drive: bool = True) -> Array:
    """Row of the total energy: kinetic plus potential energy is the row times the parameters.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; the leading axes broadcast.
    drive : bool
        Whether the columns of the rotor inertias, ``v^2 / 2`` (and those of coupled motors), are
        included. Friction is no energy.

    Returns
    -------
    ndarray, shape (..., 10 f + n)
        Columns as `parameter_names` up to ``Ia`` (10 f without drives), then one more for the
        ``Iam`` of each coupled motor.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.2; M. Gautier and W. Khalil, "On the identification of the inertial
    parameters of robots", IEEE CDC 1988.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> float(energy_regressor(one, [0.0], [2.0])[5])
    2.0
    """
    check_model(model)
    from .kernels.energy_regressor import energy_regressors

    arrays = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    batch, rows = batch_rows(arrays, ("q", "v"))
    out = np.empty((rows[0].shape[0], 1, 10 * model.f))
    energy_regressors(*rows, *model.chain, model.gravity, np.arange(10 * model.f), out)
    out = out[:, 0]
    if drive:
        v = rows[1]
        coupled = [0.5 * np.einsum("ki,ij,kj->k", v, c, v)[:, None] for _, c in _couplings(model)]
        out = np.concatenate((out, 0.5 * v**2, *coupled), axis=1)
    return out.reshape(*batch, out.shape[-1])


def _columns(model: RobotModel, drive: bool) -> int:
    return 10 * model.f + (4 * model.n + 3 * len(_coupled(model)) if drive else 0)


def _coupled(model: RobotModel) -> tuple[int, ...]:
    return () if model.transmission is None else model.transmission.coupled_motors


def _chunks(
    model: RobotModel, rows: list[Array], drive: bool, size: int
) -> Iterator[tuple[slice, Array]]:
    N = rows[0].shape[0]
    size = min(size, max(N, 1))
    W = np.zeros((size, model.n, _columns(model, drive)))
    rigid = np.empty((size, model.n, 10 * model.f)) if drive else W
    for start in range(0, N, size):
        piece = slice(start, min(start + size, N))
        k = piece.stop - start
        samples = [array[piece] for array in rows]
        _fill(model, samples, rigid[:k], W[:k] if drive else None)
        yield piece, W[:k]


def _fill(model: RobotModel, rows: list[Array], rigid: Array, W: Array | None) -> None:
    """Rigid columns into ``rigid``; if ``W`` is given, these and the drive columns into ``W``."""
    from .kernels.torque_regressor import torque_regressors

    torque_regressors(*rows, *model.chain, model.gravity, np.arange(10 * model.f), rigid)
    if W is None:
        return
    _, v, a = rows
    n, p = model.n, 10 * model.f
    W[:, :, :p] = rigid
    joints = np.arange(n)
    for kind, values in enumerate((a, v, np.sign(v), np.ones_like(v))):
        W[:, joints, p + kind * n + joints] = values
    couplings = _couplings(model)
    step = len(couplings)
    for i, (row, cross) in enumerate(couplings):
        first = p + 4 * n + i
        W[:, :, first] = a @ cross
        W[:, :, first + step] = v @ cross
        W[:, :, first + 2 * step] = np.sign(v @ row)[:, None] * row


def _couplings(model: RobotModel) -> list[tuple[Array, Array]]:
    """Of each coupled motor, its turns ``w`` per joint (n,) and ``w w^T`` without diagonal."""
    if model.transmission is None:
        return []
    weights = model.transmission.weights
    rows = [weights[m - 1] for m in model.transmission.coupled_motors]
    return [(w, np.outer(w, w) - np.diag(w**2)) for w in rows]
