"""Regressors: the dynamic model as a matrix times the standard parameters.

Book sections 1.5.1.2, 1.5.2.1, 1.5.3 and 1.6.2: the dynamic model is linear in the inertial
and drive parameters. Torque, power, momentum and filtered forms have the columns of
`parameter_names`, the energy those of `energy_parameter_names`; `chunked` goes through long logs in
pieces of bounded size. The arguments of all are those of `torque_regressor`.
"""

from .. import _docs
from .chunks import chunked
from .columns import Columns
from .energy import (
    energy_difference_regressor,
    energy_regressor,
    joint_work,
    power_regressor,
)
from .momentum import (
    MomentumRegressors,
    filtered_regressor,
    filtered_torque,
    momentum_regressor,
)
from .names import energy_parameter_names, parameter_names, parameter_vector
from .torque import torque_regressor, torque_regressor_chunks

__all__ = [
    "Columns",
    "MomentumRegressors",
    "chunked",
    "energy_difference_regressor",
    "energy_parameter_names",
    "energy_regressor",
    "filtered_regressor",
    "filtered_torque",
    "joint_work",
    "momentum_regressor",
    "parameter_names",
    "parameter_vector",
    "power_regressor",
    "torque_regressor",
    "torque_regressor_chunks",
]

_docs.document(__name__)
