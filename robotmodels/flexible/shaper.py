"""Input shapers: impulses that leave no vibration of a given frequency."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, Value, as_floats, as_number
from .._choices import one_of

_IMPULSES = {"ZV": 2, "ZVD": 3}


@dataclass(frozen=True, slots=True, eq=False)
class Shaper(Frozen, Value):
    """Impulses that a reference is convolved with.

    Parameters
    ----------
    times, amplitudes : ndarray, shape (k,)
        Times, s, and amplitudes, whose sum is 1.
    frequency, damping : float
        Of the vibration: undamped, rad/s, and damping ratio.
    """

    times: Array
    amplitudes: Array
    frequency: float
    damping: float

    def residual(self, relative_frequency_error: ArrayLike = 0.0) -> Array:
        """Vibration that is left, relative to one impulse: ``|sum A_i exp(s t_i)|`` at the end."""
        w = self.frequency * (1.0 + as_floats(relative_frequency_error, "relative_frequency_error"))
        w, damping = w[..., None], self.damping
        s = w * (damping + 1j * np.sqrt(1.0 - damping**2))
        left = np.abs((self.amplitudes * np.exp(s * self.times)).sum(axis=-1))
        return left * np.exp(-damping * w[..., 0] * self.times[-1])

    def shaped(self, reference: Callable[[Array], Array]) -> Callable[[ArrayLike], Array]:
        """Convolution of a function of time, such as ``trajectory.q``, with the impulses."""
        pairs = list(zip(self.times.tolist(), self.amplitudes.tolist(), strict=True))
        return lambda t: sum(a * reference(np.asarray(t) - delay) for delay, a in pairs)  # type: ignore[return-value]


def input_shaper(frequency: float, damping: float = 0.0, kind: str = "ZV") -> Shaper:
    """Input shaper for one vibration (section 7.3.3.2).

    Parameters
    ----------
    frequency : float
        Undamped natural frequency, rad/s.
    damping : float
        Damping ratio, from 0 and below 1.
    kind : str
        ``"ZV"``: no vibration at the frequency; ``"ZVD"``: nor a derivative by it.

    Returns
    -------
    Shaper
        Two or three impulses, each half a period after the other.

    Raises
    ------
    InvalidValueError
        A frequency that is not positive, damping outside [0, 1), an unknown kind.

    References
    ----------
    N. Singer and W. Seering, "Preshaping command inputs to reduce system vibration", J. Dyn.
    Syst. Meas. Control 112 (1990).

    Examples
    --------
    >>> shaper = input_shaper(2.0, kind="ZVD")
    >>> shaper.amplitudes, float(shaper.residual().round(12))
    (array([0.25, 0.5 , 0.25]), 0.0)
    """
    w = as_number(frequency, "frequency", above=0.0)
    damping = as_number(damping, "damping", least=0.0, below=1.0)
    count, root = _IMPULSES[one_of(kind, tuple(_IMPULSES), "kind")], np.sqrt(1.0 - damping**2)
    ratio = np.exp(-damping * np.pi / root)
    amplitudes = np.array([comb(count - 1, i) * ratio**i for i in range(count)])
    times = np.arange(count) * np.pi / (w * root)
    return Shaper(times, amplitudes / amplitudes.sum(), w, damping)
