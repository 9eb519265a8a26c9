"""Polytopes of velocities, forces and accelerations: what limits of joints leave of a task."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_mask, as_vector, read_only
from .._outcomes import Outcome
from ..dynamics import mass_matrix
from ..errors import InvalidValueError, ShapeError
from ..kinematics import jacobian
from ..model import RobotModel, check_model
from .arms import Result, checked_word

KINDS = ("velocity", "force", "acceleration")
_ZERO = 1e-10  # beside the largest generator, or the largest distance of a plane
_MOST_GENERATORS = 16
_MOST_CORNERS = 400000


class PolytopeStatus(Outcome):
    """Outcome of `polytope`."""

    BOUNDED = 0, "The polytope is bounded and has an inside."
    FLAT = 1, "The polytope has no inside: some direction of the task cannot be reached."
    UNBOUNDED = 2, "The polytope is unbounded: the structure carries some wrenches alone."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Polytope(Result):
    """A convex polytope about the origin, symmetric to it.

    Parameters
    ----------
    vertices : ndarray, shape (V, m)
        Extreme points, in the units of the task: m/s and rad/s, N and N m, m/s^2 and rad/s^2.
        Of an unbounded polytope those of the part that the joints feel.
    faces : ndarray of int64, shape (F, c), or tuple of ndarray of int64
        Numbers of the vertices of each face: triangles for m = 3, edges for m = 2; a tuple where
        faces have different numbers of vertices.
    radius : float
        Radius of the largest ball about the origin inside.
    status : PolytopeStatus
        Whether it is bounded and has an inside.
    """

    vertices: Array
    faces: NDArray[np.int64] | tuple[NDArray[np.int64], ...]
    radius: float
    status: PolytopeStatus

    def reason(self) -> str:
        """The status as a sentence."""
        return self.status.sentence

    def __repr__(self) -> str:
        V, m = self.vertices.shape
        return (
            f"<Polytope in {m} dimensions: {V} vertices, {len(self.faces)} faces, radius "
            f"{self.radius:.4g}; {self.reason()}>"
        )


def polytope(
    arm: RobotModel,
    q: ArrayLike,
    kind: str = "velocity",
    mask: ArrayLike | str | None = None,
    frame: str | int | None = None,
) -> Polytope:
    """Polytope of velocities, forces or accelerations of the tool within the limits of the joints.

    Velocities are the images of the box of joint velocities, a zonotope; accelerations, at rest
    and without gravity, those of the box of torques; forces are all that torques in their box
    balance, an intersection of strips.

    Parameters
    ----------
    arm : RobotModel
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

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        Several configurations, an unknown kind, a limit that is missing or infinite, no mass for
        accelerations, more than 16 joints.

    References
    ----------
    Seed book section 3.6.2; A. Skuric et al., "Pycapacity", JOSS 8(89), 2023, for the words.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> found = polytope(load("ur5e"), [0, 0.5, 0.5, 0, 0.5, 0], mask="position")
    >>> found.vertices.shape[1], found.radius > 0.0
    (3, True)
    """
    check_model(arm)
    checked_word(kind, KINDS, "kind")
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
    G = _merged(G)
    rank = np.linalg.matrix_rank(G) if G.size else 0
    if rank < m:
        return _flat(G)
    if m == 1:
        top = float(np.abs(G).sum())
        return _polytope(np.array([[-top], [top]]), (np.array([0]), np.array([1])), top)
    if m == 2:
        G = G * np.where((G[1] > 0.0) | ((G[1] == 0.0) & (G[0] > 0.0)), 1.0, -1.0)
        G = G[:, np.argsort(np.arctan2(G[1], G[0]))]
        half = 2.0 * np.cumsum(G, axis=1) - G.sum(axis=1, keepdims=True)
        vertices = np.concatenate((half, -half), axis=1).T
        k = len(vertices)
        faces = tuple(np.array([i, (i + 1) % k]) for i in range(k))
        edges = np.roll(vertices, -1, axis=0) - vertices
        cross = vertices[:, 0] * edges[:, 1] - vertices[:, 1] * edges[:, 0]
        radius = float((np.abs(cross) / np.linalg.norm(edges, axis=1)).min())
        return _polytope(vertices, faces, radius)
    return _in_space(G.T, False) if m == 3 else _zonotope_of_corners(G)


def _merged(G: Array) -> Array:
    """The columns of a zonotope, parallel ones added, zeros left out."""
    length = np.linalg.norm(G, axis=0)
    G = G[:, length > _ZERO * max(float(length.max(initial=0.0)), 1e-300)]
    if G.shape[1] == 0:
        return G
    u = G / np.linalg.norm(G, axis=0)
    cos = u.T @ u
    same = np.abs(cos) > 1.0 - 1e-13
    first = same.argmax(axis=1)
    if (first == np.arange(len(first))).all():
        return G
    sign = np.sign(cos[first, np.arange(len(first))])
    return np.stack([(G * sign)[:, first == k].sum(axis=1) for k in np.unique(first)], axis=1)


def _in_space(A: Array, of_strips: bool) -> Polytope:
    """A zonotope of rows of A (k, 3), or the intersection of the strips ``|A x| <= 1``."""
    from .kernels import strip_faces, zonotope_faces

    k = len(A)
    faces = 2 * k if of_strips else k * (k - 1)
    room = 8 * k * (k - 1) * (k - 2) // 6 if of_strips else faces + 2
    vertices, sizes = np.empty((room, 3)), np.empty(faces, np.int64)
    corners, counts = np.empty(room * (2 * k if of_strips else 8), np.int64), np.zeros(3, np.int64)
    size = float(np.sqrt(np.einsum("ij,ij->i", A, A).max()))
    zero = _ZERO * (size**3 if of_strips else size)
    run = strip_faces if of_strips else zonotope_faces
    radius = run(np.ascontiguousarray(A), zero, vertices, corners, sizes, counts)
    ends = np.cumsum(sizes[: counts[1]])
    loops = [corners[b - n : b] for b, n in zip(ends.tolist(), sizes.tolist(), strict=False)]
    # a fan of triangles for each face
    fans = [np.stack((np.full(len(f) - 2, f[0]), f[1:-1], f[2:]), axis=1) for f in loops]
    return _polytope(vertices[: counts[0]].copy(), np.concatenate(fans), radius)


def _zonotope_of_corners(G: Array) -> Polytope:
    """A zonotope in more dimensions, from all corners of the box."""
    m, k = G.shape
    signs = np.array(list(product((-1.0, 1.0), repeat=k)))
    if m == k:
        inverse = np.linalg.inv(G)
        faces = [np.flatnonzero(signs[:, c] == s) for c in range(k) for s in (-1.0, 1.0)]
        radius = float((1.0 / np.linalg.norm(inverse, axis=1)).min())
        return _polytope(signs @ G.T, tuple(faces), radius)
    return _hull(signs @ G.T)


def _hull(points: Array) -> Polytope:
    """Convex hull by Qhull; faces are simplices."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    radius = float(-hull.equations[:, -1].max())
    faces = tuple(number[face] for face in hull.simplices)
    return _polytope(points[hull.vertices], faces, radius)


