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
    """A joint that stands at zero in every posture of the arm itself.

    Parameters
    ----------
    gap : int
        0 before the first joint of the chain, g behind its g-th.
    frame : ndarray, shape (4, 4)
        Frame of the joint, its axis along z, in that of the joint before (R_0 for gap 0).
    sigma : int
        0 revolute, 1 prismatic.
    """

    gap: int
    frame: Array
    sigma: int


def with_virtual_joints(
    chain: JointChain, joints: Sequence[VirtualJoint]
) -> tuple[JointChain, NDArray[np.int64]]:
    """Put virtual joints into a chain; with all of them at zero it places the tool as before.

    Parameters
    ----------
    chain : JointChain
        The arm.
    joints : sequence of VirtualJoint
        In each gap in the order from base to tool.

    Returns
    -------
    longer : JointChain
        The chain with them; their ``columns`` are `NO_COLUMN`.
    places : ndarray of int, shape (chain.k,)
        Where the joints of the chain stand in it.

    Examples
    --------
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.robots import load
    >>> slide = VirtualJoint(gap=1, frame=np.eye(4), sigma=1)
    >>> longer, places = with_virtual_joints(joint_chain(load("lab_trr")), [slide])
    >>> longer.sigma, places
    (array([1, 1, 0, 0]), array([0, 2, 3]))
    """
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
