"""Regressors: dynamics as a matrix times the standard parameters.

Seed book sections 1.5.2.1, 1.5.3 and 1.6.2: the dynamic model is linear in the inertial and drive
parameters. Torque, power, energy, momentum and filtered forms have the same columns
(`parameter_names`; the energy those that store it), any subset of which can be asked for, and each
has an iterator over pieces for long logs.
"""

from .columns import Columns
from .energy import energy_regressor, energy_regressor_chunks
from .energy_difference import (
    energy_difference_regressor,
    energy_difference_regressor_chunks,
    joint_work,
)
from .filtered import filtered_regressor, filtered_regressor_chunks
from .low_pass import LowPass
from .momentum import MomentumRegressors, momentum_regressor, momentum_regressor_chunks
from .names import energy_parameter_names, parameter_names, parameter_vector
from .power import power_regressor, power_regressor_chunks
from .torque import torque_regressor, torque_regressor_chunks

__all__ = [
    "Columns",
    "LowPass",
    "MomentumRegressors",
    "energy_difference_regressor",
    "energy_difference_regressor_chunks",
    "energy_parameter_names",
    "energy_regressor",
    "energy_regressor_chunks",
    "filtered_regressor",
    "filtered_regressor_chunks",
    "joint_work",
    "momentum_regressor",
    "momentum_regressor_chunks",
    "parameter_names",
    "parameter_vector",
    "power_regressor",
    "power_regressor_chunks",
    "torque_regressor",
    "torque_regressor_chunks",
]
