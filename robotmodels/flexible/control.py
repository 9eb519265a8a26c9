"""Control of flexible robots: regulation, motion in fixed time, tracking of joints (7.3.3.1 to 3).

A law is a function of (t, q, v, e, e_v) that `simulate` takes as its ``control``.

Parameters
----------
arm
    See `robotmodels.flexible`.
kp, kd : array_like, shape () or (n,)
    Positive gains: N m/rad and N m s/rad of `regulator`, 1/s^2 and 1/s of `joint_tracking`, whose
    errors decay with ``s^2 + kd s + kp``.
q_goal, q0, q1 : array_like, shape (n,)
    Goal (default zero), start and end of the motors, rad or m.
reference : Trajectory, RestToRest, or callable
    Motion of the motors, or a function of t that returns (q, v, a).
duration, frequency, damping : float
    Time, s; undamped natural frequency of a vibration, rad/s, and its ratio from 0, below 1.
kind : str
    ``"ZV"``: no vibration at the frequency; ``"ZVD"``: nor a derivative by it.

Returns
-------
callable, RestToRest or Shaper
    The law; the motion with its torques and its status; impulses half a period after each other.

References
----------
A. De Luca and B. Siciliano, IEEE Trans. Robotics and Automation 9 (1993); M. Benosman and G. Le
Vey, ICRA 2002; N. Singer and W. Seering, J. Dyn. Syst. Meas. Control 112 (1990).

Examples
--------
>>> input_shaper(2.0, kind="ZVD").amplitudes
array([0.25, 0.5 , 0.25])
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, Value, as_each, as_exact, as_floats, as_number
from .._choices import one_of
from .._outcomes import Outcome, Result
from ..errors import InvalidValueError
from ..trajectories import Trajectory
from ..trajectories.motions import PiecewisePolynomial
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
    """Regulation: ``kp (q_goal - q) - kd v`` and the torque that holds the arm at the goal."""
    n = check_arm(arm).n
    goal = np.zeros(n) if q_goal is None else as_exact(q_goal, (n,), "q_goal").copy()
    P, D = (as_each(gain, n, "kp, kd", above=0.0, finite=True) for gain in (kp, kd))
    found = static_deflection(arm, goal)
    if np.isnan(found.tau).any():
        raise InvalidValueError(f"q_goal: the arm has no equilibrium there. {found.reason()}")
    hold = found.tau
    return lambda t, q, v, e=None, e_v=None: P * (goal - q) - D * v + hold


def joint_tracking(arm: FlexibleRobot, reference: Any, kp: ArrayLike, kd: ArrayLike) -> Law:
    """Tracking of joint motions: the inverse model with the errors of the motors."""
    n = check_arm(arm).n
    P, D = (as_each(gain, n, "kp, kd", above=0.0, finite=True) for gain in (kp, kd))
    at = motion_of(reference, n)

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
            f"reference: expected a trajectory or a function of t, got {type(reference).__name__}."
        )

    def at(t: float) -> list[Array]:
        given: Any = [getattr(motion, name)(t) for name in "qva"] if trajectory else motion(t)
        if not isinstance(given, tuple | list | np.ndarray) or len(given) != 3:
            raise InvalidValueError(f"reference: expected (q, v, a) at t = {t:.6g} s.")
        return [as_exact(x, (n,), f"reference at t = {t:.6g} s") for x in given]

    at(0.0)
    return at


# --- rest to rest --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RestToRest(Result):
    """Motion of the motors from rest to rest in a fixed time, ``trajectory``.

    ``end`` (2 m,) is the rest of elastic coordinates and velocities at the end, relative to their
    largest values on the way, and at least to 1e-4 of the length.
    """

    arm: FlexibleRobot
    trajectory: Trajectory
    end: Array
    status: RestStatus
    _elastic: Any

    @property
    def _values(self) -> tuple[Any, ...]:
        return self.arm, self.trajectory, self.end, self.status

    def elastic(self, t: ArrayLike) -> tuple[Array, Array]:
        """Elastic coordinates and velocities (..., m) at times (...)."""
        times = np.clip(as_floats(t, "t"), 0.0, self.trajectory.duration)
        y = self._elastic(times.ravel()).T if times.size else times
        return tuple(np.split(y.reshape(*times.shape, 2 * self.arm.m), 2, axis=-1))  # type: ignore[return-value]

    def torque(self, t: ArrayLike) -> Array:
        """Torques (..., n) at times (...), which hold the arm before and after the motion."""
        e, e_v = self.elastic(t)
        times = np.clip(as_floats(t, "t"), 0.0, self.trajectory.duration)
        path = self.trajectory.motion.derivatives(times.ravel(), (0, 1, 2))
        q, v, a = (x.reshape(*times.shape, self.arm.n) for x in path)
        return idm(self.arm, q, e, v, e_v, a)[0]


def rest_to_rest(arm: FlexibleRobot, q0: ArrayLike, q1: ArrayLike, duration: float) -> RestToRest:
    """Motion between equilibria in a fixed time, without vibration at the end.

    The motion of the motors is a spline with free coefficients, of least change, with which the
    elastic coordinates, integrated by the inverse model, begin and end at rest.
    """
    from scipy.integrate import solve_ivp
    from scipy.interpolate import PPoly

    n, m, T = check_arm(arm).n, arm.m, as_number(duration, "duration", above=0.0)
    ends = np.array([as_exact(q, (n,), name) for q, name in ((q0, "q0"), (q1, "q1"))])
    rest = static_deflection(arm, ends)
    if (rest.status > DeflectionStatus.LARGE).any():
        raise InvalidValueError(
            "q0, q1: expected postures in which the arm has a stable equilibrium."
        )
    start, goal = np.hstack([rest.e, 0.0 * rest.e])
    K = -(-_FACTORS * 2 * m // n) if m else 2
    knots = np.clip(np.arange(-7.0, K + 9.0), 0.0, K + 1.0)
    # B-splines of degree 7 in powers, (K + 1, 8, K + 8); at each end four are the state at rest
    powers = [PPoly.from_spline((knots, row, 7)).c[::-1, 7:-7] for row in np.eye(K + 8)]
    pieces = np.stack(powers, axis=-1).swapaxes(0, 1)
    share = np.clip((np.arange(K + 8.0) - 3.0) / (K + 1.0), 0.0, 1.0)
    base = ends[0] + np.outer(share**2 * (3.0 - 2.0 * share), ends[1] - ends[0])

    def path(factors: Array) -> PiecewisePolynomial:
        """Motions with other free coefficients, factors (P, K, n), side by side as P n joints."""
        none = np.zeros((len(factors), 4, n))
        values = base + np.concatenate([none, factors, none], axis=1)
        c = np.moveaxis(pieces @ values[:, None], 0, 2)
        return PiecewisePolynomial(np.linspace(0.0, T, K + 2)[None], c.reshape(K + 1, 8, -1))

    def elastic(factors: Array, rtol: float, dense: bool = False) -> Any:
        """Solutions for several motions, factors (P, K, n)."""
        P, motion = len(factors), path(factors)

        def rate(t: float, y: Array) -> Array:
            q, v, a = (x.reshape(P, n) for x in motion.derivatives(np.array([t]), (0, 1, 2)))
            e, e_v = y.reshape(P, 2, m).swapaxes(0, 1)
            e_a = solved(arm, False, np.hstack([q, e]), np.hstack([v, e_v]), a)[0][:, n:]
            return np.stack([e_v, e_a], axis=1).ravel()

        options = {"rtol": rtol, "atol": 1e-3 * rtol, "dense_output": dense}
        return solve_ivp(rate, (0.0, T), np.tile(start, P), "DOP853", **options)

    floor = _NEGLIGIBLE * scales(arm)[n:]
    rates = np.sqrt(np.diag(arm.parts.K)[n:] / np.diag(mass_matrix(arm, ends[0]))[n:])

    def left_over(found: Any) -> tuple[Array, Array]:
        """Elastic state at the end (2 m,) relative to the sizes along the motion; those sizes."""
        most = np.abs(found.y).max(axis=1, initial=0.0)
        e = np.maximum(most[:m], floor)  # velocities: of vibrations as large as these
        size = np.concatenate([e, np.maximum(most[m:], rates * e)])
        return (found.y[:, -1] - goal) / size, size

    c, slope, before = np.zeros((K, n)), None, np.inf
    for _ in range(_NEWTON if m else 0):
        left, size = left_over(elastic(c[None], _FINE))
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
    end, _ = left_over(found)
    still = (np.abs(end) < 10.0 * _STILL).all()
    status = RestStatus.AT_REST if still else RestStatus.VIBRATES
    return RestToRest(arm, Trajectory(path(c[None]), holds=True), end, status, found.sol)


# --- input shaping --------------------------------------------------------------------------------


_IMPULSES = {"ZV": 2, "ZVD": 3}


@dataclass(frozen=True, slots=True, eq=False)
class Shaper(Frozen, Value):
    """Impulses that a reference is convolved with: ``times`` (k,), s, and ``amplitudes`` (k,).

    The sum of the amplitudes is 1; ``frequency``, rad/s, and ``damping`` are those of the
    vibration.
    """

    times: Array
    amplitudes: Array
    frequency: float
    damping: float

    def residual(self, relative_frequency_error: ArrayLike = 0.0) -> Array:
        """Vibration that is left, relative to one impulse: ``|sum A_i exp(s t_i)|`` at the end."""
        w = self.frequency * (1.0 + as_floats(relative_frequency_error, "relative_frequency_error"))
        w, damping = w[..., None], self.damping
        s = w * (damping + 1j * np.sqrt(1.0 - damping**2))
        left = np.abs((self.amplitudes * np.exp(s * self.times)).sum(axis=-1))
        return left * np.exp(-damping * w[..., 0] * self.times[-1])

    def shaped(self, reference: Callable[[Array], Array]) -> Callable[[ArrayLike], Array]:
        """Convolution of a function of time, such as ``trajectory.q``, with the impulses."""
        pairs = list(zip(self.times.tolist(), self.amplitudes.tolist(), strict=True))
        return lambda t: sum(a * reference(np.asarray(t) - delay) for delay, a in pairs)  # type: ignore[return-value]


def input_shaper(frequency: float, damping: float = 0.0, kind: str = "ZV") -> Shaper:
    """Input shaper for one vibration (section 7.3.3.2)."""
    w = as_number(frequency, "frequency", above=0.0)
    damping = as_number(damping, "damping", least=0.0, below=1.0)
    count, root = _IMPULSES[one_of(kind, tuple(_IMPULSES), "kind")], np.sqrt(1.0 - damping**2)
    ratio = np.exp(-damping * np.pi / root)
    amplitudes = np.array([comb(count - 1, i) * ratio**i for i in range(count)])
    times = np.arange(count) * np.pi / (w * root)
    return Shaper(times, amplitudes / amplitudes.sum(), w, damping)
