"""The interface of solvers: prepared data, and one function that solves poses.

The file of a solver prepares a frozen object from a `JointChain`, before any pose is known, and
registers how poses are solved with it::

    @postures.register
    def _(solver: ClosedForm, U, references, tolerances): ...

so that code which changes the chain (a locked joint, a mask) calls `postures`
with the solver of the changed chain.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from typing import NamedTuple, Protocol

from .._arrays import Array
from .loop import JointChain
from .postures import Postures


class Tolerances(NamedTuple):
    """Largest errors with which a pose counts as met: position [m] and rotation [rad]."""

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
        """Name of the method."""
        ...


Prepare = Callable[[JointChain], "Solver | None"]
"""Chooses the solver of a chain; passed to solvers that solve another chain on the way."""


@singledispatch
def prepare_alike(known: Solver, chain: JointChain, prepare: Prepare) -> Solver | None:
    """Solver of a chain that differs from a prepared one in its numbers only.

    What was chosen and tested for the other is taken over where a solver registers how.
    """
    return prepare(chain)


@singledispatch
def postures(solver: Solver, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    """All postures of poses by a prepared solver. Shapes: U (N, 4, 4), references (N, k)."""
    raise TypeError(f"no solver is registered for {type(solver).__name__}")
