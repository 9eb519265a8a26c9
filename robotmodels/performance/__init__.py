"""Performance analysis (chapter 3): accessibility, workspaces, aspects, cusps, paths, dexterity."""

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

__all__ = [
    "AccessStatus",
    "Accessibility",
    "AspectStatus",
    "Aspects",
    "CurveKind",
    "Cuspidality",
    "CuspidalityStatus",
    "DexterityMap",
    "FeasiblePath",
    "GlobalIndex",
    "PathStatus",
    "Polytope",
    "PolytopeStatus",
    "RegionStatus",
    "Regions",
    "SectionStatus",
    "SingularCurves",
    "SpecialPoints",
    "Workspace",
    "WorkspaceStatus",
    "accessibility",
    "aspects",
    "cuspidality",
    "cusps",
    "dexterity_map",
    "feasible_path",
    "free_components",
    "global_index",
    "isotropy_index",
    "nodes",
    "polytope",
    "regions",
    "singular_curves",
    "workspace",
]
