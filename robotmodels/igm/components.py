"""The components of a pose that a mask asks for: what is missing of them, and how they move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from ..se3.orientation import rotation_vectors_of
from .loop import JointChain
from .motion import jacobians, tool_poses


@dataclass(frozen=True, slots=True)
class Components:
    """Components ``x y z rx ry rz`` of the way from a pose to the desired one."""

    asked: tuple[bool, ...]
    in_tool_axes: bool

    @property
    def freed_translations(self) -> tuple[int, ...]:
        """Axes along which the position is not asked for."""
        return tuple(i for i in range(3) if not self.asked[i])

    @property
    def freed_rotations(self) -> tuple[int, ...]:
        """Axes about which the rotation is not asked for."""
        return tuple(i for i in range(3) if not self.asked[3 + i])


def mask_axes(chain: JointChain, U: Array, components: Components) -> Array:
    """The axes of the mask in R_0, columns of a rotation, shape (N, 3, 3)."""
    if components.in_tool_axes:
        return U[:, :3, :3]
    return np.broadcast_to(chain.base[:3, :3].T, (len(U), 3, 3))


def missing_components(
    chain: JointChain, U: Array, q: Array, components: Components
) -> tuple[Array, Array]:
    """Error of each component, in the mask's axes.

    Shapes: U (N, 4, 4), q (N, k) -> translation, rotation (N, 3).
    """
    P = tool_poses(chain, q)
    axes = mask_axes(chain, U, components)
    translation = U[:, :3, 3] - P[:, :3, 3]
    rotation = rotation_vectors_of(U[:, :3, :3] @ np.swapaxes(P[:, :3, :3], 1, 2))
    return _along(axes, translation), _along(axes, rotation)


def asked_errors(
    chain: JointChain, U: Array, q: Array, components: Components
) -> tuple[Array, Array]:
    """Lengths of what is missing of the asked translations [m] and rotations [rad], each (N,)."""
    asked = np.array(components.asked)
    translation, rotation = missing_components(chain, U, q, components)
    return (
        np.linalg.norm(translation[:, asked[:3]], axis=1),
        np.linalg.norm(rotation[:, asked[3:]], axis=1),
    )


def asked_jacobians(chain: JointChain, U: Array, q: Array, components: Components) -> Array:
    """How the asked components of the tool's motion depend on the joints, shape (N, a, k).

    The rows of rotations hold where all asked ones are met and the freed ones are none or all, or
    nothing is missing of them; elsewhere they are those of the angular velocity.
    """
    J = jacobians(chain, q)
    axes = np.swapaxes(mask_axes(chain, U, components), 1, 2)
    return np.concatenate([axes @ J[:, :3], axes @ J[:, 3:]], axis=1)[:, np.array(components.asked)]


def _along(axes: Array, vectors: Array) -> Array:
    """Components of vectors (N, 3) along axes (N, 3, 3)."""
    return np.einsum("nij,ni->nj", axes, vectors)
