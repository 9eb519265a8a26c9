"""The transmission between encoders (motors) and joints, with what couples the motors.

Seed book sections 1.2.1 (q = K_c q_c + q_0) and 1.6.2.5 (joint torques from motor torques).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_floats, as_vector, read_only, same_value, value_hash
from ..errors import InertiaError, InvalidValueError, ShapeError


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
