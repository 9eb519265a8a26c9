"""Identifiable parameters of a calibration, by the column rule of the base parameters (1.4.4.2)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, as_exact
from ..errors import InvalidValueError
from ..estimation import column_basis
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model
from ..table_text import boxed
from .candidates import chosen_candidates
from .extended_table import Frame
from .measurements import Measurement, scale_is_observable
from .measurements.kinds import Kind, as_kind, drawn_groups, measurement_of
from .parameters import Compliance, ErrorLaw, GeometricParameters, as_names
from .problem import Problem, guessed_fixtures, linearised, measured_frames, problem_of, satisfying

DEPENDENT = 1e-7
"""Sine of the angle to the columns before, below which a parameter acts like a combination."""
_EMPTY = 1e-9  # length of a column beside the longest, below which it has no effect
_SEED = 14
_LEAST = 1e-6  # length that counts as zero, relative to the robot's size
_CONTACTS = 14  # number of contacts that are drawn for structural identifiability


class Reason(Enum):
    """Why a parameter is not estimated; the value is the sentence.

    Examples
    --------
    >>> Reason.GAUGE.value
    'the base pose is not measured: it keeps its nominal value'
    """

    NO_EFFECT = "it does not change what is measured"
    REGROUPED = "its effect is a combination of those of others, into which it is regrouped"
    GAUGE = "the base pose is not measured: it keeps its nominal value"
    KNOWN = "it is known and fixed"
    NOISE = "its effect is smaller than the noise: it keeps its nominal value"


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiableParameters(Frozen):
    """The identifiable parameters, and why the others are not; prints as a table.

    Parameters
    ----------
    candidates, kept : GeometricParameters
        All parameters that were examined, and those that can be estimated.
    reasons : mapping of str to Reason
        For every other candidate.
    regrouping : mapping of str to mapping of str to float
        ``{kept: {candidate: coefficient}}``: the estimate of a kept parameter is this sum.
    gap : tuple of float
        Smallest distance of a kept column, largest of a dependent one: sines of angles.
    condition : float
        Condition number of the kept columns and fixtures, columns scaled to length 1.
    factor : ndarray, shape (count, count)
        Triangular factor of the kept columns without their projection on the fixtures: its
        singular values are those of the identification matrix of the kept parameters.
    configurations : int
        Number of blocks of rows (measurements).

    References
    ----------
    Book section 1.4.4.2; W. Khalil, M. Gautier, Ch. Enguehard, "Identifiable parameters and
    optimum configurations for robots calibration", Robotica 9, 1991.
    """

    candidates: GeometricParameters
    kept: GeometricParameters
    reasons: dict[str, Reason]
    regrouping: dict[str, dict[str, float]]
    gap: tuple[float, float]
    condition: float
    factor: Array
    configurations: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that can be estimated."""
        return self.kept.names

    @property
    def count(self) -> int:
        """Number of parameters that can be estimated."""
        return len(self.kept)

    def of_reason(self, reason: Reason) -> tuple[str, ...]:
        """Names of the parameters that are left out for a reason."""
        return tuple(name for name, why in self.reasons.items() if why is reason)

    @property
    def regrouped_into(self) -> dict[str, dict[str, float]]:
        """``{regrouped: {kept: coefficient}}``: the sum of kept ones that has the same effect."""
        return {
            name: {kept: terms[name] for kept, terms in self.regrouping.items() if name in terms}
            for name in self.of_reason(Reason.REGROUPED)
        }

    @property
    def matrix(self) -> Array:
        """C, shape (count, P): corrections xi of all candidates are estimated as ``C xi``."""
        number = {name: k for k, name in enumerate(self.candidates.names)}
        C = np.zeros((self.count, len(self.candidates)))
        for row, name in enumerate(self.names):
            for other, c in self.regrouping[name].items():
                C[row, number[other]] = c
        return C

    def left_out(self) -> list[str]:
        """Sentences on the parameters that cannot be estimated, and on the rank."""
        lines = []
        for reason in (why for why in Reason if why is not Reason.REGROUPED):
            names = ", ".join(self.of_reason(reason))
            lines += [f"{names}: {reason.value}."] if names else []
        if self.regrouped_into:
            lines.append(
                f"Only in combination ({Reason.REGROUPED.value}); a correction of 1 (m, rad) has "
                "the effect of:"
            )
        lines += [
            f"* {name}: {_sum_text(terms) or 'the unknown fixtures'}"
            for name, terms in self.regrouped_into.items()
        ]
        low, high = self.gap
        lines.append(
            f"Sines of the angles to the columns before: {low:.1e} is the smallest that was kept, "
            f"{high:.1e} the largest left out; condition {self.condition:.3g}."
        )
        return lines

    def __str__(self) -> str:
        sums = [_sum_text(self.regrouping[name]) for name in self.names]
        head = f"{self.count} identifiable parameters of {len(self.candidates)}:"
        table = boxed([("parameter", list(self.names)), ("combination", sums)])
        return "\n".join([head, table, *self.left_out()])


