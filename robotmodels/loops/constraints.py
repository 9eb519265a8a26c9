"""Constraints of cut loops on velocities: Jacobians, mobility, and the map from actuated joints.

Returns
-------
ndarray or Mobility
    Each function states its shape.

References
----------
Book section 2.3; W. Khalil and E. Dombre, *Modeling, Identification and Control of
Robots*, section 7.7, for the reduction of tree models by ``v = G v_a``.

Examples
--------
A parallelogram: two cranks on the base, a coupler on the first one that meets the second.

>>> from robotmodels.geometry import DHTable
>>> from robotmodels.loops import Closure
>>> from robotmodels.model import RobotModel
>>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
>>> robot = LoopedRobot(RobotModel.from_table(table), [Closure("cut", (4, 5))], actuated=[0])
>>> q = v = [1.0, 1.0, -1.0]
>>> closure_jacobian(robot, q).shape, mobility(robot, q)
((5, 3), <Mobility 1, redundant rows: cut.z, cut.rx, cut.ry>)
>>> velocity_map(robot, q).T.round(12), velocity_map_rate(robot, q, v).T.round(12) + 0.0
(array([[ 1.,  1., -1.]]), array([[0., 0., 0.]]))
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, Frozen, Value, as_vector, batch_rows, batch_shape
from ..errors import LoopError
from ..kinematics import dgm, jacobian, jacobian_rate
from .robot import ROWS, LoopedRobot, check_looped, scaled

_INDEPENDENT = 1e-8  # least part of an independent row beyond those before it, of the longest row
_DETERMINED = 1e-7  # least singular value of the passive columns, with lengths in robot sizes
_CONSISTENT = 1e-5  # largest velocity between the frames of a closure, in the same units


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Mobility(Frozen, Value):
    """Number of independent motions of a looped robot; serves as a number or an array.

    ``count`` (...) are the degrees of freedom, joints less independent constraint rows;
    ``is_redundant`` (..., c) the ``rows`` that follow from others, earlier ones first kept.
    """

    count: NDArray[np.int64]
    is_redundant: NDArray[np.bool_]
    rows: tuple[str, ...]

    @property
    def redundant(self) -> tuple[str, ...]:
        """Names of the rows that are redundant in every posture; none of no postures."""
        flat = self.is_redundant.reshape(-1, len(self.rows)) if self.is_redundant.size else []
        return tuple(self.rows[k] for k in np.flatnonzero(np.all(flat, axis=0) & (len(flat) > 0)))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.count, dtype=dtype)

    def __index__(self) -> int:
        return int(self.count)

    def __eq__(self, other: object) -> Any:
        return Value.__eq__(self, other) if isinstance(other, Mobility) else self.count == other

    def __hash__(self) -> int:
        return Value.__hash__(self)

    def __repr__(self) -> str:
        return f"<Mobility {self.count}, redundant rows: {', '.join(self.redundant) or 'none'}>"


def closure_jacobian(robot: LoopedRobot, q: ArrayLike) -> Array:
    """Jacobian (..., c, n) of the closures: rows that vanish on every motion, ``J v = 0``.

    Rows are the velocity and angular velocity of the second frame of each closure relative to the
    first, in the axes of the first, m or 1; see ``robot.rows`` for their names.
    """
    return closure_rows(robot, *checked(robot, q=q))[1]


def mobility(robot: LoopedRobot, q: ArrayLike) -> Mobility:
    """Mobility: number of independent motions of a posture, with the redundant rows named."""
    (q,) = checked(robot, q=q)
    J = scaled(robot, closure_rows(robot, q)[1])
    least = _INDEPENDENT * np.linalg.norm(J, axis=-1).max(axis=-1, initial=0.0)
    ranks = [np.linalg.matrix_rank(J[..., :k, :], least) for k in range(1, len(robot.rows) + 1)]
    ranks = np.stack([np.zeros(q.shape[:-1], np.int64), *ranks], axis=-1)
    redundant = np.diff(ranks, axis=-1) == 0
    return Mobility(np.asarray(robot.n - ranks[..., -1]), redundant, robot.rows)


def velocity_map(robot: LoopedRobot, q: ArrayLike) -> Array:
    """Map G (..., n, n_a) from velocities of the actuated joints to those of all, ``v = G v_a``."""
    return maps(robot, *checked(robot, q=q))[0]


def velocity_map_rate(robot: LoopedRobot, q: ArrayLike, v: ArrayLike) -> Array:
    """Time derivative (..., n, n_a) of the velocity map, so that ``a = G a_a + dG/dt v_a``."""
    return maps(robot, *checked(robot, q=q, v=v))[1]


def checked(robot: LoopedRobot, **vectors: ArrayLike) -> list[Array]:
    """Joint vectors of all joints as arrays (..., n)."""
    check_looped(robot)
    return [as_vector(value, robot.n, name) for name, value in vectors.items()]


def closure_rows(robot: LoopedRobot, q: Array) -> tuple[Array, Array]:
    """Residuals (..., c) of the closures and their Jacobian (..., c, n) at q (..., n)."""
    from .kernels import closure_jacobians

    batch, (rows,) = batch_rows((q,), ("q",))
    e, J = np.empty((len(rows), len(robot.rows))), np.empty((len(rows), len(robot.rows), robot.n))
    closure_jacobians(rows, robot.cuts, e, J)
    return e.reshape(*batch, *e.shape[1:]), J.reshape(*batch, *J.shape[1:])


def row_rates(robot: LoopedRobot, q: Array, v: Array) -> Array:
    """Time derivative of the Jacobian of the closures (..., c, n) at q, v (..., n)."""
    tree, rates = robot.tree, [np.empty((*batch_shape((q, v), ("q", "v")), 0, robot.n))]
    for closure in robot.closures:
        ends = closure.frames[::-1]
        B, A = (jacobian(tree, q, frame) @ v[..., None] for frame in ends)
        # twists of the joints relative to the first frame, at the world's origin, then shifted
        S = np.subtract(*(jacobian(tree, q, frame, "world") for frame in ends))
        dS = np.subtract(*(jacobian_rate(tree, q, v, frame, "world") for frame in ends))
        (V, W), (dV, dW) = np.split(S, 2, axis=-2), np.split(dS, 2, axis=-2)
        T, turn = dgm(tree, q, closure.frames[0]), se3.skew(A[..., 3:, 0])
        point = se3.skew(dgm(tree, q, closure.frames[1])[..., :3, 3])
        linear = dV - point @ dW - se3.skew(B[..., :3, 0]) @ W - turn @ (V - point @ W)
        parts = [T[..., :3, :3].swapaxes(-1, -2) @ x for x in (linear, dW - turn @ W)]
        rates.append(np.concatenate(parts, axis=-2)[..., : ROWS[closure.kind], :])
    return np.concatenate(rates, axis=-2)


def maps(robot: LoopedRobot, q: Array, v: Array | None = None) -> tuple[Array, Array]:
    """Velocity map and its rate along v, each (..., n, n_a); the rate is zero without v."""
    n, actuated, passive = robot.n, robot.actuated, robot.passive
    J = scaled(robot, closure_rows(robot, q)[1])
    U, sizes, Vt = np.linalg.svd(J[..., passive], full_matrices=False)
    determined = len(robot.rows) >= len(passive)
    least = sizes.min(axis=-1, initial=np.inf) if determined else np.zeros(q.shape[:-1])
    _check_determined(robot, least > _DETERMINED, "can move while the actuated ones stand still")
    inverse = (Vt.swapaxes(-1, -2) / sizes[..., None, :]) @ U.swapaxes(-1, -2)
    G = np.zeros((*q.shape[:-1], n, len(actuated)))
    G[..., actuated, range(len(actuated))] = 1.0
    G[..., passive, :] = -inverse @ J[..., actuated]
    left = np.abs(J @ G).max(axis=(-1, -2), initial=0.0)
    _check_determined(
        robot, left <= _CONSISTENT, "block the actuated ones, which depend on each other"
    )
    scales = robot.units[:, None] / robot.units[actuated]
    if v is None:
        return G * scales, np.zeros_like(G)
    rates = -inverse @ (scaled(robot, row_rates(robot, q, v)) @ G)
    rate = np.zeros((*rates.shape[:-2], n, len(actuated)))
    rate[..., passive, :] = rates
    return G * scales, rate * scales


def _check_determined(robot: LoopedRobot, is_determined: NDArray[np.bool_], how: str) -> None:
    """Raise for the first sample (...) whose motion the actuated joints do not determine."""
    for i in np.flatnonzero(~np.ravel(is_determined))[:1]:
        where = f" in sample {i}" if np.ndim(is_determined) else ""
        raise LoopError(
            f"the actuated joints {robot.actuated.tolist()} of {robot.name!r} do not determine the "
            f"others{where}: the passive joints {how}. Check the posture (a dead point, or loops "
            "that are open: see close), the closures (see mobility) and actuated=."
        )
