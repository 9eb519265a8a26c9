"""Second-order filter sections, forward and backward over channels of samples."""

from __future__ import annotations

import numpy as np

from ._compile import INT, MATRIX, OUT2, Floats, compiled


@compiled()
def run_sections(sections: Floats, x: Floats) -> None:
    """Filter one channel in place, from the state of rest at its first sample."""
    N = x.shape[0]
    for s in range(sections.shape[0]):
        b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
        a1, a2 = sections[s, 3], sections[s, 4]
        gain = (b0 + b1 + b2) / (1.0 + a1 + a2)
        later = (b2 - a2 * gain) * x[0]
        state = (b1 - a1 * gain) * x[0] + later
        for i in range(N):
            given = x[i]
            y = b0 * given + state
            state = b1 * given - a1 * y + later
            later = b2 * given - a2 * y
            x[i] = y


@compiled(INT(MATRIX, MATRIX, INT, OUT2))
def forward_backward(sections, x, pad, out):
    """Filter channels forward and backward, continued by their point reflection at both ends.

    Shapes: sections (s, 5), x (N, c) -> out (N, c).
    """
    N, channels = x.shape
    buffer = np.empty(N + 2 * pad)
    for c in range(channels):
        for i in range(pad):
            buffer[i] = 2.0 * x[0, c] - x[pad - i, c]
            buffer[pad + N + i] = 2.0 * x[N - 1, c] - x[N - 2 - i, c]
        for i in range(N):
            buffer[pad + i] = x[i, c]
        run_sections(sections, buffer)
        run_sections(sections, buffer[::-1])
        for i in range(N):
            out[i, c] = buffer[pad + i]
    return len(buffer)
