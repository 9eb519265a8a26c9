"""The models that are written as code, and the function that makes a program of any of them."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any, Literal, NamedTuple

import numpy as np

from .._arrays import as_flag
from .._choices import one_of
from ..drive import DriveKind, Drives, drive_kinds
from ..dynamics import ddm
from ..dynamics.direct import free_motion
from ..errors import InvalidValueError
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model
from ..regressors import parameter_names
from . import inputs, recursion
from .inputs import Draft, comment
from .source import Program
from .tape import Number, Port

ModelName = Literal[
    "dgm", "jacobian", "idm", "mass_matrix", "bias", "gravity_torque", "torque_regressor",
    "base_regressor", "ddm", "igm",
]  # fmt: skip


class _Kind(NamedTuple):
    """A model: its name in words, inputs, the arguments that it accepts, outputs with units."""

    title: str
    inputs: tuple[str, ...]
    accepts: tuple[str, ...]
    output: str
    unit: str


_DYNAMIC, _FORCED = ("parameters", "geometry"), ("parameters", "geometry", "wrench")
_TORQUES, _RATES = "[N m] or [N]", "[rad/s^2] or [m/s^2]"
_KINDS = {
    "dgm": _Kind("direct geometric model", ("q",), ("geometry", "frame"), "T", "world pose [m]"),
    "jacobian": _Kind("Jacobian", ("q",), ("geometry", "frame"), "J", "[v; w] in world axes"),
    "idm": _Kind("inverse dynamic model", ("q", "v", "a"), _FORCED, "tau", _TORQUES),
    "mass_matrix": _Kind("mass matrix", ("q",), _DYNAMIC, "M", "[kg m^2], [kg m], [kg]"),
    "bias": _Kind("inverse dynamic model at a = 0", ("q", "v"), _FORCED, "h", _TORQUES),
    "gravity_torque": _Kind("gravity torques", ("q",), _DYNAMIC, "Q", _TORQUES),
    "torque_regressor": _Kind(
        "regressor of the standard parameters", ("q", "v", "a"), ("geometry",), "W", _TORQUES
    ),
    "base_regressor": _Kind(
        "regressor of the base parameters", ("q", "v", "a"), ("geometry",), "W", _TORQUES
    ),
    "ddm": _Kind("direct dynamic model", ("q", "v", "tau"), _FORCED, "a", _RATES),
    "igm": _Kind("inverse geometric model", ("T",), (), "q", "NaN where valid is not 1"),
}
_UNITS = {
    "q": "joint variables [rad] or [m]", "v": "velocities [rad/s] or [m/s]",
    "a": f"accelerations {_RATES}", "tau": f"torques {_TORQUES}",
    "T": "pose of the tool in the world [m]",
    "wrench": "force [N] and moment [N m] of the tool on its environment, at the tool, world axes",
    "geometry": "[m] or [rad]", "parameters": "SI units",
}  # fmt: skip


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
    zeros and ones removed, equal operations shared, unused operations dropped. With numbers
    for both, base parameters replace those of the model where they give the same torques.

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
        ``drive=True`` means ``("Ia", "Fv", "Fc")`` and offsets are those of the model.
    geometry : {"numbers", "symbols"}
        Geometric parameters: those of the table; or lengths that are not zero, and constants
        that ``DHTable.symbols`` names, as an input before the parameters. Base, tool and gravity
        are numbers.
    drive : bool or collection of DriveKind or str
        Terms of the drives, coupled motors included: all, none, or some kinds. Geometric models
        and `gravity_torque` have none.
    wrench : bool
        Whether ``idm``, ``bias`` and ``ddm`` have an input ``[f; m]`` as in `robotmodels.idm`.
    frame : str or int, optional
        Of `dgm` and `jacobian`; default the tool.

    Returns
    -------
    Program
        Runs, counts its operations, and prints itself as code.

    Raises
    ------
    InvalidValueError, FrameNotFoundError, SingularMassMatrixError
        Unknown choices, arguments that the model does not have, arms without a plan for ``"igm"``;
        `ddm` of a robot whose mass matrix is singular in every configuration: code divides by its
        pivots and does not check them.

    Notes
    -----
    ``"igm"`` returns all branches ``q (S, n)`` in (-pi, pi], ``valid (S,)`` and a ``status`` of
    `IGMStatus`: ``REACHED``; ``REACHED_FAMILY``: a joint that the pose leaves free is 0;
    ``INCOMPLETE``: near a singular pose or on the boundary of the workspace, where postures may be
    missing or appear twice; ``NOT_CONVERGED``: no posture (`igm` gives the reason). Joint limits
    are ignored, and inputs are not checked: ``T`` must be a pose.

    References
    ----------
    Book sections 1.2.3.2, 1.5.2 and 1.5.3; W. Khalil and J.-F. Kleinfinger, IEEE Journal of
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
    _check(kind, {"parameters": parameters, "geometry": geometry, "wrench": wrench, "frame": frame})
    draft = Draft(model, drive_kinds(drive))
    for name in (*_KINDS[kind].inputs, *("wrench",) * bool(wrench)):
        draft.input(name, {"T": (4, 4), "wrench": (6,)}.get(name, (model.n,)))
    if kind == "igm":
        from .inverse import inverse_model, status_notes  # opens the inverse models of the package

        results = inverse_model(model, draft.tape, draft.scalars["T"])
        draft.notes += status_notes()
        S = len(results[1])
        ports = Port("q", (S, model.n)), Port("valid", (S,)), Port("status", ())
        return _finished(draft, kind, ports, results)
    numbers = inputs.table_numbers(model)
    constant = (
        inputs.geometric_parameters(draft) if geometry == "symbols" else lambda *key: numbers[key]
    )
    if kind in ("dgm", "jacobian"):
        out = _geometric(draft, kind, constant, frame)
    else:
        out = _dynamic(draft, kind, constant, parameters, geometry == "symbols")
    return _finished(draft, kind, (Port(_KINDS[kind].output, out.shape),), (out.ravel().tolist(),))


def _check(kind: str, given: dict[str, Any]) -> None:
    """Refuse unknown models and choices, and arguments that a model does not have."""
    one_of(kind, tuple(_KINDS), "kind")
    one_of(given["parameters"], ("numbers", "symbols", "base"), "parameters")
    one_of(given["geometry"], ("numbers", "symbols"), "geometry")
    as_flag(given["wrench"], "wrench")
    for name, value in given.items():
        is_default = value is None if name == "frame" else value in ("numbers", False)
        if name not in _KINDS[kind].accepts and not is_default:
            able = ", ".join(repr(k) for k, row in _KINDS.items() if name in row.accepts)
            raise InvalidValueError(
                f"{name}: {kind!r} has no {name}={value!r:.40}, only {able} have."
            )


def _geometric(
    draft: Draft, kind: str, constant: recursion.Constant, frame: str | int | None
) -> recursion.Vector:
    """A pose or a Jacobian."""
    model = draft.model
    links = recursion.links_of(model, draft.scalars["q"], constant, is_lowered=False)
    number, E, e = recursion.point_of(model, frame)
    draft.notes.append(f"Frame: {comment(str('tool' if frame is None else frame))}")
    if kind == "jacobian":
        return recursion.jacobian(model, links, number, e)
    R, p = recursion.poses(model, links)[number]
    return np.vstack([np.column_stack([R @ E, p + R @ e]), (0.0, 0.0, 0.0, 1.0)])


def _dynamic(
    draft: Draft, kind: str, constant: recursion.Constant, parameters: str, is_general: bool
) -> recursion.Vector:
    """Torques, their regressors, the mass matrix, or accelerations under torques."""
    model, scalars, zero = draft.model, draft.scalars, [0.0] * draft.model.n
    links = recursion.links_of(model, scalars["q"], constant)
    v, a = scalars.get("v", zero), scalars.get("a", zero)
    moved = recursion.motions(model, links, v, a)
    if "regressor" in kind:
        is_base = kind == "base_regressor"
        names = draft.base().names if is_base else parameter_names(model, draft.kinds)
        draft.notes.append(f"Columns: {', '.join(names)}")
        units = ({name: 1.0} for name in names)
        columns = [
            recursion.inverse_dynamics(model, links, moved, unit, v, a, {}) for unit in units
        ]
        return np.array(columns, dtype=object).reshape(len(names), model.n).T
    own = inputs.dynamic_parameters(draft, parameters, is_general)
    if kind == "mass_matrix":
        return recursion.mass_matrix(model, links, own)
    if kind == "gravity_torque":
        own = {name: x for name, x in own.items() if not name.startswith(recursion.DRIVE_TERMS)}
    wrench = recursion.vector(*scalars.get("wrench", ()))
    tool = recursion.tool_wrench(model, links, wrench) if wrench.size else {}
    tau = recursion.inverse_dynamics(model, links, moved, own, v, a, tool)
    if kind != "ddm":
        return tau
    K = model.transmission
    free = None if K is None else free_motion(K)
    G = np.eye(model.n) if free is None else free
    if parameters == "numbers":  # refuse a mass matrix that is singular in every configuration
        x = np.random.default_rng(0).normal(size=G.shape[1])
        q = x if free is None or K is None else K.offset + G @ x
        ddm(model, q, zero, zero, drive=DriveKind.IA in draft.kinds)
    if free is not None:
        draft.notes.append("Joints that mimic others follow them; q and v must do so, too.")
    G, M = G.astype(object), recursion.mass_matrix(model, links, own)
    return G @ recursion.solved(G.T @ M @ G, G.T @ (recursion.vector(*scalars["tau"]) - tau))


def _finished(
    draft: Draft, kind: str, outputs: tuple[Port, ...], results: Sequence[Sequence[Number]]
) -> Program:
    """The program with its header."""
    model, row = draft.model, _KINDS[kind]
    name = f"{inputs.identifier(model.name)}_{kind}"
    operations = draft.tape.frozen(results)
    counts = ", ".join(f"{k} {word}" for word, k in operations.count()._asdict().items())
    notes = [
        f"{name}: {row.title} of {comment(model.name)}",
        f"Written by robotmodels {import_module('robotmodels').__version__}. {counts}.",
        "SI units and radians, matrices row by row, frames of Khalil and Kleinfinger.",
    ]
    for port, names, values in zip(draft.inputs, draft.elements, draft.values, strict=True):
        notes.append(f"Input {port.name} {port.shape}: {_UNITS[port.name]}")
        pairs = zip(names, values, strict=True)
        notes += [f"  {k} {element} = {value!r}" for k, (element, value) in enumerate(pairs)]
    words = row.unit, "1 where the row is a posture, else 0", "see below"
    notes += [
        f"Output {port.name} {port.shape}: {word}"
        for port, word in zip(outputs, words, strict=False)
    ]
    notes += draft.notes
    units = np.where(model.table.sigma[model.table.joint_rows] == PRISMATIC, "m", "rad")
    joints = enumerate(zip(model.table.joint_names, units, strict=True))
    notes.append(f"Joints: {', '.join(f'{k} {comment(x)} [{unit}]' for k, (x, unit) in joints)}")
    if any(node[0] == "sign" for node in operations.nodes):
        notes.append("sign(0) = 0; in CasADi, smooth > 0 replaces sign(v) by tanh(v / smooth).")
    elements, values = tuple(draft.elements), tuple(draft.values)
    of_inputs = tuple(draft.inputs), elements, values
    return Program(name, kind, *of_inputs, outputs, tuple(notes), operations)
