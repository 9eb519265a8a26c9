"""Direct dynamics of robots whose joints mimic others: ``q = K q_c + q_0`` with a singular K.

With G the columns of K that are not zero, ``v = G v_c``, and what holds the joints together does
no work: ``G^T (M G a_c + h - tau) = 0`` (seed book section 1.2.1, last note, and 1.5.1).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .._arrays import Array, batch_rows
from ..drive import Transmission
from ..errors import InvalidValueError
from ..model import RobotModel
from .definite import is_definite, no_answer, unit_diagonal
from .mass import mass_matrix
from .rigid import rigid_torques

_CHUNK = 1024  # mass matrices held at a time
_ROUNDING = 1e-9


@lru_cache(maxsize=32)
def free_motion(transmission: Transmission) -> Array | None:
    """Joint velocities per free coordinate, shape (n, m); None if all joints are free."""
    if transmission.is_invertible:
        return None
    if not transmission.is_mimicry:
        n, rank = transmission.n, transmission.rank
        raise InvalidValueError(
            f"transmission: the coupling matrix K is singular, it has rank {rank} of {n}, so that "
            "motor torques do not determine how the joints move. Correct it, or take it away: "
            "model.with_transmission(None). Joints that mimic others are rows of a matrix whose "
            "columns of their own motors are zero, as RobotModel.from_urdf(..., mimic=True) makes."
        )
    G = transmission.free
    return G / np.linalg.norm(G, axis=0)


def check_follows(model: RobotModel, free: Array, q: Array, v: Array) -> None:
    """Refuse positions and velocities in which mimic joints do not follow their masters.

    Shapes: free (n, m); q, v (..., n).
    """
    K = model.transmission
    offset = np.zeros(model.n) if K is None else K.offset
    for name, values in (("q", q - offset), ("v", v)):
        away = np.abs(values - values @ np.linalg.pinv(free).T @ free.T)
        size = 1.0 + np.abs(values).max(axis=-1, initial=0.0, keepdims=True)
        if (away > _ROUNDING * size).any():
            j = int(np.argmax(away.reshape(-1, model.n).max(axis=0)))
            shift = "" if name == "q" else " - transmission.offset"
            raise InvalidValueError(
                f"{name}: the joints of {model.name!r} that mimic others do not follow them here "
                f"(joint {j + 1} is off by {away[..., j].max():.3g}). Take "
                f"{name} = model.transmission.to_joint({name}_c){shift} of the encoder variables, "
                "or model.with_transmission(None) to let all joints move independently."
            )


def following_accelerations(
    model: RobotModel, free: Array, q: Array, v: Array, tau: Array, drive: bool
) -> Array:
    """Joint accelerations with mimic joints.

    Shapes: free (n, m); q, v, tau (..., n) -> (..., n).
    """
    batch, rows = batch_rows((q, v, tau), ("q", "v", "tau"))
    N = rows[0].shape[0]
    out = np.empty((N, model.n))
    for start in range(0, N, _CHUNK):
        piece = slice(start, start + _CHUNK)
        x, dx, load = (array[piece] for array in rows)
        rest = (load - rigid_torques(model, x, dx, np.zeros_like(x))) @ free
        A = free.T @ mass_matrix(model, x, drive) @ free
        for i, matrix in enumerate(A):
            scaled, size = unit_diagonal(matrix)
            if not is_definite(scaled):
                where = f" (first in sample {start + i} of {N})" if batch else ""
                raise no_answer(model, matrix, drive, where, free)
            out[start + i] = free @ (np.linalg.solve(scaled, rest[i] / size) / size)
    return out.reshape(*batch, model.n)
