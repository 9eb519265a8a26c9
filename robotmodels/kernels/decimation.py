"""Weighted sums of rows: a low-pass filter by which rows are thinned out."""

from __future__ import annotations

from ._compile import INT, MATRIX, NOTHING, OUT1, OUT2, VECTOR, compiled


@compiled(NOTHING(MATRIX, VECTOR, INT, INT, INT, OUT2, OUT1))
def add_rows(rows, taps, step, first, centre, sums, weights):
    """Add rows to the outputs in whose windows they are.

    Parameters
    ----------
    rows : ndarray, shape (k, c)
        Rows, the first of which has the number ``first``.
    taps : ndarray, shape (L,)
        Symmetric weights, L odd.
    step : int
        Output o is centred on row ``centre + o * step``.
    first, centre : int
        See above.
    sums : ndarray, shape (m, c)
        Of outputs, to add to.
    weights : ndarray, shape (m,)
        Of outputs: the sum of the weights so far.
    """
    half = len(taps) // 2
    m = len(weights)
    for i in range(len(rows)):
        # outputs whose centre is at most `half` rows away
        place = first + i - centre
        low = max(0, -((half - place) // step))
        high = min(m - 1, (place + half) // step)
        for o in range(low, high + 1):
            weight = taps[place - o * step + half]
            weights[o] += weight
            for c in range(rows.shape[1]):
                sums[o, c] += weight * rows[i, c]
