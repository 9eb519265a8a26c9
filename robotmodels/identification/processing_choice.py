"""Choices of the processing for a robot and a log: those with which torques are predicted best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..logs import Log
from ..minimal_parameters import BaseParameters
from .preparation.processing import Processing, choose_processing
from .regressor_noise import RegressorNoise, bias_ratio, regressor_noise

EQUATIONS = 20
"""Equations for each parameter at least."""
_BIAS = 0.1
"""Bias by noise in the regressor at most, in standard errors."""
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

    The cutoff of the equations is the highest at which noise of the positions biases no parameter
    by more than `_BIAS` standard errors; there are never fewer than `EQUATIONS` equations for a
    parameter, if the log has as many samples.
    """
    plain = choose_processing(log, cutoff, decimation, dead_band, edges)
    most = max(1, len(log) * (kinds or log.n) // (EQUATIONS * len(base)))
    highest = min(max(_HIGHEST, _OF_MOTION * plain.motion), _NYQUIST / log.dt)
    lowest = min(_OF_MOTION * plain.motion, highest)
    if cutoff is not None:
        lowest, highest = min(lowest, cutoff), max(highest, cutoff)
    noise = regressor_noise(base, log, lowest, highest)
    if cutoff is not None:
        step = decimation or max(1, min(plain.decimation, most))
        asked = min(cutoff, _HALF / (step * log.dt))
        chosen = choose_processing(log, cutoff, step, dead_band, edges)
        return _told(chosen, base, log, kinds, asked, bias_ratio(noise, asked))
    if decimation is not None:
        highest = min(highest, _HALF / (decimation * log.dt))
    band, ratio = _highest_cutoff(noise, min(lowest, highest), highest)
    step = decimation or max(1, min(int(_HALF / (band * log.dt)), most))
    # where more equations are asked for than the noise leaves to know, positions are cut off lower
    wider = np.clip(_POSITIONS * band * step * log.dt / _HALF, 1.0, _POSITIONS)
    positions = min(float(wider) * band, _NYQUIST / log.dt)
    chosen = choose_processing(log, positions, step, dead_band, edges)
    return _told(chosen, base, log, kinds, band, ratio)


def _highest_cutoff(noise: RegressorNoise, lowest: float, highest: float) -> tuple[float, Array]:
    """The highest cutoff at which no parameter is noticeably biased, and the biases there."""
    band = highest
    ratio = bias_ratio(noise, band)
    while ratio.max(initial=0.0) > _BIAS and band > lowest:
        band = max(lowest, band / _STEP)
        ratio = bias_ratio(noise, band)
    return band, ratio


def _told(
    chosen: Processing, base: BaseParameters, log: Log, kinds: int | None, band: float, ratio: Array
) -> Processing:
    """The choices, with sentences on the noise and on the number of equations."""
    rate = len(log) * (kinds or log.n) / chosen.decimation / len(base)
    notes = [
        f"The equations hold frequencies up to {band:.3g} Hz, about {rate:.3g} equations for each "
        f"of {len(base)} parameters."
    ]
    worst = int(np.argmax(ratio)) if len(ratio) else 0
    if ratio.max(initial=0.0) > _BIAS:
        notes.append(
            f"Noise of the positions biases parameters by up to {ratio[worst]:.2g} standard errors "
            f"({base.names[worst]}) at this cutoff, as predicted; a lower cutoff=, better position "
            "signals, or method 'iv' avoid that."
        )
    if rate < EQUATIONS:
        notes.append(
            f"That is fewer than {EQUATIONS} equations for each parameter: the log is short for "
            "so many parameters. Record a longer one, or identify fewer."
        )
    return replace(chosen, notes=(*chosen.notes, *notes))
