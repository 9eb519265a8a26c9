"""The standard parameters: their names in the order of the regressors' columns, their values."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..drive import Drives, drive_kinds
from ..friction import Friction
from ..model import RobotModel, check_model
from .columns import (
    Columns,
    chosen_columns,
    coupled_motors,
    energy_blocks,
    friction_of,
    standard_blocks,
)


def parameter_names(
    model: RobotModel,
    drive: Drives = True,
    friction: Friction | None = None,
    columns: Columns | None = None,
) -> tuple[str, ...]:
    """Names of the standard parameters, in the order of the regressor's columns.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints.
    drive : bool or collection of DriveKind or str
        Which drive parameters are included: all, none, or kinds such as ``("Ia", "Fv", "Fc")``;
        what couples motors goes with its kind.
    friction : Friction, optional
        A friction model that is linear in its parameters, see `robotmodels.friction`.
    columns : indices, names or BaseParameters, optional
        A choice of them, as for `torque_regressor`.

    Returns
    -------
    tuple of str
        ``XX1 XY1 ... M1 XX2 ...``, then all ``Ia``, all ``Fv``, all ``Fc``, all ``offset``,
        numbered by frame; ``Iam``, ``Fvm``, ``Fcm`` of coupled motors; those of the friction model
        at the end.

    Raises
    ------
    InvalidValueError
        Friction that is not linear, or whose names the drives have already; columns that are not
        there.

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
    return chosen_columns(standard_blocks(model, drive, friction), columns, model).names


def energy_parameter_names(
    model: RobotModel, drive: Drives = True, columns: Columns | None = None
) -> tuple[str, ...]:
    """Names of the parameters that store energy, in the order of `energy_regressor`.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints.
    drive : bool or collection of DriveKind or str
        Whether the rotors are included, as for `energy_regressor`.
    columns : indices, names or BaseParameters, optional
        A choice of them.

    Returns
    -------
    tuple of str
        Those of the links, then all ``Ia``, then the ``Iam`` of coupled motors.

    Raises
    ------
    InvalidValueError
        Columns that are not there.

    References
    ----------
    Seed book section 1.5.1.2.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> energy_parameter_names(arm)[-2:]
    ('M1', 'Ia1')
    """
    check_model(model)
    return chosen_columns(energy_blocks(model, drive), columns, model).names


def parameter_vector(
    model: RobotModel, drive: Drives = True, friction: Friction | None = None
) -> Array:
    """The model's own standard parameters, in the order of `parameter_names`.

    Parameters
    ----------
    model : RobotModel
        The robot.
    drive : bool or collection of DriveKind or str
        Which drive parameters are included: all, none, or kinds such as ``("Ia", "Fv", "Fc")``;
        what couples motors goes with its kind.
    friction : Friction, optional
        A friction model that is linear in its parameters.

    Returns
    -------
    ndarray, shape (p,)
        Values such that ``torque_regressor(...) @ parameter_vector(...)`` is the torque.

    Raises
    ------
    InvalidValueError, ShapeError
        Friction that is not linear, or of another number of joints.

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
    kinds = drive_kinds(drive)
    values += [getattr(model.drive, kind.value) for kind in kinds]
    if model.transmission is not None:
        motors = np.array(coupled_motors(model), dtype=np.int64) - 1
        terms = (kind.coupling for kind in kinds if kind.coupling is not None)
        values += [getattr(model.transmission, term)[motors] for term in terms]
    if (linear := friction_of(model, friction)) is not None:
        values.append(linear.parameters.ravel())
    return np.concatenate(values)
