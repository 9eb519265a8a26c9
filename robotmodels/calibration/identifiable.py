"""Which parameters measurements can tell: by the column rule of the base parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Rebuilt, as_exact, read_only
from ..errors import InvalidValueError
from ..estimation import ColumnBasis, column_basis
from ..geometry import PRISMATIC
from ..kinematics.lengths import spread_configurations
from ..model import RobotModel, check_model
from ..table_text import boxed
from .candidates import candidate_parameters
from .differential import differential_model
from .extended_table import Frame
from .measurements import Measurement, length_is_known
from .measurements.kinds import Kind, as_kind, drawn_groups, measurement_of
from .parameters import Compliance, ErrorLaw, GeometricParameters, as_names
from .problem import Problem, guessed_fixtures, linearised, measured_frames, problem_of, satisfying

DEPENDENT = 1e-7
"""Sine of the angle to the columns before, below which a parameter acts like a combination."""
_EMPTY = 1e-9


class Reason(Enum):
    """Why a parameter is not estimated; the value is the sentence.

    Examples
    --------
    >>> Reason.GAUGE.value
    'where the robot stands is not measured: it stays as it is'
    """

    NO_EFFECT = "it does not change what is measured"
    REGROUPED = "it acts like a combination of others, which take its part"
    GAUGE = "where the robot stands is not measured: it stays as it is"
    KNOWN = "it is known and fixed"
    NOISE = "what it does is smaller than the noise: it stays as it is"


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiableParameters(Rebuilt):
    """The parameters that measurements tell, and why the others are not among them.

    Parameters
    ----------
    candidates : GeometricParameters
        All that were looked at.
    kept : GeometricParameters
        Those that can be estimated.
    reasons : mapping of str to Reason
        For every other candidate.
    regrouping : mapping of str to mapping of str to float
        ``{kept: {candidate: coefficient}}``: what the estimate of a kept parameter stands for.
    basis : ColumnBasis
        Of the fixtures and candidates, in this order.
    fixtures : int
        How many columns of the basis are fixtures.
    condition : float
        Condition number of the kept columns and fixtures, columns scaled to length 1.
    rows : int
        Number of residual rows that were looked at.
    factor : ndarray, shape (count, count)
        Triangular factor of the kept columns without their projection on the fixtures: its
        singular values are those of the identification matrix of the kept parameters.
    configurations : int
        Number of blocks of rows (measurements) that were looked at.

    References
    ----------
    Seed book section 1.4.4.2; W. Khalil, M. Gautier, Ch. Enguehard, "Identifiable parameters and
    optimum configurations for robots calibration", Robotica 9, 1991.
    """

    candidates: GeometricParameters
    kept: GeometricParameters
    reasons: dict[str, Reason]
    regrouping: dict[str, dict[str, float]]
    basis: ColumnBasis
    fixtures: int
    condition: float
    rows: int
    factor: Array
    configurations: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "factor", read_only(self.factor))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that can be estimated."""
        return self.kept.names

    @property
    def count(self) -> int:
        """How many can be estimated."""
        return len(self.kept)

    @property
    def gap(self) -> tuple[float, float]:
        """Smallest distance of a kept column, largest of a dependent one: sines of angles."""
        return self.basis.gap

    def of_reason(self, reason: Reason) -> tuple[str, ...]:
        """Parameters that are left out for a reason.

        Parameters
        ----------
        reason : Reason
            Which.

        Returns
        -------
        tuple of str
            Names.
        """
        return tuple(name for name, why in self.reasons.items() if why is reason)

    @property
    def regrouped_into(self) -> dict[str, dict[str, float]]:
        """For every parameter seen only in combination, the kept ones that take its part.

        ``{regrouped: {kept: coefficient}}``: a deviation of 1 of the parameter moves what is
        measured as these deviations of the kept ones do (and of the fixtures, not listed).
        """
        return {
            name: {kept: terms[name] for kept, terms in self.regrouping.items() if name in terms}
            for name in self.of_reason(Reason.REGROUPED)
        }

    @property
    def matrix(self) -> Array:
        """C, shape (count, P): what is estimated is ``C xi`` for deviations xi of all candidates.

        Columns of parameters without effect, of the gauge and of what is known are zero.
        """
        number = {name: k for k, name in enumerate(self.candidates.names)}
        C = np.zeros((self.count, len(self.candidates)))
        for row, name in enumerate(self.names):
            for other, c in self.regrouping[name].items():
                C[row, number[other]] = c
        return C

    def __str__(self) -> str:
        lines = [f"{self.count} identifiable parameters of {len(self.candidates)}"]
        if self.count:
            stands_for = [_sum_text(self.regrouping[name]) for name in self.names]
            lines[0] += ":"
            lines.append(boxed([("parameter", list(self.names)), ("stands for", stands_for)]))
        for heading, reason in (
            ("Not identifiable", Reason.NO_EFFECT), ("Only in combination", Reason.REGROUPED),
            ("Gauge", Reason.GAUGE), ("Known", Reason.KNOWN),
            ("Smaller than the noise", Reason.NOISE),
        ):  # fmt: skip
            names = self.of_reason(reason)
            if not names:
                continue
            lines.append(f"{heading} ({reason.value}):")
            if reason is Reason.REGROUPED:
                lines += [
                    f"  {name} acts like {_sum_text(terms) or 'the unknown fixtures'}"
                    for name, terms in self.regrouped_into.items()
                ]
            else:
                lines.append(f"  {', '.join(names)}")
        low, high = self.gap
        lines.append(
            f"Smallest angle kept {low:.1e}, largest left out {high:.1e} (sines); condition "
            f"{self.condition:.3g}."
        )
        return "\n".join(lines)


