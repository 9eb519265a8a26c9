"""Durations with which polynomials between two states keep limits.

The durations that do are intervals, whose ends are durations at which an extreme value of the
motion is just a limit. There either the value at an end of the motion is the limit, or value less
limit, a polynomial in the normalised time x, has a double root: it and its derivative have a root
in common, and their Sylvester matrix, a polynomial in the duration, is singular. The ends of the
intervals are thus eigenvalues, none of which a search could miss. Between two of them all durations
keep the limits or none does.
"""

from __future__ import annotations

from math import comb

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError
from .limits import MotionLimits
from .piecewise import PiecewisePolynomial

_SHIFT = -0.7
"""Eigenvalues are looked for as inverse distances from this duration, which is no solution."""

_KEPT = 1e-14
"""Relative excess that rounding alone makes."""


def between_states(order: int, states: dict[str, Array], T: Array) -> Array:
    """Coefficients of the polynomials between two states.

    Shapes: states (R, n) or (n,) -> (order + 1, ...).
    """
    return _powers_of_duration(order, states, np.stack((np.ones_like(T), T, T * T))).sum(axis=0)


def _powers_of_duration(order: int, states: dict[str, Array], of_T: Array) -> Array:
    """The parts of the coefficients with the powers 0 to 2 of the duration, (3, order + 1, ...)."""
    q0, D = states["q0"], states["q1"] - states["q0"]
    v0, v1, a0, a1 = (states[name] for name in ("v0", "v1", "a0", "a1"))
    none = np.zeros_like(q0)
    if order == 3:
        rows = (
            (q0, none, 3.0 * D, -2.0 * D),
            (none, v0, -2.0 * v0 - v1, v0 + v1),
            (none, none, none, none),
        )
    else:
        rows = (
            (q0, none, none, 10.0 * D, -15.0 * D, 6.0 * D),
            (none, v0, none, -6.0 * v0 - 4.0 * v1, 8.0 * v0 + 7.0 * v1, -3.0 * (v0 + v1)),
            (none, none, 0.5 * a0, -1.5 * a0 + 0.5 * a1, 1.5 * a0 - a1, 0.5 * (a1 - a0)),
        )
    return np.array([[row * power for row in part] for part, power in zip(rows, of_T, strict=True)])


def excess(order: int, state: dict[str, Array], T: Array, limits: MotionLimits) -> Array:
    """Relative excess over the worst limit for given durations."""
    c = np.moveaxis(between_states(order, state, T[:, None]), 0, -2)[:, None]
    motion = PiecewisePolynomial(np.stack((np.zeros_like(T), T), axis=-1)[:, None], c)
    worst = np.full(T.shape, -np.inf)
    for k, (least, most) in enumerate(_bounds(limits)):
        if not (np.isfinite(least).any() or np.isfinite(most).any()):
            continue
        low, high = motion.extremes(k)
        size = np.maximum(np.abs(least), np.abs(most))
        size = np.where(np.isfinite(size) & (size > 0.0), size, 1.0)
        over = np.maximum((high - most) / size, (least - low) / size)
        worst = np.maximum(worst, over.max(axis=-1))
    return worst


def least_duration(
    order: int, state: dict[str, Array], limits: MotionLimits, after: float = 0.0
) -> float | None:
    """Least duration with which the polynomials keep the limits."""
    D = np.abs(state["q1"] - state["q0"])
    if not (D.any() or any(state[name].any() for name in ("v0", "v1", "a0", "a1"))):
        return 0.0
    scales = _scales(state, limits)
    edges = _edges(order, state, limits, scales)
    # the edges part the durations; a few more in between do no harm
    around = np.geomspace(scales.min() / 1e3, scales.max() * 1e3, 40)
    edges = np.unique(np.concatenate((edges, around)))
    edges = edges[edges > after]
    between = np.sqrt(edges[1:] * edges[:-1])
    ends = (0.5 * edges[:1], 2.0 * edges[-1:]) if after == 0.0 else ([after], 2.0 * edges[-1:])
    trials = np.unique(np.concatenate((edges, between, *ends)))
    kept = excess(order, state, trials, limits) <= _KEPT
    if not kept.any():
        return None
    k = int(kept.argmax())
    if k == 0 and after > 0.0:
        return after
    if k == 0:
        raise InvalidValueError(
            "limits: between these states they are kept in any time, however short; give duration."
        )
    below, T = float(trials[k - 1]), float(trials[k])
    while np.nextafter(below, T) < T:
        finer = np.linspace(below, T, 18)
        kept = excess(order, state, finer[1:-1], limits) <= _KEPT
        k = int(kept.argmax()) + 1 if kept.any() else 17
        if (below, T) == (finer[k - 1], finer[k]):
            break
        below, T = float(finer[k - 1]), float(finer[k])
    return T


def _bounds(limits: MotionLimits) -> tuple[tuple[Array, Array], ...]:
    return (
        (limits.lower, limits.upper),
        (limits.velocity_lower, limits.velocity),
        (limits.acceleration_lower, limits.acceleration),
        (limits.jerk_lower, limits.jerk),
    )


