"""Dynamic models of looped robots: torques of the actuated joints, accelerations, closure forces.

With ``v = G v_a``, torques of the spanning tree do the work of ``G^T tau_tree`` at the actuated
joints; drives of passive joints, such as their friction, are among those of the tree. `ddm` and
`closure_forces` do not check that the loops are closed at q and stay so at the velocities; where no
accelerations keep them closed they raise LoopError, SingularMassMatrixError where free motions have
no inertia.

Returns
-------
ndarray
    Each function states its shape.

References
----------
W. Khalil and E. Dombre, *Modeling, Identification and Control of Robots*, chapter 10; book
section 1.5; J. Carpentier, R. Budhiraja and N. Mansard, "Proximal and sparse resolution of
constrained dynamic equations", RSS 2021, for the direct model.

Examples
--------
A parallelogram in a horizontal plane, driven by one of its cranks.

>>> from robotmodels import RobotModel, InertialParameters
>>> from robotmodels.geometry import DHTable
>>> from robotmodels.loops import Closure
>>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
>>> bars = InertialParameters.from_com(np.ones(5), np.zeros((5, 3)), [np.eye(3)] * 5)
>>> robot = LoopedRobot(RobotModel.from_table(table, bars), [Closure("cut", (4, 5))], actuated=[0])
>>> q, v = [1.0, 1.0, -1.0], np.zeros(3)
>>> a = ddm(robot, q, v, [2.0])
>>> (a / a[0]).round(9), idm(robot, q, v, a).round(9), closure_forces(robot, q, v, [2.0]).shape
(array([ 1.,  1., -1.]), array([2.]), (5,))
"""
# Pinocchio has no revolute closure: it is two points on the axis, with redundant rows, which its
# proximal iterations tolerate (one point where all axes are parallel). The residual J a + dJ/dt v
# of an iteration is the proximal parameter times the change of the multipliers; Pinocchio's own
# residual is another quantity. Where it fails, accelerations are projected on the free motions.

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .. import dynamics
from .._arrays import Array, as_vector, batch_rows
from ..drive import check_all_or_none
from ..dynamics.inverse import rigid_torques, wrench_torque
from ..errors import InvalidValueError, LoopError, SingularMassMatrixError
from ..minimal_parameters.rules import reach
from .constraints import checked, closure_rows, maps, row_rates
from .robot import LoopedRobot, acting_rows, check_looped, scaled

_OPEN = 1e-3  # largest residual of closed loops, relative to the robot's size, or rad
_MU, _ITERATIONS, _CHANGE = 1e-8, 5, 1e-5
"""Proximal parameter; most iterations; change of the multipliers at which they end."""
_RANK = 1e-8  # least singular value of independent constraints, relative to the largest
_DEFINITE = 1e-14  # least eigenvalue of the mass matrix of free motions, relative to the largest
_REJECTED = 1e-6  # least part of closure accelerations that no joint acceleration gives
_LEFT = 1e-12 / _MU  # largest change of the multipliers of closures that hold to 1e-12
_FLOAT64, _solve = np.dtype(np.float64), pin.constraintDynamics


def idm(
    robot: LoopedRobot,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
) -> Array:
    """Inverse dynamic model: torques (..., n_a) of the actuated joints, ``G^T tau_tree``."""
    q, v, a = checked(robot, q=q, v=v, a=a)
    G = maps(robot, closed(robot, q))[0]
    tau = dynamics.idm(robot.tree, q, v, a, wrench=wrench, drive=drive)
    return np.einsum("...ij,...i->...j", G, tau)


def ddm(
    robot: LoopedRobot,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
) -> Array:
    """Direct dynamic model: accelerations (..., n) of all joints, at dead points too."""
    try:  # one sample given as arrays, of a robot without drives whose engine is made: no calls
        model, data, models, datas, settings, full, places, order, back, n, n_a = (
            robot.scratch.quick
        )
        if (
            q.shape == v.shape == n  # type: ignore[union-attr]
            and tau.shape == n_a  # type: ignore[union-attr]
            and q.dtype is v.dtype is tau.dtype is _FLOAT64  # type: ignore[union-attr]
            and drive is True
            and wrench is None
        ):
            full[places] = tau
            a = _solve(model, data, q[order], v[order], full, models, datas, settings)  # type: ignore[index]
            if settings.relative_residual <= _LEFT and isfinite(sum(a.tolist())):
                return a[back]
    except AttributeError:
        pass
    check_looped(robot)
    q, v = as_vector(q, robot.n, "q"), as_vector(v, robot.n, "v")
    tau = as_vector(tau, len(robot.actuated), "tau")
    full = tree_torques(robot, q, v, tau, wrench, drive)
    return accelerations(robot, engine_of(robot, drive), q, v, full)


