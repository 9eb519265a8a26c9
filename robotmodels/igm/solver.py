"""What every family of arms is to the inverse model: prepared data, and one function that solves.

A family file prepares a frozen object from a `JointChain` (what can be known before a pose is) and
registers how poses are solved with it::

    @postures.register
    def _(solver: ClosedForm, U, references, tolerances): ...

so that rooms which change the chain (a locked joint, a mask, a calibrated neighbour) call
`postures` on whatever serves the chain they made.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import singledispatch
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .loop import JointChain


class Tolerances(NamedTuple):
    """When a pose counts as met: metres and radians, each on the length of what is missing."""

    position: float = 1e-9
    orientation: float = 1e-9


class Solver(Protocol):
    """A family prepared for one arm.

    Attributes
    ----------
    chain : JointChain
        The arm: postures are in the order of its joints.
    method : str
        The family, in words.
    """

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


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Postures of N poses, in the order of the chain, checked on the chain itself.

    Parameters
    ----------
    q : ndarray, shape (N, S, k)
        Postures, rad or m, angles in (-pi, pi]; NaN in rows without one. Packed: the rows of a
        pose that are in use come first.
    valid : ndarray of bool, shape (N, S)
        Rows in use.
    residual : ndarray, shape (N, S)
        The larger of the position error in metres and the rotation angle in radians, from a
        forward pass over the chain; NaN in rows without one.
    double : ndarray of bool, shape (N, S)
        Rows in which two postures fell together within 1e-6.
    free : ndarray of bool, shape (N, S, k)
        Joints the pose left free: they took the reference, or the nearest value at which the
        others can follow. One for each dimension of the infinite family.
    family : ndarray of bool, shape (N, S)
        Rows that belong to an infinite family (also where no joint took a reference).
    """

    q: Array
    valid: NDArray[np.bool_]
    residual: Array
    double: NDArray[np.bool_]
    free: NDArray[np.bool_]
    family: NDArray[np.bool_]


def nothing_found(N: int, S: int, k: int) -> Found:
    """No posture for any of N poses: to be filled in."""
    return Found(
        q=np.full((N, S, k), np.nan),
        valid=np.zeros((N, S), np.bool_),
        residual=np.full((N, S), np.nan),
        double=np.zeros((N, S), np.bool_),
        free=np.zeros((N, S, k), np.bool_),
        family=np.zeros((N, S), np.bool_),
    )


@singledispatch
def postures(solver: Solver, U: Array, references: Array, tolerances: Tolerances) -> Found:
    """All postures of the poses that the family knows.

    Parameters
    ----------
    solver : Solver
        A prepared family.
    U : ndarray, shape (N, 4, 4)
        Poses of the tool in R_0, ``U = D_0 M_1 D_1 ... M_k D_k``; proper transforms [m].
    references : ndarray, shape (N, k)
        Values for joints that a pose leaves free [rad or m].
    tolerances : Tolerances
        When a pose counts as met.

    Returns
    -------
    Found
        The postures.
    """
    raise TypeError(f"no family is registered for {type(solver).__name__}")
