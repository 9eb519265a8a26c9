"""Which axes are parallel, perpendicular or along gravity only nearly, in words."""

from __future__ import annotations

from math import ceil, log10

import numpy as np

from .._arrays import Array
from ..geometry import FIXED
from ..model import RobotModel

_ROUNDING, _NEAR = 1e-13, 1e-4
_GREATEST = 1e-2  # of a tolerance
_LONGEST_LIST = 4


def near_alignments(model: RobotModel, tolerance: float) -> tuple[str, ...]:
    """Sentences about axes that a file with few digits has nearly parallel or perpendicular.

    Parameters
    ----------
    model : RobotModel
        The robot.
    tolerance : float
        Sine of an angle that counts as none.

    Returns
    -------
    tuple of str
        One about those that were taken as exact, one about those that were not; none if all axes
        are aligned to rounding or clearly not.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> near_alignments(load("rx90"), 1e-11)
    ()
    """
    taken: list[tuple[float, str]] = []
    apart: list[tuple[float, str]] = []
    for name, a, b in _pairs(model):
        across = float(np.linalg.norm(np.cross(a, b)))
        for word, off in (("parallel", across), ("perpendicular", abs(float(a @ b)))):
            if _ROUNDING < off < _NEAR:
                said = f"{name} {word} but for {off:.1e} rad"
                (taken if off <= tolerance else apart).append((off, said))
    out = []
    if taken:
        out.append(f"Taken as exact: {_listed(taken)}.")
    if apart:
        greatest = max(off for off, _ in apart)
        enough = min(10.0 ** (ceil(log10(greatest)) + 1), _GREATEST)
        out.append(
            f"Not exact: {_listed(apart)}. What they show beyond {tolerance:.0e} of the largest "
            f"torque is kept; tolerance={enough:.0e} takes them as exact."
        )
    return tuple(out)


def _listed(found: list[tuple[float, str]]) -> str:
    found = sorted(found, key=lambda item: -item[0])
    words = "; ".join(said for _, said in found[:_LONGEST_LIST])
    more = len(found) - _LONGEST_LIST
    return words + (f"; and {more} more" if more > 0 else "")


def _pairs(model: RobotModel) -> list[tuple[str, Array, Array]]:
    """Each axis and the one before it, and gravity with what moves on the base."""
    chain = model.chain
    gravity = np.asarray(model.gravity) @ chain.base_rotation
    weight = float(np.linalg.norm(gravity))
    pairs: list[tuple[str, Array, Array]] = []
    # of each frame, the last moving frame up to it and the turn from that to this
    last: list[tuple[int, Array]] = [(0, np.eye(3))]
    for j in range(1, model.f + 1):
        before, turn = last[int(chain.antecedent[j - 1])]
        R = turn @ chain.rotation[j - 1]
        if chain.sigma[j - 1] == FIXED:
            last.append((before, R))
            continue
        if before:
            pairs.append((f"axes {before} and {j}", np.array([0.0, 0.0, 1.0]), R[:, 2]))
        elif weight > 0:
            pairs.append((f"axis {j} and gravity", gravity / weight, R[:, 2]))
        last.append((j, np.eye(3)))
    return pairs
