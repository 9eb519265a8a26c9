"""The calibrated robot: a model that holds the deviations, and what no table can hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_exact, read_only
from ...errors import InvalidValueError
from ...model import RobotModel
from ...urdf.in_place import tool_link
from ..extended_table.elements import Element, ErrorLaw
from ..extended_table.parameters import GeometricParameters
from ..extended_table.six_parameters import pose_of_elements
from ..extended_table.skeleton import Frame
from .bending import Bending, bending_of
from .joint_errors import JointErrors, joint_errors_of


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
