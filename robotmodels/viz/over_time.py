"""Signals of joints over time: units, sampled trajectories, lines with their limits and breaks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from .._arrays import Array
from .._choices import as_instance
from ..errors import InvalidValueError, ShapeError
from ..geometry import PRISMATIC
from ..model import RobotModel
from ..trajectories.limits import MotionLimits, ranges_of
from ..trajectories.motions import PiecewisePolynomial
from ..trajectories.trajectory import Samples, Trajectory
from . import style
from .style import ALERT, BEYOND, DASHED, INK, LIMIT, PALE, ZERO, Axes

QUANTITIES = ("position", "velocity", "acceleration", "jerk")
_SAMPLES = 601
_BEFORE = 1e-9  # of the duration: where the value before a jump is read
_ROUNDING = 1e-9


class Unit(Enum):
    """Units of a joint in a figure; data are in SI units and radians always.

    Examples
    --------
    >>> Unit.DEGREE.of(2), round(Unit.DEGREE.factor, 3)
    ('deg/s²', 57.296)
    """

    RADIAN = "rad"
    DEGREE = "deg"
    METRE = "m"
    MILLIMETRE = "mm"
    NONE = "1"
    UNSTATED = "rad or m"

    @property
    def factor(self) -> float:
        """Factor from SI units and radians."""
        return {Unit.DEGREE: 180.0 / np.pi, Unit.MILLIMETRE: 1e3}.get(self, 1.0)

    def of(self, order: int) -> str:
        """Unit of a derivative by time, such as ``rad/s²``: order 0 position, to 3 jerk."""
        per = ("", "/s", "/s²", "/s³")[order]
        return " or ".join(part + per for part in self.value.split(" or "))


def is_prismatic(model: RobotModel) -> Array:
    """Joints that slide. Shapes: -> (n,) bool."""
    return model.table.sigma[model.table.joint_rows] == PRISMATIC


def joint_names(names: Sequence[str] | None, n: int, model: RobotModel | None = None) -> list[str]:
    """Names of joints for a legend."""
    _check_model(model, n)
    if names is not None:
        return style.as_texts(names, n, "names", "joints")
    if model is None:
        return [f"joint {j + 1}" for j in range(n)]
    return [str(name) for name in model.table.joint_names]


def joint_units(
    units: Unit | str | Sequence[Unit | str] | None,
    n: int,
    model: RobotModel | None = None,
    degrees: bool = False,
) -> list[Unit]:
    """Units of joints for their axes; degrees in place of radians where none are given."""
    _check_model(model, n)
    lengths = [None] * n if model is None else is_prismatic(model).tolist()
    if units is None:
        angle = Unit.DEGREE if degrees else Unit.RADIAN
        return [{None: Unit.UNSTATED, True: Unit.METRE, False: angle}[long] for long in lengths]
    given = [units] * n if isinstance(units, (Unit, str)) else list(units)
    if len(given) != n:
        raise ShapeError(f"units: expected one for each of the {n} joints, got {len(given)}.")
    kinds = [as_unit(unit) for unit in given]
    wrong = {True: (Unit.RADIAN, Unit.DEGREE), False: (Unit.METRE, Unit.MILLIMETRE), None: ()}
    for j, (unit, long) in enumerate(zip(kinds, lengths, strict=True)):
        if unit in wrong[long]:
            kind = "prismatic" if long else "revolute"
            raise InvalidValueError(f"units: joint {j + 1} is {kind}, got {unit.value!r}.")
    return kinds


def joints_of(
    n: int, model: RobotModel | None, names: Any = None, units: Any = None, degrees: bool = False
) -> tuple[list[str], dict[Unit, list[int]]]:
    """Names of joints, and their numbers by units."""
    kinds = joint_units(units, n, model, degrees)
    return joint_names(names, n, model), {
        unit: [j for j, kind in enumerate(kinds) if kind is unit] for unit in dict.fromkeys(kinds)
    }


def effort_units(model: RobotModel) -> list[str]:
    """Units of the torques and forces of joints."""
    return ["N" if slides else "N m" for slides in is_prismatic(model)]


def as_unit(unit: Unit | str) -> Unit:
    """A unit from itself or its symbol."""
    try:
        return Unit(unit)
    except ValueError:
        known = ", ".join(repr(each.value) for each in Unit)
        raise InvalidValueError(f"units: expected one of {known}, got {unit!r}.") from None


def as_limits(limits: MotionLimits | None, n: int) -> MotionLimits | None:
    """Limits of n joints, checked."""
    if limits is None:
        return None
    return as_instance(limits, MotionLimits, "limits").for_joints(n)


def as_orders(orders: Sequence[int]) -> list[int]:
    """Quantities to draw, checked."""
    what = "some of position (0), velocity, acceleration and jerk (3)"
    return style.as_choice(orders, 4, "orders", what)


def _check_model(model: Any, n: int) -> None:
    if model is not None and as_instance(model, RobotModel, "model").n != n:
        raise ShapeError(f"model: expected a robot of {n} joints, got {model.name!r} of {model.n}.")


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """Positions and derivatives of n joints at the times of a figure.

    Shapes: t (N,), values (4, N, n).
    """

    t: Array
    values: Array
    breaks: tuple[Array, ...] = ()
    duration: float = 0.0

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.values.shape[-1]


def sampled(trajectory: Any, name: str = "trajectory") -> Sampled:
    """Dense samples of a trajectory, with both sides of every jump."""
    breaks: tuple[Array, ...] = ()
    if isinstance(trajectory, Samples):
        samples, T = trajectory, float(np.ptp(trajectory.t)) if trajectory.t.size else 0.0
    else:
        advice = " of joints (of a PoseTrajectory its .law, or plot_pose_path)"
        motion = as_instance(trajectory, Trajectory, name, advice).motion
        T = float(motion.duration)
        if isinstance(motion, PiecewisePolynomial):
            breaks = tuple(np.unique(row) for row in motion.breaks)
        both = [np.append(row, row - _BEFORE * T) for row in breaks]
        times = np.unique(np.concatenate((np.linspace(0.0, T, _SAMPLES), *both)))
        samples = trajectory.at(times[(times >= 0.0) & (times <= T)])
    t, rows = samples.t.reshape(-1), np.stack((samples.q, samples.v, samples.a, samples.jerk))
    if samples.q.shape == samples.t.shape:  # a scalar trajectory
        rows = rows[..., None]
    if not t.size:
        raise ShapeError(f"{name}: expected at least one sample, got none.")
    return Sampled(t, rows, breaks, T)


def lines_over_time(
    axes: Axes,
    t: Array,
    values: Array,
    names: Sequence[str],
    numbers: Sequence[int] | None = None,
    lower: Array | None = None,
    upper: Array | None = None,
    zero: bool = False,
) -> None:
    """Lines of k signals in the styles of some numbers, with limits and values beyond them.

    Shapes: t (N,), values (N, k), lower and upper (k,).
    """
    numbers = range(len(names)) if numbers is None else numbers
    marker = "" if len(t) > 1 else "o"
    if zero:
        axes.axhline(0.0, **ZERO)
    for y, name, k in zip(values.T, names, numbers, strict=True):
        axes.plot(t, y, label=name, marker=marker, **style.line(k))
    if lower is None or upper is None:
        return
    slack = _ROUNDING * np.maximum(1.0, np.abs(values).max(axis=0, initial=0.0))
    beyond = (values > upper + slack) | (values < lower - slack)
    for j in np.flatnonzero(beyond.any(axis=0)):
        y = np.where(beyond[:, j], values[:, j], np.nan)
        axes.plot(t, y, color=ALERT, alpha=0.35, linewidth=5.2, zorder=1.8, label=BEYOND)
    limit_lines(axes, lower, names, numbers)
    limit_lines(axes, upper, names, numbers)


def limit_lines(
    axes: Axes, limits: Array, names: Sequence[str], numbers: Sequence[int] | None = None
) -> None:
    """Dashed lines in the colours of the joints; one grey line where all share a limit."""
    common = bool(np.isfinite(limits).all() and np.ptp(limits) == 0.0)
    for k, limit in enumerate(limits[: 1 if common else None]):
        if np.isfinite(limit):
            color = PALE if common else INK if numbers is None else style.line(numbers[k])["color"]
            label = f"_limit of {' and '.join(names) if common else names[k]}"
            axes.axhline(float(limit), color=color, zorder=1.5, label=label, **DASHED)
            axes.plot([], [], color=PALE, label=LIMIT, **DASHED)


def quantity_over_time(
    axes: Axes,
    motion: Sampled,
    order: int,
    joints: Sequence[int],
    unit: Unit,
    names: Sequence[str] | Mapping[int, str],
    limits: MotionLimits | None,
    numbers: Sequence[int] | None = None,
) -> None:
    """Position, velocity, acceleration or jerk of some joints, with their limits."""
    lower = upper = None
    if limits is not None:
        lower, upper = (unit.factor * x[joints] for x in ranges_of(limits)[order][1:])
    values = unit.factor * motion.values[order][:, joints]
    some = [names[j] for j in joints]
    lines_over_time(axes, motion.t, values, some, numbers or joints, lower, upper)
    axes.set_ylabel(f"{QUANTITIES[order]}\n({unit.of(order)})")


def mark_breaks(axes: Axes, motion: Sampled, order: int, joints: Sequence[int], unit: Unit) -> None:
    """Times at which pieces meet: lines where all joints share them, else dots on the lines."""
    if len(motion.breaks) == 1:
        for time in motion.breaks[0][1:-1]:
            axes.axvline(time, color=PALE, linewidth=0.8, zorder=1.2, label="_break")
        return
    for j in joints if motion.breaks else ():
        at = np.searchsorted(motion.t, motion.breaks[j]).clip(max=len(motion.t) - 1)
        y = unit.factor * motion.values[order, at, j]
        color = style.line(j)["color"]
        axes.plot(motion.t[at], y, "o", color=color, markersize=2.4, label="_break")
