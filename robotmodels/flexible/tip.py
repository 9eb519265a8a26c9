"""Tracking in the operational space: inversion of the tip's motion (section 7.3.3.4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, Value, as_floats, as_number
from .._outcomes import Outcome
from ..errors import InvalidValueError
from .control import motion_of
from .linear import linearize, static_deflection, stiffness_matrix, tangent, tip_gain
from .models import dgm, generalized_forces, idm, jacobian, mass_matrix
from .robot import FlexibleRobot, check_arm, damping_matrix

_METHODS = ("stable_inversion", "causal")
_TIME_CONSTANTS = 14.0  # of the slowest unstable zero: default preview
_CORRECTIONS = 4
_PART, _EVERY = 400, 8  # samples of each part; those that the problem starts with
_TOLERANCE, _NODES, _ON_PATH = 1e-6, 5_000, 1e-8  # of the boundary value problem; rad or m
_UNSTABLE = 1e-6  # least real part of an unstable zero, relative to its size


class TipStatus(Outcome):
    """Outcome of an inversion; fits int8."""

    FOUND = 0, "The torques move the tip along its reference."
    NON_MINIMUM_PHASE = (
        1,
        "Causal inversion is refused: the tip is a non-minimum-phase output, so that its zeros in "
        "the right half plane make causal torques grow without bound. Take "
        "method='stable_inversion', which starts before the motion.",
    )
    NOT_FOUND = 2, "The boundary value problem was not solved: the motion is too fast for this arm."


@dataclass(frozen=True, slots=True, eq=False)
class TipTracking(Frozen, Value):
    """Motion of the joints that moves the tip of a flexible arm along a reference.

    Parameters
    ----------
    arm : FlexibleRobot
        The robot, n joints and m elastic coordinates.
    t : ndarray, shape (N,)
        Times, s, from ``-preview`` on; empty if refused.
    q, v, tau : ndarray, shape (N, n)
        Angles, velocities and torques of the motors.
    e, e_v : ndarray, shape (N, m)
        Elastic coordinates and velocities.
    zeros : ndarray of complex, shape (2 m,)
        Of the tip at the start, 1/s.
    preview : float
        Time before the reference starts to move at which the torques start, s.
    status : TipStatus
        Whether it was found.
    """

    arm: FlexibleRobot
    t: Array
    q: Array
    v: Array
    tau: Array
    e: Array
    e_v: Array
    zeros: NDArray[np.complex128]
    preview: float
    status: TipStatus
    _spline: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        from scipy.interpolate import CubicSpline

        values = np.hstack([self.tau, self.q, self.v])
        spline = CubicSpline(self.t, values) if len(self.t) else None
        object.__setattr__(self, "_spline", spline)

    @property
    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, f.name) for f in fields(self) if f.init)

    def torque(self, t: ArrayLike) -> Array:
        """Torques (..., n) at times (...), constant outside the motion."""
        return self._at(t)[0]

    def control(self, kp: float, kd: float) -> Any:
        """Law (t, q, v): the torques, with gains kp and kd on the errors of the motors."""

        def law(t: float, q: Array, v: Array) -> Array:
            tau, q_t, v_t = self._at(t)
            return tau + kp * (q_t - q) + kd * (v_t - v)

        return law

    def _at(self, t: ArrayLike) -> list[Array]:
        if self._spline is None:
            raise InvalidValueError(f"There are no torques. {self.reason()}")
        times = np.clip(as_floats(t, "t"), self.t[0], self.t[-1])
        return np.split(self._spline(times), 3, axis=-1)

    def reason(self) -> str:
        """The sentence of the status."""
        return self.status.sentence

    def __repr__(self) -> str:
        return f"<TipTracking: {self.status.name}, preview {self.preview:.4g} s>"


def tip_tracking(
    arm: FlexibleRobot,
    reference: Any,
    method: str = "stable_inversion",
    duration: float | None = None,
    preview: float | None = None,
) -> TipTracking:
    """Torques that move the tip as the rigid arm would be moved by a reference of its joints.

    The output is ``y = q + J_q^+ J_e e``, corrected until the tip is on the path in the directions
    in which the joints move it (one joint does not correct a shortened beam). Its zero dynamics are
    solved as a boundary value problem, which needs a preview of the motion.

    Parameters
    ----------
    arm : FlexibleRobot
        The robot, n joints up to six; rigid joints.
    reference : Trajectory or callable
        Motion of the joints of the rigid arm: its tip is the reference. A function of t returns
        (q, v, a) and needs ``duration``.
    method : str
        ``"stable_inversion"``, or ``"causal"``, which is refused by status where a zero is
        unstable.
    duration : float, optional
        Of the reference, s; default that of the trajectory.
    preview : float, optional
        Default 14 time constants of the slowest unstable zero, s.

    Returns
    -------
    TipTracking
        Motion, torques and status.

    Raises
    ------
    InvalidValueError, ShapeError
        Flexible joints, another method, a reference of another kind, a singular posture.

    References
    ----------
    Seed book section 7.3.3.4; E. Bayo, "A finite-element approach to control the end-point motion
    of a single-link flexible robot", J. Robotic Systems 4 (1987); S. Devasia, D. Chen, B. Paden,
    "Nonlinear inversion-based output tracking", IEEE Trans. Automatic Control 41 (1996).

    Examples
    --------
    >>> from robotmodels import RobotModel, DHTable, flexible, trajectories
    >>> model = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> arm = flexible.FlexibleRobot(model, {1: flexible.beam(1.0, EI=(np.inf, 9.0), hub=0.1)})
    >>> motion = trajectories.quintic([0.0], [0.5], duration=1.0)
    >>> tip_tracking(arm, motion, method="causal").status
    <TipStatus.NON_MINIMUM_PHASE: 1>
    """
    if method not in _METHODS:
        raise InvalidValueError(f"method: expected one of {_METHODS}, got {method!r:.40}.")
    if len(check_arm(arm).joints) or not arm.m:
        raise InvalidValueError(
            "arm: tip tracking is for flexible links with rigid joints. Take rest_to_rest or "
            "joint_tracking for flexible joints, and computed torque for rigid arms."
        )
    at, motion = motion_of(reference, arm.n), getattr(reference, "trajectory", reference)
    given = getattr(motion, "duration", None) if duration is None else duration
    T = as_number(np.nan if given is None else given, "duration", above=0.0)
    n, m = arm.n, arm.m
    zeros = linearize(arm, at(0.0)[0], "tip").zeros
    unstable = zeros[zeros.real > _UNSTABLE * np.abs(zeros)]
    slowest = float(unstable.real.min()) if unstable.size else np.inf
    before = _TIME_CONSTANTS / slowest if preview is None else preview
    before = as_number(before, "preview", least=0.0)
    nothing: Any = [np.zeros((0, k)) for k in (n, n, n, m, m)]
    if method == "causal" and unstable.size:
        refused = TipStatus.NON_MINIMUM_PHASE
        return TipTracking(arm, np.zeros(0), *nothing, zeros=zeros, preview=0.0, status=refused)
    after = before if unstable.size else 0.0
    ends = ((-before, 0.0), (0.0, T), (T, T + after))  # with nodes where the motion has kinks
    parts = [np.linspace(a, b, _PART, endpoint=False) for a, b in ends if b > a]
    grid = np.append(np.concatenate(parts), T + after)

    def path(times: Array) -> list[Array]:
        """Positions, velocities and accelerations (N, n), at rest before and after."""
        inside = ((times > 0.0) & (times < T))[:, None]
        if hasattr(motion, "a"):
            q, v, a = at(np.clip(times, 0.0, T))  # type: ignore[arg-type]
        else:
            samples = [at(float(t)) for t in np.clip(times, 0.0, T)]
            q, v, a = (np.array(x) for x in zip(*samples, strict=True))
        return [q.reshape(-1, n), v.reshape(-1, n) * inside, a.reshape(-1, n) * inside]

    found: Any = _inverted(arm, grid, path)
    if found is None:
        return TipTracking(
            arm, np.zeros(0), *nothing, zeros=zeros, preview=before, status=TipStatus.NOT_FOUND
        )
    return TipTracking(arm, grid, *found, zeros=zeros, preview=before, status=TipStatus.FOUND)


def _inverted(
    arm: FlexibleRobot, grid: Array, reference: Callable[[Array], list[Array]]
) -> list[Array] | None:
    """Motion and torques at times (N,) by a boundary value problem."""
    from scipy.integrate import solve_bvp
    from scipy.interpolate import make_interp_spline

    n, m, N, path = arm.n, arm.m, len(grid), reference(grid)[0]
    gain = tip_gain(jacobian(arm, path, np.zeros((N, m))), n).reshape(N, n * m)
    gains = make_interp_spline(grid, gain, k=5)

    def motors(t: Array, e: Array, ev: Array) -> tuple[Array, Array, Array, Array]:
        """Motion of the motors without the share of the elastic accelerations, and the gain."""
        t = np.atleast_1d(t)
        H, dH, ddH = (gains(t, order).reshape(-1, n, m) for order in range(3))
        wanted = reference(t)
        y, dy, ddy = (x - shift(t, order) for order, x in enumerate(wanted))
        x, dx = e[..., None], ev[..., None]
        v, a = dy - (dH @ x + H @ dx)[..., 0], ddy - (ddH @ x + 2.0 * dH @ dx)[..., 0]
        return y - (H @ x)[..., 0], v, a, H

    def rate(t: Array, z: Array) -> Any:
        e, ev = z[:m].T, z[m:].T
        q, v, a, H = motors(t, e, ev)
        M = mass_matrix(arm, q, e)
        force = generalized_forces(arm, q, e, v, ev, a, 0.0 * e)[1]
        return np.vstack([ev.T, np.linalg.solve(zero_mass(M, H), -force[..., None])[..., 0].T])

    def zero_mass(M: Array, H: Array) -> Any:
        return M[..., n:, n:] - M[..., n:, :n] @ H

    def rest(t: float) -> tuple[Any, Any]:
        """Equilibrium with the tip on the path, and matrix of the zero dynamics about it."""
        e = np.zeros((1, m))
        for _ in range(_CORRECTIONS):
            q = motors(np.array([t]), e, 0.0 * e)[0]
            e = static_deflection(arm, q).e
        H, M = gains(t).reshape(n, m), mass_matrix(arm, q, e)[0]
        K, D = tangent(arm, np.concatenate([q[0], e[0]])), damping_matrix(arm)
        stiff = np.hstack([K[n:, n:] - K[n:, :n] @ H, D[n:, n:]])
        upper = np.hstack([np.zeros((m, m)), np.eye(m)])
        return np.append(e, np.zeros(m)), np.vstack(
            [upper, -np.linalg.solve(zero_mass(M, H), stiff)]
        )

    correction, nodes = np.zeros_like(path), grid[::_EVERY]
    guess, stiffness = np.zeros((2 * m, len(nodes))), stiffness_matrix(arm)[n:, n:]
    for k in range(_CORRECTIONS):
        shift = make_interp_spline(grid, correction, k=5)
        for _ in range(0 if k else _CORRECTIONS):  # deflection by the loads of the slow motion
            e, ev = guess[:m].T, guess[m:].T
            q, v, a, H = motors(nodes, e, ev)
            force = generalized_forces(arm, q, e, v, ev, a, 0.0 * e)[1]
            guess[:m] = (e - np.linalg.solve(stiffness, force.T).T).T
            guess[m:] = np.gradient(guess[:m], nodes, axis=1)
        (start, A), (end, B) = rest(grid[0]), rest(grid[-1])
        kept = _left_space(A, False)
        left = _left_space(B, True, 2 * m - len(kept))
        rows = np.hstack([np.vstack([kept, 0.0 * left]), np.vstack([0.0 * kept, left])])
        ends = np.concatenate([start, end])
        found = solve_bvp(
            rate, partial(_boundary, rows, ends), nodes, guess, tol=_TOLERANCE, max_nodes=_NODES
        )
        if found.status or not np.isfinite(found.y).all():
            return None
        nodes, guess = found.x, found.y
        z = found.sol(grid)
        e, ev, e_a = z[:m].T, z[m:].T, rate(grid, z)[m:].T
        q, v, a, H = motors(grid, e, ev)
        away = _from_path(arm, q, e, path)
        correction = correction + away
        if np.abs(away).max() < _ON_PATH:
            break
    a = a - (H @ e_a[..., None])[..., 0]
    return [q, v, idm(arm, q, e, v, ev, a)[0], e, ev]


def _boundary(rows: Array, ends: Array, a: Array, b: Array) -> Array:
    """Conditions on the states at both ends."""
    return rows @ (np.concatenate([a, b]) - ends)


def _left_space(A: Array, unstable: bool, count: int | None = None) -> Array:
    """Rows that span the left eigenvectors of the unstable, or of all other, eigenvalues."""
    from scipy.linalg import schur

    def chosen(re: float, im: float) -> bool:
        return (re > _UNSTABLE * abs(complex(re, im))) == unstable

    _, Z, k = schur(A.T, sort=chosen)
    return Z[:, : k if count is None else count].T


def _from_path(arm: FlexibleRobot, q: Array, e: Array, path: Array) -> Array:
    """Motion of the joints (N, n) between the tip and where the rigid arm has it."""
    T, at = dgm(arm, q, e), dgm(arm, path)
    J = jacobian(arm, path)[..., : arm.n]
    R = T[:, :3, :3] @ at[:, :3, :3].swapaxes(1, 2)
    turn = 0.5 * np.stack(
        [R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], -1
    )
    moved = np.hstack([T[:, :3, 3] - at[:, :3, 3], turn])
    return (tip_gain(np.concatenate([J, moved[..., None]], axis=-1), arm.n))[..., 0]
