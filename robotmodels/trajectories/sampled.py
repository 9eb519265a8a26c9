"""Plain arrays of poses or joint positions between two ends, as ``ctraj`` and ``jtraj`` give."""

from __future__ import annotations

from operator import index
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_floats
from .._choices import chosen
from ..errors import InvalidValueError, ShapeError
from ..se3.orientation import rotation_vectors_of
from .laws import TimeLaw, law_of_duration
from .paths import axis_and_angle, rotation_about
from .piecewise import PiecewisePolynomial
from .point_to_point import quintic
from .trajectory import Samples, Trajectory

_MOST = 10**9
"""Samples; more would be a mistake."""


def cartesian_trajectory(
    T0: Any, T1: Any, N: int, law: TimeLaw | str = TimeLaw.TRAPEZOIDAL
) -> Array:
    """Poses on the straight line between two poses, at equal steps of time.

    Also called ``ctraj`` (`TimeLaw.LINEAR`: ``trinterp``). The position moves on a line, the
    orientation turns about one fixed axis by the shorter way (slerp), both by the same time law:
    by default a trapezoid of velocity whose ramps take a third of the time each.

    Parameters
    ----------
    T0, T1 : array_like, shape (..., 4, 4)
        First and last poses, m; leading axes broadcast.
    N : int
        Number of poses, both ends included; a single one is ``T0``.
    law : TimeLaw or str
        How the motion is distributed over the time; a member or its name.

    Returns
    -------
    ndarray, shape (..., N, 4, 4)
        Poses. The first and the last are those given.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        What are no poses; ``N`` that is not a whole number from 0; `TimeLaw.JERK_LIMITED`, whose
        shape depends on limits (see `straight_line`).

    References
    ----------
    Seed book section 4.3; the exercise, section 4.3 (``ctraj``).

    Examples
    --------
    >>> from robotmodels.se3 import rotation, translation
    >>> T = cartesian_trajectory(np.eye(4), translation(0.3, 0, 0) @ rotation("z", 1.0), 50)
    >>> T.shape, bool((T[0] == np.eye(4)).all())
    ((50, 4, 4), True)
    """
    first, last = se3.as_pose(T0, "T0"), se3.as_pose(T1, "T1")
    N = _whole(N, "N")
    law = chosen(TimeLaw, law, "law")
    try:
        batch = np.broadcast_shapes(first.shape[:-2], last.shape[:-2])
    except ValueError:
        raise ShapeError(
            f"The leading (batch) axes do not broadcast: T0 {first.shape}, T1 {last.shape}."
        ) from None
    first, last = (np.broadcast_to(T, (*batch, 4, 4))[..., None, :, :] for T in (first, last))
    s = _progress(law, N)
    R0 = first[..., :3, :3]
    # the turn seen in the world's axes
    axis, angle = axis_and_angle(rotation_vectors_of(last[..., :3, :3] @ np.swapaxes(R0, -1, -2)))
    T = np.zeros((*batch, N, 4, 4))
    T[..., :3, :3] = rotation_about(axis, angle * s) @ R0
    T[..., :3, 3] = first[..., :3, 3] + s[:, None] * (last[..., :3, 3] - first[..., :3, 3])
    T[..., 3, 3] = 1.0
    if N:
        T[..., -1:, :, :] = last
        T[..., :1, :, :] = first
    return T


def joint_trajectory(
    q0: ArrayLike,
    q1: ArrayLike,
    N: int | ArrayLike,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
) -> Samples:
    """Positions, velocities and accelerations between two postures, fifth-order polynomials.

    Also called ``jtraj``. For limits, other laws and continuous time see `quintic` and the other
    generators of a `Trajectory`.

    Parameters
    ----------
    q0, q1 : array_like, shape (..., n)
        First and last postures, rad or m.
    N : int or array_like, shape (N,)
        How many samples, equally spaced over one second; or their times, s, ascending. The motion
        lasts from the first time to the last.
    v0, v1 : array_like, shape () or (..., n)
        Velocities at the ends, rad/s or m/s.

    Returns
    -------
    Samples
        ``t (N,)`` and ``q, v, a, jerk (..., N, n)``; the object itself passes as the array of its
        positions.

    Raises
    ------
    ShapeError, InvalidValueError
        Vectors of different lengths, NaN, times that do not ascend.

    References
    ----------
    Seed book section 4.2.1.

    Examples
    --------
    >>> path = joint_trajectory([0.0, 1.0], [1.0, -1.0], 5)
    >>> path.q[2], path.q.shape
    (array([0.5, 0. ]), (5, 2))
    >>> joint_trajectory([0.0], [1.0], [0.0, 1.0, 2.0]).v.ravel()
    array([0.    , 0.9375, 0.    ])
    """
    if not isinstance(N, (list, tuple)) and np.ndim(N) == 0:  # type: ignore[arg-type]
        t = np.linspace(0.0, 1.0, _whole(N, "N"))
    else:
        t = as_floats(N, "N")  # type: ignore[arg-type]
        if t.ndim != 1 or (t[1:] < t[:-1]).any():
            raise InvalidValueError("N: expected a number of samples or times that ascend.")
    start, duration = (float(t[0]), float(t[-1] - t[0])) if t.size else (0.0, 1.0)
    moves = quintic(q0, q1, duration or 1.0, v0=v0, v1=v1)
    times = t - start
    if times.size:
        times[-1] = duration
    samples = moves.at(times)
    return Samples(t, samples.q, samples.v, samples.a, samples.jerk)


def _progress(law: TimeLaw, N: int) -> Array:
    """Part of the way, from 0 to 1, at N equal steps of time."""
    one = np.ones(1)
    pieces = law_of_duration(law, one, one)
    breaks = np.concatenate((np.zeros((1, 1)), np.cumsum(pieces.durations, axis=-1)), axis=-1)
    motion = PiecewisePolynomial(breaks, pieces.coefficients[0][..., None])
    return Trajectory(motion, scalar=True).q(np.linspace(0.0, motion.duration, N))


def _whole(value: Any, name: str) -> int:
    try:
        number = index(value)
    except TypeError:
        number = -1
    if number < 0:
        raise InvalidValueError(f"{name}: expected a whole number from 0, got {value!r}.")
    if number > _MOST:
        raise InvalidValueError(f"{name}: expected at most {_MOST} samples, got more.")
    return number
