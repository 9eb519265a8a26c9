"""Links that bend and a mount that tilts under gravity: compliance that no joint variable holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_exact, as_vector, read_only
from ..drive import Transmission
from ..errors import InvalidValueError
from ..kinematics import dgm, jacobian
from ..model import RobotModel
from ..se3.orientation import rotation_vectors_of
from ..urdf.in_place import tool_link
from .extended_table import Element, Frame, Skeleton, gravity_loads, pose_of_elements
from .parameters import ErrorLaw, GeometricParameter, GeometricParameters

_OWN = (Element.THETA, Element.R, None)  # of sigma 0, 1, 2
_DIFFERENCE = 1e-4  # rad or m: of loads, whose slope only leads Newton's steps


@dataclass(frozen=True, slots=True, eq=False)
class Bending(Rebuilt):
    """How far elements of the extended table give way where the joints read ``q_read``.

    ``element += compliance * load(q_read)``, with the gravity loads of the nominal robot.

    Parameters
    ----------
    skeleton : Skeleton
        The nominal extended table, R rows.
    elements : ndarray, shape (R, 7)
        Its elements with the constant deviations, rad and m.
    row, element, source : ndarray of int, shape (B,)
        What gives way, and the row that all the load hangs on.
    compliance : ndarray, shape (B,)
        rad or m, per N m or N.

    References
    ----------
    Seed book section 1.4.2; 1.5.1.1 for the loads.

    Examples
    --------
    >>> import numpy as np
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("erd:ur10"), compliance="links")
    >>> soft = 1e-6 * (np.array(parameters.names) == "compliance_beta3")
    >>> bending = bending_of(parameters, parameters.skeleton.nominal, soft)
    >>> bending.row, bending.given_way(np.zeros((1, 6))).shape
    (array([3]), (1, 1))
    """

    skeleton: Skeleton
    elements: Array
    row: NDArray[np.int64]
    element: NDArray[np.int64]
    source: NDArray[np.int64]
    compliance: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "elements", read_only(self.elements))
        object.__setattr__(self, "compliance", read_only(self.compliance))
        for name in ("row", "element", "source"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.int64))

    @property
    def is_zero(self) -> bool:
        """Whether nothing gives way but the joints about their own axes."""
        return not self.compliance.size

    @property
    def tilts_mount(self) -> bool:
        """Whether the base gives way."""
        return bool((self.row == 0).any())

    @property
    def bent_rows(self) -> tuple[str, ...]:
        """Names of the frames whose place on the link before gives way."""
        rows = sorted({int(row) for row in self.row if row > 0})
        return tuple(self.skeleton.row_name(row) for row in rows)

    def path_to(self, row: int) -> NDArray[np.int64]:
        """Rows from the world to a row of the extended table, the base's (0) first."""
        rows = [row]
        while rows[-1] > 0:
            rows.append(int(self.skeleton.antecedent[rows[-1]]))
        return np.array(rows[::-1], dtype=np.int64)

    def given_way(self, q_read: Array) -> Array:
        """How far each element gives way.

        Parameters
        ----------
        q_read : ndarray, shape (N, n)
            Readings, rad or m.

        Returns
        -------
        ndarray, shape (N, B)
            rad or m.
        """
        bent = [
            (int(row), Element(int(element)), int(source))
            for row, element, source in zip(self.row, self.element, self.source, strict=True)
        ]
        return gravity_loads(self.skeleton, q_read, bent) * self.compliance

    def poses(self, q_read: Array, q: Array, path: NDArray[np.int64], after: Array) -> Array:
        """World poses behind a row.

        Parameters
        ----------
        q_read, q : ndarray, shape (N, n)
            Readings, on which the loads depend, and joint variables, rad or m.
        path : ndarray of int, shape (k,)
            Rows from the world.
        after : ndarray, shape (4, 4)
            Constant pose behind the last of them, metres.

        Returns
        -------
        ndarray, shape (N, 4, 4)
            Metres.
        """
        owner = np.arange(len(self.row))
        actions = owner, self.row, self.element
        ones = np.ones(len(owner))
        return self._recursion(q, path, after, ones, actions, self.given_way(q_read), 0)[0]

    def jacobians(
        self, q_read: Array, q: Array, path: NDArray[np.int64], after: Array
    ) -> tuple[Array, Array]:
        """How what is behind a row moves with the joints, and with the readings through the loads.

        Parameters
        ----------
        q_read, q, path, after
            As for `poses`.

        Returns
        -------
        by_joint : ndarray, shape (N, 6, n)
            ``[v; w]`` per unit of q at constant loads, world axes.
        by_load : ndarray, shape (N, 6, n)
            The same per unit of q_read through the loads alone, which are differentiated by
            central differences.
        """
        skeleton, B = self.skeleton, len(self.row)
        n = skeleton.model.n
        moving = np.flatnonzero(skeleton.joint >= 0)
        own = np.array([_OWN[sigma] for sigma in skeleton.sigma[moving]], dtype=np.int64)
        # what bends is moved as it is bent, and once more by a unit of nothing, for its screw
        owner = np.concatenate([np.arange(2 * B), 2 * B + skeleton.joint[moving]])
        actions = (
            owner,
            np.concatenate([self.row, self.row, moving]),
            np.concatenate([self.element, self.element, own]),
        )
        factor = np.ones((len(q), len(owner)))
        factor[:, :B] = self.given_way(q_read)
        size = np.concatenate([np.ones(B), np.zeros(B + n)])
        screws = self._recursion(q, path, after, size, actions, factor, 2 * B + n)[1]
        steps = _DIFFERENCE * np.eye(n)
        slope = np.empty((len(q), B, n))
        for j in range(n):
            slope[..., j] = self.given_way(q_read + steps[j]) - self.given_way(q_read - steps[j])
        slope /= 2.0 * _DIFFERENCE
        return screws[..., 2 * B :], screws[..., B : 2 * B] @ slope

    def _recursion(
        self,
        q: Array,
        path: NDArray[np.int64],
        after: Array,
        size: Array,
        actions: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]],
        factor: Array,
        columns: int,
    ) -> tuple[Array, Array]:
        from ..kernels.erroneous_poses import erroneous_poses

        skeleton = self.skeleton
        T, screws = np.empty((len(q), 4, 4)), np.empty((len(q), 6, columns))
        erroneous_poses(
            np.ascontiguousarray(q), self.elements, skeleton.sigma, skeleton.joint, path,
            np.ascontiguousarray(skeleton.before[:3, :3]),
            np.ascontiguousarray(skeleton.before[:3, 3]),
            np.ascontiguousarray(after[:3, :3]), np.ascontiguousarray(after[:3, 3]),
            size, *actions, factor, T, screws,
        )  # fmt: skip
        return T, screws


