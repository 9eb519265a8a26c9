"""Tracking in the operational space: inversion of the tip's motion (section 7.3.3.4).

The output is ``y = q + J_q^+ J_e e``, corrected until the tip is on the path in the directions in
which the joints move it. Its zero dynamics are a boundary value problem, which needs a preview of
the motion.

Parameters
----------
arm : FlexibleRobot
    The robot, n joints up to six; rigid joints.
reference : Trajectory or callable
    Motion of the joints of the rigid arm: its tip is the reference. A function of t returns
    (q, v, a) and needs ``duration``.
method : str
    ``"stable_inversion"``, or ``"causal"``, refused by status where a zero is unstable.
duration, preview : float, optional
    Of the reference, s, default that of the trajectory; default 14 time constants of the slowest
    unstable zero, s.

Returns
-------
TipTracking
    ``t`` (N,), s, from ``-preview`` on, empty if refused; motion ``q, v, e, e_v`` and torques
    ``tau``; ``zeros`` (2 m,) of the tip at the start, 1/s; status.

References
----------
S. Devasia, D. Chen, B. Paden, IEEE Trans. Automatic Control 41 (1996).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_floats, as_number
from .._choices import one_of
from .._outcomes import Outcome, Result
from ..errors import InvalidValueError
from .control import motion_of
from .linear import linearize, scales, tip_inverse
from .models import cross, dgm, forces, jacobian, mass_matrix
from .robot import FlexibleRobot, check_arm

_METHODS = ("stable_inversion", "causal")
_TIME_CONSTANTS = 14.0  # of the slowest unstable zero: default preview
_SAMPLES, _MOST = 500, 5_000  # during the reference; in all
_NEWTON, _STEP, _DONE = 15, 1e-6, 1e-10  # iterations; step of differences; last correction
_UNSTABLE = 1e-6  # least real part of an unstable zero, relative to its size


class TipStatus(Outcome):
    """Outcome of an inversion; fits int8."""

    FOUND = 0, "The torques move the tip along its reference."
    NON_MINIMUM_PHASE = 1, "The tip is non-minimum-phase: take method='stable_inversion'."
    NOT_FOUND = 2, "No bounded motion of the joints was found; take a slower reference."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TipTracking(Result):
    """Motion of the joints that moves the tip of a flexible arm along a reference."""

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

    def torque(self, t: ArrayLike) -> Array:
        """Torques (..., n) at times (...), constant outside the motion."""
        return self._motion()(as_floats(t, "t"))[0]

    def control(self, kp: float, kd: float) -> Any:
        """Law (t, q, v): the torques, with gains kp and kd on the errors of the motors."""
        at = self._motion()

        def law(t: float, q: Array, v: Array) -> Array:
            tau, q_t, v_t = at(t)
            return tau + kp * (q_t - q) + kd * (v_t - v)

        return law

    def _motion(self) -> Any:
        """Function of time: torques, positions and velocities of the motors."""
        from scipy.interpolate import CubicSpline

        if not len(self.t):
            raise InvalidValueError(f"There are no torques. {self.reason()}")
        spline = CubicSpline(self.t, np.hstack([self.tau, self.q, self.v]))
        return lambda t: np.split(spline(np.clip(t, self.t[0], self.t[-1])), 3, axis=-1)


def tip_tracking(
    arm: FlexibleRobot,
    reference: Any,
    method: str = "stable_inversion",
    duration: float | None = None,
    preview: float | None = None,
) -> TipTracking:
    """Torques that move the tip as the rigid arm would be moved by a reference of its joints."""
    causal = one_of(method, _METHODS, "method") == "causal"
    if len(check_arm(arm).joints) or not arm.m:
        raise InvalidValueError(
            "arm: tip tracking is for flexible links with rigid joints; see joint_tracking."
        )
    at, motion = motion_of(reference, arm.n), getattr(reference, "trajectory", reference)
    given = getattr(motion, "duration", None) if duration is None else duration
    T = as_number(np.nan if given is None else given, "duration", above=0.0)
    zeros, last = (linearize(arm, at(t)[0], "tip").zeros for t in (0.0, T))
    unstable = [x.real[x.real > _UNSTABLE * np.abs(x)] for x in (zeros, last)]
    before, after = (_TIME_CONSTANTS / x.min() if x.size else 0.0 for x in unstable)
    before = before if preview is None else as_number(preview, "preview", least=0.0)
    status, found = TipStatus.NON_MINIMUM_PHASE, None
    if causal and unstable[0].size:
        before = 0.0
    else:
        h = max(T / _SAMPLES, (T + before + after) / _MOST)
        h = T / np.ceil(T / h)
        grid = h * np.arange(-np.ceil(before / h), np.ceil((T + after) / h) + 1.0)
        path = np.array([at(t)[0] for t in np.clip(grid, 0.0, T)]).reshape(-1, arm.n)
        found = _inverted(arm, h, path)
        status = TipStatus.NOT_FOUND if found is None else TipStatus.FOUND
    if found is None:
        grid, found = np.zeros(0), [np.zeros((0, k)) for k in (*[arm.n] * 3, arm.m, arm.m)]
    return TipTracking(arm, grid, *found, zeros=zeros, preview=before, status=status)


def _inverted(arm: FlexibleRobot, h: float, path: Array) -> list[Array] | None:
    """Motion and torques at times with the step h: Newton refinement of all samples together.

    Unknown are the rows (q, e), central differences their derivatives. The tip is on the path,
    and the forces on the elastic coordinates vanish. Shapes: path (N, n).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import splu

    (N, n), m, size = path.shape, arm.m, scales(arm)
    k, wanted = n + m, dgm(arm, path)
    inverse = tip_inverse(jacobian(arm, path), n)
    none = np.zeros((N, k))

    def equations(x: Array, dx: Array, ddx: Array) -> list[Any]:
        """Residuals (N, k), and their derivatives (N, k, k) by x, dx and ddx."""
        q, e = x[:, :n], x[:, n:]
        left, steps = forces(arm, x, dx, ddx)[0], _STEP * size
        y, dy, ddy = (np.repeat(r, k, axis=0) for r in (x, dx, ddx))
        unit = np.tile(np.diag(steps), (N, 1))
        moved = forces(arm, y + unit, dy, ddy)[0], forces(arm, y, dy + unit, ddy)[0]
        K, C = ((Q.reshape(N, k, k) - left[:, None]) / steps[:, None] for Q in moved)
        K, C, M, T = K.swapaxes(1, 2), C.swapaxes(1, 2), mass_matrix(arm, q, e), dgm(arm, q, e)
        R, W = T[:, :3, :3], wanted[:, :3, :3]
        turn = 0.5 * sum(cross(W[:, :, i], R[:, :, i]) for i in range(3))
        away = np.hstack([T[:, :3, 3] - wanted[:, :3, 3], turn])
        left[:, :n] = (inverse @ away[..., None])[..., 0]
        K[:, :n], C[:, :n], M[:, :n] = inverse @ jacobian(arm, q, e), 0.0, 0.0
        return [left, K, C, M]

    x = np.hstack([path, np.zeros((N, m))])
    for _ in range(_NEWTON):  # without accelerations
        left, K, C, M = equations(x, none, none)
        step = np.linalg.solve(K, left[..., None])[..., 0]
        x -= step
        if np.abs(step / size).max() < _DONE:
            break
    # at the start no share of zeros that are not unstable, at the end none of unstable ones
    first, last = (_left_space(M[i], C[i], K[i], n, i == 0) for i in (0, -1))
    if len(first[0]) + len(last[1]) > 2 * m:
        return None
    G = np.zeros((2 * m, N, k))
    for rows, i, beside in ((first[0], 0, 1), (np.vstack(last)[len(first[0]) - 2 * m :], -1, -2)):
        here, sign = G[len(G) - len(rows) :] if i else G[: len(rows)], 2 * i + 1
        here[:, i, n:] = rows[:, :m] - sign * rows[:, m:] / h
        here[:, beside, n:] = sign * rows[:, m:] / h
    G, slow, ddx = G.reshape(2 * m, N * k), x.copy(), none.copy()
    for _ in range(_NEWTON):
        dx, ddx[1:-1] = np.gradient(x, h, axis=0), (x[2:] - 2.0 * x[1:-1] + x[:-2]) / h**2
        left, K, C, M = equations(x, dx, ddx)
        blocks = np.stack([M / h**2 - 0.5 * C / h, K - 2.0 * M / h**2, M / h**2 + 0.5 * C / h], 1)
        blocks[[0, -1], :, n:], blocks[0, 0], blocks[-1, 2] = 0.0, 0.0, 0.0
        i, o, r, c = np.nonzero(blocks)
        j, column = np.nonzero(G)
        free = np.concatenate([np.arange(n, k), (N - 1) * k + np.arange(n, k)])
        left.ravel()[free] = G @ (x - slow).ravel()
        values = np.append(blocks[i, o, r, c], G[j, column])
        at = np.append(i * k + r, free[j]), np.append((i + o - 1) * k + c, column)
        step = splu(coo_array((values, at), (N * k, N * k)).tocsc()).solve(left.ravel())
        x -= step.reshape(N, k)
        moved = np.abs(step.reshape(N, k) / size).max()
        if not moved < 10.0:
            return None
        if moved < _DONE:
            drives = arm.model.drive_matrices
            v, tau = dx[:, :n], forces(arm, x, dx, ddx)[0][:, :n]
            tau = tau + (0.0 if drives is None else drives.torque(v.copy(), None))
            return [x[:, :n], v, tau, x[:, n:], dx[:, n:]]
    return None


def _left_space(M: Array, C: Array, K: Array, n: int, stable: bool) -> tuple[Array, Array]:
    """Rows of left eigenvectors of the zeros: of those that are not unstable, and of the others.

    Shapes: mass, damping and stiffness (n + m, n + m), whose first n rows are the path of the tip.
    """
    from scipy.linalg import schur

    m = len(M) - n
    H = np.vstack([-np.linalg.solve(K[:n, :n], K[:n, n:]), np.eye(m)])
    M, C, K = (B[n:] @ H for B in (M, C, K))
    A = np.block([[np.zeros((m, m)), np.eye(m)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])

    def chosen(re: float, im: float) -> bool:
        return (re > _UNSTABLE * abs(complex(re, im))) != stable

    _, Z, count = schur(A.T, sort=chosen)
    return (Z[:, :count].T, Z[:, count:].T) if stable else (Z[:, count:].T, Z[:, :count].T)
