"""The transmission between encoders (motors) and joints, with the coupling terms of the motors.

Book sections 1.2.1 (q = K_c q_c + q_0) and 1.6.2.5 (joint torques from motor torques).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Value, as_exact, as_floats, as_vector, read_only
from ..errors import InertiaError, InvalidValueError, ShapeError
from ..table_text import joints_text


@dataclass(frozen=True, slots=True, eq=False)
class Transmission(Value):
    """Transmission between encoders (motors) and joints: ``q = K q_c + q_0``.

    ``q_c`` are the encoder variables, usually motor angles. Power is conserved, so torques go the
    other way through the transpose: ``tau_c = K^T tau``. A motor whose shaft is turned by several
    joints (motor 6 of the Staubli TX40 by joints 5 and 6) has drive terms that couple them::

        w = row m of K^-1 divided by its diagonal entry        (for the TX40: w_5 = w_6 = 1)
        tau_j += sum over k != j of w_j w_k (Iam a_k + Fvm v_k)  +  w_j Fcm sign(w . v)

    The diagonal parts (k = j) belong to ``Ia`` and ``Fv`` of `DriveParameters`, as in the
    published TX40 identifications. Where ``q_motor = R q`` is given: `from_motor`.

    Parameters
    ----------
    matrix : array_like, shape (n, n)
        ``K``; singular only where joints mimic others.
    offset : array_like, shape (n,), optional
        ``q_0``, default zero.
    Iam, Fvm, Fcm : array_like, shape (n,), optional
        Coupling inertia, viscous and Coulomb friction of motor m, joint side, default zero.
        They must be zero for motors that turn one joint only.

    References
    ----------
    Book section 1.2.1 (last note) and 1.6.2.5; A. Janot, P.-O. Vandanjon and M. Gautier,
    Control Engineering Practice 25, 2014, section 4 (TX40, Iam6, Fvm6, Fcm6).

    Examples
    --------
    >>> wrist = Transmission.from_motor([[45.0, 0.0], [32.0, 32.0]], Iam=[0.0, 0.01])
    >>> wrist.coupled_motors, wrist.to_encoder([1.0, 0.0]), wrist.to_motor_torque([77.0, 32.0])
    ((2,), array([45., 32.]), array([1., 1.]))
    """

    matrix: Any
    offset: Any = None
    Iam: Any = None
    Fvm: Any = None
    Fcm: Any = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", read_only(_square(self.matrix)))
        n = self.n
        for name in ("offset", "Iam", "Fvm", "Fcm"):
            value = getattr(self, name)
            array = np.zeros(n) if value is None else as_exact(value, (n,), name)
            object.__setattr__(self, name, read_only(array))
        terms = (self.Iam != 0.0) | (self.Fvm != 0.0) | (self.Fcm != 0.0)
        for m in set(np.flatnonzero(terms) + 1) - set(self.coupled_motors if terms.any() else ()):
            known = f"turns one joint only, or K is singular, rank {self.rank} of {n}"
            raise InertiaError(
                f"Motor {m} {known}; its inertia and friction belong to DriveParameters (Ia, Fv, "
                f"Fc). Coupling terms are for the motors {list(self.coupled_motors)}."
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
        """The transmission of motors that turn as ``q_c = R q + r_0``: ``K = R^-1, q_0 = -K r_0``.

        Row m of R (n, n) has the turns of motor m per turn of each joint; other arguments as for
        the class.
        """
        R = _square(matrix)
        n = len(R)
        if _rank(R.T) < n:  # a row for each motor, each in units of its own
            raise InvalidValueError(
                f"matrix: R has rank {_rank(R.T)} of {n}, so that the motors do not determine the "
                "joints; check its rows, or give K of q = K q_c to Transmission itself."
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
        """Whether K is regular (no joint mimics others)."""
        return self.rank == self.n

    @property
    def is_mimicry(self) -> bool:
        """Whether K is singular as with mimic joints: independent columns, others of zeros."""
        return 0 < self.rank < self.n and self.rank == self.free.shape[1]

    @property
    def free(self) -> Array:
        """Columns of ``K`` that are not zero, shape (n, m): ``v = free v_c``."""
        return self.matrix[:, self.matrix.any(axis=0)]

    @property
    def weights(self) -> Array:
        """Turns (n, n) of motor m per turn of joint j, relative to joint m; 0 if K is singular."""
        if not self.is_invertible:
            return np.zeros((self.n, self.n))
        # relative to their joints, the units of the motors cancel
        W = np.linalg.inv(self.matrix / np.abs(self.matrix).max(axis=0))
        W[np.abs(W) < 1e-12 * np.abs(W).max()] = 0.0
        diagonal = np.diag(W).copy()
        diagonal[diagonal == 0.0] = 1.0
        return W / diagonal[:, None]

    @property
    def coupled_motors(self) -> tuple[int, ...]:
        """Numbers (from 1) of the coupled motors (turned by more than one joint)."""
        return tuple(int(m) + 1 for m in np.flatnonzero((self.weights != 0.0).sum(axis=1) > 1))

    def __str__(self) -> str:
        form = "joints mimic others" if self.is_mimicry else "K is singular"
        if self.is_invertible:
            form = f"coupled motors: {', '.join(map(str, self.coupled_motors)) or 'none'}"
        columns = {f"K {m + 1}": column for m, column in enumerate(self.matrix.T) if column.any()}
        terms = {name: getattr(self, name) for name in ("offset", "Iam", "Fvm", "Fcm")}
        shown = {"offset": self.offset} | {k: x for k, x in terms.items() if x.any()}
        return f"q = K q_c + offset of {self.n} joints; {form}.\n{joints_text(columns | shown)}"

    def to_joint(self, q_c: ArrayLike) -> Array:
        """Joint variables ``q = K q_c + q_0`` of encoder variables, both (..., n)."""
        return as_vector(q_c, self.n, "q_c") @ self.matrix.T + self.offset

    def to_encoder(self, q: ArrayLike) -> Array:
        """Encoder variables of joint variables (..., n); a singular K is an InvalidValueError."""
        q = as_vector(q, self.n, "q")
        if not self.is_invertible:
            raise InvalidValueError(
                "The transmission matrix is singular (a joint mimics another one): not every q "
                "has encoder variables. Take the master joints' values instead."
            )
        columns = (q - self.offset)[..., None]
        return np.asarray(np.linalg.solve(self.matrix, columns)[..., 0], np.float64)

    def to_motor_torque(self, tau: ArrayLike) -> Array:
        """Motor torques ``tau_c = K^T tau`` of joint torques (equal power), both (..., n)."""
        return as_vector(tau, self.n, "tau") @ self.matrix


def _square(matrix: ArrayLike) -> Array:
    """A square matrix of finite numbers."""
    K = as_floats(matrix, "matrix")
    if K.ndim != 2 or K.shape[0] != K.shape[1]:
        raise ShapeError(f"matrix: expected a square (n, n) matrix, got {K.shape}.")
    return K


def _rank(K: Array) -> int:
    """Rank of a matrix whose columns may be in any units."""
    size = np.abs(K).max(axis=0, initial=0.0)
    return int(np.linalg.matrix_rank(K[:, size > 0.0] / size[size > 0.0])) if size.any() else 0
