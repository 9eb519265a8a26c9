"""The Jacobians of what is asked of the tool, at the postures of a path."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array
from ..kinematics import jacobian
from ..model import RobotModel
from ..se3.orientation import rotation_vectors_of


class Task:
    """Jacobians of the task along the path.

    Shapes: T (N, 4, 4); q (N, n); reached, conditioning, sign (N,); mask (6,); columns (k,).
    """

    __slots__ = (
        "_asked",
        "_inverse",
        "_length",
        "_poses",
        "_tool",
        "conditioning",
        "sign",
        "square",
    )

    def __init__(
        self,
        model: RobotModel,
        T: Array,
        q: Array,
        reached: NDArray[np.bool_],
        mask: ArrayLike | None,
        mask_axes: str,
        columns: NDArray[np.int64],
    ) -> None:
        N, n = q.shape
        self._asked = np.ones(6, np.bool_) if mask is None else np.asarray(mask, np.bool_)
        self._tool, self._poses = mask_axes == "tool", T
        J = jacobian(model, q[reached], reference="local" if self._tool else "world_aligned")
        lever = np.linalg.norm(J[:, :3], axis=-2).max(initial=0.0)
        self._length = float(lever) if lever > 0.0 else 1.0
        J[:, :3] /= self._length
        J = J[:, self._asked][..., columns]
        self.square = J.shape[-1] == J.shape[-2]
        self.conditioning, self.sign = np.full(N, np.nan), np.zeros(N)
        self._inverse = np.full((N, n, J.shape[-2]), np.nan)
        inverse, conditioning, sign = _inverted(J)
        self._inverse[reached], self.conditioning[reached] = 0.0, conditioning
        self._inverse[np.ix_(reached, columns)] = inverse
        self.sign[reached] = sign

    def rates(self, twists: Array) -> Array:
        """Joint velocities (N, n) for twists (N, 6) in world axes; the least of many."""
        return (self._inverse @ self._rows(twists, self._poses)[..., None])[..., 0]

    def foreseen(self, steps: NDArray[np.intp]) -> Array:
        """Steps (S, n) that the Jacobians at both ends foresee, from some poses to the next."""
        T, after = self._poses[steps], self._poses[steps + 1]
        move = np.empty((steps.size, 6))
        move[:, :3] = after[:, :3, 3] - T[:, :3, 3]
        move[:, 3:] = rotation_vectors_of(after[:, :3, :3] @ np.swapaxes(T[:, :3, :3], -1, -2))
        mean = 0.5 * (self._inverse[steps + 1] + self._inverse[steps])
        return (mean @ self._rows(move, T)[..., None])[..., 0]

    def _rows(self, twists: Array, T: Array) -> Array:
        """The components asked for, positions in units of the lever."""
        twists = np.array(twists)
        if self._tool:
            axes = np.swapaxes(T[:, :3, :3], -1, -2)
            twists[:, :3] = (axes @ twists[:, :3, None])[..., 0]
            twists[:, 3:] = (axes @ twists[:, 3:, None])[..., 0]
        twists[:, :3] /= self._length
        return twists[:, self._asked]


def _inverted(J: Array) -> tuple[Any, Any, Any]:
    """(Pseudo-)inverses, conditioning and sign of the determinant of Jacobians (M, m, n)."""
    from ..kernels.inverses import inverses

    M, m, n = J.shape
    r = min(m, n)
    if m == n:
        inverse, conditioning, sign = np.empty((M, n, n)), np.empty(M), np.empty(M)
        if inverses(np.ascontiguousarray(J), inverse, conditioning, sign) < 0:
            return inverse, np.nan_to_num(conditioning), sign
    # one of them is singular to the last digit, or they are not square
    size = np.sqrt(np.einsum("kij,kij->k", J, J))
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    live = s > 1e-14 * s[:, :1]
    with np.errstate(divide="ignore"):
        other = np.sqrt((1.0 / (s * s)).sum(axis=-1))
        factor = np.where(live, 1.0 / np.where(live, s, 1.0), 0.0)
    inverse = np.swapaxes(Vt, -1, -2) @ (factor[..., None] * np.swapaxes(U, -1, -2))
    with np.errstate(invalid="ignore"):
        conditioning = np.where(size > 0.0, r / (size * other), 0.0)
    sign = np.sign(np.linalg.det(J)) if m == n else np.zeros(len(J))
    return inverse, conditioning, sign