def closure_forces(
    robot: LoopedRobot,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
) -> Array:
    """Forces f (..., c) of the closures, N and N m: ``tau_tree(q, v, a) = tau + J^T f``.

    Force and moment of the first frame of each closure on the second, at the second's origin, in
    the axes of the first. Of redundant rows they are not determined: the shortest vector is given.
    """
    a = ddm(robot, q, v, tau, wrench, drive)
    q, v = checked(robot, q=q, v=v)
    given = tree_torques(robot, q, v, as_vector(tau, len(robot.actuated), "tau"), wrench, drive)
    bodies = dynamics.idm(robot.tree, q, v, a, drive=False) + a @ engine_of(robot, drive).rotor
    inverse = np.linalg.pinv(scaled(robot, closure_rows(robot, q)[1]), rcond=1e-8)
    f = np.einsum("...jk,...j->...k", inverse, (bodies - given) * robot.units)
    return f * np.sqrt(robot.cuts.weight)


def tree_torques(
    robot: LoopedRobot, q: Array, v: Array, tau: Array, wrench: ArrayLike | None, drive: bool
) -> Array:
    """Torques on the bodies of all joints (..., n): actuators less friction, offsets and wrench."""
    check_all_or_none(drive)
    full = np.zeros((*tau.shape[:-1], robot.n))
    full[..., robot.actuated] = tau
    if drive and (drives := robot.tree.drive_matrices) is not None:
        full = full - drives.torque(v, None)
    if wrench is not None:
        full = full - wrench_torque(robot.tree, q, as_vector(wrench, 6, "wrench"))
    return full


def closed(robot: LoopedRobot, q: Array) -> Array:
    """The same posture, refused where a loop is open."""
    residual = np.abs(closure_rows(robot, q)[0] * np.sqrt(robot.cuts.weight))
    for i in np.argwhere(residual > _OPEN)[:1].tolist():
        raise LoopError(
            f"q: the loops of {robot.name!r} are open in posture {tuple(i[:-1])}: "
            f"{robot.rows[i[-1]]} is off by {residual[*i]:.3g} of the robot's size, or rad. Close "
            "them: close(robot, q_actuated, q_guess).q."
        )
    return q


