"""What is asked of a motion, checked once: vectors, durations and limits."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats
from ..errors import InvalidValueError, ShapeError
from ..kinematics.singular.task import whole_number
from .laws import LineLimits
from .limits import RATES, MotionLimits, ranges_of

ROUNDING = 1e-12
"""Relative shortfall of a given duration that is put down to rounding."""

_EXTREME = 1e50
"""Largest size of states, durations and limits: cubes of their ratios are floats."""


def joint_vectors(**given: Any) -> tuple[dict[str, Array], tuple[int, ...], bool]:
    """Positions and rates of the same joints as arrays (R, n); leading axes; whether scalar."""
    arrays = {name: as_floats(value, name) for name, value in given.items()}
    try:
        shape = np.broadcast_shapes((1,), *(array.shape for array in arrays.values()))
    except ValueError:
        got = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ShapeError(f"Expected vectors of the same joints, got {got}.") from None
    refuse_jointless(shape[-1], " and ".join(tuple(given)[:2]))
    rows = {k: np.broadcast_to(v, shape).reshape(-1, shape[-1]) for k, v in arrays.items()}
    return rows, shape[:-1], all(array.ndim == 0 for array in arrays.values())


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


def limits_along(limits: MotionLimits, direction: Array, names: tuple[str, ...] = ()) -> LineLimits:
    """Limits of the coordinate that several joints share.

    Shapes: direction (R, 1, n) or (R, n, 1).
    """
    own = direction.shape[-1] == 1 and direction.shape[-2] == limits.velocity.size
    u = direction[..., 0] if own else direction[..., 0, :]
    pairs = [(getattr(limits, f"{name}_lower"), getattr(limits, name)) for name in RATES]
    most = np.stack([x for low, high in pairs for x in (high, -low)])[:, None]
    # the bound that stops the coordinate from growing; then that of the way back
    bounds = np.where(u > 0.0, most, most[[1, 0, 3, 2, 5, 4]])
    zero = (u != 0.0) & (bounds == 0.0)
    zero[1] = False
    if zero.any():
        i, *_, j = (int(k) for k in np.argwhere(zero)[0])
        what, other = f"joint {j + 1}", "leave the joint where it is"
        if names:
            what, other = names[j], f"take poses without {names[j]}"
        raise InvalidValueError(
            f"limits: the limit of {RATES[i // 2]} of {what} is 0, but it has to move; any other "
            f"limit will do, or {other}."
        )
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        bounds = np.where(u != 0.0, bounds / np.abs(u), np.inf)
    V, back, A, B, J, K = bounds.reshape(6, -1) if own else bounds.min(axis=-1)
    return LineLimits(V, A, B, J, K, back)


def given_durations(duration: ArrayLike | None, batch: tuple[int, ...]) -> Array | None:
    """Checked durations, shape (R,), one per motion."""
    if duration is None:
        return None
    T = as_floats(duration, "duration")
    if (T < 0.0).any():
        raise InvalidValueError(f"duration: expected seconds of at least 0, got {T.min():g}.")
    try:
        return np.broadcast_to(T, batch).reshape(-1)
    except ValueError:
        raise ShapeError(
            f"duration: expected one number or one per motion {batch}, got shape {T.shape}."
        ) from None


def checked_limits(limits: MotionLimits | None, n: int, *postures: Array) -> MotionLimits | None:
    """Limits of n joints, within which the postures are. Shapes: *postures (R, n)."""
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


def refuse_short(T: Array | None, least: Array, length: Array) -> None:
    """Refuse durations below the least feasible ones. Shapes: T, least (R,); length (R, ...)."""
    if T is None:
        return
    short = least * (1.0 - ROUNDING) > T
    if short.any():
        i = int(short.argmax())
        raise InvalidValueError(
            f"duration: {T[i]:.9g} s is too short for the limits; the least is "
            f"{least_shown(least[i])} s."
        )
    if ((T == 0.0) & (length > 0.0).any(axis=-1)).any():
        raise InvalidValueError("duration: expected a positive time for a motion, got 0 s.")


def slowed(T: Array, blends: Array, duration: ArrayLike | None, kept: bool) -> tuple[Array, Array]:
    """Times (m - 1,) of lines and (m,) of their blends, evenly stretched to a whole duration.

    ``kept``: whether limits make the given times the least ones.
    """
    least = float(T.sum() + 0.5 * (blends[0] + blends[-1]))
    wanted = given_durations(duration, ())
    if wanted is None or least == 0.0:
        return T, blends
    refuse_short(wanted, np.array([least if kept else 0.0]), np.ones((1, 1)))
    return T * (wanted[0] / least), blends * (wanted[0] / least)


def checked_request(
    states: dict[str, Array], batch: tuple[int, ...], duration: Any, limits: MotionLimits | None
) -> tuple[Array | None, MotionLimits | None]:
    """Durations (R,) and limits of a motion between states (R, n); at least one of the two.

    States, durations and limits whose powers overflow or underflow are refused.
    """
    T = given_durations(duration, batch)
    if T is None and limits is None:
        raise InvalidValueError("Give duration, limits or both.")
    bounds = checked_limits(limits, states["q0"].shape[1], states["q0"], states["q1"])
    given = states if T is None else states | {"duration": T}
    if bounds is not None:
        for name, least, most in ranges_of(bounds)[1:]:
            given = given | {f"limits: {name}": most, f"limits: {name}_lower": least}
    for name, values in given.items():
        size = np.abs(values)
        small = (size > 0.0) & (size < 1.0 / _EXTREME) & (name not in ("q0", "q1"))
        wrong = size[np.isfinite(size) & ((size > _EXTREME) | small)]
        if wrong.size:
            raise InvalidValueError(
                f"{name}: expected sizes from {1.0 / _EXTREME:g} to {_EXTREME:g} (or 0), got "
                f"{wrong[0]:.3g}; check the units."
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
        size = np.abs(np.where(np.isnan(values), 0.0, values)).reshape(-1, values.shape[-1])
        if size.size:
            size = size.max(axis=0)
            joint = f" (joint {int(size.argmax()) + 1})" if size.size > 1 and size.any() else ""
            texts.append(f"{name} {size.max():.4g}{joint}")
    return "greatest " + ", ".join(texts) if texts else "no values"


def seconds_shown(t: Array) -> str:
    """The times of samples. Shapes: t (N,)."""
    times = f" from {t[0]:.4g} s to {t[-1]:.4g} s" if t.size > 1 else ""
    return counted(t.size, "sample") + (f" at {t[0]:.4g} s" if t.size == 1 else times)
