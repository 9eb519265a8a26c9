"""Accelerations of looped robots by Pinocchio, with the projection on free motions as reference.

Pinocchio has no revolute closure: it is two points on the axis, with redundant rows, which its
proximal iterations tolerate. The residual ``J a + dJ/dt v`` of an iteration is the proximal
parameter times the change of the multipliers; Pinocchio's own residual is another quantity.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from .._arrays import Array, batch_rows
from ..dynamics import mass_matrix
from ..dynamics.inverse import rigid_torques
from ..errors import LoopError, SingularMassMatrixError
from .constraints import closure_rows, row_rates
from .robot import LoopedRobot

_FLOAT64 = np.dtype(np.float64)
_FLOAT64 = np.dtype(np.float64)
_MU, _ITERATIONS, _CHANGE = 1e-8, 5, 1e-5
"""Proximal parameter; most iterations; change of the multipliers at which they end."""
_RESIDUAL = 1e-12  # largest acceleration between the frames of a closure, m/s^2 or rad/s^2
_RANK = 1e-8  # least singular value of independent constraints, relative to the largest
_DEFINITE = 1e-14  # least eigenvalue of the mass matrix of free motions, relative to the largest
_REJECTED = 1e-6  # least part of closure accelerations that no joint acceleration gives


class Engine:
    """Pinocchio's closures of one robot, with the scratch data of one thread.

    With a ``rate`` (1/s), errors of the closures decay at that rate.
    """

    def __init__(self, robot: LoopedRobot, drive: bool = True, rate: float = 0.0) -> None:
        tree, twin = robot.tree, robot.tree.twin
        drives = tree.drive_matrices if drive else None
        rotor = np.zeros((tree.n, tree.n)) if drives is None else drives.rotor
        self.drives, self.rotor, self.robot = drives, rotor, robot
        self.serves = twin.serves_dynamics and not (rotor - np.diag(np.diag(rotor))).any()
        if not self.serves:
            return
        self.order = np.argsort(twin.order)  # joints of the table in Pinocchio's order
        self.back = twin.order
        self.model: Any = twin.model.copy() if rotor.any() else twin.model
        if rotor.any():
            self.model.armature = np.diag(rotor)[self.order].copy()
        self.data = self.model.createData()
        self.models, self.datas = (
            pin.StdVec_RigidConstraintModel(),
            pin.StdVec_RigidConstraintData(),
        )
        along = pin.SE3(np.eye(3), np.array([0.0, 0.0, float(robot.cuts.length[0])]))
        for closure in robot.closures:
            first, second = (twin.model.frames[twin.frame(f).pin_id] for f in closure.frames)
            whole = closure.kind == "full"
            kind = pin.ContactType.CONTACT_6D if whole else pin.ContactType.CONTACT_3D
            points = [pin.SE3.Identity(), along][: 2 if closure.kind == "revolute" else 1]
            for point in points:
                constraint = pin.RigidConstraintModel(
                    kind, self.model, first.parentJoint, first.placement * point,
                    second.parentJoint, second.placement * point, pin.LOCAL,
                )  # fmt: skip
                if rate:
                    constraint.setBaumgarteCorrectorParameters(
                        pin.BaumgarteCorrectorParameters(rate**2, 2.0 * rate)
                    )
                self.models.append(constraint)
        for constraint in self.models:
            self.datas.append(constraint.createData())
        # the four-argument form: with three the data of another set of constraints are used
        pin.initConstraintDynamics(self.model, self.data, self.models, self.datas)
        self.full, self.actuated = np.zeros(tree.n), robot.actuated
        self.settings = pin.ProximalSettings(_CHANGE, _MU, _ITERATIONS)

    def accelerations(self, q: Array, v: Array, tau: Array) -> Array | None:
        """Accelerations under torques of all joints, each (n,); None if the closures fail."""
        order, settings = self.order, self.settings
        a = pin.constraintDynamics(
            self.model, self.data, q[order], v[order], tau[order], self.models, self.datas, settings
        )
        left, squared = _MU * settings.relative_residual, a.dot(a)
        if not (left <= _RESIDUAL or left * left <= _RESIDUAL**2 * squared) or squared != squared:
            return None
        return a[self.back]

    def quick(self, q: Any, v: Any, tau: Any) -> Array | None:
        """`accelerations` of one sample given as arrays, of a robot without drives; else None."""
        if not (
            type(q) is type(v) is type(tau) is np.ndarray
            and q.shape == v.shape == self.full.shape
            and tau.shape == self.actuated.shape
            and q.dtype is v.dtype is tau.dtype is _FLOAT64
        ):
            return None
        self.full[self.actuated] = tau
        return self.accelerations(q, v, self.full)


def engine_of(robot: LoopedRobot, drive: bool = True) -> Engine:
    """The engine of the calling thread."""
    name = "driven" if drive else "free"
    try:
        return getattr(robot.scratch, name)
    except AttributeError:
        engine = Engine(robot, drive)
        setattr(robot.scratch, name, engine)
        if drive and engine.serves and engine.drives is None:
            robot.scratch.quick = engine.quick
        return engine


def projected(robot: LoopedRobot, q: Array, v: Array, tau: Array, rotor: Array) -> Array:
    """Accelerations by projection on the free motions, for any masses. Shapes: (N, n) -> (N, n)."""
    units, weight = robot.units, np.sqrt(robot.cuts.weight)
    J = weight[:, None] * closure_rows(robot, q)[1] * units
    bias = weight * np.einsum("kij,kj->ki", row_rates(robot, q, v), v)
    h = rigid_torques(robot.tree, q, v, np.zeros_like(q))
    M = (mass_matrix(robot.tree, q, False) + rotor) * units * units[:, None]
    out = np.empty_like(q)
    for i in range(len(q)):
        U, sizes, Vt = np.linalg.svd(J[i])
        rank = int((sizes > _RANK * sizes.max(initial=0.0)).sum())
        part = U.T @ bias[i]
        if np.abs(part[rank:]).max(initial=0.0) > _REJECTED * (1.0 + np.abs(part).max(initial=0.0)):
            raise LoopError(
                f"no accelerations keep the loops of {robot.name!r} closed in sample {i}: its "
                "velocities violate them (take v = velocity_map(robot, q) @ v_a), or the posture "
                "is singular."
            )
        start, Z = -Vt[:rank].T @ (part[:rank] / sizes[:rank]), Vt[rank:].T
        S = Z.T @ M[i] @ Z
        eigenvalues = np.abs(np.linalg.eigvalsh(S))
        if S.size and not eigenvalues.min() > _DEFINITE * eigenvalues.max():
            raise SingularMassMatrixError(
                f"the mass matrix of the free motions of {robot.name!r} is singular in sample {i}. "
                "Give inertial parameters to its tree: LoopedRobot(tree.with_inertia(...), ...)."
            )
        free = np.linalg.solve(S, Z.T @ ((tau[i] - h[i]) * units - M[i] @ start))
        out[i] = (start + Z @ free) * units
    return out


def accelerations(engine: Engine, q: Array, v: Array, tau: Array) -> Array:
    """Accelerations (..., n) under torques of all joints, without those of drives."""
    if q.ndim == v.ndim == tau.ndim == 1 and engine.serves:
        a = engine.accelerations(q, v, tau)
        if a is not None:
            return a
    batch, rows = batch_rows((q, v, tau), ("q", "v", "tau"))
    out, left = np.empty_like(rows[0]), list(range(len(rows[0])))
    if engine.serves:
        left = []
        for i, row in enumerate(zip(*rows, strict=True)):
            q, v, tau = row
            a = engine.accelerations(q, v, tau)
            if a is None:
                left.append(i)
            else:
                out[i] = a
    if left:
        q, v, tau = (x[left] for x in rows)
        out[left] = projected(engine.robot, q, v, tau, engine.rotor)
    return out.reshape(*batch, out.shape[-1])
