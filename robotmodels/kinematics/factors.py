"""The Jacobian as a product of three matrices, of which only the third can be singular.

Book section 1.3.1.3, after M. Renaud, "Contribution à la modélisation et à la commande
dynamique des robots manipulateurs", 1980.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, Frozen, Value, as_vector
from ..geometry import PRISMATIC
from ..model import FrameOfInterest, RobotModel, check_model
from .poses import link_poses


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class JacobianFactors(Frozen, Value):
    """The three matrices of the book: ``J = rotation transport reduced``.

    The first two are invertible at every configuration, so that rank, singular positions and (for
    six joints) the inverse are those of the third.

    Parameters
    ----------
    rotation : ndarray, shape (..., 6, 6)
        ``diag(R_i, R_i)``, the axes of the projection frame i in the world.
    transport : ndarray, shape (..., 6, 6)
        ``[1, -[L]x; 0, 1]`` with ``L`` from the origin of the intermediate frame j to that of the
        frame, in the axes of i, metres.
    reduced : ndarray, shape (..., 6, n)
        ``iJ_{n,j}``, rows ``[v; w]``: column k is ``[a_k; 0]`` if prismatic and
        ``[a_k x L_{k,j}; a_k]`` if revolute, in the axes of i, with ``L_{k,j}`` from O_k to O_j;
        zero if the joint does not move the frame.
    projection, intermediate : str
        Names of the frames i and j.
    """

    rotation: Array
    transport: Array
    reduced: Array
    projection: str
    intermediate: str

    @property
    def jacobian(self) -> Array:
        """The product of the three, shape (..., 6, n): world axes, at the frame's origin."""
        return self.rotation @ (self.transport @ self.reduced)

    def inverse_times(self, twist: ArrayLike) -> Array:
        """Joint velocities (..., n) of least norm whose twist is nearest a given one (..., 6).

        The inverses of the first two matrices are written down; only the third is solved. Singular
        values below 1e-12 of its largest count as zero, nothing is damped.
        """
        twist = as_vector(twist, 6, "twist")
        seen = np.einsum("...ji,...j->...i", self.rotation, twist)
        w = seen[..., 3:]
        # [1, -[L]x; 0, 1] has the inverse [1, [L]x; 0, 1]
        lever = -self.transport[..., :3, 3:]
        at_j = np.concatenate([seen[..., :3] + np.einsum("...ij,...j->...i", lever, w), w], axis=-1)
        inverse = np.linalg.pinv(self.reduced, rcond=1e-12)
        return np.einsum("...ij,...j->...i", inverse, at_j)


def jacobian_factors(
    model: RobotModel,
    q: ArrayLike,
    projection: str | int | None = None,
    intermediate: str | int | None = None,
    frame: str | int | None = None,
) -> JacobianFactors:
    """Decomposition of the Jacobian into three matrices, the first two of full rank.

    Parameters
    ----------
    projection, intermediate : str or int, optional
        Frames i, in whose axes the third matrix is, and j, at whose origin; 0 is R_0. Defaults as
        the book advises, halfway along the k frames that carry ``frame``: i is number k/2 of them
        (R_3 of six) and j the next (R_4).

    Examples
    --------
    >>> from robotmodels.kinematics import jacobian
    >>> from robotmodels.robots import load
    >>> rx90, q = load("rx90"), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    >>> np.allclose(jacobian_factors(rx90, q, 3, 4).jacobian, jacobian(rx90, q), atol=1e-14)
    True
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    point = model.twin.frame(frame)
    middle_i, middle_j = middle_frames(point)
    i = model.twin.frame(middle_i if projection is None else projection)
    j = model.twin.frame(middle_j if intermediate is None else intermediate)
    poses = link_poses(model, q)
    batch = q.shape[:-1]
    base = np.broadcast_to(model.base, (*batch, 1, 4, 4))
    poses = np.concatenate([base, poses], axis=-3)
    axes = poses[..., i.parent, :3, :3] @ i.rotation
    at = _origin(poses, j)
    lever = np.einsum("...ji,...j->...i", axes, _origin(poses, point) - at)

    rotation = np.zeros((*batch, 6, 6))
    rotation[..., :3, :3] = rotation[..., 3:, 3:] = axes
    transport = np.zeros((*batch, 6, 6))
    transport[..., range(6), range(6)] = 1.0
    transport[..., :3, 3:] = -se3.skew(lever)
    rows = model.table.joint_rows
    links = poses[..., rows + 1, :, :]
    a, o = links[..., :3, 2], links[..., :3, 3]
    slides = (model.table.sigma[rows] == PRISMATIC)[:, None]
    v, w = np.where(slides, a, np.cross(a, at[..., None, :] - o)), np.where(slides, 0.0, a)
    columns = np.stack([v, w], axis=-2) @ axes[..., None, :, :]
    columns = np.where(np.isin(rows + 1, point.path)[:, None, None], columns, 0.0)
    reduced = np.ascontiguousarray(columns.reshape(*batch, model.n, 6).swapaxes(-1, -2))
    names = (model.twin.names.frames[0], *map(str, model.table.names))
    return JacobianFactors(
        rotation=rotation,
        transport=transport,
        reduced=reduced,
        projection=_name(middle_i if projection is None else projection, names),
        intermediate=_name(middle_j if intermediate is None else intermediate, names),
    )


def middle_frames(point: FrameOfInterest) -> tuple[int, int]:
    """The projection and intermediate frame that the book advises: halfway along a path."""
    path = [0, *(int(j) for j in point.path)]
    half = (len(path) - 1) // 2
    return path[half], path[min(half + 1, len(path) - 1)]


def _origin(poses: Array, frame: FrameOfInterest) -> Array:
    """World position of a frame's origin."""
    pose = poses[..., frame.parent, :, :]
    return pose[..., :3, 3] + pose[..., :3, :3] @ frame.position


def _name(frame: str | int, names: tuple[str, ...]) -> str:
    return frame if isinstance(frame, str) else str(names[frame])
