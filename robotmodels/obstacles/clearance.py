"""Clearance of links from obstacles and from each other, with gradients."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_each, as_vector
from ..errors import InvalidValueError
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model
from .shapes import Obstacle, Plane, nearest_points, unit_between

Frame = str | int | None
Segment = tuple[Frame, Frame]

_ROWS = 4096  # configurations at a time
_SAMPLES = 8  # random configurations that determine which points move
_STILL = 1e-12  # m, or m/rad


def clearance(
    model: RobotModel,
    q: ArrayLike,
    obstacles: Iterable[Obstacle] | Obstacle,
    radius: float | ArrayLike | None = None,
    self_collision: bool = False,
    *,
    segments: Sequence[Segment] | None = None,
) -> Array:
    """Clearance: least distance of the links from obstacles and, on request, from each other.

    Links are capsules: straight segments between the origins of frames, with a radius. Where the
    bodies of a robot are not near these segments, give a radius that covers them.

    Bodies that no joint moves are ignored. Of a link with one fixed end this end is ignored for
    planes and for bodies that it touches, such as the support of the robot. Links that share a
    joint, or that the radius always brings into contact, are ignored for self-collision.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m.
    obstacles : Sphere, Box, Plane, Capsule, or iterable of these
        May be empty.
    radius : float or array_like, shape (S,), optional
        Radius of all links, or of each segment, m; default 0.
    self_collision : bool
        Whether the distances between links are included.
    segments : sequence of pairs of frames, optional
        Names or numbers of frames (None is the tool) whose origins the segments join; twice the
        same frame is a point. Default every frame with its antecedent, and the tip with the tool.

    Returns
    -------
    ndarray, shape (...)
        Metres, negative inside; infinite without pairs.

    Examples
    --------
    >>> from robotmodels.obstacles import Plane, Sphere
    >>> from robotmodels.robots import load
    >>> clearance(load("planar_2r"), [0.0, 0.0], Sphere([0.5, 0.3, 0.0], 0.1))
    array(0.2)
    >>> clearance(load("rx90"), np.zeros((2, 6)), [Plane([0, 0, -1], [0, 0, 1])], 0.1).round(3)
    array([0.9, 0.9])
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    bodies, pairs = checked_obstacles(obstacles), checked_segments(segments)
    rows = q.reshape(-1, model.n)
    least = np.empty(len(rows))
    for k in range(0, len(rows), _ROWS):
        part = slice(k, k + _ROWS)
        distances, _ = link_distances(model, rows[part], bodies, radius, pairs, self_collision)
        least[part] = distances.min(axis=1, initial=np.inf)
    return least.reshape(q.shape[:-1])


def link_distances(
    model: RobotModel,
    q: Array,
    obstacles: Sequence[Obstacle],
    radius: float | ArrayLike | None = None,
    segments: Sequence[Segment] | None = None,
    self_collision: bool = False,
) -> tuple[Array, Array]:
    """Distances of all considered pairs, and their gradients by q.

    Shapes: q (N, n) -> (N, p), (N, p, n).
    """
    N = len(q)
    segments = links(model) if segments is None else segments
    size = as_each(radius, len(segments), "radius", least=0.0, finite=True, default=0.0)
    samples = np.random.default_rng(0).uniform(-3.0, 3.0, (_SAMPLES, model.n))
    q = np.concatenate((q, samples))
    frames = list(dict.fromkeys(frame for pair in segments for frame in pair))
    P, JP = origins(model, q, frames)
    first, last = np.array([[frames.index(frame) for frame in pair] for pair in segments]).T
    A, B, JA, JB = P[:, first], P[:, last], JP[:, first], JP[:, last]
    moves = np.array([np.abs(J[N:]).max(axis=(0, 2, 3), initial=0.0) > _STILL for J in (JA, JB)])
    k = np.flatnonzero(moves[0] | moves[1])
    distances, gradients = [np.empty((N, 0))], [np.empty((N, 0, model.n))]
    sampled = A[N:], B[N:]
    fixed = np.stack((A[-1, k], B[-1, k]))
    A, B, JA, JB = A[:N], B[:N], JA[:N], JB[:N]
    for body in obstacles:
        # an ignored fixed end is replaced by the moving end
        touch = isinstance(body, Plane) | (body.nearest(fixed, fixed)[0] <= size[k])
        first, last = (~moves[:, k] & touch)[..., None]
        start, end = np.where(first, B[:, k], A[:, k]), np.where(last, A[:, k], B[:, k])
        distance, t, away = body.nearest(start, end)
        first, last = first[..., None], last[..., None]
        J, K = np.where(first, JB[:, k], JA[:, k]), np.where(last, JA[:, k], JB[:, k])
        distances.append(distance - size[k])
        gradients.append(_along(away, J, K, t))
    if self_collision:
        i, j = _colliding(*sampled, moves[0] | moves[1], size)
        s, t = nearest_points(A[:, i], B[:, i], A[:, j], B[:, j])
        along = B[:, i] - A[:, i]
        point, other = A[:, i] + s[..., None] * along, A[:, j] + t[..., None] * (B - A)[:, j]
        distance, away = unit_between(point, other, along)
        distances.append(distance - size[i] - size[j])
        slope = _along(away, JA[:, i], JB[:, i], s) - _along(away, JA[:, j], JB[:, j], t)
        gradients.append(slope)
    return np.concatenate(distances, axis=1), np.concatenate(gradients, axis=1)


