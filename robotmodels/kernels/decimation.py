"""Weighted sums of rows: a low-pass filter by which rows are thinned out."""

from __future__ import annotations

from ._compile import INT, INTS, NOTHING, OUT2, OUT3, STACK, VECTOR, compiled


@compiled(NOTHING(STACK, INTS, INTS, VECTOR, INT, INT, INT, OUT3, OUT2))
def add_rows(rows, use, first_column, taps, step, first, centre, sums, weights):
    """Add rows to the outputs in whose windows they are, each kind by itself.

    Parameters
    ----------
    rows : ndarray, shape (k, m, c)
        Rows of m kinds, the first of which has the number ``first``.
    use : ndarray of int, shape (k * m,)
        Whether a row takes part.
    first_column : ndarray of int, shape (m,)
        Columns before it are zero in the rows of this kind.
    taps : ndarray, shape (L,)
        Symmetric weights, L odd.
    step : int
        Output o is centred on row ``centre + o * step``.
    first, centre : int
        See above.
    sums : ndarray, shape (o, m, c)
        Of outputs, to add to.
    weights : ndarray, shape (o, m)
        Of outputs: the sum of the weights so far.
    """
    half = len(taps) // 2
    k, m, columns = rows.shape
    for i in range(k):
        # outputs whose centre is at most `half` rows away
        place = first + i - centre
        low = max(0, -((half - place) // step))
        high = min(len(weights) - 1, (place + half) // step)
        for j in range(m):
            if use[i * m + j] == 0:
                continue
            for o in range(low, high + 1):
                weight = taps[place - o * step + half]
                weights[o, j] += weight
                for c in range(first_column[j], columns):
                    sums[o, j, c] += weight * rows[i, j, c]
