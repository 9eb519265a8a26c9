"""Inverse geometric models: poses to joint variables, with a status for every pose.

The way of a pose: `inverse` reads the call, and `call` the mask, limits and references (`asked`).
`loop` writes the arm as a chain of joints; `families` chooses once what solves it (a `solver`):
a plan of Paul's equations (`paul`, `closed_form`, `by_plan`), three prismatic joints
(`prismatic`), any six joints (`general`) or the nominal arm next to them (`nominal`), fewer
joints than the task asks for (`fewer`), more of them (`redundant`, `arm_angle`, `mask`). Its
candidate postures are improved and checked on the chain itself (`check`), infinite families come
to rest at the references (`self_motion`), and the postures are labelled (`branches`), sorted and
held in `solutions`; a pose without any is told `why`. `numeric` is the iterative inverse.
"""

from .inverse import igm
from .numeric import igm_numeric
from .solutions import IGMSolutions
from .status import IGMStatus

__all__ = [
    "IGMSolutions",
    "IGMStatus",
    "igm",
    "igm_numeric",
]
