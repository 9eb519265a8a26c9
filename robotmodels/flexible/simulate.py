"""Simulation of flexible arms and of free elastic bodies, with their energies and momenta.

Energy and momenta are integrated along, or constant: their drift measures the error of the
integration. Dry friction is taken with the sign of the velocity, without sticking.

Parameters
----------
arm, e0, e_v0
    See `robotmodels.flexible`: the robot, elastic coordinates and velocities at the start.
link : FlexibleLink
    A free body. A line without inertia about its axis gets that of a radius of length / 10.
q0, v0 : array_like, shape (n,)
    Motors at the start; v0 by default at rest. Of a free body v0 (6,) is the velocity [v; w] of the
    root, whose axes are those of the world at the start.
control, wrench : callable or array_like of shape (n,) or (6,), optional
    Functions of t, of (t, q, v) or of (t, q, v, e, e_v), or constant; default none. Constant
    torques without a wrench are simulated in compiled steps, ten times as fast.
t : array_like
    A duration, with samples at the steps of the integrator, or ascending times (N,), s.
method, rtol, atol, progress
    As for `robotmodels.simulate`. The highest mode limits the step, at loose tolerances too: take
    few modes, or ``"Radau"`` for stiff links with modal damping.
max_evaluations : int, optional
    Default 60 000 for each second and as many more.

Returns
-------
FlexibleMotion or FreeBodyMotion
    The motion with its energies, momenta and status.

Examples
--------
>>> from robotmodels import flexible
>>> link = flexible.beam(1.0, EI=(5.0, 8.0), density=1.0, gyration=0.02, modes=1)
>>> free_body(link, [0.01, 0.0], [0, 0, 0, 0.1, 0.2, 1.0], 1.0).energy_drift < 1e-9
True
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_number
from .._arrays.tasks import Progress, Workers
from .._choices import as_instance, chosen
from .._outcomes import Outcome, Result
from ..errors import InvalidValueError, SingularMassMatrixError
from ..geometry import DHTable
from ..model import RobotModel
from ..simulation import Integrator
from ..simulation.feedback import checked
from ..simulation.simulate import law_of, times_of
from .linear import scales
from .link import FlexibleLink
from .models import SpinStatus, cross, ddm, dgm, in_world, jacobian, recursion, solved, states
from .robot import FlexibleRobot, check_arm

_LAW = Callable[..., ArrayLike]
_LARGEST = 10.0  # deflection, in lengths or rad, at which a motion is given up
_RIGID = 1e-10  # least share of the modal mass that rigid motions do not explain
_PER_SECOND = 60_000  # default budget of evaluations


class FlexibleMotionStatus(Outcome):
    """Outcome of a simulation; fits int8. The motion until then is given for every status."""

    FINISHED = 0, "The motion was followed to its end."
    NOT_CONVERGED = 1, "The allowed evaluations of the model were used up before the end."
    DIVERGED = 2, "The motion grew without bound."
    SOFTENED = 3, SpinStatus.SOFTENED.sentence
    LARGE_DEFLECTION = 4, SpinStatus.LARGE_DEFLECTION.sentence


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FlexibleMotion(Result):
    """Simulated motion of a flexible arm at times ``t`` (N,), which may end early.

    Motors ``q, v, tau`` (N, n), elastic coordinates ``e, e_v`` (N, m); ``kinetic``, ``potential``
    and ``work`` (N,) of the torques less friction, damping and the tool's, J; ``momentum`` (N, 6),
    linear and angular about the origin of the world, and the ``impulse`` (N, 6) of the base, of
    gravity and of the environment, without rotors; ``status``, SOFTENED if a link ever spun too
    fast for its linear modes; ``evaluations`` of the direct model.
    """

    arm: FlexibleRobot
    t: Array
    q: Array
    v: Array
    tau: Array
    e: Array
    e_v: Array
    kinetic: Array
    potential: Array
    work: Array
    momentum: Array
    impulse: Array
    status: FlexibleMotionStatus
    evaluations: int

    @property
    def energy(self) -> Array:
        """Kinetic plus potential energy, J, shape (N,)."""
        return self.kinetic + self.potential

    @property
    def energy_drift(self) -> float:
        """Largest error of the energy balance, relative to the energy turned over."""
        parts = self.kinetic, self.potential - self.potential[0], self.work
        turnover = max(float(np.abs(part).max()) for part in parts)
        return float(np.abs(self.energy - self.energy[0] - self.work).max()) / max(turnover, 1e-12)

    @property
    def momentum_drift(self) -> float:
        """Largest error of the momentum balance, relative to the largest momentum and impulse."""
        error = self.momentum - self.momentum[0] - self.impulse
        return _relative(error, self.momentum, self.impulse)


def simulate(
    arm: FlexibleRobot,
    q0: ArrayLike,
    v0: ArrayLike | None = None,
    control: _LAW | ArrayLike | None = None,
    t: ArrayLike = 1.0,
    wrench: _LAW | ArrayLike | None = None,
    *,
    e0: ArrayLike | None = None,
    e_v0: ArrayLike | None = None,
    method: Integrator | str = Integrator.DOP853,
    rtol: float = 1e-9,
    atol: float = 1e-11,
    max_evaluations: int | None = None,
    progress: Progress = None,
) -> FlexibleMotion:
    """Simulate a flexible arm under torques."""
    n, m, model = check_arm(arm).n, arm.m, arm.model
    given = (("q0", q0, n), ("e0", e0, m), ("v0", v0, n), ("e_v0", e_v0, m))
    start = [as_exact(np.zeros(k) if x is None else x, (k,), name) for name, x, k in given]
    law, push = _law(control, n, "control"), _law(wrench, 6, "wrench")
    ddm(arm, *start, np.zeros(n))  # type: ignore[reportCallIssue]  # its errors name what is singular
    k, D, drives, spun = n + m, arm.parts.D[n:, n:], model.drive_matrices, [0.0]

    def rate(time: float, y: Array) -> Array:
        q, e, v, ev = parts = y[:n], y[n:k], y[k : k + n], y[k + n : 2 * k]
        tau, w, dx = law(time, *parts), push(time, *parts), y[k : 2 * k]
        ddx, base = solved(arm, True, y[None, :k], dx[None], tau[None], w[None])
        spun.append(base[0, 9])
        power = tau @ v - ev @ D @ ev - (0.0 if drives is None else drives.torque(v, None) @ v)
        loads = [base[0, :9]]
        if wrench is not None:
            power -= w @ jacobian(arm, q, e) @ dx
            tool = np.eye(4)
            tool[:3, 3] = dgm(arm, q, e)[:3, 3]
            loads.append(in_world(tool, w))
        return np.concatenate([dx, ddx[0], [power], *loads])

    y0 = np.concatenate([*start, np.zeros(10 if wrench is None else 16)])
    largest = np.full(len(y0), np.inf)
    largest[n:k] = _LARGEST * scales(arm)[n:]
    kind = chosen(Integrator, method, "method")
    options = kind, rtol, atol, max_evaluations, progress
    steps: Any = None  # compiled
    if kind == Integrator.DOP853 and wrench is None and not callable(control):
        torque = np.concatenate([law(0.0, *start), np.zeros(m)])[None]  # type: ignore[reportCallIssue]
        steps = partial(_compiled_steps, arm, torque)
    times, Y, status, count = _followed(rate, y0, t, options, spun, largest, steps)
    q, e, v, ev, work, load, first, pull = np.split(Y, np.cumsum([n, m, n, m, 1, 6, 3]), axis=1)
    tau = np.array([law(*row) for row in zip(times, q, e, v, ev, strict=True)])
    kinetic, potential, momentum = states(arm, Y[:, :k].copy(), Y[:, k : 2 * k].copy())
    weight = arm.parts.chain.pi[:, 9].sum() * np.outer(times - times[0], model.gravity)
    momentum, impulse = (in_world(model.base, x) for x in (momentum, load))
    impulse = impulse + np.hstack([weight, cross(first, model.gravity)])
    impulse -= 0.0 if wrench is None else pull
    energies = kinetic, potential, work[:, 0]
    return FlexibleMotion(arm, times, q, v, tau, e, ev, *energies, momentum, impulse, status, count)


def _law(law: Any, size: int, name: str) -> Callable[..., Array]:
    """Function (t, q, e, v, e_v) -> (size,) of a user's function or of constant values."""
    if not callable(law):
        return law_of(np.zeros(size) if law is None else law, size, None, name)[0]
    for count in (5, 3, 1):
        with suppress(TypeError, ValueError):  # another number of arguments
            signature(law).bind(*range(count))
            few = count - 1
            return checked(lambda t, q, e, v, ev, k=few: law(t, *(q, v, e, ev)[:k]), size, name)
    raise InvalidValueError(f"{name}: expected a function of t, (t, q, v) or (t, q, v, e, e_v).")


