"""Every posture of a general six-joint arm, up to 16, by Raghavan and Roth's elimination.

The method needs no special axes, and is the worse the more special they are: with a spherical
wrist or three parallel axes its equations become dependent. Pieper's and Paul's methods serve
those arms; `GeneralSolver.reliable` says whether this one may.

Which of the joints plays which part in the elimination is free: any joint may be the one that
drops out, its two neighbours to one side the pair that is eliminated linearly, and of the other
three an outer one gives the eigenvalues. That makes 24 representations of one robot, equal in
theory and far from it in rounding. `prepare_general` tries them all on random postures and keeps
the best ones.

References
----------
M. Raghavan and B. Roth, "Inverse kinematics of the general 6R manipulator and related linkages",
J. Mechanical Design 115(3):502-508, 1993.
D. Manocha and J. F. Canny, "Efficient inverse kinematics for general 6R manipulators", IEEE
Trans. Robotics and Automation 10(5):648-657, 1994.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, read_only
from .check import checked
from .loop import JointChain
from .solver import Found, Tolerances, postures

__all__ = [
    "GeneralArm",
    "GeneralSolver",
    "Representation",
    "general_postures",
    "on_infinite_family",
    "prepare_general",
]

MOST = 16  # postures a six-joint arm can have at one pose
ROOM = 48  # rows while solving: an infinite family takes any number, and must leave some
CHUNK = 256  # poses worked on at a time: 2 MB of equations
TOLERANCE = 1e-13  # residual of a posture [m, or the arm's length if that is more; rad]
POOR = 1e-9  # quality of the elimination below which another representation is asked as well
WAYS = 12  # representations kept
ASIDE = 16  # poses nearby that are solved where doubts are left
FALLS = 100  # starts from anywhere where doubts are left
ROUGH = 1e-4  # way that polishing moved a posture above which it is asked as well [rad]


@dataclass(frozen=True, slots=True, eq=False)
class Representation:
    """One of the 24 ways to write the loop of six joints for the elimination.

    Parameters
    ----------
    joints : ndarray of int, shape (6,)
        Joint of the arm at each place of the loop: two that are eliminated linearly, one that
        gives the eigenvalues, two in the eigenvectors, one that drops out.
    kinds : ndarray of int, shape (6,)
        Their types, 0 revolute, 1 prismatic.
    direction : int
        1 from the base to the tool, -1 the other way round.
    links : ndarray, shape (6, 4, 4)
        Constants after each joint, lengths in `GeneralSolver.unit`.
    closing : int
        Place of the link that closes the loop through the pose.
    swapped : bool
        Whether the fifth joint of the loop takes the half angles, instead of the fourth.
    """

    joints: NDArray[np.int64]
    kinds: NDArray[np.int64]
    direction: int
    links: Array
    closing: int
    swapped: bool


@dataclass(frozen=True, slots=True, eq=False)
class GeneralSolver:
    """What `general_postures` needs to know of an arm, and how well the method suits it.

    Parameters
    ----------
    sigma : ndarray of int, shape (6,)
        0 revolute, 1 prismatic.
    D : ndarray, shape (7, 4, 4)
        Constants of the chain, lengths in ``unit``.
    unit : float
        Length by which lengths are divided [m].
    representations : tuple of Representation
        The first is used for every pose, the others in turn where doubts are left.
    conditioning : float
        How far rounding had moved the roots of the first representation before they were
        polished, 90 of 100 in the self-test [rad]. 1e-11 or so for a general arm.
    tested : int
        Poses of the self-test.
    doubts : int
        How many of them the first representation did not settle alone. Few for a general arm;
        most for one with a spherical wrist or three parallel axes.
    misses : int
        How many did not give back the posture they came from.
    odd : int
        How many had an odd number of postures, which a missing one explains.
    """

    sigma: NDArray[np.int64]
    D: Array
    unit: float
    representations: tuple[Representation, ...]
    conditioning: float
    tested: int
    doubts: int
    misses: int
    odd: int

    @property
    def reliable(self) -> bool:
        """Whether the self-test found every posture, and most at the first attempt."""
        return self.misses == 0 and 4 * self.doubts <= self.tested and self.conditioning < 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class GeneralArm:
    """A six-joint arm that the elimination serves well.

    Parameters
    ----------
    chain : JointChain
        The arm.
    solver : GeneralSolver
        The representations that were chosen for it.
    """

    chain: JointChain
    solver: GeneralSolver

    @property
    def method(self) -> str:
        """The family in words."""
        return "any six joints: elimination to 16 postures (Raghavan and Roth)"


@postures.register
def _(solver: GeneralArm, U: Array, references: Array, tolerances: Tolerances) -> Found:
    from .self_motion import singular_postures  # which needs `shortened` from here

    q, valid, double = general_postures(solver.solver, U)
    found = checked(solver.chain, U, q, valid, tolerances, double=double)
    found.family[...] = singular_postures(solver.chain, found)[1]
    return found


def prepare_general(
    chain: JointChain, tests: int = 48, rng: np.random.Generator | int | None = 0
) -> GeneralSolver | None:
    """Choose the best representations of a six-joint arm and test them on random postures.

    Parameters
    ----------
    chain : JointChain
        The arm.
    tests : int
        Random postures of the self-test.
    rng : Generator or int
        Source of the random postures.

    Returns
    -------
    GeneralSolver or None
        None where the method does not apply: other than six joints, more than one of them
        prismatic (the equations are dependent with two), or an arm without any posture found.

    Examples
    --------
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.robots import load
    >>> prepare_general(joint_chain(load("crx10ia"))).misses
    0
    >>> prepare_general(joint_chain(load("lab_rrt"))) is None
    True
    """
    if chain.k != 6 or int(np.sum(chain.sigma == 1)) > 1:
        return None
    rng = np.random.default_rng(rng)
    D, unit = shortened(chain)
    sigma = read_only(chain.sigma, np.int64)
    candidates = _representations(sigma, D)
    few, many = _random_goals(sigma, D, 8, rng), _random_goals(sigma, D, tests, rng)
    ranked = _ranked(sigma, D, unit, candidates, few[1])
    if not ranked:
        return None
    solver = GeneralSolver(sigma, read_only(D), unit, ranked, np.inf, 0, 0, 0, 0)
    q, goals = many
    doubt, moved = _one_way(solver, solver.representations[0], goals, _Found(tests))
    found = _solve(solver, goals)
    lost = _nearest(sigma, q, found) > 1e-5
    odd = (found.count + np.sum(found.double, axis=1)) % 2 == 1
    return GeneralSolver(
        sigma=sigma,
        D=read_only(D),
        unit=unit,
        representations=ranked,
        conditioning=float(np.sort(moved)[(9 * tests) // 10]),
        tested=tests,
        doubts=int(np.sum(doubt)),
        misses=int(np.sum(lost)),
        odd=int(np.sum(odd)),
    )


def general_postures(
    solver: GeneralSolver, U: ArrayLike
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """All real postures of a six-joint arm.

    Parameters
    ----------
    solver : GeneralSolver
        From `prepare_general`.
    U : array_like, shape (N, 4, 4)
        Poses of the tool in the base, ``U = D_0 M_1 D_1 ... M_6 D_6`` [m].

    Returns
    -------
    q : ndarray, shape (N, 16, 6)
        Postures, packed, angles in (-pi, pi] [rad or m]; NaN in the rows without one.
    valid : ndarray of bool, shape (N, 16)
        Rows that hold a posture. Each meets its pose to 1e-13 m and rad, beside infinite families
        to 1e-12.
    double : ndarray of bool, shape (N, 16)
        Rows that hold two postures merged to less than 1e-6.

    Examples
    --------
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> model = load("crx10ia")
    >>> solver = prepare_general(joint_chain(model))
    >>> T = dgm(model, [[0.3, -0.2, 0.5, 1.0, -0.7, 0.4]])
    >>> q, valid, double = general_postures(solver, T)
    >>> int(valid.sum()) % 2, bool(double.any())
    (0, False)
    """
    goals = np.array(U, dtype=np.float64, order="C")
    goals[:, :3, 3] /= solver.unit
    N = goals.shape[0]
    q = np.full((N, MOST, 6), np.nan)
    valid = np.zeros((N, MOST), np.bool_)
    double = np.zeros((N, MOST), np.bool_)
    for first in range(0, N, CHUNK):
        rows = slice(first, first + CHUNK)
        found = _solve(solver, goals[rows])
        _shorten(solver, found)
        there = found.there[:, :MOST]
        valid[rows], double[rows] = there, found.double[:, :MOST] & there
        q[rows][there] = found.q[:, :MOST][there]
    q[:, :, solver.sigma == 1] *= solver.unit
    return q, valid, double


def on_infinite_family(
    solver: GeneralSolver, q: Array, valid: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Whether postures belong to an infinite family: the arm moves and the tool does not.

    There `general_postures` returns some members of the family, as many as it came upon.

    Parameters
    ----------
    solver : GeneralSolver
        From `prepare_general`.
    q : ndarray, shape (N, 16, 6)
        Postures from `general_postures` [rad or m].
    valid : ndarray of bool, shape (N, 16)
        Rows that hold one.

    Returns
    -------
    ndarray of bool, shape (N, 16)
        Rows at which the Jacobian is singular and, to first order, stays so along its null
        direction.

    Examples
    --------
    Joint 3 of the CRX at -90 degrees brings four of its axes together.

    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> model = load("crx10ia")
    >>> solver = prepare_general(joint_chain(model))
    >>> T = dgm(model, [[0.3, -0.2, -np.pi / 2, 1.0, -0.7, 0.4]])
    >>> q, valid, _ = general_postures(solver, T)
    >>> bool(on_infinite_family(solver, q, valid).any())
    True
    """
    from . import _general_kernels as kernels

    found = np.where(valid[..., None], q, 0.0)
    found[:, :, solver.sigma == 1] /= solver.unit
    flat = np.zeros(valid.shape, np.bool_)
    kernels.flat_singularities(solver.sigma, solver.D, found, np.sum(valid, axis=1), flat)
    return flat


