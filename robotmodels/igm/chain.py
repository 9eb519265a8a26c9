"""Chains made from another one: joints locked, virtual joints added, frames slid together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, read_only
from .loop import JointChain

NO_COLUMN = -1
"""`JointChain.columns` of a virtual joint."""


BESIDE = 4.0
"""Distance along rails, in lengths of the arm, up to which a pose is solved where it is."""


class VirtualJoint(NamedTuple):
    """Virtual joint, zero in every configuration of the arm."""

    gap: int
    frame: Array
    sigma: int


def motion(sigma: int, value: ArrayLike) -> Array:
    """Motion of a joint along or about z, (..., 4, 4)."""
    value = np.asarray(value, dtype=np.float64)
    M = np.zeros((*value.shape, 4, 4))
    M[..., range(4), range(4)] = 1.0
    if sigma == 1:
        M[..., 2, 3] = value
    else:
        c, s = np.cos(value), np.sin(value)
        M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1] = c, -s, s, c
    return M


def locked_chain(chain: JointChain, locks: Mapping[int, float]) -> JointChain:
    """Chain with some joints replaced by constants."""
    kept = [j for j in range(chain.k) if j not in locks]
    constant, D = chain.D[0], []
    for j in range(chain.k):
        if j in locks:
            constant = constant @ motion(int(chain.sigma[j]), locks[j]) @ chain.D[j + 1]
        else:
            D.append(constant)
            constant = chain.D[j + 1]
    return JointChain(
        columns=read_only(chain.columns[kept], np.int64),
        sigma=read_only(chain.sigma[kept], np.int64),
        D=read_only(np.array([*D, constant])),
        base=chain.base,
    )


def without_locked(chain: JointChain, locks: Sequence[tuple[int, float]]) -> JointChain:
    """Chain with joints locked that are given by their columns of the model."""
    values = dict(locks)
    places = {j: values[int(c)] for j, c in enumerate(chain.columns) if int(c) in values}
    return locked_chain(chain, places) if places else chain


def without_end(chain: JointChain, joint: int, values: Array, U: Array) -> tuple[JointChain, Array]:
    """Chain without its first or last joint, and poses (N, 4, 4) moved by values (N,) of it."""
    M = motion(int(chain.sigma[joint]), values)
    if joint == 0:
        middle, poses = slice(1, chain.k), se3.inverse(chain.D[0] @ M) @ U
    else:
        middle, poses = slice(0, chain.k - 1), U @ se3.inverse(M @ chain.D[chain.k])
    rest = JointChain(
        columns=read_only(chain.columns[middle], np.int64),
        sigma=read_only(chain.sigma[middle], np.int64),
        D=read_only(chain.D[middle.start : middle.stop + 1]),
        base=chain.base,
    )
    return rest, np.ascontiguousarray(poses)


def with_virtual_joints(
    chain: JointChain, joints: Sequence[VirtualJoint]
) -> tuple[JointChain, NDArray[np.int64]]:
    """Chain with virtual joints, and the places of the real ones; at zero the tool is as before."""
    columns, sigma, D, places = [], [], [], []
    for gap in range(chain.k + 1):
        if gap > 0:
            places.append(len(sigma))
            columns.append(int(chain.columns[gap - 1]))
            sigma.append(int(chain.sigma[gap - 1]))
        before = np.eye(4)
        for joint in joints:
            if joint.gap == gap:
                D.append(before @ joint.frame)
                before = se3.inverse(joint.frame)
                columns.append(NO_COLUMN)
                sigma.append(joint.sigma)
        D.append(before @ chain.D[gap])
    longer = JointChain(
        columns=read_only(columns, np.int64),
        sigma=read_only(sigma, np.int64),
        D=read_only(np.array(D)),
        base=chain.base,
    )
    return longer, read_only(places, np.int64)


@lru_cache(maxsize=256)
def canonical_frames(chain: JointChain) -> tuple[Array, float]:
    """Constants (k + 1, 4, 4) with frames slid along their axes, in units of the arm; the unit."""
    D, k = np.array(chain.D), chain.k
    for forward in (True, False):
        for i in range(1, k) if forward else range(k - 1, 0, -1):
            # joint frame i + 1 slides on the way out, joint frame i on the way back
            near, far = (i, i + 1) if forward else (i, i - 1)
            z = D[near][:3, 2] if forward else np.array([0.0, 0.0, 1.0])
            slide = float(z @ D[near][:3, 3])
            if forward:
                D[near][:3, 3] -= slide * z
                D[far][2, 3] += slide
            else:
                D[near][2, 3] -= slide
                D[far][:3, 3] += slide * D[far][:3, 2]
    unit = float(np.sum(np.linalg.norm(D[1:k, :3, 3], axis=1))) / 2.0
    unit = unit if unit >= 1e-9 else 1.0
    D[:, :3, 3] /= unit
    return read_only(D), unit


def far_along_rails(chain: JointChain, U: Array) -> tuple[Array, Array]:
    """Values (N, k) of prismatic joints at the base that are far extended, and poses without them.

    Closed forms square lengths: many lengths of the arm away, the squares leave few digits.
    """
    k, moved, poses = chain.k, np.zeros((len(U), chain.k)), U.copy()
    rails = k if np.all(chain.sigma == 1) else int(np.argmin(chain.sigma == 1))
    if rails == 0 or len(U) == 0:
        return moved, poses
    frames = [chain.D[0]]
    for D in chain.D[1:rails]:
        frames.append(frames[-1] @ D)
    axes = np.array([frame[:3, 2] for frame in frames])
    # rails that are nearly parallel share what they have in common, and no more is removed
    away = (U[:, :3, 3] - chain.D[0, :3, 3]) @ np.linalg.pinv(axes, rcond=0.1)
    length = float(np.linalg.norm(chain.D[1:, :3, 3], axis=1).sum()) or 1.0
    far = np.abs(away).max(axis=1) > BESIDE * length
    moved[:, :rails] = np.where(far[:, None], away, 0.0)
    poses[:, :3, 3] -= moved[:, :rails] @ axes
    return moved, poses
