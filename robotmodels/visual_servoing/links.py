"""Virtual links between camera and object, and interaction matrices learnt from motions.

Parameters
----------
f : Points, Lines, Segments, Circle, ...
    Feature that is kept.
T : array_like, shape (4, 4)
    Pose of the object in the camera.
dS, dX : array_like, shapes (N, k) and (N, 6)
    Changes of a measurement, and the small displacements [v; w] of the camera in its own axes that
    caused them, m and rad.
L, ds, dx : array_like, shapes (k, 6), (k,) and (6,)
    Estimate so far; the last change and its displacement, which leaves L as it is where it is zero.
factor : float
    Part of the correction, in (0, 1].

Returns
-------
VirtualLink, or ndarray of shape (k, 6)
    The link, or the interaction matrix.

Raises
------
ShapeError, InvalidValueError, NotARotationError
    Arrays that do not fit each other, displacements that do not span all six directions, a pose at
    which the feature does not exist.

References
----------
Seed book sections 6.3.3.1 and 6.2.4.4; B. Espiau, F. Chaumette and P. Rives 1992; M. Jagersand,
O. Fuentes and R. Nelson, "Experimental evaluation of uncalibrated visual servoing", ICRA 1997.

Examples
--------
>>> import numpy as np
>>> from robotmodels.se3 import translation
>>> from robotmodels.visual_servoing import Sphere
>>> link = virtual_link(Sphere([0, 0, 0], 0.2), translation(0, 0, 1))
>>> link.link_class, link.rank, link.name
(3, 3, 'ball joint')
>>> estimate_interaction(np.eye(6)[:, :2], np.eye(6)).shape
(2, 6)
>>> broyden(np.zeros((1, 6)), [0.2], [0.1, 0, 0, 0, 0, 0])
array([[2., 0., 0., 0., 0., 0.]])
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats, as_number, as_vector
from ..errors import InvalidValueError, ShapeError
from ..se3 import as_single_pose
from .features import Feature
from .results import Result
from .velocity import RANK_TOLERANCE

_NAMES = {
    (0, 0): "rigid", (1, 1): "prismatic", (1, 0): "revolute", (2, 1): "cylindrical joint",
    (3, 2): "planar joint", (3, 0): "ball joint", (4, 2): "line contact",
    (4, 1): "sphere in a cylinder", (5, 2): "point contact", (6, 3): "free",
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class VirtualLink(Result):
    """The motions of a camera that leave a feature unchanged at a pose.

    Parameters
    ----------
    link_class : int
        Dimension of the motions, 6 - rank.
    rank : int
        Rank of the interaction matrix.
    kernel_twists : ndarray, shape (class, 6)
        Orthonormal twists [v; w] of the camera in its own axes.
    name : str
        Of the mechanical link with as many rotations and translations, "" for others.
    """

    link_class: int
    rank: int
    kernel_twists: Array
    name: str = ""


def virtual_link(f: Feature, T: ArrayLike) -> VirtualLink:
    """Virtual link between a camera and an object: the kernel of the interaction matrix."""
    if not isinstance(f, Feature):
        raise InvalidValueError(f"f: expected a feature, got {type(f).__name__}.")
    _, sizes, Vt = np.linalg.svd(f.interaction(as_single_pose(T, "T")))
    rank = int((sizes > RANK_TOLERANCE * sizes[0]).sum())
    kernel = Vt[rank:]
    turns = int(np.linalg.matrix_rank(kernel[:, 3:], tol=1e-6)) if len(kernel) else 0
    translations = len(kernel) - turns
    return VirtualLink(len(kernel), rank, kernel, _NAMES.get((len(kernel), translations), ""))


def estimate_interaction(dS: ArrayLike, dX: ArrayLike) -> Array:
    """Interaction matrix from motions of the camera: least squares of ``dS = dX L^T``."""
    S, X = as_floats(dS, "dS"), as_vector(dX, 6, "dX")
    if S.ndim != 2 or X.ndim != 2 or len(S) != len(X):
        raise ShapeError(f"dS, dX: expected shapes (N, k) and (N, 6), got {S.shape} and {X.shape}.")
    scale = np.abs(X).max(axis=0, initial=0.0)
    L, _, rank, _ = np.linalg.lstsq(X / np.where(scale > 0.0, scale, 1.0), S, rcond=1e-10)
    if rank < 6:
        raise InvalidValueError(
            f"dX: the displacements span {rank} of 6 directions; translate along and rotate about "
            "all three axes of the camera."
        )
    return (L / scale[:, None]).T


def broyden(L: ArrayLike, ds: ArrayLike, dx: ArrayLike, factor: float = 1.0) -> Array:
    """Broyden's update: the matrix nearest to L that explains the last motion."""
    A, s, x = as_vector(L, 6, "L"), as_floats(ds, "ds"), as_vector(dx, 6, "dx")
    if A.ndim != 2 or s.shape != A.shape[:1] or x.ndim != 1:
        raise ShapeError(
            f"L, ds, dx: expected (k, 6), (k,), (6,), got {A.shape}, {s.shape}, {x.shape}."
        )
    part = as_number(factor, "factor", above=0.0)
    if part > 1.0:
        raise InvalidValueError(f"factor: expected a number in (0, 1], got {factor}.")
    size = float(np.abs(x).max())
    if size == 0.0:
        return A.copy()
    unit = x / size
    with np.errstate(over="ignore"):
        B = A + part * np.outer((s - A @ x) / size, unit / (unit @ unit))
    if not np.isfinite(B).all():
        raise InvalidValueError(f"dx: expected a displacement that can cause ds, got {dx!r:.60}.")
    return B
