"""robotmodels: kinematics, dynamics, calibration and identification of robot manipulators.

A table of Khalil-Kleinfinger (modified Denavit-Hartenberg) parameters becomes URDF, is loaded into
Pinocchio, and gives the direct models; everything takes a `RobotModel` first. Only NumPy and
Pinocchio are imported here, the rest where it is used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from . import errors
from .drive import DriveParameters, Transmission
from .dynamics import (
    coriolis_matrix,
    ddm,
    gravity_torque,
    idm,
    kinetic_energy,
    mass_matrix,
    potential_energy,
)
from .geometry import DHTable, link_transforms
from .igm import IGMSolutions, IGMStatus, igm, igm_numeric
from .inertia import InertialParameters
from .kinematics import dgm, dkm, jacobian, jacobian_rate, link_poses
from .model import RobotModel, to_urdf, write_urdf
from .regressors import (
    energy_regressor,
    parameter_names,
    parameter_vector,
    torque_regressor,
    torque_regressor_chunks,
)
from .robots import load, robots
from .symbolic_dgm import DirectModelExplanation, explain_dgm
from .symoro import read_par
from .urdf import NamedFrame

if TYPE_CHECKING:
    from . import trajectories, viz
    from .igm.paul import InverseModelExplanation, explain_igm

__version__ = "0.1.0"

__all__ = [
    "DHTable",
    "DirectModelExplanation",
    "DriveParameters",
    "IGMSolutions",
    "IGMStatus",
    "InverseModelExplanation",
    "InertialParameters",
    "NamedFrame",
    "RobotModel",
    "Transmission",
    "coriolis_matrix",
    "ddm",
    "dgm",
    "dkm",
    "energy_regressor",
    "errors",
    "explain_dgm",
    "explain_igm",
    "gravity_torque",
    "idm",
    "igm",
    "igm_numeric",
    "jacobian",
    "jacobian_rate",
    "kinetic_energy",
    "link_poses",
    "link_transforms",
    "load",
    "mass_matrix",
    "parameter_names",
    "parameter_vector",
    "potential_energy",
    "read_par",
    "robots",
    "to_urdf",
    "torque_regressor",
    "torque_regressor_chunks",
    "trajectories",
    "viz",
    "write_urdf",
]


def __dir__() -> list[str]:
    """What is imported on demand is there as well."""
    return sorted({*globals(), *__all__})


_ON_DEMAND = {"InverseModelExplanation": ".igm.paul", "explain_igm": ".igm.paul"}


def __getattr__(name: str) -> Any:
    """Import trajectories, pictures and derivations when they are first asked for."""
    if name in ("trajectories", "viz"):
        return importlib.import_module(f".{name}", __name__)
    if name in _ON_DEMAND:
        return getattr(importlib.import_module(_ON_DEMAND[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
