"""Least durations on a circle, where the acceleration towards the centre takes its part.

On a circle of radius r the position has the acceleration ``(L s'', (L s')^2 / r)`` along the path
and towards the centre, and the jerk ``(L s''' - (L s')^3 / r^2, 3 L^2 s' s'' / r)``. Slowed down
evenly, a motion divides them by powers of one factor, so that a law of one shape is as quick as the
factor allows. Of the shapes of a law the quickest is taken: the part of the time that its ramps
take and, with seven phases, the part of a ramp that bends.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from .laws import Pieces, Ramp, TimeLaw, law_of_duration, phases, ramped
from .limits import MotionLimits
from .pose_trajectory import FixedAxisPath

_MARGIN = 1.0 + 1e-13
"""Durations are this much above the least, so that rounding does not exceed a limit."""
_SAMPLES = np.linspace(0.0, 1.0, 33)


def circle_law(law: TimeLaw, path: FixedAxisPath, limits: MotionLimits) -> Pieces:
    """The quickest motion of a law along a whole arc, under limits of translation and rotation."""
    from scipy.optimize import minimize, minimize_scalar

    shape = np.zeros(2)
    if law in (TimeLaw.TRAPEZOIDAL, TimeLaw.SMOOTHED_TRAPEZOIDAL):
        smooth = law is TimeLaw.SMOOTHED_TRAPEZOIDAL
        shape[0] = minimize_scalar(
            lambda part: _stretch(_of_shape(law, part, 0.0), path, limits, smooth),
            bounds=(1e-6, 0.5),
            method="bounded",
            options={"xatol": 1e-13},
        ).x
    elif law is TimeLaw.JERK_LIMITED:
        shape = minimize(
            lambda x: _stretch(_of_shape(law, *x), path, limits),
            (0.3, 0.3),
            bounds=((1e-6, 0.5), (1e-6, 0.5)),
            method="Nelder-Mead",
            options={"xatol": 1e-7, "fatol": 1e-10},
        ).x
    pieces = _of_shape(law, *shape)
    stretch = _stretch(pieces, path, limits, exact=True) * _MARGIN
    return Pieces(pieces.durations * stretch, pieces.coefficients)


def _of_shape(law: TimeLaw, part: float, bend: float) -> Pieces:
    """Motion of unit duration; ``part`` is that of a ramp, ``bend`` that of a bend in a ramp."""
    one, ramp_part = np.ones(1), np.full(1, part)
    if law in (TimeLaw.TRAPEZOIDAL, TimeLaw.SMOOTHED_TRAPEZOIDAL):
        return ramped(law, one, 1.0 / (1.0 - ramp_part), one, ramp_part, ramp_part)
    if law is TimeLaw.JERK_LIMITED:
        V, turn = 1.0 / (1.0 - ramp_part), ramp_part * bend
        ramp = Ramp(turn, ramp_part - 2.0 * turn, turn, 0.5 * V * ramp_part, ramp_part)
        return Pieces(*phases(one, V, ramp, 1.0 - 2.0 * ramp_part, ramp))
    return law_of_duration(law, one, one)


def _stretch(
    pieces: Pieces, path: FixedAxisPath, limits: MotionLimits, exact: bool = False
) -> float:
    """Factor on the duration of a motion with which it keeps all limits, one in full.

    Not ``exact``: at samples, ends of the phases included, which serves to compare shapes.
    """
    L, r, turn = path.length, path.radius, abs(path.turn)
    V, W, A, B, J, K = (
        float(x) for pair in (limits.velocity, limits.acceleration, limits.jerk) for x in pair
    )
    need = 0.0
    half = (pieces.durations.shape[-1] + 1) // 2  # both halves of a motion are alike
    for h, c in zip(pieces.durations[0, :half], pieces.coefficients[0], strict=False):
        if h <= 0.0:
            continue
        s = Polynomial(c)
        v, a, j = (s.deriv(k) / h**k for k in (1, 2, 3))
        peak = _peak
        if not exact:
            v, a, j, peak = v(_SAMPLES), a(_SAMPLES), j(_SAMPLES), np.max
        need = max(need, np.sqrt(peak(v * v)) * max(L / V, turn / W))
        need = max(need, (peak((L * a) ** 2 + (L * L * v * v / r) ** 2) / A**2) ** 0.25)
        need = max(need, (peak(a * a) * (turn / B) ** 2) ** 0.25)
        need = max(need, (peak(j * j) * (turn / K) ** 2) ** (1.0 / 6.0))
        if np.isfinite(J):
            jolt = (L * j - (L * v) ** 3 / r**2) ** 2 + (3.0 * L * L * v * a / r) ** 2
            need = max(need, (peak(jolt) / J**2) ** (1.0 / 6.0))
    return float(need)


def _peak(p: Polynomial) -> float:
    """Greatest value of a polynomial on [0, 1]."""
    x = np.clip(p.deriv().roots().real, 0.0, 1.0)
    return float(max(p(0.0), p(1.0), *p(x)))