# --- the loop and its 24 representations ---------------------------------------------------------


def _inverse(T: Array) -> Array:
    """Inverse of transforms, shape (..., 4, 4)."""
    out = np.zeros_like(T)
    R = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, :3] = R
    out[..., :3, 3] = -(R @ T[..., :3, 3, None])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def shortened(chain: JointChain) -> tuple[Array, float]:
    """Constants with each frame slid along its axis towards its neighbours, in units of the arm.

    Sliding changes nothing (motions commute with it for revolute joints; for prismatic ones too)
    but keeps the numbers small where a table put frames far out, at nearly parallel axes.

    Parameters
    ----------
    chain : JointChain
        Any number of joints.

    Returns
    -------
    D : ndarray, shape (k + 1, 4, 4)
        Constants of a chain with the same poses at the same joint values, lengths in ``unit``.
    unit : float
        About the length of the arm [m].

    Examples
    --------
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.robots import load
    >>> round(shortened(joint_chain(load("rx90")))[1], 3)
    0.45
    """
    D, k = np.array(chain.D), chain.k
    for forward in (True, False):
        for i in range(1, k) if forward else range(k - 1, 0, -1):
            # joint frame i + 1 slides when going out, joint frame i when coming back
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
    if unit < 1e-9:
        unit = 1.0
    D[:, :3, 3] /= unit
    return D, unit


