"""Parallel robots given as kinematic loops: a platform frame on a robot of `robotmodels.loops`.

A pose is reached if its position and orientation are; the latter does not count where it only
follows from the position, as of a five-bar's rod.

Parameters
----------
looped_robot : LoopedRobot
    The robot: spanning tree, closures, and actuated joints that determine the platform.
platform_frame : str or int
    Name or number of the platform's frame in the tree.
q_home : array_like, shape (n,), optional
    All joints near the home posture, rad or m; default the tree's zero posture. The loops are
    closed from there; other joints and poses are found by continuation from it.

Returns
-------
LoopedPlatform
    Taken by the functions of this package in place of a `ParallelRobot`. Its ``columns`` are the
    independent components of the platform's twist, from 0. Loops that cannot be closed near home
    and actuated joints that do not determine the platform are refused.

Examples
--------
>>> from robotmodels.geometry import DHTable
>>> from robotmodels.model import RobotModel
>>> table = DHTable(antecedent=[0, 0, 1, 2, 3, 4], sigma=[0, 0, 0, 0, 2, 2],
...                 d=[0, 0.5, 0.4, 0.4, 0.6, 0.6])
>>> closures = [loops.Closure("cut", (5, 6), "point")]
>>> five = loops.LoopedRobot(RobotModel.from_table(table), closures, actuated=[0, 1])
>>> from_loops(five, 5, [2.0, 1.0, -1.0, 1.0]).m
2
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from .. import loops, se3
from .._arrays import Array, Value, as_core, as_exact, batch_shape, read_only
from .._choices import as_instance
from ..errors import InvalidValueError, LoopError
from ..kinematics import dgm, jacobian, jacobian_rate
from ..kinematics.lengths import characteristic_length
from ..se3.orientation import rotation_vectors_of

_STARTS = 64
_LONGEST = 0.2  # step of the platform, rad or characteristic lengths
_CLOSED = 1e-10
_RANK = 1e-9


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LoopedPlatform(Value):
    """A parallel robot made of kinematic loops, from `from_loops`. Read-only."""

    robot: loops.LoopedRobot
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

    def coordinates(self, T: ArrayLike) -> Array:
        """Coordinates (..., m) of poses: independent entries of position and rotation vector."""
        T = se3.as_pose(T)
        full = np.concatenate((T[..., :3, 3], rotation_vectors_of(T[..., :3, :3])), axis=-1)
        return np.asarray(full[..., list(self.columns)])

    def postures(self, T: ArrayLike) -> tuple[Array, Array, NDArray[np.bool_]]:
        """All joints (..., n) at poses near home, residuals, and whether the poses are reached.

        The pose is one more closure of the loops, moved from home in short steps.
        """
        from ..loops.kernels import closed_postures

        poses, n, tree = se3.as_pose(T), self.robot.n, self.robot.tree
        rows = se3.inverse(tree.base) @ poses.reshape(-1, 4, 4)
        home, q = se3.inverse(tree.base) @ self.home, np.tile(self.q_home, (len(rows), 1))
        place, sort = tree.with_frames({"_pose": home}, 0), "point" if self._follows() else "full"
        held = [*self.robot.closures, loops.Closure("_pose", ("_pose", self.frame), sort)]
        cuts = loops.LoopedRobot(place, held, np.zeros(0, np.int64)).cuts
        turns = Rotation.from_matrix(rows[:, :3, :3] @ home[:3, :3].T).as_rotvec()
        rest, code, none = np.zeros(len(rows)), np.zeros(1), np.zeros((1, 0))
        for i, (target, turn) in enumerate(zip(rows, turns, strict=True)):
            by = target[:3, 3] - home[:3, 3]
            count = np.ceil(max(*np.abs(by) / self.length, *np.abs(turn), _LONGEST) / _LONGEST)
            for share in np.arange(1.0, count + 1.0) / count:
                R, at = cuts.rotation.copy(), cuts.position.copy()
                R[-2] = Rotation.from_rotvec(share * turn).as_matrix() @ home[:3, :3]
                at[-2] = home[:3, 3] + share * by
                moved = cuts._replace(rotation=read_only(R), position=read_only(at))
                closed_postures(
                    none, moved, np.arange(0), np.arange(n), 0, q[i : i + 1], rest[i : i + 1], code
                )
        shape = poses.shape[:-2]
        return q.reshape(*shape, n), rest.reshape(shape), rest.reshape(shape) <= _CLOSED

    def _follows(self) -> bool:
        """Whether turns of the platform follow from its position, so that they do not count."""
        moves = np.abs(self._twists(self.q_home)[3:]).max() > _RANK
        return bool(max(self.columns) < 3 and moves)

    def _reached(self, T: ArrayLike) -> Array:
        """Joints at poses; raises where one is not reached."""
        q, residual, reached = self.postures(T)
        if not reached.all():
            raise InvalidValueError(
                f"T: the platform does not reach this pose (residual {residual.max():.2g})."
            )
        return q

    def _twists(self, q: Array) -> Array:
        """Map from actuated velocities to the platform's twist. Shapes: (..., n) -> (..., 6, m)."""
        return jacobian(self.robot.tree, q, self.frame) @ loops.velocity_map(self.robot, q)

    def _twist_rates(self, q: Array, rate: Array) -> Array:
        """Time derivative of `_twists`. Shapes: (..., n), (..., m) -> (..., 6, m)."""
        tree, G = self.robot.tree, loops.velocity_map(self.robot, q)
        v = times(G, rate)
        change = jacobian_rate(tree, q, v, self.frame) @ G
        return change + jacobian(tree, q, self.frame) @ loops.velocity_map_rate(self.robot, q, v)

    def _inverse(self, P: Array) -> Array:
        """Inverse of the independent rows, least squares where singular. Shapes: (..., 6, m)."""
        columns = list(self.columns)
        unit = np.where(np.array(columns) < 3, 1.0, self.length)
        J = np.zeros((*P.shape[:-2], self.m, 6))
        J[..., columns] = np.linalg.pinv(P[..., columns, :] * unit[:, None], rcond=_RANK) * unit
        return J

    def inverse_jacobian(self, T: ArrayLike) -> Array:
        """Inverse Jacobian (..., m, 6) at poses."""
        return self._inverse(self._twists(self._reached(T)))

    def inverse_jacobian_rate(self, T: ArrayLike, V: Array) -> Array:
        """Time derivative (..., m, 6) of the inverse Jacobian."""
        q = self._reached(T)
        J = self._inverse(self._twists(q))
        return -J @ self._twist_rates(q, times(J, V)) @ J

    def closed(self, q: ArrayLike, T0: ArrayLike | None) -> tuple[Any, ...]:
        """Fields of `PlatformPoses` at actuated positions (..., m), by one closing of the loops."""
        guess = self.q_home if T0 is None else self._reached(T0)
        found = loops.close(self.robot, as_core(q, (self.m,), "q"), guess)
        residual = np.asarray(found.residual)
        good, det = residual < 1e-9, self._side(found.q)
        T = np.where(good[..., None, None], dgm(self.robot.tree, found.q, self.frame), np.nan)
        code = np.where(good, np.where(det * self._side(guess) < 0.0, 2, 0), 1).astype(np.int8)
        return T, code, np.ones(good.shape, np.int64), residual, np.where(good, det, np.nan)

    def _side(self, q: Array) -> Array:
        """Determinants of the inverse Jacobian's independent columns; 0 where there is none."""
        out = np.zeros(q.shape[:-1])
        for i in np.ndindex(out.shape):
            try:
                det = np.linalg.det(self._twists(q[i])[list(self.columns)])
            except LoopError:
                continue
            out[i] = 1.0 / det if abs(det) > 1e-300 else 0.0
        return out

    def assemblies(self, q: Array) -> tuple[Any, ...]:
        """Assembly modes from random starts, home the first, of N rows (N, m)."""
        T = np.full((len(q), _STARTS, 4, 4), np.nan)
        residual, det = np.full(T.shape[:2], np.nan), np.full(T.shape[:2], np.nan)
        starts = np.random.default_rng(0).uniform(-np.pi, np.pi, (_STARTS, self.robot.n))
        starts[0] = 0.0
        starts = (self.q_home + starts * self.robot.units)[:, self.robot.passive]
        count = np.zeros(len(q), np.int64)
        for s, row in enumerate(q):
            found = loops.close(self.robot, np.broadcast_to(row, (_STARTS, self.m)), starts)
            poses = dgm(self.robot.tree, found.q, self.frame)
            for k in np.flatnonzero(np.asarray(found.residual) < 1e-9):
                if not (np.abs(T[s] - poses[k]).max(axis=(1, 2)) < 1e-6).any():
                    place = s, count[s]
                    T[place], residual[place] = poses[k], found.residual[k]
                    det[place] = self._side(found.q[k])
                    count[s] += 1
        return T, residual, det, np.full(len(q), 2, np.int8), count

    def _motion(self, T: ArrayLike, V: ArrayLike, A: ArrayLike) -> tuple[Array, ...]:
        """Joints, velocities, accelerations, and the map from actuated velocities to twists."""
        q, V, A = self._reached(T), as_core(V, (6,), "V"), as_core(A, (6,), "A")
        P, G = self._twists(q), loops.velocity_map(self.robot, q)
        J = self._inverse(P)
        rate = times(J, V)
        v = times(G, rate)
        second = times(J, A - times(self._twist_rates(q, rate), rate))
        a = times(G, second) + times(loops.velocity_map_rate(self.robot, q, v), rate)
        return np.broadcast_to(q, a.shape), np.broadcast_to(v, a.shape), a, np.swapaxes(P, -1, -2)

    def idm(self, T: ArrayLike, V: ArrayLike, A: ArrayLike, wrench: ArrayLike) -> Array:
        """Inverse dynamic model, as `parallel.idm`."""
        q, v, a, Pt = self._motion(T, V, A)
        return loops.idm(self.robot, q, v, a) + times(Pt, as_core(wrench, (6,), "wrench"))

    def ddm(self, T: ArrayLike, V: ArrayLike, tau: ArrayLike, wrench: ArrayLike) -> Array:
        """Direct dynamic model, as `parallel.ddm`."""
        q, v, _, Pt = self._motion(T, V, np.zeros(6))
        load = times(Pt, as_core(wrench, (6,), "wrench"))
        a = loops.ddm(self.robot, q, v, as_core(tau, (self.m,), "tau") - load)
        tree, frame = self.robot.tree, self.frame
        return times(jacobian(tree, q, frame), a) + times(jacobian_rate(tree, q, v, frame), v)

    def singular_motions(self, T: ArrayLike, epsilon: float) -> tuple[int, Array]:
        """Code of `SingularityKind` at a pose, and twists (k, 6) with locked actuators."""
        q, loose = self._reached(T), np.sqrt(epsilon)
        unit, units = np.repeat([1.0, self.length], 3)[:, None], self.robot.units
        Jp = jacobian(self.robot.tree, q, self.frame) * unit * units
        J, passive = loops.closure_jacobian(self.robot, q) * units, self.robot.passive
        U, s, _ = np.linalg.svd(Jp[:, passive] @ null_space(J[:, passive], epsilon).T)
        gained = (U / unit)[:, : len(s)][:, s > loose * max(1.0, s.max(initial=0.0))].T
        free = np.linalg.matrix_rank(Jp @ null_space(J, epsilon).T, tol=loose)
        idle = null_space(np.concatenate((J, Jp)), epsilon)[:, self.actuated]
        if len(gained) and free > self.m:
            return 4, gained
        return int(np.abs(idle).max(initial=0.0) > loose) + 2 * bool(len(gained)), gained

    def __repr__(self) -> str:
        return f"<LoopedPlatform {self.frame!r} of {self.robot!r}>"


