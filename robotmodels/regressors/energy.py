"""Energy regressor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows
from ..drive import Drives
from ..model import RobotModel, check_model
from .chunks import check_log, check_size, stream
from .columns import LINKS, ChosenColumns, Columns, chosen_columns, energy_blocks
from .drives import add_rotor_energies


def energy_regressor(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    drive: Drives = True,
    columns: Columns | None = None,
) -> Array:
    """Row of the total energy: kinetic plus potential energy is the row times the parameters.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; the leading axes broadcast.
        An empty batch gives an empty result.
    drive : bool or collection of DriveKind or str
        Whether the columns of the rotor inertias, ``v^2 / 2`` (and those of coupled motors), are
        included: True, or kinds with ``"Ia"`` among them. Friction is no energy.
    columns : indices, names, mask or BaseParameters, optional
        A choice of the columns. Base parameters without friction and offsets, such as
        ``base_parameters(model, drive=("Ia",))``, give the energy but for a constant.

    Returns
    -------
    ndarray, shape (..., 10 f + n)
        Columns as `energy_parameter_names`: as `parameter_names` up to ``Ia`` (10 f without
        drives), then one more for the ``Iam`` of each coupled motor.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity; columns that are not there.

    See Also
    --------
    energy_difference_regressor : with the work of friction, for identification.

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
    arrays = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    batch, rows = batch_rows(arrays, ("q", "v"))
    chosen = chosen_columns(energy_blocks(model, drive), columns, model)
    out = np.empty((rows[0].shape[0], chosen.count))
    fill_energies(model, chosen, rows, out)
    return out.reshape(*batch, chosen.count)


def energy_regressor_chunks(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    drive: Drives = True,
    size: int = 1024,
    columns: Columns | None = None,
) -> Iterator[tuple[slice, Array]]:
    """The energy regressor of many samples, a piece at a time in one reused buffer.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v : array_like, shape (N, n)
        Joint variables (rad or m) and velocities.
    drive : bool or collection of DriveKind or str
        Whether the columns of the rotor inertias are included, as for `energy_regressor`.
    size : int
        Samples in a piece.
    columns
        As for `energy_regressor`.

    Yields
    ------
    rows : slice
        Which samples the piece is for.
    h : ndarray, shape (k, p)
        Their rows. The next piece overwrites them.

    Raises
    ------
    ShapeError, InvalidValueError
        As `energy_regressor`, ``size`` below 1, or a log without samples.

    References
    ----------
    Seed book section 1.5.1.2.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> samples = np.zeros((1000, 1))
    >>> [h.shape for _, h in energy_regressor_chunks(one, samples, samples, size=600)]
    [(600, 11), (400, 11)]
    """
    check_model(model)
    check_size(size)
    arrays = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    _, rows = batch_rows(arrays, ("q", "v"))
    check_log(rows[0].shape[0])
    chosen = chosen_columns(energy_blocks(model, drive), columns, model)
    return stream(partial(fill_energies, model, chosen), rows, size, (chosen.count,))


def fill_energies(
    model: RobotModel, chosen: ChosenColumns, rows: Sequence[Array], out: Array
) -> None:
    """Write the energies of the samples ``(q, v)`` into ``out (N, c)``, zero elsewhere."""
    from ..kernels.energy_regressor import energy_regressors

    energy_regressors(*rows, *model.chain, model.gravity, chosen.places[LINKS], out[:, None])
    add_rotor_energies(model, chosen, rows[1], out)
