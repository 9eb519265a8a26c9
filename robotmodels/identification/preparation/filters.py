"""Filters of logs: zero-phase low-pass, central differences, and the window of the decimation."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_floats, read_only
from ...errors import InvalidValueError, ShapeError

_SETTLED = 1e-13
"""What is left of a filter's memory where a margin ends."""
_HALF_WINDOW = 5
"""Half of the decimation's window, in samples after it."""
_DIFFERENCES = {2: (1 / 2,), 4: (2 / 3, -1 / 12), 6: (3 / 4, -3 / 20, 1 / 60)}


def zero_phase(x: ArrayLike, cutoff: float, dt: float, order: int = 4) -> Array:
    """Butterworth low-pass filter, forward and backward: no delay, -3 dB at the cutoff.

    Each of the two passes takes half of the 3 dB, so that the whole has its -3 dB point where it is
    asked for. At the ends the signal is continued by its point reflection.

    Parameters
    ----------
    x : array_like, shape (N, ...)
        Samples along the first axis.
    cutoff : float
        Frequency of the -3 dB point, Hz, below half the sampling rate.
    dt : float
        Sampling period, seconds.
    order : int
        Of each pass.

    Returns
    -------
    ndarray, shape (N, ...)
        The filtered samples.

    Raises
    ------
    InvalidValueError, ShapeError
        A cutoff that is not between zero and half the sampling rate; an order below 1; NaN; fewer
        than two samples.

    References
    ----------
    Seed book section 1.6.2.4; F. Gustafsson, "Determining the initial states in forward-backward
    filtering", IEEE Trans. Signal Processing 44(4), 1996.

    Examples
    --------
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> y = zero_phase(np.sin(2 * np.pi * 5.0 * t), cutoff=5.0, dt=0.01)
    >>> round(float(np.abs(y[500:1500]).max()), 3)
    0.707
    """
    from ...kernels.biquads import forward_backward

    signal = as_floats(x, "x")
    if signal.ndim < 1 or signal.shape[0] < 2:
        raise ShapeError(
            f"x: expected at least two samples along the first axis, got {np.shape(x)}."
        )
    sections = _sections(cutoff, dt, order)
    pad = min(settling(cutoff, dt, order), signal.shape[0] - 1)
    channels = np.ascontiguousarray(signal).reshape(len(signal), -1)
    out = np.empty(channels.shape)
    forward_backward(sections, channels, pad, out)
    return out.reshape(signal.shape)


def settling(cutoff: float, dt: float, order: int = 4) -> int:
    """Settling time of `zero_phase` in samples."""
    sections = _sections(cutoff, dt, order)
    # poles of a second-order section are a pair, that of a first-order one is alone
    sizes = np.where(sections[:, 4] != 0.0, np.sqrt(sections[:, 4]), np.abs(sections[:, 3]))
    slowest = float(sizes.max())
    return int(np.ceil(np.log(_SETTLED) / np.log(slowest))) if slowest > 0.0 else 1


def central_differences(x: ArrayLike, dt: float, accuracy: int = 4) -> Array:
    """Derivative of samples by central differences, without delay.

    Parameters
    ----------
    x : array_like, shape (N, ...)
        Samples along the first axis.
    dt : float
        Sampling period, seconds.
    accuracy : int
        2, 4 or 6: the error is of this order in ``2 pi f dt``. Near the ends lower orders are
        taken, at the first and last sample one-sided differences.

    Returns
    -------
    ndarray, shape (N, ...)
        Per second.

    Raises
    ------
    InvalidValueError, ShapeError
        Another accuracy; NaN; fewer than two samples.

    References
    ----------
    Seed book section 1.6.2.4.

    Examples
    --------
    >>> central_differences([0.0, 1.0, 4.0, 9.0, 16.0], 1.0)[1:4]
    array([2., 4., 6.])
    """
    signal = as_floats(x, "x")
    if accuracy not in _DIFFERENCES:
        raise InvalidValueError(f"accuracy: expected 2, 4 or 6, got {accuracy!r}.")
    N = signal.shape[0] if signal.ndim else 0
    if N < 2:
        raise ShapeError(
            f"x: expected at least two samples along the first axis, got {np.shape(x)}."
        )
    out = np.empty(signal.shape)
    out[0], out[-1] = signal[1] - signal[0], signal[-1] - signal[-2]
    for width in range(1, accuracy // 2 + 1):
        if 2 * width >= N:
            break
        inner = slice(width, N - width)
        out[inner] = 0.0
        for k, weight in enumerate(_DIFFERENCES[2 * width], start=1):
            ahead, behind = signal[width + k : N - width + k], signal[width - k : N - width - k]
            out[inner] += weight * (ahead - behind)
    out /= dt
    return out


def decimation_window(step: int) -> Array:
    """Weights of the low-pass by which every ``step``-th sample is kept.

    A sinc under Hamming's window that falls to half at 0.4 of the new sampling rate; the same for
    regressor and torque, which is what keeps them equal ("parallel decimation").

    Parameters
    ----------
    step : int
        Samples before for one after, from 1.

    Returns
    -------
    ndarray, shape (L,)
        Symmetric, of odd length, with the sum 1.

    References
    ----------
    Seed book section 1.6.2.5.

    Examples
    --------
    >>> decimation_window(1), round(float(decimation_window(10).sum()), 12)
    (array([1.]), 1.0)
    """
    if step < 1:
        raise InvalidValueError(f"step: expected a whole number from 1, got {step!r}.")
    if step == 1:
        return np.ones(1)
    k = np.arange(-_HALF_WINDOW * step, _HALF_WINDOW * step + 1)
    taps = np.sinc(0.8 * k / step) * np.hamming(len(k))
    return taps / taps.sum()


def _sections(cutoff: float, dt: float, order: int) -> Array:
    """Second-order sections b0, b1, b2, a1, a2 of one pass of a Butterworth low-pass."""
    if not isinstance(order, (int, np.integer)) or order < 1:
        raise InvalidValueError(f"order: expected a whole number from 1, got {order!r}.")
    if not 0.0 < cutoff < 0.5 / dt:
        raise InvalidValueError(
            f"cutoff: expected a frequency between 0 and half the sampling rate ({0.5 / dt:g} Hz), "
            f"got {cutoff!r}."
        )
    return _butterworth(float(cutoff), float(dt), int(order))


@lru_cache(maxsize=64)  # asked for each piece of each pass
def _butterworth(cutoff: float, dt: float, order: int) -> Array:
    # where one pass of a wider filter has lost half of the 3 dB; the bilinear design bends
    # frequencies by a tangent
    w = np.tan(np.pi * cutoff * dt) / (np.sqrt(2.0) - 1.0) ** (0.5 / order)
    rows = []
    if order % 2:
        rows.append((w / (1.0 + w), w / (1.0 + w), 0.0, (w - 1.0) / (w + 1.0), 0.0))
    for k in range(order // 2):
        # a pair of poles on the half circle, s^2 + 2 d w s + w^2, with s = (z - 1) / (z + 1)
        d = np.sin(np.pi * (2 * k + 1) / (2 * order))
        size = 1.0 + 2.0 * d * w + w**2
        b = w**2 / size
        rows.append((b, 2.0 * b, b, 2.0 * (w**2 - 1.0) / size, (1.0 - 2.0 * d * w + w**2) / size))
    return read_only(rows)
