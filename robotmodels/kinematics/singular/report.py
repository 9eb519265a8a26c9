"""What a configuration has lost and gained beside a regular one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt
from ...table_text import length_text
from ..singularity_kind import SingularityKind
from .boundary import WorkspaceSide
from .flags import SingularityStatus
from .frames import LostDirections
from .motion import SelfMotion
from .task import counting_lines

SMALL = 0.02
"""Parts of a weak direction below this are left out of its words."""


@dataclass(frozen=True, slots=True, eq=False)
class SingularityReport(Rebuilt):
    """One configuration: what it has lost, what it has gained. Read-only; `print` it.

    Parameters
    ----------
    status : SingularityStatus
        Regular, near singular or singular.
    q : ndarray, shape (n,)
        The configuration, rad or m.
    dimension, rank, order : int
        M, local rank r, and M - r.
    singular_values : ndarray, shape (k,)
        Descending, no unit.
    weakest : float
        The M-th of them over the first: the measure of the distance to a singularity.
    gap : float
        Smallest singular value that counts over the largest that does not.
    kinds : tuple of SingularityKind
        Shoulder, elbow, wrist or other.
    words : tuple of str
        The same as sentences.
    near_kinds, near_words : tuples of SingularityKind and str
        Of the singular sets nearby that make the freedoms weak which are not lost.
    weak : LostDirections
        Combinations that are weak but not lost, where they have the most small parts: those of
        singular values between ``tolerance`` and ``near``.
    side : WorkspaceSide
        Boundary or interior, of what the robot reaches near this configuration.
    lost : LostDirections
        Combinations that cannot be produced, where they have the most zeros.
    lost_in_world : LostDirections
        The same in the axes of the task (world axes unless the mask's are the tool's) at the
        frame's origin.
    open_twist : ndarray, shape (6,), or None
        At a boundary: the lost direction towards the side that is open, ``[v; w]`` in the axes of
        ``lost_in_world``, unit length when metres are divided by ``length``.
    self_motions : tuple of SelfMotion
        Joint motions that leave the frame still.
    gained : int
        How many more of them than at regular configurations.
    mask : ndarray of bool, shape (6,)
        Components that count.
    length, tolerance : float
        Characteristic length in metres, and what counts as zero.

    Examples
    --------
    >>> from robotmodels import classify_singularity, load
    >>> report = classify_singularity(load("rx90"), [0.1, 0.2, -np.pi / 2, 0.4, 0.5, 0.6])
    >>> report.kinds[0].name, report.side.name, report.lost.combinations
    ('ELBOW', 'BOUNDARY', ('vz',))
    """

    status: SingularityStatus
    q: Array
    dimension: int
    rank: int
    order: int
    singular_values: Array
    weakest: float
    gap: float
    kinds: tuple[SingularityKind, ...]
    words: tuple[str, ...]
    near_kinds: tuple[SingularityKind, ...]
    near_words: tuple[str, ...]
    weak: LostDirections
    side: WorkspaceSide
    lost: LostDirections
    lost_in_world: LostDirections
    open_twist: Array | None
    self_motions: tuple[SelfMotion, ...]
    gained: int
    mask: NDArray[np.bool_]
    length: float
    tolerance: float

    def __str__(self) -> str:
        """Describe it in sentences."""
        lines = [
            self.status.sentence,
            *counting_lines(self.mask, self.lost.frame),
            f"Rank {self.rank} of {self.dimension}, weakest singular value "
            f"{self.weakest:.3g} of the largest (length {length_text(self.length)} m)",
            *self.words,
            *(f"near {text}" for text in self.near_words),
        ]
        if len(self.weak.wrenches):
            lines.append(f"Hardly produced, {self.weak.where} (parts below {SMALL:g} left out):")
            lines += [f"  {text}" for text in self.weak.rounded(SMALL)]
        if self.lost.combinations:
            lines.append(f"Cannot be produced, {self.lost.where}:")
            lines += [f"  {text} = 0 whatever the joints do" for text in self.lost.combinations]
            lines += [f"  carried without torque: {text}" for text in self.lost.carried]
            lines.append(self.side.sentence)
        for motion in self.self_motions:
            names = ", ".join(map(str, motion.joints))
            rates = ", ".join(length_text(float(x)) for x in motion.velocity)
            lines.append(f"Self-motion of joints {names}: ({rates}). {motion.kind.sentence}")
        if self.self_motions:
            lines.append(f"Self-motions gained beside a regular configuration: {self.gained}")
        return "\n".join(lines)
