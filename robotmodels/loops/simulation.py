"""Simulation of looped robots, with every sample on the closures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_number
from ..drive import check_all_or_none
from ..errors import InvalidValueError, LoopError, SingularMassMatrixError
from ..simulation import Integrator, Simulation
from ..simulation.feedback import Feedback
from ..simulation.integration import Integration
from ..simulation.motion import Loads, Motion
from ..simulation.simulate import followed, law_of, times_of
from .closing import ClosingStatus, close
from .constraints import closure_rows, mobility
from .dynamics import Engine, accelerations, closed
from .robot import LoopedRobot, check_looped, scaled

_RATE = 10.0  # 1/s, decay of errors of the closures during the integration
_SAME = 0.8  # least cosine between singular vectors of two evaluations that belong together
_MOVING = 1e-6  # largest violation of the closures by the velocities at the start, of the largest


def simulate(
    robot: LoopedRobot,
    q0: ArrayLike,
    v0: ArrayLike | None = None,
    control: Callable[..., ArrayLike] | ArrayLike | None = None,
    t: ArrayLike = 1.0,
    wrench: Callable[..., ArrayLike] | ArrayLike | None = None,
    *,
    drive: bool = True,
    smoothing: float | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-12,
    max_evaluations: int = 200_000,
) -> Simulation:
    """Simulate a looped robot under torques of its actuated joints.

    The direct model of all joints is integrated, dead points of the actuated joints included.
    Errors of the closures decay during the integration, and every sample is projected on them, so
    that the loops stay closed to rounding.

    Parameters
    ----------
    q0, v0 : array_like, shape (n,)
        Positions (rad or m) of all joints, which close the loops, and velocities; default at rest.
    control : callable, or array_like of shape (n_a,) or (N, n_a), optional
        Torques of the actuated joints, N m or N, as for `robotmodels.simulate`; a function gets
        t and q, v of all joints.
    t, wrench, drive, rtol, atol, max_evaluations
        As for `robotmodels.simulate`.
    smoothing : float, optional
        Velocity w, rad/s or m/s: ``tanh(v / w)`` instead of ``sign(v)`` in dry friction, which
        needs it here.

    Returns
    -------
    Simulation
        Motion of the tree, energies and works, status; ``tau`` is zero for passive joints.

    References
    ----------
    J. Baumgarte, "Stabilization of constraints", CMAME 1, 1972. Book section 1.5.

    Examples
    --------
    >>> from robotmodels import RobotModel, InertialParameters
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.loops import Closure
    >>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
    >>> bars = InertialParameters.from_com(np.ones(5), np.full((5, 3), 0.1), [np.eye(3)] * 5)
    >>> tree = RobotModel.from_table(table, bars, gravity=[0, -9.81, 0])
    >>> robot = LoopedRobot(tree, [Closure("cut", (4, 5))], actuated=[0])
    >>> motion = simulate(robot, [1.0, 1.0, -1.0], t=0.5)
    >>> bool(abs(motion.q[:, 1] + motion.q[:, 2]).max() < 1e-12), bool(motion.relative_drift < 1e-8)
    (True, True)
    """
    check_looped(robot)
    check_all_or_none(drive)
    n, tree, drives = robot.n, robot.tree, robot.tree.drive_matrices if drive else None
    q = closed(robot, as_exact(q0, (n,), "q0")).copy()
    v = np.zeros(n) if v0 is None else as_exact(v0, (n,), "v0").copy()
    start, end, times = times_of(t)
    law, knots = law_of(control, len(robot.actuated), times, "control")
    tool, tool_knots = law_of(wrench, 6, times, "wrench")
    width = None if smoothing is None else np.full(n, as_number(smoothing, "smoothing", above=0.0))
    if width is None and drives is not None and (drives.coulomb.any() or drives.coupling.size):
        raise InvalidValueError(
            "smoothing: dry friction needs a velocity here, such as 1e-3; or take drive=False."
        )

    def torques(t: float, q: Array, v: Array, x: Array) -> Array:
        tau = np.zeros(n)
        if law is not None:
            tau[robot.actuated] = law(t, q, v)
        return tau

    motion = LoopMotion(tree, Feedback(torques), tool, drive, None, width)
    motion.robot, motion.engine = robot, Engine(robot, drive, _RATE)
    # the start may be singular: there, a posture beside it has the rank
    beside = close(robot, q[robot.actuated] + 0.01 * robot.units[robot.actuated], q)
    near = beside.q if beside.status == ClosingStatus.CLOSED else q
    motion.engine.rank = n - int(mobility(robot, [q, near]).count.min())
    moved = motion.projected(q, v)
    if np.abs(moved[1] - v).max(initial=0.0) > _MOVING * np.abs(v).max(initial=0.0):
        raise LoopError(
            f"v0: it opens the loops of {robot.name!r}; take velocity_map(robot, q0) @ v_actuated."
        )
    steps = {"rtol": as_number(rtol, "rtol", least=1e-13), "max_step": np.inf}
    steps["atol"] = as_number(atol, "atol", above=0.0)
    budget = int(min(as_number(max_evaluations, "max_evaluations", least=1.0), 2**62))
    inside = sorted({float(x) for x in (*knots, *tool_knots) if start < x < end})
    run = _Integration(motion, times, None, Integrator.DOP853, steps, budget, None)
    return followed(run, tree, *moved, [(x, False) for x in (start, *inside, end)], drive)


class LoopMotion(Motion):
    """Equations of motion of a looped robot on plain arrays, for an integrator."""

    robot: LoopedRobot
    engine: Engine
    weakest: tuple[Array, Array] | None = None
    passed = False

    def at(self, t: float, q: Array, v: Array, x: Array) -> Loads:
        """Accelerations and torques at one time; NaN accelerations where there are none."""
        self.evaluations += 1
        load, tau, friction, tool = self.load(t, q, v, x)
        self.passed = self.passed or self._passes(q)
        try:
            a = np.full(self.n, np.nan)
            if not self.passed:
                a = accelerations(self.robot, self.engine, q, v, load)
        except (LoopError, SingularMassMatrixError):
            pass
        self.singular = self.singular or bool(np.isnan(a).any())
        return Loads(a, tau, friction, tool, self._zero[0])

    def _passes(self, q: Array) -> bool:
        """Whether the least singular value of the closures changed its sign on the way to q."""
        J = scaled(self.robot, closure_rows(self.robot, q)[1])
        U, _, Vt = np.linalg.svd(J, full_matrices=False)
        last = self.engine.rank - 1
        before, self.weakest = self.weakest, (U[:, last], Vt[last]) if last >= 0 else None
        if before is None or self.weakest is None:
            return False
        turned = [float(a @ b) for a, b in zip(before, self.weakest, strict=True)]
        return min(map(abs, turned)) > _SAME and turned[0] * turned[1] < 0.0

    def projected(self, q: Array, v: Array) -> tuple[Array, Array]:
        """The nearest state on the closures; each (n,)."""
        weight, units = np.sqrt(self.robot.cuts.weight), self.robot.units
        for _ in range(3):
            e, J = closure_rows(self.robot, q)
            U, sizes, Vt = np.linalg.svd(scaled(self.robot, J), full_matrices=False)
            rank = self.engine.independent(sizes)
            inverse = units[:, None] * (Vt[:rank].T / sizes[:rank]) @ U[:, :rank].T
            q = q - inverse @ (weight * e)
        return q, v - inverse @ (weight * (J @ v))


class _Integration(Integration):
    """Integration whose samples are on the closures."""

    motion: LoopMotion

    def _sample(self, t: float, y: Array) -> None:
        n = self.motion.n
        moved = self.motion.projected(y[:n], y[n : 2 * n])
        super()._sample(t, np.concatenate((*moved, y[2 * n :])))
