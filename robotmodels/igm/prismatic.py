"""Six joints, two or three of them prismatic, wherever they stand.

Prismatic joints do not turn the tool. With three of them the three revolute joints alone make the
orientation, as a wrist does, and three linear equations give the lengths. With two the four
revolute joints have one motion to spare, and the position leaves one equation for it: what is
missing across both directions of sliding. It is solved as a trigonometric polynomial.

Source: D. L. Pieper, "The kinematics of manipulators under computer control", 1968 (three prismatic
joints).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, read_only
from .check import checked
from .loop import JointChain
from .self_motion import settle_families, singular_postures
from .shortened import shortened
from .solver import Found, Tolerances, postures

__all__ = ["FourRevolute", "PrismaticArm", "prepare_prismatic"]

MOST = 16  # postures of an arm with two prismatic joints, with room to spare
OFFSET = 0.123456789  # of the first sample, away from round angles
SAMPLES = 64  # values of the spare motion at which the polynomial is sampled
NEAR_CIRCLE = 1e-3  # imaginary part of an angle up to which its real part is tried
VANISHES = 1e-12  # size of the polynomial beside its usual one below which all angles solve it
ROUGH = 0.1  # error of a candidate that is still improved [m, rad]
CHUNK = 512


@dataclass(frozen=True, slots=True, eq=False)
class FourRevolute:
    """Decomposition of the orientation of four revolute joints.

    Shapes: joints (4,), rotations (5, 3, 3).
    """

    joints: NDArray[np.int64]
    rotations: Array
    late: int
    power: int
    degree: int


@dataclass(frozen=True, slots=True, eq=False)
class PrismaticArm:
    """Six joints with two or three prismatic ones."""

    chain: JointChain
    four: FourRevolute | None

    @property
    def method(self) -> str:
        """The family in words."""
        if self.four is None:
            return "three prismatic joints: orientation first, then the lengths"
        return "two prismatic joints: orientation with one motion to spare, then the lengths"


def prepare_prismatic(chain: JointChain) -> PrismaticArm | None:
    """Prepare a six-joint arm with two or three prismatic joints."""
    slides = int(np.sum(chain.sigma == 1))
    if chain.k != 6 or slides not in (2, 3):
        return None
    if slides == 3:
        rotations = _constant_rotations(chain, np.flatnonzero(chain.sigma == 0))
        across = np.hypot(rotations[1:3, 0, 2], rotations[1:3, 1, 2])
        return PrismaticArm(chain, None) if across.min() > 1e-9 else None
    four = _plan(chain)
    return None if four is None else PrismaticArm(chain, four)


@postures.register
def _(solver: PrismaticArm, U: Array, references: Array, tolerances: Tolerances) -> Found:
    chain = solver.chain
    if solver.four is None:
        q, there = _with_three(chain, U, references, tolerances)
        found = checked(chain, U, q, there, tolerances)
    else:
        parts = [
            checked(
                chain, U[rows], *_with_two(chain, solver.four, U[rows]), tolerances,
                most=MOST, rough=ROUGH,
            )
            for rows in (slice(start, start + CHUNK) for start in range(0, max(len(U), 1), CHUNK))
        ]  # fmt: skip
        found = _joined(parts)
    found.double[...], found.family[...] = singular_postures(chain, found)
    return settle_families(chain, U, found, references, tolerances)


def _joined(parts: list[Found]) -> Found:
    """Postures of all poses from those of some."""
    return Found(
        q=np.concatenate([part.q for part in parts]),
        valid=np.concatenate([part.valid for part in parts]),
        residual=np.concatenate([part.residual for part in parts]),
        double=np.concatenate([part.double for part in parts]),
        free=np.concatenate([part.free for part in parts]),
        family=np.concatenate([part.family for part in parts]),
    )


def _constant_rotations(chain: JointChain, joints: NDArray[np.int64]) -> Array:
    """Rotations before, between and after some joints, the others at rest."""
    out, R = [], chain.D[0, :3, :3]
    for k in range(6):
        if k in joints:
            out.append(R)
            R = np.eye(3)
        R = R @ chain.D[k + 1, :3, :3]
    return np.ascontiguousarray([*out, R])


def _with_three(
    chain: JointChain, U: Array, references: Array, tolerances: Tolerances
) -> tuple[Array, NDArray[np.bool_]]:
    """Candidates ``(N, 2, 6)`` of an arm with three prismatic joints."""
    from ._prismatic import three_prismatic

    turning = np.flatnonzero(chain.sigma == 0)
    q, counts = np.full((len(U), 2, 6), np.nan), np.zeros(len(U), np.int64)
    three_prismatic(
        np.ascontiguousarray(U), turning, np.flatnonzero(chain.sigma == 1), chain.D,
        _constant_rotations(chain, turning), max(1e-9, tolerances.orientation),
        np.ascontiguousarray(references), q, counts,
    )  # fmt: skip
    return q, np.arange(2) < counts[:, None]


# --- two prismatic joints ------------------------------------------------------------------------


def _plan(chain: JointChain) -> FourRevolute | None:
    """Which pair comes late, and the degree of the polynomial, found on random poses."""
    joints = np.flatnonzero(chain.sigma == 0)
    rotations = _constant_rotations(chain, joints)
    rng = np.random.default_rng(0)
    R = np.linalg.qr(rng.normal(size=(6, 3, 3)))[0]
    poses = np.tile(np.eye(4), (6, 1, 1))
    poses[:, :3, :3] = R * np.linalg.det(R)[:, None, None]
    poses[:, :3, 3] = rng.uniform(-1.0, 1.0, (6, 3))
    D, _ = shortened(chain)
    best: FourRevolute | None = None
    # the late pair is found by a division by the sine of the angle between its axes
    sines = np.hypot(rotations[1:4, 0, 2], rotations[1:4, 1, 2])
    for late in np.argsort(-sines, kind="stable"):
        for power in range(5):
            if sines[late] < 1e-9:
                continue
            four = FourRevolute(
                joints=read_only(joints, np.int64),
                rotations=read_only(rotations),
                late=int(late),
                power=power,
                degree=0,
            )
            size = np.abs(_spectrum(D, chain.sigma, four, poses))
            scale = size.max(axis=1, keepdims=True)
            # no angle of the second early joint, or slides that are always parallel
            if not np.all(scale > VANISHES):
                continue
            high = int(np.flatnonzero(np.any(size > 1e-11 * scale, axis=0))[-1])
            if high < (SAMPLES // 2 - 4 if best is None else best.degree):
                best = replace(four, degree=high)
    return best


def _rotated(c: Array, s: Array, R: Array, transposed: bool = False) -> Array:
    """``Rz R`` for cosines and sines (...), or ``Rz^T R``; R (..., 3, 3)."""
    if transposed:
        s = -s
    first = c[..., None] * R[..., 0, :] - s[..., None] * R[..., 1, :]
    second = s[..., None] * R[..., 0, :] + c[..., None] * R[..., 1, :]
    third = np.broadcast_to(R[..., 2, :], first.shape)
    return np.stack([first, second, third], axis=-2)


def _remaining(
    four: FourRevolute, M: Array, u: tuple[Array, Array], v: tuple[Array, Array]
) -> Array:
    """``W`` of the late pair, from cosines and sines of the early pair; M (..., 3, 3)."""
    R = four.rotations
    A, B, C = R[1], R[2], R[3]
    if four.late == 2:  # Rz(c) C Rz(d) = B^T Rz(b)^T A^T Rz(a)^T M
        return B.T @ _rotated(*v, A.T @ _rotated(*u, M, True), True)
    if four.late == 0:  # Rz(a) A Rz(b) = M Rz(d)^T C^T Rz(c)^T B^T
        inner = C.T @ _rotated(*u, np.broadcast_to(B.T, M.shape), True)
        return M @ _rotated(*v, inner, True)
    # Rz(b) B Rz(c) = A^T Rz(a)^T M Rz(d)^T C^T
    inner = M @ _rotated(*v, np.broadcast_to(C.T, M.shape), True)
    return A.T @ _rotated(*u, inner, True)


def _early(four: FourRevolute) -> tuple[int, int]:
    """The early pair among the four."""
    first, second = (k for k in range(4) if k not in (four.late, four.late + 1))
    return first, second


def _second_early(
    four: FourRevolute, M: Array, u: tuple[Array, Array]
) -> tuple[Array, Array, Array]:
    """``X cos v + Y sin v = Z`` for the second early joint: W and K agree in one element."""
    one, zero = np.ones_like(u[0]), np.zeros_like(u[0])
    at_cos = _remaining(four, M, u, (one, zero))[..., 2, 2]
    at_sin = _remaining(four, M, u, (zero, one))[..., 2, 2]
    back = _remaining(four, M, u, (-one, zero))[..., 2, 2]
    constant = 0.5 * (at_cos + back)
    K = four.rotations[four.late + 1]
    return at_cos - constant, at_sin - constant, K[2, 2] - constant


def _late(four: FourRevolute, W: Array) -> tuple[Array, Array, Array, Array]:
    """Cosine and sine of the late pair from W; polynomials in those of the early pair."""
    K = four.rotations[four.late + 1]
    size = K[0, 2] ** 2 + K[1, 2] ** 2
    return (
        (K[0, 2] * W[..., 0, 2] + K[1, 2] * W[..., 1, 2]) / size,
        (K[0, 2] * W[..., 1, 2] - K[1, 2] * W[..., 0, 2]) / size,
        (K[2, 0] * W[..., 2, 0] + K[2, 1] * W[..., 2, 1]) / size,
        (K[2, 1] * W[..., 2, 0] - K[2, 0] * W[..., 2, 1]) / size,
    )


def _slides(
    D: Array, sigma: NDArray[np.int64], c: Array, s: Array, U: Array
) -> tuple[Array, Array, Array]:
    """Directions of both slides and the position missing with both at 0, each (..., 3).

    Cosines and sines ``(..., 6)`` may be complex.
    """
    shape = c.shape[:-1]
    R = np.broadcast_to(D[0, :3, :3].astype(c.dtype), (*shape, 3, 3))
    p = np.broadcast_to(D[0, :3, 3].astype(c.dtype), (*shape, 3))
    directions = []
    for k in range(6):
        if sigma[k] == 1:
            directions.append(R[..., :, 2])
        else:
            x = c[..., k, None] * R[..., :, 0] + s[..., k, None] * R[..., :, 1]
            y = c[..., k, None] * R[..., :, 1] - s[..., k, None] * R[..., :, 0]
            R = np.stack([x, y, R[..., :, 2]], axis=-1)
        p = p + R @ D[k + 1, :3, 3]
        R = R @ D[k + 1, :3, :3]
    return directions[0], directions[1], U[..., :3, 3] - p


def _all_joints(
    four: FourRevolute, M: Array, u: tuple[Array, Array], v: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Cosines and sines of all six joints, 1 and 0 at the prismatic ones, shape (..., 6)."""
    first, second = _early(four)
    x = _late(four, _remaining(four, M, u, v))
    c, s = np.ones((*u[0].shape, 6), v[0].dtype), np.zeros((*u[0].shape, 6), v[0].dtype)
    pairs = ((first, u), (second, v), (four.late, x[:2]), (four.late + 1, x[2:]))
    for place, (cosine, sine) in pairs:
        c[..., four.joints[place]], s[..., four.joints[place]] = cosine, sine
    return c, s


