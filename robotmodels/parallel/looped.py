"""Parallel robots given as kinematic loops: a platform frame on a robot of `robotmodels.loops`.

The models are numeric: Newton's method on all joints, and the velocity map of the loops.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, Value, as_core, as_exact, as_floats, read_only
from ..errors import InvalidValueError, LoopError
from ..geometry import PRISMATIC
from ..kinematics import dgm, jacobian, jacobian_rate
from ..kinematics.lengths import characteristic_length
from ..loops import LoopedRobot, close, closure_jacobian, velocity_map, velocity_map_rate
from .robot import pose_of, rotation_vector

_STEPS, _PIECES = 60, 16
_CLOSED = 1e-10
_STARTS = 64
_RANK = 1e-9


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LoopedPlatform(Value):
    """A parallel robot made of kinematic loops, from `from_loops`. Read-only.

    Parameters
    ----------
    robot : LoopedRobot
        Spanning tree, closures, actuated joints.
    frame : str or int
        Frame of the platform.
    q_home : ndarray, shape (n,)
        All joints at the home pose, with closed loops.
    columns : tuple of int
        Independent components of the platform's twist, from 0.
    """

    robot: LoopedRobot
    frame: str | int
    q_home: Array
    columns: tuple[int, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "q_home", read_only(self.q_home))

    @property
    def actuated(self) -> NDArray[np.int64]:
        """Columns of the actuated joints."""
        return self.robot.actuated

    @property
    def m(self) -> int:
        """Number of actuated joints."""
        return len(self.robot.actuated)

    @property
    def home(self) -> Array:
        """Home pose of the platform, shape (4, 4)."""
        return dgm(self.robot.tree, self.q_home, self.frame)

    @property
    def length(self) -> float:
        """Characteristic length, m: half the reach of the platform's frame in the tree."""
        return 0.5 * characteristic_length(self.robot.tree, self.frame)

    @property
    def units(self) -> Array:
        """Natural unit of each joint of the tree: 1 rad, or the characteristic length in metres."""
        table = self.robot.tree.table
        return np.where(table.sigma[table.joint_rows] == PRISMATIC, self.length, 1.0)

    def postures(self, T: ArrayLike) -> tuple[Array, Array, NDArray[np.bool_]]:
        """All joints at poses of the platform, near home; only its freedoms count.

        Parameters
        ----------
        T : array_like, shape (..., 4, 4)
            Poses.

        Returns
        -------
        q : ndarray, shape (..., n)
            Joint variables, those of the last iteration where there is none.
        residual : ndarray, shape (...)
            Largest error of closures and pose, m or rad.
        reached : ndarray of bool, shape (...)
            Whether the pose is reached with closed loops.
        """
        poses = se3.as_pose(T)
        rows = poses.reshape(-1, 4, 4)
        q, rest = self._newton(np.broadcast_to(self.q_home, (len(rows), self.robot.n)), rows)
        for i in np.flatnonzero(rest > _CLOSED):
            x = self.q_home[None]
            for target in _between(self.home, rows[i]):
                x, away = self._newton(x, target[None])
            q[i], rest[i] = x[0], away[0]
        batch = poses.shape[:-2]
        return (
            q.reshape(*batch, self.robot.n),
            rest.reshape(batch),
            (rest <= _CLOSED).reshape(batch),
        )

    def _newton(self, q: Array, target: Array) -> tuple[Array, Array]:
        """Newton's method on the actuated joints, the loops closed after each step, N rows."""
        q, rest = q.copy(), np.full(len(q), np.inf)
        active = np.arange(len(q))
        for _ in range(_STEPS):
            T = dgm(self.robot.tree, q[active], self.frame)
            error = _difference(T, target[active])
            error[:, [k for k in range(6) if k not in self.columns]] = 0.0
            away = np.abs(error).max(axis=-1, initial=0.0)
            better = away < 0.9 * rest[active]
            rest[active] = np.minimum(rest[active], away)
            active, error = active[better & (away > 1e-15)], error[better & (away > 1e-15)]
            if not active.size:
                break
            try:
                J = self._inverse(self._twists(q[active]))
            except LoopError:
                break
            step = np.einsum("nij,nj->ni", J, error)
            found = close(self.robot, q[active][:, self.actuated] + step, q[active])
            good = np.asarray(found.residual) < _CLOSED
            q[active[good]] = found.q[good]
            active = active[good]
        return q, rest

    def _twists(self, q: Array) -> Array:
        """Map from actuated velocities to the platform's twist. Shapes: (..., n) -> (..., 6, m)."""
        return jacobian(self.robot.tree, q, self.frame) @ velocity_map(self.robot, q)

    def _reached(self, T: ArrayLike) -> Array:
        """Joints at poses; raises where one is not reached."""
        q, residual, reached = self.postures(T)
        if not reached.all():
            raise InvalidValueError(
                f"T: the platform does not reach this pose near home (residual {residual.max():.2g});"
                " see igm(robot, T).status."
            )
        return q

    def inverse_jacobian(self, T: ArrayLike) -> Array:
        """Inverse Jacobian.

        Parameters
        ----------
        T : array_like, shape (..., 4, 4)
            Poses.

        Returns
        -------
        ndarray, shape (..., m, 6)
            From twists that the platform has to actuated velocities.
        """
        return self._inverse(self._twists(self._reached(T)))

    def _inverse(self, P: Array) -> Array:
        """Inverse of the independent rows, least squares where singular. Shapes: (..., 6, m)."""
        unit = np.where(np.array(self.columns) < 3, 1.0, self.length)
        J = np.zeros((*P.shape[:-2], self.m, 6))
        rows = P[..., list(self.columns), :] * unit[:, None]
        J[..., list(self.columns)] = np.linalg.pinv(rows, rcond=_RANK) * unit
        return J

    def inverse_jacobian_rate(self, T: ArrayLike, V: Array) -> Array:
        """Time derivative of the inverse Jacobian.

        Parameters
        ----------
        T : array_like, shape (..., 4, 4)
            Poses.
        V : ndarray, shape (..., 6)
            Twists.

        Returns
        -------
        ndarray, shape (..., m, 6)
            As the Jacobian.
        """
        q = self._reached(T)
        P = self._twists(q)
        J = self._inverse(P)
        return -J @ self._twist_rates(q, np.einsum("...ij,...j->...i", J, V)) @ J

    def _twist_rates(self, q: Array, rate: Array) -> Array:
        """Time derivative of `_twists`. Shapes: (..., n), (..., m) -> (..., 6, m)."""
        tree, G = self.robot.tree, velocity_map(self.robot, q)
        v = np.einsum("...ij,...j->...i", G, rate)
        change = jacobian_rate(tree, q, v, self.frame) @ G
        return change + jacobian(tree, q, self.frame) @ velocity_map_rate(self.robot, q, v)

    def closed(self, q: ArrayLike, T0: ArrayLike | None) -> tuple[Array, ...]:
        """Poses at actuated positions.

        Parameters
        ----------
        q : array_like, shape (..., m)
            Actuated joints.
        T0 : array_like, shape (..., 4, 4), or None
            Where to start.

        Returns
        -------
        tuple of ndarray
            Poses, codes, iterations, residuals and determinants, as in `PlatformPoses`.
        """
        q = as_core(q, (self.m,), "q")
        guess = self.q_home if T0 is None else self._reached(T0)
        found = close(self.robot, q, guess)
        good = np.asarray(found.residual) < 1e-9
        T = np.where(good[..., None, None], dgm(self.robot.tree, found.q, self.frame), np.nan)
        side, det = self._side(guess), self._side(found.q)
        code = np.where(good, np.where(det * side < 0.0, 2, 0), 1).astype(np.int8)
        none = np.zeros(good.shape, np.int64)
        return T, code, none, np.asarray(found.residual), np.where(good, det, np.nan)

    def _side(self, q: Array) -> Array:
        """Determinants of the inverse Jacobian's independent columns; 0 where there is none."""
        flat, out = q.reshape(-1, self.robot.n), []
        for row in flat:
            try:
                det = float(np.linalg.det(self._twists(row)[list(self.columns)]))
                out.append(1.0 / det if abs(det) > 1e-300 else 0.0)
            except LoopError:
                out.append(0.0)
        return np.array(out).reshape(q.shape[:-1])

    def batch_of(self, q: ArrayLike) -> tuple[int, ...]:
        """Leading axes of actuated positions.

        Parameters
        ----------
        q : array_like, shape (..., m)
            Actuated joints.

        Returns
        -------
        tuple of int
            The shape of the batch.
        """
        return as_core(q, (self.m,), "q").shape[:-1]

    def assemblies(self, q: ArrayLike) -> tuple[Any, ...]:
        """Assembly modes from random starts, with home the first.

        Parameters
        ----------
        q : array_like, shape (..., m)
            Actuated joints.

        Returns
        -------
        tuple
            Poses, residuals, determinants, codes and counts of N rows, as in `AssemblyModes`.
        """
        rows = as_core(q, (self.m,), "q").reshape(-1, self.m)
        rng, n = np.random.default_rng(0), self.robot.n
        T = np.full((len(rows), _STARTS + 1, 4, 4), np.nan)
        residual, det = np.full(T.shape[:2], np.nan), np.full(T.shape[:2], np.nan)
        starts = self.q_home + rng.uniform(-np.pi, np.pi, (_STARTS + 1, n)) * self.units
        starts[0] = self.q_home
        for s, row in enumerate(rows):
            found = close(self.robot, np.broadcast_to(row, (_STARTS + 1, self.m)), starts)
            poses = dgm(self.robot.tree, found.q, self.frame)
            for k in np.flatnonzero(np.asarray(found.residual) < 1e-9):
                if not (np.abs(T[s] - poses[k]).max(axis=(1, 2)) < 1e-6).any():
                    T[s, k], residual[s, k] = poses[k], found.residual[k]
                    det[s, k] = self._side(found.q[k])
        count = (~np.isnan(T[..., 0, 3])).sum(axis=1)
        return T, residual, det, np.full(len(rows), 2, np.int8), count

    def motion(self, T: ArrayLike, V: ArrayLike, A: ArrayLike | None = None) -> tuple[Array, ...]:
        """Joints, velocities and accelerations of the tree for a motion of the platform.

        Parameters
        ----------
        T : array_like, shape (..., 4, 4)
            Poses.
        V, A : array_like, shape (..., 6)
            Twists and their time derivatives.

        Returns
        -------
        tuple of ndarray
            q, v, a (..., n) and the map from actuated velocities to twists (..., 6, m).
        """
        q = self._reached(T)
        V = as_core(V, (6,), "V")
        A = np.zeros(6) if A is None else as_core(A, (6,), "A")
        P, G = self._twists(q), velocity_map(self.robot, q)
        J = self._inverse(P)
        rate = np.einsum("...ij,...j->...i", J, V)
        v = np.einsum("...ij,...j->...i", G, rate)
        bias = np.einsum("...ij,...j->...i", self._twist_rates(q, rate), rate)
        second = np.einsum("...ij,...j->...i", J, A - bias)
        a = np.einsum("...ij,...j->...i", G, second)
        a = a + np.einsum("...ij,...j->...i", velocity_map_rate(self.robot, q, v), rate)
        return np.broadcast_arrays(q, v, a)[0], v, a, P

    def idm(self, T: ArrayLike, V: ArrayLike, A: ArrayLike, wrench: ArrayLike | None) -> Array:
        """Inverse dynamic model.

        Parameters
        ----------
        T, V, A, wrench : array_like
            As for `parallel.idm`.

        Returns
        -------
        ndarray, shape (..., m)
            Torques or forces of the actuated joints.
        """
        from .. import loops

        q, v, a, P = self.motion(T, V, A)
        W = np.zeros(6) if wrench is None else as_core(wrench, (6,), "wrench")
        return loops.idm(self.robot, q, v, a) + np.einsum("...ji,...j->...i", P, W)

    def ddm(self, T: ArrayLike, V: ArrayLike, tau: Array, wrench: ArrayLike | None) -> Array:
        """Direct dynamic model.

        Parameters
        ----------
        T, V, tau, wrench : array_like
            As for `parallel.ddm`.

        Returns
        -------
        ndarray, shape (..., 6)
            Accelerations of the platform.
        """
        from .. import loops

        q, v, _, P = self.motion(T, V)
        W = np.zeros(6) if wrench is None else as_core(wrench, (6,), "wrench")
        a = loops.ddm(self.robot, q, v, tau - np.einsum("...ji,...j->...i", P, W))
        tree = self.robot.tree
        change = np.einsum("...ij,...j->...i", jacobian_rate(tree, q, v, self.frame), v)
        return np.einsum("...ij,...j->...i", jacobian(tree, q, self.frame), a) + change

    def singular_motions(self, T: ArrayLike, epsilon: float) -> tuple[int, Array]:
        """Kind of a pose and twists that the platform has with locked actuators.

        Parameters
        ----------
        T : array_like, shape (4, 4)
            A pose.
        epsilon : float
            Relative size of singular values that count as zero.

        Returns
        -------
        kind : int
            Code of `SingularityKind`.
        motion : ndarray, shape (k, 6)
            Twists.
        """
        q = self._reached(T)
        unit = np.repeat([1.0, self.length], 3)
        Jp = jacobian(self.robot.tree, q, self.frame) * unit[:, None] * self.units
        J = closure_jacobian(self.robot, q) * self.units
        passive = np.setdiff1d(np.arange(self.robot.n), self.actuated)
        locked = Jp[:, passive] @ _null(J[:, passive], epsilon).T
        U, s, _ = np.linalg.svd(locked)
        gained = (U[:, : len(s)] / unit[:, None])[
            :, s > np.sqrt(epsilon) * max(1.0, s.max(initial=0))
        ]
        free = np.linalg.matrix_rank(Jp @ _null(J, epsilon).T, tol=np.sqrt(epsilon))
        idle = _null(np.concatenate((J, Jp)), epsilon)[:, self.actuated]
        serial = bool(np.abs(idle).max(initial=0.0) > np.sqrt(epsilon))
        parallel = gained.shape[1] > 0
        if parallel and free > len(self.columns):
            return 4, gained.T
        return int(serial) + 2 * int(parallel), gained.T

    def __repr__(self) -> str:
        return f"<LoopedPlatform {self.frame!r} of {self.robot!r}>"


