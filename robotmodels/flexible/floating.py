"""Motion of one elastic body in space (section 7.2.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, Value, as_exact
from ..errors import InvalidValueError
from ..geometry import DHTable
from ..model import RobotModel
from ..simulation import Integrator
from .link import FlexibleLink
from .robot import FlexibleRobot
from .simulate import FlexibleMotionStatus, cross, followed, relative


@dataclass(frozen=True, slots=True, eq=False)
class FreeBodyMotion(Frozen, Value):
    """Motion of an elastic body without loads (section 7.2.2).

    Parameters
    ----------
    t : ndarray, shape (N,)
        Times, s.
    pose : ndarray, shape (N, 4, 4)
        Of the frame at the root, in the world.
    twist : ndarray, shape (N, 6)
        Its velocity [v; w] in its own axes.
    e, e_v : ndarray, shape (N, m)
        Elastic coordinates and velocities.
    energy : ndarray, shape (N,)
        Kinetic and elastic energy, J.
    momentum : ndarray, shape (N, 6)
        Linear and angular momentum about the origin of the world.
    status : FlexibleMotionStatus
        Why it ended.
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
        return relative(self.momentum - self.momentum[0], self.momentum)

    def reason(self) -> str:
        """The sentence of the status."""
        return self.status.sentence

    def __repr__(self) -> str:
        return f"<FreeBodyMotion: {self.t[-1]:.6g} s, energy drift {self.energy_drift:.1g}>"


def _spinnable(link: FlexibleLink) -> FlexibleLink:
    """The link with inertia about every axis."""
    inv = link.invariants
    values, axes = np.linalg.eigh(inv.inertia)
    if values[0] > 1e-9 * values[-1]:
        return link
    more = inv.mass * (0.1 * link.length) ** 2 * np.outer(axes[:, 0], axes[:, 0])
    return replace(link, invariants=replace(inv, inertia=inv.inertia + more))


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
    """Motion of an elastic body that floats without loads (section 7.2.2).

    Parameters
    ----------
    link : FlexibleLink
        The body, m modes. A line without inertia about its axis, such as a beam without gyration,
        gets that of a radius of length / 10.
    e0, e_v0 : array_like, shape (m,)
        Elastic coordinates and velocities at the start.
    v0 : array_like, shape (6,)
        Velocity [v; w] of the root at the start, where its axes are those of the world.
    t : array_like
        A duration or ascending times (N,), s.
    rtol, atol, max_evaluations
        As for `simulate`.

    Returns
    -------
    FreeBodyMotion
        The motion with its energy and momenta.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    Examples
    --------
    >>> from robotmodels import flexible
    >>> link = flexible.beam(1.0, EI=(5.0, 8.0), density=1.0, gyration=0.02, modes=1)
    >>> motion = free_body(link, [0.01, 0.0], [0, 0, 0, 0.1, 0.2, 1.0], 1.0)
    >>> motion.energy_drift < 1e-9, motion.momentum_drift < 1e-9
    (True, True)
    """
    from scipy.spatial.transform import Rotation

    from .kernels import motions
    from .kernels_loads import loads

    if not isinstance(link, FlexibleLink):
        raise InvalidValueError(f"link: expected a FlexibleLink, got {type(link).__name__}.")
    link, m, none = _spinnable(link), link.m, np.zeros((1, 0))
    start = [
        as_exact(np.zeros(m) if x is None else x, (m,), s) for s, x in (("e0", e0), ("e_v0", e_v0))
    ]
    table = DHTable(antecedent=[0], sigma=[2])
    arrays = FlexibleRobot(RobotModel.from_table(table, gravity=(0, 0, 0)), {1: link}).arrays
    cuts = np.cumsum([m, m, 6, 4])
    flags, nothing = np.zeros(1, np.int64), np.zeros((1, m))

    def rate(t: float, y: Array) -> Array:
        e_a, base = np.empty((1, m)), np.empty((1, 10))
        rows = [y[None, a:b].copy() for a, b in ((0, m), (m, 2 * m), (2 * m, 2 * m + 6))]
        loads(
            arrays, none, rows[0], none, rows[1], none, nothing, np.zeros((1, 6)), rows[2], flags,
            1, 1, np.empty((1, 0)), e_a, base,
        )  # fmt: skip
        v, w, (*u, s) = (
            y[2 * m : 2 * m + 3].tolist(),
            y[2 * m + 3 :][:3].tolist(),
            y[2 * m + 6 :][:4],
        )
        turned, lever = cross(u, w), cross(u, v)
        again = cross(u, lever)
        out = np.empty_like(y)
        out[:m], out[m : 2 * m], out[2 * m : 2 * m + 6] = rows[1][0], e_a[0], base[0, :6]
        for k in range(3):
            out[2 * m + 6 + k] = 0.5 * (s * w[k] + turned[k])
            out[2 * m + 10 + k] = v[k] + 2.0 * (s * lever[k] + again[k])
        out[2 * m + 9] = -0.5 * sum(a * b for a, b in zip(u, w, strict=True))
        return out

    y0 = np.concatenate([*start, as_exact(v0, (6,), "v0"), [0.0, 0.0, 0.0, 1.0], np.zeros(3)])
    times, Y, status, _ = followed(
        rate, y0, t, Integrator.DOP853, rtol, atol, max_evaluations, None
    )
    e, ev, twist, quaternion, place = (np.ascontiguousarray(x) for x in np.split(Y, cuts, axis=1))
    N = len(times)
    out, empty = np.empty((N, 15)), np.zeros((N, 0))
    motions(arrays, empty, e, empty, ev, twist, np.empty((N, 2, 3, 4)), out)
    turn = Rotation.from_quat(quaternion)
    pose = np.tile(np.eye(4), (N, 1, 1))
    pose[:, :3, :3], pose[:, :3, 3] = turn.as_matrix(), place
    p = turn.apply(out[:, 3:6])
    momentum = np.hstack([p, turn.apply(out[:, 6:9]) + np.cross(place, p)])
    return FreeBodyMotion(times, pose, twist, e, ev, out[:, 0] + out[:, 2], momentum, status)
