"""The models that are written as code, and the function that makes a program of any of them."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Literal, NamedTuple

import numpy as np

from ..drive import Drives, drive_kinds
from ..dynamics import ddm
from ..dynamics.direct import free_motion
from ..errors import InvalidValueError, SingularMassMatrixError, nearest_names
from ..igm import IGMStatus
from ..inertia import PARAMETERS
from ..model import RobotModel, check_model
from ..regressors import parameter_names
from . import dynamics
from .dynamics import Parameters
from .geometry import Frames, carried, constant_pose, frames_of, jacobian, pose_of
from .inputs import (
    Draft,
    comment,
    dynamic_parameters,
    geometric_parameters,
    identifier,
    joint_notes,
)
from .inverse import inverse_model
from .source import Program
from .tape import Number, Port

ModelName = Literal[
    "dgm", "jacobian", "idm", "mass_matrix", "bias", "gravity_torque", "torque_regressor",
    "base_regressor", "ddm", "igm",
]  # fmt: skip
_STATES, _ROUNDING = 10, 1e-13
Rows = list[tuple[Port, list[Number]]]
"""Outputs with their elements."""


class _Kind(NamedTuple):
    """A model: its name in words, inputs, the arguments that it accepts, outputs in words."""

    title: str
    inputs: tuple[str, ...]
    accepts: tuple[str, ...]
    result: str


_DYNAMIC = ("parameters", "geometry")
_KINDS = {
    "dgm": _Kind(
        "direct geometric model", ("q",), ("geometry", "frame"), "T: pose in the world [m]"
    ),
    "jacobian": _Kind(
        "Jacobian", ("q",), ("geometry", "frame"), "J: rows v, w of the frame's origin, world axes"
    ),
    "idm": _Kind(
        "inverse dynamic model", ("q", "v", "a"), (*_DYNAMIC, "wrench"),
        "tau: torques [N m] or forces [N]",
    ),
    "mass_matrix": _Kind("mass matrix", ("q",), _DYNAMIC, "M: [kg m^2], [kg m], [kg]"),
    "bias": _Kind(
        "torques of motion without acceleration", ("q", "v"), (*_DYNAMIC, "wrench"),
        "h: torques [N m] or forces [N] of idm at a = 0",
    ),
    "gravity_torque": _Kind(
        "gravity torques", ("q",), _DYNAMIC, "Q: torques [N m] or forces [N]"
    ),
    "torque_regressor": _Kind(
        "torque regressor", ("q", "v", "a"), ("geometry",),
        "W: torques per unit of the standard parameters",
    ),
    "base_regressor": _Kind(
        "torque regressor of the base parameters", ("q", "v", "a"), ("geometry",),
        "W: torques per unit of the base parameters",
    ),
    "ddm": _Kind(
        "direct dynamic model", ("q", "v", "tau"), (*_DYNAMIC, "wrench"),
        "a: accelerations [rad/s^2] or [m/s^2]",
    ),
    "igm": _Kind(
        "inverse geometric model", ("T",), (),
        "q: postures, a row for each branch, NaN if it does not exist; "
        "valid: 1 for postures that exist, else 0; status: see below",
    ),
}  # fmt: skip
_INPUTS = {
    "q": "joint variables [rad] or [m]",
    "v": "velocities [rad/s] or [m/s]",
    "a": "accelerations [rad/s^2] or [m/s^2]",
    "tau": "torques [N m] or forces [N]",
    "T": "pose of the tool in the world [m]",
    "wrench": "force [N] and moment [N m] of the tool on its environment, at the tool, world axes",
    "geometry": "geometric parameters [m] or [rad]",
    "parameters": "dynamic parameters [kg m^2], [kg m], [kg], friction in joint units",
}


def program(
    model: RobotModel,
    kind: ModelName,
    parameters: Literal["numbers", "symbols", "base"] = "numbers",
    geometry: Literal["numbers", "symbols"] = "numbers",
    drive: Drives = True,
    wrench: bool = False,
    frame: str | int | None = None,
) -> Program:
    """Write a model of a robot as straight-line code: Khalil's customised symbolic models.

    The recursion runs once over the scalars of a tape: operations on constants are carried out,
    zeros and ones removed, equal operations shared, what no result needs is dropped. With
    numbers, the links have their base parameters, which are fewer.

    Parameters
    ----------
    model : RobotModel
        The robot of n joints.
    kind : str
        ``"dgm"``, ``"jacobian"`` (world-aligned), ``"idm"``, ``"mass_matrix"``, ``"bias"`` (`idm`
        without acceleration), ``"gravity_torque"``, ``"torque_regressor"``, ``"base_regressor"``,
        ``"ddm"`` or ``"igm"`` (arms that Paul's equations solve).
    parameters : {"numbers", "symbols", "base"}
        Dynamic parameters: those of the model; all standard ones as the last input
        (`parameter_names`); the base parameters of `base_parameters` as the last input, where
        ``drive=True`` stands for ``("Ia", "Fv", "Fc")`` and offsets are those of the model.
    geometry : {"numbers", "symbols"}
        Geometric parameters: those of the table; or lengths that are not zero, and what
        ``DHTable.symbols`` names, as an input before the parameters. Base, tool and gravity are
        numbers.
    drive : bool or collection of DriveKind or str
        Terms of the drives, coupled motors included: all, none, or some kinds. `gravity_torque`
        has none.
    wrench : bool
        Whether `idm`, `bias` and `ddm` have an input ``[f; m]`` as in `robotmodels.idm`.
    frame : str or int, optional
        Of `dgm` and `jacobian`; default the tool.

    Returns
    -------
    Program
        Runs, counts its operations, and prints itself as code.

    Raises
    ------
    InvalidValueError
        An unknown model or choice; an argument that the model does not have; an arm without a plan
        for ``"igm"``.
    FrameNotFoundError
        No such frame.
    SingularMassMatrixError, InertiaError
        `ddm` of a robot whose mass matrix is not positive definite.

    Notes
    -----
    ``"igm"`` returns all branches ``q (S, n)`` in (-pi, pi], ``valid (S,)`` and a ``status`` of
    `IGMStatus`: ``REACHED``; ``REACHED_FAMILY``: a joint that the pose leaves free is 0;
    ``INCOMPLETE``: near a singular pose, where postures may be missing or appear twice;
    ``NOT_CONVERGED``: no posture. Code does not check its inputs.

    References
    ----------
    Seed book sections 1.2.3.2, 1.5.2 and 1.5.3; W. Khalil and J.-F. Kleinfinger, IEEE Journal of
    Robotics and Automation 3(6), 1987.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> arm = program(load("rx90"), "idm", parameters="base", drive=False)
    >>> arm.inputs[-1]
    Port(name='parameters', shape=(36,))
    >>> print(program(load("planar_2r"), "dgm", frame=1).code("python").splitlines()[-1])
        return T
    """
    check_model(model)
    given = {"parameters": parameters, "geometry": geometry, "wrench": wrench, "frame": frame}
    _check(kind, given)
    draft = Draft(model, drive_kinds(drive))
    for name in (*_KINDS[kind].inputs, *("wrench",) * bool(wrench)):
        draft.input(name, {"T": (4, 4), "wrench": (6,)}.get(name, (model.n,)))
    if kind == "igm":
        return _finished(draft, kind, _inverse(draft))
    constant = geometric_parameters(draft) if geometry == "symbols" else None
    own: Parameters = {}
    if "parameters" in _KINDS[kind].accepts:
        own, simpler = dynamic_parameters(draft, parameters, constant is not None)
        if simpler is not None and _same_torques(model, own, simpler):
            own = simpler
    at_rest = np.flatnonzero(model.chain.joint < 0).tolist()
    heavy = any(f"{name}{k + 1}" in own for k in at_rest for name in PARAMETERS)
    frames = frames_of(model, draft.scalars["q"], constant, heavy or kind == "torque_regressor")
    if kind in ("dgm", "jacobian"):
        return _finished(draft, kind, _geometric(draft, kind, frames, frame))
    return _finished(draft, kind, _dynamic(draft, kind, frames, own))


def _check(kind: str, given: dict[str, Any]) -> None:
    """Refuse unknown models and choices, and arguments that a model does not have."""
    if not isinstance(kind, str) or kind not in _KINDS:
        near = nearest_names(str(kind), _KINDS)
        meant = f" Did you mean {near[0]!r}?" if near else ""
        words = ", ".join(map(repr, _KINDS))
        raise InvalidValueError(f"kind: expected one of {words}, got {kind!r:.60}.{meant}")
    choices = {
        "parameters": ("numbers", "symbols", "base"),
        "geometry": ("numbers", "symbols"),
        "wrench": (False, True),
    }
    for name, words in choices.items():
        if isinstance(given[name], np.ndarray) or given[name] not in words:
            listed = ", ".join(map(repr, words))
            raise InvalidValueError(f"{name}: expected one of {listed}, got {given[name]!r:.60}.")
    for name, value in given.items():
        if name not in _KINDS[kind].accepts and value not in ("numbers", False, None):
            able = ", ".join(repr(k) for k, row in _KINDS.items() if name in row.accepts)
            raise InvalidValueError(
                f"{name}: {kind!r} has no {name}={value!r:.40}; {able} have it. {_WHY[name]}"
            )


_WHY = {
    "parameters": "Geometric models have no dynamic parameters, and a regressor multiplies them.",
    "geometry": "Paul's equations are derived for the numbers of a table; explain_igm prints them "
    "with its symbols.",
    "wrench": "Only torques and accelerations depend on it.",
    "frame": "Dynamic models are those of all links; an inverse model is that of the tool.",
}


def _same_torques(model: RobotModel, own: Parameters, other: Parameters) -> bool:
    """Whether two sets of parameters have the same torques, to rounding."""
    draft = Draft(model, ())
    q, v, a = (draft.input(name, (model.n,)) for name in "qva")
    frames = frames_of(model, q, heavy=True)
    results = [dynamics.inverse_dynamics(model, frames, x, v, a, {}) for x in (own, other)]
    states = np.random.default_rng(0).normal(size=(3, model.n, _STATES))
    torques = draft.tape.frozen(results).run(list(states))
    first, second = (np.array([np.broadcast_to(x, _STATES) for x in row]) for row in torques)
    off, size = (np.abs(x).max(initial=0.0) for x in (first - second, first))
    return bool(off <= _ROUNDING * size)


def _inverse(draft: Draft) -> Rows:
    """All postures of a pose."""
    model = draft.model
    q, valid, status = inverse_model(model, draft.tape, draft.scalars["T"])
    S = len(valid)
    draft.notes += ["status (without a posture all rows of q are NaN):"]
    for code in (
        IGMStatus.REACHED, IGMStatus.REACHED_FAMILY, IGMStatus.NOT_CONVERGED, IGMStatus.INCOMPLETE
    ):  # fmt: skip
        more = {
            IGMStatus.REACHED_FAMILY: " Joints that are free are 0.",
            IGMStatus.INCOMPLETE: " It is near a singular pose.",
        }
        draft.notes.append(f"  {int(code)}: {code.sentence}{more.get(code, '')}")
    return [
        (Port("q", (S, model.n)), q),
        (Port("valid", (S,)), valid),
        (Port("status", ()), status),
    ]


def _geometric(draft: Draft, kind: str, frames: Frames, frame: str | int | None) -> Rows:
    """Pose of a frame, or its Jacobian."""
    model = draft.model
    if frame is not None:
        model.twin.frame(frame)
        draft.notes.append(f"of the frame {comment(str(frame))}")
    number, (R, p) = pose_of(model, frames, frame)
    if kind == "jacobian":
        columns = jacobian(frames, number, p, model.n)
        rows = [columns[j][i] for i in range(6) for j in range(model.n)]
        return [(Port("J", (6, model.n)), rows)]
    elements = [x for row, d in zip(R, p, strict=True) for x in (*row, d)]
    return [(Port("T", (4, 4)), [*elements, 0.0, 0.0, 0.0, 1.0])]


def _dynamic(draft: Draft, kind: str, frames: Frames, own: Parameters) -> Rows:
    """Torques, masses, regressors or accelerations."""
    model, scalars = draft.model, draft.scalars
    n, zero = model.n, [0.0] * model.n
    v, a = scalars.get("v", zero), scalars.get("a", zero)
    if "regressor" in kind:
        names = draft.base().names
        if kind == "torque_regressor":
            names = parameter_names(model, draft.kinds)
        draft.notes.append(f"columns: {', '.join(names)}")
        columns = dynamics.regressor(model, frames, names, v, a)
        rows = [column[i] for i in range(n) for column in columns]
        return [(Port("W", (n, len(names))), rows)]
    if kind == "mass_matrix":
        M = dynamics.mass_matrix(model, frames, own)
        return [(Port("M", (n, n)), [x for row in M for x in row])]
    if kind == "gravity_torque":
        own = {name: x for name, x in own.items() if not name.startswith(_DRIVE_TERMS)}
    tool: dict[int, dynamics.Wrench] = {}
    if "wrench" in scalars:
        number, place = carried(model, frames, None)
        point = constant_pose(place)[1]
        tool = dynamics.tool_wrench(frames, number, point, scalars["wrench"])
    tau = dynamics.inverse_dynamics(model, frames, own, v, a, tool)
    if kind != "ddm":
        return [(Port(_KINDS[kind].result.split(":")[0], (n,)), tau)]
    return [(Port("a", (n,)), _accelerations(draft, frames, own, tau))]


_DRIVE_TERMS = ("Ia", "Fv", "Fc", "offset")


def _accelerations(
    draft: Draft, frames: Frames, own: Parameters, bias: Sequence[Number]
) -> list[Number]:
    """Accelerations by the mass matrix; joints that mimic others follow them."""
    model, n = draft.model, draft.model.n
    G = None if model.transmission is None else free_motion(model.transmission)
    if model.inertia.values.any() or model.drive.Ia.any():
        at = np.zeros(n) if model.transmission is None else model.transmission.offset
        ddm(model, at, np.zeros(n), np.zeros(n), drive=bool(draft.kinds))  # refuses singular masses
    M = dynamics.mass_matrix(model, frames, own)
    rest = [x - y for x, y in zip(draft.scalars["tau"], bias, strict=True)]
    try:
        if G is None:
            return dynamics.solved(M, rest)
        draft.notes.append("joints that mimic others follow them; q and v must do so too")
        free = G.T.tolist()
        MG = [[_dot(row, column) for column in free] for row in M]
        reduced = [[_dot(row, [x[j] for x in MG]) for j in range(len(free))] for row in free]
        x = dynamics.solved(reduced, [_dot(row, rest) for row in free])
        return [_dot(row, x) for row in G.tolist()]
    except ZeroDivisionError:
        raise SingularMassMatrixError(
            f"model: the mass matrix of {model.name!r} is singular. Give inertial parameters with "
            "model.with_inertia(...), or rotor inertias Ia with model.with_drive(...)."
        ) from None


def _dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)


def _finished(draft: Draft, kind: str, results: Rows) -> Program:
    """The program with its header."""
    model, row = draft.model, _KINDS[kind]
    name = identifier(f"{model.name}_{kind}" if model.name else kind)
    operations = draft.tape.frozen(elements for _, elements in results)
    count = operations.count()
    notes = [
        f"{name}: {row.title} of {comment(model.name)}, {model.n} joints.",
        f"Written by robotmodels {_version()}; {count.multiplications} multiplications, "
        f"{count.additions} additions, {count.functions} functions, {count.divisions} divisions.",
        "SI units and radians; matrices row by row; frames of Khalil and Kleinfinger.",
        "Inputs:",
    ]
    for port, names, values in zip(draft.inputs, draft.elements, draft.values, strict=True):
        notes.append(f"  {port.name} {port.shape}: {_INPUTS[port.name]}")
        pairs = zip(names, values, strict=True)
        notes += [f"    {k}: {element} = {value!r}" for k, (element, value) in enumerate(pairs)]
    notes += [
        "Outputs:",
        *(f"  {port.name} {port.shape}" for port, _ in results),
        f"  {row.result}",
    ]
    notes += ["Joints:", *joint_notes(model), *draft.notes]
    if any(node[0] == "sign" for node in operations.nodes):
        notes.append("sign(0) = 0; in CasADi, smooth > 0 replaces sign(v) by tanh(v / smooth).")
    return Program(
        name, kind, tuple(draft.inputs), tuple(port for port, _ in results),
        tuple(draft.elements), tuple(draft.values), tuple(notes), operations,
    )  # fmt: skip


def _version() -> str:
    try:
        return version("robotmodels")
    except PackageNotFoundError:
        return "(not installed)"
