"""Joints that an arm does not have, put into its chain so that a family of six joints serves it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array, read_only
from .loop import JointChain

NO_COLUMN = -1
"""`JointChain.columns` of a virtual joint."""


class VirtualJoint(NamedTuple):
    """Virtual joint, zero in every posture of the arm."""

    gap: int
    frame: Array
    sigma: int


def with_virtual_joints(
    chain: JointChain, joints: Sequence[VirtualJoint]
) -> tuple[JointChain, NDArray[np.int64]]:
    """Put virtual joints into a chain; with all of them at zero it places the tool as before."""
    columns, sigma, D, places = [], [], [], []
    for gap in range(chain.k + 1):
        if gap > 0:
            places.append(len(sigma))
            columns.append(int(chain.columns[gap - 1]))
            sigma.append(int(chain.sigma[gap - 1]))
        before = np.eye(4)
        for joint in joints:
            if joint.gap == gap:
                D.append(before @ joint.frame)
                before = se3.inverse(joint.frame)
                columns.append(NO_COLUMN)
                sigma.append(joint.sigma)
        D.append(before @ chain.D[gap])
    longer = JointChain(
        columns=read_only(columns, np.int64),
        sigma=read_only(sigma, np.int64),
        D=read_only(np.array(D)),
        base=chain.base,
    )
    return longer, read_only(places, np.int64)
