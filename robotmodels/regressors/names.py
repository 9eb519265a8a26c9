"""The standard parameters: their names in the order of the regressors' columns, their values.

Book sections 1.5.1.2 and 1.5.2.1.

Parameters
----------
model, drive, friction, columns
    As for `torque_regressor`.
"""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..drive import Drives, drive_kinds
from ..friction import Friction
from ..model import RobotModel, check_model
from .columns import Columns, chosen_columns, energy_blocks, friction_of, standard_blocks


def parameter_names(
    model: RobotModel,
    drive: Drives = True,
    friction: Friction | None = None,
    columns: Columns | None = None,
) -> tuple[str, ...]:
    """Names of the standard parameters, in the order of the columns of `torque_regressor`.

    Returns
    -------
    tuple of str
        ``XX1 XY1 ... M1 XX2 ...``, then all ``Ia``, all ``Fv``, all ``Fc``, all ``offset``,
        numbered by frame; ``Iam``, ``Fvm``, ``Fcm`` of coupled motors; those of the friction model.

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
    """Names of the parameters that store energy, in the order of the columns of `energy_regressor`.

    Returns
    -------
    tuple of str
        Those of the links, then all ``Ia``, then the ``Iam`` of coupled motors.

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
    """The model's own standard parameters: ``torque_regressor(...) @ parameter_vector(...)``.

    Returns
    -------
    ndarray, shape (p,)
        In the order of `parameter_names`.

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
        motors = np.array(model.transmission.coupled_motors, dtype=np.int64) - 1
        terms = (kind.coupling for kind in kinds if kind.coupling is not None)
        values += [getattr(model.transmission, term)[motors] for term in terms]
    if (linear := friction_of(model, friction)) is not None:
        values.append(linear.parameters.ravel())
    return np.concatenate(values)
