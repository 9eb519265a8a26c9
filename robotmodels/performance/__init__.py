"""Performance analysis (chapter 3): accessibility, workspaces, aspects, cusps, paths, dexterity.

Common parameters: ``arm``, the robot; ``limits``, whether its joint limits count; ``free``,
a function of q (N, n) that returns bool (N,), or obstacles that the links must not touch; ``mask``
(6,), the requested components of the pose, see `igm`; ``executor``, threads or processes that
compute (the results do not depend on their number); ``progress``, a function that is called with
the fraction done, or True for the log (`logging`). Wrong input raises `ShapeError` or
`InvalidValueError`, also prismatic joints without limits and resolutions that need more than 1 GB.
"""

from .. import _docs
from .accessibility import Accessibility, AccessStatus, accessibility
from .aspects import Aspects, AspectStatus, aspects, free_components
from .curves import (
    CurveKind,
    SectionStatus,
    SingularCurves,
    SpecialPoints,
    cusps,
    nodes,
    singular_curves,
)
from .cuspidality import Cuspidality, CuspidalityStatus, cuspidality
from .dexterity import DexterityMap, GlobalIndex, dexterity_map, global_index, isotropy_index
from .paths import FeasiblePath, PathStatus, feasible_path
from .polytope import Polytope, PolytopeStatus, polytope
from .regions import Regions, RegionStatus, regions
from .workspace import Workspace, WorkspaceStatus, workspace

__all__ = ["AccessStatus", "Accessibility", "accessibility"]
__all__ += ["AspectStatus", "Aspects", "aspects", "free_components"]
__all__ += ["CurveKind", "SectionStatus", "SingularCurves", "SpecialPoints"]
__all__ += ["cusps", "nodes", "singular_curves"]
__all__ += ["Cuspidality", "CuspidalityStatus", "cuspidality"]
__all__ += ["DexterityMap", "GlobalIndex", "dexterity_map", "global_index", "isotropy_index"]
__all__ += ["FeasiblePath", "PathStatus", "feasible_path"]
__all__ += ["Polytope", "PolytopeStatus", "polytope", "RegionStatus", "Regions", "regions"]
__all__ += ["Workspace", "WorkspaceStatus", "workspace"]

_docs.document(__name__)
