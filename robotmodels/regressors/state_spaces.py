"""SciPy's filters as state-space systems."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._arrays import Array, as_floats
from ..errors import InvalidValueError

Space = tuple[Array, Array, Array, Array]


def is_discrete(system: Any, dt: float | None) -> bool:
    """Whether a filter is a discrete-time one."""
    from scipy import signal

    if isinstance(system, signal.lti) and dt is not None:
        raise InvalidValueError("dt: the filter is a continuous one (lti), it has no period.")
    if isinstance(system, np.ndarray) and dt is None:
        raise InvalidValueError(
            "dt: second-order sections are a discrete filter; give its sampling period, "
            "from_scipy(sos, dt=1 / fs)."
        )
    return isinstance(system, signal.dlti) or dt is not None


def continuous_space(system: Any) -> Space:
    """State-space matrices of a continuous filter.

    Shapes: -> A (m, m), B (m, 1), C (1, m), D (1, 1).
    """
    from scipy import signal

    try:
        given: Any = system if isinstance(system, signal.lti) else signal.lti(*system)
        space = given.to_ss()
    except (TypeError, ValueError) as error:
        raise InvalidValueError(
            "system: expected a filter of SciPy, such as butter(2, 60.0, analog=True), or a "
            f"discrete one with its period dt, got {system!r:.80} ({error})."
        ) from None
    return _single(space)


def discrete_space(given: object, dt: float | None) -> tuple[Space, float]:
    """State-space matrices of a discrete filter, and its sampling period. Shapes: given (k, 6)."""
    from scipy import signal

    system: Any = given
    own = system.dt if isinstance(given, signal.dlti) else None
    period = own if dt is None else dt
    if period is True or period is None:
        raise InvalidValueError(
            "dt: the discrete filter says no sampling period; give it, from_scipy(system, dt=...)."
        )
    step = as_floats(period, "dt")
    if step.ndim != 0 or not step > 0.0:
        raise InvalidValueError(f"dt: expected the sampling period in seconds, got {period!r:.80}.")
    if own is not None and own is not True and abs(float(own) - float(step)) > 1e-9 * float(step):
        raise InvalidValueError(f"dt: the filter's own period is {float(own):g} s, got {period} s.")
    try:
        if isinstance(given, np.ndarray):
            space = _cascade(as_floats(given, "system"))
        elif isinstance(given, signal.ZerosPolesGain):
            sections = signal.zpk2sos(system.zeros, system.poles, system.gain)
            space = _cascade(np.asarray(sections, np.float64))
        elif own is None and len(system) == 3:
            space = _cascade(np.asarray(signal.zpk2sos(*system), np.float64))
        else:
            found: Any = system if own is not None else signal.dlti(*system, dt=float(step))
            space = _single(found.to_ss())
    except (TypeError, ValueError, IndexError) as error:
        if isinstance(error, InvalidValueError):
            raise
        raise InvalidValueError(
            "system: expected a discrete filter of SciPy, such as butter(4, 10.0, fs=1000.0, "
            f"output='sos'), got {system!r:.80} ({error})."
        ) from None
    return space, float(step)


def _single(space: Any) -> Space:
    A, B, C, D = (np.asarray(part, np.float64) for part in (space.A, space.B, space.C, space.D))
    if B.shape[1:] != (1,) or C.shape[:1] != (1,):
        raise InvalidValueError("system: expected one input and one output.")
    return A, B, C, D


def _cascade(sections: Array) -> Space:
    """Second-order sections one after another."""
    if sections.ndim != 2 or sections.shape[1] != 6:
        raise InvalidValueError(
            f"system: expected second-order sections of shape (k, 6), got {sections.shape}."
        )
    A, B, C, D = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1))
    for row in sections:
        b, (_, a1, a2) = row[:3] / row[3], row[3:] / row[3]
        count = 2 if b[2] or a2 else 1 if b[1] or a1 else 0  # states that do not only wait
        section = np.array([[-a1, 1.0], [-a2, 0.0]])[:count, :count]
        into = np.array([[b[1] - a1 * b[0]], [b[2] - a2 * b[0]]])[:count]
        read = np.array([[1.0, 0.0]])[:, :count]
        A = np.block([[A, np.zeros((len(A), count))], [into @ C, section]])
        B = np.vstack([B, into @ D])
        C = np.hstack([b[0] * C, read])
        D = b[0] * D
    return A, B, C, D
