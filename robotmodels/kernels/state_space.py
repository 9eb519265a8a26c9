"""A linear filter on many channels, sample after sample."""

import numpy as np
from numba import types

from ._compile import MATRIX, NOTHING, OUT1, OUT2, VECTOR, Floats, compiled

__all__ = ["filtered"]


@compiled()
def step_states(
    u: Floats,
    k: int,
    step: Floats,
    present: Floats,
    coming: Floats,
    state: Floats,
    last: Floats,
) -> None:
    """Bring the states of all channels to sample k."""
    m = step.shape[0]
    if m == 1:
        for c in range(u.shape[1]):
            state[0, c] = step[0, 0] * state[0, c] + present[0] * last[c] + coming[0] * u[k, c]
        return
    new = np.empty(m)
    for c in range(u.shape[1]):
        for r in range(m):
            x = present[r] * last[c] + coming[r] * u[k, c]
            for s in range(m):
                x += step[r, s] * state[s, c]
            new[r] = x
        for r in range(m):
            state[r, c] = new[r]


@compiled(
    NOTHING(MATRIX, MATRIX, VECTOR, VECTOR, VECTOR, types.float64, types.boolean, OUT2, OUT1, OUT2)
)
def filtered(
    u: Floats,
    step: Floats,
    present: Floats,
    coming: Floats,
    output: Floats,
    through: float,
    first: bool,
    state: Floats,
    last: Floats,
    out: Floats,
) -> None:
    """Outputs of ``x_k = step x_(k-1) + present u_(k-1) + coming u_k``.

    Parameters
    ----------
    u : (N, c)
        Samples of c channels.
    step : (m, m)
        Of the state over one period.
    present, coming : (m,)
        Of the samples before and after it.
    output, through : (m,), float
        ``y_k = output x_k + through u_k``.
    first : bool
        Whether ``state`` is that of the first sample already.
    state : (m, c)
        Before the first sample; overwritten with that of the last.
    last : (c,)
        The sample before the first; overwritten with the last.
    out : (N, c)
        Written.
    """
    m = step.shape[0]
    for k in range(u.shape[0]):
        if k > 0 or not first:
            step_states(u, k, step, present, coming, state, last)
        for c in range(u.shape[1]):
            y = through * u[k, c]
            for r in range(m):
                y += output[r] * state[r, c]
            out[k, c] = y
            last[c] = u[k, c]
