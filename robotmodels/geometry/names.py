"""Names of frames: each its own, and none that a URDF could not hold."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import ShapeError, TableError
from .joint_kinds import FIXED

NOT_XML = re.compile("[\x00-\x1f\ud800-\udfff\ufffe\uffff]")
"""Characters that an XML attribute cannot hold or does not keep: names must do without them."""


def default_names(sigma: NDArray[np.int64]) -> tuple[str, ...]:
    """``joint_j``, or ``frame_j`` where nothing moves."""
    return tuple(f"{'frame' if s == FIXED else 'joint'}_{j}" for j, s in enumerate(sigma, start=1))


def checked_names(names: Sequence[str], f: int) -> tuple[str, ...]:
    """The names of f frames, or the error that says what is wrong with them."""
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise TableError(f"names: expected a list of names, one for each row, got {names!r:.80}.")
    labels = tuple(map(str, names))
    if len(labels) != f:
        raise ShapeError(f"names: expected one name for each of the {f} rows, got {len(labels)}.")
    repeated = sorted({name for name in labels if labels.count(name) > 1})
    if repeated or not all(labels):
        raise TableError(
            f"names: each frame needs a name of its own, got {', '.join(map(repr, repeated))} "
            "more than once."
            if repeated
            else "names: a frame has an empty name."
        )
    for name in labels:
        if NOT_XML.search(name):
            raise TableError(f"names: {name!r} holds a control character; a URDF cannot hold it.")
    return labels
