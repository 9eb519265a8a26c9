"""Alignment of nearly parallel or perpendicular axes."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce
from math import ceil, copysign, log10

import numpy as np

from .. import se3
from .._arrays import Array
from ..geometry import FIXED, REVOLUTE
from ..model import RobotModel

ALIGNED = 1e-5
"""Default alignment tolerance, rad; a right angle written as 1.5708 has an error of 3.7e-6."""
_ROUNDING, _NEAR, _GREATEST = 1e-13, 1e-4, 1e-2
"""Angles, rad: rounding, largest angle of a noted pair, and largest tolerance."""
_LISTED, _STEPS = 4, 6
"""Pairs listed in a note, and Newton steps."""
_RANK = 1e-3
"""Rank tolerance of the derivatives of an axis: relative singular value."""


def aligned_robot(model: RobotModel, angle: float) -> tuple[RobotModel, tuple[str, ...]]:
    """Align axes that are nearly parallel or perpendicular by the least rotation; notes on them."""
    chain, table = model.chain, model.table
    rows = np.stack((table.gamma, table.beta, table.alpha, table.theta))
    pairs = _Pairs(angle)
    gravity = np.asarray(model.gravity) @ chain.base_rotation
    weight = float(np.linalg.norm(gravity))
    # of each frame, the directions that do not turn relative to it, in its axes
    still: list[dict[str, Array]] = [{"gravity": gravity / weight} if weight > 0 else {}]
    for k in range(model.f):
        sigma, row, R = int(chain.sigma[k]), rows[:, k], chain.rotation[k]
        around = still[int(chain.antecedent[k])]
        name = f"axis {k + 1}" if sigma != FIXED else f"z of frame {k + 1}"
        known = len(pairs.taken)
        if (z := pairs.aligned(name, R[:, 2], around)) is not None:
            if not _turn_axis(row, z):  # beta and alpha both near a right angle: no small rotation
                pairs.apart += pairs.taken[known:]
                del pairs.taken[known:]
            R = _rotation(*row)
        if sigma == REVOLUTE:
            still.append({name: np.array([0.0, 0.0, 1.0])})
            continue
        for i, letter in enumerate("xy"):  # they decide which first moments are kept
            others = {**around, name: R[:, 2]}
            if (x := pairs.aligned(f"{letter} of frame {k + 1}", R[:, i], others)) is not None:
                cosine, sine = x @ _rotation(row[0], row[1], row[2], 0.5 * np.pi * i)[:, :2]
                row[3] = np.arctan2(sine, cosine)
                R = _rotation(*row)
        if sigma != FIXED:
            around = {**around, name: R[:, 2]}
        still.append({other: e @ R for other, e in around.items()})
    if pairs.taken:
        columns = dict(zip(("gamma", "beta", "alpha", "theta"), rows, strict=True))
        model = model.with_table(table.replace(**columns))
    return model, pairs.notes


@dataclass
class _Pairs:
    """Pairs of nearly aligned directions, with their angular errors."""

    angle: float
    taken: list[tuple[float, str]] = field(default_factory=list)
    apart: list[tuple[float, str]] = field(default_factory=list)

    def aligned(self, name: str, u: Array, others: dict[str, Array]) -> Array | None:
        """Nearest unit vector aligned with the others; None if unchanged."""
        turned = False
        near: dict[str, list[Array]] = {"parallel": [], "perpendicular": []}
        for other, e in others.items():
            cosine, sine = float(u @ e), float(np.linalg.norm(np.cross(u, e)))
            for word, off in (("parallel", sine), ("perpendicular", abs(cosine))):
                pair = off, f"{name} and {other} {word} but for {off:.1e} rad"
                if off <= self.angle:
                    near[word].append(copysign(1.0, cosine) * e)
                    if off > _ROUNDING:
                        self.taken.append(pair)
                        turned = True
                elif off < _NEAR:
                    self.apart.append(pair)
        if not turned:
            return None
        if near["parallel"]:
            return near["parallel"][0]
        across = near["perpendicular"]
        u = u - np.linalg.pinv(across, rcond=_RANK) @ (across @ u)
        return u / np.linalg.norm(u)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences about the pairs treated as aligned, and the other nearly aligned ones."""
        out = []
        if self.taken:
            out.append(f"Treated as aligned: {_listed(self.taken)}.")
        if self.apart:
            greatest = max(off for off, _ in self.apart)
            enough = min(10.0 ** (ceil(log10(greatest)) + 1), _GREATEST)
            out.append(
                f"Not treated as aligned: {_listed(self.apart)}; tolerance={enough:.0e} would "
                "align them."
            )
        return tuple(out)


def _turn_axis(row: Array, z: Array) -> bool:
    """Smallest change of gamma, beta and alpha of a row such that its axis is z."""
    given = row.copy()
    for _ in range(_STEPS):
        gamma, beta, alpha, _ = row
        about_z, both = se3.rotation("z", gamma)[:3, :3], _rotation(gamma, beta, alpha)
        axes = np.stack(([0.0, 0.0, 1.0], about_z[:, 1], both[:, 0]))
        slopes = np.cross(axes, both[:, 2]).T
        row[:3] += np.linalg.lstsq(slopes, z - both[:, 2], rcond=_RANK)[0]
    aligned = np.linalg.norm(z - _rotation(*row)[:, 2]) < _ROUNDING
    if not aligned:
        row[:] = given
    return bool(aligned)


def _rotation(gamma: float, beta: float, alpha: float, theta: float = 0.0) -> Array:
    """Rotation of a row of the table."""
    turns = zip("zyxz", (gamma, beta, alpha, theta), strict=True)
    return reduce(np.matmul, [se3.rotation(axis, float(angle))[:3, :3] for axis, angle in turns])


def _listed(pairs: list[tuple[float, str]]) -> str:
    pairs = sorted(pairs, key=lambda item: -item[0])
    words = "; ".join(sentence for _, sentence in pairs[:_LISTED])
    more = len(pairs) - _LISTED
    return words + (f"; and {more} more" if more > 0 else "")
