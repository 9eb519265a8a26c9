"""robotmodels: kinematics, dynamics, calibration and identification of robot manipulators.

A table of Khalil-Kleinfinger (modified Denavit-Hartenberg) parameters becomes URDF, is loaded into
Pinocchio, and gives the direct models; everything takes a `RobotModel` first. Only NumPy and
Pinocchio are imported here, the rest where it is used. "Book" and "[1.16]" in docstrings are
E. Dombre and W. Khalil (eds.), *Modeling, Performance Analysis and Control of Robot Manipulators*,
ISTE 2007, and its equation 1.16.
"""

from __future__ import annotations

import importlib
import re
import threading
from typing import TYPE_CHECKING, Any

from . import errors, friction, kinematics, regressors, se3
from .drive import DriveKind, DriveParameters, Transmission
from .dynamics import (
    base_model,
    christoffel_blocks,
    coriolis_matrix,
    ddm,
    gravity_torque,
    idm,
    idm_from_base,
    kinetic_energy,
    mass_matrix,
    potential_energy,
    with_payload,
    without_payload,
)
from .geometry import DHTable, link_transforms
from .igm import IGMSolutions, IGMStatus, igm, igm_numeric
from .inertia import InertialParameters, InertiaWarning
from .kinematics import dgm, dkm, dkm_second_order, jacobian, jacobian_rate, link_poses
from .model import RobotModel, to_urdf, write_urdf
from .regressors import (
    energy_difference_regressor,
    energy_regressor,
    filtered_regressor,
    momentum_regressor,
    parameter_names,
    parameter_vector,
    power_regressor,
    torque_regressor,
    torque_regressor_chunks,
)
from .robots import load, robots
from .urdf import NamedFrame

if TYPE_CHECKING:
    from . import (
        calibration,
        control,
        datasets,
        export,
        flexible,
        identification,
        loops,
        obstacles,
        parallel,
        performance,
        simulation,
        symbolic,
        trajectories,
        visual_servoing,
        viz,
    )
    from .igm.paul import InverseModelExplanation, explain_igm
    from .kinematics import (
        DampedInverse,
        FilteredInverse,
        IKMSolution,
        IKMStatus,
        OrientationKind,
        PseudoInverse,
        classify_singularity,
        coordinate_jacobian,
        force_ellipsoid,
        ikm,
        ikm_second_order,
        jacobian_factors,
        manipulability,
        nearest_singularity,
        operational_coordinates,
        operational_dimension,
        pose_from_coordinates,
        static_torque,
        static_wrench,
        velocity_ellipsoid,
    )
    from .minimal_parameters import (
        BaseParameters,
        BaseValues,
        StandardParameters,
        base_parameters,
        standard_parameters,
        uniform_bodies,
    )
    from .simulation import Simulation, simulate, torque_parts
    from .symbolic import (
        DirectModelExplanation,
        JacobianExplanation,
        SingularityExplanation,
        explain_dgm,
        explain_jacobian,
        explain_singularities,
    )
    from .symoro import read_par

__version__ = "0.2.0"

