"""Natural sizes of drive and friction parameters, also where the prior has none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...drive import DriveKind
from ...minimal_parameters import BaseParameters
from ...minimal_parameters.coupled_drives import drive_sizes

_LEAST = 1e-3
"""Part of the torques below which what a kind of parameters explains does not give it a size."""

_NOTHING = 1e-2
"""Part of the data's size that a kind of the prior has at least, else it counts as absent."""


def sizes_of_drives(base: BaseParameters, prior: Array, R: Array, y: Array) -> Array:
    """Natural sizes of drive and friction parameters: the prior's, else those of the data.

    Shapes: prior (p,), R (r, b), y (r,) -> (p - 10 f,).
    """
    first = 10 * base.model.f
    sizes = drive_sizes(base, prior)
    lengths = np.linalg.norm(R, axis=0)
    seen = np.where(lengths > 0.0, lengths, 1.0)
    values = np.linalg.lstsq(R / seen, y, rcond=1e-10)[0] / seen
    # what would explain all torques by itself
    whole = np.linalg.norm(y) / seen
    coupling = {kind.coupling: kind.value for kind in DriveKind if kind.coupling is not None}
    kinds = [name.rstrip("0123456789") for name in base.parameter_names]
    kinds = np.array([coupling.get(name, name) for name in kinds])
    of_base = kinds[base.kept]
    for kind in set(kinds[first:].tolist()):
        own = kinds[first:] == kind
        shown = (of_base == kind) & (lengths > 0.0)
        if shown.any():
            size = np.median(np.abs(values[shown]))
            size = max(float(size), _LEAST * float(np.median(whole[shown])))
        else:  # of no effect, or seen with the bodies: as great as what it is seen with
            size = _beside_bodies(base, first + np.flatnonzero(own), np.abs(values))
        # a prior that is nothing beside the data would make its columns look unseen
        if size > 0.0 and np.abs(prior[first:][own]).max() < _NOTHING * size:
            sizes[own] = size
    return sizes


def _beside_bodies(base: BaseParameters, numbers: NDArray[np.int64], values: Array) -> float:
    """Size of parameters that are regrouped with others: that of the sums that they are in."""
    M = np.abs(base.matrix[:, numbers])
    rows, columns = np.nonzero(M)
    return float(np.median(values[rows] / M[rows, columns])) if len(rows) else 0.0
