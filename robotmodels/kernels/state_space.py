"""A linear filter on many channels, sample after sample."""

import numpy as np
from numba import types

from ._compile import MATRIX, NOTHING, OUT1, OUT2, VECTOR, Floats, compiled

__all__ = ["filtered"]


@compiled()
def add_scaled(y: Floats, factor: float, x: Floats) -> None:
    """Add ``factor x`` to y, channel by channel: a plain loop, which the compiler makes wide."""
    for c in range(y.shape[0]):
        y[c] += factor * x[c]


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

    Shapes: u (N, c); step (m, m); present, coming, output, through (m,); state (m, c); last (c,) ->
    out (N, c).
    """
    m = step.shape[0]
    new = np.empty(state.shape)
    for k in range(u.shape[0]):
        if k > 0 or not first:
            for r in range(m):
                new[r] = 0.0
                add_scaled(new[r], present[r], last)
                add_scaled(new[r], coming[r], u[k])
                for s in range(m):
                    if step[r, s] != 0.0:
                        add_scaled(new[r], step[r, s], state[s])
            state[:] = new
        out[k] = 0.0
        if through != 0.0:
            add_scaled(out[k], through, u[k])
        for r in range(m):
            if output[r] != 0.0:
                add_scaled(out[k], output[r], state[r])
        last[:] = u[k]
