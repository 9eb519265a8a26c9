"""Flexible links from modes, and reduction of finite elements by Craig and Bampton (7.2.2.3).

Parameters
----------
M, K : array_like, shape (c, c)
    Mass and stiffness of the nodes: for `from_modes` c = 3 N displacements, or 6 N with rotations
    after the displacements of each node, and M may be the N masses of the nodes.
shapes : array_like, shape (c, m) or (N, 3, m)
    Orthogonal modes, zero at the first node, where the link is clamped; at most N.
nodes : array_like, shape (N, 3)
    Places in the frame of the joint, m; the last is where the next link is fixed.
interface, clamped : array_like of int, shape (k,) and optional
    Displacements, from 0, by which the body is loaded, such as those of the last node; those that
    are zero, such as those of the first node.
modes : int
    Modes with the interface held.

Returns
-------
FlexibleLink or ReducedModel
    The link; the reduction with k + modes shapes, which `from_modes` takes.

Examples
--------
>>> K = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
>>> craig_bampton(np.eye(3), K, [2], 2).frequencies.round(4)
array([0.445 , 1.247 , 1.8019])
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, Value, as_count, as_exact, as_floats
from ..errors import InvalidValueError, ShapeError
from .link import FlexibleLink, Section, integrals

_MIXED = 1e-6  # largest mixed mass or stiffness of two modes, relative to their own
_MOVES = 1e-9  # largest displacement of the root, relative to the shape


def from_modes(M: ArrayLike, K: ArrayLike, shapes: ArrayLike, nodes: ArrayLike) -> FlexibleLink:
    """Flexible link from modes of a finite element model, clamped at its first node.

    Integrals linear in the shapes are those of M; quadratic ones take the mass of its translations.
    """
    X = as_floats(nodes, "nodes")
    if X.ndim != 2 or X.shape[1] != 3 or len(X) < 2:
        raise ShapeError(f"nodes: expected shape (N, 3), N from 2, got {X.shape}.")
    N, S = len(X), as_floats(shapes, "shapes")
    if S.ndim == 3 and S.shape[0] == N:  # (N, 3, m), as the shapes of a link are
        S = S.reshape(-1, S.shape[2])
    if S.ndim != 2 or len(S) not in (3 * N, 6 * N):
        raise ShapeError(f"shapes: expected ({3 * N}, m) or ({6 * N}, m), got {S.shape}.")
    c, m = S.shape
    if m > N:
        raise InvalidValueError(
            f"shapes: expected at most as many modes as nodes, got {m} modes of {N} nodes."
        )
    K, M = _symmetric(K, c, "K"), as_floats(M, "M")
    if M.shape == (N,):
        M = np.diag(np.repeat(M, c // N) * np.tile(np.arange(c // N) < 3, N))
    M, free = _symmetric(M, c, "M"), c // N
    size = np.abs(S).max(axis=0, initial=1e-300)
    if (np.abs(S[:free]) > _MOVES * size).any():
        raise InvalidValueError(
            "shapes: the first node moves, and a link is clamped there; take modes with it held."
        )
    least = np.linalg.eigvalsh(M)
    if least[0] < -_MIXED * max(least[-1], 0.0):
        raise InvalidValueError("M: expected a mass matrix, which has no negative eigenvalue.")
    if free == 3 and not np.any(X[-1] - X[-2]):
        raise InvalidValueError(
            "nodes: the last two are the same place, so that the tip has no rotation."
        )
    mass, stiffness = S.T @ M @ S, S.T @ K @ S
    for name, matrix in (("M", mass), ("K", stiffness)):
        own = np.diag(matrix)
        mixed = np.abs(matrix - np.diag(own)) > _MIXED * np.sqrt(np.abs(np.outer(own, own)))
        if (own <= 0.0).any() or mixed.any():
            raise InvalidValueError(
                f"shapes: expected modes orthogonal with respect to {name}, with positive {name}."
            )
    parts = S.reshape(N, free, m)
    Phi = parts[:, :3]
    W = np.mean([M[i::free, i::free] for i in range(3)], axis=0)
    found = integrals(W, X, Phi, np.zeros((N, 3, m, m)), np.diag(np.diag(stiffness)))
    rigid = np.zeros((N, free, 6))  # displacements by unit translations and rotations
    rigid[:, :3, :3] = np.eye(3)
    rigid[:, :3, 3:] = np.cross(np.eye(3)[None], X[:, None]).swapaxes(1, 2)
    if free == 6:
        rigid[:, 3:, 3:] = np.eye(3)
    R = rigid.reshape(c, 6)
    own, mixed = R.T @ M @ R, (R.T @ M @ S).T
    found = replace(found, inertia=own[3:, 3:], modal_mass=np.diag(np.diag(mass)))
    found = replace(found, translation=mixed[:, :3], rotation=mixed[:, 3:])
    if free == 6:
        turn = parts[-1, 3:].T
    else:  # of the line to the node before
        along = X[-1] - X[-2]
        turn = np.cross(along, (Phi[-1] - Phi[-2]).T) / (along @ along)
    section = Section(X[-1], Phi[-1].T, turn, np.zeros((m, m, 3)))
    return FlexibleLink(found, np.sqrt(np.diag(stiffness) / np.diag(mass)), section, X, Phi)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ReducedModel(Frozen, Value):
    """Reduced finite elements: diagonal ``M, K`` (r, r), the mass of each mode 1.

    ``shapes`` (c, r) are orthogonal, ``frequencies`` (r,) ascending, rad/s.
    """

    M: Array
    K: Array
    shapes: Array
    frequencies: Array


def craig_bampton(
    M: ArrayLike, K: ArrayLike, interface: ArrayLike, modes: int, clamped: ArrayLike = ()
) -> ReducedModel:
    """Reduction of finite elements to an interface and modes with the interface held.

    Its shapes are the static ones of unit displacements of the interface and the first modes,
    made orthogonal.
    """
    from scipy.linalg import LinAlgError, eigh

    c = len(np.atleast_1d(as_floats(M, "M")))
    M, K = _symmetric(M, c, "M"), _symmetric(K, c, "K")
    chosen = [as_floats(x, name) for x, name in ((interface, "interface"), (clamped, "clamped"))]
    named = np.concatenate([x.ravel() for x in chosen])
    if len(set(named)) != len(named) or not np.isin(named, np.arange(c)).all():
        raise InvalidValueError(
            f"interface, clamped: expected different numbers below {c}, got {named.tolist()}."
        )
    k = chosen[0].ravel().astype(np.int64)
    inner = np.setdiff1d(np.arange(c), named.astype(np.int64))
    modes = as_count(modes, "modes", 0, len(inner))
    T = np.zeros((c, len(k) + modes))
    T[k, np.arange(len(k))] = 1.0
    try:
        if len(inner):
            inside = np.ix_(inner, inner)
            T[inner, : len(k)] = -np.linalg.solve(K[inside], K[np.ix_(inner, k)])
            T[inner, len(k) :] = eigh(K[inside], M[inside])[1][:, :modes]
        values, V = eigh(T.T @ K @ T, T.T @ M @ T)
    except LinAlgError:
        raise InvalidValueError(
            "M, K: singular mass or stiffness where the interface is held; clamp the body."
        ) from None
    values = np.maximum(values, 0.0)
    return ReducedModel(np.eye(len(values)), np.diag(values), T @ V, np.sqrt(values))


def _symmetric(value: ArrayLike, c: int, name: str) -> Array:
    """A symmetric matrix."""
    matrix = as_exact(value, (c, c), name)
    if np.abs(matrix - matrix.T).max(initial=0.0) > 1e-9 * np.abs(matrix).max(initial=0.0):
        raise InvalidValueError(f"{name}: expected a symmetric matrix.")
    return 0.5 * (matrix + matrix.T)
