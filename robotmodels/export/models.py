"""The models that are written as code, and the function that makes a program of any of them."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from typing import Any, Literal, NamedTuple

import numpy as np

from ..drive import DriveKind, Drives, drive_kinds
from ..dynamics import ddm
from ..dynamics.direct import free_motion
from ..errors import InvalidValueError, SingularMassMatrixError, nearest_names
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model
from ..regressors import parameter_names
from . import dynamics
from .dynamics import Parameters, dot
from .geometry import Constant, Link, jacobian, links_of, lowered, point_of, poses, world_pose
from .inputs import Draft, comment, dynamic_parameters, geometric_parameters, identifier
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
_STATES, _ROUNDING = 10, 1e-13


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
    zeros and ones removed, equal operations shared, what no result needs is dropped. With numbers
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
        ``drive=True`` stands for ``("Ia", "Fv", "Fc")`` and offsets are those of the model.
    geometry : {"numbers", "symbols"}
        Geometric parameters: those of the table; or lengths that are not zero, and what
        ``DHTable.symbols`` names, as an input before the parameters. Base, tool and gravity are
        numbers.
    drive : bool or collection of DriveKind or str
        Terms of the drives, coupled motors included: all, none, or some kinds. Geometric models
        and `gravity_torque` have none.
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
        `ddm` with numbers of a robot whose mass matrix is singular in every configuration. Code
        divides by its pivots and does not check them.

    Notes
    -----
    ``"igm"`` returns all branches ``q (S, n)`` in (-pi, pi], ``valid (S,)`` and a ``status`` of
    `IGMStatus`: ``REACHED``; ``REACHED_FAMILY``: a joint that the pose leaves free is 0;
    ``INCOMPLETE``: near a singular pose or on the boundary of the workspace, where postures may be
    missing or appear twice; ``NOT_CONVERGED``: no posture (`igm` tells why). Joint limits are
    ignored, and inputs are not checked: ``T`` must be a pose.

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
        from .inverse import inverse_model, status_notes  # opens the inverse models of the package

        results = inverse_model(model, draft.tape, draft.scalars["T"])
        S = len(results[1])
        draft.notes += status_notes()
        ports = Port("q", (S, model.n)), Port("valid", (S,)), Port("status", ())
        return _finished(draft, kind, ports, results)
    constant = geometric_parameters(draft) if geometry == "symbols" else _numbers(model)
    links, own = links_of(model, draft.scalars["q"], constant), {}
    if "parameters" in _KINDS[kind].accepts:
        own, simpler = dynamic_parameters(draft, parameters, geometry == "symbols")
        if simpler is not None and _same_torques(model, own, simpler):
            own = simpler
    if kind == "ddm" and parameters == "numbers":
        _check_mass_matrix(model, DriveKind.IA in draft.kinds)
    if kind in ("dgm", "jacobian"):
        rows = _geometric(draft, kind, links, frame)
    elif "regressor" in kind:
        rows = _regressor(draft, kind, lowered(links))
    elif kind == "mass_matrix":
        rows = dynamics.mass_matrix(model, lowered(links), own)
    else:
        rows = [_torques(draft, kind, lowered(links), own)]
    is_vector = kind in ("idm", "bias", "gravity_torque", "ddm")
    shape = (model.n,) if is_vector else (len(rows), len(rows[0]) if rows else model.n)
    elements = [x for row in rows for x in row]
    return _finished(draft, kind, (Port(_KINDS[kind].output, shape),), (elements,))


def _check(kind: str, given: dict[str, Any]) -> None:
    """Refuse unknown models and choices, and arguments that a model does not have."""
    if not isinstance(kind, str) or kind not in _KINDS:
        near = nearest_names(str(kind), _KINDS)
        meant = f" Did you mean {near[0]!r}?" if near else ""
        listed = ", ".join(map(repr, _KINDS))
        raise InvalidValueError(f"kind: expected one of {listed}, got {kind!r:.60}.{meant}")
    words = ("numbers", "symbols", "base")
    for name, allowed in (("parameters", words), ("geometry", words[:2])):
        if not isinstance(given[name], str) or given[name] not in allowed:
            listed = ", ".join(map(repr, allowed))
            raise InvalidValueError(f"{name}: expected one of {listed}, got {given[name]!r:.60}.")
    if not isinstance(given["wrench"], (bool, np.bool_)):
        raise InvalidValueError(f"wrench: expected True or False, got {given['wrench']!r:.60}.")
    for name, value in given.items():
        is_default = value is None if name == "frame" else value in ("numbers", False)
        if name not in _KINDS[kind].accepts and not is_default:
            able = ", ".join(repr(k) for k, row in _KINDS.items() if name in row.accepts)
            raise InvalidValueError(
                f"{name}: {kind!r} has no {name}={value!r:.40}, only {able} have."
            )


def _check_mass_matrix(model: RobotModel, drive: bool) -> None:
    """Refuse robots whose mass matrix is singular in every one of some random configurations."""
    still, K = np.zeros(model.n), model.transmission
    G = None if K is None else free_motion(K)
    for k, x in enumerate(np.random.default_rng(0).normal(size=(_STATES, model.n))):
        q = x if G is None or K is None else K.offset + G @ x[: G.shape[1]]
        try:
            ddm(model, q, still, still, drive=drive)
        except SingularMassMatrixError:
            if k == _STATES - 1:
                raise
        else:
            return


def _numbers(model: RobotModel) -> Constant:
    """Geometric parameters as they are in the table."""
    return lambda column, row: float(getattr(model.table, column)[row - 1])


def _same_torques(model: RobotModel, own: Parameters, other: Parameters) -> bool:
    """Whether two sets of parameters have the same torques, to rounding."""
    draft = Draft(model, ())
    q, v, a = (draft.input(name, (model.n,)) for name in "qva")
    links = lowered(links_of(model, q, _numbers(model)))
    moved = dynamics.motions(model, links, v, a)
    both = [dynamics.inverse_dynamics(model, links, moved, x, v, a, {}) for x in (own, other)]
    states = np.random.default_rng(0).normal(size=(3, model.n, _STATES))
    torques = draft.tape.frozen(both).run(list(states))
    first, second = (np.array([np.broadcast_to(x, _STATES) for x in row]) for row in torques)
    off, size = (np.abs(x).max(initial=0.0) for x in (first - second, first))
    return bool(off <= _ROUNDING * size)


def _geometric(
    draft: Draft, kind: str, links: Sequence[Link], frame: str | int | None
) -> list[Sequence[Number]]:
    """Rows of a pose or a Jacobian."""
    number, point = point_of(draft.model, frame)
    draft.notes.append(f"Frame: {comment(str('tool' if frame is None else frame))}")
    if kind == "jacobian":
        return [*jacobian(draft.model, links, number, point)]
    R, p = world_pose(poses(draft.model, links), number, point)
    return [*((*row, x) for row, x in zip(R, p, strict=True)), (0.0, 0.0, 0.0, 1.0)]


def _regressor(draft: Draft, kind: str, links: Sequence[Link]) -> list[list[Number]]:
    """Rows of torques per unit of each parameter."""
    model, (v, a) = draft.model, (draft.scalars[name] for name in "va")
    is_base = kind == "base_regressor"
    names = draft.base().names if is_base else parameter_names(model, draft.kinds)
    draft.notes.append(f"Columns: {', '.join(names)}")
    moved = dynamics.motions(model, links, v, a)
    columns = [
        dynamics.inverse_dynamics(model, links, moved, {name: 1.0}, v, a, {}) for name in names
    ]
    return [[column[i] for column in columns] for i in range(model.n)]


def _torques(draft: Draft, kind: str, links: Sequence[Link], own: Parameters) -> list[Number]:
    """Torques of a motion, or accelerations under torques."""
    model, scalars, zero = draft.model, draft.scalars, [0.0] * draft.model.n
    v, a = scalars.get("v", zero), scalars.get("a", zero)
    if kind == "gravity_torque":
        own = {name: x for name, x in own.items() if not name.startswith(dynamics.DRIVE_TERMS)}
    tool: dict[int, dynamics.Wrench] = {}
    if "wrench" in scalars:
        tool = dynamics.tool_wrench(model, links, point_of(model, None), scalars["wrench"])
    moved = dynamics.motions(model, links, v, a)
    tau = dynamics.inverse_dynamics(model, links, moved, own, v, a, tool)
    if kind != "ddm":
        return tau
    rest = [x - y for x, y in zip(scalars["tau"], tau, strict=True)]
    return _accelerations(draft, dynamics.mass_matrix(model, links, own), rest)


def _accelerations(draft: Draft, M: list[list[Number]], torques: list[Number]) -> list[Number]:
    """Accelerations under torques; joints that mimic others follow them."""
    K = draft.model.transmission
    G = None if K is None else free_motion(K)
    if G is None:
        return dynamics.solved(M, torques)
    draft.notes.append("Joints that mimic others follow them; q and v must do so, too.")
    free = G.T.tolist()
    MG = [[dot(row, column) for column in free] for row in M]
    own = [[dot(row, column) for column in zip(*MG, strict=True)] for row in free]
    solution = dynamics.solved(own, [dot(row, torques) for row in free])
    return [dot(row, solution) for row in G.tolist()]


def _finished(
    draft: Draft, kind: str, outputs: tuple[Port, ...], results: Sequence[Sequence[Number]]
) -> Program:
    """The program with its header."""
    model, row = draft.model, _KINDS[kind]
    name = f"{identifier(model.name)}_{kind}"
    operations = draft.tape.frozen(results)
    counts = ", ".join(f"{k} {word}" for word, k in operations.count()._asdict().items())
    notes = [
        f"{name}: {row.title} of {comment(model.name)}",
        f"Written by robotmodels {version('robotmodels')}. {counts}.",
        "SI units and radians, matrices row by row, frames of Khalil and Kleinfinger.",
    ]
    for port, names, values in zip(draft.inputs, draft.elements, draft.values, strict=True):
        notes.append(f"Input {port.name} {port.shape}: {_UNITS[port.name]}")
        pairs = zip(names, values, strict=True)
        notes += [f"  {k} {element} = {value!r}" for k, (element, value) in enumerate(pairs)]
    notes += [f"Output {port.name} {port.shape}: {row.unit}" for port in outputs[:1]]
    words = {"valid": "1 where the row is a posture, else 0", "status": "see below"}
    notes += [f"Output {port.name} {port.shape}: {words[port.name]}" for port in outputs[1:]]
    notes += draft.notes
    sigma = model.table.sigma[model.table.joint_rows]
    joints = zip(model.table.joint_names, np.where(sigma == PRISMATIC, "m", "rad"), strict=True)
    named = (f"{k} {comment(name)} [{unit}]" for k, (name, unit) in enumerate(joints))
    notes.append(f"Joints: {', '.join(named)}")
    if any(node[0] == "sign" for node in operations.nodes):
        notes.append("sign(0) = 0; in CasADi, smooth > 0 replaces sign(v) by tanh(v / smooth).")
    elements, values = tuple(draft.elements), tuple(draft.values)
    return Program(
        name, kind, tuple(draft.inputs), elements, values, outputs, tuple(notes), operations
    )
