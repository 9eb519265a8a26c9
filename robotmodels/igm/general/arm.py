"""The general six-joint arm as a family: what `prepare` chooses and `postures` serves."""

from __future__ import annotations

from dataclasses import dataclass

from ..._arrays import Array
from ..check import checked
from ..loop import JointChain
from ..self_motion import singular_postures
from ..solver import Found, Tolerances, postures
from .postures import general_postures
from .solver import GeneralSolver


@dataclass(frozen=True, slots=True, eq=False)
class GeneralArm:
    """Six-joint arm solved by elimination (Raghavan-Roth)."""

    chain: JointChain
    solver: GeneralSolver

    @property
    def method(self) -> str:
        """The family in words."""
        return "any six joints: elimination to 16 postures (Raghavan and Roth)"


@postures.register
def _(solver: GeneralArm, U: Array, references: Array, tolerances: Tolerances) -> Found:
    q, valid, double = general_postures(solver.solver, U)
    found = checked(solver.chain, U, q, valid, tolerances, double=double)
    found.family[...] = singular_postures(solver.chain, found)[1]
    return found