def _sum_text(terms: dict[str, float]) -> str:
    text = ""
    for name, c in terms.items():
        size = "" if abs(abs(c) - 1.0) < 1e-9 else f"{abs(c):.4g} "
        sign = ("-" if c < 0 else "") if not text else (" - " if c < 0 else " + ")
        text += f"{sign}{size}{name}"
    return text


def identifiable_on(
    candidates: GeometricParameters,
    measurements: Iterable[Measurement],
    known_lengths: Iterable[str] = (),
    known: Iterable[str] = (),
    deviation: Array | None = None,
    fixtures: Array | None = None,
    dependent: float = DEPENDENT,
    scale_is_known: bool = False,
) -> IdentifiableParameters:
    """Parameters that given measurements tell.

    Parameters
    ----------
    candidates : GeometricParameters
        In the order of preference.
    measurements : iterable of Measurement
        What is measured, at the configurations at hand.
    known_lengths : iterable of str
        Parameters that are known: they stay as they are and give the scale.
    known : iterable of str
        Other parameters that stay as they are.
    deviation, fixtures : ndarray, optional
        Where to look; default the nominal robot.
    dependent : float
        Sine of the angle to the columns before, below which a column depends on them.
    scale_is_known : bool
        Whether the candidates cannot change the scale of the robot (base and tool alone).

    Returns
    -------
    IdentifiableParameters
        Kept and left out.

    Raises
    ------
    InvalidValueError
        No length is known; a name that is no parameter.

    References
    ----------
    Seed book section 1.4.4.2.

    Examples
    --------
    >>> from robotmodels.calibration import Position, candidate_parameters
    >>> from robotmodels.robots import load
    >>> q = np.random.default_rng(0).uniform(-2, 2, (20, 6))
    >>> there = Position(q, np.zeros((20, 3)))
    >>> found = identifiable_on(candidate_parameters(load("rx90")), [there])
    >>> found.count
    21
    """
    problem = problem_of(candidates, measurements)
    known_lengths, known = as_names(known_lengths), as_names(known)
    at = {
        *candidates.index(known_lengths, "known_lengths").tolist(),
        *candidates.index(known, "known").tolist(),
    }
    reasons: dict[str, Reason] = {}
    xi = np.zeros(len(candidates)) if deviation is None else deviation
    values = guessed_fixtures(problem, xi) if fixtures is None else fixtures
    there = satisfying(problem, xi, values)
    if not any(m.views for m in there.measurements):
        raise InvalidValueError(
            f"{', '.join(m.name for m in problem.measurements)}: no readings near the given ones "
            "satisfy these constraints, so the robot is far from what touched. Check the labels, "
            "the order of the joints and the tool (a first value of its length helps)."
        )
    W = _all_rows(there, xi, values)
    size = problem.parameters.skeleton.size
    told = W / _sizes(there, size)[:, None]  # lengths as parts of the robot's size
    if not scale_is_known and needs_a_length(problem, (*known, *known_lengths)):
        fixed = [*known, *known_lengths]
        if not problem.sees_base:
            fixed += [
                e.name for e in candidates.entries if e.row == 0 and e.law is ErrorLaw.CONSTANT
            ]
        check_scale(there, told, fixed, known_lengths)
    for k, entry in enumerate(candidates.entries):
        if k in at:
            reasons[entry.name] = Reason.KNOWN
        elif entry.row == 0 and entry.law is ErrorLaw.CONSTANT and not problem.sees_base:
            reasons[entry.name] = Reason.GAUGE
    free = np.array([k for k, name in enumerate(candidates.names) if name not in reasons], int)
    F = problem.F
    columns = np.concatenate([np.arange(F), F + free]).astype(int)
    unit = [size if f.unit == "m" else 1.0 for f in problem.fixtures]
    unit += [size if e.element.is_length else 1.0 for e in candidates.entries]
    basis = _angle_basis(told[:, columns], dependent, np.array(unit)[columns])
    kept = [k - F for k in basis.kept if k >= F]
    for k in basis.empty:
        if k >= F:
            reasons[candidates.names[free[k - F]]] = Reason.NO_EFFECT
    for k in basis.dependent:
        if k >= F:
            reasons[candidates.names[free[k - F]]] = Reason.REGROUPED
    regrouping: dict[str, dict[str, float]] = {}
    for position, k in enumerate(basis.kept):
        if k >= F:
            row = basis.coefficients[position, F:]
            regrouping[candidates.names[free[k - F]]] = {
                candidates.names[free[c]]: float(row[c]) for c in np.flatnonzero(row)
            }
    chosen = W[:, columns][:, basis.kept]
    alike = chosen / np.linalg.norm(chosen, axis=0)
    singular = np.linalg.svd(alike, compute_uv=False) if len(basis.kept) else np.ones(1)
    return IdentifiableParameters(
        candidates=candidates,
        kept=candidates.subset([candidates.names[free[k]] for k in kept]),
        reasons=reasons,
        regrouping=regrouping,
        basis=basis,
        fixtures=F,
        condition=float(singular[0] / singular[-1]),
        rows=len(W),
        factor=_without_fixtures(chosen, len(basis.kept) - len(kept)),
        configurations=there.blocks,
    )


