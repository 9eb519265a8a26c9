"""Geometric, kinematic and dynamic models of flexible robots, by compiled recursions (7.2).

Vectors may have leading batch axes, which broadcast; an empty batch gives an empty result.

Parameters
----------
arm : FlexibleRobot
    The robot, n joints and m elastic coordinates.
q, v, a : array_like, shape (..., n)
    Positions, velocities and accelerations of the motors, rad or m.
e, e_v : array_like, shape (..., m)
    Elastic coordinates and their velocities; None is zero.
tau : array_like, shape (..., n)
    Torques of the motors, N m or N.
wrench : array_like, shape (..., 6), optional
    Force and moment of the tool on the environment at the tool point, in world axes.
drive : bool
    Whether rotor inertia, friction and offsets of the model's drives take part.

Raises
------
ShapeError, InvalidValueError
    Arguments of the wrong length, or with NaN or infinity.
SingularMassMatrixError
    A coordinate that moves no inertia, such as a flexible joint without rotor inertia.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_vector, batch_rows, read_only
from .._outcomes import Outcome
from ..errors import SingularMassMatrixError
from .robot import FlexibleRobot, check_arm

INVERSE, DIRECT = range(2)
_NO_WRENCH = np.zeros((1, 6))


class SpinStatus(Outcome):
    """Whether the elastic stiffness of the spinning links is positive; fits int8."""

    STIFF = 0, "The elastic stiffness of every link is positive at its angular velocity."
    SOFTENED = (
        1,
        "A link spins above its own critical speed: its linear modes have no stiffness left and "
        "their deflection grows. Make the link with stiffening=True.",
    )


class Accelerations(tuple[Array, Array]):
    """Accelerations (a, e_a) of a direct dynamic model, with a status.

    Parameters
    ----------
    pair : tuple of ndarray, shapes (..., n) and (..., m)
        Accelerations of the motors and of the elastic coordinates.
    status : ndarray of int8, shape (...)
        Codes of `SpinStatus`.
    """

    status: NDArray[np.int8]

    def __new__(cls, pair: tuple[Array, Array], status: NDArray[np.int8]) -> Accelerations:
        """Attach the status to the pair."""
        made = super().__new__(cls, pair)
        made.status = status
        return made

    def reason(self, i: Any = ()) -> str:
        """The sentence of the status of sample i."""
        return SpinStatus(int(self.status[i])).sentence

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Accelerations):
            return NotImplemented
        pairs = zip((*self, self.status), (*other, other.status), strict=True)
        return all(np.array_equal(x, y, equal_nan=True) for x, y in pairs)

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash(tuple(x.shape for x in self))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (tuple(self), self.status)


def dgm(arm: FlexibleRobot, q: ArrayLike, e: ArrayLike | None = None) -> Array:
    """Direct geometric model: world pose (..., 4, 4) of the tool (section 7.2.7).

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Its pose.

    Examples
    --------
    >>> from robotmodels import flexible, load
    >>> arm = flexible.FlexibleRobot(load("rx90"), {3: flexible.beam(0.45, EI=100.0, modes=1)})
    >>> dgm(arm, np.zeros(6), [0.0, 0.01]).shape
    (4, 4)
    """
    poses = _poses(arm, q, e)[..., -1, :, :]
    return poses @ np.block([[arm.model.tool[:3, :3], np.zeros((3, 1))], [np.eye(4)[3:]]])


def link_poses(arm: FlexibleRobot, q: ArrayLike, e: ArrayLike | None = None) -> Array:
    """World poses of the frames R_1 to R_f, the roots of the links, on the deformed arm.

    Returns
    -------
    ndarray, shape (..., f, 4, 4)
        Poses.
    """
    return _poses(arm, q, e)[..., :-1, :, :]


def jacobian(arm: FlexibleRobot, q: ArrayLike, e: ArrayLike | None = None) -> Array:
    """Jacobian of the tool by (q, e), rows [v; w] at the tool point in world axes (section 7.2.3).

    Returns
    -------
    ndarray, shape (..., 6, n + m)
        The columns of the joints, then of the elastic coordinates.
    """
    batch, (q, e) = checked_rows(arm, q=q, e=e)
    n, size = arm.n, arm.n + arm.m
    unit = np.tile(np.eye(size), (len(q), 1))
    q, e = (np.repeat(x, size, axis=0) for x in (q, e))
    _, out = _motions(arm, q, e, unit[:, :n], unit[:, n:])
    return out[:, 9:].reshape(*batch, size, 6).swapaxes(-1, -2).copy()


def energies(
    arm: FlexibleRobot,
    q: ArrayLike,
    e: ArrayLike | None = None,
    v: ArrayLike | None = None,
    e_v: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """Kinetic energy, and potential energy of gravity and deformation (section 7.2.2.7).

    Returns
    -------
    kinetic, potential : ndarray, shape (...)
        J; rotors included.
    """
    batch, (q, e, v, e_v) = checked_rows(arm, q=q, e=e, v=v, e_v=e_v)
    kinetic, potential, _ = states(arm, q, e, v, e_v)
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
    """Inverse dynamic model: torques of given joint accelerations (section 7.2.8.2).

    The elastic accelerations follow from the state: integrate them along a motion.

    Returns
    -------
    tau : ndarray, shape (..., n)
        Torques, N m or N.
    e_a : ndarray, shape (..., m)
        Elastic accelerations.

    References
    ----------
    F. Boyer and W. Khalil, "An efficient calculation of flexible manipulator inverse dynamics",
    Int. J. Robotics Research 17 (1998).
    """
    batch, rows = checked_rows(arm, q=q, e=e, v=v, e_v=e_v, a=a, wrench=wrench)
    tau, e_a, _ = solved(arm, INVERSE, *rows, drive=drive)
    return tau.reshape(*batch, arm.n), e_a.reshape(*batch, arm.m)


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
    """Direct dynamic model: accelerations under given torques (section 7.2.8.3).

    Returns
    -------
    Accelerations
        The pair (a, e_a), shapes (..., n) and (..., m), with ``.status`` of `SpinStatus`.

    Examples
    --------
    >>> from robotmodels import flexible, load
    >>> arm = flexible.FlexibleRobot(load("rx90"), {3: flexible.beam(0.45, EI=100.0, modes=1)})
    >>> a, e_a = ddm(arm, np.zeros(6), None, np.zeros(6), None, np.zeros(6))
    >>> a.shape, e_a.shape
    ((6,), (2,))
    """
    batch, rows = checked_rows(arm, q=q, e=e, v=v, e_v=e_v, tau=tau, wrench=wrench)
    a, e_a, base = solved(arm, DIRECT, *rows, drive=drive)
    status = base[:, 9].astype(np.int8).reshape(batch)
    return Accelerations((a.reshape(*batch, arm.n), e_a.reshape(*batch, arm.m)), status)


def mass_matrix(arm: FlexibleRobot, q: ArrayLike, e: ArrayLike | None = None) -> Array:
    """Mass matrix of (q, e), rotor inertia on it (section 7.2.5).

    Returns
    -------
    ndarray, shape (..., n + m, n + m)
        Symmetric.
    """
    batch, (q, e) = checked_rows(arm, q=q, e=e)
    n, size = arm.n, arm.n + arm.m
    bare = arm.arrays.second.copy()
    bare[..., 16:] = 0.0  # no elastic forces
    arrays = arm.arrays._replace(second=read_only(bare), gravity=read_only(np.zeros(3)))
    unit = np.tile(np.eye(size), (len(q), 1))
    q, e = (np.repeat(x, size, axis=0) for x in (q, e))
    forces = generalized_forces(
        arm, q, e, 0.0 * q, 0.0 * e, unit[:, :n], unit[:, n:], arrays=arrays, elastic=False
    )
    return np.hstack(forces).reshape(*batch, size, size)


# --- rows of samples, checked ------------------------------------------------------------------


def checked_rows(arm: FlexibleRobot, **given: Any) -> tuple[tuple[int, ...], list[Array]]:
    """Batch axes and rows (N, k) of vectors; None is zero."""
    check_arm(arm)
    lengths = {"e": arm.m, "e_v": arm.m, "wrench": 6}
    vectors = []
    for name, value in given.items():
        k = lengths.get(name, arm.n)
        vectors.append(np.zeros(k) if value is None else as_vector(value, k, name))
    if all(vector.ndim == 1 for vector in vectors):
        return (), [vector.reshape(1, -1) for vector in vectors]
    return batch_rows(tuple(vectors), tuple(given))


def _of_links(arm: FlexibleRobot, q: Array, e: Array) -> tuple[Array, Array]:
    """Turns of the links (N, n), and modes (N, modes), of motors and elastic coordinates."""
    if not len(arm.joints):
        return np.ascontiguousarray(q), np.ascontiguousarray(e)
    turns, modes = np.array(q, order="C"), arm.modes
    turns[:, arm.joints] += e[:, modes:]
    return turns, np.ascontiguousarray(e[:, :modes])


def _motions(arm: FlexibleRobot, q: Array, e: Array, v: Array, ev: Array) -> tuple[Array, Array]:
    """Poses (N, f + 1, 3, 4), and energies, momenta and the velocity of the tool (N, 15)."""
    from .kernels import motions

    out, poses = np.empty((len(q), 15)), np.empty((len(q), arm.model.f + 1, 3, 4))
    turns, rates = _of_links(arm, q, e), _of_links(arm, v, ev)
    motions(arm.arrays, *turns, *rates, np.zeros((len(q), 6)), poses, out)
    return poses, out


def _poses(arm: FlexibleRobot, q: ArrayLike, e: ArrayLike | None) -> Array:
    batch, (q, e) = checked_rows(arm, q=q, e=e)
    poses = np.zeros((len(q), arm.model.f + 1, 4, 4))
    poses[:, :, :3], poses[:, :, 3, 3] = _motions(arm, q, e, 0.0 * q, 0.0 * e)[0], 1.0
    return poses.reshape(*batch, *poses.shape[1:])


def states(
    arm: FlexibleRobot, q: Array, e: Array, v: Array, ev: Array
) -> tuple[Array, Array, Array]:
    """Kinetic and potential energies (N,), and momenta in the world (N, 6), of rows."""
    _, out = _motions(arm, q, e, v, ev)
    drives, deflected = arm.model.drive_matrices, e[:, arm.modes :]
    rotor = 0.0 if drives is None else 0.5 * (v**2 @ np.diag(drives.rotor))
    spring = 0.5 * deflected**2 @ arm.joint_stiffness[arm.joints]  # type: ignore[index]
    return out[:, 0] + rotor, out[:, 1] + out[:, 2] + spring, out[:, 3:9]


def solved(
    arm: FlexibleRobot,
    kind: int,
    q: Array,
    e: Array,
    v: Array,
    ev: Array,
    given: Array,
    wrench: Array = _NO_WRENCH,
    *,
    drive: bool = True,
) -> tuple[Array, Array, Array]:
    """Inverse or direct model of rows: torques or accelerations (N, n), elastic ones (N, m).

    Also the rows (N, 10) of the base: its load, first moment of the arm, whether it is softened.
    """
    from .kernels_loads import loads

    N, joints, modes = len(q), arm.joints, arm.modes
    arrays, drives = arm.arrays, arm.model.drive_matrices if drive else None
    if not drive:
        arrays = arrays._replace(rotor=read_only(np.zeros(arm.n)))
    direct = kind == DIRECT
    rest = 0.0 if drives is None else drives.torque(v, None)
    value = given - rest if direct and drives is not None else given
    flags = np.full(arm.n, int(direct))
    net = spring = np.zeros((N, 0))
    turns, rates = _of_links(arm, q, e), _of_links(arm, v, ev)
    if len(joints):
        k, d = arm.joint_stiffness[joints], arm.joint_damping[joints]  # type: ignore[index]
        spring = k * e[:, modes:] + d * ev[:, modes:]
        flags[joints], value = 1, value.copy()
        net, value[:, joints] = value[:, joints], -spring  # on the motors; on the links
    out, out_e, base = np.empty((N, arm.n)), np.empty((N, arm.m)), np.empty((N, 10))
    found_e = out_e if not len(joints) else np.empty((N, modes))
    none, twist = np.zeros((N, modes)), np.zeros((N, 6))
    pull = wrench if len(wrench) == N else np.zeros((N, 6))
    failed = loads(
        arrays, *turns, *rates, np.ascontiguousarray(value), none, pull, twist, flags, 1, 0,
        out, found_e, base,
    )  # fmt: skip
    if len(joints):
        rotor = np.zeros(arm.n) if drives is None else np.diag(drives.rotor)
        if direct and not (rotor[joints] > 0.0).all():
            raise SingularMassMatrixError(
                f"{arm.model.name!r}: flexible joint {int(joints[rotor[joints] <= 0.0][0]) + 1} "
                "has no rotor inertia, so its motor has no acceleration. "
                + (
                    "Give Ia with model.with_drive(DriveParameters(Ia=...))."
                    if drive
                    else "drive=False leaves out that of the model; take drive=True."
                )
            )
        link = out[:, joints].copy()
        motor = (net + spring) / rotor[joints] if direct else given[:, joints]
        out[:, joints] = motor if direct else -spring
        out_e[:, :modes], out_e[:, modes:] = found_e, link - motor
        if not direct:
            out += 0.0 if drives is None else (given * rotor) * np.isin(np.arange(arm.n), joints)
    if failed >= 0:
        raise SingularMassMatrixError(
            f"{arm.model.name!r}: a joint moves no inertia (first in sample {failed} of {N}). Give "
            "inertial parameters with model.with_inertia(...), or rotor inertia with with_drive."
        )
    return (out if direct else out + rest), out_e, base


def generalized_forces(
    arm: FlexibleRobot,
    q: Array,
    e: Array,
    v: Array,
    ev: Array,
    a: Array,
    ea: Array,
    wrench: Array = _NO_WRENCH,
    arrays: Any = None,
    elastic: bool = True,
) -> tuple[Array, Array]:
    """Forces on (q, e) that given accelerations need, rows (N, n) and (N, m), without friction."""
    from .kernels_loads import loads

    N, joints, modes = len(q), arm.joints, arm.modes
    turns, rates, given = _of_links(arm, q, e), _of_links(arm, v, ev), _of_links(arm, a, ea)
    out, found, base = np.empty((N, arm.n)), np.empty((N, modes)), np.empty((N, 10))
    pull = wrench if len(wrench) == N else np.zeros((N, 6))
    flags = np.zeros(arm.n, np.int64)
    loads(
        arrays or arm.arrays, *turns, *rates, *given, pull, np.zeros((N, 6)), flags, 0, 0,
        out, found, base,
    )  # fmt: skip
    deflection = out[:, joints]
    if len(joints):
        k, d = arm.joint_stiffness[joints], arm.joint_damping[joints]  # type: ignore[index]
        deflection = deflection + elastic * (k * e[:, modes:] + d * ev[:, modes:])
        if arm.model.drive_matrices is not None:
            rotor = np.diag(arm.model.drive_matrices.rotor)[joints]
            out[:, joints] += rotor * a[:, joints]
    return out, np.hstack([found, deflection])
