"""Drive chains: rotor inertia, friction and offset of the joints, and the transmission.

Seed book sections 1.2.1 (q = K_c q_c + q_0), 1.5.1.4 (friction), 1.5.1.5 (rotor inertia) and
1.6.2.5 (joint torques from motor torques).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Array, as_exact, as_floats, as_vector, read_only, same_value, value_hash
from ._choices import chosen
from .errors import InertiaError, InvalidValueError, ShapeError


class DriveKind(Enum):
    """One kind of drive parameters; those of coupled motors belong to the kind that they couple.

    Examples
    --------
    >>> DriveKind.IA.value, DriveKind.IA.coupling
    ('Ia', 'Iam')
    """

    IA = "Ia"
    FV = "Fv"
    FC = "Fc"
    OFFSET = "offset"

    @property
    def coupling(self) -> str | None:
        """Name of what couples motors in this kind; an offset couples nothing."""
        return None if self is DriveKind.OFFSET else f"{self.value}m"


DriveWord = Literal["Ia", "Fv", "Fc", "offset"]
Drives = bool | DriveKind | DriveWord | Iterable[DriveKind | DriveWord]
"""All drive parameters, none, or those of some kinds."""


def drive_kinds(drive: Drives) -> tuple[DriveKind, ...]:
    """Which kinds of drive parameters are meant.

    Parameters
    ----------
    drive : bool, DriveKind, str, or collection of these
        All kinds, none, or some, as members or in words: ``("Ia", "Fv", "Fc")``.

    Returns
    -------
    tuple of DriveKind
        In the order of the regressors' columns, each once.

    Raises
    ------
    InvalidValueError
        Something else.

    Examples
    --------
    >>> [kind.value for kind in drive_kinds(("Fc", "Ia"))]
    ['Ia', 'Fc']
    """
    if isinstance(drive, (bool, np.bool_)):
        return tuple(DriveKind) if drive else ()
    if isinstance(drive, (DriveKind, str)):
        drive = (drive,)
    if not isinstance(drive, Iterable):
        raise InvalidValueError(
            "drive: expected True, False, or kinds of drive parameters such as ('Ia', 'Fv'), got "
            f"{drive!r:.60}."
        )
    asked = {chosen(DriveKind, kind, "drive") for kind in drive}
    return tuple(kind for kind in DriveKind if kind in asked)


def check_all_or_none(drive: object) -> bool:
    """Refuse kinds of drives where all or none act: torques are those of the model's drives.

    Parameters
    ----------
    drive : bool
        What the caller passed.

    Returns
    -------
    bool
        The same.

    Raises
    ------
    InvalidValueError
        Something else.

    Examples
    --------
    >>> check_all_or_none(True)
    True
    """
    if isinstance(drive, (bool, np.bool_)):
        return bool(drive)
    raise InvalidValueError(
        f"drive: expected True or False here, got {drive!r:.60}; kinds of drive parameters are for "
        "regressors and base parameters, and model.with_drive(...) takes single terms away."
    )


@dataclass(frozen=True, slots=True, init=False, eq=False)
class DriveParameters:
    """Drive terms of each joint, seen from the joint side.

    ``tau_drive = Ia * a + Fv * v + Fc * sign(v) + offset``. Any real values are legal.

    Parameters
    ----------
    Ia : array_like, shape (n,), optional
        Inertia of rotor and gears on the joint side (gear ratio squared times rotor inertia),
        kg m^2 or kg.
    Fv : array_like, shape (n,), optional
        Viscous friction, N m s/rad or N s/m.
    Fc : array_like, shape (n,), optional
        Coulomb friction, N m or N.
    offset : array_like, shape (n,), optional
        Constant torque or force, N m or N. What is left out is zero; give at least one.

    Raises
    ------
    ShapeError, InvalidValueError
        Lengths that differ; NaN or infinity.

    References
    ----------
    Seed book sections 1.5.1.4 and 1.5.1.5.

    Examples
    --------
    >>> DriveParameters(Fv=[1.0, 2.0]).Ia
    array([0., 0.])
    """

    Ia: Array
    Fv: Array
    Fc: Array
    offset: Array

    def __init__(
        self,
        Ia: ArrayLike | None = None,
        Fv: ArrayLike | None = None,
        Fc: ArrayLike | None = None,
        offset: ArrayLike | None = None,
    ) -> None:
        given = {"Ia": Ia, "Fv": Fv, "Fc": Fc, "offset": offset}
        values = {name: as_floats(v, name) for name, v in given.items() if v is not None}
        if not values:
            raise InertiaError("Give at least one of Ia, Fv, Fc, offset, each of shape (n,).")
        shape = next(iter(values.values())).shape
        if len(shape) != 1 or any(array.shape != shape for array in values.values()):
            shapes = ", ".join(f"{name} {array.shape}" for name, array in values.items())
            raise ShapeError(f"Drive parameters are all of shape (n,), got {shapes}.")
        for name in given:
            object.__setattr__(self, name, read_only(values.get(name, np.zeros(shape))))

    @classmethod
    def zeros(cls, n: int) -> Self:
        """Drives without inertia, friction or offset.

        Parameters
        ----------
        n : int
            Number of joints.

        Returns
        -------
        DriveParameters
            All zero.

        Examples
        --------
        >>> DriveParameters.zeros(2).n
        2
        """
        return cls(Ia=np.zeros(n))

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.Ia.size

    @property
    def is_zero(self) -> bool:
        """Whether every parameter is zero."""
        return not (self.Ia.any() or self.Fv.any() or self.Fc.any() or self.offset.any())

    def __reduce__(self) -> tuple[Any, ...]:  # rebuilt, so that a copy is read-only as well
        return type(self), tuple(getattr(self, f.name) for f in fields(self))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, DriveParameters):
            return NotImplemented
        return all(same_value(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    def __hash__(self) -> int:
        return value_hash(self.Ia, self.Fv, self.Fc, self.offset)


@dataclass(frozen=True, slots=True, init=False, eq=False)
class Transmission:
    """How encoders (motors) and joints move together: ``q = K q_c + q_0``.

    ``q_c`` are the encoder variables, usually motor angles. Power is conserved, so torques go the
    other way through the transpose: ``tau_c = K^T tau``. A motor whose shaft is turned by more
    than one joint (a coupled wrist, such as motor 6 of the Staubli TX40, whose speed is that of
    joints 5 and 6 together) has drive terms that couple those joints::

        w = row m of K^-1 divided by its diagonal entry        (for the TX40: w_5 = w_6 = 1)
        tau_j += sum over k != j of w_j w_k (Iam a_k + Fvm v_k)  +  w_j Fcm sign(w . v)

    The diagonal parts (k = j) belong to ``Ia`` and ``Fv`` of `DriveParameters`, as in the
    published TX40 identifications.

    Where the motors are given by the joints, ``q_motor = R q``, ``K`` is the inverse of ``R``:
    `from_motor`.

    Parameters
    ----------
    matrix : array_like, shape (n, n)
        ``K``; singular only where joints mimic others.
    offset : array_like, shape (n,), optional
        ``q_0``, default zero.
    Iam, Fvm, Fcm : array_like, shape (n,), optional
        Coupling inertia, viscous and Coulomb friction of motor m, joint side, default zero.
        They must be zero for motors that turn one joint only.

    Raises
    ------
    ShapeError, InvalidValueError
        Not square, lengths that differ, NaN or infinity.
    InertiaError
        A coupling term on a motor that is not coupled.

    References
    ----------
    Seed book section 1.2.1 (last note) and 1.6.2.5; A. Janot, P.-O. Vandanjon and M. Gautier,
    "An instrumental variable approach for rigid industrial robots identification", Control
    Engineering Practice 25, 2014, section 4 (TX40, Iam6, Fvm6, Fcm6).

    Examples
    --------
    >>> wrist = Transmission([[1 / 45, 0], [-1 / 45, 1 / 32]])
    >>> wrist.coupled_motors
    (2,)
    >>> wrist.to_joint([45.0, 0.0])
    array([ 1., -1.])
    """

    matrix: Array
    offset: Array
    Iam: Array
    Fvm: Array
    Fcm: Array

    def __init__(
        self,
        matrix: ArrayLike,
        offset: ArrayLike | None = None,
        Iam: ArrayLike | None = None,
        Fvm: ArrayLike | None = None,
        Fcm: ArrayLike | None = None,
    ) -> None:
        K = as_floats(matrix, "matrix")
        if K.ndim != 2 or K.shape[0] != K.shape[1]:
            raise ShapeError(f"matrix: expected a square (n, n) matrix, got {K.shape}.")
        n = K.shape[0]
        object.__setattr__(self, "matrix", read_only(K))
        given = {"offset": offset, "Iam": Iam, "Fvm": Fvm, "Fcm": Fcm}
        for name, value in given.items():
            array = np.zeros(n) if value is None else as_exact(value, (n,), name)
            object.__setattr__(self, name, read_only(array))
        terms = any(getattr(self, name).any() for name in ("Iam", "Fvm", "Fcm"))
        if terms and not self.is_invertible:
            raise InertiaError(
                f"matrix: it has rank {self.rank} of {n}, so that joints do not tell how fast the "
                "motors turn: inertia and friction of coupled motors (Iam, Fvm, Fcm) need a matrix "
                "that can be inverted."
            )
        single = sorted(set(range(1, self.n + 1)) - set(self.coupled_motors))
        for m in single:
            if self.Iam[m - 1] or self.Fvm[m - 1] or self.Fcm[m - 1]:
                raise InertiaError(
                    f"Motor {m} turns one joint only, so its inertia and friction belong to "
                    "DriveParameters (Ia, Fv, Fc); coupling terms are for the motors "
                    f"{list(self.coupled_motors)}."
                )

    @classmethod
    def from_motor(
        cls,
        matrix: ArrayLike,
        offset: ArrayLike | None = None,
        Iam: ArrayLike | None = None,
        Fvm: ArrayLike | None = None,
        Fcm: ArrayLike | None = None,
    ) -> Self:
        """The transmission of motors that turn as ``q_c = R q + r_0``.

        Joint torques are then ``tau = R^T tau_c``.

        Parameters
        ----------
        matrix : array_like, shape (n, n)
            ``R``: turns of each motor (row) per turn of each joint (column).
        offset : array_like, shape (n,), optional
            ``r_0``, the motors' variables where the joints are at zero; default zero.
        Iam, Fvm, Fcm : array_like, shape (n,), optional
            As for the class.

        Returns
        -------
        Transmission
            With ``K = R^-1`` and ``q_0 = -K r_0``.

        Raises
        ------
        InvalidValueError
            ``R`` has no inverse.
        ShapeError, InertiaError
            As the class.

        References
        ----------
        Seed book section 1.2.1; the wrist of the TX40 turns motor 6 by joints 5 and 6.

        Examples
        --------
        >>> wrist = Transmission.from_motor([[45.0, 0.0], [32.0, 32.0]], Iam=[0.0, 0.01])
        >>> wrist.to_encoder([1.0, 0.0]), wrist.to_motor_torque([77.0, 32.0])
        (array([45., 32.]), array([1., 1.]))
        """
        R = as_floats(matrix, "matrix")
        if R.ndim != 2 or R.shape[0] != R.shape[1]:
            raise ShapeError(f"matrix: expected a square (n, n) matrix, got {R.shape}.")
        n = R.shape[0]
        if _rank(R.T) < n:  # a row for each motor, each in units of its own
            raise InvalidValueError(
                f"matrix: R has rank {_rank(R.T)} of {n}, so that motors do not tell the joints; "
                "check its rows, or give K of q = K q_c to Transmission itself."
            )
        K = np.linalg.inv(R)
        zero = None if offset is None else -K @ as_exact(offset, (n,), "offset")
        return cls(K, zero, Iam, Fvm, Fcm)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.matrix.shape[0]

    @property
    def rank(self) -> int:
        """Number of independent encoder variables."""
        return _rank(self.matrix)

    @property
    def is_invertible(self) -> bool:
        """Whether every set of joint variables has encoder variables (no joint mimics others)."""
        return self.rank == self.n

    @property
    def is_mimicry(self) -> bool:
        """Whether the matrix is singular as that of mimic joints: independent columns, and zeros.

        The encoder variables with columns of zeros are not there; the others are free.
        """
        return 0 < self.rank < self.n and self.rank == self.free.shape[1]

    @property
    def free(self) -> Array:
        """Columns of ``K`` that are not zero, shape (n, m): ``v = free v_c``."""
        return self.matrix[:, self.matrix.any(axis=0)]

    @property
    def weights(self) -> Array:
        """Turns of motor m's shaft per turn of joint j, relative to its own joint, shape (n, n).

        Zero for a transmission that cannot be inverted.
        """
        if not self.is_invertible:
            return np.zeros((self.n, self.n))
        # the units of the motors do not matter: relative to the motors' own joints they go away
        W = np.linalg.inv(self.matrix / np.abs(self.matrix).max(axis=0))
        W[np.abs(W) < 1e-12 * np.abs(W).max()] = 0.0
        own = np.diag(W).copy()
        own[own == 0.0] = 1.0
        return W / own[:, None]

    @property
    def coupled_motors(self) -> tuple[int, ...]:
        """Numbers (from 1) of the motors that more than one joint turns."""
        return tuple(int(m) + 1 for m in np.flatnonzero((self.weights != 0.0).sum(axis=1) > 1))

    def to_joint(self, q_c: ArrayLike) -> Array:
        """Joint variables from encoder variables, ``q = K q_c + q_0``.

        Parameters
        ----------
        q_c : array_like, shape (..., n)
            Encoder variables.

        Returns
        -------
        ndarray, shape (..., n)
            Joint variables, radians or metres.

        Raises
        ------
        ShapeError, InvalidValueError
            Wrong length; NaN or infinity.

        Examples
        --------
        >>> Transmission([[0.5]], [0.1]).to_joint([2.0])
        array([1.1])
        """
        return as_vector(q_c, self.n, "q_c") @ self.matrix.T + self.offset

    def to_encoder(self, q: ArrayLike) -> Array:
        """Encoder variables from joint variables, the inverse of `to_joint`.

        Parameters
        ----------
        q : array_like, shape (..., n)
            Joint variables, radians or metres.

        Returns
        -------
        ndarray, shape (..., n)
            Encoder variables.

        Raises
        ------
        InvalidValueError
            K is singular: some joints mimic others, so ``q`` does not fix ``q_c``.
        ShapeError
            Wrong length.

        Examples
        --------
        >>> Transmission([[0.5]], [0.1]).to_encoder([1.1])
        array([2.])
        """
        q = as_vector(q, self.n, "q")
        if not self.is_invertible:
            raise InvalidValueError(
                "The transmission matrix is singular (a joint mimics another one): not every q "
                "has encoder variables. Take the master joints' values instead."
            )
        columns = (q - self.offset)[..., None]
        return np.asarray(np.linalg.solve(self.matrix, columns)[..., 0], np.float64)

    def to_motor_torque(self, tau: ArrayLike) -> Array:
        """Motor torques that do the work of joint torques, ``tau_c = K^T tau``.

        Parameters
        ----------
        tau : array_like, shape (..., n)
            Joint torques or forces, N m or N.

        Returns
        -------
        ndarray, shape (..., n)
            Torques on the encoder (motor) side.

        Raises
        ------
        ShapeError, InvalidValueError
            Wrong length; NaN or infinity.

        Examples
        --------
        >>> Transmission([[0.5]]).to_motor_torque([3.0])
        array([1.5])
        """
        return as_vector(tau, self.n, "tau") @ self.matrix

    def __reduce__(self) -> tuple[Any, ...]:  # rebuilt, so that a copy is read-only as well
        return type(self), tuple(getattr(self, f.name) for f in fields(self))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Transmission):
            return NotImplemented
        return all(same_value(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    def __hash__(self) -> int:
        return value_hash(self.matrix, self.offset, self.Iam, self.Fvm, self.Fcm)


def _rank(K: Array) -> int:
    """Rank of a matrix whose columns may be in any units."""
    size = np.abs(K).max(axis=0, initial=0.0)
    return int(np.linalg.matrix_rank(K[:, size > 0.0] / size[size > 0.0])) if size.any() else 0


@dataclass(frozen=True, slots=True, eq=False)
class DriveMatrices:
    """Drive terms of all joints together, coupled motors included.

    ``tau_drive = rotor a + viscous v + Fc sign(v) + W^T (Fcm sign(W v)) + offset``

    Parameters
    ----------
    rotor, viscous : ndarray, shape (n, n)
        Symmetric; diagonal unless motors are coupled.
    coulomb, offset : ndarray, shape (n,)
        Of the joints.
    coupling : ndarray, shape (k, n)
        ``W``, a row for each coupled motor.
    coupled_coulomb : ndarray, shape (k,)
        ``Fcm`` of the coupled motors.
    rows : tuple of (Ia, Fv, Fc, offset)
        The same numbers joint by joint; empty if motors are coupled.

    Examples
    --------
    >>> drive_matrices(DriveParameters(Ia=[1.0, 2.0]), None).rotor
    array([[1., 0.],
           [0., 2.]])
    """

    rotor: Array
    viscous: Array
    coulomb: Array
    offset: Array
    coupling: Array
    coupled_coulomb: Array
    rows: tuple[tuple[float, float, float, float], ...]

    def torque(self, v: Array, a: Array | None) -> Array:
        """Torque the drives take up.

        Parameters
        ----------
        v : ndarray, shape (..., n)
            Joint velocities.
        a : ndarray, shape (..., n), or None
            Joint accelerations; None leaves the rotor term out.

        Returns
        -------
        ndarray, shape (..., n)
            N m or N.

        Examples
        --------
        >>> drive_matrices(DriveParameters(Fc=[2.0]), None).torque(np.array([-1.0]), None)
        array([-2.])
        """
        if self.rows and a is not None and v.ndim == a.ndim == 1:
            # one sample of uncoupled drives: plain floats take a third of small arrays' time
            return np.array([
                Ia * acc + Fv * vel + offset + (Fc if vel > 0.0 else -Fc if vel < 0.0 else 0.0)
                for (Ia, Fv, Fc, offset), vel, acc in zip(
                    self.rows, v.tolist(), a.tolist(), strict=True
                )
            ])  # fmt: skip
        if self.rows and a is not None and v.ndim == a.ndim == 2 and v.shape == a.shape:
            # many samples of them: one pass through the arrays instead of seven
            from .kernels.drive_torques import drive_torques

            Ia, Fv, Fc, offset = np.array(self.rows).T.copy()
            out = np.empty(v.shape)
            v, a = np.ascontiguousarray(v), np.ascontiguousarray(a)
            drive_torques(v, a, Ia, Fv, Fc, offset, out)
            return out
        tau = np.sign(v)
        tau *= self.coulomb
        tau += v.dot(self.viscous)
        tau += self.offset
        if a is not None:
            tau = tau + a.dot(self.rotor)
        if self.coupling.size:
            W = self.coupling
            tau = tau + (np.sign(v @ W.T) * self.coupled_coulomb) @ W
        return tau


def drive_matrices(drive: DriveParameters, transmission: Transmission | None) -> DriveMatrices:
    """Gather drive and coupling terms, see `Transmission` for the formula.

    Parameters
    ----------
    drive : DriveParameters
        Of the n joints.
    transmission : Transmission or None
        With the terms of coupled motors.

    Returns
    -------
    DriveMatrices
        Ready to be applied to many samples.

    Examples
    --------
    >>> wrist = Transmission([[1, 0], [-1, 1]], Iam=[0, 0.1])
    >>> drive_matrices(DriveParameters.zeros(2), wrist).rotor
    array([[0. , 0.1],
           [0.1, 0. ]])
    """
    rotor, viscous = np.diag(drive.Ia), np.diag(drive.Fv)
    coupling, coulomb = np.zeros((0, drive.n)), np.zeros(0)
    if transmission is not None and transmission.coupled_motors:
        motors = np.array(transmission.coupled_motors) - 1
        coupling, coulomb = transmission.weights[motors], transmission.Fcm[motors]
        cross = np.einsum("mi,mj->mij", coupling, coupling)
        cross[:, range(drive.n), range(drive.n)] = 0.0
        rotor = rotor + np.einsum("m,mij->ij", transmission.Iam[motors], cross)
        viscous = viscous + np.einsum("m,mij->ij", transmission.Fvm[motors], cross)
    columns = (drive.Ia, drive.Fv, drive.Fc, drive.offset)
    rows = () if len(coupling) else tuple(zip(*(c.tolist() for c in columns), strict=True))
    return DriveMatrices(rotor, viscous, drive.Fc, drive.offset, coupling, coulomb, rows)
