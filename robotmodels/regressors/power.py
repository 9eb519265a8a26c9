"""Power regressor."""

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
from .drives import add_powers


def power_regressor(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    drive: Drives = True,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Array:
    """Row of the joint power: ``v . idm(model, q, v, a)`` is the row times the parameters.

    ``v^T`` times the torque regressor, computed without it. The columns of the links and rotors
    are the rate of `energy_regressor`; those of friction and offsets are the power they take.
    `energy_difference_regressor` is its integral between samples and needs no accelerations.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints.
    q, v, a : array_like, shape (..., n)
        Joint variables (rad or m), velocities and accelerations; the leading axes broadcast.
        An empty batch gives an empty result.
    drive : bool or collection of DriveKind or str
        Which drive parameters have columns: all, none, or kinds such as ``("Ia", "Fv", "Fc")``;
        what couples motors goes with its kind.
    columns, friction
        As for `torque_regressor`.

    Returns
    -------
    ndarray, shape (..., p)
        Watts per unit of each parameter; columns as `parameter_names`.

    Raises
    ------
    ShapeError, InvalidValueError
        As `torque_regressor`.

    References
    ----------
    Seed book sections 1.5.1.2 and 1.6.3; M. Gautier, "Dynamic identification of robots with power
    model", IEEE ICRA 1997.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> power_regressor(one, [0.0], [3.0], [2.0], columns=["ZZ1", "Fv1", "Fc1"])
    array([6., 9., 3.])
    """
    check_model(model)
    n = model.n
    arrays = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(a, n, "a")
    batch, rows = batch_rows(arrays, ("q", "v", "a"))
    chosen = chosen_columns(standard_blocks(model, drive, friction), columns, model)
    out = np.empty((rows[0].shape[0], chosen.count))
    _fill(model, chosen, friction_of(model, friction), rows, out)
    return out.reshape(*batch, chosen.count)


def power_regressor_chunks(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    drive: Drives = True,
    size: int = 1024,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Iterator[tuple[slice, Array]]:
    """The power regressor of many samples, a piece at a time in one reused buffer.

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
    d : ndarray, shape (k, p)
        Their rows. The next piece overwrites them.

    Raises
    ------
    ShapeError, InvalidValueError
        As `power_regressor`, ``size`` below 1, or a log without samples.

    References
    ----------
    Seed book section 1.6.3.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> samples = np.zeros((1000, 1))
    >>> [d.shape for _, d in power_regressor_chunks(one, samples, samples, samples, size=600)]
    [(600, 14), (400, 14)]
    """
    check_model(model)
    check_size(size)
    n = model.n
    arrays = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(a, n, "a")
    _, rows = batch_rows(arrays, ("q", "v", "a"))
    check_log(rows[0].shape[0], "q, v, a")
    chosen = chosen_columns(standard_blocks(model, drive, friction), columns, model)
    fill = partial(_fill, model, chosen, friction_of(model, friction))
    return stream(fill, rows, size, (chosen.count,))


def _fill(
    model: RobotModel,
    chosen: ChosenColumns,
    friction: LinearFriction | None,
    rows: Sequence[Array],
    out: Array,
) -> None:
    from ..kernels.power_regressor import power_regressors

    power_regressors(*rows, *model.chain, model.gravity, chosen.places[LINKS], out[:, None])
    q, v, a = rows
    add_powers(model, chosen, q, v, a, friction, out)
