"""Models as formulas: the direct geometric model, the Jacobian, and singular positions.

Book sections 1.2.1 and 1.3.1.3.

Parameters
----------
model : RobotModel
    The robot, n joints.
frame : str or int, optional
    Name or number of the frame whose motion it is; default the tool.
symbols : mapping of str to str, optional
    Other names of symbols, such as ``{"RL1": "l1", "C1": "c1"}``.
robot, numbers : str and FormulaNumbers
    Of explanations: the name of the robot; variables, abbreviations and constants.
text, latex : str
    Of explanations: the derivation for people; the LaTeX has the same content.
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
