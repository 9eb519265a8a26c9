"""Models as formulas: the direct geometric model, the Jacobian, and singular positions.

Seed book sections 1.2.1 and 1.3.1.3.
"""

from .. import _docs
from .dgm import DirectModelExplanation, SymbolicTransform, explain_dgm
from .factor import SingularityFactor
from .jacobian import JacobianExplanation, explain_jacobian
from .singularities import explain_singularities
from .singularity_explanation import FormulaStatus, SingularityCondition, SingularityExplanation
from .singularity_map import SingularityMap, singularity_map

__all__ = [
    "DirectModelExplanation",
    "FormulaStatus",
    "JacobianExplanation",
    "SingularityCondition",
    "SingularityExplanation",
    "SingularityFactor",
    "SingularityMap",
    "SymbolicTransform",
    "explain_dgm",
    "explain_jacobian",
    "explain_singularities",
    "singularity_map",
]

_docs.document(__name__)
