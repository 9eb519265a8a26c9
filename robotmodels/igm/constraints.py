"""Constraints on the joints: asked components of a pose, and linear relations between joints."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce
from math import gcd

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..se3.orientation import quaternions_of, rotation_vectors_of
from .loop import JointChain
from .motion import cross, jacobians, lever, poses_and_jacobians, tool_poses


@dataclass(frozen=True, slots=True)
class Components:
    """Asked components ``x y z rx ry rz`` of the displacement from a pose to the desired one."""

    asked: tuple[bool, ...] = (True,) * 6
    in_tool_axes: bool = False

    @property
    def freed_translations(self) -> tuple[int, ...]:
        """Axes along which the position is not asked for."""
        return tuple(i for i in range(3) if not self.asked[i])

    @property
    def freed_rotations(self) -> tuple[int, ...]:
        """Axes about which the rotation is not asked for."""
        return tuple(i for i in range(3) if not self.asked[3 + i])


WHOLE = Components()


def mask_axes(chain: JointChain, U: Array, components: Components) -> Array:
    """The axes of the mask in R_0, columns of a rotation, shape (N, 3, 3)."""
    if components.in_tool_axes:
        return U[:, :3, :3]
    return np.broadcast_to(chain.base[:3, :3].T, (len(U), 3, 3))


def asked_errors(
    chain: JointChain, U: Array, q: Array, components: Components
) -> tuple[Array, Array]:
    """Lengths of the errors of the asked translations [m] and rotations [rad], each (N,)."""
    P, asked = tool_poses(chain, q), np.array(components.asked)
    rows = np.swapaxes(mask_axes(chain, U, components), 1, 2)
    rotation = rotation_vectors_of(U[:, :3, :3] @ np.swapaxes(P[:, :3, :3], 1, 2))
    errors = [
        (rows[:, wanted] @ vector[..., None])[..., 0]
        for wanted, vector in ((asked[:3], U[:, :3, 3] - P[:, :3, 3]), (asked[3:], rotation))
    ]
    return np.linalg.norm(errors[0], axis=1), np.linalg.norm(errors[1], axis=1)


def asked_jacobians(chain: JointChain, U: Array, q: Array, components: Components) -> Array:
    """Jacobians of the asked components, at configurations that meet them, shape (N, a, k)."""
    J = jacobians(chain, q)
    axes = np.swapaxes(mask_axes(chain, U, components), 1, 2)
    return np.concatenate([axes @ J[:, :3], axes @ J[:, 3:]], axis=1)[:, np.array(components.asked)]


@dataclass(frozen=True, slots=True, eq=False)
class Constraints:
    """Asked components of a pose and relations ``A q = b``. Shapes: A (m, k), b, period (m,)."""

    chain: JointChain
    components: Components
    A: Array
    b: Array
    length: float = field(default=1.0)

    @property
    def period(self) -> Array:
        """Periods of the relations: with whole coefficients of angles they hold modulo a turn."""
        period = np.zeros(len(self.A))
        for i, row in enumerate(self.A[:, self.chain.sigma == 0]):
            used = row[row != 0.0]
            if used.size and np.array_equal(used, np.round(used)) and np.abs(used).max() < 1e6:
                period[i] = 2.0 * np.pi * reduce(gcd, (int(abs(a)) for a in used))
        return period

    def relation_errors(self, q: Array) -> Array:
        """``b - A q`` modulo the periods, shape (N, m)."""
        r, period = self.b - q @ self.A.T, self.period
        turn = np.where(period > 0.0, period, 1.0)
        return np.where(period > 0.0, r - turn * np.round(r / turn), r)

    def linearised(self, U: Array, q: Array) -> tuple[Array, Array]:
        """Errors (N, r) and their Jacobians (N, r, k): lengths in units of the arm.

        An error of rotation is twice a component of the quaternion of ``R_desired R^T``: where
        rotations are freed it vanishes exactly where that component of the rotation vector does.
        """
        P, J = poses_and_jacobians(self.chain, q)
        axes = np.swapaxes(mask_axes(self.chain, U, self.components), 1, 2)
        translations, rotations = (np.array(part) for part in _halves(self.components.asked))
        across, about = axes[:, translations], axes[:, rotations]
        away = (across @ (U[:, :3, 3] - P[:, :3, 3])[..., None])[..., 0] / self.length
        Q = quaternions_of(U[:, :3, :3] @ np.swapaxes(P[:, :3, :3], 1, 2))
        turned = 2.0 * (about @ Q[:, 1:, None])[..., 0]
        # (c, v) becomes (c, v) (1, -w/2) where the tool turns by w
        rows = Q[:, :1, None] * about + cross(about, Q[:, None, 1:])
        linear = np.broadcast_to(self.A, (len(q), *self.A.shape))
        return (
            np.concatenate([away, turned, self.relation_errors(q)], axis=1),
            np.concatenate([across @ J[:, :3] / self.length, rows @ J[:, 3:], linear], axis=1),
        )

    def met(
        self, U: Array, q: Array, tolerances: tuple[float, float]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Residuals [m or rad] and whether configurations meet the constraints, each (N,)."""
        away, turned = asked_errors(self.chain, U, q, self.components)
        related = np.abs(self.relation_errors(q)).max(axis=1, initial=0.0) <= 1e-9
        residual = np.maximum(away, turned)
        return residual, (away <= tolerances[0]) & (turned <= tolerances[1]) & related


def constraints(chain: JointChain, components: Components = WHOLE) -> Constraints:
    """Constraints of a pose without relations."""
    return Constraints(chain, components, np.zeros((0, chain.k)), np.zeros(0), lever(chain))


def _halves(asked: tuple[bool, ...]) -> tuple[tuple[bool, ...], tuple[bool, ...]]:
    return asked[:3], asked[3:]


def in_half_open_turn(sigma: NDArray[np.int64], q: Array) -> Array:
    """Configurations with angles in (-pi, pi]."""
    return np.where(sigma == 0, np.pi - (np.pi - q) % (2.0 * np.pi), q)