def _scales(state: dict[str, Array], limits: MotionLimits) -> Array:
    """Times that the states and limits make: the durations sought are of their size."""
    D = np.abs(state["q1"] - state["q0"])
    v = np.maximum(np.abs(state["v0"]), np.abs(state["v1"]))
    a = np.maximum(np.abs(state["a0"]), np.abs(state["a1"]))
    V = np.minimum(limits.velocity, -limits.velocity_lower)
    A = np.minimum(limits.acceleration, -limits.acceleration_lower)
    J = np.minimum(limits.jerk, -limits.jerk_lower)
    room = np.minimum(
        np.maximum(limits.upper - np.maximum(state["q0"], state["q1"]), 0.0),
        np.maximum(np.minimum(state["q0"], state["q1"]) - limits.lower, 0.0),
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.concatenate(
            (D / V, np.sqrt(D / A), np.cbrt(D / J), v / A, np.sqrt(v / J),
             a / J, D / v, np.sqrt(D / a), v / a, V / a, room / v, np.sqrt(room / a))
        )  # fmt: skip
    times = times[np.isfinite(times) & (times > 0.0)]
    return times if times.size else np.ones(1)


def _edges(order: int, state: dict[str, Array], limits: MotionLimits, scales: Array) -> Array:
    """Durations at which an extreme value may be a limit, and others that are not."""
    start = {**state, "q0": np.zeros_like(state["q0"]), "q1": state["q1"] - state["q0"]}
    parts = _powers_of_duration(order, start, np.ones((3, 1)))
    # several units of time, so that edges of every size come out with their digits
    low, high = np.log(scales.min()), np.log(scales.max())
    units = np.exp(np.linspace(low, high, 1 + min(int((high - low) / np.log(30.0)), 5)))
    ends = {0: ("q0", "q1"), 1: ("v0", "v1"), 2: ("a0", "a1")}
    found = []
    for k, bounds in enumerate(_bounds(limits)):
        powers = np.arange(float(order + 1))
        c = (
            parts[:, k:] * np.prod([powers[k:] - i for i in range(k)], axis=0)[:, None]
            if k
            else (parts)
        )
        for side, bound in zip((-1.0, 1.0), bounds, strict=True):
            bound = bound - state["q0"] if k == 0 else bound
            live = np.isfinite(bound) & np.any(parts[:, 1:] != 0.0, axis=(0, 1))
            if not live.any():
                continue
            given = [start[name] for name in ends[k]] if k in ends and (k, order) != (2, 3) else []
            bound = _clear_of(bound, side, given)[live]
            # p[b, i, m]: power i of x and m of the duration, value less limit
            p = np.zeros((bound.size, c.shape[1], 4))
            p[..., :3] = np.moveaxis(c[..., live], -1, 0).swapaxes(-1, -2)
            p[:, 0, k] -= bound
            for unit in units:
                q = p * unit ** np.arange(4.0)
                q = q / np.abs(q).max(axis=(1, 2), keepdims=True)
                matrices = [end[..., None, None] for end in (q[:, 0], q.sum(axis=1))]
                if q.shape[1] > 2:
                    matrices.append(_sylvester(q))
                found += [unit * _singular_at(M) for M in matrices]
    return np.concatenate(found) if found else np.ones(1)


def _clear_of(bound: Array, side: float, given: list[Array]) -> Array:
    """Limits moved aside where the motion begins or ends on them, whatever the duration.

    There the double root is always, and hides the others. They are only edges: a small error of
    an edge does not matter.
    """
    size = np.maximum.reduce([np.abs(bound), *(np.abs(value) for value in given)])
    size = np.where(size > 0.0, size, 1.0)
    for value in given:
        bound = np.where(np.abs(bound - value) <= 1e-9 * size, bound + side * 1e-8 * size, bound)
    return bound


def _sylvester(p: Array) -> Array:
    """Sylvester matrices (B, g, 2 d - 1, 2 d - 1) of polynomials (B, d + 1, g) and derivatives."""
    B, powers, g = p.shape
    d = powers - 1
    S = np.zeros((B, 2 * d - 1, 2 * d - 1, g))
    slope = p[:, 1:] * np.arange(1.0, powers)[:, None]
    for row in range(d - 1):
        S[:, row, row : row + powers] = p
    for row in range(d):
        S[:, d - 1 + row, row : row + d] = slope
    return np.moveaxis(S, -1, 1)


def _singular_at(S: Array) -> Array:
    """Positive real T (K,) at which a matrix ``sum_m S[b, m] T^m`` of the batch is singular."""
    B, g, k, _ = S.shape
    while g > 1 and not S[:, g - 1].any():
        g -= 1
    if g == 1:
        return np.zeros(0)
    # T = shift + 1 / mu: the matrix at the shift leads the polynomial of mu
    C = [
        sum((comb(m, i) * _SHIFT ** (m - i) * S[:, m] for m in range(i, g)), np.zeros((B, k, k)))
        for i in range(g)
    ]
    lead = C[0]
    try:
        rest = np.linalg.solve(lead[:, None], np.stack(C[1:], axis=1))
    except np.linalg.LinAlgError:
        rest = np.linalg.pinv(lead)[:, None] @ np.stack(C[1:], axis=1)
    companion = np.zeros((B, (g - 1) * k, (g - 1) * k))
    companion[:, :k] = -np.moveaxis(rest, 1, 2).reshape(B, k, (g - 1) * k)
    companion[:, range(k, (g - 1) * k), range((g - 2) * k)] = 1.0
    mu = np.linalg.eigvals(companion).ravel()
    with np.errstate(divide="ignore", invalid="ignore"):
        T = _SHIFT + 1.0 / mu
    T = T[np.isfinite(T)]
    real: Array = T.real.astype(np.float64)[np.abs(T.imag) <= 1e-4 * np.abs(T.real)]
    return real[real > 0.0]
