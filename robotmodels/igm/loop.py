"""The chain from base to tool as the inverse models see it: constants between joint motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, read_only
from ..geometry import constant_factors
from ..model import RobotModel


@dataclass(frozen=True, slots=True, eq=False)
class JointChain:
    """The k moving joints between base and tool, and what is constant between them.

    ``D_0 M_1(q_1) D_1 M_2(q_2) ... M_k(q_k) D_k = Z^-1 T`` with ``M`` a rotation about or a
    translation along z; fixed frames are multiplied into the ``D``.

    Parameters
    ----------
    columns : ndarray of int, shape (k,)
        Column of each joint in the model's q.
    sigma : ndarray of int, shape (k,)
        0 revolute, 1 prismatic.
    D : ndarray, shape (k + 1, 4, 4)
        The constants, the tool in the last one.
    base : ndarray, shape (4, 4)
        ``Z``.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> joint_chain(load("rx90")).D.shape
    (7, 4, 4)
    """

    columns: NDArray[np.int64]
    sigma: NDArray[np.int64]
    D: Array
    base: Array

    @property
    def k(self) -> int:
        """Number of joints."""
        return self.columns.size


def joint_chain(model: RobotModel) -> JointChain:
    """Gather the joints that move the tool.

    Parameters
    ----------
    model : RobotModel
        The robot.

    Returns
    -------
    JointChain
        Its joints from base to tip, in order.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> joint_chain(load("lab_trr")).sigma
    array([1, 0, 0])
    """
    C = constant_factors(model.table)
    chain = model.chain
    columns, sigma, D = [], [], []
    constant = np.eye(4)
    for number in model.table.path(model.tip):
        row = number - 1
        constant = constant @ C[row]
        if chain.joint[row] >= 0:
            columns.append(int(chain.joint[row]))
            sigma.append(int(chain.sigma[row]))
            D.append(constant)
            constant = np.eye(4)
    D.append(constant @ model.tool)
    return JointChain(
        columns=read_only(columns, np.int64),
        sigma=read_only(sigma, np.int64),
        D=read_only(np.array(D)),
        base=model.base,
    )