def _flat(G: Array) -> Polytope:
    """A zonotope without inside: its vertices in the subspace it spans."""
    m = len(G)
    U, s, _ = np.linalg.svd(G) if G.size else (np.eye(m), np.zeros(0), None)
    rank = int((s > _ZERO * s.max(initial=0.0)).sum())
    if rank == 0:
        return _polytope(np.zeros((1, m)), (), 0.0, PolytopeStatus.FLAT)
    inner = _zonotope(U[:, :rank].T @ G)
    vertices = inner.vertices @ U[:, :rank].T
    return _polytope(vertices, inner.faces, 0.0, PolytopeStatus.FLAT)


def _strips(J: Array, tau: Array) -> Polytope:
    """All f (m,) with ``|J^T f| <= tau``."""
    m, n = J.shape
    A = (J / tau).T  # |A f| <= 1
    _, s, Vt = np.linalg.svd(A) if A.size else (None, np.zeros(0), np.eye(m))
    rank = int((s > _ZERO * s.max(initial=0.0)).sum())
    status = PolytopeStatus.BOUNDED
    basis = np.eye(m)
    if rank < m:
        # directions that no joint feels are left out
        status, basis = PolytopeStatus.UNBOUNDED, Vt[:rank]
        if rank == 0:
            return _polytope(np.zeros((1, m)), (), float("inf"), status)
        A = A @ basis.T
    if rank == m == 3:
        return _in_space(A, True)
    chosen = np.array(list(combinations(range(n), rank)))
    if len(chosen) * 2**rank > _MOST_CORNERS:
        raise InvalidValueError(
            f"mask: the corners of {n} strips in {rank} dimensions are more than {_MOST_CORNERS}; "
            "ask for fewer components."
        )
    B = A[chosen]
    scale = np.linalg.norm(B, axis=2).prod(axis=1)
    B = B[np.abs(np.linalg.det(B)) > _ZERO * scale]
    signs = np.array(list(product((-1.0, 1.0), repeat=rank)))
    corners = np.einsum("kij,sj->ksi", np.linalg.inv(B), signs).reshape(-1, rank)
    heights = corners @ A.T
    inside = np.abs(heights).max(axis=1) <= 1.0 + 1e-9
    corners, heights = corners[inside], heights[inside]
    on = np.abs(np.abs(heights) - 1.0) <= 1e-8
    # corners on the same strips, the same sides, are one
    codes = on * np.sign(heights)
    _, first = np.unique(codes, axis=0, return_index=True)
    corners, codes = corners[first], codes[first]
    length = np.linalg.norm(A, axis=1)
    faces = []
    for c in range(n):
        for side in (1.0, -1.0):
            face = np.flatnonzero(codes[:, c] == side)
            if len(face) >= rank:
                faces.append(face)
    return _polytope(corners @ basis, tuple(faces), float(1.0 / length.max()), status)


def _polytope(
    vertices: Array, faces: NDArray[np.int64] | tuple[NDArray[np.int64], ...], radius: float,
    status: PolytopeStatus = PolytopeStatus.BOUNDED,
) -> Polytope:  # fmt: skip
    if len({len(face) for face in faces}) == 1:
        return Polytope(read_only(vertices), read_only(np.array(faces), np.int64), radius, status)
    return Polytope(
        read_only(vertices), tuple(read_only(f, np.int64) for f in faces), radius, status
    )
