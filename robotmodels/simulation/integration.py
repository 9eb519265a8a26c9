"""Event-driven integration: steps of SciPy's integrators, and event location in each step.

`solve_ivp` gives no partial result when a budget is used up, and looks for events at the ends of
its steps only; here they are looked for at eight times of each step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from math import nextafter
from typing import Any, NamedTuple

import numpy as np

from .._arrays import Array
from .._arrays.tasks import Progress, Workers
from ..errors import RobotModelsError
from .dry_friction import Mode
from .feedback import Sampled
from .motion import Motion
from .result import Integrator, SimulationEvent, SimulationEventKind, SimulationStatus

_LOOKS = 8  # number of evaluations of the event functions per step
_SLACK = 1e-9  # relative to the breakaway torque: ignored excess
_ROUNDING = 1e-13
_SAME_INSTANT = 64 * float(np.finfo(np.float64).eps)


class Event(NamedTuple):
    """An event: a part at rest, a joint at a limit (>= 0), or a breakaway (both -1)."""

    t: float
    part: int = -1
    limit: int = -1


class Integration:
    """One simulation: its state, mode, samples and events."""

    def __init__(
        self,
        motion: Motion,
        times: Array | None,
        limits: tuple[Array, Array] | None,
        method: Integrator,
        tolerances: Mapping[str, float],
        max_evaluations: int,
        progress: Progress,
    ) -> None:
        self.motion, self.dry, self.times = motion, motion.dry, times
        self.report = Workers(progress=progress)
        self.method, self.tolerances = method, tolerances
        self.max_evaluations, n = max_evaluations, motion.n
        # limits as rows of G y + c, which is negative beyond them
        G = np.hstack([np.vstack([-np.eye(n), np.eye(n)]), np.zeros((2 * n, n))])
        c = np.full(2 * n, np.inf) if limits is None else np.concatenate([limits[1], -limits[0]])
        self._limits = np.flatnonzero(np.isfinite(c))
        self._G, self._c = G[self._limits], c[self._limits]
        self.t: list[float] = []
        self.rows: list[tuple[Array, ...]] = []
        self.events: list[SimulationEvent] = []
        self.status = SimulationStatus.FINISHED
        self.steps, self._repeats, self._last_event, self._report_at = 0, 0, -np.inf, -np.inf
        self._step: float | None = None

    def follow(self, q: Array, v: Array, cuts: Sequence[tuple[float, bool]]) -> None:
        """Integrate between times at which laws have kinks or (True) jumps. Shapes: q, v (n,)."""
        control = self.motion.control
        t, y = cuts[0][0], np.concatenate([q, v, np.zeros(4), control.state0])
        self._start, self._end = t, cuts[-1][0]
        for (begin, jumped), (end, jumps) in pairwise(cuts):
            if self.status:
                break
            # laws are evaluated before a jump only, until it is reached
            self.motion.latest = max(nextafter(end, begin), begin) if jumps else np.inf
            if isinstance(control, Sampled):
                control.tick(t, *np.split(y[: 2 * len(q)].copy(), 2))
            if not self.t or jumped:
                y = self._decide(t, y, first=not self.t)
                if self.times is None or self._next == t:
                    self._sample(t, y)
            # samples at a jump belong to the time after it
            self._open = end if jumps and end < self._end else np.inf
            while t < end and not self.status:
                t, y, event = self._smooth(t, y, end)
                if event is not None:
                    y = self._change(t, y, event)
        if t > self.t[-1]:
            self._sample(t, y)

    def _smooth(self, t: float, y: Array, bound: float) -> tuple[float, Array, Event | None]:
        """Integrate without changes of mode, to a time, an event or a failure."""
        import scipy.integrate

        motion = self.motion
        method: Any = getattr(scipy.integrate, self.method.value)
        first = None if self._step is None else min(self._step, bound - t)
        watched = bool(self.dry.lower.size or self._limits.size)
        try:
            solver = method(motion.derivative, t, y, bound, first_step=first, **self.tolerances)
            failed = not np.isfinite(solver.h_abs)
            while solver.status == "running" and not failed:
                if motion.evaluations >= self.max_evaluations:
                    self.status = SimulationStatus.NOT_CONVERGED
                    return t, np.array(y), None
                before = float(solver.h_abs)
                solver.step()
                if failed := solver.status == "failed":
                    break
                motion.singular = False
                self.steps += 1
                old, t, y = t, float(solver.t), solver.y
                # the last step was shortened by the bound, the next need not be
                self._step = max(before, float(solver.h_abs))
                dense: Any = solver.dense_output() if watched or self._next < t else None
                event = self._first_event(old, t, dense) if watched else None
                if event is not None:
                    t, y, self._step = event.t, dense(event.t), None
                while (time := self._next) <= t and time != self._open:
                    self._sample(time, y if time == t else dense(time))
                if self.times is None and self.t[-1] < t != self._open:
                    self._sample(t, y)
                if t >= self._report_at:
                    self._report_at = t + 0.01 * (self._end - self._start)
                    self.report.done((t - self._start) / (self._end - self._start))
                if event is not None:
                    return t, np.array(y), event
        except ValueError as error:
            # NaN in the matrices of an implicit integrator; laws add notes to errors
            if isinstance(error, RobotModelsError) or hasattr(error, "__notes__"):
                raise
            failed = True
        if failed:
            singular = motion.singular
            self.status = SimulationStatus.SINGULAR if singular else SimulationStatus.STEP_TOO_SMALL
        return t, np.array(y), None

    @property
    def _next(self) -> float:
        """Time of the next sample that was requested."""
        if self.times is None or len(self.t) == len(self.times):
            return np.inf
        return float(self.times[len(self.t)])

    def _sample(self, t: float, y: Array) -> None:
        n, motion = self.motion.n, self.motion
        q, v, works, _, x = np.split(y.copy(), [n, 2 * n, 2 * n + 3, 2 * n + 4])
        at = motion.at(t, q, v, x)
        self.t.append(t)
        held = motion.joint_signs == 0.0
        state = motion.control.state(x)
        self.rows.append((q, v, at.a, at.tau.copy(), at.friction, held, works, state))

    def _first_event(self, t_old: float, t_new: float, dense: Any) -> Event | None:
        """The first event inside a step: speeds and limits are linear in y, margins are not."""
        n, mode = self.motion.n, self.motion.mode
        ts = np.linspace(t_old, t_new, _LOOKS + 1)
        slip = np.flatnonzero(mode.signs)
        speeds = self.dry.rates[slip] * mode.signs[slip, None]
        G = np.concatenate([np.hstack([np.zeros((slip.size, n)), speeds]), self._G])
        c = np.concatenate([np.zeros(slip.size), self._c])
        Y = dense(ts)[: 2 * n]
        values = G @ Y + c[:, None]
        least = -_ROUNDING * (1.0 + (np.abs(G) @ np.abs(Y)).max(axis=1, initial=0.0))
        event: Event | None = None
        for i in np.flatnonzero((values < least[:, None]).any(axis=1)).tolist():
            distance = partial(lambda i, s: float(G[i] @ dense(s)[: 2 * n] + c[i]), i)
            root = first_below(distance, ts, values[i], float(least[i]))
            if root is not None and (event is None or root[0] < event.t):
                limit = int(self._limits[i - slip.size]) % n if i >= slip.size else -1
                event = Event(root[0], -1 if limit >= 0 else int(slip[i]), limit)
        if not mode.stuck.size:
            return event

        def margin(s: float) -> float:
            y = np.ascontiguousarray(dense(s))
            at = self.motion.at(s, y[:n], y[n : 2 * n], y[2 * n + 4 :])
            return self.dry.margin(mode, at.reaction)

        # torques after the first event belong to another mode
        within = ts if event is None else ts[: max(int(np.searchsorted(ts, event.t)) + 1, 2)]
        margins = np.array([margin(float(s)) for s in within])
        root = first_below(margin, within, margins, -_SLACK, -_ROUNDING)
        if root is None:
            return event
        # past the root, so that a jump of the torques is included
        t, end = root
        step = float(np.spacing(max(abs(t), abs(end))))
        while t < end and margin(t) >= -_ROUNDING:
            t, step = min(t + step, end), 2.0 * step
        return Event(t) if event is None or t < event.t else event

    def _change(self, t: float, y: Array, event: Event) -> Array:
        """State after an event, which changes the mode or ends the simulation."""
        if event.limit >= 0:
            self.events.append(SimulationEvent(SimulationEventKind.LIMIT, t, event.limit))
            self.status = SimulationStatus.LIMIT_REACHED
            return y
        near = t - self._last_event <= _SAME_INSTANT * max(abs(t), self._end - self._start)
        self._repeats, self._last_event = self._repeats + 1 if near else 0, t
        mode = self.motion.mode
        if self._repeats > 10 + 4 * self.dry.lower.size:
            self.status = SimulationStatus.CHATTERING
        elif event.part >= 0:
            signs = mode.signs.copy()
            signs[event.part] = 0.0
            return self._decide(t, _at_rest(y, self.dry.mode(signs)))
        else:
            try:
                self._set(t, self.dry.loosened(mode, *self.motion.balance(t, y)))
            except np.linalg.LinAlgError:
                self.status = SimulationStatus.SINGULAR
        return y

    def _decide(self, t: float, y: Array, first: bool = False) -> Array:
        """State with the mode that follows from the torques at this instant."""
        if not self.dry.lower.size:
            return y
        n, old = self.motion.n, self.motion.mode
        v = y[n : 2 * n].copy()
        self.motion.set_mode(self.dry.mode(self.dry.signs(v)))  # no dry friction at rest
        try:
            mode = self.dry.decided(v, *self.motion.balance(t, y))
        except np.linalg.LinAlgError:
            self.status, mode = SimulationStatus.SINGULAR, old
        self.motion.set_mode(old)
        self._set(t, mode, record=not first)
        return _at_rest(y, mode)

    def _set(self, t: float, mode: Mode, record: bool = True) -> None:
        """Set a mode, and record the changes as events."""
        kinds, old = SimulationEventKind, self.motion.mode.signs
        for i in np.flatnonzero(old != mode.signs) if record else ():
            kind = kinds.STUCK if mode.signs[i] == 0.0 else kinds.REVERSED
            kind = kinds.BROKE_AWAY if old[i] == 0.0 else kind
            joint, motor = int(self.dry.joint[i]), bool(self.dry.motor[i])
            self.events.append(SimulationEvent(kind, t, joint, motor))
        self.motion.set_mode(mode)


def _at_rest(y: Array, mode: Mode) -> Array:
    """State whose sticking parts are exactly at rest."""
    n, y = len(mode.free), y.copy()
    if mode.stuck.size:
        y[n : 2 * n] = mode.free @ (mode.free.T @ y[n : 2 * n])
    return y


def first_below(
    g: Callable[[float], float], ts: Array, values: Array, least: float, zero: float = 0.0
) -> tuple[float, float] | None:
    """Root of a function before its first value (K,) below a level, and the time ts (K,) of it."""
    from scipy.optimize import brentq

    below = np.flatnonzero(values < least)
    if not below.size:
        return None
    left, low = float(ts[max(below[0] - 1, 0)]), float(ts[below[0]])
    if g(left) <= zero:
        return left, low
    root: Any = brentq(lambda t: g(t) - zero, left, low, xtol=1e-15 * max(1.0, abs(low)))
    return float(root), low