def _followed(
    rate: Callable[[float, Array], Array],
    y: Array,
    t: ArrayLike,
    options: tuple[Integrator, float, float, int | None, Progress],
    spun: list[float],
    largest: ArrayLike = np.inf,
    steps: Any = None,
) -> tuple[Array, Array, FlexibleMotionStatus, int]:
    """Times, states up to the largest, status and evaluations of an initial value problem.

    Each evaluation appends a code of `SpinStatus` to ``spun``; ``steps`` takes SciPy's place.
    """
    import scipy.integrate

    (start, end, wanted), (method, rtol, atol, budget, progress) = times_of(t), options
    rtol, atol = as_number(rtol, "rtol", above=0.0), as_number(atol, "atol", above=0.0)
    most = _PER_SECOND * (1.0 + end - start) if budget is None else budget
    most = as_number(most, "max_evaluations", least=1.0)
    report = Workers(progress=progress)
    if steps is not None:
        ends = np.array([end]) if wanted is None else wanted
        return steps(y, start, ends, np.array([max(rtol, 3e-14), atol, most]), largest, report)
    kind: Any = getattr(scipy.integrate, method.value)

    def finite(t: float, y: Array) -> Array:
        dy = rate(t, y)
        if not np.isfinite(dy).all():  # SciPy's integrators would reduce their step for ever
            raise SingularMassMatrixError(f"The accelerations at t = {t:.6g} s are not finite.")
        return dy

    status, found = FlexibleMotionStatus.FINISHED, [(start, y)]
    with np.errstate(over="ignore", invalid="ignore"):
        solver = kind(finite, start, y, end, rtol=max(rtol, 3e-14), atol=atol)
        while solver.status == "running" and end > start:
            if solver.nfev >= most:
                status = FlexibleMotionStatus.NOT_CONVERGED
                break
            before = solver.t
            with suppress(SingularMassMatrixError):  # accelerations that are not finite
                solver.step()
            # the last evaluation of a step is at its end
            if spun[-1] == SpinStatus.LARGE_DEFLECTION:
                status = FlexibleMotionStatus.LARGE_DEFLECTION
                break
            if solver.t == before or (np.abs(solver.y) > largest).any():
                status = FlexibleMotionStatus.DIVERGED
                break
            if wanted is None:
                found.append((float(solver.t), solver.y.copy()))
            else:
                dense = solver.dense_output()
                inside = wanted[(wanted > found[-1][0]) & (wanted <= solver.t)]
                found += [(float(x), dense(x)) for x in inside]
            report.done((float(solver.t) - start) / (end - start))
    times, states = (np.array(x) for x in zip(*found, strict=True))
    return times, states, _ended(status, spun), int(solver.nfev)