def from_loops(
    looped_robot: loops.LoopedRobot, platform_frame: str | int, q_home: ArrayLike | None = None
) -> LoopedPlatform:
    """Parallel robot of any kind from a robot with kinematic loops."""
    n = as_instance(looped_robot, loops.LoopedRobot, "looped_robot").n
    start = np.zeros(n) if q_home is None else as_exact(q_home, (n,), "q_home")
    found = loops.close(looped_robot, start[looped_robot.actuated], start)
    if not found.residual < 1e-8:
        raise InvalidValueError(
            f"q_home: the loops do not close near this posture (residual {found.residual:.2g})."
        )
    P = jacobian(looped_robot.tree, found.q, platform_frame)
    P = P @ loops.velocity_map(looped_robot, found.q)
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
    return LoopedPlatform(looped_robot, platform_frame, found.q, tuple(columns))


def null_space(A: Any, epsilon: float) -> Array:
    """Orthonormal basis of a null space. Shapes: (r, n) -> (k, n)."""
    _, s, Vt = np.linalg.svd(A)
    return Vt[int((s > epsilon * max(s.max(initial=0.0), 1e-300)).sum()) :]


def times(J: Array, x: Array) -> Array:
    """Products of matrices and vectors with batches."""
    batch_shape((J[..., 0], x), ("the poses' matrices", "the vector"))
    return np.einsum("...ij,...j->...i", J, x)
