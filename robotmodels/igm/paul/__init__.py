"""Paul's method: which equation of which type gives which joint, derived from the table.

`derive_plan` finds the equations, `paul_postures` runs them, `explain_igm` prints them.
"""

from .plan import PaulPlan, derive_plan
from .postures import PaulPostures, paul_postures

__all__ = ["PaulPlan", "PaulPostures", "derive_plan", "paul_postures"]