def _compiled_steps(
    arm: FlexibleRobot,
    torque: Array,
    y: Array,
    start: float,
    times: Array,
    bounds: Array,
    largest: Array,
    report: Workers,
) -> tuple[Array, Array, FlexibleMotionStatus, int]:
    """`_followed` under constant torques, by `follow`."""
    from .kernels import address
    from .steps import follow, table
    from .work import workspace

    parts, state, span, k = arm.parts, y.copy(), times[-1] - start, len(torque[0])
    every = len(times) == 1
    clock, samples = np.array([start, 1e-3 * span, *np.zeros(5)]), [np.append(start, y)[None]]
    ends, bounds = times[times > start], np.append(bounds, every)
    given = address(), parts.chain, parts.free[2], parts.D, torque, table(), ends, bounds, largest
    poses = np.zeros((1, len(parts.chain.pi) + 1, 3, 4))
    scratch = np.zeros((4, max(k, 18))), poses, np.zeros((1, 10)), state, np.zeros((14, len(y)))
    room, found = (workspace(parts.chain, parts.free[2]), *scratch), np.empty((500, 1 + len(y)))
    while clock[3] < len(ends) and not clock[4]:
        samples.append(found[: follow(*given, *room, clock, found)].copy())
        report.done((clock[0] - start) / span)
    status = _ended(FlexibleMotionStatus(int(clock[4])), clock[5:].tolist())
    t, *states = np.vstack(samples).T
    return t, np.array(states).T.copy(), status, int(clock[2])


def _ended(status: FlexibleMotionStatus, spun: Sequence[float]) -> FlexibleMotionStatus:
    """Status of a motion, given the codes of `SpinStatus` along it."""
    if status and SpinStatus.LARGE_DEFLECTION in spun:
        return FlexibleMotionStatus.LARGE_DEFLECTION
    softened = status != FlexibleMotionStatus.NOT_CONVERGED and SpinStatus.SOFTENED in spun
    return FlexibleMotionStatus.SOFTENED if softened else status


def _relative(error: Array, *sizes: Array) -> float:
    """Largest error of linear and of angular momenta (N, 6), relative to their sizes."""
    largest = np.abs(error).reshape(-1, 2, 3).max(axis=(0, 2))
    size = [np.linalg.norm(x.reshape(-1, 2, 3), axis=2).max(axis=0) for x in sizes]
    return float((largest / np.maximum(np.max(size, axis=0), 1e-9)).max())


