"""Parts of all control laws: defaults, gains, references, and torques of the model of the law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from math import isfinite
from typing import Any

import numpy as np

from .._arrays import Array, Value, as_exact, as_floats, as_number, as_vector, read_only
from ..dynamics import gravity_torque, idm
from ..dynamics.inverse import motion_torques, warn_without_masses
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel
from ..se3 import as_single_pose
from ..trajectories import PoseTrajectory, Trajectory

NONE = read_only([])
NO_WRENCH = read_only(np.zeros(6))
POSE = (4, 4), (6,), (6,)
WRENCH = (6,), (6,), (6,)
_SLOWEST = 5e-324

Desired = Callable[[float], tuple[Array, ...]]
"""Value, rate and second rate at a time."""


class Law(Value):
    """Defaults of control laws: no state, continuous, without a Lyapunov function."""

    __slots__ = ()

    switches: Any = False
    """Whether the torque or the rate of the state jumps: a continuous simulation would stall."""
    state0: Any = NONE
    """State at the start, shape (k,)."""

    @property
    def n(self: Any) -> int:
        """Number of joints."""
        return self.model.n

    def command(self: Any, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Torques (n,) at positions, velocities (n,), state (k,) and measured wrench (6,)."""
        return self._torques(*self._measured(t, q, v, x, wrench))

    def rate(self: Any, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Time derivative of the state, shape (k,)."""
        return self._rate(*self._measured(t, q, v, x, wrench)) if self.state0.size else NONE

    def error(self: Any, t: float, q: Any, v: Any, wrench: Any = None) -> Array:
        """Error of the law: of the joints (n,), of components of the task (m,), or of forces."""
        return self._error(*self._measured(t, q, v, self.state0, wrench))

    def lyapunov(self, plant: RobotModel, t: float, q: Array, v: Array, x: Array) -> float | None:
        """Lyapunov function at a state of the plant, None where the law has none."""
        return None

    def notes(self, t: Array, q: Array, v: Array) -> tuple[str, ...]:
        """Sentences about a motion (N, n)."""
        return ()

    @property
    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, f.name) for f in fields(self) if f.init)  # type: ignore[arg-type]

    def _set(self, **values: Any) -> None:
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value = read_only(value, value.dtype.type)
            object.__setattr__(self, name, value)

    def _keep_gains(
        self, names: tuple[str, ...], n: int | None, zero: str = "", rows: Any = None
    ) -> None:
        """Check positive gains: one number, or one for each of n components; six are of all rows.

        Gains of the name `zero` may be zero. With rows each component gets its own.
        """
        for name in names:
            gains = as_floats(getattr(self, name), name)
            gains = gains[rows] if rows is not None and gains.shape == (6,) else gains
            if gains.ndim and (gains.ndim > 1 or n not in (None, gains.size)):
                raise ShapeError(
                    f"{name}: expected one number, or one for each of {n or 'n'} joints or "
                    f"components of the task, got shape {gains.shape}."
                )
            if not ((gains >= 0.0) if name == zero else (gains > 0.0)).all():
                least = "at least 0" if name == zero else "above 0"
                raise InvalidValueError(f"{name}: expected gains {least}, got {gains.tolist()}.")
            self._set(**{name: gains if rows is None else np.full(len(rows), gains)})

    def _keep_reference(
        self, shapes: Any = None, n: int | None = None, name: Any = "reference"
    ) -> int:
        """Check the reference: of joints (their number is returned), a pose or a wrench."""
        given = getattr(self, name)
        desired = desired_of(given, shapes, name)
        first = desired(0.0)[0]
        moves = callable(given) or isinstance(given, (Trajectory, PoseTrajectory))
        self._set(_desired=desired, **{name: given if moves else first})
        if not first.size or n not in (None, first.size):
            raise ShapeError(
                f"{name}: expected {n or 'one or more'} joints, those of the model, "
                f"got {first.size}."
            )
        return first.size

    def _measured(self, t: Any, q: Any, v: Any, x: Any, wrench: Any) -> tuple[Any, ...]:
        """Checked t, q, v, x and wrench; the wrench is zero without a sensor."""
        k, q, v = self.state0.size, as_vector(q, self.n, "q"), as_vector(v, self.n, "v")
        if q.ndim != 1 or v.ndim != 1:
            raise ShapeError(f"q, v: expected one posture, shape (n,), got {q.shape}, {v.shape}.")
        t = t if isinstance(t, float) and isfinite(t) else as_number(t, "t")
        x = as_vector(x, k, "x") if k or np.size(x) else NONE
        return t, q, v, x, NO_WRENCH if wrench is None else as_vector(wrench, 6, "wrench")


def desired_of(reference: Any, shapes: Any = None, name: str = "reference") -> Desired:
    """Function of time of a motion, function or constant; without shapes that of joints."""
    if shapes is None and isinstance(reference, Trajectory):
        motion, end, n = reference.motion, float(reference.duration), reference.n

        def joints(t: float) -> tuple[Array, ...]:
            if 0.0 <= t <= end:  # without the checks of a trajectory
                q, v, a = motion.derivatives(np.array([t], np.float64), (0, 1, 2))
            else:
                q, v, a = reference.q(t), reference.v(t), reference.a(t)
            return q.reshape(n), v.reshape(n), a.reshape(n)

        return joints
    if shapes is POSE and isinstance(reference, PoseTrajectory):

        def pose(t: float) -> tuple[Array, ...]:
            there = reference.at(np.array([t]))
            return there.T[0], there.twist[0], there.acceleration[0]

        return pose
    if callable(reference):

        def function(t: float) -> tuple[Array, ...]:
            where, answer = f"{name}({t:g})", reference(t)
            if not isinstance(answer, (tuple, list)) or len(answer) != 3:
                raise InvalidValueError(
                    f"{where}: expected three arrays, got {type(answer).__name__}."
                )
            values = tuple(as_floats(x, where) for x in answer)
            wanted, found = shapes or ((values[0].size,),) * 3, tuple(x.shape for x in values)
            if found != wanted:
                raise ShapeError(f"{where}: expected shapes {wanted}, got {found}.")
            return values

        if function(0.0)[0].shape == POSE[0]:
            as_single_pose(function(0.0)[0], f"{name}(0)")
        return function
    if shapes is POSE:
        value = as_single_pose(reference, name).copy()
    elif shapes is WRENCH:
        value = as_exact(reference, (6,), name).copy()
    elif (value := as_floats(reference, name).copy()).ndim != 1:
        raise ShapeError(f"{name}: expected positions of shape (n,), got {value.shape}.")
    rest = np.zeros(value.size if shapes is None else 6)
    return lambda t: (value, rest, rest)


def model_torques(model: RobotModel, q: Array, v: Array, a: Array) -> Array:
    """Inverse dynamics; a joint at rest has the dry friction of its direction of acceleration."""
    if model.twin.torques_warn:
        warn_without_masses(model)
    return motion_torques(model, q, started(v, a), a)


def virtual_torques(model: RobotModel, q: Array, v: Array, v_r: Array, a_r: Array) -> Array:
    """``A a_r + C(q, v) v_r + Q`` of the bodies.

    C(q, v) v_r is symmetric in both velocities: a difference of squares of half sums.
    """
    less = idm(model, q, 0.5 * (v - v_r), drive=False) - gravity_torque(model, q)
    return idm(model, q, 0.5 * (v + v_r), a_r, drive=False) - less


def started(v: Array, towards: Array) -> Array:
    """Velocities, the smallest ones in the given direction for joints at rest."""
    return v if v.all() else np.where(v == 0.0, _SLOWEST * np.sign(towards), v)
