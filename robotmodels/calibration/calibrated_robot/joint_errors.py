"""From the reading of the joints to where they are: the errors that no table can hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_exact, as_vector, read_only
from ...drive import Transmission
from ...errors import InvalidValueError
from ...model import RobotModel
from ..extended_table.elements import Element, ErrorLaw
from ..extended_table.parameters import GeometricParameters
from .bending import bends

_ROUNDING = 4e-15
_ROUNDS = 60
_STEPS = 30
_DIFFERENCE = 1e-4  # of a gravity torque: its error only slows Newton's steps down

_FIELDS = {
    ErrorLaw.GAIN: "gain",
    ErrorLaw.SINE: "sine",
    ErrorLaw.COSINE: "cosine",
    ErrorLaw.SINE_2: "sine_2",
    ErrorLaw.COSINE_2: "cosine_2",
    ErrorLaw.COMPLIANCE: "compliance",
}


@dataclass(frozen=True, slots=True, eq=False)
class JointErrors(Rebuilt):
    """How far the joints are from their readings.

    ::

        q = q_read + G q_read + A sin(q_read) + B cos(q_read) + A2 sin(2 q_read)
            + B2 cos(2 q_read) - C g(q_read)

    with g the gravity torques of the nominal robot. Element (j, i) of a matrix is the effect of
    what joint i reads (or carries) on joint j. Constant offsets are the table's.

    Parameters
    ----------
    model : RobotModel
        The nominal robot, n joints.
    gain, sine, cosine, sine_2, cosine_2, compliance : ndarray, shape (n, n)
        G, A, B, A2, B2 (rad or m per rad, m or 1) and C (rad or m, per N m or N).

    References
    ----------
    Seed book section 1.4.2 (``q = K q_c + q_0``).

    Examples
    --------
    >>> import numpy as np
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("rx90"), gains=True)
    >>> errors = joint_errors_of(parameters, 0.01 * (np.array(parameters.names) == "gain2"))
    >>> errors.actual([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])[1]
    np.float64(1.01)
    >>> errors.reading([0.0, 1.01, 0.0, 0.0, 0.0, 0.0])[1].round(12)
    np.float64(1.0)
    """

    model: RobotModel
    gain: Array
    sine: Array
    cosine: Array
    sine_2: Array
    cosine_2: Array
    compliance: Array

    def __post_init__(self) -> None:
        n = self.model.n
        for name in _FIELDS.values():
            matrix = as_exact(getattr(self, name), (n, n), name)
            object.__setattr__(self, name, read_only(matrix))

    @property
    def is_zero(self) -> bool:
        """Whether the joints are where they read."""
        return not any(getattr(self, name).any() for name in _FIELDS.values())

    @property
    def is_affine(self) -> bool:
        """Whether there are only gains, so that a `Transmission` can hold the law."""
        return not any(getattr(self, name).any() for name in _FIELDS.values() if name != "gain")

    def actual(self, q_read: ArrayLike) -> Array:
        """Joint variables from their readings.

        Parameters
        ----------
        q_read : array_like, shape (..., n)
            Readings, rad or m.

        Returns
        -------
        ndarray, shape (..., n)
            Joint variables of the calibrated table, rad or m.

        Raises
        ------
        ShapeError, InvalidValueError
            Wrong length; NaN or infinity.

        References
        ----------
        Seed book section 1.4.2.

        Examples
        --------
        See `JointErrors`.
        """
        q = as_vector(q_read, self.model.n, "q_read")
        return q + self._error(q)

    def reading(self, q_actual: ArrayLike) -> Array:
        """Readings at which the joints are where they are wanted, the inverse of `actual`.

        By a fixed-point iteration on the part beside the gains, which small errors contract
        quickly; by Newton's method where it does not settle.

        Parameters
        ----------
        q_actual : array_like, shape (..., n)
            Joint variables of the calibrated table, rad or m.

        Returns
        -------
        ndarray, shape (..., n)
            Readings, to rounding; NaN in rows where no reading was found (errors so large that
            the readings do not go up with the joints).

        Raises
        ------
        ShapeError, InvalidValueError
            Wrong length, NaN or infinity; gains that take all motion away.

        References
        ----------
        Seed book section 1.4.2.

        Examples
        --------
        See `JointErrors`.
        """
        n = self.model.n
        wanted = as_vector(q_actual, n, "q_actual")
        if self.is_zero:
            return wanted.copy()
        rows = wanted.reshape(-1, n)
        K = np.eye(n) + self.gain
        if np.linalg.matrix_rank(K) < n:
            raise InvalidValueError(
                "gain: 1 + G is singular, so that some joints do not move with any reading; a "
                "gain error is small beside 1."
            )
        inverse = np.asarray(np.linalg.inv(K), np.float64)
        q = rows @ inverse.T
        if not self.is_affine:
            q = self._settled(q, rows, inverse)
        else:
            q = q + (rows - self.actual(q)) @ inverse.T  # the inverse's rounding
        return q.reshape(wanted.shape)

    def slope(self, q_read: ArrayLike) -> Array:
        """Derivative of `actual` by the readings.

        Parameters
        ----------
        q_read : array_like, shape (..., n)
            Readings, rad or m.

        Returns
        -------
        ndarray, shape (..., n, n)
            Exact but for the compliance, whose part is a central difference.

        Raises
        ------
        ShapeError, InvalidValueError
            Wrong length; NaN or infinity.

        References
        ----------
        Seed book section 1.4.2.

        Examples
        --------
        >>> from robotmodels.calibration import candidate_parameters
        >>> from robotmodels.robots import load
        >>> parameters = candidate_parameters(load("lab_rr"), gains=True)
        >>> deviation = 0.01 * (np.array(parameters.names) == "gain2")
        >>> joint_errors_of(parameters, deviation).slope([0.0, 1.0])
        array([[1.  , 0.  ],
               [0.  , 1.01]])
        """
        n = self.model.n
        q = as_vector(q_read, n, "q_read")[..., None, :]
        D = (
            np.eye(n) + self.gain
            + self.sine * np.cos(q) - self.cosine * np.sin(q)
            + 2.0 * (self.sine_2 * np.cos(2.0 * q) - self.cosine_2 * np.sin(2.0 * q))
        )  # fmt: skip
        if self.compliance.any():
            steps = _DIFFERENCE * np.eye(n)
            change = self._gravity(q + steps) - self._gravity(q - steps)
            change /= 2.0 * _DIFFERENCE
            D = D - self.compliance @ change.swapaxes(-1, -2)
        return D

    def _error(self, q: Array) -> Array:
        error = q @ self.gain.T
        for law, of in ((self.sine, np.sin), (self.cosine, np.cos)):
            if law.any():
                error += of(q) @ law.T
        for law, of in ((self.sine_2, np.sin), (self.cosine_2, np.cos)):
            if law.any():
                error += of(2.0 * q) @ law.T
        if self.compliance.any():
            error -= self._gravity(q) @ self.compliance.T
        return error

    def _gravity(self, q: Array) -> Array:
        from ...dynamics import gravity_torque

        return gravity_torque(self.model, q)

    def _settled(self, q: Array, wanted: Array, inverse: Array) -> Array:
        """Fixed point, then Newton's steps for the rows that are left."""
        floor = _ROUNDING * (1.0 + np.abs(wanted).max(axis=-1, initial=0.0))
        moving = np.arange(len(q))
        last = np.full(len(q), np.inf)
        for _ in range(_ROUNDS):
            step = (wanted[moving] - self.actual(q[moving])) @ inverse.T
            size = np.abs(step).max(axis=-1, initial=0.0)
            q[moving] += step
            # contraction that is slower than this is left to Newton
            going = (size > floor[moving]) & (size < 0.2 * last[moving])
            last[moving] = size
            moving = moving[going]
            if not moving.size:
                break
        floor *= 5.0
        left = np.flatnonzero(np.abs(self.actual(q) - wanted).max(axis=-1, initial=0.0) > floor)
        if not left.size:
            return q
        x = wanted[left] @ inverse.T
        best = np.abs(self.actual(x) - wanted[left]).max(axis=-1)
        for _ in range(_STEPS):
            D = self.slope(x)
            # the shortest step where the slope is singular
            step = (np.linalg.pinv(D) @ (wanted[left] - self.actual(x))[..., None])[..., 0]
            step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=-1), 0.5))[:, None]
            error = np.abs(self.actual(x + step) - wanted[left]).max(axis=-1)
            keep = error < best
            step[~keep] *= 0.5
            x = x + step
            best = np.abs(self.actual(x) - wanted[left]).max(axis=-1)
            if (best <= floor[left]).all():
                break
        x[best > floor[left]] = np.nan
        q[left] = x
        return q


