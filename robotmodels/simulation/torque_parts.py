"""Decomposition of the torques of a motion (book sections 1.5.1.1 to 1.5.1.5).

Parameters
----------
model, q, v, a, wrench, drive, friction
    As for `idm`: q, v, a (..., n) of at least one sample.
simulation : Simulation
    Result of `simulate`.

Returns
-------
TorqueParts
    Arrays of the shape of q.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, as_vector, batch_rows
from ..drive import check_all_or_none
from ..dynamics import gravity_torque
from ..dynamics.inverse import rigid_torques, wrench_torque
from ..errors import InvalidValueError
from ..friction import Friction, check_friction
from ..friction.protocols import torque_at
from ..model import RobotModel, check_model
from .result import Simulation


@dataclass(frozen=True, slots=True, eq=False)
class TorqueParts(Frozen):
    """Parts of the joint torques of a motion; their sum is the torque of `idm`. Read-only.

    Parameters
    ----------
    inertia, coriolis, gravity, friction, wrench : ndarray, shape (..., n)
        ``M(q) a`` with rotors, ``C(q, v) v``, ``g(q)``, friction and offsets, ``J^T wrench``; N m
        or N.
    """

    inertia: Array
    coriolis: Array
    gravity: Array
    friction: Array
    wrench: Array

    @property
    def total(self) -> Array:
        """Sum of all parts, shape (..., n)."""
        return self.inertia + self.coriolis + self.gravity + self.friction + self.wrench


def torque_parts(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
    friction: Friction | None = None,
) -> TorqueParts:
    """Split the torques of a motion into inertia, Coriolis, gravity, friction and wrench.

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.robots import load
    >>> arm, state = load("rx90"), np.random.default_rng(0).normal(size=(3, 6))
    >>> bool(np.allclose(torque_parts(arm, *state).total, idm(arm, *state), atol=1e-12))
    True
    """
    check_model(model)
    check_all_or_none(drive)
    n, names = model.n, ("q", "v", "a", "wrench")
    given = zip(names, (q, v, a, np.zeros(6) if wrench is None else wrench), strict=True)
    motion = tuple(as_vector(x, 6 if name == "wrench" else n, name) for name, x in given)
    batch, rows = batch_rows(motion, names)
    if not len(rows[0]):
        raise InvalidValueError("q, v, a: the motion is empty; expected at least one sample.")
    q, v, a, w = (row.reshape(*batch, -1) for row in rows)
    still = taken = np.zeros_like(q)
    # separate calls, so that no part loses digits to a larger one
    weightless = model.with_gravity(np.zeros(3))
    inertia = rigid_torques(weightless, q, still, a)
    if drive and (drives := model.drive_matrices) is not None:
        inertia = inertia + a @ drives.rotor
        taken = drives.torque(v, None)
    if friction is not None:
        taken = taken + torque_at(check_friction(friction, n), v, q)
    coriolis, pull = rigid_torques(weightless, q, v, still), wrench_torque(model, q, w)
    return TorqueParts(inertia, coriolis, gravity_torque(model, q), taken, pull)


def simulated_torque_parts(simulation: Simulation) -> TorqueParts:
    """Split the torques of a simulated motion (N samples), with the friction of sticking joints.

    The total, (N, n), is the torque of the control.
    """
    if not isinstance(simulation, Simulation):
        got = type(simulation).__name__
        raise InvalidValueError(f"simulation: expected the result of simulate(...), got {got}.")
    model = simulation.model
    parts = torque_parts(model, simulation.q, simulation.v, simulation.a, drive=simulation.drive)
    friction = simulation.friction + (model.drive.offset if simulation.drive else 0.0)
    rest = parts.inertia, parts.coriolis, parts.gravity, friction
    # the tool's torque was a law of time: the remainder, but for rounding
    tool = simulation.tau - np.sum(rest, axis=0)
    tool[np.abs(tool) <= 1e-9 * np.sum(np.abs([simulation.tau, *rest]), axis=0)] = 0.0
    return TorqueParts(*rest, tool)
