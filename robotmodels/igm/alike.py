"""A family prepared for a chain that differs from another in its numbers only.

What was chosen and tested for the other is taken over: no search, no self-test. Families register
how; those that do not are prepared as new.
"""

from __future__ import annotations

from functools import singledispatch

from .closed_form import ClosedForm, prepare_closed_form
from .elimination import EliminationArm, with_forms_of
from .loop import JointChain
from .solver import Prepare, Solver


@singledispatch
def prepare_alike(known: Solver, chain: JointChain, prepare: Prepare) -> Solver | None:
    """Prepare a solver for a chain of the same structure as a prepared one."""
    return prepare(chain)


@prepare_alike.register
def _(known: ClosedForm, chain: JointChain, prepare: Prepare) -> Solver | None:
    return prepare_closed_form(chain) or prepare(chain)


@prepare_alike.register
def _(known: EliminationArm, chain: JointChain, prepare: Prepare) -> Solver | None:
    return prepare_closed_form(chain) or with_forms_of(known.forms, chain)
