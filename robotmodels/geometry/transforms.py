"""The transforms of a table, for one q or many. Book section 1.2.1, eq. [1.2] and [1.3].

Parameters
----------
table : DHTable
    The geometric parameters, f frames.
q : array_like, shape (..., n)
    Joint variables in table order, radians or metres.

Returns
-------
ndarray, shape (..., f, 4, 4)
    One factor per row; their product along a branch is the pose of its last frame in R_0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_vector
from ..errors import InvalidValueError
from .joint_kinds import PRISMATIC
from .table import DHTable


def constant_factors(table: DHTable) -> Array:
    """The constant part ``C_j`` of each factor ``T(a(j), j) = C_j Motion(q_j)``, at ``q = 0``."""
    C = np.empty((table.f, 4, 4))
    for j in range(table.f):
        C[j] = (
            se3.rotation("z", float(table.gamma[j]))
            @ se3.translation(0.0, 0.0, table.b[j])
            @ se3.rotation("y", float(table.beta[j]))
            @ se3.rotation("x", float(table.alpha[j]))
            @ se3.translation(table.d[j], 0.0, 0.0)
            @ se3.rotation("z", float(table.theta[j]))
            @ se3.translation(0.0, 0.0, table.r[j])
        )
    return C


def link_transforms(table: DHTable, q: ArrayLike) -> Array:
    """The factors ``T(a(j), j)`` of the direct geometric model, straight from the table.

    Shapes: q (..., n) -> (..., f, 4, 4).
    Plain NumPy, no Pinocchio and no compiled code: the oracle that the fast paths are held to.

    Examples
    --------
    >>> table = DHTable.from_rows([{"sigma": 0}, {"sigma": 1, "r": 0.1}])
    >>> link_transforms(table, [0.0, 0.2])[1, 2, 3].round(12)
    np.float64(0.3)
    """
    if not isinstance(table, DHTable):
        hint = "; pass model.table" if hasattr(table, "table") else ""
        raise InvalidValueError(f"table: expected a DHTable, got {type(table).__name__}{hint}.")
    q = as_vector(q, table.n, "q")
    theta = np.broadcast_to(table.theta, (*q.shape[:-1], table.f)).copy()
    r = np.broadcast_to(table.r, theta.shape).copy()
    for i, row in enumerate(table.joint_rows):
        own = r if table.sigma[row] == PRISMATIC else theta
        own[..., row] += q[..., i]
    # left factor: everything up to Trans(x, d); right factor: Rot(z, theta) Trans(z, r)
    left = constant_factors(table.replace(theta=np.zeros(table.f), r=np.zeros(table.f)))
    c, s = np.cos(theta), np.sin(theta)
    T = np.zeros((*theta.shape, 4, 4))
    T[..., :3, 0] = c[..., None] * left[:, :3, 0] + s[..., None] * left[:, :3, 1]
    T[..., :3, 1] = -s[..., None] * left[:, :3, 0] + c[..., None] * left[:, :3, 1]
    T[..., :3, 2] = left[:, :3, 2]
    T[..., :3, 3] = left[:, :3, 3] + r[..., None] * left[:, :3, 2]
    T[..., 3, 3] = 1.0
    return T