__all__ = [
    "BaseParameters",
    "BaseValues",
    "DHTable",
    "DampedInverse",
    "DirectModelExplanation",
    "DriveKind",
    "DriveParameters",
    "FilteredInverse",
    "IGMSolutions",
    "IGMStatus",
    "IKMSolution",
    "IKMStatus",
    "InertiaWarning",
    "InertialParameters",
    "InverseModelExplanation",
    "JacobianExplanation",
    "NamedFrame",
    "OrientationKind",
    "PseudoInverse",
    "RobotModel",
    "Simulation",
    "SingularityExplanation",
    "StandardParameters",
    "Transmission",
    "base_model",
    "base_parameters",
    "calibration",
    "christoffel_blocks",
    "classify_singularity",
    "control",
    "coordinate_jacobian",
    "coriolis_matrix",
    "datasets",
    "ddm",
    "dgm",
    "dkm",
    "dkm_second_order",
    "energy_difference_regressor",
    "energy_regressor",
    "errors",
    "explain_dgm",
    "explain_igm",
    "explain_jacobian",
    "explain_singularities",
    "export",
    "filtered_regressor",
    "flexible",
    "force_ellipsoid",
    "friction",
    "gravity_torque",
    "identification",
    "idm",
    "idm_from_base",
    "igm",
    "igm_numeric",
    "ikm",
    "ikm_second_order",
    "jacobian",
    "jacobian_factors",
    "jacobian_rate",
    "kinematics",
    "kinetic_energy",
    "link_poses",
    "link_transforms",
    "load",
    "loops",
    "manipulability",
    "mass_matrix",
    "momentum_regressor",
    "nearest_singularity",
    "obstacles",
    "operational_coordinates",
    "operational_dimension",
    "parallel",
    "parameter_names",
    "parameter_vector",
    "performance",
    "pose_from_coordinates",
    "potential_energy",
    "power_regressor",
    "read_par",
    "regressors",
    "robots",
    "se3",
    "show_versions",
    "simulate",
    "simulation",
    "standard_parameters",
    "static_torque",
    "static_wrench",
    "symbolic",
    "to_urdf",
    "torque_parts",
    "torque_regressor",
    "torque_regressor_chunks",
    "trajectories",
    "uniform_bodies",
    "velocity_ellipsoid",
    "visual_servoing",
    "viz",
    "with_payload",
    "without_payload",
    "write_urdf",
]


def show_versions() -> str:
    """Versions of the program, of Python and of its libraries, and the platform, for reports.

    Returns
    -------
    str
        One line for each.

    Examples
    --------
    >>> show_versions().splitlines()[0].split()[0]
    'robotmodels'
    """
    import platform
    from importlib.metadata import PackageNotFoundError, requires, version

    lines = [("robotmodels", __version__), ("Python", platform.python_version())]
    lines.append(("platform", platform.platform()))
    for requirement in requires("robotmodels") or ():
        name = re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        try:
            lines.append((name, version(name)))
        except PackageNotFoundError:
            if "extra ==" not in requirement:
                lines.append((name, "not installed"))
    return "\n".join(f"{name:<28}{found}" for name, found in dict(lines).items())


def __dir__() -> list[str]:
    """The public names, those that are imported on demand included."""
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})


_ROOMS = {
    ".minimal_parameters": (
        "BaseParameters BaseValues StandardParameters base_parameters standard_parameters "
        "uniform_bodies"
    ),
    ".igm.paul": "InverseModelExplanation explain_igm",
    ".kinematics": (
        "DampedInverse FilteredInverse IKMSolution IKMStatus OrientationKind PseudoInverse "
        "classify_singularity coordinate_jacobian force_ellipsoid ikm ikm_second_order "
        "jacobian_factors manipulability nearest_singularity operational_coordinates "
        "operational_dimension pose_from_coordinates static_torque static_wrench "
        "velocity_ellipsoid"
    ),
    ".simulation": "Simulation simulate torque_parts",
    ".symbolic": (
        "DirectModelExplanation JacobianExplanation SingularityExplanation explain_dgm "
        "explain_jacobian explain_singularities"
    ),
    ".symoro": "read_par",
}
_ROOM_OF = {name: room for room, names in _ROOMS.items() for name in names.split()}
# Threads that import rooms which import each other would otherwise see half of one.
_OPENING = threading.RLock()


def __getattr__(name: str) -> Any:
    """Import subpackages, pictures and derivations at their first use."""
    with _OPENING:
        if name in _ROOM_OF:
            value = getattr(importlib.import_module(_ROOM_OF[name], __name__), name)
            globals()[name] = value  # the next use is a plain attribute
            return value
        if name in __all__:
            return importlib.import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
