"""Independent columns of a tree's regressor, one path from the base to a tip at a time.

A parameter of a frame acts on the joints between the base and that frame alone. So the columns of
one path have rows of their own, and what depends on others there depends on them in the whole.
Whether what is kept on the paths is independent also across them is looked at from the tips to the
base, with the combinations that no joint so far shows: there are never many.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..estimation import ColumnBasis, column_basis
from ..model import RobotModel


def columns_by_branches(
    model: RobotModel, factors: Sequence[Array], scale: Array, kinds: NDArray[np.int64],
    nothing: float,
) -> ColumnBasis | None:  # fmt: skip
    """Column basis of the regressor of a tree from those of its paths.

    Shapes: factors (r, p); scale, kinds (p,).
    """
    f, n, p = model.f, model.n, len(scale)
    antecedent, joint = model.chain.antecedent, model.chain.joint
    length = np.sqrt(sum((R * R).sum(axis=0) for R in factors)) * scale
    longest = float(length.max(initial=0.0)) or 1.0
    tips = sorted(set(range(1, f + 1)) - set(antecedent.tolist()))
    found = np.full(p, -1)
    coefficients = np.zeros((p, p))
    distance = np.zeros(p)
    most = _longest_of(length, kinds, nothing * longest)
    for tip in tips:
        path = np.array(model.table.path(tip)) - 1
        joints = joint[path[joint[path] >= 0]]
        columns = _columns_of(path, joints, f, n, p)
        if not joints.size:
            found[columns] = 0
            continue
        W = np.vstack([factors[i][:, columns] for i in joints])
        basis = column_basis(W, None, scale[columns], nothing, None, longest)
        kept = np.zeros(len(columns), dtype=np.int64)
        kept[basis.kept] = 1
        before = found[columns]
        if (before[before >= 0] != kept[before >= 0]).any():
            return None
        new = columns[before < 0]
        found[columns] = kept
        coefficients[np.ix_(columns[basis.kept], new)] = basis.coefficients[:, before < 0]
        # the path's distances are relative to its longest column
        own = basis.distance * (_longest(W * scale[columns]) or 1.0)
        distance[new] = own[before < 0] / most[kinds[new]]
    numbers = np.flatnonzero(found == 1)
    if _depend(model, factors, scale / longest, numbers, nothing):
        return None
    empty = np.flatnonzero(length <= nothing * longest)
    return ColumnBasis(numbers, empty, coefficients[numbers], distance)


def _columns_of(
    path: NDArray[np.int64], joints: NDArray[np.int64], f: int, n: int, p: int
) -> NDArray[np.int64]:
    """Columns of the links of a path, and of its joints."""
    links = (10 * path[:, None] + np.arange(10)).ravel()
    rest = (np.arange(10 * f, p, n)[:, None] + joints).ravel()
    return np.concatenate((np.sort(links), np.sort(rest)))


def _depend(
    model: RobotModel, factors: Sequence[Array], scale: Array, kept: NDArray[np.int64],
    nothing: float,
) -> bool:  # fmt: skip
    """Whether a combination of the kept columns is shown by no joint."""
    f, n = model.f, model.n
    # of each frame, which kept columns its tree has, and their combinations that no joint shows
    columns: list[NDArray[np.int64]] = [np.empty(0, dtype=np.int64) for _ in range(f + 1)]
    unseen: list[Array] = [np.zeros((0, 0)) for _ in range(f + 1)]
    for j in range(f, 0, -1):
        joint = int(model.chain.joint[j - 1])
        is_own = kept // 10 == j - 1
        is_own &= kept < 10 * f
        if joint >= 0:
            is_own |= (kept >= 10 * f) & ((kept - 10 * f) % n == joint)
        own = kept[is_own]
        columns[j], unseen[j] = _joined(columns[j], unseen[j], own, np.eye(len(own)))
        if joint >= 0 and unseen[j].shape[1]:
            shown = (factors[joint][:, columns[j]] * scale[columns[j]]) @ unseen[j]
            _, s, Vt = np.linalg.svd(shown, full_matrices=True)
            unseen[j] = unseen[j] @ Vt[int((s > nothing).sum()) :].T
        a = int(model.chain.antecedent[j - 1])
        columns[a], unseen[a] = _joined(columns[a], unseen[a], columns[j], unseen[j])
    return unseen[0].shape[1] > 0


def _joined(
    a: NDArray[np.int64], A: Array, b: NDArray[np.int64], B: Array
) -> tuple[NDArray[np.int64], Array]:
    Z = np.zeros((len(a) + len(b), A.shape[1] + B.shape[1]))
    Z[: len(a), : A.shape[1]], Z[len(a) :, A.shape[1] :] = A, B
    return np.concatenate((a, b)), Z


def _longest(W: Array) -> float:
    return float(np.sqrt((W * W).sum(axis=0)).max(initial=0.0))


def _longest_of(length: Array, kinds: NDArray[np.int64], nothing: float) -> Array:
    """Of each kind, its longest column; the longest of all where a kind has no effect."""
    most = np.zeros(kinds.max(initial=-1) + 1)
    np.maximum.at(most, kinds, length)
    return np.where(most > nothing, most, length.max(initial=0.0) or 1.0)