class Engine:
    """Pinocchio's closures of one robot, with the scratch data of one thread.

    With a ``rate`` (1/s), errors of the closures decay at that rate. At most ``rank`` constraints
    count: those of overconstrained robots depend on each other with closed loops only.
    """

    def __init__(self, robot: LoopedRobot, drive: bool = True, rate: float = 0.0) -> None:
        tree, twin = robot.tree, robot.tree.twin
        drives = tree.drive_matrices if drive else None
        self.rotor = np.zeros((tree.n, tree.n)) if drives is None else drives.rotor
        self.rate, self.rank = rate, tree.n
        self.serves = twin.serves_dynamics and not (self.rotor - np.diag(np.diag(self.rotor))).any()
        if not self.serves:
            return
        self.order, self.back = np.argsort(twin.order), twin.order  # the table's and Pinocchio's
        self.model: Any = twin.model.copy()
        self.model.armature = np.diag(self.rotor)[self.order].copy()
        models, self.datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        along = pin.SE3(np.eye(3), np.array([0.0, 0.0, reach(tree)]))
        acts = acting_rows(robot)
        for closure in robot.closures:
            tilts = [acts[robot.rows.index(row)] for row in closure.rows[3:5]]
            first, second = (twin.model.frames[twin.frame(f).pin_id] for f in closure.frames)
            whole = closure.kind == "full"
            kind = pin.ContactType.CONTACT_6D if whole else pin.ContactType.CONTACT_3D
            two = any(tilts) and not whole  # one point closes a loop of parallel axes
            for point in [pin.SE3.Identity(), along][: 2 if two else 1]:
                constraint = pin.RigidConstraintModel(
                    kind, self.model, first.parentJoint, first.placement * point,
                    second.parentJoint, second.placement * point, pin.LOCAL,
                )  # fmt: skip
                if rate:
                    constraint.setBaumgarteCorrectorParameters(
                        pin.BaumgarteCorrectorParameters(rate**2, 2.0 * rate)
                    )
                models.append(constraint)
        self.models, self.data = models, self.model.createData()
        for constraint in models:
            self.datas.append(constraint.createData())
        # the four-argument form: with three the data of another set of constraints are used
        pin.initConstraintDynamics(self.model, self.data, models, self.datas)
        self.settings = pin.ProximalSettings(_CHANGE, _MU, _ITERATIONS)

    def accelerations(self, q: Array, v: Array, tau: Array) -> Array | None:
        """Accelerations under torques of all joints, each (n,); None if the closures fail."""
        q, v, tau, settings = q[self.order], v[self.order], tau[self.order], self.settings
        a = _solve(self.model, self.data, q, v, tau, self.models, self.datas, settings)
        left = settings.relative_residual
        holds = left <= _LEFT or left <= _LEFT * np.linalg.norm(a)
        return a[self.back] if holds and isfinite(sum(a.tolist())) else None

    def independent(self, sizes: Array) -> int:
        """Number of independent constraints by their singular values, the largest first."""
        return min(self.rank, int((sizes > _RANK * sizes.max(initial=0.0)).sum()))


def engine_of(robot: LoopedRobot, drive: bool = True) -> Engine:
    """The engine of the calling thread."""
    name, scratch = "driven" if drive else "free", robot.scratch
    if not hasattr(scratch, name):
        engine = Engine(robot, drive)
        setattr(scratch, name, engine)
        if drive and engine.serves and robot.tree.drive_matrices is None:
            parts = engine.model, engine.data, engine.models, engine.datas, engine.settings
            full, places = np.zeros(robot.n), engine.back[robot.actuated]
            orders, shapes = (engine.order, engine.back), (full.shape, places.shape)
            scratch.quick = (*parts, full, places, *orders, *shapes)
    engine: Engine = getattr(scratch, name)
    return engine


def projected(robot: LoopedRobot, q: Array, v: Array, tau: Array, engine: Engine) -> Array:
    """Accelerations by projection on the free motions, for any masses. Shapes: (N, n) -> (N, n)."""
    units, rate = robot.units, engine.rate
    e, J = closure_rows(robot, q)
    J, dJ = scaled(robot, J), scaled(robot, row_rates(robot, q, v))
    bias = np.einsum("kij,kj->ki", dJ + 2.0 * rate * J, v / units)
    bias += rate**2 * np.sqrt(robot.cuts.weight) * e
    h = rigid_torques(robot.tree, q, v, np.zeros_like(q))
    M = (dynamics.mass_matrix(robot.tree, q, False) + engine.rotor) * units * units[:, None]
    out = np.empty_like(q)
    for i in range(len(q)):
        U, sizes, Vt = np.linalg.svd(J[i])
        rank = engine.independent(sizes)
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


def accelerations(robot: LoopedRobot, engine: Engine, q: Array, v: Array, tau: Array) -> Array:
    """Accelerations (..., n) under torques of all joints, without those of drives."""
    batch, rows = batch_rows((q, v, tau), ("q", "v", "tau"))
    out, left = np.empty_like(rows[0]), []
    for i, row in enumerate(zip(*rows, strict=True)):
        a = engine.accelerations(*row) if engine.serves else None
        if a is None:
            left.append(i)
        else:
            out[i] = a
    if left:
        q, v, tau = (x[left] for x in rows)
        with np.errstate(over="ignore", invalid="ignore"):
            out[left] = projected(robot, q, v, tau, engine)
    if not np.isfinite(out).all():
        most = max(float(np.abs(x).max()) for x in rows)
        raise InvalidValueError(
            f"q, v, tau: entries up to {most:.3g} give no finite accelerations; check the units."
        )
    return out.reshape(*batch, robot.n)