def _representations(sigma: NDArray[np.int64], D: Array) -> list[Representation]:
    """The 24 ways to write the loop, without those that put a prismatic joint where none may be."""
    found = []
    inverse = _inverse(D)
    for direction in (1, -1):
        for start in range(6):
            joints = (start + direction * np.arange(6)) % 6
            kinds = sigma[joints]
            # the eigenvalue is an angle, and only a revolute joint leaves a line in place
            if kinds[2] == 1 or kinds[5] == 1:
                continue
            # the link after a joint; where the loop closes it is replaced pose by pose
            links = np.array([D[j + 1] if direction == 1 else inverse[j] for j in joints])
            closing = int(np.flatnonzero(joints == (5 if direction == 1 else 0))[0])
            found += [
                Representation(
                    joints=read_only(joints, np.int64),
                    kinds=read_only(kinds, np.int64),
                    direction=direction,
                    links=read_only(links),
                    closing=closing,
                    swapped=swapped,
                )
                for swapped in (False, True)
            ]
    return found


def _closings(D: Array, direction: int, goals: Array) -> Array:
    """The links that close the loop through the poses, shape (N, 4, 4)."""
    if direction == 1:
        return np.ascontiguousarray(D[6] @ _inverse(goals) @ D[0])
    return np.ascontiguousarray(_inverse(D[0]) @ goals @ _inverse(D[6]))


# --- solving ------------------------------------------------------------------------------------


