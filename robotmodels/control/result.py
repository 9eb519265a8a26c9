"""Result of a run: the simulated motion, errors, wrenches and the status."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from .._arrays import Array, Value, as_number
from .._outcomes import Outcome
from ..errors import InvalidValueError
from ..simulation import Simulation


class ControlStatus(Outcome):
    """Outcome of a run; fits int8. The motion until then is given for every status."""

    FOLLOWED = 0, "The law was followed to the end, within the limits of the robot."
    SATURATED = 1, "Torques were limited to the efforts of the joints."
    LEFT_LIMITS = 2, "Joints left their limits."
    DIVERGED = 3, "The law was not followed to the end."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ControlledMotion(Value):
    """Motion of a controlled robot. Read-only.

    Parameters
    ----------
    law : object
        The control law.
    simulation : Simulation
        The motion of the plant, N samples, n joints.
    error : ndarray, shape (N, k)
        Error of the law: desired less actual joints, components of the task, or forces.
    wrench : ndarray, shape (N, 6)
        Wrench ``[f; m]`` of the tool on the environment, world axes.
    lyapunov : ndarray, shape (N,), or None
        Lyapunov function of the law, None if it has none.
    status : ControlStatus
        Outcome.
    notes : tuple of str
        Sentences that explain it.

    Examples
    --------
    >>> from robotmodels.control import ComputedTorque, run
    >>> from robotmodels.robots import load
    >>> arm = load("rx90")
    >>> motion = run(arm, ComputedTorque(np.full(6, 0.1), model=arm), np.zeros(6), t=1.0)
    >>> motion.status, bool(motion.rms(after=0.9).max() < 1e-3)
    (<ControlStatus.FOLLOWED: 0>, True)
    """

    law: Any
    simulation: Simulation
    error: Array
    wrench: Array
    lyapunov: Array | None
    status: ControlStatus
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for f in fields(self):
            if isinstance(value := getattr(self, f.name), np.ndarray):
                value.setflags(write=False)

    @property
    def _values(self) -> tuple[Any, ...]:
        sim, rest = self.simulation, (self.status, self.notes)
        motion = sim.model, sim.t, sim.q, sim.v, sim.tau, sim.state
        return (self.law, *motion, self.error, self.wrench, self.lyapunov, *rest)

    @property
    def t(self) -> Array:
        """Times, s, shape (N,)."""
        return self.simulation.t

    @property
    def q(self) -> Array:
        """Positions, rad or m, shape (N, n)."""
        return self.simulation.q

    @property
    def v(self) -> Array:
        """Velocities, shape (N, n)."""
        return self.simulation.v

    @property
    def tau(self) -> Array:
        """Torques of the control, N m or N, shape (N, n)."""
        return self.simulation.tau

    @property
    def state(self) -> Array:
        """State of the law, shape (N, k)."""
        return self.simulation.state

    @property
    def surface(self) -> Array | None:
        """Values (N, n) of s of laws that have one: sliding modes, passivity, adaptive control."""
        rows = zip(self.t, self.q, self.v, strict=True)
        return (
            np.array([self.law.surface(*x) for x in rows]) if hasattr(self.law, "slope") else None
        )

    def rms(self, after: float = 0.0) -> Array:
        """Root mean square of the error from a time on, shape (k,)."""
        late = self.t >= as_number(after, "after")
        if not late.any():
            raise InvalidValueError(f"after: expected a time up to {self.t[-1]:.6g} s.")
        weights = np.convolve(np.diff(self.t[late]), [0.5, 0.5]) if late.sum() > 1 else np.ones(1)
        return np.sqrt(weights @ self.error[late] ** 2 / weights.sum())

    def reason(self) -> str:
        """The sentence of the status, and what explains it."""
        return " ".join([self.status.sentence, *self.notes])

    def __repr__(self) -> str:
        last = self.rms(float(self.t[0] + 0.9 * (self.t[-1] - self.t[0])))
        shown = np.array2string(last, precision=3, max_line_width=200, threshold=8)
        lines = (
            f"<ControlledMotion: {self.law!r:.90}",
            f"  {self.t[-1] - self.t[0]:.6g} s, samples: {len(self.t)}",
            f"  root mean square error of the last tenth: {shown:.70}",
            f"  {self.reason():.200}>",
        )
        return "\n".join(lines)
