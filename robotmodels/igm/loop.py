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
    """The k moving joints from base to tool and the constant transforms between them.

    Shapes: columns, sigma (k,); D (k + 1, 4, 4); base (4, 4).
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
    """Gather the joints that move the tool."""
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
