"""Functions of the joints whose signs tell apart the sides of the singular positions of an arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array
from ..igm.loop import joint_chain
from ..kinematics import jacobian
from ..model import RobotModel
from ..symbolic import explain_singularities
from .arms import section_arm, task_rows

_CHUNK = 65536


@dataclass(frozen=True, slots=True, eq=False)
class Factors:
    """Factors of the determinant of an arm: names, the joints (columns of q) of each, values."""

    model: RobotModel
    names: tuple[str, ...]
    joints: tuple[tuple[int, ...], ...]
    formulas: tuple[Any, ...]
    rows: NDArray[np.bool_]

    def values(self, q: Array) -> Array:
        """Values (N, k) of the factors at configurations (N, n)."""
        if self.formulas:
            return np.stack([factor.values(q) for factor in self.formulas], axis=-1)
        arm = section_arm(self.model)
        if arm is not None and not self.rows[3:].any():
            return arm.values(q[:, arm.columns[1:]])[:, 6:7]
        out = np.empty((len(q), 1))
        columns = joint_chain(self.model).columns
        for k in range(0, len(q), _CHUNK):
            J = jacobian(self.model, q[k : k + _CHUNK])[:, self.rows][..., columns]
            out[k : k + _CHUNK, 0] = np.linalg.det(J)
        return out

    def codes(self, q: Array) -> NDArray[np.int64]:
        """Signs (N,) of all factors as one number: bit i is set where factor i is positive."""
        return np.asarray((self.values(q) > 0.0) @ (1 << np.arange(len(self.joints))))


def sign_factors(model: RobotModel, mask: ArrayLike | str | None = None) -> Factors | None:
    """Factors of the square matrix that decides; None if it is not square, or never regular."""
    rows = task_rows(model, mask)
    columns = joint_chain(model).columns
    if columns.size == 0 or (rows.sum() != columns.size and section_arm(model) is None):
        return None
    if mask is None:
        explained = explain_singularities(model)
        if np.isfinite(explained.constant) and explained.constant != 0.0 and explained.factors:
            kept = tuple(f for f in explained.factors if not f.never_zero)
            return Factors(
                model, tuple(f.text for f in kept), tuple(f.joints for f in kept), kept, rows
            )
        if explained.constant == 0.0:
            return None
        if np.isfinite(explained.constant) and not explained.factors:
            return Factors(model, (), (), (), rows)
    joints = tuple(int(c) for c in columns)
    return Factors(model, ("determinant",), (joints,), (), rows)
