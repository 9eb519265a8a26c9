"""Poses as fixtures: six unknown numbers for each label, position and rotation vector."""

from __future__ import annotations

from typing import Any

import numpy as np

from ... import se3
from ..._arrays import Array, read_only
from .labelled import Labelled
from .measurement import Evaluation, Fixture
from .rotation_vectors import left_jacobians, mean_rotation, rotations_of

POSITION = (0, 1, 2)
SIX = (0, 1, 2, 3, 4, 5)
_NAMES = ("x", "y", "z", "rx", "ry", "rz")


def as_known_pose(value: Any, name: str) -> Array:
    """Check a known pose."""
    return read_only(se3.as_single_pose(value, name))


def pose_fixtures(kind: Labelled, asked: tuple[int, ...]) -> tuple[Fixture, ...]:
    """Unknowns of the poses of a kind of measurement."""
    return tuple(
        Fixture(f"{kind.name}:{label}.{_NAMES[k]}", "m" if k < 3 else "rad")
        for label in kind.unknown
        for k in asked
    )


def labelled_poses(
    kind: Labelled, asked: tuple[int, ...], values: Array, parameters: int
) -> Evaluation:
    """Pose of the label of each block. Shapes: values (F,)."""
    unknown, count = kind.unknown, len(asked)
    six = np.zeros((len(unknown), 6))
    six[:, asked] = values.reshape(len(unknown), count)
    poses = np.tile(np.eye(4), (len(unknown), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotations_of(six[:, 3:]), six[:, :3]
    by_six = np.tile(np.eye(6), (len(unknown), 1, 1))
    by_six[:, 3:, 3:] = left_jacobians(six[:, 3:])
    group = kind.unknown_groups
    psi = np.zeros((kind.blocks, 6, parameters + len(values)))
    for g in range(len(unknown)):
        first = parameters + g * count
        psi[group == g, :, first : first + count] = by_six[g][:, asked]
    place = {**dict(zip(unknown, poses, strict=True)), **kind.known}
    return Evaluation(np.array([place[label] for label in kind.label]), psi)


def guessed_poses(kind: Labelled, asked: tuple[int, ...], T: Array) -> Array:
    """Mean pose of each unknown label. Shapes: T (B, 4, 4) -> (F,)."""
    from scipy.spatial.transform import Rotation

    found = np.zeros((len(kind.unknown), 6))
    group = kind.unknown_groups
    for g in range(len(found)):
        mine = T[group == g]
        found[g, :3] = mine[:, :3, 3].mean(axis=0)
        found[g, 3:] = Rotation.from_matrix(mean_rotation(mine[:, :3, :3])).as_rotvec()
    return found[:, asked].ravel()