def _sum_text(terms: dict[str, float]) -> str:
    """A sum of parameters with their coefficients."""
    parts = []
    for name, c in terms.items():
        if abs(c) > 1e-9:
            size = "" if abs(abs(c) - 1.0) < 1e-9 else f"{abs(c):.4g} "
            parts.append(f"{'-' if c < 0 else '+'} {size}{name}")
    text = " ".join(parts).removeprefix("+ ")
    return f"-{text[2:]}" if text.startswith("- ") else text


def identifiable_parameters(
    model: RobotModel,
    measurements: Any,
    *,
    frame: Frame = None,
    known_lengths: Iterable[str] = (),
    known: Iterable[str] = (),
    parameters: GeometricParameters | Iterable[str] | None = None,
    corrections: ArrayLike | Mapping[str, float] | None = None,
    base: bool = True,
    tool: bool = True,
    gains: bool = False,
    couplings: Iterable[tuple[int, int]] = (),
    compliance: Compliance | str = Compliance.NONE,
    eccentricity: bool = False,
    rng: np.random.Generator | None = None,
) -> IdentifiableParameters:
    """Identifiable parameters of a calibration (base parameters of the geometry).

    With kinds of measurement the result is structural, for random configurations within the joint
    ranges, of contacts without these; with measured data it is that of these data. The base stays
    as it is if no measurement depends on it.

    Parameters
    ----------
    model, frame, known_lengths, known, base, tool, gains, couplings, compliance, eccentricity, rng
        See `robotmodels.calibration`; measured data have their own frames. The seed is fixed.
    measurements : kinds or data, one or more
        Classes (`Pose`, `PointContact`) or their names (``"pose"``), or measured data, or both.
    parameters : GeometricParameters or names, optional
        Candidates, in the order of preference, or which of them; default all.
    corrections : array_like, shape (P,), or mapping of names to values, optional
        Corrections of the candidates (m, rad) at which the rank is computed; default none.

    Returns
    -------
    IdentifiableParameters
        Kept, left out and why, regrouping; it prints as a table.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> identifiable_parameters(load("ur10e"), "pose").count
    30
    """
    check_model(model)
    single = isinstance(measurements, Measurement | str | type)
    given = [
        m if isinstance(m, Measurement) else as_kind(m, f"measurements[{k}]")
        for k, m in enumerate([measurements] if single else measurements)
    ]
    if not given:
        raise InvalidValueError("measurements: expected kinds or measured data, got none.")
    data = [m for m in given if isinstance(m, Measurement)]
    frames = measured_frames(data) if data else ()
    if len(data) < len(given):
        frames = tuple(dict.fromkeys((*frames, frame)))
    candidates = chosen_candidates(
        parameters,
        model,
        frames,
        base=base,
        tool=tool,
        gains=gains,
        couplings=couplings,
        compliance=compliance,
        eccentricity=eccentricity,
    )
    xi = None if corrections is None else _all_corrections(candidates, corrections)
    rng = np.random.default_rng(_SEED) if rng is None else rng
    drawn = [
        m if isinstance(m, Measurement) else _drawn(candidates, m, rng, frame, xi) for m in given
    ]
    return identifiable_on(candidates, drawn, known_lengths, known, xi)


def _all_corrections(
    candidates: GeometricParameters, corrections: ArrayLike | Mapping[str, float]
) -> Array:
    """Corrections of all candidates, zero for those that a mapping does not name."""
    if not isinstance(corrections, Mapping):
        return as_exact(corrections, (len(candidates),), "corrections")
    xi = np.zeros(len(candidates))
    xi[candidates.index(corrections, "corrections")] = list(corrections.values())
    return xi


def _drawn(
    candidates: GeometricParameters,
    kind: Kind,
    rng: np.random.Generator,
    frame: Frame,
    xi: Array | None,
) -> Measurement:
    """Random noise-free measurements, enough to identify all that the kind can identify."""
    count, postures = 20 + 2 * len(candidates), kind.postures
    if kind.is_constraint:
        count, postures = _CONTACTS, 2 * kind.postures + 2
    groups = drawn_groups(
        candidates, kind, count, postures, rng, frame=frame, corrections=xi, limits=False
    )
    if not groups.count:
        raise InvalidValueError(
            f"{kind.word}: this robot does not reach a target in two postures, so that nothing is "
            "identifiable. Measure something else (Position, Pose), or let the robot touch with "
            "fewer constraints."
        )
    return measurement_of(candidates, kind, groups, frame=frame, corrections=xi)