def bends(parameters: GeometricParameters, entry: GeometricParameter) -> bool:
    """Whether a parameter is a compliance that does not add to the variable of its own joint."""
    if entry.law is not ErrorLaw.COMPLIANCE:
        return False
    own = entry.element is _OWN[int(parameters.skeleton.sigma[entry.row])]
    return not (own and entry.moves_own_joint and entry.source == entry.row)


def bending_of(parameters: GeometricParameters, elements: Array, deviation: ArrayLike) -> Bending:
    """The corrections that bend links or tilt the mount.

    Shapes: elements (R, 7), deviation (P,).
    """
    xi = as_exact(deviation, (len(parameters),), "deviation")
    found = [
        (*action, value)
        for entry, value in zip(parameters.entries, xi, strict=True)
        if value != 0.0 and bends(parameters, entry)
        for action in entry.actions
    ]
    where = np.array([action[:3] for action in found], dtype=np.int64).reshape(-1, 3)
    row, element, source = where.T
    compliance = np.array([action[3] for action in found], dtype=np.float64)
    return Bending(parameters.skeleton, elements, row, element, source, compliance)


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
        from ..dynamics import gravity_torque

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


class CalibratedEnd(NamedTuple):
    """A measured end of a calibrated robot.

    Attributes
    ----------
    frame : str, int or None
        As it was given to `candidate_parameters`; None is the tool.
    parent : int
        Number of the table's frame it is fixed to; 0 is R_0.
    pose : ndarray, shape (4, 4)
        In that frame with nothing bent, metres.
    row : int
        Its row of the extended table.

    Examples
    --------
    >>> CalibratedEnd(None, 6, np.eye(4), 7).parent
    6
    """

    frame: Frame
    parent: int
    pose: Array
    row: int


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class CalibratedRobot(Rebuilt):
    """A robot with its deviations applied.

    Constant deviations are in ``model``, whose variables are where the joints are;
    ``joint_errors`` lead there from what the joints read. What gravity bends elsewhere is in
    ``bending``: no model with constant elements has it. Limits and named configurations are
    those of the readings. Bodies keep their place in their own frames: inertial parameters are
    those of the nominal robot, and so is the transmission.

    Parameters
    ----------
    parameters : GeometricParameters
        What was calibrated, with the nominal robot.
    deviation : ndarray, shape (P,)
        Values.
    model : RobotModel
        The table (with beta, gamma and b), base and tool with the constant deviations in.
    structured : RobotModel
        The nominal table at the calibrated base and tool: it keeps the structure that gives a
        closed form, and errs only by the deviations of the table.
    joint_errors : JointErrors
        Gains, couplings, eccentricity and compliance of the joints about their own axes.
    bending : Bending
        Compliance of the links and of the mount.
    ends : tuple of CalibratedEnd
        Where the measured ends are.

    References
    ----------
    Seed book section 1.4.6.

    Examples
    --------
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("rx90"))
    >>> robot = calibrated_model(parameters, 1e-3 * (np.array(parameters.names) == "d3"))
    >>> float((robot.model.table.d - robot.nominal.table.d)[2].round(9))
    0.001
    """

    parameters: GeometricParameters
    deviation: Array
    model: RobotModel
    structured: RobotModel
    joint_errors: JointErrors
    bending: Bending
    ends: tuple[CalibratedEnd, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "deviation", read_only(self.deviation))

    @property
    def nominal(self) -> RobotModel:
        """The robot before the calibration."""
        return self.parameters.model

    @property
    def notes(self) -> tuple[str, ...]:
        """What ``model`` alone, or a URDF of it, does not hold, in sentences."""
        errors, notes = self.joint_errors, []
        if errors.gain.any():
            notes.append("Gains and couplings of the readings are in joint_errors, not in model.")
        if any(m.any() for m in (errors.sine, errors.cosine, errors.sine_2, errors.cosine_2)):
            notes.append("Eccentricity of the encoders is in joint_errors, not in model.")
        if errors.compliance.any():
            notes.append("Compliance of the joints is in joint_errors, not in model.")
        if not self.bending.is_zero:
            bent = self.bending.bent_rows
            what = ["tilt of the mount"] if self.bending.tilts_mount else []
            what += [f"bending before {', '.join(bent)}"] if bent else []
            notes.append(
                f"What gives way under gravity ({' and '.join(what)}) is in bending, not in model."
            )
        elsewhere = [
            self.parameters.skeleton.row_name(end.row)
            for end in self.ends
            if end.frame not in _tool_names(self.model) and not _is_named(self.model, end.frame)
        ]
        if elsewhere:
            notes.append(
                f"The errors of {', '.join(elsewhere)} are in ends: the model has no frame that "
                "could hold them."
            )
        return tuple(notes)

    def end(self, frame: Frame = None) -> CalibratedEnd | None:
        """A measured end.

        Parameters
        ----------
        frame : str, int or None
            Any frame of the model; None, or its name, is the tool.

        Returns
        -------
        CalibratedEnd or None
            None for a frame that was not a measured end.
        """
        for end in self.ends:
            if _same(end.frame, frame):
                return end
        names = _tool_names(self.model)
        return next((e for e in self.ends if frame in names and e.frame in names), None)

    def with_tool_at(self, frame: Frame) -> Self:
        """The same robot whose tool is another measured end, so that inverse models serve it.

        Parameters
        ----------
        frame : str, int or None
            One of the ends.

        Returns
        -------
        CalibratedRobot
            With ``model`` and ``structured`` that carry the end as their tool.

        Raises
        ------
        InvalidValueError
            Not a measured end, or one that no joint moves.
        """
        end = self.end(frame)
        if end is None or end.parent < 1:
            known = [e.frame for e in self.ends if e.parent >= 1]
            raise InvalidValueError(
                f"frame: expected one of the measured ends that joints move, {known}, got "
                f"{frame!r}."
            )
        tool = end._replace(frame=None)
        others = tuple(e for e in self.ends if e.frame is not None)
        return replace(
            self,
            model=self.model.with_tool(end.pose, end.parent),
            structured=self.structured.with_tool(end.pose, end.parent),
            ends=(*others, tool),
        )


