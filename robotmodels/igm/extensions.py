"""Where virtual joints may stand so that an arm of fewer than six joints has a closed form.

Six joints have one if three consecutive revolute axes meet in a point or are parallel. The three
may be virtual (a wrist at a point of any link), or one or two of them real: two virtual axes
through a point of a real one, one through the crossing of two real ones or parallel to them. What
is then still short of six stands anywhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from .. import se3
from .._arrays import Array
from .loop import JointChain
from .structure import ANGLE_TOLERANCE, LENGTH_TOLERANCE
from .virtual import VirtualJoint

TRIES = 3
"""Random placings of each layout."""

_ONTO_X, _ONTO_Y = se3.rotation("y", np.pi / 2), se3.rotation("x", -np.pi / 2)


class Triple(Enum):
    """What the family of the extended arm is built on."""

    MEETING = auto()
    PARALLEL = auto()
    ANY = auto()


class Layout(NamedTuple):
    """One way to place the virtual joints."""

    triple: Triple
    first: int
    real: int
    behind: int
    seed: int
    joints: tuple[VirtualJoint, ...]


def layouts(chain: JointChain, length: float) -> Iterator[Layout]:
    """Random virtual joints that give a chain of one to five joints a closed form."""
    for real in range(4):
        for first in range(chain.k + 1 if real == 0 else chain.k - real + 1):
            # with its virtual joints before, amid or behind the run
            places = range(real + 1) if real == 2 else (0, real) if real == 1 else (0,)
            for triple in (Triple.MEETING, Triple.PARALLEL):
                for behind in places:
                    for seed in range(TRIES):
                        layout = _placed(chain, length, triple, first, real, behind, seed)
                        if layout is not None:
                            yield layout


def loose_layouts(chain: JointChain, length: float, sigma: int) -> Iterator[Layout]:
    """Random virtual joints without regard to a closed form."""
    for gap in range(chain.k + 1):
        for seed in range(TRIES):
            layout = _placed(chain, length, Triple.ANY, gap, 0, sigma, seed)
            if layout is not None:
                yield layout


def layout_like(chain: JointChain, length: float, layout: Layout) -> Layout | None:
    """The same placing for a chain with other constants; None if it has not the same structure."""
    return _placed(chain, length, *layout[:5])


def _placed(
    chain: JointChain,
    length: float,
    triple: Triple,
    first: int,
    real: int,
    behind: int,
    seed: int,
) -> Layout | None:
    """The virtual joints of a layout, None if the real joints do not suit it."""
    rng = np.random.default_rng((seed, first, real, behind))
    missing = 6 - chain.k
    if triple is Triple.ANY:
        loose = tuple(VirtualJoint(first, _anywhere(length, rng), behind) for _ in range(missing))
        return Layout(triple, first, real, behind, seed, loose)
    if 3 - real > missing or chain.sigma[first : first + real].any():
        return None
    if triple is Triple.MEETING:
        point = _meeting_point(chain, first, real)
        if real >= 2 and point is None:
            return None
        block = _meeting_block(chain, first, real, behind, point, length, rng)
    else:
        if real < 2 or chain.sigma.any() or not _are_parallel(chain, first, real):
            return None
        block = _parallel_block(chain, first, real, behind, length, rng)
    slides = triple is Triple.MEETING
    joints = _filled(chain, first, real, behind, block, slides, length, rng)
    return Layout(triple, first, real, behind, seed, joints)


# --- the triple -----------------------------------------------------------------------------------


def _meeting_point(chain: JointChain, first: int, real: int) -> Array | None:
    """Where the axes of a run meet, in the frame of its first joint; None if they do not."""
    if real < 2:
        return None
    crossing = _crossing(chain.D[first + 1])
    if crossing is None or real == 2:
        return crossing
    into = se3.inverse(chain.D[first + 1])
    second = _crossing(chain.D[first + 2])
    if second is None:
        return None
    onwards = into[:3, :3] @ crossing + into[:3, 3]
    return crossing if np.linalg.norm(onwards - second) <= LENGTH_TOLERANCE else None


def _crossing(D: Array) -> Array | None:
    """Point in which the z axis and that of the frame D meet, shape (3,)."""
    direction, origin = D[:3, 2], D[:3, 3]
    across = float(np.hypot(direction[0], direction[1]))
    if across < 1e-6:
        return None
    point = origin - (origin[:2] @ direction[:2]) / across**2 * direction
    return None if np.hypot(point[0], point[1]) > LENGTH_TOLERANCE else np.array([0, 0, point[2]])


def _are_parallel(chain: JointChain, first: int, real: int) -> bool:
    """Whether the axes of a run are parallel and neighbours are apart."""
    for D in chain.D[first + 1 : first + real]:
        if np.hypot(D[0, 2], D[1, 2]) > ANGLE_TOLERANCE:
            return False
        if np.hypot(D[0, 3], D[1, 3]) < LENGTH_TOLERANCE:
            return False
    return True


def _gap(first: int, real: int, behind: int) -> int:
    """Gap in which a triple's virtual joints stand."""
    return first if real == 0 else first + behind