def links(model: RobotModel, frame: Frame = None) -> list[Segment]:
    """Every frame with its antecedent, and the tool or another frame with its parent."""
    pairs: list[Segment] = [(int(a), j + 1) for j, a in enumerate(model.table.antecedent)]
    return [*pairs, (model.twin.frame(frame).parent, frame)]


def origins(model: RobotModel, q: Array, frames: Sequence[Frame]) -> tuple[Array, Array]:
    """Origins of frames and their Jacobians. Shapes: q (N, n) -> (N, F, 3), (N, F, 3, n)."""
    from ..kernels.poses import link_poses

    inner = np.empty((len(q), model.f, 4, 4))
    link_poses(np.ascontiguousarray(q), model.chain, inner)
    base = np.broadcast_to(model.base, (len(q), 1, 4, 4))
    T = np.concatenate((base, inner), axis=1)
    places = [model.twin.frame(frame) for frame in frames]
    offset = np.array([[*frame.position, 1.0] for frame in places]).reshape(-1, 4, 1)
    P = (T[:, [frame.parent for frame in places]] @ offset)[..., :3, 0]
    rows = model.table.joint_rows
    moving = inner[:, None, rows]
    axis, point = moving[..., :3, 2], moving[..., :3, 3]
    turned = np.cross(axis, P[:, :, None] - point)
    slides = (model.table.sigma[rows] == PRISMATIC)[:, None]
    upstream = np.array([[row + 1 in frame.path for row in rows] for frame in places])
    J = np.where(slides, axis, turned) * upstream.reshape(-1, model.n, 1)
    return P, J.swapaxes(2, 3)


def checked_obstacles(obstacles: Any) -> tuple[Obstacle, ...]:
    """Obstacles as a tuple."""
    bodies: tuple[Any, ...] = tuple(obstacles) if isinstance(obstacles, Iterable) else (obstacles,)
    for k, body in enumerate(bodies):
        if not isinstance(body, Obstacle):
            raise InvalidValueError(
                f"obstacles[{k}]: expected Sphere, Box, Plane or Capsule, got {body!r:.60}."
            )
    return bodies


def checked_segments(segments: Any) -> Any:
    """Pairs of frames as a tuple; None stays None."""
    if segments is None:
        return None
    pairs = tuple(tuple(pair) if isinstance(pair, tuple | list) else () for pair in segments)
    if not pairs or any(len(pair) != 2 for pair in pairs):
        raise InvalidValueError(
            f"segments: expected pairs of frames, at least one, got {segments!r:.80}; a point is "
            "twice the same frame."
        )
    return pairs


def _along(away: Array, J: Array, K: Array, t: Array) -> Array:
    """Gradient by q of a distance whose nearest point is at t between two points."""
    return np.einsum("nsi,nsij->nsj", away, J + t[..., None, None] * (K - J))


def _colliding(
    A: Array, B: Array, moves: NDArray[np.bool_], size: Array
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of segments that may come nearer; neighbours and parts of one body do not count."""
    i, j = np.triu_indices(A.shape[1], 1)
    ends = [np.linalg.norm(X[:, i] - Y[:, j], axis=-1) for X in (A, B) for Y in (A, B)]
    touching = (np.min(ends, axis=0) <= size[i] + size[j] + _STILL).all(axis=0)
    rigid = (np.ptp(ends, axis=1) <= 1e-9).all(axis=0)
    some = (moves[i] | moves[j]) & ~touching & ~rigid
    point = np.linalg.norm(B - A, axis=-1).max(axis=0) <= 1e-9
    some &= ~point[i] & ~point[j]
    return i[some], j[some]