def calibrated_model(parameters: GeometricParameters, deviation: ArrayLike) -> CalibratedRobot:
    """The robot that some deviations describe.

    Parameters
    ----------
    parameters : GeometricParameters
        P parameters of a nominal robot.
    deviation : array_like, shape (P,)
        Their values, added to the nominal ones (rad, m, or the unit of the parameter).

    Returns
    -------
    CalibratedRobot
        ``calibrated_pose`` of it equals ``differential_model(parameters, q, deviation).T``.

    Raises
    ------
    ShapeError, InvalidValueError
        Not P finite numbers; laws of the readings on elements that no joint moves.

    References
    ----------
    Seed book section 1.4.6.

    Examples
    --------
    >>> from robotmodels.calibration import calibrated_pose, candidate_parameters
    >>> from robotmodels.calibration import differential_model
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("rx90"), gains=True)
    >>> xi = 1e-3 * np.random.default_rng(0).normal(size=len(parameters))
    >>> q = [0.1, -0.4, 0.8, 0.2, 0.6, -0.3]
    >>> T = calibrated_pose(calibrated_model(parameters, xi), q)
    >>> np.allclose(T, differential_model(parameters, q, xi).T, atol=1e-14)
    True
    """
    xi = as_exact(deviation, (len(parameters),), "deviation")
    skeleton, nominal = parameters.skeleton, parameters.model
    elements = skeleton.nominal.copy()
    for entry, value in zip(parameters.entries, xi, strict=True):
        if entry.law is ErrorLaw.CONSTANT:
            elements[entry.row, entry.element] += value
    f = nominal.f
    changed = [bool((elements[row] != skeleton.nominal[row]).any()) for row in range(len(elements))]
    # what is not off stays as it is, to the last digit
    base = skeleton.before @ pose_of_elements(elements[0]) if changed[0] else nominal.base
    ends = []
    for k, frame in enumerate(skeleton.frames):
        found = nominal.twin.frame(frame)
        if changed[1 + f + k]:
            pose = pose_of_elements(elements[1 + f + k]) @ skeleton.after[k]
        else:
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = found.rotation, found.position
        ends.append(CalibratedEnd(frame, found.parent, read_only(pose), 1 + f + k))
    columns = {e.word: elements[1 : 1 + f, e] for e in Element}
    by_name = [end for end in ends if end.frame in _tool_names(nominal)]
    tool = min(by_name, key=lambda end: end.frame is not None).pose if by_name else nominal.tool
    poses = {end.frame: end.pose for end in ends if isinstance(end.frame, str)}
    model = replace(
        with_moved_tool(nominal, tool, poses),
        table=nominal.table.replace(**columns),
        base=base,
        notes=(*nominal.notes, f"Calibrated: {int(np.count_nonzero(xi))} parameters are off."),
    )
    return CalibratedRobot(
        parameters=parameters,
        deviation=xi,
        model=model,
        structured=nominal.with_base(base).with_tool(tool),
        joint_errors=joint_errors_of(parameters, xi),
        bending=bending_of(parameters, elements, xi),
        ends=tuple(ends),
    )


