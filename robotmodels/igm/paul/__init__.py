"""Paul's method: which equation of which type gives which joint, derived from the table.

`derive_plan` finds the equations, one kernel solves them, `explain_igm` prints them.
"""

from .explain import ExplainedStep, InverseModelExplanation, explain_igm
from .plan import PaulPlan, derive_plan

__all__ = ["ExplainedStep", "InverseModelExplanation", "PaulPlan", "derive_plan", "explain_igm"]
