"""The calibrated robot: a model with the constant corrections, and error laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, as_exact, as_vector, read_only
from ..errors import InvalidValueError
from ..model import RobotModel
from ..urdf.in_place import tool_link
from .differential import screws_of
from .extended_table import (
    JOINT_VARIABLE,
    Element,
    Frame,
    frame_place,
    pose_of_elements,
)
from .parameters import ErrorLaw, GeometricParameters

_STEPS = 200
_ROUNDING, _WRONG = 1e-15, 1e-12  # of joint variables, relative to the largest plus 1

_LAW_WORDS = {ErrorLaw.GAIN: "Gains", ErrorLaw.COMPLIANCE: "Compliance"}


@dataclass(frozen=True, slots=True, eq=False)
class JointErrors(Frozen):
    """Joint variables as a function of the readings, ``q = q_read + sum of values * factors``.

    ``laws`` are the P parameters that add to joint variables, ``values (P,)`` their corrections.
    """

    laws: GeometricParameters
    values: Array

    @property
    def is_zero(self) -> bool:
        """Whether readings are joint variables."""
        return not len(self.laws)

    def actual(self, q_read: ArrayLike) -> Array:
        """Joint variables of the calibrated table at readings, both (..., n), rad or m."""
        q = as_vector(q_read, self.laws.model.n, "q_read")
        return q + self._errors(q)

    def reading(self, q_actual: ArrayLike) -> Array:
        """Readings that lead to joint variables, the inverse of `actual`, by fixed-point iteration.

        NaN in rows where it does not converge: changes of the errors near those of the readings.
        """
        wanted = as_vector(q_actual, self.laws.model.n, "q_actual")
        q = wanted.copy()
        if self.is_zero or not q.size:
            return q
        size = 1.0 + np.abs(wanted).max(axis=-1, keepdims=True)
        for _ in range(_STEPS):
            missing = wanted - self.actual(q)
            off = np.abs(missing).max(axis=-1, keepdims=True) / size
            if (off <= _ROUNDING).all():
                break
            q += missing
        return np.where(off <= _WRONG, q, np.nan)

    def _errors(self, q: Array) -> Array:
        """Differences of joint variables and readings, (..., n)."""
        if self.is_zero:
            return np.zeros_like(q)
        owner, rows, _ = self.laws.actions
        effect = np.zeros((len(owner), q.shape[-1]))
        effect[np.arange(len(owner)), self.laws.table.joint[rows]] = self.values[owner]
        return (self.laws.factors(q.reshape(-1, q.shape[-1])) @ effect).reshape(q.shape)


def joint_errors_of(parameters: GeometricParameters, xi: Array) -> JointErrors:
    """The parameters whose laws add to joint variables, with their nonzero corrections (P,)."""
    table, chosen = parameters.table, []
    for k, entry in enumerate(parameters.entries):
        if entry.law is ErrorLaw.CONSTANT or parameters.bends(entry):
            continue
        for row, element, source in entry.actions:
            if element is not JOINT_VARIABLE[table.sigma[row]] or table.joint[source] < 0:
                raise InvalidValueError(
                    f"{entry.name}: expected a law from the reading of a joint to the variable of "
                    f"a joint; this one changes {element.word} of {table.row_name(row)}."
                )
        if xi[k] != 0.0:
            chosen.append(k)
    laws = replace(parameters, entries=tuple(parameters.entries[k] for k in chosen))
    return JointErrors(laws, xi[chosen])


class CalibratedEnd(NamedTuple):
    """A measured end: its frame, the frame (0 is R_0) and pose it is fixed at, and its row."""

    frame: Frame
    parent: int
    pose: Array
    row: int


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class CalibratedRobot(Frozen):
    """A robot with its corrections applied.

    Constant corrections are in ``model`` (its table has beta, gamma and b), whose variables are the
    actual joint variables; ``joint_errors.actual`` gives them from the readings. Links and a mount
    that bend under gravity are in `calibrated_pose` alone: no model with constant elements has
    them. Limits and named configurations are those of the readings. Inertial parameters, each in
    its own frame, and the transmission are those of the nominal robot.

    Parameters
    ----------
    parameters : GeometricParameters
        The calibrated parameters, with the nominal robot.
    corrections : ndarray, shape (P,)
        Their corrections (rad, m, or the unit of the parameter).
    model : RobotModel
        The model with the constant corrections of table, base and tool.
    joint_errors : JointErrors
        Gains, couplings, eccentricity and compliance of the joints about their own axes.
    ends : tuple of CalibratedEnd
        The measured ends.

    References
    ----------
    Book section 1.4.6.
    """

    parameters: GeometricParameters
    corrections: Array
    model: RobotModel
    joint_errors: JointErrors
    ends: tuple[CalibratedEnd, ...]

    @property
    def nominal(self) -> RobotModel:
        """The robot before the calibration."""
        return self.parameters.model

    @property
    def bent_rows(self) -> tuple[int, ...]:
        """Rows of the extended table that bend under gravity, 0 for the mount; mostly none."""
        p = self.parameters
        entries = [e for e, value in zip(p.entries, self.corrections, strict=True) if value != 0.0]
        return tuple(sorted({row for e in entries if p.bends(e) for row, _, _ in e.actions}))

    @property
    def notes(self) -> tuple[str, ...]:
        """Errors that ``model`` alone, or a URDF of it, does not hold, in sentences."""
        table, bent, present = self.parameters.table, self.bent_rows, self.joint_errors.laws.entries
        words = sorted({_LAW_WORDS.get(e.law, "Eccentricity") for e in present}, reverse=True)
        notes = [f"{what} of the joints: in joint_errors, not in model." for what in words]
        if bent:
            places = ", ".join(table.row_name(row) if row else "the mount" for row in bent)
            notes.append(f"Compliance before {places}: in calibrated_pose, not in model.")
        held = {*_tool_names(self.model), *(named.name for named in self.model.frames)}
        elsewhere = [table.row_name(end.row) for end in self.ends if end.frame not in held]
        if elsewhere:
            notes.append(f"Errors of {', '.join(elsewhere)}: in ends, no frame of the model.")
        return tuple(notes)

    def end(self, frame: Frame = None) -> CalibratedEnd | None:
        """The measured end at a frame (None or its name for the tool); None if not measured."""
        for end in self.ends:
            if type(end.frame) is type(frame) and end.frame == frame:
                return end
        names = _tool_names(self.model)
        return next((e for e in self.ends if frame in names and e.frame in names), None)

    def with_tool_at(self, frame: Frame) -> Self:
        """The same robot whose tool is another measured end, for `corrected_igm`."""
        end = self.end(frame)
        if end is None or end.parent < 1:
            known = [e.frame for e in self.ends if e.parent >= 1]
            raise InvalidValueError(
                f"frame: expected one of the measured ends that joints move, {known}, got "
                f"{frame!r}."
            )
        return replace(
            self,
            model=self.model.with_tool(end.pose, end.parent),
            ends=(*(e for e in self.ends if e.frame is not None), end._replace(frame=None)),
        )


def calibrated_model(parameters: GeometricParameters, corrections: ArrayLike) -> CalibratedRobot:
    """The robot with given corrections.

    Parameters
    ----------
    parameters, corrections
        See `robotmodels.calibration`.

    Returns
    -------
    CalibratedRobot
        ``calibrated_pose`` of it equals ``differential_model(parameters, q, corrections).T``.

    Examples
    --------
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.robots import load
    >>> robot = calibrated_model(candidate_parameters(load("lab_rr")), np.full(18, 1e-3))
    >>> float((robot.model.table.d - robot.nominal.table.d)[1].round(9))
    0.001
    """
    xi = as_exact(corrections, (len(parameters),), "corrections")
    table, nominal = parameters.table, parameters.model
    elements = table.nominal.copy()
    for entry, value in zip(parameters.entries, xi, strict=True):
        if entry.law is ErrorLaw.CONSTANT:
            elements[entry.row, entry.element] += value
    f = nominal.f
    changed = (elements != table.nominal).any(axis=1)
    # poses without corrections stay equal to the last digit
    base = table.before @ pose_of_elements(elements[0]) if changed[0] else nominal.base
    ends = []
    for row, frame in enumerate(table.frames, 1 + f):
        parent, pose = frame_place(nominal, frame)
        if changed[row]:
            pose = pose_of_elements(elements[row]) @ table.after[row - 1 - f]
        ends.append(CalibratedEnd(frame, parent, read_only(pose), row))
    tools = [end for end in ends if end.frame in _tool_names(nominal)]
    tool = min(tools, key=lambda end: end.frame is not None).pose if tools else nominal.tool
    named = {end.frame: end.pose for end in ends if isinstance(end.frame, str)}
    model = replace(
        with_moved_tool(nominal, tool, named),
        table=nominal.table.replace(**{e.word: elements[1 : 1 + f, e] for e in Element}),
        base=base,
        notes=(*nominal.notes, f"Calibrated: {np.count_nonzero(xi)} corrections."),
    )
    return CalibratedRobot(
        parameters=parameters,
        corrections=xi,
        model=model,
        joint_errors=joint_errors_of(parameters, xi),
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
    calibrated = getattr(robot, "robot", robot)
    if not isinstance(calibrated, CalibratedRobot):
        raise InvalidValueError(
            "robot: expected a CalibratedRobot or a CalibrationResult, got "
            f"{type(robot).__name__}; make one with fit(...) or calibrated_model(parameters, "
            "corrections)."
        )
    return calibrated


def calibrated_pose(robot: CalibratedRobot, q_read: ArrayLike, frame: Frame = None) -> Array:
    """Direct geometric model of a calibrated robot, from the readings of its joints.

    Parameters
    ----------
    robot, q_read, frame
        See `robotmodels.calibration`; the frame is a measured end or any frame of the model.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        World poses, metres; an example is at `calibrated_model`.
    """
    p, n = robot.parameters, robot.model.n
    readings = as_vector(q_read, n, "q_read")
    q = readings.reshape(-1, n)
    path, after = _path_of(robot, frame)
    T, _ = screws_of(p.table, q, path, after, robot.corrections, p.actions, p.factors(q), 0)
    return T.reshape(*readings.shape[:-1], 4, 4)


def _path_of(robot: CalibratedRobot, frame: Frame = None) -> tuple[NDArray[np.int64], Array]:
    """Path of a frame in the extended table, and its constant pose behind the path's end."""
    table, end = robot.parameters.table, robot.end(frame)
    if end is not None:
        return table.path_to(end.row), table.after[end.row - 1 - robot.model.f]
    parent, pose = frame_place(robot.model, frame)
    return table.path_to(parent), pose


def _tool_names(model: RobotModel) -> tuple[str | None, ...]:
    """Names of the tool: None, its frame, and its URDF link."""
    return None, model.twin.names.tool, tool_link(model.parts)
