"""Identification of the inertial parameters of a payload."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from .._outcomes import Outcome
from ..dynamics import with_payload
from ..errors import InvalidValueError
from ..estimation import column_basis
from ..estimation.covariance import correlated_covariance
from ..estimation.factor import TriangularFactors
from ..estimation.linear import check_count, residual_noise, solved
from ..friction import Friction
from ..inertia import PARAMETERS
from ..logs import Log
from ..minimal_parameters import base_parameters
from ..minimal_parameters.physical import nearest_body
from ..model import RobotModel, check_model
from .loads import (
    UNIDENTIFIABLE,
    CommonEquations,
    NamedEstimate,
    UnknownPayload,
    common_unknowns,
    equations_of,
)
from .methods.base import check_solved
from .result import IdentificationResult
from .signals import Processing

_SIGNIFICANT = 3.0  # least significant value of a parameter, in standard errors


class PayloadStatus(Outcome):
    """Outcome of the identification of a payload."""

    COMPLETE = 0, "All ten parameters are identified."
    PARTIAL = 1, "Only some of the ten parameters, or combinations, are identifiable."
    INSIGNIFICANT = 2, "No parameter differs from zero by three standard errors: there is no load."
    NO_FEASIBLE_BODY = 3, "No physically consistent body was found; estimates are unconstrained."


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
    loaded, reference : Log, IdentificationResult or Log
        With the load, and without it.
    frame : str or int, optional
        Frame of the parameters; default the tool.
    consistent : bool
        Constrain the ten parameters to those of a physically consistent body; needs an optional
        extra.
    changed : tuple of str
        Kinds of drive and friction parameters that differ between the logs, such as
        ``("offset", "Fc")``.
    friction, processing, executor
        As for `fit`; friction with a log as reference, processing of both logs.

    Returns
    -------
    PayloadEstimate
        ``.mass``, ``.com``, ``.inertia``, ``.parameters`` (NaN where not identifiable) and the
        loaded robot ``.carried``; ``.names, .values, .standard_errors, .covariance`` of the
        identifiable parameters, and their linear combinations, ``.regrouping``;
        ``.status``, ``.notes``; ``.sigma``, the residual standard deviation of each joint;
        ``.cost``, the relative increase of the sum of squares by ``consistent``.

    References
    ----------
    W. Khalil, M. Gautier and P. Lemoine, "Identification of the payload inertial parameters of
    industrial manipulators", IEEE ICRA 2007, sections III.A and III.C; P. Wensing, S. Kim and
    J.-J. Slotine, IEEE RA-L 3(1), 2018 (physical consistency).

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.dynamics import idm, with_payload
    >>> arm, log = example_log()
    >>> both = arm, with_payload(arm, 2.0, [0.1, 0.0, 0.0])
    >>> bare, loaded = (
    ...     Log(log.dt, log.q, idm(each, log.q, log.v, log.a), log.v, log.a) for each in both
    ... )
    >>> round(identify_payload(arm, loaded, bare).value("M"), 2)
    2.0
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
    basis = column_basis(whole.stacked(1.0 / sigma)[0], negligible=UNIDENTIFIABLE)
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