def from_loops(
    looped_robot: LoopedRobot, platform_frame: str | int, q_home: ArrayLike | None = None
) -> LoopedPlatform:
    """Parallel robot of any kind from a robot with kinematic loops.

    Parameters
    ----------
    looped_robot : LoopedRobot
        The robot; its actuated joints determine the platform.
    platform_frame : str or int
        Name or number of the platform's frame in the tree.
    q_home : array_like, shape (n,), optional
        All joints near the home posture, rad or m; default the tree's zero posture. The loops are
        closed from there.

    Returns
    -------
    LoopedPlatform
        Taken by the functions of this room in place of a `ParallelRobot`.

    Raises
    ------
    InvalidValueError, LoopError, FrameNotFoundError
        Not a LoopedRobot, loops that cannot be closed near home, actuated joints that do not
        determine the platform, or more of them than it has freedoms.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.loops import Closure, LoopedRobot
    >>> from robotmodels.model import RobotModel
    >>> table = DHTable(antecedent=[0, 0, 1, 2, 3], sigma=[0, 0, 0, 0, 2], d=[0, 1, 1, 1, 1])
    >>> tree = RobotModel.from_table(table)
    >>> five = LoopedRobot(tree, [Closure("cut", (4, 5), "point")], actuated=[0, 1])
    >>> from_loops(five, 5, [2.0, 1.0, -1.0, 1.0]).m
    2
    """
    if not isinstance(looped_robot, LoopedRobot):
        raise InvalidValueError(
            f"looped_robot: expected a loops.LoopedRobot, got {type(looped_robot).__name__}."
        )
    n = looped_robot.n
    start = np.zeros(n) if q_home is None else as_exact(as_floats(q_home, "q_home"), (n,), "q_home")
    found = close(looped_robot, start[looped_robot.actuated], start)
    if not found.residual < 1e-8:
        raise InvalidValueError(
            f"q_home: the loops do not close near this posture (residual {found.residual:.2g}); give "
            "all joints of an assembled posture."
        )
    q = found.q
    P = jacobian(looped_robot.tree, q, platform_frame) @ velocity_map(looped_robot, q)
    columns: list[int] = []
    for k in range(6):
        if np.linalg.matrix_rank(P[[*columns, k]], tol=1e-7 * np.abs(P).max()) > len(columns):
            columns.append(k)
    if len(columns) != P.shape[1]:
        raise InvalidValueError(
            f"looped_robot: {P.shape[1]} actuated joints move the platform in {len(columns)} "
            "independent ways at q_home; give a regular posture, or actuate as many joints as the "
            "platform has freedoms."
        )
    return LoopedPlatform(looped_robot, platform_frame, q, tuple(columns))


def _difference(T: Array, target: Array) -> Array:
    """Small twists from poses to others. Shapes: (N, 4, 4) -> (N, 6)."""
    turn = target.copy()
    turn[:, :3, :3] = target[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2)
    return np.concatenate((target[:, :3, 3] - T[:, :3, 3], rotation_vector(turn)), axis=1)


def _between(start: Array, end: Array) -> list[Array]:
    """Poses between two."""
    turn = np.zeros((4, 4))
    turn[:3, :3] = end[:3, :3] @ start[:3, :3].T
    vector = rotation_vector(turn)
    poses = []
    for share in np.linspace(0.0, 1.0, _PIECES + 1)[1:]:
        place = (1.0 - share) * start[:3, 3] + share * end[:3, 3]
        T = pose_of(np.concatenate((place, share * vector)))
        T[:3, :3] = T[:3, :3] @ start[:3, :3]
        poses.append(T)
    return [*poses[:-1], end]


def _null(A: Array, epsilon: float) -> Array:
    """Orthonormal basis of a null space. Shapes: (r, n) -> (k, n)."""
    _, s, Vt = np.linalg.svd(A)
    rank = int((s > epsilon * max(s.max(initial=0.0), 1e-300)).sum())
    return Vt[rank:]