class _Found:
    """Postures of N poses as they are gathered: q (N, 48, 6), count (N,), double (N, 48)."""

    def __init__(self, N: int) -> None:
        self.q = np.zeros((N, ROOM, 6))
        self.count = np.zeros(N, np.int64)
        self.double = np.zeros((N, ROOM), np.bool_)

    @property
    def there(self) -> NDArray[np.bool_]:
        """Rows in use, shape (N, 48)."""
        return np.arange(ROOM) < self.count[:, None]

    def rows(self, chosen: NDArray[np.int64]) -> _Found:
        """A copy of some poses."""
        part = _Found(0)
        part.q, part.count = self.q[chosen], self.count[chosen]
        part.double = self.double[chosen]
        return part

    def put(self, chosen: NDArray[np.int64], part: _Found) -> None:
        """Write poses back."""
        self.q[chosen], self.count[chosen] = part.q, part.count
        self.double[chosen] = part.double


def _tolerance(unit: float) -> Array:
    """Residuals up to which a pose is met: in units of the arm, and rad."""
    return np.array([TOLERANCE / min(unit, 1.0), TOLERANCE])


def _one_way(
    solver: GeneralSolver, way: Representation, goals: Array, found: _Found
) -> tuple[NDArray[np.bool_], Array]:
    """Add the postures one representation finds; whether doubts remain, and its errors (N,)."""
    from . import _general_kernels as kernels

    N = goals.shape[0]
    M, P, Q = np.empty((N, 16, 16)), np.empty((N, 14, 27)), np.empty((N, 8, 8))
    order, angle, quality = np.empty((N, 8), np.int64), np.empty(N), np.empty(N)
    report = np.empty((N, 2))
    closings = _closings(solver.D, way.direction, goals)
    how = (way.closing, closings, int(way.swapped))
    kernels.assemble(way.kinds, way.links, *how, M, P, Q, order, angle, quality)
    failed = ~np.all(np.isfinite(M), axis=(1, 2))
    M[failed] = 0.0
    eigenvalues = np.linalg.eigvals(M).astype(np.complex128)
    eigenvalues[failed] = 1j
    kernels.postures(
        solver.sigma,
        solver.D,
        goals,
        _tolerance(solver.unit),
        way.kinds,
        way.joints,
        float(way.direction),
        way.links,
        *how,
        eigenvalues,
        P,
        Q,
        order,
        angle,
        found.q,
        found.count,
        report,
    )
    kernels.partners(
        solver.sigma, solver.D, goals, _tolerance(solver.unit), found.q, found.count, found.double
    )
    total = found.count + np.sum(found.double & found.there, axis=1)
    doubt = (total % 2 == 1) | (total != report[:, 0]) | (quality < POOR) | (report[:, 1] > ROUGH)
    return doubt | failed, report[:, 1]


