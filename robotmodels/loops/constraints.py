"""Constraints of cut loops on velocities: Jacobians, mobility, and the map from actuated joints.

Parameters
----------
robot : LoopedRobot
    The robot: n joints, n_a of them actuated, c constraint rows.
q, v : array_like, shape (..., n)
    Joint variables of all joints (rad or m), which close the loops, and their velocities.

Raises
------
ShapeError, InvalidValueError
    Arguments of the wrong length, or with NaN or infinity.
LoopError
    The actuated joints do not determine the motion of the others (velocity maps).

References
----------
Seed book section 2.3; W. Khalil and E. Dombre, *Modeling, Identification and Control of
Robots*, section 7.7, for the reduction of tree models by ``v = G v_a``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, Value, as_vector, batch_rows
from ..errors import LoopError
from .robot import LoopedRobot, check_looped

_DETERMINED = 1e-7
"""Least singular value of the actuated rows of an orthonormal basis of motions."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Mobility(Frozen, Value):
    """Number of independent motions of a looped robot; serves as a number or an array.

    Parameters
    ----------
    count : ndarray of int, shape (...)
        Degrees of freedom: joints less independent constraint rows.
    is_redundant : ndarray of bool, shape (..., c)
        Constraint rows that follow from others, earlier ones first kept.
    rows : tuple of str
        Names of the c rows.

    Examples
    --------
    >>> Mobility(np.array(1), np.array([False, True]), ("cut.x", "cut.z"))
    <Mobility 1, redundant rows: cut.z>
    """

    count: NDArray[np.int64]
    is_redundant: NDArray[np.bool_]
    rows: tuple[str, ...]

    @property
    def redundant(self) -> tuple[str, ...]:
        """Names of the rows that are redundant in every posture."""
        everywhere = self.is_redundant.reshape(-1, len(self.rows)).all(axis=0)
        return tuple(self.rows[k] for k in np.flatnonzero(everywhere))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.count, dtype=dtype)

    def __int__(self) -> int:
        return int(self.count)

    def __index__(self) -> int:
        return int(self.count)

    def __eq__(self, other: object) -> Any:
        return Value.__eq__(self, other) if isinstance(other, Mobility) else self.count == other

    def __hash__(self) -> int:
        return Value.__hash__(self)

    def __repr__(self) -> str:
        return f"<Mobility {self.count}, redundant rows: {', '.join(self.redundant) or 'none'}>"


def closure_jacobian(robot: LoopedRobot, q: ArrayLike) -> Array:
    """Jacobian of the closures: rows that vanish on every motion, ``J v = 0``.

    Rows are the velocity and angular velocity of the second frame of each closure relative to the
    first, in the axes of the first; see ``robot.rows`` for their names.

    Returns
    -------
    ndarray, shape (..., c, n)
        Metres or 1 for each rad/s or m/s.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.loops import Closure
    >>> from robotmodels.model import RobotModel
    >>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
    >>> robot = LoopedRobot(RobotModel.from_table(table), [Closure("cut", (4, 5))], actuated=[0])
    >>> (closure_jacobian(robot, [1.0, 1.0, -1.0]) @ [1.0, 1.0, -1.0]).round(12) + 0.0
    array([0., 0., 0., 0., 0.])
    """
    return jacobians(robot, q)[1]


def mobility(robot: LoopedRobot, q: ArrayLike) -> Mobility:
    """Mobility: number of independent motions of a posture, with the redundant rows named.

    Returns
    -------
    Mobility
        ``int(...)`` or ``np.asarray(...)`` is the count, shape (...); ``.redundant`` has the names
        of constraint rows that follow from others.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.loops import Closure
    >>> from robotmodels.model import RobotModel
    >>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
    >>> robot = LoopedRobot(RobotModel.from_table(table), [Closure("cut", (4, 5))], actuated=[0])
    >>> mobility(robot, [1.0, 1.0, -1.0])
    <Mobility 1, redundant rows: cut.z, cut.rx, cut.ry>
    """
    q = checked(robot, q=q)[0]
    redundant = _bases(robot, q, q)[2]
    count = robot.n - (~redundant).sum(axis=-1)
    return Mobility(np.asarray(count, np.int64), redundant, robot.rows)


def velocity_map(robot: LoopedRobot, q: ArrayLike) -> Array:
    """Map G from velocities of the actuated joints to those of all joints, ``v = G v_a``.

    Returns
    -------
    ndarray, shape (..., n, n_a)
        The rows of the actuated joints are the identity.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.loops import Closure
    >>> from robotmodels.model import RobotModel
    >>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
    >>> robot = LoopedRobot(RobotModel.from_table(table), [Closure("cut", (4, 5))], actuated=[0])
    >>> velocity_map(robot, [1.0, 1.0, -1.0]).round(12).T
    array([[ 1.,  1., -1.]])
    """
    q = checked(robot, q=q)[0]
    return maps(robot, q, np.zeros_like(q))[0]