def joint_errors_of(parameters: GeometricParameters, deviation: ArrayLike) -> JointErrors:
    """The part of some deviations that depends on the readings.

    Parameters
    ----------
    parameters : GeometricParameters
        P parameters.
    deviation : array_like, shape (P,)
        Their values.

    Returns
    -------
    JointErrors
        Gains, eccentricities and compliances of joints about their own axes; what bends links or
        tilts the mount is not among them, see `bending_of`.

    Raises
    ------
    ShapeError, InvalidValueError
        Not P finite numbers; a law that acts on an element which is not a joint's own variable.

    References
    ----------
    Seed book section 1.4.2.

    Examples
    --------
    See `JointErrors`.
    """
    xi = as_exact(deviation, (len(parameters),), "deviation")
    skeleton, n = parameters.skeleton, parameters.model.n
    laws = {name: np.zeros((n, n)) for name in _FIELDS.values()}
    for entry, value in zip(parameters.entries, xi, strict=True):
        if entry.law is ErrorLaw.CONSTANT or bends(parameters, entry):
            continue
        for row, element, source_row in entry.actions:
            own = (Element.THETA, Element.R, None)[int(skeleton.sigma[row])]
            source = int(skeleton.joint[source_row])
            if element is not own or source < 0:
                raise InvalidValueError(
                    f"{entry.name}: a law of the readings acts on the variable of a joint, and "
                    f"reads one; this one acts on {element.word} of {skeleton.row_name(row)}."
                )
            laws[_FIELDS[entry.law]][int(skeleton.joint[row]), source] += value
    return JointErrors(parameters.model, **laws)


