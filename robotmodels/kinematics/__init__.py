"""Kinematic models: poses, velocities, Jacobians, and what becomes of them near singular positions.

Seed book sections 1.2.2 and 1.3. What most calls need is imported here, the rest when it is first
asked for.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from .jacobians import Reference, jacobian, jacobian_rate
from .poses import dgm, link_poses
from .velocities import dkm, dkm_second_order

if TYPE_CHECKING:
    from .coordinates import (
        OrientationKind,
        continuous_coordinates,
        coordinate_jacobian,
        coordinate_jacobian_rate,
        coordinate_rates,
        coordinate_rates_rate,
        is_representation_singular,
        operational_coordinates,
        pose_from_coordinates,
        twist_from_rates,
    )
    from .dexterity import Manipulability, manipulability
    from .ellipsoid import Ellipsoid, EllipsoidQuantity
    from .ellipsoids import OtherPart, TwistPart, force_ellipsoid, velocity_ellipsoid
    from .equilibrium import StaticStatus, StaticWrench, static_wrench
    from .factors import JacobianFactors, jacobian_factors
    from .inverse import (
        Criterion,
        DampedInverse,
        Damping,
        DistanceTask,
        FilteredInverse,
        FunctionTask,
        IKMSolution,
        IKMStatus,
        InverseMethod,
        JointBounds,
        JointLimitCriterion,
        JointTask,
        LinearTask,
        ManipulabilityCriterion,
        NearLimitCriterion,
        ObstacleCriterion,
        Plane,
        PositionTask,
        PostureCriterion,
        PseudoInverse,
        Sphere,
        Task,
        TwistTask,
        ikm,
        ikm_second_order,
    )
    from .singular import (
        JacobianRank,
        LostDirections,
        NearestSingularities,
        NearestStatus,
        OperationalDimension,
        SearchOutcome,
        SelfMotion,
        SelfMotionKind,
        SingularityFlags,
        SingularityReport,
        SingularityStatus,
        WorkspaceSide,
        classify_singularity,
        jacobian_rank,
        nearest_singularity,
        operational_dimension,
        singularity_flags,
    )
    from .singularity_kind import SingularityKind
    from .statics import static_torque, transported_wrench

__all__ = [
    "Criterion",
    "DampedInverse",
    "Damping",
    "DistanceTask",
    "Ellipsoid",
    "EllipsoidQuantity",
    "FilteredInverse",
    "FunctionTask",
    "IKMSolution",
    "IKMStatus",
    "InverseMethod",
    "JacobianFactors",
    "JacobianRank",
    "JointBounds",
    "JointLimitCriterion",
    "JointTask",
    "LinearTask",
    "LostDirections",
    "Manipulability",
    "ManipulabilityCriterion",
    "NearLimitCriterion",
    "NearestSingularities",
    "NearestStatus",
    "ObstacleCriterion",
    "OperationalDimension",
    "OrientationKind",
    "OtherPart",
    "Plane",
    "PositionTask",
    "PostureCriterion",
    "PseudoInverse",
    "Reference",
    "SearchOutcome",
    "SelfMotion",
    "SelfMotionKind",
    "SingularityFlags",
    "SingularityKind",
    "SingularityReport",
    "SingularityStatus",
    "Sphere",
    "StaticStatus",
    "StaticWrench",
    "Task",
    "TwistPart",
    "TwistTask",
    "WorkspaceSide",
    "classify_singularity",
    "continuous_coordinates",
    "coordinate_jacobian",
    "coordinate_jacobian_rate",
    "coordinate_rates",
    "coordinate_rates_rate",
    "dgm",
    "dkm",
    "dkm_second_order",
    "force_ellipsoid",
    "ikm",
    "ikm_second_order",
    "is_representation_singular",
    "jacobian",
    "jacobian_factors",
    "jacobian_rank",
    "jacobian_rate",
    "link_poses",
    "manipulability",
    "nearest_singularity",
    "operational_coordinates",
    "operational_dimension",
    "pose_from_coordinates",
    "singularity_flags",
    "static_torque",
    "static_wrench",
    "transported_wrench",
    "twist_from_rates",
    "velocity_ellipsoid",
]

_ROOMS = {
    ".coordinates": (
        "OrientationKind",
        "continuous_coordinates",
        "coordinate_jacobian",
        "coordinate_jacobian_rate",
        "coordinate_rates",
        "coordinate_rates_rate",
        "is_representation_singular",
        "operational_coordinates",
        "pose_from_coordinates",
        "twist_from_rates",
    ),
    ".ellipsoid": (
        "Ellipsoid",
        "EllipsoidQuantity",
    ),
    ".ellipsoids": (
        "OtherPart",
        "TwistPart",
        "force_ellipsoid",
        "velocity_ellipsoid",
    ),
    ".factors": (
        "JacobianFactors",
        "jacobian_factors",
    ),
    ".inverse": (
        "Criterion",
        "DampedInverse",
        "Damping",
        "DistanceTask",
        "FilteredInverse",
        "FunctionTask",
        "IKMSolution",
        "IKMStatus",
        "InverseMethod",
        "JointBounds",
        "JointLimitCriterion",
        "JointTask",
        "LinearTask",
        "ManipulabilityCriterion",
        "NearLimitCriterion",
        "ObstacleCriterion",
        "Plane",
        "PositionTask",
        "PostureCriterion",
        "PseudoInverse",
        "Sphere",
        "Task",
        "TwistTask",
        "ikm",
        "ikm_second_order",
    ),
    ".dexterity": (
        "Manipulability",
        "manipulability",
    ),
    ".singular": (
        "JacobianRank",
        "LostDirections",
        "NearestSingularities",
        "NearestStatus",
        "OperationalDimension",
        "SearchOutcome",
        "SelfMotion",
        "SelfMotionKind",
        "SingularityFlags",
        "SingularityReport",
        "SingularityStatus",
        "WorkspaceSide",
        "classify_singularity",
        "jacobian_rank",
        "nearest_singularity",
        "operational_dimension",
        "singularity_flags",
    ),
    ".singularity_kind": ("SingularityKind",),
    ".equilibrium": (
        "StaticStatus",
        "StaticWrench",
        "static_wrench",
    ),
    ".statics": (
        "static_torque",
        "transported_wrench",
    ),
}
_ROOM_OF = {name: room for room, names in _ROOMS.items() for name in names}


def __dir__() -> list[str]:
    """What is imported on demand is there as well."""
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    """Import a room when one of its names is first asked for."""
    if name in _ROOM_OF:
        return getattr(importlib.import_module(_ROOM_OF[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