def with_moved_tool(
    model: RobotModel, tool: Array, poses: Mapping[str, Array] = MappingProxyType({})
) -> RobotModel:
    """Model with another tool pose, applied also to the tool's URDF link."""
    link = tool_link(model.parts)
    poses = {**({} if link is None else {link: tool}), **poses}
    frames = (replace(named, pose=poses.get(named.name, named.pose)) for named in model.frames)
    return replace(model, tool=tool, frames=tuple(frames))


def as_calibrated(robot: Any) -> CalibratedRobot:
    """Calibrated robot from itself or from the result of a fit."""
    found = getattr(robot, "robot", robot)
    if not isinstance(found, CalibratedRobot):
        raise InvalidValueError(
            "robot: expected a CalibratedRobot or a CalibrationResult, got "
            f"{type(robot).__name__}; make one with fit(...) or calibrated_model(parameters, "
            "deviation)."
        )
    return found


def _same(a: Frame, b: Frame) -> bool:
    return type(a) is type(b) and a == b


def _tool_names(model: RobotModel) -> tuple[str | None, ...]:
    """Names of the tool: None, its frame, and its URDF link."""
    return None, model.twin.names.tool, tool_link(model.parts)


def _is_named(model: RobotModel, frame: Frame) -> bool:
    return any(named.name == frame for named in model.frames)


