"""Connected cells of grids over joints, some of which close in themselves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .arms import wrapped

_SPECKS = 1e-4  # of all cells: components without a core that belong to another


class Group(NamedTuple):
    """A grid over some joints (columns of q): lower ends, sides, which close, labels from 1."""

    joints: tuple[int, ...]
    low: Array
    side: Array
    closed: tuple[bool, ...]
    factors: tuple[int, ...]
    labels: NDArray[np.int32]
    codes: NDArray[np.int64]
    volumes: Array
    separates: bool


def core_cells(value: Array, closed: tuple[bool, ...]) -> NDArray[np.bool_]:
    """Cells in which a factor cannot vanish, judged by its differences to the next cells."""
    change = np.zeros_like(value)
    for axis in range(value.ndim):
        step = np.abs(np.diff(value, axis=axis, append=np.take(value, [0], axis=axis)))
        if not closed[axis]:
            last = [slice(None)] * value.ndim
            last[axis] = slice(-1, None)
            step[tuple(last)] = 0.0
        change += np.maximum(step, np.roll(step, 1, axis=axis))
    return np.abs(value) > change


def connected(
    code: NDArray[np.int64], certain: NDArray[np.bool_], closed: tuple[bool, ...]
) -> tuple[NDArray[np.int32], bool]:
    """Labels, from 1, of connected cells with equal codes; whether the grid separates them all."""
    from scipy import ndimage

    labels = np.zeros(code.shape, np.int32)
    separates, specks = True, _SPECKS * code.size
    for value in np.unique(code[code >= 0]):
        same = code == value
        whole, count = _torus_labels(same, closed)
        cores, _ = _torus_labels(same & certain, closed)
        sizes = np.bincount(whole.ravel(), minlength=count + 1)
        pairs = np.unique(np.stack((whole[cores > 0], cores[cores > 0])), axis=1)
        per_part = np.bincount(pairs[0], minlength=count + 1)
        kept = (per_part > 0) | (sizes > specks)
        kept[0] = False
        if not kept.any():
            kept[1:] = sizes[1:] == sizes[1:].max()
        separates &= bool((per_part[kept] == 1).all())
        number = np.where(kept, np.cumsum(kept), 0)
        own = number[whole]
        lost = same & (own == 0)
        if lost.any():
            # the cut-off tips of a part belong to it
            near = ndimage.distance_transform_edt(own == 0, False, True)
            own[lost] = own[tuple(axis[lost] for axis in near)]
        labels[same] = own[same] + labels.max()
    return labels, separates


def _torus_labels(
    flags: NDArray[np.bool_], closed: tuple[bool, ...]
) -> tuple[NDArray[np.int64], int]:
    """Labels of connected cells, the ends of closed axes joined."""
    from scipy import ndimage, sparse

    labels, count = ndimage.label(flags)
    pairs = [np.zeros((2, 0), np.int64)]
    for axis, joined in enumerate(closed):
        if joined:
            ends = np.stack((np.take(labels, 0, axis).ravel(), np.take(labels, -1, axis).ravel()))
            pairs.append(ends[:, (ends > 0).all(axis=0)])
    a, b = np.unique(np.concatenate(pairs, axis=1), axis=1)
    graph = sparse.coo_matrix((np.ones(a.size), (a, b)), (count + 1, count + 1))
    total, parts = sparse.csgraph.connected_components(graph, directed=False)
    # the background keeps zero
    parts = np.where(parts == parts[0], 0, parts + (parts < parts[0]))
    return parts[labels], int(total) - 1


def labels_of(group: Group, q: Array, values: Array | None) -> NDArray[np.int64]:
    """Label of the part of a group for configurations (N, n); 0 where there is none."""
    cells = np.array(group.labels.shape)
    x = q[:, list(group.joints)]
    closed = np.array(group.closed)
    x = wrapped(x, closed)
    at = np.clip(np.floor((x - group.low) / group.side).astype(int), 0, cells - 1)
    labels = group.labels[tuple(at.T)].astype(np.int64)
    if values is None or not group.factors:
        return labels
    members = list(group.factors)
    wanted = (values[:, members] > 0.0) @ (1 << np.array(members))
    codes = np.append(-1, group.codes)
    # beside a singular position the cell may be of another aspect: look around
    for reach in (1, 2):
        wrong = np.flatnonzero(codes[labels] != wanted)
        for step in np.ndindex(*(2 * reach + 1,) * len(cells)) if wrong.size else ():
            to = at[wrong] + np.array(step) - reach
            good = np.all(closed | ((to >= 0) & (to < cells)), axis=1)
            other = group.labels[tuple((to % cells).T)]
            good &= codes[other] == wanted[wrong]
            labels[wrong[good]] = other[good]
            wrong = wrong[~good]
    return np.where(codes[labels] == wanted, labels, 0)
