"""The direct geometric model as formulas: `explain_dgm`."""

from .derive import explain_dgm
from .result import DirectModelExplanation, SymbolicTransform

__all__ = ["DirectModelExplanation", "SymbolicTransform", "explain_dgm"]
