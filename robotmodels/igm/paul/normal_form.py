"""The arm as Paul's method reads it: one row of four constants between successive joints.

``Z M_1 K_2 M_2 ... K_k M_k E = pose`` with ``K_j = Rot(x, alpha_j) Trans(x, d_j) Trans(z, r_j)``
(``Rot(z, theta_j)`` instead of the last for a prismatic joint), whatever frames the table had:
frames slide along and turn about their axes to where neighbouring axes come closest, which a
joint variable takes up as an offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...se3 import inverse
from ..loop import JointChain
from ..structure import ANGLE_TOLERANCE, LENGTH_TOLERANCE


@dataclass(frozen=True, slots=True)
class Row:
    """Constants of one joint, rad and m; ``theta`` of a prismatic joint, ``r`` of a revolute one.

    The variable of the row is the joint's plus ``offset``.
    """

    frame: int
    sigma: int
    alpha: float
    d: float
    theta: float
    r: float
    offset: float


@dataclass(frozen=True, slots=True, eq=False)
class NormalForm:
    """Rows of a chain in normal form.

    Shapes: before, after, tool (4, 4); lever (3,); exact (k, 4, 4).
    """

    rows: tuple[Row, ...]
    before: Array
    after: Array
    tool: Array
    lever: Array
    exact: Array

    @property
    def k(self) -> int:
        """Number of joints."""
        return len(self.rows)

    @property
    def sigma(self) -> NDArray[np.int64]:
        """Joint types."""
        return np.array([row.sigma for row in self.rows], dtype=np.int64)


def normal_form(chain: JointChain, frames: Sequence[int]) -> NormalForm:
    """Rows of a chain; ``frames`` are the numbers of its frames in the table.

    Axes that are parallel, perpendicular or meet to 1e-9 rad or m count as such.
    """
    k = chain.k
    parts = [_common_normal(D) for D in chain.D[:k]]
    offsets, lengths, turns = np.zeros(k), np.zeros(k), np.zeros(k)
    for j, (gamma, b, _, _, theta, r) in enumerate(parts):
        slides = bool(chain.sigma[j])
        offsets[j] += r if slides else theta
        lengths[j] += 0.0 if slides else r
        turns[j] += theta if slides else 0.0
        if j and chain.sigma[j - 1]:
            offsets[j - 1] += b
            turns[j - 1] += gamma
        elif j:
            offsets[j - 1] += gamma
            lengths[j - 1] += b
    exact = np.empty((k, 4, 4))
    for j, (gamma, b, _, _, theta, r) in enumerate(parts):
        crossing = inverse(_screw(gamma, b)) @ chain.D[j] @ inverse(_screw(theta, r))
        exact[j] = crossing @ _screw(turns[j], lengths[j])
    start, tool = _screw(*parts[0][:2]), chain.D[k]
    whole = k >= 6
    if whole:
        # the first constant goes to the pose, and what the last joint carries along its axis
        start = start @ exact[0]
        tool = _screw(turns[-1], lengths[-1]) @ tool
        exact[-1] = exact[-1] @ inverse(_screw(turns[-1], lengths[-1]))
        exact[0] = np.eye(4)
        parts[0] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        turns[0] = lengths[0] = turns[-1] = lengths[-1] = 0.0
    rows = tuple(
        Row(
            frames[j], int(chain.sigma[j]), _square(parts[j][2]), _no_dust(parts[j][3]),
            _square(turns[j]), _no_dust(lengths[j]), float(offsets[j]),
        )
        for j in range(k)
    )  # fmt: skip
    return NormalForm(
        rows=rows,
        before=inverse(start),
        after=inverse(tool) if whole else np.eye(4),
        tool=np.eye(4) if whole else tool,
        lever=tool[:3, 3].copy() if whole else np.zeros(3),
        exact=exact,
    )


def _common_normal(D: Array) -> tuple[float, float, float, float, float, float]:
    """``D = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)``.

    gamma in (-pi/2, pi/2], so that rows that have no gamma keep all their signs.
    """
    z, p = D[:3, 2], D[:3, 3]
    across = hypot(z[0], z[1])
    if across > ANGLE_TOLERANCE:
        gamma = atan2(z[0], -z[1])
    elif hypot(p[0], p[1]) > LENGTH_TOLERANCE:
        gamma = atan2(p[1], p[0])
    else:
        gamma = 0.0
    if gamma > pi / 2 + 1e-12:
        gamma -= pi
    elif gamma <= -pi / 2 + 1e-12:
        gamma += pi
    rest = inverse(_screw(gamma, 0.0)) @ D
    z, p = rest[:3, 2], rest[:3, 3]
    alpha = atan2(-z[1], z[2])
    if across > ANGLE_TOLERANCE:
        # p = (d, -r sin(alpha), b + r cos(alpha))
        r = -p[1] / sin(alpha)
        b = p[2] - r * cos(alpha)
    else:
        alpha = 0.0 if z[2] > 0.0 else pi
        b, r = 0.0, p[2] * cos(alpha)
    if abs(alpha + pi) < ANGLE_TOLERANCE:
        alpha = pi
    # the x axis behind Rot(x, alpha)
    x = rest[:3, 0]
    theta = atan2(cos(alpha) * x[1] + sin(alpha) * x[2], x[0])
    return gamma, float(b), alpha, float(p[0]), theta, float(r)


def _screw(angle: float, length: float) -> Array:
    """``Rot(z, angle) Trans(z, length)``."""
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, length], [0, 0, 0, 1.0]])


def _no_dust(length: float) -> float:
    return 0.0 if abs(length) <= LENGTH_TOLERANCE else float(length)


def _square(angle: float) -> float:
    """The angle in (-pi, pi], a multiple of a right angle if it is within tolerance of one."""
    quarters = round(angle / (pi / 2))
    if abs(angle - quarters * pi / 2) <= ANGLE_TOLERANCE:
        return ((quarters + 1) % 4 - 1) * pi / 2
    return pi - (pi - angle) % (2 * pi)
