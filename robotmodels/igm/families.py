"""Which family serves an arm: the order in which they are tried."""

from __future__ import annotations

from .asked import Task
from .closed_form import prepare_closed_form
from .general import GeneralArm, prepare_general
from .loop import JointChain
from .solver import Solver


def prepare_task(chain: JointChain, task: Task) -> Solver | None:
    """Choose and prepare what solves a task: locked joints, then the mask, then the arm.

    Parameters
    ----------
    chain : JointChain
        The arm.
    task : Task
        What is asked of it.

    Returns
    -------
    Solver or None
        None if no family serves the arm for this task.
    """
    return prepare(chain)


def prepare(chain: JointChain) -> Solver | None:
    """Choose the family of a chain and prepare it.

    Parameters
    ----------
    chain : JointChain
        The arm.

    Returns
    -------
    Solver or None
        None if no family serves it.

    Examples
    --------
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.robots import load
    >>> prepare(joint_chain(load("ur5e"))).method
    'three consecutive revolute axes that are parallel'
    """
    if chain.k == 6:
        closed = prepare_closed_form(chain)
        if closed is not None:
            return closed
        general = prepare_general(chain)
        if general is not None and general.reliable:
            return GeneralArm(chain, general)
    return None
