"""Inverse geometric models: poses to joint variables, with a status for every pose.

`inverse` documents the call, `call` checks it (`request`). `loop` writes the arm as a chain of
joints, `chain` makes other chains of it; `families` chooses once which solver serves it: a plan of
Paul's equations (`paul`, `closed_form`, `by_plan`), elimination for other arms of six joints,
calibrated ones among them (`elimination`), fewer joints or components (`reduced`, `position`), more
of them (`redundant`, `arm_angle`), numeric search for the rest and for relations of joints
(`search`). Candidates are refined and checked on the chain itself (`check`), self-motions are
completed at the reference (`singular`), and the solutions are labelled (`branches`), sorted and
held in `solutions`; `call` finds the reason where a pose has none. `numeric` is the iterative
inverse.
"""

from .. import _docs
from .inverse import igm
from .numeric import igm_numeric
from .solutions import IGMSolutions
from .status import IGMStatus

__all__ = ["IGMSolutions", "IGMStatus", "igm", "igm_numeric"]

_docs.document(__name__)