def velocity_map_rate(robot: LoopedRobot, q: ArrayLike, v: ArrayLike) -> Array:
    """Time derivative of the velocity map, so that ``a = G a_a + dG/dt v_a``.

    Returns
    -------
    ndarray, shape (..., n, n_a)
        The rows of the actuated joints are zero.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.loops import Closure
    >>> from robotmodels.model import RobotModel
    >>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
    >>> robot = LoopedRobot(RobotModel.from_table(table), [Closure("cut", (4, 5))], actuated=[0])
    >>> velocity_map_rate(robot, [1.0, 1.0, -1.0], [1.0, 1.0, -1.0]).round(12).T + 0.0
    array([[0., 0., 0.]])
    """
    return maps(robot, *checked(robot, q=q, v=v))[1]


def checked(robot: LoopedRobot, **vectors: ArrayLike) -> list[Array]:
    """Joint vectors of all joints as arrays (..., n)."""
    check_looped(robot)
    return [as_vector(value, robot.n, name) for name, value in vectors.items()]


def jacobians(robot: LoopedRobot, q: ArrayLike, v: ArrayLike | None = None) -> list[Array]:
    """Residuals (..., c) of the closures, their Jacobian and its rate (..., c, n)."""
    from .kernels import closure_jacobians

    (q,) = checked(robot, q=q)
    v = np.zeros_like(q) if v is None else as_vector(v, robot.n, "v")
    batch, rows = batch_rows((q, v), ("q", "v"))
    N, c, n = len(rows[0]), len(robot.rows), robot.n
    out = [np.empty((N, c)), np.empty((N, c, n)), np.empty((N, c, n))]
    closure_jacobians(*rows, robot.tree.chain, robot.cuts, *out)
    return [array.reshape(*batch, *array.shape[1:]) for array in out]


def _bases(robot: LoopedRobot, q: Array, v: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Basis of motions and its rate (..., n, n), redundant rows (..., c)."""
    from .kernels import motion_bases

    batch, rows = batch_rows((q, v), ("q", "v"))
    N, c, n = len(rows[0]), len(robot.rows), robot.n
    Z, B, redundant = np.empty((N, n, n)), np.empty((N, n, n)), np.empty((N, c))
    motion_bases(*rows, robot.tree.chain, robot.cuts, Z, B, redundant)
    is_redundant = (redundant > 0.0).reshape(*batch, c)
    return Z.reshape(*batch, n, n), B.reshape(*batch, n, n), is_redundant


def maps(robot: LoopedRobot, q: Array, v: Array) -> tuple[Array, Array]:
    """Velocity map and its rate, each (..., n, n_a)."""
    Z, B, redundant = _bases(robot, q, v)
    n, actuated = robot.n, robot.actuated
    m = len(actuated)
    batch = Z.shape[:-2]
    count = (n - (~redundant).sum(axis=-1)).reshape(-1)
    Z, B = Z[..., :m].reshape(-1, n, m), B[..., :m].reshape(-1, n, m)
    units = robot.cuts.units
    for i in np.flatnonzero(count != m)[:1]:
        raise _undetermined(robot, int(i), batch, f"{count[i]} independent motions")
    A = Z[:, actuated]
    least = np.linalg.svd(A / units[actuated][:, None], compute_uv=False).min(axis=-1, initial=1.0)
    for i in np.flatnonzero(least < _DETERMINED)[:1]:
        words = "a motion in which no actuated joint moves"
        raise _undetermined(robot, int(i), batch, words)
    both = np.linalg.solve(A.swapaxes(1, 2), np.concatenate((Z, B), axis=1).swapaxes(1, 2))
    G = np.array(both[..., :n].swapaxes(1, 2), np.float64)
    rate = np.array(both[..., n:].swapaxes(1, 2), np.float64)
    G[:, actuated] = np.eye(m)
    rate = rate - G @ rate[:, actuated]
    rate[:, actuated] = 0.0
    return G.reshape(*batch, n, m), rate.reshape(*batch, n, m)


def _undetermined(robot: LoopedRobot, i: int, batch: tuple[int, ...], has: str) -> LoopError:
    where = f" in sample {i}" if batch else ""
    return LoopError(
        f"{robot.name!r} has {has}{where}, and {len(robot.actuated)} actuated joints "
        f"{robot.actuated.tolist()}, which do not determine the others there. Check the posture "
        "(a dead point, or loops that are open: see close), the closures (see mobility) and "
        "actuated=."
    )
