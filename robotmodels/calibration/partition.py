"""Partition of measurements into folds for cross-validation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..kinematics import dgm
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel
from .measurements import Labelled, Measurement, scale_is_observable, single_observations

_NEAR = 0.2
"""Extent of one place, relative to the size of the robot."""
_FEWEST = 3
"""Smallest number of places for leaving places out."""

Numbers = NDArray[np.int64]
Mask = NDArray[np.bool_]


class Part(NamedTuple):
    """Masks of the validation and the training blocks, shape (B,); a block may be in neither."""

    aside: Mask
    kept: Mask


class Partition(NamedTuple):
    """Folds, number of places left out, whether runs of postures are left out, and a note."""

    parts: tuple[Part, ...]
    places: int
    runs: bool
    note: str

    @property
    def manner(self) -> str:
        """Description for the report."""
        runs = "runs of successive postures, those next to a run left out of the fit as well,"
        whole = f"whole places ({self.places})"
        if self.places and self.runs:
            return f"{whole}; elsewhere {runs}"
        return whole if self.places else runs


def partition_blocks(
    model: RobotModel,
    measurements: Sequence[Measurement],
    folds: int,
    rng: np.random.Generator,
    whole_places: bool = True,
) -> Partition:
    """Part measurements by whole places or by runs of postures, equal readings always together."""
    seen = [m for m in measurements if m.views]
    if not seen:
        return Partition((), 0, False, "")
    posture, thing = _postures(seen), _things(seen)
    fold = np.full(len(posture), -1, dtype=np.int64)
    near = _NEAR * characteristic_length(model)
    place = _places(model, seen, posture, thing, near)
    count = len(np.unique(place[place >= 0]))
    whole, note = np.zeros(len(posture), dtype=np.bool_), ""
    if whole_places and count >= _FEWEST:
        dealt = _dealt_places(measurements, place, folds, rng)
        if (dealt >= 0).any():
            fold, whole = dealt, place >= 0
    elif count and (place >= 0).all():
        note = (
            f"Measured at {count} place{'s'[: count > 1]} only: the errors on data kept aside are "
            "of other postures there, and may be larger at another place. Measure at three or "
            f"more places, over {near:.2g} m apart."
        )
    places, runs = len(np.unique(place[fold >= 0])), False
    of_posture = np.full(int(posture.max()) + 1, -1, dtype=np.int64)
    of_posture[posture[whole]] = fold[whole]
    next_to = np.zeros((folds, len(posture)), dtype=np.bool_)
    for one in np.unique(thing[~whole]):
        blocks = np.flatnonzero((thing == one) & ~whole)
        met, first = np.unique(posture[blocks], return_index=True)
        met = met[np.argsort(first)]
        if len(met) > 1:
            turn = rng.permutation(folds)[np.arange(len(met)) * folds // len(met)]
            of_posture[met] = np.where(of_posture[met] < 0, turn, of_posture[met])
            width = len(met) // (3 * folds)
            for k in range(folds):
                wide = np.convolve(of_posture[met] == k, np.ones(2 * width + 1), "same") > 0.5
                next_to[k, blocks] = np.isin(posture[blocks], met[wide])
            runs = True
    fold[~whole] = of_posture[posture[~whole]]
    used = [k for k in range(folds) if (fold == k).any()]
    parts = tuple(Part(fold == k, (fold != k) & ~next_to[k]) for k in used)
    return Partition(parts, places, runs, note)


def _postures(seen: Sequence[Measurement]) -> Numbers:
    """Posture index of each block; equal readings have the same index."""
    found: dict[bytes, int] = {}
    numbers = []
    for m in seen:
        for rows in zip(*(view.q for view in m.views), strict=True):
            distinct = dict.fromkeys(row.tobytes() for row in rows)
            numbers.append(found.setdefault(b"".join(distinct), len(found)))
    return np.array(numbers, dtype=np.int64)


def _things(seen: Sequence[Measurement]) -> Numbers:
    """Index of the touched or seen object of each block."""
    found: dict[tuple[str, ...], int] = {}
    numbers = []
    for m in seen:
        if isinstance(m, Labelled):
            names = [(m.name, label) for label in m.label]
        else:
            names = [(m.name,) if m.fixtures else ()] * m.blocks
        numbers += [found.setdefault(name, len(found)) for name in names]
    return np.array(numbers, dtype=np.int64)


def _places(
    model: RobotModel, seen: Sequence[Measurement], posture: Numbers, thing: Numbers, near: float
) -> Numbers:
    """Place index of each block, -1 for blocks without a place."""
    place = np.full(len(posture), -1, dtype=np.int64)
    p = np.concatenate([dgm(model, m.views[0].q, m.views[0].frame)[:, :3, 3] for m in seen])
    single = single_observations(seen)
    names = [m.label if isinstance(m, Labelled) else [None] * m.blocks for m in seen]
    labelled = np.array(
        [
            label is not None and f"{m.name}:{label}" not in single
            for m, own in zip(seen, names, strict=True)
            for label in own
        ]
    )
    centres, at = np.zeros((0, 3)), np.full(len(posture), -1, dtype=np.int64)
    for one in np.unique(thing[labelled]):
        blocks = thing == one
        centre = p[blocks].mean(axis=0)
        if np.linalg.norm(p[blocks] - centre, axis=1).max() < near:
            at[blocks] = len(centres)
            centres = np.vstack([centres, centre])
    held = at >= 0
    if not held.any():
        return place
    region = np.ones(1, dtype=np.int64)
    if len(centres) > 1:
        region = fcluster(linkage(centres, "complete"), near, "distance").astype(np.int64)
    # things that are measured in one posture are at one place
    one, other = region[at[held]], posture[held] + len(centres) + 1
    size = int(other.max()) + 1
    links = coo_array((np.ones(len(one)), (one, other)), shape=(size, size))
    place[held] = connected_components(links, directed=False)[1][one]
    return place


def _dealt_places(
    measurements: Sequence[Measurement], place: Numbers, folds: int, rng: np.random.Generator
) -> Numbers:
    """Fold of each block by its place; each fold leaves a known length in its fit."""
    fold = np.full(len(place), -1, dtype=np.int64)
    length = scale_is_observable(measurements)
    for one in rng.permutation(np.unique(place[place >= 0])):
        sizes = np.bincount(fold[fold >= 0], minlength=folds)
        for k in np.argsort(sizes, kind="stable"):
            tried = np.where(place == one, k, fold)
            left = parted(measurements, tried != k)
            if left and (not length or scale_is_observable(m for _, m in left)):
                fold = tried
                break
    return fold


def parted(measurements: Sequence[Measurement], kept: Mask) -> list[tuple[int, Measurement]]:
    """Measurements restricted to some blocks, with their indices."""
    parts: list[tuple[int, Measurement]] = []
    first = 0
    for k, m in enumerate(measurements):
        if m.views:
            part = np.flatnonzero(kept[first : first + m.blocks])
            first += m.blocks
            if len(part):
                parts.append((k, m if len(part) == m.blocks else m.subset(part)))
        else:
            parts.append((k, m))
    touched = {f.name for _, m in parts if m.views for f in m.fixtures}
    return [(k, m) for k, m in parts if m.views or touched.issuperset(f.name for f in m.fixtures)]
