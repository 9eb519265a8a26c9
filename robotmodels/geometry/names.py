"""Names of frames: each its own, and none that a URDF could not hold."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import ShapeError, TableError
from .joint_kinds import FIXED

NOT_XML = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""Characters that XML does not keep, and control characters that a terminal obeys."""


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
    repeated = sorted(name for name, count in Counter(labels).items() if count > 1)
    if repeated:
        listed = ", ".join(f"{name!r:.80}" for name in repeated[:5])
        raise TableError(f"names: each frame needs a name of its own, got {listed} more than once.")
    if not all(labels):
        raise TableError("names: a frame has an empty name.")
    for name in labels:
        if NOT_XML.search(name):
            raise TableError(
                f"names: {name!r:.80} holds a control character; a URDF cannot hold it."
            )
    return labels
