"""The Jacobian and its singular positions as formulas.

Seed book section 1.3.1.3.
"""

from .explain_jacobian import explain_jacobian
from .explain_singularities import explain_singularities
from .jacobian_explanation import JacobianExplanation
from .singularity_explanation import (
    FormulaStatus,
    SingularityCondition,
    SingularityExplanation,
    SingularityFactor,
)
from .singularity_map import SingularityMap, singularity_map

__all__ = [
    "FormulaStatus",
    "JacobianExplanation",
    "SingularityCondition",
    "SingularityExplanation",
    "SingularityFactor",
    "SingularityMap",
    "explain_jacobian",
    "explain_singularities",
    "singularity_map",
]
