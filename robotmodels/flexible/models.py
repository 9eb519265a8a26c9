"""Geometric, kinematic and dynamic models of flexible robots, by a compiled recursion (7.2).

Parameters
----------
arm, q, e, v, e_v, a, tau, wrench
    See `robotmodels.flexible`.
drive : bool
    Whether rotor inertia, friction and offsets of the model's drives take part.

Returns
-------
ndarray, shape (..., core)
    Or a pair of them; each function states the shape of its core.

References
----------
F. Boyer and W. Khalil, Int. J. Robotics Research 17 (1998).

Examples
--------
>>> from robotmodels import flexible, load
>>> arm = flexible.FlexibleRobot(load("rx90"), {3: flexible.beam(0.45, EI=100.0, modes=1)})
>>> dgm(arm, np.zeros(6), [0.0, 0.01]).shape
(4, 4)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import LARGEST, Array, as_bounded, as_vector, batch_rows, read_only
from .._outcomes import Outcome, Result
from ..errors import SingularMassMatrixError
from .robot import Arm, FlexibleRobot, check_arm

_NEEDED = ("q", "a", "tau")  # other vectors are zero by default
Load = Array | None
Ints = NDArray[np.int64]


class SpinStatus(Outcome):
    """Whether the elastic stiffness of the spinning links and the mass are positive; fits int8."""

    STIFF = 0, "The elastic stiffness of every link is positive at its angular velocity."
    SOFTENED = 1, "A link spins above its own critical speed: make it with stiffening=True."
    LARGE_DEFLECTION = 2, "Deflections are too large for stiffening=True: take fewer modes."


class Accelerations(Result, tuple[Array, Array]):
    """Accelerations (a, e_a), (..., n) and (..., m), with ``.status`` of `SpinStatus`."""

    status: NDArray[np.int8]
    outcomes = SpinStatus
    __repr__ = tuple.__repr__  # type: ignore[assignment]

    def __new__(cls, pair: tuple[Array, Array], status: NDArray[np.int8]) -> Accelerations:
        """Attach the status to the pair."""
        made = tuple.__new__(cls, pair)
        made.status = status
        return made

    @property
    def _values(self) -> tuple[Any, ...]:
        return (*self, self.status)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (tuple(self), self.status)


def dgm(arm: FlexibleRobot, q: ArrayLike, e: ArrayLike | None = None) -> Array:
    """Direct geometric model: world pose (..., 4, 4) of the tool."""
    poses = _poses(arm, q, e)[..., -1, :, :]
    return poses @ np.block([[arm.model.tool[:3, :3], np.zeros((3, 1))], [np.eye(4)[3:]]])


def link_poses(arm: FlexibleRobot, q: ArrayLike, e: ArrayLike | None = None) -> Array:
    """World poses (..., f, 4, 4) of the frames R_1 to R_f, roots of the links, on a bent arm."""
    return _poses(arm, q, e)[..., :-1, :, :]


def jacobian(arm: FlexibleRobot, q: ArrayLike, e: ArrayLike | None = None) -> Array:
    """Jacobian (..., 6, n + m) of the tool by (q, e), rows [v; w] at the tool point, world axes."""
    batch, (x,) = checked_rows(arm, (q, e))
    unit, x = np.tile(np.eye(6), (len(x), 1)), np.repeat(x, 6, axis=0)
    return forces(arm, x, 0.0 * x, 0.0 * x, unit, bare=True)[0].reshape(*batch, 6, x.shape[1])


def energies(
    arm: FlexibleRobot,
    q: ArrayLike,
    e: ArrayLike | None = None,
    v: ArrayLike | None = None,
    e_v: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """Kinetic energy, and potential energy of gravity and deformation, (...) each, J."""
    batch, (x, dx) = checked_rows(arm, (q, e), (v, e_v))
    kinetic, potential, _ = states(arm, x, dx)
    return kinetic.reshape(batch), potential.reshape(batch)


def idm(
    arm: FlexibleRobot,
    q: ArrayLike,
    e: ArrayLike | None,
    v: ArrayLike,
    e_v: ArrayLike | None,
    a: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
) -> tuple[Array, Array]:
    """Inverse dynamic model: torques (..., n) of joint accelerations, and elastic ones (..., m).

    The latter follow from the state: integrate them along a motion.
    """
    batch, rows = checked_rows(arm, (q, e), (v, e_v), a=a, wrench=wrench)
    found = solved(arm, False, *rows, drive=drive)[0].reshape(*batch, arm.n + arm.m)
    return found[..., : arm.n].copy(), found[..., arm.n :].copy()


def ddm(
    arm: FlexibleRobot,
    q: ArrayLike,
    e: ArrayLike | None,
    v: ArrayLike,
    e_v: ArrayLike | None,
    tau: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
) -> Accelerations:
    """Direct dynamic model: the pair (a, e_a) of accelerations under given torques."""
    batch, rows = checked_rows(arm, (q, e), (v, e_v), tau=tau, wrench=wrench)
    found, base = solved(arm, True, *rows, drive=drive)
    found, status = found.reshape(*batch, arm.n + arm.m), base[:, 9].astype(np.int8)
    pair = found[..., : arm.n].copy(), found[..., arm.n :].copy()
    return Accelerations(pair, status.reshape(batch))


def mass_matrix(arm: FlexibleRobot, q: ArrayLike, e: ArrayLike | None = None) -> Array:
    """Mass matrix (..., n + m, n + m) of (q, e), with rotor inertia."""
    batch, (x,) = checked_rows(arm, (q, e))
    size = x.shape[1]
    unit, x = np.tile(np.eye(size), (len(x), 1)), np.repeat(x, size, axis=0)
    return forces(arm, x, 0.0 * x, unit, bare=True)[0].reshape(*batch, size, size)


# --- rows of coordinates x = (q, e), checked ------------------------------------------------------


def checked_rows(
    arm: FlexibleRobot, *pairs: tuple[ArrayLike | None, ArrayLike | None], **given: Any
) -> tuple[tuple[int, ...], list[Array]]:
    """Batch axes, and rows (N, n + m) of pairs, (N, k) of other vectors; None is zero."""
    sizes = dict.fromkeys(("q", "v", "a", "tau"), check_arm(arm).n) | {"wrench": 6}
    sizes |= dict.fromkeys(("e", "e_v"), arm.m)
    named = dict(zip(("q", "e", "v", "e_v"), [x for pair in pairs for x in pair], strict=False))
    given, k, batch = {**named, **given}, len(named), ()
    vectors: Any = [
        np.zeros(sizes[name])
        if x is None and name not in _NEEDED
        else as_bounded(as_vector(x, sizes[name], name), name, LARGEST)  # type: ignore[arg-type]
        for name, x in given.items()
    ]
    if any(vector.ndim > 1 for vector in vectors):
        batch, vectors = batch_rows(tuple(vectors), tuple(given))
    rows = [np.concatenate(vectors[i : i + 2], axis=-1) for i in range(0, k, 2)] + vectors[k:]
    return batch, rows if batch else [np.atleast_2d(row) for row in rows]


def recursion(
    chain: Arm,
    y: Array,
    dy: Array,
    given: Array,
    free: Ints,
    wrench: Load = None,
    moved: Load = None,
) -> tuple[Array, Array, Array, int]:
    """The compiled recursion: loads or accelerations, rows of the base, poses, first failure."""
    from .kernels import loads
    from .work import workspace

    N = len(y)
    out, base = np.empty((N, y.shape[1])), np.empty((N, 10))
    poses = np.empty((N, len(chain.pi) + 1, 3, 4))
    outer = np.zeros((N, 18))
    outer[:, :6] = 0.0 if wrench is None else wrench
    outer[:, 6:] = 0.0 if moved is None else moved
    y, dy, given = map(np.ascontiguousarray, (y, dy, given))
    work = workspace(chain, free)
    failed = loads(chain, y, dy, given, outer, free, work, out, base, poses)
    return out, base, poses, failed


def _poses(arm: FlexibleRobot, q: ArrayLike, e: ArrayLike | None) -> Array:
    batch, (x,) = checked_rows(arm, (q, e))
    poses = np.zeros((len(x), arm.model.f + 1, 4, 4))
    poses[:, :, :3] = recursion(arm.parts.chain, x, 0.0 * x, 0.0 * x, np.zeros(0, np.int64))[2]
    poses[:, :, 3, 3] = 1.0
    return poses.reshape(*batch, *poses.shape[1:])


def states(arm: FlexibleRobot, x: Array, dx: Array) -> tuple[Array, Array, Array]:
    """Kinetic and potential energies (N,), and momenta (N, 6) in axes of the base, of rows."""
    # the momenta are the loads of accelerations dx at rest
    Q, base = forces(arm, x, 0.0 * x, dx, bare=True)
    potential = 0.5 * ((x @ arm.parts.K) * x).sum(axis=1) - base[:, 6:9] @ arm.model.gravity
    return 0.5 * (Q * dx).sum(axis=1), potential, base[:, :6]


def in_world(pose: Array, load: Array) -> Array:
    """Forces and moments (..., 6) in axes of poses (..., 4, 4), about the origin of the world."""
    R, p = pose[..., :3, :3], pose[..., :3, 3]
    force, moment = np.matvec(R, load[..., :3]), np.matvec(R, load[..., 3:])
    return np.concatenate([force, moment + cross(p, force)], axis=-1)


def cross(a: Array, b: Array) -> Array:
    """Vector products (..., 3), for few of them quicker than NumPy's."""
    after, before = [1, 2, 0], [2, 0, 1]
    return a[..., after] * b[..., before] - a[..., before] * b[..., after]


