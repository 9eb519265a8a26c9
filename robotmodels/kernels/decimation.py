"""Weighted sums of rows: a low-pass filter by which rows are thinned out."""

from __future__ import annotations

import numpy as np

from ._compile import INT, INTS, NOTHING, OUT2, OUT3, STACK, VECTOR, compiled

_ROWS = 4
"""Rows that are added at a time, or the sums would be fetched and stored for each."""


@compiled(NOTHING(STACK, INTS, INTS, VECTOR, INT, INT, INT, OUT3, OUT2))
def add_rows(rows, use, first_column, taps, step, first, centre, sums, weights):
    """Add rows to the outputs in whose windows they are, each kind by itself.

    Shapes: rows (k, m, c), use (k * m,), first_column (m,), taps (L,), sums (o, m, c), weights
    (o, m).
    """
    half = len(taps) // 2
    k, m, columns = rows.shape
    w = np.empty(_ROWS)
    for start in range(0, k, _ROWS):
        count = min(_ROWS, k - start)
        # outputs whose centre is at most `half` rows away from one of these rows
        place = first + start - centre
        low = max(0, -((half - place) // step))
        high = min(len(weights) - 1, (place + count - 1 + half) // step)
        for j in range(m):
            for o in range(low, high + 1):
                total = 0.0
                for r in range(_ROWS):
                    w[r] = 0.0
                    tap = place + r - o * step + half
                    if r < count and use[(start + r) * m + j] != 0 and 0 <= tap < len(taps):
                        w[r] = taps[tap]
                        total += w[r]
                if total == 0.0 and w[0] == 0.0 and w[1] == 0.0 and w[2] == 0.0:
                    continue
                weights[o, j] += total
                i0, last = start, k - 1
                i1, i2, i3 = min(i0 + 1, last), min(i0 + 2, last), min(i0 + 3, last)
                w0, w1, w2, w3 = w[0], w[1], w[2], w[3]
                for c in range(first_column[j], columns):
                    sums[o, j, c] += (w0 * rows[i0, j, c] + w1 * rows[i1, j, c]) + (
                        w2 * rows[i2, j, c] + w3 * rows[i3, j, c]
                    )