def _seen_from_before(chain: JointChain, first: int, real: int, behind: int) -> Array:
    """Frame of the real joint that the block leans on, in the frame its gap is measured in."""
    if real == 0 or behind > 0:
        return np.eye(4)
    return np.asarray(chain.D[first])


def _meeting_block(
    chain: JointChain,
    first: int,
    real: int,
    behind: int,
    point: Array | None,
    length: float,
    rng: np.random.Generator,
) -> list[VirtualJoint]:
    """Virtual axes through the meeting point, square to their neighbours where they can be."""
    gap = _gap(first, real, behind)
    if real == 3:
        return []
    lean = _seen_from_before(chain, first, real, behind).copy()
    if real == 0:
        lean = _anywhere(length, rng)
        turns = (_ONTO_X, np.eye(4), _ONTO_Y)
    else:
        if point is None:
            centre = np.array([0.0, 0.0, length * rng.uniform(-1.0, 1.0)])
        elif behind == 2:
            into = se3.inverse(chain.D[first + 1])
            centre = into[:3, :3] @ point + into[:3, 3]
        else:
            centre = point
        lean = lean @ se3.translation(*centre) @ se3.rotation("z", rng.uniform(-np.pi, np.pi))
        turns = (_ONTO_X,) if real == 2 else (_ONTO_X, _ONTO_Y)
    return [VirtualJoint(gap, lean @ turn, 0) for turn in turns]


def _parallel_block(
    chain: JointChain,
    first: int,
    real: int,
    behind: int,
    length: float,
    rng: np.random.Generator,
) -> list[VirtualJoint]:
    """A third axis parallel to two, at a distance."""
    if real == 3:
        return []
    lean = _seen_from_before(chain, first, real, behind)
    away = se3.rotation("z", rng.uniform(-np.pi, np.pi)) @ se3.translation(length, 0.0, 0.0)
    return [VirtualJoint(_gap(first, real, behind), lean @ away, 0)]


# --- the rest -------------------------------------------------------------------------------------


def _filled(
    chain: JointChain,
    first: int,
    real: int,
    behind: int,
    block: list[VirtualJoint],
    slides: bool,
    length: float,
    rng: np.random.Generator,
) -> tuple[VirtualJoint, ...]:
    """The block and as many loose joints as are missing, none of them within the triple."""
    gap = _gap(first, real, behind)
    inner = range(first + 1, first + max(real, 1)) if real > 1 else range(0)
    free = [g for g in range(chain.k + 1) if g not in inner]
    before, after = [], []
    for _ in range(6 - chain.k - len(block)):
        sigma = int(slides and rng.random() < 0.3)
        joint = VirtualJoint(int(rng.choice(free)), _anywhere(length, rng), sigma)
        # next to a real joint of the triple the block must stay
        (before if joint.gap < gap or (joint.gap == gap and behind == 0) else after).append(joint)
    return (*before, *block, *after)


def _anywhere(length: float, rng: np.random.Generator) -> Array:
    """A random frame, about a length away."""
    # the columns of a random orthogonal matrix, the last turned so that it is a rotation
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    frame = np.eye(4)
    frame[:3, :3] = R * np.array([1.0, 1.0, np.linalg.det(R)])
    frame[:3, 3] = length * rng.uniform(-1.0, 1.0, 3)
    return frame
