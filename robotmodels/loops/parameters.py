"""Torque regressor and base parameters of looped robots.

Parameters
----------
q_ref : array_like, shape (n,), optional
    Posture of all joints in the assembly that is meant; it is closed at its actuated joints.
    Default: the first posture that closes at random positions of the actuated joints.
drive, columns
    As for `robotmodels.torque_regressor` of the tree, drives of passive joints included;
    ``columns`` may be base parameters.
tolerance : float
    Largest relative torque of a parameter that is not kept, between 0 and 1.

Returns
-------
ndarray, shape (..., n_a, p), or BaseParameters
    ``G^T`` times the regressor of the tree; base parameters of the tree's standard parameters.
    Given to `robotmodels.identification.fit`, they name the assembly of the log.

References
----------
W. Khalil and F. Bennis, "Symbolic calculation of the base inertial parameters of closed-loop
robots", IJRR 14(2), 1995. Book sections 1.5.2.1, 1.5.3 and 1.6.2.

Examples
--------
The inertia of a balanced parallelogram about its axes appears as one sum.

>>> from robotmodels import RobotModel
>>> from robotmodels.geometry import DHTable
>>> from robotmodels.loops import Closure
>>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
>>> tree = RobotModel.from_table(table, gravity=[0, -9.81, 0])
>>> robot = LoopedRobot(tree, [Closure("cut", (4, 5))], actuated=[0])
>>> base_parameters(robot, [1.0, 1.0, -1.0], drive=False).names
('ZZ1', 'MX1', 'MY1')
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import regressors
from .._arrays import Array, Value, as_exact, as_number, batch_rows
from ..drive import Drives, drive_kinds
from ..errors import LoopError
from ..estimation.columns import NEGLIGIBLE
from ..estimation.factor import triangles_of
from ..minimal_parameters import BaseMethod, BaseParameters
from ..minimal_parameters.numeric import TorqueColumns, residual_warning
from ..minimal_parameters.rules import EARTH, reach
from ..regressors.columns import Columns
from .closing import ClosingStatus, attempt, close, without_turns
from .constraints import checked, maps
from .dynamics import closed
from .robot import LoopedRobot, check_looped

_PIECE = 512  # samples at a time
_ROWS_A_COLUMN = 4  # rows of random motion per parameter
_NARROWER = 12  # halvings of the range of the actuated joints
_CHECKED = 40  # samples of the final check


@dataclass(frozen=True, eq=False, repr=False)
class LoopedParameters(Value, BaseParameters):
    """Base parameters of a looped robot, in the assembly of a closed posture ``q_ref`` (n,)."""

    robot: LoopedRobot = None  # type: ignore[assignment]
    q_ref: Array = None  # type: ignore[assignment]

    __repr__ = BaseParameters.__repr__  # type: ignore[assignment]

    def motion(
        self, guess: Array, q: Array, v: Array | None, a: Array | None
    ) -> tuple[Array, Array, Array, Array]:
        """Motion (N, n) of all joints from that of the actuated ones (N, n_a), and the map G."""
        v, a = (np.zeros(q.shape) if x is None else x for x in (v, a))
        return lifted(self.robot, closed(self.robot, close(self.robot, q, guess).q), v, a)

    def torque_rows(self, q: Array, v: Array, a: Array, columns: Columns) -> Array:
        """Rows (N, n, b) of the regressor at motions (N, n), zero for passive joints.

        The motion of the actuated joints counts; that of the others is where iterations start.
        """
        robot, actuated = self.robot, self.robot.actuated
        *motion, G = self.motion(q, q[:, actuated], v[:, actuated], a[:, actuated])
        W = regressors.torque_regressor(robot.tree, *motion, drive=self.drive, columns=columns)
        rows = np.zeros(W.shape)
        rows[:, actuated] = G.swapaxes(1, 2) @ W
        return rows


def lifted(
    robot: LoopedRobot, q: Array, v_a: Array, a_a: Array
) -> tuple[Array, Array, Array, Array]:
    """Motion (N, n) of all joints at closed postures, from that of the actuated ones; and G."""
    G, v_a, a_a = maps(robot, q)[0], v_a[..., None], a_a[..., None]
    v = (G @ v_a)[..., 0]
    return q, v, (G @ a_a + maps(robot, q, v)[1] @ v_a)[..., 0], G


def torque_regressor(
    robot: LoopedRobot,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    drive: Drives = True,
    columns: Columns | None = None,
) -> Array:
    """Matrix W of the inverse dynamic model: ``idm(robot, q, v, a) = W @ parameters``."""
    batch, rows = batch_rows(tuple(checked(robot, q=q, v=v, a=a)), ("q", "v", "a"))
    G = maps(robot, closed(robot, rows[0]))[0].swapaxes(1, 2)
    pieces = []
    for k in range(0, max(len(G), 1), _PIECE):
        motion = (x[k : k + _PIECE] for x in rows)
        W = regressors.torque_regressor(robot.tree, *motion, drive=drive, columns=columns)
        pieces.append(G[k : k + _PIECE] @ W)
    W = np.concatenate(pieces)
    return W.reshape(*batch, *W.shape[1:])


def base_parameters(
    robot: LoopedRobot,
    q_ref: ArrayLike | None = None,
    drive: Drives = ("Ia", "Fv", "Fc"),
    tolerance: float = 1e-10,
) -> BaseParameters:
    """Base parameters of a looped robot, numerically from ``G^T W`` on random motion.

    Khalil's choice as for the tree: earlier frames before later ones, link parameters before
    ``Ia`` before ``Fv`` and ``Fc``. There are at most as many as base parameters of the tree.
    """
    check_looped(robot)
    tolerance = as_number(tolerance, "tolerance", above=0.0, below=1.0)
    kinds, reference = drive_kinds(drive), _reference(robot, q_ref)
    maps(robot, reference)  # refuses more actuated joints than can move
    columns = TorqueColumns(robot.tree, kinds, None, tolerance)
    p, rng = len(columns.names), np.random.default_rng(0)
    count = max(_ROWS_A_COLUMN * p // max(len(robot.actuated), 1), 2)
    W = torque_regressor(robot, *_motion(robot, reference, count, rng), drive=kinds)
    # the rows of the looped robot take the place of those of its tree
    columns.__dict__["factor"] = triangles_of([W * robot.units[robot.actuated][:, None]], p)
    basis = columns.basis
    W = torque_regressor(robot, *_motion(robot, reference, _CHECKED, rng), drive=kinds)
    values = rng.normal(size=p)
    wrong = W[..., basis.kept] @ (basis.coefficients @ values) - W @ values
    error = float(np.abs(wrong).max(initial=0.0) / (np.abs(W @ values).max(initial=0.0) or 1.0))
    notes = (f"With closed loops, in the assembly of q = {reference.round(6).tolist()}.",)
    return LoopedParameters(
        robot.tree, kinds, basis.kept, basis.coefficients, BaseMethod.NUMERIC, basis.gap, None,
        tolerance, (*notes, *columns.notes, *residual_warning(error, tolerance)),
        columns.neglected(basis.coefficients), error, NEGLIGIBLE, robot, reference,
    )  # fmt: skip


def _reference(robot: LoopedRobot, q_ref: ArrayLike | None) -> Array:
    """A closed posture (n,): the given one, or the first that closes at random positions."""
    if q_ref is not None:
        q = as_exact(q_ref, (robot.n,), "q_ref")[None]
        found = close(robot, q[:, robot.actuated], q)
    else:
        spread = np.pi * robot.units[robot.actuated]
        found = close(robot, np.random.default_rng(0).uniform(-spread, spread, (200, len(spread))))
    for k in np.flatnonzero(found.status == ClosingStatus.CLOSED)[:1]:
        return found.q[k]
    raise LoopError(
        f"q_ref: {found.reason(0)} Give a posture of all joints near a regular closed one."
    )


def _motion(
    robot: LoopedRobot, reference: Array, count: int, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Random motion in the assembly of a posture, of balanced gravity and inertia; each (N, n)."""
    actuated, units = robot.actuated, robot.units[robot.actuated]
    start = np.tile(reference, (4 * count, 1))
    for narrower in range(_NARROWER):  # a range in which at least half of the postures close
        by = np.pi * 0.5**narrower * rng.uniform(-1.0, 1.0, (4 * count, len(actuated))) * units
        found, _, status = attempt(robot, reference[actuated] + by, start, True)
        q = without_turns(robot, found[status == ClosingStatus.CLOSED], reference)
        if len(q) >= 2 * count:
            break
    else:
        raise LoopError(
            f"{robot.name!r}: the loops hardly close around the posture; give another as q_ref."
        )
    G = maps(robot, q)[0]  # without the half that is nearest to dead points
    best = np.argsort(np.abs(G / robot.units[:, None]).max(axis=(1, 2)))[:count]
    rate = np.sqrt(EARTH / reach(robot.tree))
    v_a, a_a = rng.uniform(-1.0, 1.0, (2, count, len(actuated))) * units
    return lifted(robot, q[best], rate * v_a, rate**2 * a_a)[:3]
