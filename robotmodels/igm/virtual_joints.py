"""Virtual joints that give an arm of fewer than six joints a closed form.

Six joints have one if three consecutive revolute axes meet in a point or are parallel. The three
may be virtual (a wrist at a point of any link), or one or two of them real: two virtual axes
through a point of a real one, one through the crossing of two real ones or parallel to them. Joints
still missing are placed anywhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .. import se3
from .._arrays import Array
from .chain import VirtualJoint
from .loop import JointChain

TRIES = 3
"""Random placements of each kind."""

_ONTO_X, _ONTO_Y = se3.rotation("y", np.pi / 2), se3.rotation("x", -np.pi / 2)


class Placement(NamedTuple):
    """Kind of a placement: run of real joints, whose axes meet or are parallel, and its seed."""

    parallel: bool
    first: int
    real: int
    behind: bool
    seed: int
    structured: bool = True


def placements(k: int) -> Iterator[Placement]:
    """Placements that may give a chain of k joints a closed form."""
    for real in range(min(k, 3) + 1):
        for first in range(k - real + 1):
            for behind in (False, True)[: 2 if real in (1, 2) else 1]:
                for parallel in (False, True)[: 1 + (real >= 2)]:
                    for seed in range(TRIES):
                        yield Placement(parallel, first, real, behind, seed)


def loose_placements(k: int) -> Iterator[Placement]:
    """Placements without regard to a closed form."""
    for gap in range(k + 1):
        for seed in range(TRIES):
            yield Placement(False, gap, 0, False, seed, structured=False)


def virtual_joints(
    chain: JointChain, length: float, placement: Placement
) -> tuple[VirtualJoint, ...] | None:
    """Virtual joints that make six of a chain; None if its real joints do not suit.

    Whether the axes of a run meet or are parallel is left to the closed form that is to serve.
    """
    parallel, first, real, behind, seed, structured = placement
    rng = np.random.default_rng((seed, first, real, behind))
    missing, run = 6 - chain.k, slice(first, first + real)
    if not structured:
        return tuple(VirtualJoint(first, _anywhere(length, rng), 0) for _ in range(missing))
    if 3 - real > missing or chain.sigma[run].any() or (parallel and chain.sigma.any()):
        return None
    gap = first + real * behind
    # frame of a real joint of the run, in the frame of the joint before the gap
    lean = np.eye(4) if behind or real == 0 else np.array(chain.D[first])
    if parallel:
        beside = se3.rotation("z", rng.uniform(-np.pi, np.pi)) @ se3.translation(length, 0.0, 0.0)
        frames = [lean @ beside]
    else:
        # a point of the axis next to the block: that of two axes is where they come closest
        height = length * rng.uniform(-1.0, 1.0)
        if real == 2:
            D = se3.inverse(chain.D[first + 1]) if behind else chain.D[first + 1]
            across = np.maximum(np.hypot(D[0, 2], D[1, 2]) ** 2, 1e-12)
            height = D[2, 3] - D[2, 2] * (D[:2, 3] @ D[:2, 2]) / across
        turned = se3.rotation("z", rng.uniform(-np.pi, np.pi))
        lean = lean @ se3.translation(0.0, 0.0, height) @ turned
        lean = _anywhere(length, rng) if real == 0 else lean
        frames = [lean @ turn for turn in (_ONTO_X, _ONTO_Y, np.eye(4))]
    block = [VirtualJoint(gap, frame, 0) for frame in frames[: 3 - real]]
    before: list[VirtualJoint] = []
    after: list[VirtualJoint] = []
    free = [g for g in range(chain.k + 1) if not first < g < first + real]
    for _ in range(missing - len(block)):
        sigma = int(not parallel and rng.random() < 0.3)
        joint = VirtualJoint(int(rng.choice(free)), _anywhere(length, rng), sigma)
        # the block stays next to the run
        is_before = joint.gap < gap or (joint.gap == gap and not behind)
        (before if is_before else after).append(joint)
    return (*before, *block, *after)


def _anywhere(length: float, rng: np.random.Generator) -> Array:
    """A random frame, about a length away."""
    # the columns of a random orthogonal matrix, the last turned so that it is a rotation
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    frame = np.eye(4)
    frame[:3, :3] = R * np.array([1.0, 1.0, np.linalg.det(R)])
    frame[:3, 3] = length * rng.uniform(-1.0, 1.0, 3)
    return frame
