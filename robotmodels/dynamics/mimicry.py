"""Direct dynamics of robots whose joints mimic others: ``q = K q_c + q_0`` with a singular K.

With G the columns of K that are not zero, ``v = G v_c``, and the forces of the constraint do no
work: ``G^T (M G a_c + h - tau) = 0`` (seed book section 1.2.1, last note, and 1.5.1).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .._arrays import Array, batch_rows
from ..drive import Transmission
from ..errors import InvalidValueError
from ..model import RobotModel
from .inverse import rigid_torques
from .mass_errors import mass_matrix_error, rounding, unit_sizes
from .parts import mass_matrix

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
            "motor torques do not determine the motion. Correct it, or remove it with "
            "model.with_transmission(None). For mimic joints, the columns of their motors are "
            "zero, as RobotModel.from_urdf(..., mimic=True) makes them."
        )
    G = transmission.free
    return G / np.linalg.norm(G, axis=0)


def check_follows(model: RobotModel, free: Array, q: Array, v: Array) -> None:
    """Raise for positions and velocities in which mimic joints do not follow their masters.

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
    batch, (q, v, tau) = batch_rows((q, v, tau), ("q", "v", "tau"))
    rest = (tau - rigid_torques(model, q, v, np.zeros_like(q))) @ free
    M = free.T @ mass_matrix(model, q, drive) @ free
    size = unit_sizes(M)
    scaled = M / (size[:, :, None] * size[:, None, :])
    definite = np.linalg.eigvalsh(scaled)[:, 0] > rounding(free.shape[1])
    for i in np.flatnonzero(~definite)[:1]:
        where = f" (first in sample {i} of {len(q)})" if batch else ""
        raise mass_matrix_error(model, M[i], drive, where, free)
    a_c = np.linalg.solve(scaled, (rest / size)[..., None])[..., 0] / size
    return (a_c @ free.T).reshape(*batch, model.n)