def identifiable_on(
    candidates: GeometricParameters,
    measurements: Iterable[Measurement],
    known_lengths: Iterable[str] = (),
    known: Iterable[str] = (),
    corrections: ArrayLike | Mapping[str, float] | None = None,
    fixtures: Array | None = None,
    dependent: float = DEPENDENT,
    scale_is_known: bool = False,
) -> IdentifiableParameters:
    """Parameters that given measurements identify, at corrections (P,) and fixtures (F,).

    ``scale_is_known``: the candidates cannot change the scale of the robot (base and tool alone).
    """
    problem = problem_of(candidates, measurements)
    known_lengths, known = as_names(known_lengths), as_names(known)
    at = {
        *candidates.index(known_lengths, "known_lengths").tolist(),
        *candidates.index(known, "known").tolist(),
    }
    xi = _all_corrections(candidates, {} if corrections is None else corrections)
    values = guessed_fixtures(problem, xi) if fixtures is None else fixtures
    exact = satisfying(problem, xi, values)
    if not any(m.views for m in exact.measurements):
        raise InvalidValueError(
            f"{', '.join(m.name for m in problem.measurements)}: no readings near the given ones "
            "satisfy these constraints, so the model is far from the robot. Check the labels, "
            "the order of the joints and the tool (a first value of its length helps)."
        )
    gauge = [e.name for e in candidates.entries if e.row == 0 and e.law is ErrorLaw.CONSTANT]
    gauge = [] if problem.sees_base else gauge
    reasons = dict.fromkeys(gauge, Reason.GAUGE)
    reasons |= {candidates.names[k]: Reason.KNOWN for k in at}
    W, size = _all_rows(exact, xi, values), problem.parameters.table.size
    units = [np.tile(m.units, m.blocks) for m in exact.measurements]
    # lengths in parts of the robot's size
    relative = W / np.where(np.concatenate(units) == "m", size, 1.0)[:, None]
    if not scale_is_known:
        check_scale(problem, {*known, *known_lengths}, known_lengths)
    F = problem.F
    free = [k for k, name in enumerate(candidates.names) if name not in reasons]
    columns = np.concatenate([np.arange(F), F + np.array(free)]).astype(int)
    lengths = [f.unit == "m" for f in problem.fixtures]
    lengths += [e.element.is_length for e in candidates.entries]
    # independent columns by their angles, since metres and radians have no common scale
    relative, unit = relative[:, columns], np.where(lengths, size, 1.0)[columns]
    length = np.linalg.norm(relative * unit, axis=0)
    longest = length.max(initial=0.0) or 1.0
    scale = unit / np.where(length > _EMPTY * longest, length, longest)
    basis = column_basis(relative, scale=scale, negligible=dependent)
    names = [f.name for f in problem.fixtures] + [candidates.names[k] for k in free]
    reasons |= {names[k]: Reason.NO_EFFECT for k in basis.empty if k >= F}
    reasons |= {names[k]: Reason.REGROUPED for k in basis.dependent if k >= F}
    regrouping = {
        names[k]: {names[c]: float(row[c]) for c in F + np.flatnonzero(row[F:])}
        for k, row in zip(basis.kept, basis.coefficients, strict=True) if k >= F
    }  # fmt: skip
    chosen = W[:, columns][:, basis.kept]
    singular = np.linalg.svd(chosen / np.linalg.norm(chosen, axis=0), compute_uv=False)
    first = len(basis.kept) - len(regrouping)
    return IdentifiableParameters(
        candidates=candidates,
        kept=candidates.subset(regrouping),
        reasons=reasons,
        regrouping=regrouping,
        gap=basis.gap,
        condition=float(singular[0] / singular[-1]) if len(singular) else 1.0,
        factor=np.asarray(np.linalg.qr(chosen, mode="r"))[first:, first:],
        configurations=exact.blocks,
    )


def needs_a_length(problem: Problem, known: Collection[str] = ()) -> bool:
    """Whether the scale has to come from a parameter that is known."""
    if all(unit == "rad" for m in problem.measurements for unit in m.units):
        return False  # orientations do not depend on lengths at all
    p = problem.parameters
    constant = [e for e in p.entries if e.law is ErrorLaw.CONSTANT]
    base_is_known = all(e.name in known for e in constant if e.row == 0)
    if scale_is_observable(problem.measurements, p.model.base[:3, 3] if base_is_known else None):
        return False
    return any(e.element.is_length and 0 < e.row <= p.model.f for e in constant)


def check_scale(problem: Problem, known: Collection[str], named: Collection[str]) -> None:
    """Refuse measurements without a length if no length of the table is known.

    The readings of prismatic joints are lengths as well.
    """
    p = problem.parameters
    if not needs_a_length(problem, known) or (p.table.sigma == PRISMATIC).any():
        return
    lengths = [
        entry.name
        for entry, value in zip(p.entries, p.nominal, strict=True)
        if entry.law is ErrorLaw.CONSTANT
        and entry.element.is_length
        and abs(value) > _LEAST * p.table.size
        and 0 < entry.row <= p.model.f
    ]
    if not set(lengths).isdisjoint(named):
        return
    fixed = f", and fixing {', '.join(named)} gives none" if named else ""
    raise InvalidValueError(
        f"These measurements contain no length{fixed}: a robot scaled to zero size would satisfy "
        "them. Measure a distance (KnownDistance, Distance), or name a parameter whose length is "
        f"known: known_lengths=({lengths[0] if lengths else 'd3'!r},). Lengths that would do here: "
        f"{', '.join(lengths) or 'none'}."
    )


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
