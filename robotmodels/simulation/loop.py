"""The loop over the integrator's steps, with the events that lie between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from .._arrays import Array
from ..errors import RobotModelsError
from .crossings import beyond, first_below
from .dry_friction import DryFriction, Mode
from .forces import Forces
from .inputs import before
from .status import Integrator, SimulationEvent, SimulationEventKind, SimulationStatus

_LOOKS = 8  # instants of a step at which it is looked for events
_SLACK = 1e-9  # of the breakaway torque: torques that are beyond it by less do not count
_ROUNDING = 1e-13
_SAME_INSTANT = 64 * float(np.finfo(np.float64).eps)


class Options(NamedTuple):
    """How the integration is done."""

    method: Integrator
    rtol: float
    atol: float
    max_step: float
    max_evaluations: int
    progress: Callable[[float], None] | None


@dataclass(slots=True)
class Path:
    """Samples and events of a simulation as they come; the works are in J."""

    t: list[float] = field(default_factory=list)
    rows: list[tuple[Array, ...]] = field(default_factory=list)
    events: list[SimulationEvent] = field(default_factory=list)
    status: SimulationStatus = SimulationStatus.FINISHED
    steps: int = 0

    def add(self, t: float, y: Array, forces: Forces) -> None:
        """A sample."""
        n = forces.n
        q, v = y[:n].copy(), y[n : 2 * n].copy()
        a, tau, friction, _, _ = forces.at(t, q, v)
        held = np.zeros(n, dtype=bool)
        signs = forces.dry.joint_signs(forces.mode.signs)
        if forces.mode.sticks:
            held = signs == 0.0
        self.t.append(t)
        self.rows.append((q, v, a, tau.copy(), friction, held, y[2 * n : 2 * n + 3].copy()))


class _Found(NamedTuple):
    """The first event of a step: of a part that slips, of those that stick, or of a limit."""

    t: float
    part: int = -1
    limit: int = -1


def follow(
    forces: Forces,
    q: Array,
    v: Array,
    cuts: Sequence[tuple[float, bool]],
    times: Array | None,
    limits: tuple[Array, Array] | None,
    options: Options,
) -> Path:
    """Integrate from cut to cut and from event to event.

    Shapes: q, v (n,); limits (lower, upper).
    """
    path = Path()
    y = np.concatenate([q, v, np.zeros(4)])
    t, end = cuts[0][0], cuts[-1][0]
    walk = _Walk(forces, path, times, limits, options, t, end)
    walk.set_latest(cuts, 0)
    y = walk.decide(t, y, first=True)
    path.add(t, y, forces)
    for k in range(len(cuts) - 1):
        walk.set_latest(cuts, k)
        if k and cuts[k][1]:
            y = walk.decide(t, y)
        t, y = walk.segment(t, y, cuts[k + 1][0])
        if path.status is not SimulationStatus.FINISHED:
            break
    if t > path.t[-1]:
        path.add(t, y, forces)
    return path


class _Walk:
    """What the pieces of one simulation share."""

    def __init__(
        self,
        forces: Forces,
        path: Path,
        times: Array | None,
        limits: tuple[Array, Array] | None,
        options: Options,
        start: float,
        end: float,
    ) -> None:
        self.forces, self.path, self.options = forces, path, options
        self.dry: DryFriction = forces.dry if forces.width is None else DryFriction.none(forces.n)
        self.times, self.limits = times, limits
        self.next = 1  # the sample at the start is taken
        self.start, self.end = start, end
        self.last_event, self.repeats = -np.inf, 0
        self.step: float | None = None
        self.reported = 0.0

    def set_latest(self, cuts: Sequence[tuple[float, bool]], k: int) -> None:
        """Ask laws before a jump only, as long as it is not reached."""
        time, jumps = cuts[min(k + 1, len(cuts) - 1)]
        self.forces.latest = before(time, cuts[k][0]) if jumps else np.inf

    def segment(self, t: float, y: Array, bound: float) -> tuple[float, Array]:
        """Go on to a time, or to where the simulation ends before."""
        while t < bound and self.path.status is SimulationStatus.FINISHED:
            t, y, found = self._smooth(t, y, bound)
            if found is not None:
                y = self._happens(t, y, found)
        return t, y

    def _smooth(self, t: float, y: Array, bound: float) -> tuple[float, Array, _Found | None]:
        """Integrate without changes of mode, to a time, an event or a failure."""
        import scipy.integrate

        options, forces = self.options, self.forces
        make: Any = getattr(scipy.integrate, options.method.value)
        first = None if self.step is None else min(self.step, bound - t)
        watches = bool(self.dry.count) or self.limits is not None
        try:
            solver = make(
                forces.derivative, t, y, bound, rtol=options.rtol, atol=options.atol,
                max_step=options.max_step, first_step=first,
            )  # fmt: skip
            if not np.isfinite(solver.h_abs):  # nothing finite to begin with: no step would end
                self._fail()
            while solver.status == "running" and not self.path.status:
                if forces.evaluations >= options.max_evaluations:
                    self.path.status = SimulationStatus.NOT_CONVERGED
                    break
                before_step = float(solver.h_abs)
                solver.step()
                if solver.status == "failed":
                    self._fail()
                    break
                forces.met_singular = False
                self.path.steps += 1
                t_old, t, y = float(solver.t_old), float(solver.t), solver.y
                # the last step was cut off at the bound: that is no reason to go on with its size
                self.step = max(before_step, float(solver.h_abs))
                asked = (
                    self.times is not None
                    and self.next < len(self.times)
                    and self.times[self.next] <= t
                )
                dense = solver.dense_output() if watches or asked else None
                found = self._first_event(t_old, t, dense) if watches else None
                if found is not None and dense is not None:
                    t = found.t
                    y = dense(t)
                self._sample(t, y, dense)
                self._report(t)
                if found is not None:
                    self.step = None
                    return t, np.array(y), found
        except (np.linalg.LinAlgError, ValueError) as error:
            # an implicit integrator that meets NaN in its own matrices
            if isinstance(error, RobotModelsError):
                raise
            self._fail()
        return t, np.array(y), None

    def _fail(self) -> None:
        singular = self.forces.met_singular
        self.path.status = (
            SimulationStatus.SINGULAR if singular else SimulationStatus.STEP_TOO_SMALL
        )

    def _sample(self, t: float, y: Array, dense: Any) -> None:
        """The samples up to a time."""
        if self.times is None:
            if t > self.path.t[-1]:
                self.path.add(t, y, self.forces)
            return
        while self.next < len(self.times) and self.times[self.next] <= t:
            time = float(self.times[self.next])
            self.path.add(time, y if time == t else dense(time), self.forces)
            self.next += 1

    def _report(self, t: float) -> None:
        done = (t - self.start) / (self.end - self.start)
        if self.options.progress is not None and (done >= self.reported + 0.01 or done >= 1.0):
            self.reported = done
            self.options.progress(done)

    # --- events ----------------------------------------------------------------------------------

    def _first_event(self, t_old: float, t_new: float, dense: Any) -> _Found | None:
        n, mode = self.forces.n, self.forces.mode
        ts = np.linspace(t_old, t_new, _LOOKS + 1)
        Y = dense(ts)
        Q, V = Y[:n], Y[n : 2 * n]
        found: _Found | None = None

        def keep(time: float, part: int = -1, limit: int = -1) -> None:
            nonlocal found
            if found is None or time < found.t:
                found = _Found(time, part, limit)

        slip = np.flatnonzero(mode.signs) if self.dry.count else np.empty(0, np.int64)
        D = self.dry.rates[slip] * mode.signs[slip, None]
        for i, row in zip(slip, D, strict=True):

            def speed(s: float, row: Array = row) -> float:
                return float(row @ dense(s)[n : 2 * n])

            least = -_ROUNDING * (1.0 + float((np.abs(row) @ np.abs(V)).max()))
            below = first_below(speed, ts, row @ V, least, 0.0)
            if below is not None:
                keep(below[0], part=int(i))
        if self.limits is not None:
            lower, upper = self.limits
            for side, limit in ((1.0, upper), (-1.0, lower)):
                for j in np.flatnonzero(np.isfinite(limit)).tolist():

                    def room(s: float, j: int = j, sign: float = side, x: Array = limit) -> float:
                        return float(sign * (x[j] - dense(s)[j]))

                    least = -_ROUNDING * (1.0 + float(np.abs(Q[j]).max()))
                    below = first_below(room, ts, side * (limit[j] - Q[j]), least, 0.0)
                    if below is not None:
                        keep(below[0], limit=int(j))
        if mode.sticks:

            def margin(s: float) -> float:
                return self._margin(s, dense(s))

            # no look at torques after the first event: they would be those of another mode
            seen = ts if found is None else ts[: max(int(np.searchsorted(ts, found.t)) + 1, 2)]
            values = np.array([margin(float(s)) for s in seen])
            below = first_below(margin, seen, values, -_SLACK, -_ROUNDING)
            if below is not None:
                # past it, so that a jump of the torques is seen as well
                keep(beyond(margin, *below, -_ROUNDING))
        return found

    def _margin(self, t: float, y: Array) -> float:
        n = self.forces.n
        y = np.ascontiguousarray(y)
        reaction = self.forces.at(t, y[:n], y[n : 2 * n])[4]
        return self.dry.margin(self.forces.mode, reaction)

    def _happens(self, t: float, y: Array, found: _Found) -> Array:
        """What an event changes."""
        if found.limit >= 0:
            self.path.events.append(SimulationEvent(SimulationEventKind.LIMIT, t, found.limit))
            self.path.status = SimulationStatus.LIMIT_REACHED
            return y
        near = t - self.last_event <= _SAME_INSTANT * max(abs(t), self.end - self.start)
        self.repeats = self.repeats + 1 if near else 0
        self.last_event = t
        if self.repeats > 10 + 4 * self.dry.count:
            self.path.status = SimulationStatus.CHATTERING
            return y
        if found.part >= 0:
            n = self.forces.n
            signs = self.forces.mode.signs.copy()
            signs[found.part] = 0.0
            y = y.copy()
            y[n : 2 * n] = self.dry.settled(self.dry.mode(signs), y[n : 2 * n])
            return self.decide(t, y)
        try:
            mode = self.dry.loosened(self.forces.mode, *self._balance(t, y))
        except np.linalg.LinAlgError:
            self.path.status = SimulationStatus.SINGULAR
            return y
        self._change(t, mode)
        return y

    def decide(self, t: float, y: Array, first: bool = False) -> Array:
        """Which parts at rest stick, from the torques at this instant."""
        if not self.dry.count:
            return y
        n = self.forces.n
        old = self.forces.mode
        v = y[n : 2 * n]
        self.forces.set_mode(self.dry.slipping(v))
        try:
            mode = self.dry.decided(v, *self._balance(t, y))
        except np.linalg.LinAlgError:
            self.forces.set_mode(old)
            self.path.status = SimulationStatus.SINGULAR
            return y
        self.forces.set_mode(old)
        self._change(t, mode, told=not first)
        y = y.copy()
        y[n : 2 * n] = self.dry.settled(mode, v)
        return y

    def _balance(self, t: float, y: Array) -> tuple[Array, Array]:
        """Mass matrix, and the torques that no part at rest takes up."""
        n = self.forces.n
        q, v = y[:n].copy(), y[n : 2 * n].copy()
        M, h = self.forces.bodies(q, v)
        self.forces.evaluations += 1
        return M, self.forces.load(t, q, v)[0] - h

    def _change(self, t: float, mode: Mode, told: bool = True) -> None:
        kinds = SimulationEventKind
        old = self.forces.mode.signs
        for i in np.flatnonzero(old != mode.signs) if told else ():
            kind = kinds.STUCK if mode.signs[i] == 0.0 else kinds.REVERSED
            kind = kinds.BROKE_AWAY if old[i] == 0.0 else kind
            event = SimulationEvent(kind, t, int(self.dry.joint[i]), bool(self.dry.motor[i]))
            self.path.events.append(event)
        self.forces.set_mode(mode)
