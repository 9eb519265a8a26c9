"""Torque regressor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows
from ..drive import Drives
from ..friction import Friction, LinearFriction
from ..model import RobotModel, check_model
from .chunks import check_log, check_size, stream
from .columns import LINKS, ChosenColumns, Columns, chosen_columns, friction_of, standard_blocks
from .drives import add_torques


def torque_regressor(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    drive: Drives = True,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Array:
    """Matrix W of the inverse dynamic model: ``idm(model, q, v, a) = W @ parameters``.

    Also called the identification (observation) matrix; ``computeJointTorqueRegressor``.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints; its own inertia is not used.
    q, v, a : array_like, shape (..., n)
        Joint variables (rad or m), velocities and accelerations; the leading axes broadcast.
        An empty batch gives an empty result.
    drive : bool or collection of DriveKind or str
        Which drive parameters have columns: all, none, or kinds such as ``("Ia", "Fv", "Fc")``;
        what couples motors goes with its kind.
    columns : indices, names, mask or BaseParameters, optional
        A choice of the columns, which alone are computed; default all. Base parameters choose the
        columns that they keep.
    friction : Friction, optional
        A friction model that is linear in its parameters; its columns come last.

    Returns
    -------
    ndarray, shape (..., n, p)
        p = 10 f + 4 n (10 f without drives), three more for each coupled motor; columns as
        `parameter_names`.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity; columns that are not there;
        friction that is not linear.

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
    >>> torque_regressor(one, [0.0], [3.0], [2.0], columns=["ZZ1", "Fv1"])
    array([[2., 3.]])
    """
    check_model(model)
    n = model.n
    arrays = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(a, n, "a")
    batch, rows = batch_rows(arrays, ("q", "v", "a"))
    chosen = chosen_columns(standard_blocks(model, drive, friction), columns, model)
    W = np.empty((rows[0].shape[0], n, chosen.count))
    fill_torques(model, chosen, friction_of(model, friction), rows, W)
    return W.reshape(*batch, n, chosen.count)


def torque_regressor_chunks(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    drive: Drives = True,
    size: int = 256,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Iterator[tuple[slice, Array]]:
    """The torque regressor of many samples, a piece at a time in one reused buffer.

    Memory does not grow with the number of samples, and a piece stays in the processor's cache.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v, a : array_like, shape (N, n)
        Joint variables (rad or m), velocities and accelerations.
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
    W : ndarray, shape (k, n, p)
        Their regressor. The next piece overwrites it: use or copy it before going on.

    Raises
    ------
    ShapeError, InvalidValueError
        As `torque_regressor`, ``size`` below 1, or a log without samples.

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
    check_size(size)
    n = model.n
    arrays = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(a, n, "a")
    _, rows = batch_rows(arrays, ("q", "v", "a"))
    check_log(rows[0].shape[0], "q, v, a")
    chosen = chosen_columns(standard_blocks(model, drive, friction), columns, model)
    fill = partial(fill_torques, model, chosen, friction_of(model, friction))
    return stream(fill, rows, size, (n, chosen.count))


def fill_torques(
    model: RobotModel,
    chosen: ChosenColumns,
    friction: LinearFriction | None,
    rows: Sequence[Array],
    W: Array,
) -> None:
    """Write the chosen columns of the samples ``(q, v, a)`` into ``W (N, n, c)``."""
    from ..kernels.torque_regressor import torque_regressors

    torque_regressors(*rows, *model.chain, model.gravity, chosen.places[LINKS], W)
    q, v, a = rows
    add_torques(model, chosen, q, v, a, friction, 1.0, W)