def _without_fixtures(W: Array, fixtures: int) -> Array:
    """Triangular factor of the columns behind the first ones, those projected out."""
    return np.asarray(np.linalg.qr(W, mode="r"))[fixtures:, fixtures:]


def all_deviations(
    candidates: GeometricParameters, kept: GeometricParameters, deviation: Array
) -> Array:
    """Corrections of all candidates, zero for those that were not estimated."""
    values = np.zeros(len(candidates))
    values[candidates.index(kept.names)] = deviation
    return values


def _angle_basis(W: Array, dependent: float, unit: Array) -> ColumnBasis:
    """Columns are compared by angles: a metre and a radian have no common length."""
    length = np.linalg.norm(W * unit, axis=0)
    longest = length.max(initial=0.0) or 1.0
    size = np.where(length > _EMPTY * longest, length, longest)
    return column_basis(W, scale=unit / size, nothing=dependent)


def _sizes(problem: Problem, size: float) -> Array:
    """Of each row, what its unit is: a length or a radian, shape (M,)."""
    units = [
        np.tile([size if unit == "m" else 1.0 for unit in m.units], m.blocks)
        for m in problem.measurements
    ]
    return np.concatenate(units)


def _all_rows(problem: Problem, xi: Array, fixtures: Array) -> Array:
    """Derivatives by fixtures and parameters, shape (M, F + P), rows without weights."""
    F, P = problem.F, problem.P
    parts = []
    for m, part in zip(problem.measurements, linearised(problem, xi, fixtures), strict=True):
        block = np.zeros((part.residual.size, F + P))
        block[:, problem.columns(m)] = part.by_fixtures.reshape(len(block), -1)
        if part.by_parameters.shape[-1]:
            block[:, F:] = part.by_parameters.reshape(-1, P)
        parts.append(block)
    return np.concatenate(parts)


