"""What every family of arms is to the inverse model: prepared data, and one function that solves.

A family file prepares a frozen object from a `JointChain` (what can be known before a pose is) and
registers how poses are solved with it::

    @postures.register
    def _(solver: ClosedForm, U, references, tolerances): ...

so that rooms which change the chain (a locked joint, a mask, a calibrated arm) call
`postures` on whatever serves the chain they made.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from typing import NamedTuple, Protocol

from .._arrays import Array
from .loop import JointChain
from .postures import Postures, no_postures


class Tolerances(NamedTuple):
    """When a pose counts as met: metres and radians, each on the length of what is missing."""

    position: float = 1e-9
    orientation: float = 1e-9


class Solver(Protocol):
    """Solver prepared for one arm."""

    @property
    def chain(self) -> JointChain:
        """The arm that is solved."""
        ...

    @property
    def method(self) -> str:
        """The family, in words."""
        ...


Prepare = Callable[[JointChain], "Solver | None"]
"""Chooses the family of a chain; handed to families that solve another chain on the way."""


Found = Postures
nothing_found = no_postures


@singledispatch
def postures(solver: Solver, U: Array, references: Array, tolerances: Tolerances) -> Found:
    """All postures of poses by a prepared solver. Shapes: U (N, 4, 4), references (N, k)."""
    raise TypeError(f"no family is registered for {type(solver).__name__}")