def _spectrum(
    D: Array, sigma: NDArray[np.int64], four: FourRevolute, U: Array
) -> NDArray[np.complex128]:
    """Coefficients of exp(i m u), m = 0 ... SAMPLES/2, of the polynomial in the spare motion.

    The second early joint has two angles for each u, complex ones where they are not real. The
    product over both of what is missing across the slides has no root left in it.
    """
    # an offset keeps the samples away from round angles, at which denominators vanish
    u = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES + OFFSET
    cu, su = np.broadcast_arrays(np.cos(u), np.ones((len(U), 1)))[0], np.sin(u)
    su = np.broadcast_to(su, cu.shape)
    M = four.rotations[0].T @ U[:, :3, :3] @ four.rotations[4].T
    M = np.broadcast_to(M[:, None], (*cu.shape, 3, 3))
    X, Y, Z = _second_early(four, M, (cu, su))
    amplitude = X * X + Y * Y
    root = np.sqrt((Z * Z - amplitude).astype(np.complex128))
    total = (amplitude**four.power).astype(np.complex128)
    for way in (root, -root):
        with np.errstate(divide="ignore", invalid="ignore"):
            E = (Z + way) / (X - 1j * Y)
            v: Any = 0.5 * (E + 1.0 / E), -0.5j * (E - 1.0 / E)  # complex where no angle is real
        a, b, missing = _slides(D, sigma, *_all_joints(four, M, (cu, su), v), U[:, None])
        total *= np.sum(np.cross(a, b) * missing, axis=-1)
    # real for real u: conjugate ways swap
    waves = np.fft.rfft(total.real, axis=-1) / SAMPLES
    return np.asarray(waves * np.exp(-1j * OFFSET * np.arange(SAMPLES // 2 + 1)), np.complex128)


def _with_two(chain: JointChain, four: FourRevolute, U: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Candidates of an arm with two prismatic joints, two for each angle of the first early one."""
    D, unit = shortened(chain)
    goals = U.copy()
    goals[:, :3, 3] /= unit
    N, n = len(U), four.degree
    if N == 0:
        return np.empty((0, 4 * n, 6)), np.empty((0, 4 * n), np.bool_)
    waves = _spectrum(D, chain.sigma, four, goals)[:, : n + 1]
    size = np.abs(waves).max(axis=1)
    # the usual size: slides square to each other, a position missing by the size of the arm
    everywhere = size <= VANISHES * (1.0 + np.linalg.norm(goals[:, :3, 3], axis=1)) ** 2
    count = SAMPLES if everywhere.any() else 2 * n
    u = np.zeros((N, count))
    there = np.zeros((N, count), np.bool_)
    u[everywhere] = 2.0 * np.pi * np.arange(count) / count
    there[everywhere] = True
    regular = np.flatnonzero(~everywhere)
    if regular.size:
        # c_-n ... c_n of exp(i m u), the lowest power first
        poly = np.concatenate([np.conj(waves[regular, :0:-1]), waves[regular]], axis=1)
        u[regular, : 2 * n], there[regular, : 2 * n] = _angles(poly)
    cu, su = np.cos(u), np.sin(u)
    M = four.rotations[0].T @ U[:, :3, :3] @ four.rotations[4].T
    M = np.broadcast_to(M[:, None], (*cu.shape, 3, 3))
    X, Y, Z = _second_early(four, M, (cu, su))
    # beside a fold the two angles may just not be real
    half = np.arctan2(np.sqrt(np.maximum(X * X + Y * Y - Z * Z, 0.0)), Z)
    there &= Z * Z - X * X - Y * Y < 0.1
    found = np.empty((N, 2, count, 6))
    for way, sign in enumerate((1.0, -1.0)):
        v = np.arctan2(Y, X) + sign * half
        c, s = _all_joints(four, M, (cu, su), (np.cos(v), np.sin(v)))
        q = np.arctan2(s, c)
        c, s = np.cos(q), np.sin(q)
        a, b, missing = _slides(D, chain.sigma, c, s, goals[:, None])
        # least squares for the lengths; parallel slides share what is missing
        along = np.sum(a * b, axis=-1)
        square = np.sum(np.cross(a, b) ** 2, axis=-1)
        left = np.stack([np.sum(a * missing, axis=-1), np.sum(b * missing, axis=-1)], axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            lengths = (left - along[..., None] * left[..., ::-1]) / square[..., None]
        shared = 0.5 * np.stack([left[..., 0], along * left[..., 0]], axis=-1)
        lengths = np.where(square[..., None] > 1e-18, lengths, shared)
        q[..., chain.sigma == 1] = unit * lengths
        found[:, way] = q
    return found.reshape(N, 2 * count, 6), np.concatenate([there, there], axis=1)


def _angles(poly: NDArray[np.complex128]) -> tuple[Array, NDArray[np.bool_]]:
    """Arguments of the roots of polynomials (N, m + 1), lowest first, that are on the circle."""
    N, m = poly.shape[0], poly.shape[1] - 1
    if m == 0:
        return np.zeros((N, 0)), np.zeros((N, 0), np.bool_)
    # the ends are conjugate, so that neither vanishes alone: small, roots go to 0 and infinity
    lead = poly[:, -1]
    size = np.abs(poly).max(axis=1)
    lead = np.where(np.abs(lead) < 1e-14 * size, 1e-14 * size, lead)
    companion = np.zeros((N, m, m), np.complex128)
    companion[:, 0] = -poly[:, -2::-1] / lead[:, None]
    companion[:, np.arange(1, m), np.arange(m - 1)] = 1.0
    z = np.linalg.eigvals(companion)
    with np.errstate(divide="ignore"):
        off = np.abs(np.log(np.abs(z)))
    return np.angle(z).astype(np.float64), off < NEAR_CIRCLE
