"""Payloads: a known load on a robot, and the identification of an unknown one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_exact, read_only
from .._outcomes import Outcome
from ..dynamics import with_payload
from ..errors import InvalidValueError
from ..estimation import column_basis
from ..estimation.covariance import correlated_covariance
from ..estimation.factor import TriangularFactors
from ..estimation.linear import check_count, solved
from ..friction import Friction
from ..inertia import PARAMETERS, InertialParameters
from ..logs import Log
from ..logs.log import check_is_log
from ..minimal_parameters import BaseParameters, base_parameters
from ..minimal_parameters.physical import nearest_body
from ..model import RobotModel, check_model
from .common_equations import (
    UNIDENTIFIABLE,
    CommonEquations,
    NamedEstimate,
    equations_of,
    residual_noise,
)
from .methods.base import check_solved
from .result import IdentificationResult
from .signals import Processing

_SIGNIFICANT = 3.0
"""Least significant value of a parameter, in standard errors."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownPayload(Rebuilt):
    """Payload of known mass, and optionally known centre of mass and inertia.

    Parameters
    ----------
    mass : float
        Kilograms, positive.
    com : array_like, shape (3,), optional
        Centre of mass in the frame, metres; default not known.
    inertia : array_like, shape (3, 3), optional
        About the centre of mass, in the axes of the frame, kg m^2; default not known. It needs
        ``com``.
    frame : str or int, optional
        Frame that carries the load; default the tool.

    Raises
    ------
    InvalidValueError, ShapeError, InertiaError
        A mass that is not positive, an inertia without centre of mass, wrong shapes.

    Examples
    --------
    >>> disc = KnownPayload(2.0, com=[0.0, 0.0, 0.1])
    >>> [name for name, known in zip(PARAMETERS, disc.known) if known]
    ['MX', 'MY', 'MZ', 'M']
    """

    mass: float
    com: ArrayLike | None = None
    inertia: ArrayLike | None = None
    frame: str | int | None = None

    def __post_init__(self) -> None:
        mass = float(as_exact(self.mass, (), "mass"))
        if not mass > 0.0:
            raise InvalidValueError(
                f"mass: expected a positive mass, got {mass} kg; a log without load is unloaded."
            )
        if self.inertia is not None and self.com is None:
            raise InvalidValueError(
                "com: an inertia is about the centre of mass; give com= with it, or neither."
            )
        object.__setattr__(self, "mass", mass)
        for name, shape in (("com", (3,)), ("inertia", (3, 3))):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, read_only(as_exact(value, shape, name)))
        _ = self.parameters  # raises for a tensor that is not symmetric

    @property
    def known(self) -> NDArray[np.bool_]:
        """Mask of the known ones among ``XX XY XZ YY YZ ZZ MX MY MZ M``, shape (10,)."""
        return np.array([self.inertia is not None] * 6 + [self.com is not None] * 3 + [True])

    @property
    def parameters(self) -> Array:
        """The ten parameters about the frame's origin, zero where they are not known."""
        point = np.zeros(3) if self.com is None else np.asarray(self.com)
        tensor = np.zeros((3, 3)) if self.inertia is None else np.asarray(self.inertia)
        row = InertialParameters.from_com([self.mass], point[None], tensor[None]).values[0]
        return np.where(self.known, row, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class LoadedLog:
    """A log of the robot with a load of known mass.

    Parameters
    ----------
    log : Log
        The log.
    payload : KnownPayload
        The load. Logs that share one object share its unknown parameters.
    """

    log: Log
    payload: KnownPayload

    def __post_init__(self) -> None:
        check_is_log(self.log)
        if not isinstance(self.payload, KnownPayload):
            raise InvalidValueError(
                f"payload: expected KnownPayload(mass, ...), got {type(self.payload).__name__}."
            )


class PayloadStatus(Outcome):
    """Outcome of the identification of a payload."""

    COMPLETE = 0, "All ten parameters are identified."
    PARTIAL = 1, "Only some of the ten parameters, or combinations, are identifiable."
    INSIGNIFICANT = (
        2,
        "No parameter differs from zero by three standard errors: no load is visible.",
    )
    NO_FEASIBLE_BODY = (
        3,
        "The solver found no physically consistent body; the parameters are those of least squares "
        "without this condition.",
    )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PayloadEstimate(NamedEstimate):
    """Identified inertial parameters of a payload; see `identify_payload`."""

    carrier: tuple[RobotModel, str | int | None]
    names: tuple[str, ...]
    values: Array
    covariance: Array
    regrouping: Mapping[str, Mapping[str, float]]
    sigma: Array
    cost: float
    status: PayloadStatus

    @property
    def identifiable(self) -> tuple[str, ...]:
        """Individually identifiable parameters."""
        return tuple(name for name in self.names if len(self.regrouping[name]) == 1)

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Parameters without effect on the torques of the logs."""
        regrouped = {name for terms in self.regrouping.values() for name in terms}
        return tuple(name for name in PARAMETERS if name not in regrouped)

    @property
    def parameters(self) -> Array:
        """The ten parameters, NaN for those not individually identifiable, shape (10,)."""
        alone = self.identifiable
        return np.array([self.value(name) if name in alone else np.nan for name in PARAMETERS])

    @property
    def mass(self) -> float:
        """Mass, kg; NaN where it is not identified."""
        return float(self.parameters[9])

    @property
    def com(self) -> Array:
        """Centre of mass in the frame, metres, shape (3,); NaN where it is not identified."""
        ten = self.parameters
        with np.errstate(divide="ignore", invalid="ignore"):
            return ten[6:9] / ten[9]

    @property
    def inertia(self) -> Array:
        """Inertia tensor about the centre of mass, kg m^2, shape (3, 3); NaN if not identified."""
        c, tensor = self.com, self.parameters[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
        return tensor - self.mass * (c @ c * np.eye(3) - np.outer(c, c))

    @property
    def carried(self) -> RobotModel:
        """Robot with the load, if all ten parameters are identified and physically consistent."""
        missing = [p for p, x in zip(PARAMETERS, self.parameters, strict=True) if np.isnan(x)]
        if missing:
            raise InvalidValueError(
                f"payload: {', '.join(missing)} are not identified; excite them by the motion, "
                "or give with_payload(...) the parameters that are known."
            )
        model, frame = self.carrier
        return with_payload(model, self.mass, self.com, self.inertia, frame)

    @property
    def notes(self) -> tuple[str, ...]:
        """Unidentifiable parameters, and a negative mass."""
        names, notes = ", ".join(self.unidentifiable), []
        if names:
            notes.append(f"The logs do not excite {names} of the load.")
        if "M" in self.names and self.value("M") < -_SIGNIFICANT * self.standard_error("M"):
            notes.append(
                "The mass is negative: the loaded log and the reference may be exchanged, or the "
                "torques have the wrong sign."
            )
        return tuple(notes)


def identify_payload(
    model: RobotModel,
    loaded: Log,
    reference: IdentificationResult | Log,
    frame: str | int | None = None,
    *,
    consistent: bool = False,
    changed: tuple[str, ...] = (),
    friction: Friction | None = None,
    processing: Processing | None = None,
    executor: Executor | None = None,
) -> PayloadEstimate:
    """Identify the inertial parameters of a payload from a log.

    With a log without load, the parameters of the robot and of the load are found together from
    both logs, by weighted least squares. An identified robot gives its log, base parameters and
    processing: parameters that its log did not excite may have an effect in the loaded one.

    Parameters
    ----------
    model : RobotModel
        The robot; its inertia is not used.
    loaded : Log
        With the load.
    reference : IdentificationResult or Log
        The robot without it.
    frame : str or int, optional
        Frame of the parameters; default the tool.
    consistent : bool
        Constrain the ten parameters to those of a physically consistent body; needs an optional
        extra.
    changed : tuple of str
        Kinds of drive and friction parameters that differ between the logs, such as
        ``("offset", "Fc")``.
    friction : Friction, optional
        Additional friction model, with a log as reference.
    processing : Processing, optional
        Processing of both logs; default that of the reference.
    executor : concurrent.futures.Executor, optional
        Computes the pieces of the logs.

    Returns
    -------
    PayloadEstimate
        ``.mass``, ``.com``, ``.inertia``, ``.parameters`` (NaN where not identifiable) and the
        loaded robot ``.carried``; ``.names, .values, .standard_errors, .covariance`` of the
        identifiable parameters, and their linear combinations, ``.regrouping``;
        ``.status``, ``.notes``; ``.sigma``, the residual standard deviation of each joint;
        ``.cost``, the relative increase of the sum of squares by ``consistent``.

    Raises
    ------
    InvalidValueError, ShapeError, FrameNotFoundError
        Logs or a result of another robot; a frame of the base; kinds that are not identified.
    MissingExtraError
        ``consistent=True`` without its extra.

    References
    ----------
    W. Khalil, M. Gautier and P. Lemoine, "Identification of the payload inertial parameters of
    industrial manipulators", IEEE ICRA 2007, sections III.A and III.C; P. Wensing, S. Kim and
    J.-J. Slotine, IEEE RA-L 3(1), 2018 (physical consistency).

    Examples
    --------
    >>> from robotmodels.dynamics import idm, with_payload
    >>> from robotmodels.robots import load
    >>> arm, t, w = load("rx90"), 0.01 * np.arange(900)[:, None], np.linspace(1.0, 5.0, 6)
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> carrying = with_payload(arm, 2.0, [0.1, 0.02, 0.05])
    >>> bare, loaded = (Log(0.01, q, idm(each, q, v, a), v, a) for each in (arm, carrying))
    >>> body = identify_payload(arm, loaded, bare)
    >>> round(body.mass, 2), body.com.round(2), body.status.name
    (2.0, array([0.1 , 0.02, 0.05]), 'COMPLETE')
    """
    check_model(model)
    if isinstance(reference, IdentificationResult):
        if friction is not None:
            raise InvalidValueError(
                "friction: it is that of the identified reference; leave it out."
            )
        check_solved(reference.estimate)
        base, log = reference.base, reference.equations.log
        processing = reference.equations.processing if processing is None else processing
        base.check(model)
        if reference.details.unidentifiable:  # the loaded log may excite them
            base = base_parameters(model, drive=base.drive, friction=base.friction)
    else:
        base, log = base_parameters(model, drive=True, friction=friction), reference
    systems = equations_of(base, (log, loaded), processing)
    possible = sorted({name.rstrip("0123456789") for name in base.names} - set(PARAMETERS))
    if unknown := set(changed) - set(possible):
        raise InvalidValueError(
            f"changed: {', '.join(map(repr, sorted(unknown)))} are no kinds of drive or friction "
            f"parameters that are identified; there are {', '.join(possible) or 'none'}."
        )
    unknowns = common_unknowns(base, (None, UnknownPayload(frame)), changed)
    every = CommonEquations(systems, *unknowns)
    whole = every.reduced(executor)
    sigma = residual_noise(whole)
    basis = column_basis(whole.stacked(1.0 / sigma)[0], nothing=UNIDENTIFIABLE)
    factors = whole.with_names(tuple(whole.names[k] for k in basis.kept))
    check_count(factors)
    values, inverse, _ = solved(factors, 1.0 / sigma)
    covariance = correlated_covariance(
        every.columns(basis.kept), values, 1.0 / sigma, inverse
    ).covariance
    first = whole.names.index("XX load 1")
    r = int((basis.kept < first).sum())
    values, covariance = values[r:], covariance[r:, r:]
    groups, kept = basis.coefficients[r:, first:-1], [PARAMETERS[k - first] for k in basis.kept[r:]]
    regrouping = {
        name: {PARAMETERS[t]: float(row[t]) for t in np.flatnonzero(row)}
        for name, row in zip(kept, groups, strict=True)
    }
    complete = len(kept) == 10 and all(len(terms) == 1 for terms in regrouping.values())
    status, cost = PayloadStatus.COMPLETE if complete else PayloadStatus.PARTIAL, 0.0
    if consistent:
        values, cost = _nearest_body(factors, 1.0 / sigma, values, groups)
    if np.isnan(cost):
        status = PayloadStatus.NO_FEASIBLE_BODY
    elif (np.abs(values) < _SIGNIFICANT * np.sqrt(np.diag(covariance))).all():
        status = PayloadStatus.INSIGNIFICANT
    return PayloadEstimate(
        (model, frame), tuple(kept), values, covariance, regrouping, sigma, cost, status
    )


class UnknownPayload(NamedTuple):
    """Load without known parameters."""

    frame: str | int | None
    known: NDArray[np.bool_] = np.zeros(10, dtype=bool)
    parameters: Array = np.zeros(10)


def common_unknowns(
    base: BaseParameters,
    loads: Sequence[KnownPayload | UnknownPayload | None],
    changed: tuple[str, ...] = (),
) -> tuple[tuple[str, ...], tuple[Array, ...]]:
    """Names of the unknowns (known parts of the loads last), and the map of each log.

    Shapes: maps (b, p).
    """
    separate = [k for k, name in enumerate(base.names) if name.rstrip("0123456789") in changed]
    names = [*base.names, *(f"{base.names[k]} loaded" for k in separate)]
    first: dict[int, int] = {}
    for load in loads:
        if load is not None and id(load) not in first:
            first[id(load)] = len(names)
            unknown = (p for p, known in zip(PARAMETERS, load.known, strict=True) if not known)
            names += [f"{name} load {len(first)}" for name in unknown]
    maps = [np.eye(len(base), len(names) + 1) for _ in loads]
    for load, M in zip(loads, maps, strict=True):
        if load is not None:
            P = payload_columns(base, load.frame)
            unknown = P[:, ~load.known]
            M[:, first[id(load)] : first[id(load)] + unknown.shape[1]] = unknown
            M[:, -1] = P @ load.parameters
            for place, k in enumerate(separate, start=len(base)):
                M[k, [k, place]] = 0.0, 1.0
    return (*names, "known load"), tuple(maps)


def payload_columns(base: BaseParameters, frame: str | int | None) -> Array:
    """Base parameters of the ten inertial parameters of a body on a frame. Shapes: -> (b, 10)."""
    place = base.model.twin.frame(frame)
    if place.parent == 0:
        raise InvalidValueError(
            f"frame: {frame!r} is fixed to the base, where a body loads no joint; give a frame of "
            "a link."
        )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = place.rotation, place.position
    moved = InertialParameters(np.eye(10)).moved(np.broadcast_to(pose, (10, 4, 4))).values
    first = 10 * (place.parent - 1)
    return base.matrix[:, first : first + 10] @ moved.T


def _nearest_body(
    factors: TriangularFactors, weights: Array, values: Array, groups: Array
) -> tuple[Array, float]:
    """Load parameters of the best physically consistent body, and its increase of squares."""
    R, y, rest = factors.stacked(weights)
    k = len(values)  # the parameters of the robot, before those of the load, are free
    body = nearest_body(R[-k:, -k:] @ groups, y[-k:])
    if body is None:
        return values, np.nan
    more = float(((R[-k:, -k:] @ groups @ body - y[-k:]) ** 2).sum())
    # weights of exact data: residuals are below their assumed size
    return groups @ body, more / max(rest, float(factors.rows))
