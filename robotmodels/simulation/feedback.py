"""Feedback in a simulation: control laws with a state of their own, sampling and delay."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import ceil
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, as_exact
from ..errors import InvalidValueError, ShapeError

Law = Callable[[float, Array, Array, Array], Array]
"""Torques, or rates of the state, at time t, positions q, velocities v and state x."""

_MOST_SAMPLES = 10_000_000
_NONE = np.empty(0)


@runtime_checkable
class StatefulControl(Protocol):
    """A control law with a state x (k,), such as an integral or an estimate.

    The torque is ``command(t, q, v, x)``, shape (n,); the state begins at ``state0`` and its time
    derivative is ``rate(t, q, v, x)``, shape (k,).

    Examples
    --------
    >>> class Integral:
    ...     state0 = np.zeros(6)
    ...     def command(self, t, q, v, x):
    ...         return -4.0 * q - 4.0 * v - x
    ...     def rate(self, t, q, v, x):
    ...         return q
    >>> isinstance(Integral(), StatefulControl)
    True
    """

    @property
    def state0(self) -> ArrayLike: ...  # noqa: D102
    def command(self, t: float, q: Array, v: Array, x: Array) -> ArrayLike: ...  # noqa: D102
    def rate(self, t: float, q: Array, v: Array, x: Array) -> ArrayLike: ...  # noqa: D102


class Feedback:
    """A control law as the integration calls it, which integrates its state from `state0`."""

    instants: tuple[float, ...] = ()

    def __init__(self, command: Law | None, rate: Law | None = None, state0: Array = _NONE) -> None:
        self.torque, self.rate, self.state0 = command, rate, state0

    def state(self, x: Array) -> Array:
        """State of the law (k,), from the part that is integrated."""
        return x


class Sampled(Feedback):
    """A law that is sampled every `period`: its state advances by Euler steps of one period.

    Its torques are held; each acts `delay` later, the first ones are zero. `instants` within
    rounding of the times `near` are these times.
    """

    def __init__(
        self, law: Feedback, ends: tuple[float, float], period: float, delay: float, near: Array
    ) -> None:
        start, end = ends
        if law.torque is None:
            raise InvalidValueError("period: there is no control to sample; give control.")
        if (end - start) / period > _MOST_SAMPLES:
            raise InvalidValueError(
                f"period: {period:.3g} s would sample more than {_MOST_SAMPLES} times."
            )
        if delay and delay >= end - start:
            raise InvalidValueError(
                f"delay: expected less than the duration {end - start:.6g} s, got {delay:.6g} s; "
                "no torque would act."
            )
        k = np.arange(max(1.0, ceil((end - start) / period - 1e-9)))
        tolerance = 1e-9 * period
        # a torque that acts at a later sample acts exactly then
        whole = int(delay / period + 1e-9)
        rest = delay - whole * period
        taken = _snapped(start + period * k, near, tolerance)
        acts = start + period * (k + whole) + (rest if rest >= tolerance else 0.0)
        acts = _snapped(acts, near, tolerance)
        super().__init__(lambda t, q, v, x: 0.0 * v if self._held is None else self._held)
        self.instants = tuple(sorted({*taken.tolist(), *acts[acts < end].tolist()}))
        self._samples = deque(zip(taken.tolist(), acts.tolist(), strict=True))
        self._waiting: deque[tuple[float, Array]] = deque()
        self._command, self._rate, self._period = law.torque, law.rate, period
        self._held: Array | None = None
        self._state = self._next = law.state0

    def tick(self, t: float, q: Array, v: Array) -> None:
        """Sample the law, and change the torque that is held, if this is the instant to do so."""
        if self._samples and self._samples[0][0] <= t:
            x = self._state = self._next
            self._waiting.append((self._samples.popleft()[1], self._command(t, q, v, x)))
            if self._rate is not None:
                self._next = x + self._period * self._rate(t, q, v, x)
        while self._waiting and self._waiting[0][0] <= t:
            self._held = self._waiting.popleft()[1]

    def state(self, x: Array) -> Array:
        """State of the law (k,) at the last sample."""
        return self._state


def _snapped(times: Array, near: Array, tolerance: float) -> Array:
    """Times, replaced by the nearest of other times where they differ by rounding only."""
    if not near.size:
        return times
    near = np.sort(near)
    after = np.minimum(np.searchsorted(near, times - tolerance), near.size - 1)
    return np.where(np.abs(near[after] - times) <= tolerance, near[after], times)


def stateful(control: StatefulControl, n: int) -> Feedback:
    """Feedback by a law with a state; its results are checked."""
    state0 = as_core(control.state0, (), "control.state0")
    if state0.ndim != 1:
        raise ShapeError(f"control.state0: expected shape (k,), got {state0.shape}.")
    return Feedback(
        checked(control.command, n, "control.command"),
        checked(control.rate, state0.size, "control.rate"),
        state0.copy(),
    )


def checked(law: Callable[..., Any], size: int, name: str) -> Callable[..., Array]:
    """User function of time and state with checks of its values."""

    def value(t: float, *state: Array) -> Array:
        where = f"{name} at t = {t:.9g} s"
        try:
            answer = law(t, *(x.copy() for x in state))
        except Exception as error:
            error.add_note(f"Raised by {where}.")
            raise
        return as_exact(answer, (size,), where)

    return value
