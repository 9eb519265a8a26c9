"""More joints than the task has components: joints take their reference until six are left.

The joint nearest to the base that moves along the infinite family of a pose takes its reference
value, then the next one that moves given those before, until six joints are left, which their own
family solves. Where no posture exists at the reference, members of the family are looked for on a
grid and walked along it to the nearest value at which one does.

Virtual joints, which stand for components that a task leaves open, are never set.

The way of a pose: `reference` locks joints at their reference (`locked_arms`) and looks for
`members` where that leaves nothing; `prepare` chose the joints of the `arm`.
"""

from .arm import Redundant
from .locked_arms import LockedArms, at_an_end, locked_postures
from .members import members
from .prepare import prepare_redundant
from .reference import postures_at_reference

__all__ = [
    "LockedArms",
    "Redundant",
    "at_an_end",
    "locked_postures",
    "members",
    "postures_at_reference",
    "prepare_redundant",
]