def _nearby(goals: Array, k: int) -> Array:
    """The poses a little aside: k = 0, 1 one way and back, k = 2, 3 another, and so on."""
    rng = np.random.default_rng(k // 2)
    size = (3e-3, 3e-4, 1e-3)[(k // 2) % 3] * (1 if k % 2 == 0 else -1)
    half = 0.5 * size * rng.normal(size=3)
    # Cayley's formula gives a rotation exactly
    S = np.array([[0, -half[2], half[1]], [half[2], 0, -half[0]], [-half[1], half[0], 0]])
    aside = goals.copy()
    aside[:, :3, :3] = np.linalg.solve(np.eye(3) - S, np.eye(3) + S) @ goals[:, :3, :3]
    aside[:, :3, 3] += size * rng.normal(size=3)
    return aside


def _solve(solver: GeneralSolver, goals: Array) -> _Found:
    """Postures of poses in units of the arm."""
    from . import _general_kernels as kernels

    found = _Found(goals.shape[0])
    doubt, _ = _one_way(solver, solver.representations[0], goals, found)
    for way in solver.representations[1:]:
        chosen = np.flatnonzero(doubt)
        if chosen.size == 0:
            break
        part = found.rows(chosen)
        doubt[chosen] = _one_way(solver, way, goals[chosen], part)[0]
        found.put(chosen, part)
    chosen = np.flatnonzero(doubt & (found.count != MOST))
    if chosen.size:
        # Where roots merge the equations lose digits, or all meaning; a little aside they do not.
        # A pair that is complex on one side of a fold is real on the other, so both are tried.
        # Beside an infinite family what is found aside leads into a valley to be searched.
        part, goals = found.rows(chosen), goals[chosen]
        arm = (solver.sigma, solver.D, goals, _tolerance(solver.unit))
        for k in range(ASIDE):
            aside = _Found(chosen.size)
            _one_way(solver, solver.representations[0], _nearby(goals, k), aside)
            kernels.bring_home(*arm, aside.q, aside.count, part.q, part.count)
            kernels.follow_valleys(*arm, aside.q, aside.count, part.q, part.count)
        kernels.follow_valleys(*arm, part.q.copy(), part.count.copy(), part.q, part.count)
        starts = np.random.default_rng(0).uniform(-np.pi, np.pi, (FALLS, 6))
        starts[:, solver.sigma == 1] /= np.pi
        valleys, number = np.empty((chosen.size, FALLS, 6)), np.zeros(chosen.size, np.int64)
        kernels.fall_into_valleys(*arm[:3], starts, valleys, number)
        kernels.follow_valleys(*arm, valleys, number, part.q, part.count)
        kernels.partners(*arm, part.q, part.count, part.double)
        found.put(chosen, part)
    found.double &= found.there
    return found


def _shorten(solver: GeneralSolver, found: _Found) -> None:
    """Where there are more rows than postures can be, members of infinite families go first."""
    from . import _general_kernels as kernels

    chosen = np.flatnonzero(found.count > MOST)
    if chosen.size == 0:
        return
    part = found.rows(chosen)
    flat = np.zeros((chosen.size, ROOM), np.bool_)
    kernels.flat_singularities(solver.sigma, solver.D, part.q, part.count, flat)
    order = np.argsort(np.where(part.there, flat, 2), axis=1, kind="stable")
    part.q = np.take_along_axis(part.q, order[..., None], axis=1)
    part.double = np.take_along_axis(part.double, order, axis=1)
    part.count = np.minimum(part.count, MOST)
    found.put(chosen, part)


# --- choosing -----------------------------------------------------------------------------------


def _random_goals(
    sigma: NDArray[np.int64], D: Array, N: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Random postures ``(N, 6)`` and their poses ``(N, 4, 4)``, in units of the arm."""
    q = np.where(sigma == 1, rng.uniform(-1.0, 1.0, (N, 6)), rng.uniform(-np.pi, np.pi, (N, 6)))
    T = np.broadcast_to(D[0], (N, 4, 4))
    for k in range(6):
        M = np.broadcast_to(np.eye(4), (N, 4, 4)).copy()
        if sigma[k] == 1:
            M[:, 2, 3] = q[:, k]
        else:
            c, s = np.cos(q[:, k]), np.sin(q[:, k])
            M[:, 0, 0], M[:, 0, 1], M[:, 1, 0], M[:, 1, 1] = c, -s, s, c
        T = T @ M @ D[k + 1]
    return q, np.ascontiguousarray(T)


def _nearest(sigma: NDArray[np.int64], q: Array, found: _Found) -> Array:
    """Distance from ``q (N, 6)`` to the nearest posture found, shape (N,); inf without any."""
    d = np.abs(found.q - q[:, None, :])
    d = np.where(sigma == 0, np.abs(d - 2 * np.pi * np.round(d / (2 * np.pi))), d).max(axis=2)
    return np.min(np.where(found.there, d, np.inf), axis=1)


def _ranked(
    sigma: NDArray[np.int64],
    D: Array,
    unit: float,
    candidates: list[Representation],
    goals: Array,
) -> tuple[Representation, ...]:
    """The best representations first, by postures missed and by the errors before polishing.

    What each finds at a few poses is compared with what all of them find together.
    """
    N = goals.shape[0]
    solver = GeneralSolver(sigma, D, unit, tuple(candidates), np.inf, 0, 0, 0, 0)
    union, counts, errors = _Found(N), [], []
    for way in candidates:
        alone = _Found(N)
        _, moved = _one_way(solver, way, goals, alone)
        _one_way(solver, way, goals, union)
        counts.append(int(alone.count.sum()))
        errors.append(np.sort(np.minimum(moved, 10.0)))
    most = int(union.count.sum())
    if most == 0:
        return ()
    # a posture missed weighs more than any error; 1e-16 keeps the logarithm finite
    score = np.array(
        [
            100.0 * (most - count) + float(np.mean(np.log10(error + 1e-16)))
            for count, error in zip(counts, errors, strict=True)
        ]
    )
    first = int(np.argmin(score))
    # a second opinion from another joint's eigenvalues doubts other poses: worth two digits
    same = np.array([way.joints[2] == candidates[first].joints[2] for way in candidates])
    score += 2.0 * same
    score[first] = -np.inf
    return tuple(candidates[i] for i in np.argsort(score, kind="stable")[:WAYS])
