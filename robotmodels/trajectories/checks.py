"""What is asked of a motion, checked once: vectors, durations and limits."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from .._arrays import Array, as_floats, as_number
from ..errors import InvalidValueError, ShapeError
from ..kinematics.singular.task import whole_number
from .laws import LineLimits
from .limits import RATES, MotionLimits

ROUNDING = 1e-12
"""Relative shortfall of a given duration that is put down to rounding."""

_EXTREME = 1e50
"""Largest size of states and durations, and of their inverses: cubes of ratios are floats."""


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


def sample_count(N: Any, name: str = "N", least: int = 0, most: int = 10**9) -> int:
    """A number of samples, not more than can be held."""
    count = whole_number(N, name, least)
    if count > most:
        raise InvalidValueError(f"{name}: expected a whole number of at most {most}, got {count}.")
    return count


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
        what, other = f"joint {j + 1}", "leave the joint where it is"
        if names:
            what, other = names[j], f"take poses without {names[j]}"
        raise InvalidValueError(
            f"limits: the limit of {RATES[i // 2]} of {what} is 0, but it has to move; any other "
            f"limit will do, or {other}."
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
    if not isinstance(limits, MotionLimits):
        raise InvalidValueError(
            f"limits: expected MotionLimits, got {type(limits).__name__}; write for instance "
            "MotionLimits(velocity=2.0, acceleration=10.0)."
        )
    limits = limits.for_joints(n)
    slack = 1e-9
    for q in postures:
        outside = (q < limits.lower - slack) | (q > limits.upper + slack)
        if outside.any():
            j = int(np.argwhere(outside)[0][-1])
            raise InvalidValueError(
                f"Joint {j + 1} is asked to be at {q[outside].ravel()[0]:.6g}, outside its limits "
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
    rates = () if bounds is None else [(f"limits: {name}", getattr(bounds, name)) for name in RATES]
    for name, values in (*states.items(), *rates, ("duration", np.array(T or 0.0))):
        size = np.abs(values[np.isfinite(values) & (values != 0.0)])
        least = 0.0 if name in ("q0", "q1") else 1.0 / _EXTREME
        if size.max(initial=0.0) > _EXTREME or size.min(initial=1.0) < least:
            raise InvalidValueError(
                f"{name}: expected sizes from {1.0 / _EXTREME:g} to {_EXTREME:g} (or 0), got "
                f"{size.max():.3g}; check the units."
            )
    return T, bounds


def least_shown(value: float, digits: int = 12) -> str:
    """A least value in few digits, rounded up: it is accepted when it is passed back."""
    text = f"{value:.{digits}g}"
    up = value + abs(value) * 10.0 ** (1 - digits)
    return text if float(text) >= value else f"{up:.{digits}g}"


def counted(number: int, one: str) -> str:
    """Number with its noun."""
    return f"{number} {one}" if number == 1 else f"{number} {one}s"


def greatest_shown(rows: Iterable[tuple[str, Array]]) -> str:
    """The greatest sizes of quantities of joints, and which joint has them."""
    texts = []
    for name, values in rows:
        size = np.abs(np.nan_to_num(values, posinf=np.inf, neginf=-np.inf))
        size = size.reshape(-1, values.shape[-1]).max(axis=0, initial=0.0)
        joint = f" (joint {int(size.argmax()) + 1})" if size.size > 1 and size.any() else ""
        texts.append(f"{name} {size.max():.4g}{joint}")
    return f"greatest {', '.join(texts)}"


def seconds_shown(t: Array) -> str:
    """The times of samples. Shapes: t (N,)."""
    times = f" from {t[0]:.4g} s to {t[-1]:.4g} s" if t.size > 1 else ""
    return counted(t.size, "sample") + (f" at {t[0]:.4g} s" if t.size == 1 else times)
