"""Limits of a motion: of velocity, acceleration, jerk and position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Value, as_reals, read_only
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel
from ..table_text import joints_text

RATES = ("velocity", "acceleration", "jerk")


@dataclass(frozen=True, slots=True, eq=False)
class MotionLimits(Value):
    """Limits that a motion keeps; a number stands for all joints.

    Parameters
    ----------
    velocity, acceleration, jerk : array_like, shape () or (n,)
        Greatest ones, rad or m, per s, s^2 and s^3. Infinity is no limit, as everywhere here.
    velocity_lower, acceleration_lower, jerk_lower : array_like, shape () or (n,), optional
        The least ones, not above zero; default the greatest with the sign changed.
    lower, upper : array_like, shape () or (n,)
        Limits of position, rad or m.

    Examples
    --------
    >>> limits = MotionLimits(velocity=[1.0, 2.0], acceleration=4.0)
    >>> limits.velocity_lower
    array([-1., -2.])
    """

    velocity: Array = np.inf  # type: ignore[assignment]
    acceleration: Array = np.inf  # type: ignore[assignment]
    jerk: Array = np.inf  # type: ignore[assignment]
    velocity_lower: Array = None  # type: ignore[assignment]
    acceleration_lower: Array = None  # type: ignore[assignment]
    jerk_lower: Array = None  # type: ignore[assignment]
    lower: Array = -np.inf  # type: ignore[assignment]
    upper: Array = np.inf  # type: ignore[assignment]

    def __repr__(self) -> str:
        ranges = [(name, least.min(), most.max()) for name, least, most in ranges_of(self)
                  if np.isfinite([least, most]).any()]  # fmt: skip
        shown = [f"{name} {least:.4g} to {most:.4g}" for name, least, most in ranges]
        return f"<MotionLimits: {', '.join(shown) or 'no limits'}>"

    def __str__(self) -> str:
        shown = [f.name for f in fields(self) if np.isfinite(getattr(self, f.name)).any()]
        columns = {name: np.atleast_1d(getattr(self, name)) for name in shown}
        return joints_text(columns) if columns else "MotionLimits: no limits"

    def __post_init__(self) -> None:
        arrays = {}
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            lower = name.removesuffix("_lower") if name.endswith("_lower") else ""
            array = arrays[name] = -arrays[lower] if value is None else as_reals(value, name)
            if array.ndim > 1:
                raise ShapeError(
                    f"{name}: expected one number or one per joint, got {array.shape}."
                )
            if np.isnan(array).any():
                raise InvalidValueError(f"{name}: a limit is NaN; infinity means no limit.")
            if name in RATES and (array < 0.0).any():
                raise InvalidValueError(f"{name}: expected limits of at least 0, got {array}.")
            if lower and (array > 0.0).any():
                raise InvalidValueError(f"{name}: expected limits of at most 0, got {array}.")
        try:
            shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
        except ValueError:
            got = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
            raise ShapeError(f"The limits are for different numbers of joints: {got}.") from None
        if (arrays["lower"] > arrays["upper"]).any():
            raise InvalidValueError(
                f"lower: expected at most upper, got {arrays['lower']} above {arrays['upper']}."
            )
        for name, array in arrays.items():
            object.__setattr__(self, name, read_only(np.broadcast_to(array, shape)))

    @classmethod
    def of_model(
        cls, model: RobotModel, acceleration: ArrayLike = np.inf, jerk: ArrayLike = np.inf
    ) -> Self:
        """Limits of a robot: positions and velocities from its table, the others as given."""
        bounds = {"lower": model.lower, "upper": model.upper, "velocity": model.table.velocity}
        rates = {"acceleration": acceleration, "jerk": jerk}
        return cls(**bounds, **{name: as_reals(value, name) for name, value in rates.items()})

    def for_joints(self, n: int) -> Self:
        """The same limits as arrays (n,); an error if they are of another number of joints."""
        if self.velocity.shape not in ((), (1,), (n,)):
            raise ShapeError(
                f"limits: expected limits of {n} joints, got limits of {self.velocity.size}."
            )
        if self.velocity.shape == (n,):
            return self
        return replace(self, **{f.name: np.full(n, getattr(self, f.name)) for f in fields(self)})

    def without_jerk(self) -> Self:
        """The same limits but none of jerk, for laws whose acceleration jumps."""
        free = np.full(self.jerk.shape, np.inf)
        return replace(self, jerk=free, jerk_lower=-free)


def ranges_of(limits: MotionLimits) -> tuple[tuple[str, Array, Array], ...]:
    """Name, least and greatest value of the position and its three derivatives."""
    rates = ((name, getattr(limits, f"{name}_lower"), getattr(limits, name)) for name in RATES)
    return (("position", limits.lower, limits.upper), *rates)


@dataclass(frozen=True, slots=True, eq=False)
class LimitsReport(Value):
    """What a motion asks of each joint, beside what is allowed.

    Parameters
    ----------
    limits : MotionLimits
        Of n joints.
    position, velocity, acceleration, jerk : ndarray, shape (2, ..., n)
        Least and greatest values of the motion, ends included. Infinite where the quantity below
        jumps inside the motion.
    tolerance : float
        Relative overshoot that is put down to rounding.
    """

    limits: MotionLimits
    position: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    tolerance: float = 1e-9

    @property
    def kept(self) -> bool:
        """Whether every joint keeps every limit."""
        return not self.violations()

    @property
    def stretch(self) -> float:
        """By how much the motion must be slowed down to keep its limits; at most 1 if it does.

        Duration times this keeps velocity, acceleration and jerk. Positions are not touched.
        """
        need = 0.0
        for order, (name, least, most) in enumerate(ranges_of(self.limits)):
            low, high = getattr(self, name)
            for value, bound in ((high, most), (-low, -least)) if order else ():
                with np.errstate(divide="ignore", invalid="ignore"):
                    ratio = np.where((value > 0.0) & np.isfinite(bound), value / bound, 0.0)
                need = max(need, float(ratio.max(initial=0.0)) ** (1.0 / order))
        return need

    def violations(self) -> tuple[str, ...]:
        """The limits that are not kept, one sentence each."""
        found = []
        for name, least, most in ranges_of(self.limits):
            low, high = (x.reshape(-1, x.shape[-1]) for x in getattr(self, name))
            for j, bounds in enumerate(zip(most, least, strict=True)):
                ends = (high[:, j].max(initial=-np.inf), low[:, j].min(initial=np.inf))
                for value, bound, side in zip(ends, bounds, (1.0, -1.0), strict=True):
                    size = max(abs(bound), float(name == "position"))
                    if size < np.inf and side * (value - bound) > self.tolerance * size:
                        found.append(f"joint {j + 1}: {name} {value:.6g}, allowed {bound:.6g}")
        return tuple(found)

    def __repr__(self) -> str:
        if self.kept:
            return "<LimitsReport: every limit is kept>"
        return few_lines("<LimitsReport: limits are exceeded", self.violations())


def few_lines(first: str, lines: Sequence[object]) -> str:
    """Text of at most six lines, the first one and as many others as fit."""
    more = [f"and {len(lines) - 4} more"] if len(lines) > 5 else []
    return "\n  ".join([first, *map(str, lines[: 5 - len(more)]), *more]) + ">"
