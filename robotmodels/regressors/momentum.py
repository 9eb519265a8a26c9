"""Momentum regressors: identification without accelerations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows
from ..drive import Drives
from ..friction import Friction, LinearFriction
from ..model import RobotModel, check_model
from .chunks import check_log, check_size, pieces
from .columns import LINKS, ChosenColumns, Columns, chosen_columns, friction_of, standard_blocks
from .drives import add_rotor_momenta, add_torques


class MomentumRegressors(NamedTuple):
    """Regressors of the generalised momentum and of what changes it besides the torques.

    Attributes
    ----------
    momentum : ndarray, shape (..., n, p)
        ``P @ parameters`` is ``p = A(q) v``, rotors included.
    force : ndarray, shape (..., n, p)
        ``S @ parameters`` is ``C(q, v)^T v - Q(q) - friction - offset``.
    """

    momentum: Array
    force: Array


def momentum_regressor(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    drive: Drives = True,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> MomentumRegressors:
    """Regressors P and S of the momentum form ``dp/dt = tau + C^T v - Q - friction``.

    With ``p = P @ parameters`` the torque is ``tau = (dP/dt - S) @ parameters``: filtered or
    integrated, it needs no accelerations. ``C^T v`` is ``dA/dt v - C v``, the slope of the kinetic
    energy over the configuration.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; the leading axes broadcast.
        An empty batch gives an empty result.
    drive : bool or collection of DriveKind or str
        Which drive parameters have columns: all, none, or kinds such as ``("Ia", "Fv", "Fc")``;
        what couples motors goes with its kind.
    columns, friction
        As for `torque_regressor`.

    Returns
    -------
    MomentumRegressors
        ``momentum`` and ``force``, each of shape (..., n, p); columns as `parameter_names`.

    Raises
    ------
    ShapeError, InvalidValueError
        As `torque_regressor`.

    See Also
    --------
    filtered_regressor : both through a low-pass filter.

    References
    ----------
    Seed book sections 1.5.1.2 and 1.6.3; J.-J. Slotine and W. Li, "On the adaptive control of robot
    manipulators", IJRR 6(3), 1987 (the filtered form); A. De Luca and R. Mattone, "Actuator failure
    detection and isolation using generalized momenta", IEEE ICRA 2003.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> P, S = momentum_regressor(one, [0.0], [3.0], columns=["ZZ1", "Fv1"])
    >>> P, S
    (array([[3., 0.]]), array([[ 0., -3.]]))
    """
    check_model(model)
    n = model.n
    batch, rows = batch_rows((as_vector(q, n, "q"), as_vector(v, n, "v")), ("q", "v"))
    chosen = chosen_columns(standard_blocks(model, drive, friction), columns, model)
    P, S = np.empty((2, rows[0].shape[0], n, chosen.count))
    fill_momenta(model, chosen, friction_of(model, friction), rows, P, S)
    shape = (*batch, n, chosen.count)
    return MomentumRegressors(P.reshape(shape), S.reshape(shape))


def momentum_regressor_chunks(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    drive: Drives = True,
    size: int = 128,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Iterator[tuple[slice, MomentumRegressors]]:
    """The momentum regressors of many samples, a piece at a time in two reused buffers.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v : array_like, shape (N, n)
        Joint variables (rad or m) and velocities.
    drive : bool or collection of DriveKind or str
        Which drive parameters have columns: all, none, or kinds such as ``("Ia", "Fv", "Fc")``;
        what couples motors goes with its kind.
    size : int
        Samples in a piece.
    columns, friction
        As for `torque_regressor`.

    Yields
    ------
    rows : slice
        Which samples the piece is for.
    regressors : MomentumRegressors
        Arrays of shape (k, n, p). The next piece overwrites them.

    Raises
    ------
    ShapeError, InvalidValueError
        As `momentum_regressor`, ``size`` below 1, or a log without samples.

    References
    ----------
    Seed book section 1.6.3.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> samples = np.zeros((1000, 1))
    >>> [P.shape for _, (P, S) in momentum_regressor_chunks(one, samples, samples, size=600)]
    [(600, 1, 14), (400, 1, 14)]
    """
    check_model(model)
    check_size(size)
    n = model.n
    _, rows = batch_rows((as_vector(q, n, "q"), as_vector(v, n, "v")), ("q", "v"))
    check_log(rows[0].shape[0])
    chosen = chosen_columns(standard_blocks(model, drive, friction), columns, model)
    return _stream(model, chosen, friction_of(model, friction), rows, size)


def fill_momenta(
    model: RobotModel,
    chosen: ChosenColumns,
    friction: LinearFriction | None,
    rows: Sequence[Array],
    P: Array,
    S: Array,
) -> None:
    """Write the chosen columns of the samples ``(q, v)`` into ``P`` and ``S (N, n, c)``."""
    from ..kernels.momentum_regressor import momentum_regressors

    momentum_regressors(*rows, *model.chain, model.gravity, chosen.places[LINKS], P, S)
    add_rotor_momenta(model, chosen, rows[1], P)
    add_torques(model, chosen, rows[0], rows[1], None, friction, -1.0, S)


def _stream(
    model: RobotModel,
    chosen: ChosenColumns,
    friction: LinearFriction | None,
    rows: Sequence[Array],
    size: int,
) -> Iterator[tuple[slice, MomentumRegressors]]:
    N = rows[0].shape[0]
    P, S = np.empty((2, min(size, N), model.n, chosen.count))
    for piece in pieces(N, P.shape[0]):
        k = piece.stop - piece.start
        fill_momenta(model, chosen, friction, [array[piece] for array in rows], P[:k], S[:k])
        yield piece, MomentumRegressors(P[:k], S[:k])
