"""The plan of an arm: which equation of which type gives which joint.

Book section 1.2.3.2, eq. [1.14] to [1.17]; the exercise, steps I to IX.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...errors import InvalidValueError
from ..loop import JointChain
from .catalogue import Candidate, candidates, cost
from .equations import Arm
from .normal_form import NormalForm, normal_form
from .program import Program, Step, compile_plan


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
        most = 1
        for step in self.steps:
            most *= step.type.branches
        return most


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
    arm = Arm(normal_form(chain, tuple(frames) or tuple(range(1, chain.k + 1))), names)
    joints, steps = arm.joints, []
    everyone = range(chain.k)
    solved: list[int] = []
    # more than six joints: some have to be locked first
    while chain.k <= 6 and not all(joints.knows(j) for j in everyone):
        best = _best(arm)
        if best is None:
            break
        steps.append(
            Step(
                best.type, best.unknowns, best.coefficients,
                tuple(e.split for e in best.equations),
                tuple((e.row, e.column) for e in best.equations),
            )
        )  # fmt: skip
        for number in best.unknowns:
            joints.settle(number)
        solved += [j for j in everyone if joints.knows(j) and j not in solved]
    remaining = tuple(j for j in everyone if not joints.knows(j))
    program = None if remaining else compile_plan(arm, steps)
    return PaulPlan(chain, arm.form, tuple(steps), tuple(solved), remaining, arm, program)


def _best(arm: Arm) -> Candidate | None:
    for inverse in (False, True):
        found = candidates(arm.equations(inverse), arm.joints)
        if found:
            return min(found, key=lambda c: cost(c, arm.joints))
    return None
