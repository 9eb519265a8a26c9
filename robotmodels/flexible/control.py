"""Control of flexible robots: regulation, motion in fixed time, tracking of joints (7.3.3.1 to 3).

A law is a function of (t, q, v, e, e_v) that `simulate` takes as its ``control``.

Parameters
----------
arm : FlexibleRobot
    The robot, n joints and m elastic coordinates.
kp, kd : array_like, shape () or (n,)
    Positive gains: N m/rad and N m s/rad of `regulator`, 1/s^2 and 1/s of `joint_tracking`, whose
    errors decay with ``s^2 + kd s + kp``.
q_goal, q0, q1 : array_like, shape (n,)
    Goal (default zero), start and end of the motors, rad or m.
reference : Trajectory, RestToRest, or callable
    Motion of the motors, or a function of t that returns (q, v, a).
duration : float
    Time, s.

Raises
------
InvalidValueError, ShapeError
    Gains or durations that are not positive; goals without equilibrium; a reference of another
    kind; vectors of another length.

References
----------
Seed book section 7.3.3; A. De Luca and B. Siciliano, "Regulation of flexible arms under gravity",
IEEE Trans. Robotics and Automation 9 (1993); M. Benosman and G. Le Vey, "Joint trajectory tracking
for planar multi-link flexible manipulator", ICRA 2002.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import comb
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, Value, as_exact, as_number, as_reals
from .._outcomes import Outcome, Result
from ..errors import InvalidValueError, ShapeError
from .linear import DeflectionStatus, scales, static_deflection
from .models import idm, mass_matrix, solved
from .robot import FlexibleRobot, check_arm

Law = Callable[[float, Array, Array, Array, Array], Array]
_FACTORS = 2  # free coefficients of each joint, for each elastic condition that one joint has
_NEWTON = 12
_FINE, _COARSE, _STEP = 1e-10, 1e-7, 1e-2  # tolerances of integration; step of differences
_NEGLIGIBLE = 1e-4  # of a length or 1 rad: deflections that count as none at 1e-8 of it
_STILL = 1e-9  # relative to the largest deflection on the way: vibration at the end


class RestStatus(Outcome):
    """Outcome of a motion from rest to rest; fits int8."""

    AT_REST = 0, "The arm ends at rest, its elastic coordinates included."
    VIBRATES = 1, "Vibration is left at the end: the duration is too short for this arm."


def regulator(
    arm: FlexibleRobot, kp: ArrayLike, kd: ArrayLike, q_goal: ArrayLike | None = None
) -> Law:
    """Regulation: ``kp (q_goal - q) - kd v`` and the torque that holds the arm at the goal.

    Returns
    -------
    callable
        The law.

    Examples
    --------
    >>> from robotmodels import RobotModel, DHTable, flexible
    >>> model = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> arm = flexible.FlexibleRobot(model, {1: flexible.beam(1.0, EI=(np.inf, 1.0), hub=0.1)})
    >>> motion = flexible.simulate(arm, [0.0], control=regulator(arm, 1.0, 1.0, [0.2]), t=10.0)
    >>> bool(abs(motion.q[-1] - 0.2) < 1e-3)
    True
    """
    n = check_arm(arm).n
    goal = np.zeros(n) if q_goal is None else as_exact(q_goal, (n,), "q_goal").copy()
    P, D, found = _gains(kp, n, "kp"), _gains(kd, n, "kd"), static_deflection(arm, goal)
    if np.isnan(found.tau).any():
        raise InvalidValueError(f"q_goal: the arm has no equilibrium there. {found.reason()}")
    hold = found.tau
    return lambda t, q, v, e=None, e_v=None: P * (goal - q) - D * v + hold


def joint_tracking(arm: FlexibleRobot, reference: Any, kp: ArrayLike, kd: ArrayLike) -> Law:
    """Tracking of joint motions: the inverse model with the errors of the motors.

    Returns
    -------
    callable
        The law, which uses e and e_v.

    Examples
    --------
    >>> from robotmodels import load, flexible, trajectories
    >>> arm = flexible.FlexibleRobot(load("rx90"), {3: flexible.beam(0.45, EI=100.0, modes=1)})
    >>> motion = trajectories.quintic(np.zeros(6), np.ones(6), duration=1.0)
    >>> law = joint_tracking(arm, motion, 100.0, 20.0)
    >>> law(0.5, motion.q(0.5), motion.v(0.5), np.zeros(2), np.zeros(2)).shape
    (6,)
    """
    n = check_arm(arm).n
    P, D, at = _gains(kp, n, "kp"), _gains(kd, n, "kd"), motion_of(reference, n)

    def law(t: float, q: Array, v: Array, e: Array, e_v: Array) -> Array:
        qd, vd, ad = at(t)
        return idm(arm, q, e, v, e_v, ad + D * (vd - v) + P * (qd - q))[0]

    return law


def motion_of(reference: Any, n: int) -> Callable[[float], list[Array]]:
    """Function of t that returns (q, v, a), of a trajectory or of such a function, n joints."""
    motion = getattr(reference, "trajectory", reference)
    trajectory = all(callable(getattr(motion, name, None)) for name in "qva")
    if not trajectory and not callable(motion):
        raise InvalidValueError(
            "reference: expected a trajectory, or a function of t that returns (q, v, a), got "
            f"{type(reference).__name__}."
        )

    def at(t: float) -> list[Array]:
        given: Any = [getattr(motion, name)(t) for name in "qva"] if trajectory else motion(t)
        if not isinstance(given, tuple | list | np.ndarray) or len(given) != 3:
            raise InvalidValueError(f"reference: expected (q, v, a) at t = {t:.6g} s.")
        return [as_exact(x, (n,), f"reference at t = {t:.6g} s") for x in given]

    at(0.0)
    return at


def _gains(value: ArrayLike, n: int, name: str) -> Array:
    gains = as_reals(value, name)
    if gains.shape not in ((), (n,)):
        raise ShapeError(f"{name}: expected one number or shape ({n},), got {gains.shape}.")
    if not (np.isfinite(gains) & (gains > 0.0)).all():
        raise InvalidValueError(f"{name}: expected positive gains, got {gains.tolist()}.")
    return np.broadcast_to(gains, (n,)).copy()


# --- rest to rest --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class JointPolynomial(Frozen, Value):
    """Motion of the joints from rest to rest: a polynomial by its Bernstein coefficients.

    Shapes: coefficients (degree + 1, ..., n).
    """

    duration: float
    coefficients: Array
    _weighted: Any = field(default=(), init=False, repr=False)

    def __post_init__(self) -> None:
        Frozen.__post_init__(self)
        rows, weighted = self.coefficients, []
        for _ in range(3):  # derivatives have the differences as coefficients
            d = len(rows) - 1
            weights = np.array([[comb(d, k)] for k in range(d + 1)], np.float64)
            weighted.append((np.arange(d + 1), weights * rows.reshape(d + 1, -1)))
            rows = np.diff(rows, axis=0) * (d / self.duration)
        object.__setattr__(self, "_weighted", weighted)

    @property
    def _values(self) -> tuple[Any, ...]:
        return self.duration, self.coefficients

    def _at(self, t: ArrayLike, order: int) -> Array:
        powers, weighted = self._weighted[order]
        s = np.asarray(t, np.float64)[..., None] / self.duration
        x = np.minimum(np.maximum(s, 0.0), 1.0)
        found = (x**powers * (1.0 - x) ** powers[::-1]) @ weighted
        found = found if order == 0 else found * (x == s)
        return found.reshape(*s.shape[:-1], *self.coefficients.shape[1:])

    def q(self, t: ArrayLike) -> Array:
        """Positions (..., n) at times (...), constant before and after the motion."""
        return self._at(t, 0)

    def v(self, t: ArrayLike) -> Array:
        """Velocities (..., n) at times (...)."""
        return self._at(t, 1)

    def a(self, t: ArrayLike) -> Array:
        """Accelerations (..., n) at times (...)."""
        return self._at(t, 2)

    def __repr__(self) -> str:
        d, *_, n = self.coefficients.shape
        return f"<JointPolynomial: {self.duration:g} s, {n} joints, degree {d - 1}>"


@dataclass(frozen=True, slots=True, eq=False)
class RestToRest(Result):
    """Motion from rest to rest in a fixed time.

    Parameters
    ----------
    arm : FlexibleRobot
        The robot.
    trajectory : JointPolynomial
        Motion of the motors, with ``q(t)``, ``v(t)``, ``a(t)`` and ``duration``.
    end : ndarray, shape (2 m,)
        What is left of the elastic coordinates and their velocities at the end, relative to their
        largest values on the way, and at least to 1e-4 of the length.
    status : RestStatus
        Whether the arm ends at rest.
    """

    arm: FlexibleRobot
    trajectory: JointPolynomial
    end: Array
    status: RestStatus
    _elastic: Any = field(repr=False)

    @property
    def _values(self) -> tuple[Any, ...]:
        return self.arm, self.trajectory, self.end, self.status

    def elastic(self, t: ArrayLike) -> tuple[Array, Array]:
        """Elastic coordinates and velocities (..., m) at times (...)."""
        times = np.clip(np.asarray(t, np.float64), 0.0, self.trajectory.duration)
        m = self.arm.m
        y = self._elastic(times.ravel()).T if times.size else times
        return tuple(np.split(y.reshape(*times.shape, 2 * m), 2, axis=-1))  # type: ignore[return-value]

    def torque(self, t: ArrayLike) -> Array:
        """Torques (..., n) at times (...), which hold the arm before and after the motion."""
        e, e_v = self.elastic(t)
        path = self.trajectory
        return idm(self.arm, path.q(t), e, path.v(t), e_v, path.a(t))[0]

    def __repr__(self) -> str:
        return f"<RestToRest: {self.trajectory.duration:g} s, {self.status.name}>"


def rest_to_rest(arm: FlexibleRobot, q0: ArrayLike, q1: ArrayLike, duration: float) -> RestToRest:
    """Motion between equilibria in a fixed time, without vibration at the end.

    The motion of the motors is a polynomial with free coefficients, of least change, with which the
    elastic coordinates, integrated by the inverse model, begin and end at rest.

    Returns
    -------
    RestToRest
        The motion, its torques and its status.

    Examples
    --------
    >>> from robotmodels import RobotModel, DHTable, flexible
    >>> model = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> arm = flexible.FlexibleRobot(model, {1: flexible.beam(1.0, EI=(np.inf, 1.0), hub=0.1)})
    >>> plan = rest_to_rest(arm, [0.0], [1.0], 2.0)
    >>> plan.status, plan.trajectory.q(2.0)
    (<RestStatus.AT_REST: 0>, array([1.]))
    """
    from scipy.integrate import solve_ivp

    n, m, T = check_arm(arm).n, arm.m, as_number(duration, "duration", above=0.0)
    ends = np.array([as_exact(q, (n,), name) for q, name in ((q0, "q0"), (q1, "q1"))])
    rest = static_deflection(arm, ends)
    if (rest.status > DeflectionStatus.LARGE).any():
        raise InvalidValueError(
            "q0, q1: expected postures in which the arm has a stable equilibrium."
        )
    start, goal = np.hstack([rest.e, 0.0 * rest.e])
    K = -(-_FACTORS * 2 * m // n) if m else 2
    d = K + 7  # the first and last four coefficients are those of the ends
    # the step with four derivatives that vanish at both ends, of a higher degree
    step = [sum(comb(k, j) * comb(d - k, 9 - j) for j in range(5, 10)) for k in range(d + 1)]
    base = ends[0] + np.outer(np.array(step) / comb(d, 9), ends[1] - ends[0])

    def path(factors: Array) -> JointPolynomial:
        """Motions with other free coefficients, factors (..., K, n)."""
        moved = np.moveaxis(factors, -2, 0)
        none = np.zeros((4, *moved.shape[1:]))
        wide = base.reshape(d + 1, *[1] * (factors.ndim - 2), n)
        return JointPolynomial(T, wide + np.concatenate([none, moved, none]))

    def elastic(factors: Array, rtol: float, dense: bool = False) -> Any:
        """Solutions for several motions, factors (P, K, n)."""
        P, motion = len(factors), path(factors)

        def rate(t: float, y: Array) -> Array:
            e, e_v = y.reshape(P, 2, m).swapaxes(0, 1)
            x, dx = np.hstack([motion.q(t), e]), np.hstack([motion.v(t), e_v])
            e_a = solved(arm, False, x, dx, motion.a(t))[0][:, n:]
            return np.stack([e_v, e_a], axis=1).ravel()

        tolerances = {"rtol": rtol, "atol": 1e-3 * rtol}
        y0 = np.tile(start, P)
        return solve_ivp(rate, (0.0, T), y0, "DOP853", dense_output=dense, **tolerances)

    floor = _NEGLIGIBLE * scales(arm)[n:]
    rates = np.sqrt(np.diag(arm.parts.K)[n:] / np.diag(mass_matrix(arm, ends[0]))[n:])

    def sizes(y: Array) -> Array:
        """Largest elastic coordinates (m,), and velocities (m,) of vibrations as large as these."""
        most = np.abs(y).max(axis=1, initial=0.0)
        most[:m] = np.maximum(most[:m], floor)
        return np.concatenate([most[:m], np.maximum(most[m:], rates * most[:m])])

    c, slope, before = np.zeros((K, n)), None, np.inf
    for _ in range(_NEWTON if m else 0):
        found = elastic(c[None], _FINE)
        size = sizes(found.y)
        left = (found.y[:, -1] - goal) / size
        error = float(np.abs(left).max())
        if error < _STILL:
            break
        if slope is None or error > 0.2 * before:  # else the last slope serves
            unit = np.eye(K * n).reshape(-1, K, n)
            moved = elastic(np.concatenate([c[None], c + _STEP * unit]), _COARSE)
            last = moved.y[:, -1].reshape(-1, 2 * m)
            slope = (last[1:] - last[0]).T / _STEP
        before = error
        c = c + np.linalg.lstsq(slope / size[:, None], -left, rcond=1e-10)[0].reshape(K, n)
    found = elastic(c[None], _FINE, dense=True)
    end = (found.y[:, -1] - goal) / sizes(found.y)
    still = (np.abs(end) < 10.0 * _STILL).all()
    status = RestStatus.AT_REST if still else RestStatus.VIBRATES
    return RestToRest(arm, path(c), end, status, found.sol)
