"""Square blocks on the diagonal of a matrix with many zeros, rows and columns rearranged.

Source: A. L. Dulmage and N. S. Mendelsohn, "Coverings of bipartite graphs", 1958.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Block:
    """Rows and columns of a block; the determinant is the product of those of all blocks."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


def triangular_blocks(filled: NDArray[np.bool_]) -> tuple[Block, ...] | None:
    """The finest block triangular form of a square matrix. Shapes: filled (k, k)."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

    graph = csr_array(filled.astype(np.int8))
    column_of = maximum_bipartite_matching(graph, perm_type="column")
    if (column_of < 0).any():
        return None
    # row r stands for the pair (r, column_of[r]): pairs that reach each other make a block
    reach = csr_array(filled[:, column_of].astype(np.int8))
    count, label = connected_components(reach, directed=True, connection="strong")
    blocks = []
    for k in range(count):
        rows = np.flatnonzero(label == k)
        blocks.append(Block(tuple(map(int, rows)), tuple(sorted(map(int, column_of[rows])))))
    return tuple(sorted(blocks, key=lambda block: block.columns))


def cost(blocks: tuple[Block, ...] | None, filled: NDArray[np.bool_]) -> tuple[int, int]:
    """How much work a determinant is: smaller blocks first, then fewer entries."""
    if blocks is None:
        return (10**6, 0)
    largest = sum(len(block.rows) ** 3 for block in blocks)
    entries = sum(int(filled[np.ix_(block.rows, block.columns)].sum()) for block in blocks)
    return largest, entries