def encoder_transmission(errors: JointErrors) -> Transmission:
    """Gains and couplings composed with the transmission that is there: ``q = K q_c + q_0``.

    Takes the place of ``model.transmission`` together with `JointErrors`: the joint variables it
    gives are those of the calibrated table already.

    Parameters
    ----------
    errors : JointErrors
        Gains only.

    Returns
    -------
    Transmission
        ``K' = (1 + G) K`` and ``q_0' = (1 + G) q_0``; K = 1 where the robot has none.

    Raises
    ------
    InvalidValueError
        Eccentricity or compliance, which no constant matrix holds.
    InertiaError
        Terms of a coupled motor which the gains take out of its coupling.

    References
    ----------
    Seed book section 1.2.1 (last note) and 1.4.2.

    Examples
    --------
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("lab_rr"), gains=True)
    >>> deviation = 0.01 * (np.array(parameters.names) == "gain2")
    >>> encoder_transmission(joint_errors_of(parameters, deviation)).to_joint([1.0, 1.0])
    array([1.  , 1.01])
    """
    if not errors.is_affine:
        raise InvalidValueError(
            "errors: eccentricity and compliance are no linear law of the encoders; use "
            "JointErrors.actual and reading."
        )
    there = errors.model.transmission
    K = np.eye(errors.model.n) + errors.gain
    if there is None:
        return Transmission(K)
    return Transmission(K @ there.matrix, K @ there.offset, there.Iam, there.Fvm, there.Fcm)
