"""Redundant arms with linear relations between their joints: ``A q = b``.

The second of the two ways to make a redundant arm definite; the first, to lock joints, is the case
of relations with one joint each. Other relations are solved by Newton's method on pose and
relations together, from many starts: solutions may be missing.

Source: Section 1.2.3 of the book, redundant robots: additional relations.
"""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError, ShapeError
from .constraints import WHOLE, Constraints
from .loop import JointChain
from .motion import lever
from .redundant import prepare_redundant
from .search import prepare_many_starts
from .solver import Prepare, Solver


def prepare_related(chain: JointChain, A: Array, b: Array, prepare: Prepare) -> Solver | None:
    """Prepare a redundant arm for as many relations as it has joints more than six."""
    m = chain.k - 6
    if A.shape != (m, chain.k):
        raise ShapeError(
            f"relations: an arm of {chain.k} joints takes {m} relation{'s' * (m > 1)}, A of shape "
            f"{(m, chain.k)} and b of {(m,)}; got {A.shape} and {b.shape}."
        )
    if np.linalg.matrix_rank(A) < m:
        raise InvalidValueError(
            "relations: rows of A are dependent, so they are fewer relations than rows."
        )
    single = np.flatnonzero(np.count_nonzero(A, axis=1) == 1)
    if single.size:
        # a row with one joint is a lock; the other rows are relations of the shorter chain
        row = int(single[0])
        joint = int(A[row].nonzero()[0][0])
        value = float(b[row] / A[row, joint])
        rest = np.delete(A, row, axis=0)
        right = np.delete(b, row) - rest[:, joint] * value
        rest = np.delete(rest, joint, axis=1)

        def inner(shorter: JointChain) -> Solver | None:
            if len(rest) == 0:
                return prepare(shorter)
            return prepare_related(shorter, rest, right, prepare)

        return prepare_redundant(chain, WHOLE, joint, inner, value)
    return prepare_many_starts(Constraints(chain, WHOLE, A, b, lever(chain)))
