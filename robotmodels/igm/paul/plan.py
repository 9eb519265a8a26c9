"""The plan of an arm: which equation of which type gives which joint."""

from __future__ import annotations

from dataclasses import dataclass

from ...errors import InvalidValueError
from ...model import RobotModel
from ..loop import JointChain, joint_chain
from .catalogue import Candidate, candidates
from .equation_type import EquationType
from .equations import Arm, Split
from .expressions import Expression
from .normal_form import NormalForm, normal_form
from .program import Program, lowered


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One step of a plan.

    Parameters
    ----------
    type : EquationType
        What is solved.
    unknowns : tuple of int
        Numbers of the one or two unknowns, in the order of the type's formula.
    coefficients : tuple
        Expressions, in the order of the formula.
    splits : tuple of Split
        The matrix equation of each equation.
    elements : tuple of (int, int)
        Row and column of each equation in it; column 3 is the position.
    """

    type: EquationType
    unknowns: tuple[int, ...]
    coefficients: tuple[Expression, ...]
    splits: tuple[Split, ...]
    elements: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True, eq=False)
class PaulPlan:
    """What Paul's method finds for an arm: steps, and the program that a kernel runs.

    Parameters
    ----------
    chain : JointChain
        The joints and constants it was derived from.
    form : NormalForm
        The same as rows.
    steps : tuple of Step
        In the order in which they are solved.
    solved : tuple of int
        Joints that the steps give, counted from 0 along the chain, in order.
    remaining : tuple of int
        Joints that no equation of the catalogue gives.
    arm : Arm
        The matrices and expressions, for those who print them.
    program : Program or None
        What the kernel runs; None if joints remain.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> plan = derive_plan(load("rx90"))
    >>> [step.type.title for step in plan.steps]
    ['type 2 with Z = 0', 'type 6', 'type 2 with Z = 0', 'type 3 with ...', 'type 3 with ...']
    >>> plan.complete, plan.most_postures
    (True, 8)
    """

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


def derive_plan(model: RobotModel) -> PaulPlan:
    """Derive, by pre- and post-multiplication, which equation gives which joint.

    Parameters
    ----------
    model : RobotModel
        The robot, any number of joints.

    Returns
    -------
    PaulPlan
        Always one; where no equation of the catalogue is left it stops, and ``remaining`` has the
        joints that are not found.

    Raises
    ------
    InvalidValueError
        No joint moves the tool.

    References
    ----------
    Seed book section 1.2.3.2, eq. [1.14] to [1.17]; the exercise, steps I to IX.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> derive_plan(load("crx10ia")).remaining
    (0, 1, 2, 3, 4, 5)
    """
    chain = joint_chain(model)
    if chain.k == 0:
        raise InvalidValueError("model: no joint moves its tool; there is nothing to solve.")
    frames = tuple(int(model.table.joint_rows[c]) + 1 for c in chain.columns)
    arm = Arm(normal_form(chain, frames))
    joints, steps = arm.joints, []
    everyone = range(chain.k)
    solved: list[int] = []
    # with more joints than a pose has components nothing can be found without locking some
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
        for number in best.unknowns[: _given(best.type)]:
            joints.settle(number)
        solved += [j for j in everyone if joints.knows(j) and j not in solved]
    remaining = tuple(j for j in everyone if not joints.knows(j))
    program = None if remaining else lowered(arm, steps)
    return PaulPlan(chain, arm.form, tuple(steps), tuple(solved), remaining, arm, program)


def _best(arm: Arm) -> Candidate | None:
    for inverse in (False, True):
        found = candidates(arm.equations(inverse), arm.joints)
        if found:
            return min(found, key=lambda c: c.cost)
    return None


def _given(type_: EquationType) -> int:
    """How many unknowns a step gives."""
    single = (EquationType.POLYNOMIAL, EquationType.QUARTIC)
    return 1 if type_ in single else 2