def calibrated_pose(robot: CalibratedRobot, q_read: ArrayLike, frame: Frame = None) -> Array:
    """Direct geometric model of a calibrated robot, from the readings of its joints.

    Parameters
    ----------
    robot : CalibratedRobot
        The robot, n joints.
    q_read : array_like, shape (..., n)
        Readings, rad or m.
    frame : str, int or None
        A measured end or any frame of the model; None is the tool.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        World poses, metres.

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        Wrong length, NaN or infinity; an unknown frame.

    References
    ----------
    Seed book sections 1.2.2 and 1.4.6.

    Examples
    --------
    See `calibrated_model`.
    """
    readings = as_vector(q_read, robot.model.n, "q_read")
    q = robot.joint_errors.actual(readings)
    if not robot.bending.is_zero:
        n, (path, after) = robot.model.n, tip_of(robot, frame)
        T = robot.bending.poses(readings.reshape(-1, n), q.reshape(-1, n), path, after)
        return T.reshape(*q.shape[:-1], 4, 4)
    end = robot.end(frame)
    if end is None:
        return dgm(robot.model, q, frame)
    return dgm(robot.model, q, end.parent) @ end.pose


def tip_of(robot: CalibratedRobot, frame: Frame = None) -> tuple[NDArray[np.int64], Array]:
    """Path of a frame in the extended table, and its constant pose behind the path's end."""
    skeleton, end = robot.parameters.skeleton, robot.end(frame)
    if end is not None:
        return robot.bending.path_to(end.row), skeleton.after[end.row - 1 - robot.model.f]
    found, pose = robot.model.twin.frame(frame), np.eye(4)
    pose[:3, :3], pose[:3, 3] = found.rotation, found.position
    return robot.bending.path_to(found.parent), pose


def reading_jacobian(robot: CalibratedRobot, q_read: ArrayLike) -> Array:
    """Jacobian of a calibrated robot by the readings of its joints.

    Parameters
    ----------
    robot : CalibratedRobot
        The robot, n joints.
    q_read : array_like, shape (..., n)
        Readings, rad or m.

    Returns
    -------
    ndarray, shape (..., 6, n)
        ``[v; w]`` of the tool per unit of each reading, world axes; exact but for what changes
        with the loads of gravity, which is a central difference.

    Raises
    ------
    ShapeError, InvalidValueError
        Wrong length; NaN or infinity.

    References
    ----------
    Seed book sections 1.3.1 and 1.4.6.

    Examples
    --------
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.calibration.robot import calibrated_model
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("erd:ur10"), compliance="uniform")
    >>> soft = 1e-6 * np.array([name.startswith("compliance") for name in parameters.names])
    >>> reading_jacobian(calibrated_model(parameters, soft), np.zeros((5, 6))).shape
    (5, 6, 6)
    """
    n, errors = robot.model.n, robot.joint_errors
    readings = as_vector(q_read, n, "q_read")
    rows = readings.reshape(-1, n)
    q = errors.actual(rows)
    if robot.bending.is_zero:
        J = jacobian(robot.model, q) @ errors.slope(rows)
    else:
        by_joint, by_load = robot.bending.jacobians(rows, q, *tip_of(robot))
        J = by_joint @ errors.slope(rows) + by_load
    return J.reshape(*readings.shape[:-1], 6, n)


def missing_of_pose(T: Array, wanted: Array) -> Array:
    """Pose errors: translation (m) and rotation vector (rad) from each pose to the wanted one.

    Shapes: T, wanted (N, 4, 4) -> (N, 6).
    """
    turn = wanted[:, :3, :3] @ T[:, :3, :3].swapaxes(-1, -2)
    return np.concatenate([wanted[:, :3, 3] - T[:, :3, 3], rotation_vectors_of(turn)], axis=1)


def missing_slope(J: Array, phi: Array) -> Array:
    """Minus the derivative of `missing_of_pose` at a rotation error ``phi``.

    Shapes: J (N, 6, n), phi (N, 3) -> (N, 6, n).
    """
    t = np.linalg.norm(phi, axis=1)
    half = 0.5 * np.where(t < 1e-3, 1.0, t)
    c = np.where(t < 1e-3, 1.0 / 12.0 + t * t / 720.0,
                 (1.0 - half / np.tan(half)) / (4.0 * half * half))  # fmt: skip
    K = np.zeros((len(phi), 3, 3))
    K[:, [2, 0, 1], [1, 2, 0]] = phi
    K[:, [1, 2, 0], [2, 0, 1]] = -phi
    turned = np.eye(3) + 0.5 * K + c[:, None, None] * (K @ K)
    return np.concatenate([J[:, :3], turned @ J[:, 3:]], axis=1)
