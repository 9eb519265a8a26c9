"""The plan of an arm: which equation of which type gives which joint.

Book section 1.2.3.2, eq. [1.14] to [1.17]; the exercise, steps I to IX.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod

from ...errors import InvalidValueError
from ..loop import JointChain
from .catalogue import Step, candidates, cost
from .equations import Arm
from .normal_form import NormalForm, normal_form
from .program import Program, compile_plan


@dataclass(frozen=True, slots=True, eq=False)
class PaulPlan:
    """Plan of Paul's method: steps, and the program for the kernel."""

    chain: JointChain
    form: NormalForm
    steps: tuple[Step, ...]
    solved: tuple[int, ...]
    remaining: tuple[int, ...]
    arm: Arm
    program: Program | None

    @property
    def complete(self) -> bool:
        """Whether every joint is found."""
        return not self.remaining

    @property
    def most_postures(self) -> int:
        """Product of the numbers of solutions of the steps."""
        return prod(step.type.branches for step in self.steps)


def derive_plan(
    chain: JointChain,
    frames: Sequence[int] = (),
    names: Mapping[str, tuple[str, float]] | None = None,
) -> PaulPlan:
    """Derive, by pre- and post-multiplication, which equation gives which joint of a chain.

    ``frames`` are the numbers of its frames in print (default 1 to k), ``names`` the user's
    constants by their usual name: (name, value).
    """
    if chain.k == 0:
        raise InvalidValueError("model: no joint moves its tool; there is nothing to solve.")
    everyone = range(chain.k)
    arm = Arm(normal_form(chain, frames or range(1, chain.k + 1)), names)
    joints, solved = arm.joints, []
    steps: list[Step] = []
    # more than six joints: some have to be locked first
    while chain.k <= 6 and not all(joints.knows(j) for j in everyone):
        best = _best(arm)
        if best is None:
            break
        steps.append(best)
        for number in best.unknowns:
            joints.settle(number)
        solved += [j for j in everyone if joints.knows(j) and j not in solved]
    remaining = tuple(j for j in everyone if not joints.knows(j))
    program = None if remaining else compile_plan(arm, steps)
    return PaulPlan(chain, arm.form, tuple(steps), tuple(solved), remaining, arm, program)


def _best(arm: Arm) -> Step | None:
    found = candidates(arm.equations(), arm.joints) or candidates(arm.equations(True), arm.joints)
    return min(found, key=lambda c: cost(c, arm.joints), default=None)