def solved(
    arm: FlexibleRobot,
    direct: bool,
    x: Array,
    dx: Array,
    given: Array,
    wrench: Load = None,
    drive: bool = True,
) -> tuple[Array, Array]:
    """Direct or inverse model of rows: accelerations, or torques and elastic accelerations.

    Shapes: -> (N, n + m), and rows (N, 10) of the base, see `kernels`.
    """
    n, parts = arm.n, arm.parts
    chain = parts.chain if drive else _without_drive(parts.chain)
    value = np.zeros((len(x), n + arm.m))
    value[:, :n] = given
    found, base, _, failed = recursion(chain, x, dx, value, parts.free[1 + direct], wrench)
    still = arm.joints[chain.drive[arm.joints, 0] <= 0.0] if direct else arm.joints[:0]
    if len(still) or failed >= 0:
        fault = f"a joint moves no inertia (first in sample {failed} of {len(x)})"
        if len(still):
            fault = f"flexible joint {int(still[0]) + 1} has no rotor inertia to accelerate"
        raise SingularMassMatrixError(
            f"{arm.model.name!r}: {fault}; see model.with_inertia and Ia of DriveParameters."
        )
    return found, base


def _without_drive(chain: Arm) -> Arm:
    """The chain without rotor inertia, friction and offsets of its drives."""
    drive = chain.drive.copy()
    drive[:, :4] = 0.0
    return chain._replace(drive=read_only(drive))


def forces(
    arm: FlexibleRobot, x: Array, dx: Array, ddx: Array, wrench: Load = None, bare: bool = False
) -> tuple[Array, Array]:
    """Forces (N, n + m) that given accelerations need, without friction; rows (N, 10) of the base.

    Gravity and elasticity are left out if ``bare``.
    """
    parts = arm.parts
    return recursion(parts.bare if bare else parts.chain, x, dx, ddx, parts.free[0], wrench)[:2]
