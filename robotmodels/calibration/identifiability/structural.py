"""Identifiable parameters of a robot under kinds of measurement, or under measured data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_exact
from ...errors import InvalidValueError
from ...model import RobotModel, check_model
from ..extended_table.candidates import candidate_parameters
from ..extended_table.elements import Compliance
from ..extended_table.parameters import GeometricParameters
from ..extended_table.skeleton import Frame
from ..measurements import Measurement
from ..measurements.kinds import Kind, as_kind, drawn_groups, measurement_of
from ..problem import measured_frames
from .identifiable import IdentifiableParameters, identifiable_on

_SEED = 14
_CONTACTS = 14
"""Contacts that are drawn for structural identifiability, and postures of each."""


def identifiable_parameters(
    model: RobotModel,
    measurements: Any,
    *,
    frame: Frame = None,
    known_lengths: Iterable[str] = (),
    known: Iterable[str] = (),
    parameters: GeometricParameters | Iterable[str] | None = None,
    deviation: ArrayLike | Mapping[str, float] | None = None,
    base: bool = True,
    tool: bool = True,
    gains: bool = False,
    couplings: Iterable[tuple[int, int]] = (),
    compliance: Compliance | str = Compliance.NONE,
    eccentricity: bool = False,
    rng: np.random.Generator | None = None,
) -> IdentifiableParameters:
    """Identifiable parameters of a calibration (base parameters of the geometry).

    With kinds of measurement the answer is structural: what the best data of that kind tell, from
    random configurations within the joint ranges. Contacts are drawn at configurations that
    satisfy them exactly (several postures of each of several contacts), joint limits aside. With
    measured data the answer is what these data tell.

    Measurements without any known length are refused: at least one must be named. Where the robot
    stands is left as it is if no measurement sees it.

    Parameters
    ----------
    model : RobotModel
        The robot.
    measurements : kinds or data, one or more
        Classes (`Pose`, `Position`, `PointContact`) or their names (``"pose"``), or measured
        data; kinds and data together as well.
    frame : str, int or None
        The end that kinds look at; None is the tool. Data say it themselves.
    known_lengths : iterable of str
        Parameters that are known: they stay as they are and give the scale.
    known : iterable of str
        Other parameters that stay as they are.
    parameters : GeometricParameters or names, optional
        Candidates, in the order of preference, or which of them; default all that the next
        arguments make.
    deviation : array_like, shape (P,), or mapping of names to values, optional
        Where to judge: deviations of the candidates (m, rad), as a fit has found them; default the
        nominal robot.
    base, tool, gains, couplings, compliance, eccentricity
        As for `candidate_parameters`.
    rng : numpy.random.Generator, optional
        For random configurations; default one with a fixed seed.

    Returns
    -------
    IdentifiableParameters
        Kept, left out and why, regrouping; it prints as a table.

    Raises
    ------
    InvalidValueError, FrameNotFoundError
        No length is known; no contact can be reached in two postures; unknown names.

    References
    ----------
    Seed book section 1.4.4.2; W. Khalil, M. Gautier, Ch. Enguehard, "Identifiable parameters and
    optimum configurations for robots calibration", Robotica 9, 1991.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> identifiable_parameters(load("ur10e"), "pose").count
    30
    """
    check_model(model)
    asked = _asked(measurements)
    data = [given for given in asked if isinstance(given, Measurement)]
    frames = measured_frames(data) if data else ()
    if len(data) < len(asked):
        frames = tuple(dict.fromkeys((*frames, frame)))
    candidates = _candidates(
        model, frames, parameters, base=base, tool=tool, gains=gains, couplings=couplings,
        compliance=compliance, eccentricity=eccentricity,
    )  # fmt: skip
    xi = _deviation(candidates, deviation)
    rng = np.random.default_rng(_SEED) if rng is None else rng
    drawn = [
        given
        if isinstance(given, Measurement)
        else drawn_measurement(candidates, given, rng, frame=frame, deviation=xi)
        for given in asked
    ]
    return identifiable_on(candidates, drawn, known_lengths, known, xi)


def drawn_measurement(
    candidates: GeometricParameters,
    kind: Kind,
    rng: np.random.Generator,
    *,
    frame: Frame = None,
    deviation: Array | None = None,
) -> Measurement:
    """Random noise-free measurements, enough to identify all that the kind can identify."""
    groups, postures = 20 + 2 * len(candidates), kind.postures
    if kind.is_constraint:
        groups, postures = _CONTACTS, 2 * kind.postures + 2
    found = drawn_groups(
        candidates, kind, groups, postures, rng, frame=frame, deviation=deviation, limits=False
    )
    if not found.count:
        raise InvalidValueError(
            f"{kind.word}: this robot does not reach a target in two postures, so that nothing is "
            "identifiable. Measure something else (Position, Pose), or let the robot touch with "
            "fewer constraints."
        )
    return measurement_of(candidates, kind, found, frame=frame, deviation=deviation)


def _asked(measurements: Any) -> list[Measurement | Kind]:
    single = isinstance(measurements, Measurement | str | type)
    given = [measurements] if single else list(measurements)
    if not given:
        raise InvalidValueError("measurements: expected kinds or measured data, got none.")
    return [
        one if isinstance(one, Measurement) else as_kind(one, f"measurements[{k}]")
        for k, one in enumerate(given)
    ]


def _candidates(
    model: RobotModel,
    frames: tuple[Frame, ...],
    parameters: GeometricParameters | Iterable[str] | None,
    **options: Any,
) -> GeometricParameters:
    if isinstance(parameters, GeometricParameters):
        if parameters.model is not model and parameters.model != model:
            raise InvalidValueError("parameters: they were made for another robot.")
        return parameters
    candidates = candidate_parameters(model, frames, **options)
    return candidates if parameters is None else candidates.subset(parameters)


def _deviation(candidates: GeometricParameters, deviation: Any) -> Array | None:
    if deviation is None:
        return None
    if isinstance(deviation, Mapping):
        xi = np.zeros(len(candidates))
        xi[candidates.index(deviation, "deviation")] = list(deviation.values())
        return xi
    return as_exact(deviation, (len(candidates),), "deviation")
