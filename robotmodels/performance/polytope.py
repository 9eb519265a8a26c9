"""Polytopes of velocities, forces and accelerations within joint limits (section 3.6.2).

Velocities are the images of the box of joint velocities, a zonotope; accelerations, at rest and
without gravity, those of the box of torques; forces are all that torques in their box balance, an
intersection of strips.

Parameters
----------
arm
    The robot; velocity and effort limits are those of its table.
q : array_like, shape (n,)
    Configuration, rad or m.
kind : {"velocity", "force", "acceleration"}
    Which one.
mask : array_like, shape (6,), optional
    Components that count, world axes; of a force the others are zero. Default all.
frame : str or int, optional
    Name or number of the frame; default the tool.

Returns
-------
Polytope
    Vertices, faces, and the largest ball inside.

Examples
--------
>>> from robotmodels.robots import load
>>> found = polytope(load("ur5e"), [0, 0.5, 0.5, 0, 0.5, 0], mask="position")
>>> found.vertices.shape[1], found.radius > 0.0
(3, True)
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_mask, as_vector
from .._choices import one_of
from .._outcomes import Outcome, Result
from ..dynamics import mass_matrix
from ..errors import InvalidValueError, ShapeError
from ..kinematics import jacobian
from ..model import RobotModel, check_model

KINDS = ("velocity", "force", "acceleration")
_ZERO = 1e-10  # beside the largest generator, or the largest distance of a plane
_MOST_GENERATORS = 16


class PolytopeStatus(Outcome):
    """Outcome of `polytope`."""

    BOUNDED = 0, "The polytope is bounded and has an interior."
    FLAT = 1, "The polytope has no interior: some direction of the task cannot be reached."
    UNBOUNDED = 2, "The polytope is unbounded: the structure carries some wrenches alone."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Polytope(Result):
    """A convex polytope about the origin, symmetric to it.

    ``vertices`` (V, m) in the units of the task: m/s and rad/s, N and N m, m/s^2 and rad/s^2; of an
    unbounded one those of the part that the joints feel. ``faces`` (F, c) are numbers of the
    vertices of each face, simplices: triangles for m = 3, edges for m = 2; ``radius`` is that of
    the largest ball about the origin inside.
    """

    vertices: Array
    faces: NDArray[np.int64] | tuple[NDArray[np.int64], ...]
    radius: float
    status: PolytopeStatus


def polytope(
    arm: RobotModel,
    q: ArrayLike,
    kind: str = "velocity",
    mask: ArrayLike | str | None = None,
    frame: str | int | None = None,
) -> Polytope:
    """Polytope of velocities, forces or accelerations of the tool within the limits of joints."""
    check_model(arm)
    one_of(kind, KINDS, "kind")
    rows, q = as_mask(mask), as_vector(q, arm.n, "q")
    if q.ndim != 1:
        raise ShapeError(f"q: expected one configuration ({arm.n},), got shape {q.shape}.")
    J = jacobian(arm, q, frame)[rows]
    moving = np.abs(J).max(axis=0, initial=0.0) > 0.0
    bounds = arm.table.velocity if kind == "velocity" else arm.table.effort
    used = np.ones(arm.n, np.bool_) if kind == "acceleration" else moving
    if not (np.isfinite(bounds[used]) & (bounds[used] > 0.0)).all():
        word = "velocity" if kind == "velocity" else "effort"
        raise InvalidValueError(
            f"{arm.name}: the {word} limits of the table are {bounds.tolist()}; give every joint a "
            f"finite one above zero (`DHTable(..., {word}=...)`)."
        )
    if int(used.sum()) > _MOST_GENERATORS:
        raise InvalidValueError(
            f"{arm.name}: {int(used.sum())} joints move the frame; at most {_MOST_GENERATORS} can "
            "be combined."
        )
    if kind == "force":
        return _strips(J[:, moving], bounds[moving])
    if kind == "velocity":
        return _zonotope(J[:, moving] * bounds[moving])
    M = mass_matrix(arm, q)
    if np.linalg.matrix_rank(M) < arm.n:
        raise InvalidValueError(
            f"{arm.name}: accelerations need masses; the mass matrix is singular. Give the model "
            "inertial parameters."
        )
    return _zonotope(np.linalg.solve(M, J.T).T * bounds)


def _zonotope(G: Array) -> Polytope:
    """All sums of the columns of G (m, k) times factors in [-1, 1]."""
    m = len(G)
    U, s, _ = np.linalg.svd(G) if G.size else (np.eye(m), np.zeros(0), None)
    rank = int((s > _ZERO * s.max(initial=0.0)).sum())
    if rank == m:
        return _hull(_corners(G))
    # no inside: its vertices in the subspace it spans
    inner = _hull(_corners(U[:, :rank].T @ G)) if rank else None
    vertices = np.zeros((1, m)) if inner is None else inner.vertices @ U[:, :rank].T
    faces = () if inner is None else inner.faces
    return Polytope(vertices, faces, 0.0, PolytopeStatus.FLAT)


def _corners(G: Array) -> Array:
    """Images of the corners of the box, parallel columns added, zeros left out."""
    length = np.linalg.norm(G, axis=0)
    G = G[:, length > _ZERO * length.max(initial=0.0)]
    u = G / np.linalg.norm(G, axis=0)
    cos = u.T @ u
    first = (np.abs(cos) > 1.0 - 1e-13).argmax(axis=1)
    G = G * np.sign(cos[first, range(len(first))])
    G = np.stack([G[:, first == k].sum(axis=1) for k in np.unique(first)], axis=1)
    return np.array(list(product((-1.0, 1.0), repeat=G.shape[1]))) @ G.T


def _strips(J: Array, tau: Array) -> Polytope:
    """All f (m,) with ``|J^T f| <= tau``: the polar of the hull of the rows of J^T over tau."""
    from scipy.spatial import ConvexHull

    A, m = (J / tau).T, len(J)
    _, s, Vt = np.linalg.svd(A) if A.size else (None, np.zeros(0), np.eye(m))
    rank = int((s > _ZERO * s.max(initial=0.0)).sum())
    status = PolytopeStatus.BOUNDED if rank == m else PolytopeStatus.UNBOUNDED
    # directions that no joint feels are left out
    basis = np.eye(m) if rank == m else Vt[:rank]
    if rank == 0:
        return Polytope(np.zeros((1, m)), (), float("inf"), status)
    A = A @ basis.T
    if rank == 1:
        vertices = np.array([[-1.0], [1.0]]) / np.abs(A).max()
    else:
        planes = ConvexHull(np.concatenate((A, -A))).equations
        vertices = -planes[:, :-1] / planes[:, -1:]
    inner = _hull(vertices)
    return Polytope(inner.vertices @ basis, inner.faces, inner.radius, status)


def _hull(points: Array) -> Polytope:
    """Convex hull of points (N, m) about the origin."""
    from scipy.spatial import ConvexHull

    if points.shape[1] == 1:
        top = float(points.max())
        return Polytope(
            np.array([[-top], [top]]), np.array([[0], [1]]), top, PolytopeStatus.BOUNDED
        )
    hull = ConvexHull(points)
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    radius = float(-hull.equations[:, -1].max())
    return Polytope(points[hull.vertices], number[hull.simplices], radius, PolytopeStatus.BOUNDED)
