"""The inverse geometric model explained: the plan of Paul's method in words and formulas."""

from __future__ import annotations

from dataclasses import dataclass

from ...geometry import constant_names
from ...latex_text import markdown
from ...model import RobotModel, check_model
from ..arm_angle import prepare_arm_angle
from ..loop import JointChain, joint_chain
from ..structure import Family, plan_loop
from .plan import PaulPlan, derive_plan
from .render import render
from .steps import ExplainedStep, PlanText


@dataclass(frozen=True, slots=True, repr=False)
class InverseModelExplanation:
    """How the inverse geometric model of a robot is derived, made by `explain_igm`.

    Parameters
    ----------
    robot : str
        Its name.
    steps : tuple of ExplainedStep
        In the order in which the joints are found.
    complete : bool
        Whether Paul's method gives all joints.
    remaining : tuple of str
        Variables that it does not give.
    takes_over : str
        The method that solves the arm where Paul's stops; empty if it does not stop.
    plan : PaulPlan
        The plan that is printed, the same that the kernel runs.
    text, latex : str
        The derivation; the LaTeX says the same, as paragraphs and amsmath environments.

    Examples
    --------
    >>> from robotmodels.igm.paul import explain_igm
    >>> from robotmodels.robots import load
    >>> explain_igm(load("crx10ia")).complete
    False
    """

    robot: str
    steps: tuple[ExplainedStep, ...]
    complete: bool
    remaining: tuple[str, ...]
    takes_over: str
    plan: PaulPlan
    text: str
    latex: str

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        found = "all joints" if self.complete else f"all but {', '.join(self.remaining)}"
        return f"<InverseModelExplanation of {self.robot}: {found} by Paul's method>"

    def _repr_markdown_(self) -> str:
        """What a notebook shows."""
        return markdown(self.latex)

    def _repr_latex_(self) -> str:
        """What a notebook that becomes a LaTeX document shows."""
        return self.latex


def explain_igm(model: RobotModel) -> InverseModelExplanation:
    """Derive the inverse geometric model by Paul's method and explain it step by step.

    Notation: ``U0`` is the desired pose, its elements ``sx nx ax Px`` and so on as in eq. [1.13];
    ``sTp`` the pose of R_p in R_s. ``C1``, ``S1`` are cosine and sine of ``θ1``, ``C23`` of
    ``θ2 + θ3`` (an ``m`` before a number subtracts). ``Dj`` and ``RLj`` are d and r of row j,
    unless ``DHTable.symbols`` names them.

    Parameters
    ----------
    model : RobotModel
        The robot, any number of joints.

    Returns
    -------
    InverseModelExplanation
        Prints as the derivation; has the steps and ``.latex``.

    Raises
    ------
    InvalidValueError
        ``model`` is not a RobotModel, or no joint moves its tool.

    References
    ----------
    Book section 1.2.3.2, example 1.3 (its formula for S2 has a misprint that is put right
    here); the exercise, eq. (4.9) and (4.13), whose ``arctan(y/x)`` loses the quadrant: atan2 is
    used, and both solutions are kept.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> rx90 = explain_igm(load("rx90"))
    >>> print("; ".join(rx90.steps[2].formulas))
    θ4 = atan2(S1*ax - C1*ay, -C23*(C1*ax + S1*ay) - S23*az); θ4' = θ4 + π
    """
    check_model(model)
    chain = joint_chain(model)
    table = model.table
    own = constant_names(table.symbols)
    lengths = [
        (letter + str(j), column, j)
        for column, letter in (("d", "D"), ("r", "RL"))
        for j in range(1, table.f + 1)
    ]
    names = {
        usual: (own[usual], float(getattr(table, column)[j - 1]))
        for usual, column, j in lengths
        if usual in own
    }
    plan = derive_plan(chain, [int(table.joint_rows[c]) + 1 for c in chain.columns], names)
    words = PlanText(plan)
    steps = tuple(words.step(number, step) for number, step in enumerate(plan.steps))
    remaining = tuple(words.variable(j) for j in plan.remaining)
    takes_over = "" if plan.complete else _successor(plan.chain)
    text, latex = render(model, words, steps, takes_over)
    return InverseModelExplanation(
        model.name, steps, plan.complete, remaining, takes_over, plan, text, latex
    )


def _successor(chain: JointChain) -> str:
    """What solves an arm where Paul's method stops."""
    if chain.k > 7:
        return "locked joints (`lock` of `igm`), or the numeric solver `igm_numeric`"
    if chain.k == 7:
        if prepare_arm_angle(chain) is not None:
            return "the arm angle (`arm_angle` of `igm`), as shoulder and wrist are spherical"
        return (
            "a locked joint (`lock` of `igm`), as the arm has no arm angle: that needs seven "
            "revolute joints with a spherical shoulder and a spherical wrist"
        )
    if chain.k < 6:
        return "`igm`, which adds virtual joints to make six, or the numeric solver `igm_numeric`"
    loop = plan_loop(chain)
    if loop is None:
        return "Raghavan and Roth's elimination, up to 16 postures"
    if loop.family is Family.CONCURRENT:
        return "Pieper's method: three axes meet, and a quartic gives one of the other joints"
    return "the closed form of three parallel axes"