_SPREAD = 40
_NULL = 1e-9
_MOVES = 1e-6
_ZERO = 1e-6
_TINY = 1e-300


def needs_a_length(problem: Problem, known: Iterable[str]) -> bool:
    """Whether the scale has to come from a parameter that is known."""
    if all(unit == "rad" for m in problem.measurements for unit in m.units):
        return False  # orientations do not see lengths at all
    p, known = problem.parameters, set(known)
    base_is_known = not any(
        e.row == 0 and e.law is ErrorLaw.CONSTANT and e.name not in known for e in p.entries
    )
    if length_is_known(problem.measurements, p.model.base[:3, 3] if base_is_known else None):
        return False
    return any(
        e.law is ErrorLaw.CONSTANT and e.element.is_length and 0 < e.row <= p.model.f
        for e in p.entries
    )


def check_scale(problem: Problem, W: Array, fixed: Sequence[str], named: Sequence[str]) -> None:
    """Refuse measurements that do not determine the scale of the robot. Shapes: W (M, F + P)."""
    p, F = problem.parameters, problem.F
    least = _ZERO * problem.parameters.skeleton.size
    lengths = [
        entry.name
        for entry, value in zip(p.entries, p.nominal, strict=True)
        if entry.law is ErrorLaw.CONSTANT and entry.element.is_length and abs(value) > least
        and 0 < entry.row <= p.model.f
    ]  # fmt: skip
    R = np.asarray(np.linalg.qr(W, mode="r"))
    distances, G = _distances(problem)

    def is_open(names: Iterable[str]) -> bool:
        left_out = set(names)
        free = np.array([k for k, name in enumerate(p.names) if name not in left_out], dtype=int)
        columns = np.concatenate([np.arange(F), F + free]).astype(int)
        size = np.linalg.norm(R[:, columns], axis=0)
        told = size > _NULL * size.max(initial=0.0)
        columns, size = columns[told], size[told]
        _, values, directions = (np.asarray(part) for part in np.linalg.svd(R[:, columns] / size))
        rank = int((values > _NULL * values[0]).sum())
        unseen = directions[rank:] / size
        of_robot = columns >= F
        shapes = G[:, columns[of_robot] - F] @ unseen[:, of_robot].T
        if not shapes.shape[1]:
            return not distances.any()
        shapes = shapes / np.maximum(np.linalg.norm(shapes, axis=0), _TINY)
        shrunk = shapes @ np.linalg.lstsq(shapes, distances, rcond=_NULL)[0]
        return bool(np.linalg.norm(shrunk - distances) <= _MOVES * np.linalg.norm(distances))

    # readings of prismatic joints are lengths, and may be enough
    slides = bool((p.skeleton.sigma == PRISMATIC).any())
    if (named or slides) and not is_open(fixed):
        return
    rest = [name for name in fixed if name not in named]
    serve = [name for name in lengths if not is_open([*rest, name])]
    example = serve[0] if serve else "d3"
    advice = (
        f"Measure a distance (KnownDistance, Distance), or name a parameter whose length is known: "
        f"known_lengths=({example!r},). Lengths that would do here: {', '.join(serve) or 'none'}."
    )
    if not named:
        raise InvalidValueError(
            "These measurements know no length: a robot shrunk to nothing would satisfy them. "
            f"{advice}"
        )
    raise InvalidValueError(
        f"These measurements know no length, and {', '.join(named)} cannot give it here: other "
        f"parameters act alike, and the robot would shrink with them. {advice}"
    )


def _distances(problem: Problem) -> tuple[Array, Array]:
    """Distances of the end between random postures, and their derivatives, shape (rows, P)."""
    p = problem.parameters
    q = spread_configurations(p.model, _SPREAD, np.random.default_rng(0))
    T, psi = differential_model(p, q, frame=p.skeleton.frames[0])
    apart = np.diff(T[:, :3, 3], axis=0)
    length = np.linalg.norm(apart, axis=1)
    along = apart / np.where(length > 0.0, length, 1.0)[:, None]
    return length, np.einsum("ni,nip->np", along, np.diff(psi[:, :3], axis=0))


