"""The type that every generator returns: positions and their derivatives at any time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, Value, as_count, as_floats, as_number, read_only
from ..errors import InvalidValueError, ShapeError
from .limits import RATES, LimitsReport, MotionLimits, checked_limits, greatest
from .motions import FunctionMotion, Motion


class Sampled(Frozen, Value):
    """Base of results at times ``t``. As an array (``np.asarray``) it is its second field."""

    __slots__ = ()
    t: Array

    def __len__(self) -> int:
        return len(self.t)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(getattr(self, fields(self)[1].name), dtype=dtype, copy=copy)  # type: ignore[arg-type]

    def __repr__(self) -> str:
        values = {f.name: getattr(self, f.name) for f in fields(self)[1:]}  # type: ignore[arg-type]
        ends = " to ".join(f"{end:.4g}" for end in self.t[[0, -1]]) if self.t.size else "none"
        return f"<{type(self).__name__}: times {ends} s, {len(self)} samples; {greatest(values)}>"


@dataclass(frozen=True, slots=True, eq=False)
class Samples(Sampled):
    """A trajectory at given times. As an array (``np.asarray``) it is its positions.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Times, s.
    q, v, a, jerk : ndarray, shape (N, n)
        Positions and their first three derivatives, rad or m, and per s.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    jerk: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, np.ndarray) or value.flags.writeable:
                object.__setattr__(self, field.name, read_only(value))


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory(Value):
    """Motion of joints over a time from 0 to ``duration``.

    Before and after it the joints stay where they are, if the motion begins and ends at rest;
    a time outside of one that does not is an error. Pictures are drawn by `robotmodels.viz`.

    Parameters
    ----------
    motion : Motion
        Functions of time.
    scalar : bool
        Whether positions are numbers instead of vectors of joints.
    repeats : bool
        Whether the motion is periodic, so that every time is inside it.
    holds : bool
        Whether it stops at its ends whatever its velocity there, as the parameter of a path may.
    """

    motion: Motion
    scalar: bool = False
    repeats: bool = False
    holds: bool = False

    @classmethod
    def from_functions(
        cls,
        q: Callable[[Array], ArrayLike],
        duration: float,
        v: Callable[[Array], ArrayLike] | None = None,
        a: Callable[[Array], ArrayLike] | None = None,
        jerk: Callable[[Array], ArrayLike] | None = None,
    ) -> Self:
        """Motion by functions of times t (N,), which return arrays (N, n), or (N,) for scalars.

        Derivatives that are not given are differences of the last one given (relative errors
        of about 1e-10 of a first, 1e-8 of a second derivative if it is smooth). `check`
        looks at samples of such a motion.
        """
        end = as_number(duration, "duration", above=0.0)
        functions = (q, *(f for f in (v, a, jerk) if f is not None))
        given = [f is not None for f in (v, a, jerk)]
        if not all(map(callable, functions)) or given != sorted(given, reverse=True):
            raise InvalidValueError(
                "q, v, a, jerk: expected functions of time, each with those before it."
            )
        ends = np.array([0.0, 0.5 * end, end])
        shape = np.shape(q(ends))
        if len(shape) not in (1, 2) or shape[0] != 3 or shape[-1] == 0:
            raise ShapeError(f"q: expected an array (3, n) for three times, got shape {shape}.")
        motion = FunctionMotion(functions, end, 1 if len(shape) == 1 else shape[1])
        motion.derivatives(ends, (0, 1, 2, 3))
        return cls(motion, scalar=len(shape) == 1)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.motion.n

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.motion.duration

    def q(self, t: ArrayLike) -> Array:
        """Positions (t.shape..., n) at times t, rad or m; scalar ones without the last axis.

        A time outside of a motion that does not rest there is an error.
        """
        return self._at(t, (0,))[0]

    def v(self, t: ArrayLike) -> Array:
        """Velocities, rad/s or m/s, as `q`."""
        return self._at(t, (1,))[0]

    def a(self, t: ArrayLike) -> Array:
        """Accelerations, rad/s^2 or m/s^2, as `q`; where they jump, the value after the jump."""
        return self._at(t, (2,))[0]

    def jerk(self, t: ArrayLike) -> Array:
        """Derivatives of the accelerations, as `q`, without the pulses where those jump."""
        return self._at(t, (3,))[0]

    def at(self, t: ArrayLike) -> Samples:
        """Positions and derivatives together at times t."""
        times = read_only(as_floats(t, "t"))
        values = self._at(times, (0, 1, 2, 3))
        for value in values:
            value.setflags(write=False)  # nobody else has them: they need no copy
        return Samples(times, *values)

    def resample(self, samples: int | None = None, period: float | None = None) -> Samples:
        """The motion on the regular grid of time of `grid`."""
        return self.at(self.grid(samples, period))

    def grid(self, samples: int | None = None, period: float | None = None) -> Array:
        """Times (N,): ``samples`` from 0 to the duration, or multiples of ``period``, s.

        Those end at or after the duration, or before it where the motion does not end at rest.
        """
        T = self.duration
        if samples is not None and period is None:
            return np.linspace(0.0, T, as_count(samples, "samples", 1))
        if samples is not None or period is None:
            raise InvalidValueError("resample: give either samples or period.")
        step = as_number(period, "period", above=0.0)
        near = round(T / step)
        if abs(T / step - near) <= 1e-9 * max(1.0, T / step):  # a multiple up to rounding
            return np.minimum(step * np.arange(near + 1.0), T)
        at_rest = self.repeats or self.holds or not self._moving(np.array([T]))
        return step * np.arange(int(T / step) + 1.0 + at_rest)

    def check(self, limits: MotionLimits, tolerance: float = 1e-9) -> LimitsReport:
        """Compare the motion with limits, everywhere on it and not at samples only.

        ``tolerance`` is the relative overshoot that counts as rounding.
        """
        bounds = checked_limits(limits, self.n)
        if bounds is None:
            raise InvalidValueError("limits: expected MotionLimits, got None.")
        q, v, a, jerk = (np.stack(self.motion.extremes(order)) for order in range(4))
        return LimitsReport(bounds, q, v, a, jerk, tolerance)

    def _moving(self, ends: Array) -> bool:
        """Whether any joint has a velocity at one of the times."""
        (v,) = self.motion.derivatives(ends, (1,))
        scale = np.abs(self.motion.extremes(1)).max(initial=0.0)
        return bool(np.abs(v).max(initial=0.0) > 1e-9 * scale)

    def _at(self, given: ArrayLike, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives at times, those outside of the motion included."""
        t, end, outside = as_floats(given, "t"), self.duration, None
        flat = t.reshape(-1)
        if not self.repeats and ((flat < 0.0) | (flat > end)).any():
            # a few roundings beside an end, where sums of steps arrive, are the end
            slack = 4.0 * np.spacing(end)
            before, after = flat < -slack, flat > end + slack
            for beyond, edge, side in (
                (before, 0.0, "before the start"),
                (after, end, "after the end"),
            ):
                if not self.holds and beyond.any() and self._moving(np.array([edge])):
                    raise InvalidValueError(
                        f"t: {float(flat[beyond][0]):g} s is {side} of a motion of {end:g} s that "
                        "does not rest there; give times inside it."
                    )
            flat, outside = np.clip(flat, 0.0, end), before | after
        values = self.motion.derivatives(flat, orders)
        for value, order in zip(values, orders, strict=True):
            if outside is not None and order:
                value[outside] = 0.0
        shape = t.shape if self.scalar else (*t.shape, self.n)
        return [value.reshape(shape) for value in values]

    def __repr__(self) -> str:
        peaks = [np.stack(self.motion.extremes(order)) for order in (1, 2, 3)]
        text = greatest(dict(zip(RATES, peaks, strict=True)))
        return f"<Trajectory: n = {self.n}, {self.duration:.6g} s; {text}>"


class TimingResult(Frozen, Value):
    """Base of what the search of a motion under limits gives."""

    __slots__ = ()

    trajectory: Trajectory | None
    status: Any
    explanation: str

    @property
    def duration(self) -> float:
        """Seconds; NaN without a motion."""
        return np.nan if self.trajectory is None else self.trajectory.duration

    def reason(self) -> str:
        """The status as a sentence, with the place and the joint."""
        return self.explanation or self.status.sentence

    def __repr__(self) -> str:
        values = ((f.name, getattr(self, f.name)) for f in fields(self))  # type: ignore[arg-type]
        more = [f", {name} {x:.4g}" for name, x in values if isinstance(x, float)]
        text = f"{self.duration:.6g} s{''.join(more)}" if self.trajectory else self.reason()
        return f"<{type(self).__name__}: {self.status.name}, {text}>"
