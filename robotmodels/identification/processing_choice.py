"""Choice of the processing for a robot and a log, so that other motion is predicted well."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..logs import Log
from ..minimal_parameters import BaseParameters
from .preparation.processing import (
    Processing,
    checked_cutoff,
    checked_decimation,
    completed,
    decimated,
    motion_of,
    requested_cutoff,
)
from .regressor_noise import RegressorNoise, bias_ratio, regressor_noise

LEAST_EQUATIONS = 20
"""Least number of equations for each parameter."""
MOST_BIAS = 0.1
"""Largest bias by noise in the regressor, in standard errors."""
_HIGHEST, _OF_MOTION = 15.0, 2.5
"""Highest cutoff of the equations, Hz (joints are flexible above), and lowest, in frequencies of
the motion."""
_STEP = 1.3
_POSITIONS = 2.5
"""Cutoff of the positions, in cutoffs of the equations, so that it does not distort them."""
_HALF, _NYQUIST = 0.4, 0.4
"""Where the decimation's window falls to half, in rates of the equations; highest filter, in rates
of the log."""


def processing_for(
    base: BaseParameters,
    log: Log,
    cutoff: float | None = None,
    decimation: int | None = None,
    dead_band: ArrayLike | None = None,
    edges: float | None = None,
    kinds: int | None = None,
) -> Processing:
    """Choose the processing; ``kinds`` equations at a time (default one for each joint).

    The cutoff is the highest that biases no parameter by more than `MOST_BIAS` standard errors,
    the decimation leaves `LEAST_EQUATIONS` equations for each parameter where there are as many.
    """
    motion, noise = motion_of(log)
    most = max(1, int(equations_per_parameter(base, log, kinds, 1) / LEAST_EQUATIONS))
    step = None if decimation is None else checked_decimation(log, decimation)
    highest = min(max(_HIGHEST, _OF_MOTION * motion), _NYQUIST / log.dt)
    lowest = min(_OF_MOTION * motion, highest)
    if cutoff is not None:
        positions = checked_cutoff(log, cutoff)
        step = step or min(decimation_for(positions / _POSITIONS, log.dt), most)
        band = min(positions, _HALF / (step * log.dt), _NYQUIST / log.dt)
        given = regressor_noise(base, log, min(lowest, band), max(highest, band))
        ratio = bias_ratio(given, band)
        why = requested_cutoff(positions)
        lowered = ""
    else:
        highest = highest if step is None else min(highest, _HALF / (step * log.dt))
        given = regressor_noise(base, log, min(lowest, highest), highest)
        band, ratio, lowered = _highest_cutoff(given, min(lowest, highest), highest)
        step = step or min(decimation_for(band, log.dt), most)
        # where the equations go beyond what the noise allows, the positions are filtered lower
        wider = np.clip(_POSITIONS * band * step * log.dt / _HALF, 1.0, _POSITIONS)
        positions = min(float(wider) * band, _NYQUIST / log.dt)
        why = (
            f"Positions are low-pass filtered at {positions:.3g} Hz, so that their noise is "
            f"predicted to bias no parameter by more than {MOST_BIAS:g} standard errors."
        )
    reasons = [why + lowered, decimated(step, log.dt)]
    if ratio.max(initial=0.0) > MOST_BIAS:
        worst = int(np.argmax(ratio))
        reasons[0] = (
            f"Positions are low-pass filtered at {positions:.3g} Hz"
            f"{', as requested' if cutoff is not None else ', the lowest for this motion'}. Noise "
            f"of the positions is predicted to bias parameters by up to {ratio[worst]:.2g} "
            f"standard errors ({base.names[worst]}) there; use a lower cutoff=, better position "
            "signals, or method 'iv'."
        )
    return completed(log, motion, noise, positions, step, dead_band, edges, tuple(reasons))


def decimation_for(cutoff: float, dt: float) -> int:
    """Decimation that leaves frequencies up to ``cutoff`` Hz in the equations."""
    return max(1, int(_HALF / (cutoff * dt) * (1.0 + 1e-9)))  # not one less by rounding


def equations_per_parameter(
    base: BaseParameters, log: Log, kinds: int | None, decimation: int
) -> float:
    """Equations for each parameter, ``kinds`` at a time; edges and dead bands are not taken off."""
    return len(log) * (kinds or log.n) / (decimation * len(base))


def _highest_cutoff(
    given: RegressorNoise, lowest: float, highest: float
) -> tuple[float, Array, str]:
    """Highest cutoff without noticeable bias, the bias ratios there, and why it was lowered."""
    band, ratio, why = highest, bias_ratio(given, highest), ""
    if ratio.max(initial=0.0) > MOST_BIAS:
        name = given.base.names[int(np.argmax(ratio))]
        why = (
            f" Equations up to {highest:.3g} Hz would bias {name} by "
            f"{ratio.max():.2g} standard errors."
        )
    while ratio.max(initial=0.0) > MOST_BIAS and band > lowest:
        band = max(lowest, band / _STEP)
        ratio = bias_ratio(given, band)
    return band, ratio, why