_SEED = 14
_CONTACTS = 14
"""Contacts that are drawn for structural identifiability, and postures of each."""
_POSTURES = {Kind.FRAME_CONTACT: 6, Kind.POINT_CONTACT: 8, Kind.PLANE_CONTACT: 14}


def identifiable_parameters(
    model: RobotModel,
    measurements: Measurement | Kind | Any | Iterable[Any],
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
        `Kind` (or its name, or the class: ``Pose``, ``Position``, ``PointContact``), or measured
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
    >>> identifiable_parameters(load("ur10e"), Kind.POSE).count
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
    if kind.is_contact:
        groups, postures = _CONTACTS, _POSTURES[kind]
    found = drawn_groups(
        candidates, kind, groups, postures, rng, frame=frame, deviation=deviation, limits=False
    )
    if not found.count:
        raise InvalidValueError(
            f"{kind.name}: this robot has no two postures for {kind.value.split(' in ')[0]}, so "
            "nothing can be told from it. Measure something else (Position, Pose), or let the "
            "robot touch with fewer constraints."
        )
    return measurement_of(candidates, kind, found, frame=frame, deviation=deviation)


def _asked(measurements: Any) -> list[Measurement | Kind]:
    single = isinstance(measurements, Measurement | Kind | str | type)
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


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiabilityChange(Rebuilt):
    """Two answers to which parameters are identifiable.

    Parameters
    ----------
    gained, lost : tuple of str
        Parameters that only the second answer keeps, and only the first.
    before, after : IdentifiableParameters
        The answers.

    References
    ----------
    Seed book section 1.4.4.2.
    """

    gained: tuple[str, ...]
    lost: tuple[str, ...]
    before: IdentifiableParameters
    after: IdentifiableParameters

    @property
    def is_same(self) -> bool:
        """Whether both keep the same parameters."""
        return not self.gained and not self.lost

    def __str__(self) -> str:
        if self.is_same:
            return f"The same {self.after.count} parameters are identifiable in both."
        parts = []
        if self.gained:
            parts.append(f"{', '.join(self.gained)} became identifiable")
        if self.lost:
            why = [f"{name} ({self.after.reasons[name].value})" for name in self.lost]
            parts.append(f"{', '.join(why)} is no longer estimated")
        low, _ = self.after.gap
        return (
            f"{self.before.count} parameters were identifiable, now {self.after.count}: "
            f"{'; '.join(parts)}. The smallest angle kept is now {low:.1e} (sine): parameters "
            "that small deviations alone make identifiable are badly determined."
        )


def identifiability_change(
    before: IdentifiableParameters, after: IdentifiableParameters
) -> IdentifiabilityChange:
    """Compare what is identifiable, for instance at the nominal robot and at the solution.

    Parameters
    ----------
    before, after : IdentifiableParameters
        Of the same candidates.

    Returns
    -------
    IdentifiabilityChange
        It prints as a sentence.

    Raises
    ------
    InvalidValueError
        Other candidates.

    Examples
    --------
    >>> from robotmodels.calibration.identifiable import identifiable_parameters
    >>> from robotmodels.robots import load
    >>> robot = load("rx90")
    >>> nominal = identifiable_parameters(robot, "position")
    >>> solved = identifiable_parameters(robot, "position", deviation={"d7": 2e-3})
    >>> "theta5" in identifiability_change(nominal, solved).gained
    True
    """
    if before.candidates.names != after.candidates.names:
        raise InvalidValueError(
            "after: expected an answer for the same candidate parameters as before, got "
            f"{len(after.candidates)} against {len(before.candidates)}, or other names."
        )
    order = after.candidates.names
    return IdentifiabilityChange(
        gained=tuple(n for n in order if n in after.names and n not in before.names),
        lost=tuple(n for n in order if n in before.names and n not in after.names),
        before=before,
        after=after,
    )
