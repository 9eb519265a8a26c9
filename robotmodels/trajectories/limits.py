"""Limits of motions, and requests for them, checked once: vectors, durations, limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Value, as_floats, as_number, as_reals, read_only
from .._choices import as_instance
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel
from ..table_text import joints_text
from .laws import LineLimits

RATES = ("velocity", "acceleration", "jerk")
ROUNDING = 1e-12
"""Relative shortfall of a given duration that is put down to rounding."""
_EXTREME = 1e50  # largest size of rates and durations, and of their inverses: cubes are floats


@dataclass(frozen=True, slots=True, eq=False)
class MotionLimits(Value):
    """Limits that a motion keeps; a number stands for all joints.

    Parameters
    ----------
    velocity, acceleration, jerk : array_like, shape () or (n,)
        Largest values, rad or m, per s, s^2 and s^3. Infinity is no limit, as everywhere here.
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
    """Extremes of the motion of each joint, beside its limits.

    Parameters
    ----------
    limits : MotionLimits
        Of n joints.
    position, velocity, acceleration, jerk : ndarray, shape (2, n)
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
        """Factor by which the motion must be slowed down to keep its limits; at most 1 if it does.

        Duration times this keeps velocity, acceleration and jerk. Positions are not touched.
        """
        need = 0.0
        for order, (name, least, most) in enumerate(ranges_of(self.limits)[1:], 1):
            low, high = getattr(self, name)
            for value, bound in ((high, most), (-low, -least)):
                with np.errstate(divide="ignore", invalid="ignore"):
                    ratio = np.where((value > 0.0) & np.isfinite(bound), value / bound, 0.0)
                need = max(need, float(ratio.max(initial=0.0)) ** (1.0 / order))
        return need

    def violations(self) -> tuple[str, ...]:
        """The limits that are not kept, one sentence each."""
        found = []
        for name, least, most in ranges_of(self.limits):
            low, high = getattr(self, name)
            for value, bound, side in ((high, most, 1.0), (low, least, -1.0)):
                some = np.flatnonzero(np.isfinite(bound))
                over = side * (value[some] - bound[some])
                size = np.maximum(np.abs(bound[some]), float(name == "position"))
                found += [
                    f"joint {j + 1}: {name} {value[j]:.6g}, allowed {bound[j]:.6g}"
                    for j in some[over > self.tolerance * size]
                ]
        return tuple(found)

    def __repr__(self) -> str:
        if self.kept:
            return "<LimitsReport: every limit is kept>"
        return few_lines("<LimitsReport: limits are exceeded", self.violations())


def few_lines(first: str, lines: Sequence[object]) -> str:
    """Text of at most six lines, the first one and as many others as fit."""
    more = [f"and {len(lines) - 4} more"] if len(lines) > 5 else []
    return "\n  ".join([first, *map(str, lines[: 5 - len(more)]), *more]) + ">"


# ---------------------------------------------------------------- checked requests


def joint_vectors(**given: Any) -> tuple[dict[str, Array], bool]:
    """Positions and rates (n,) of the same joints; whether they are numbers."""
    arrays = {name: as_floats(value, name) for name, value in given.items()}
    got = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
    try:
        _, *rows = np.broadcast_arrays(np.zeros(1), *arrays.values())
    except ValueError:
        raise ShapeError(f"Expected vectors of the same joints, got {got}.") from None
    if rows[0].ndim != 1:
        raise ShapeError(f"Expected the states of one motion, of shape () or (n,), got {got}.")
    refuse_jointless(rows[0].size, "q0 and q1")
    return dict(zip(arrays, rows, strict=True)), all(array.ndim == 0 for array in arrays.values())


def refuse_jointless(n: int, name: str) -> None:
    """Refuse motions of no joints, which have no duration of their own."""
    if n == 0:
        raise InvalidValueError(
            f"{name}: expected positions of at least one joint, got none; a model without joints "
            "has no motion."
        )


def limits_along(limits: MotionLimits, u: Array, names: tuple[str, ...] = ()) -> LineLimits:
    """Limits of the coordinate that joints share which move by u (n,) for each unit of it."""
    pairs = [(getattr(limits, f"{name}_lower"), getattr(limits, name)) for name in RATES]
    most = np.stack([x for low, high in pairs for x in (high, -low)])
    # the bound that stops the coordinate from growing; then that of the way back
    bounds = np.where(u > 0.0, most, most[[1, 0, 3, 2, 5, 4]])
    zero = (u != 0.0) & (bounds == 0.0)
    zero[1] = False
    if zero.any():
        i, j = (int(k) for k in np.argwhere(zero)[0])
        what = names[j] if names else f"joint {j + 1}"
        raise InvalidValueError(
            f"limits: the limit of {RATES[i // 2]} of {what}, which moves, is 0."
        )
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        bounds = np.where(u != 0.0, bounds / np.abs(u), np.inf)
    V, back, A, B, J, K = bounds.min(axis=-1).tolist()
    return LineLimits(V, A, B, J, K, back)


def given_duration(duration: float | None) -> float | None:
    """A duration of at least zero seconds, or None."""
    return None if duration is None else as_number(duration, "duration", least=0.0)


def checked_limits(limits: MotionLimits | None, n: int, *postures: Array) -> MotionLimits | None:
    """Limits of n joints, within which the postures (n,) or (N, n) are."""
    if limits is None:
        return None
    limits = as_instance(limits, MotionLimits, "limits").for_joints(n)
    slack = 1e-9
    for q in postures:
        outside = (q < limits.lower - slack) | (q > limits.upper + slack)
        if outside.any():
            j = int(np.argwhere(outside)[0][-1])
            raise InvalidValueError(
                f"Joint {j + 1} is at {q[outside].ravel()[0]:.6g}, outside its limits "
                f"{limits.lower[j]:.6g} to {limits.upper[j]:.6g}."
            )
    return limits


def refuse_short(T: float | None, least: float, moves: bool = True) -> None:
    """Refuse a duration below the least feasible one, or of zero for a motion."""
    if T is not None and least * (1.0 - ROUNDING) > T:
        raise InvalidValueError(
            f"duration: {T:.9g} s is too short for the limits; the least is {least_shown(least)} s."
        )
    if T == 0.0 and moves:
        raise InvalidValueError("duration: expected a positive time for a motion, got 0 s.")


def slowed(T: Array, blends: Array, duration: float | None, kept: bool) -> tuple[Array, Array]:
    """Times (m - 1,) of lines and (m,) of their blends, evenly stretched to a whole duration.

    ``kept``: whether limits make the given times the least ones.
    """
    least = float(T.sum() + 0.5 * (blends[0] + blends[-1]))
    wanted = given_duration(duration)
    if wanted is None or least == 0.0:
        return T, blends
    refuse_short(wanted, least if kept else 0.0)
    return T * (wanted / least), blends * (wanted / least)


def checked_request(
    states: dict[str, Array], duration: float | None, limits: MotionLimits | None
) -> tuple[float | None, MotionLimits | None]:
    """Duration and limits of a motion between states (n,); at least one of the two."""
    T = given_duration(duration)
    if T is None and limits is None:
        raise InvalidValueError("Give duration, limits or both.")
    bounds = checked_limits(limits, states["q0"].size, states["q0"], states["q1"])
    rates = {} if bounds is None else {f"limits: {name}": getattr(bounds, name) for name in RATES}
    for name, values in (states | rates | {"duration": np.array(T or 0.0)}).items():
        size = np.abs(values[np.isfinite(values) & (values != 0.0)])
        least = 0.0 if name in ("q0", "q1") else 1.0 / _EXTREME
        if size.max(initial=0.0) > _EXTREME or size.min(initial=1.0) < least:
            raise InvalidValueError(
                f"{name}: expected sizes from {1.0 / _EXTREME:g} to {_EXTREME:g} (or 0); check "
                "the units."
            )
    return T, bounds


def least_shown(value: float, digits: int = 12) -> str:
    """A least value in few digits, rounded up: it is accepted when it is passed back."""
    text = f"{value:.{digits}g}"
    up = value + abs(value) * 10.0 ** (1 - digits)
    return text if float(text) >= value else f"{up:.{digits}g}"


def greatest(values: Mapping[str, Array]) -> str:
    """The greatest sizes of quantities by their names; NaN does not count."""
    sizes = ((name, float(np.nanmax(np.abs(x), initial=0.0))) for name, x in values.items())
    return "greatest " + ", ".join(f"{name} {size:.4g}" for name, size in sizes)