# --- one body in space ---------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FreeBodyMotion(Result):
    """Motion of an elastic body without loads (section 7.2.2), at times t (N,).

    Pose (N, 4, 4) and twist (N, 6) are those of the root, the twist in its own axes; energy (N,)
    and momentum (N, 6) about the origin of the world are constant.
    """

    t: Array
    pose: Array
    twist: Array
    e: Array
    e_v: Array
    energy: Array
    momentum: Array
    status: FlexibleMotionStatus

    @property
    def energy_drift(self) -> float:
        """Largest change of the energy, relative to it."""
        return float(np.abs(self.energy - self.energy[0]).max() / max(abs(self.energy[0]), 1e-300))

    @property
    def momentum_drift(self) -> float:
        """Largest change of the momenta, relative to them."""
        return _relative(self.momentum - self.momentum[0], self.momentum)


def free_body(
    link: FlexibleLink,
    e0: ArrayLike,
    v0: ArrayLike,
    t: ArrayLike,
    e_v0: ArrayLike | None = None,
    *,
    rtol: float = 1e-10,
    atol: float = 1e-13,
    max_evaluations: int | None = None,
) -> FreeBodyMotion:
    """Motion of an elastic body that floats without loads (section 7.2.2)."""
    from scipy.linalg import eigvalsh
    from scipy.spatial.transform import Rotation

    as_instance(link, FlexibleLink, "link")
    m, inv = link.m, link.invariants
    given = (("e0", e0, m), ("e_v0", e_v0, m), ("v0", v0, 6))
    start = [as_exact(np.zeros(k) if x is None else x, (k,), name) for name, x, k in given]
    values, axes = np.linalg.eigh(inv.inertia)
    if values[0] <= 1e-9 * values[-1]:  # no inertia about an axis
        more = inv.mass * (0.1 * link.length) ** 2 * np.outer(axes[:, 0], axes[:, 0])
        link = replace(link, invariants=replace(inv, inertia=inv.inertia + more))
    table = DHTable(antecedent=[0], sigma=[2])
    parts = FlexibleRobot(RobotModel.from_table(table, gravity=(0, 0, 0)), {1: link}).parts
    C, MS = np.hstack([inv.translation, inv.rotation]), np.cross(np.eye(3), inv.first_moment)
    own = np.block([[inv.mass * np.eye(3), MS.T], [MS, link.invariants.inertia]])
    left = eigvalsh(inv.modal_mass - C @ np.linalg.solve(own, C.T), inv.modal_mass) if m else C
    if (left < _RIGID).any():
        raise SingularMassMatrixError(
            "link: a sum of its modes is a rigid motion, which a free body has without modes."
        )
    cuts, loose = np.cumsum([m, m, 6, 4]), np.ones(3, np.int64)
    none, outer, spun = np.zeros((1, m)), np.zeros((1, 12)), [0.0]

    def rate(t: float, y: Array) -> Array:
        ev, v, w = y[m : 2 * m], y[2 * m : 2 * m + 3], y[2 * m + 3 : 2 * m + 6]
        outer[0, :6] = y[2 * m : 2 * m + 6]
        e_a, base, *_ = recursion(parts.chain, y[None, :m], ev[None], none, loose, None, outer)
        spun.append(base[0, 9])
        u = y[2 * m + 6 : 2 * m + 9]
        (x, y, z), s = u, y[2 * m + 9]
        W = np.array([[s, -z, y], [z, s, -x], [-y, x, s], [-x, -y, -z]])  # quaternion's rate
        moved = W[:3] @ (W[:3] @ v) + u * (u @ v)
        return np.concatenate([ev, e_a[0], base[0, :6], 0.5 * W @ w, moved])

    y0 = np.concatenate([*start, [0.0, 0.0, 0.0, 1.0], np.zeros(3)])
    options = Integrator.DOP853, rtol, atol, max_evaluations, None
    times, Y, status, _ = _followed(rate, y0, t, options, spun)
    e, ev, twist, quaternion, place = (x.copy() for x in np.split(Y, cuts, axis=1))
    pose = np.tile(np.eye(4), (len(times), 1, 1))
    pose[:, :3, :3], pose[:, :3, 3] = Rotation.from_quat(quaternion).as_matrix(), place
    # momenta: the loads of these velocities as accelerations
    moved, held = np.hstack([0.0 * twist, twist]), np.zeros(3, np.int64)
    Q, base, *_ = recursion(parts.bare, e, 0.0 * ev, ev, held, None, moved)
    energy = 0.5 * ((Q * ev).sum(1) + (base[:, :6] * twist).sum(1) + ((e @ parts.K) * e).sum(1))
    momentum = in_world(pose, base[:, :6])
    return FreeBodyMotion(times, pose, twist, e, ev, energy, momentum, status)
