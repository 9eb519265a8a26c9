"""Kinematic models: poses, velocities, Jacobians, and their singular positions.

Book sections 1.2.2 and 1.3.

Parameters
----------
model : RobotModel
    The robot, n joints and f frames.
q, v, a : array_like, shape (..., n)
    Joint variables (rad or m), velocities and accelerations in table order; the leading axes are
    batch axes and broadcast against each other.
frame : str or int, optional
    Name or number (row of the table, from 1; 0 is the base) of a frame; default the tool.
reference : {"world_aligned", "local", "world"}
    Of twists and wrenches. ``"world_aligned"``: at the frame's origin, in world axes; ``"local"``:
    the same in the frame's own axes; ``"world"``: at the world's origin, in world axes.
length : float, optional
    Characteristic length, metres: linear rows of a Jacobian are divided by it, and strokes of
    prismatic joints count in it. Default the reach of the frame, `lengths.characteristic_length`.
mask : array_like, shape (6,), optional
    Ones for the components ``vx vy vz wx wy wz`` that count, or ``"position"``, ``"orientation"``;
    default all.
mask_axes : {"world", "tool"}
    Axes of the components of ``mask``: the world's, or the frame's own.
tolerance : float
    Singular values below this fraction of the largest are zero.

All functions raise `ShapeError` or `InvalidValueError` for arrays of the wrong length, NaN or
infinity and numbers out of range, and `FrameNotFoundError` for an unknown frame.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from .. import _docs
from .jacobians import Reference, jacobian, jacobian_rate
from .poses import dgm, link_poses
from .velocities import dkm, dkm_second_order

if TYPE_CHECKING:
    from ..obstacles import Plane, Sphere  # noqa: F401
    from .coordinates.conversion import *  # noqa: F403
    from .coordinates.orientations import OrientationKind  # noqa: F401
    from .coordinates.rates import *  # noqa: F403
    from .dexterity import *  # noqa: F403
    from .ellipsoid import *  # noqa: F403
    from .ellipsoids import *  # noqa: F403
    from .factors import *  # noqa: F403
    from .inverse.bounds import *  # noqa: F403
    from .inverse.criteria import *  # noqa: F403
    from .inverse.ikm import *  # noqa: F403
    from .inverse.methods import *  # noqa: F403
    from .inverse.solution import *  # noqa: F403
    from .inverse.tasks import *  # noqa: F403
    from .singular.events import SingularityKind  # noqa: F401
    from .singular.frames import *  # noqa: F403
    from .singular.nearest import *  # noqa: F403
    from .singular.rank import *  # noqa: F403
    from .singular.report import *  # noqa: F403
    from .singular.self_motion import *  # noqa: F403
    from .statics import *  # noqa: F403

_ROOMS = {
    "..obstacles": "Plane Sphere",
    ".coordinates.conversion": (
        "continuous_coordinates operational_coordinates pose_from_coordinates"
    ),
    ".coordinates.orientations": "OrientationKind",
    ".coordinates.rates": (
        "coordinate_jacobian coordinate_jacobian_rate coordinate_rates coordinate_rates_rate "
        "is_representation_singular twist_from_rates"
    ),
    ".dexterity": "Manipulability manipulability",
    ".ellipsoid": "Ellipsoid EllipsoidQuantity",
    ".ellipsoids": "OtherPart TwistPart force_ellipsoid velocity_ellipsoid",
    ".factors": "JacobianFactors jacobian_factors",
    ".inverse.bounds": "JointBounds",
    ".inverse.criteria": (
        "Criterion JointLimitCriterion ManipulabilityCriterion NearLimitCriterion "
        "ObstacleCriterion PostureCriterion"
    ),
    ".inverse.ikm": "ikm ikm_second_order",
    ".inverse.methods": "DampedInverse Damping FilteredInverse InverseMethod PseudoInverse",
    ".inverse.solution": "IKMSolution IKMStatus",
    ".inverse.tasks": (
        "DistanceTask FunctionTask JointTask LinearTask PositionTask Task TwistTask"
    ),
    ".singular.frames": "LostDirections",
    ".singular.nearest": "NearestSingularities NearestStatus SearchOutcome nearest_singularity",
    ".singular.rank": "JacobianRank OperationalDimension jacobian_rank operational_dimension",
    ".singular.report": (
        "SingularityFlags SingularityReport SingularityStatus classify_singularity "
        "singularity_flags"
    ),
    ".singular.self_motion": "SelfMotion SelfMotionKind WorkspaceSide",
    ".singular.events": "SingularityKind",
    ".statics": "StaticStatus StaticWrench static_torque static_wrench transported_wrench",
}
"""Imported when one of their names is first used: together they take 0.15 s."""

_ROOM_OF = {name: room for room, names in _ROOMS.items() for name in names.split()}

__all__ = [
    "Reference",
    "dgm",
    "dkm",
    "dkm_second_order",
    "jacobian",
    "jacobian_rate",
    "link_poses",
    *_ROOM_OF,  # pyright: ignore[reportUnsupportedDunderAll]
]

_docs.document(__name__)


def __dir__() -> list[str]:
    """Names that are imported on first use included."""
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    """Import a subpackage when one of its names is first used."""
    if name not in _ROOM_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = _docs.documented(getattr(importlib.import_module(_ROOM_OF[name], __name__), name))
    globals()[name] = value
    return value
