"""Paul's method: which equation of which type gives which joint, derived from the table.

`derive_plan` finds the equations, `paul_postures` runs them, `explain_igm` prints them.
"""

from .explain import ExplainedStep, InverseModelExplanation, explain_igm
from .plan import PaulPlan, derive_plan
from .postures import PaulPostures, paul_postures

__all__ = [
    "ExplainedStep",
    "InverseModelExplanation",
    "PaulPlan",
    "PaulPostures",
    "derive_plan",
    "explain_igm",
    "paul_postures",
]
