"""Performance analysis (chapter 3): accessibility, workspaces, aspects, cusps, paths, dexterity.

Terms that come back: ``limits`` (whether joint limits count), ``free`` (a function of q (N, n)
that returns bool (N,), or obstacles), ``mask`` (six 0/1 for x y z rx ry rz), ``length`` (metres
that count as much as a radian). The section of an arm whose position three joints determine is
half a plane through its first axis, or a plane across it if that joint slides; of two joints that
move the tool in a plane it is that plane.
"""

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
