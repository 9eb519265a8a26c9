"""Which parameters measurements can tell: by the column rule of the base parameters."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ...errors import InvalidValueError
from ...estimation import ColumnBasis, column_basis
from ...table_text import boxed
from ..extended_table.elements import ErrorLaw
from ..extended_table.parameters import GeometricParameters, as_names
from ..measurements import Measurement
from ..problem import Problem, guessed_fixtures, linearised, problem_of, satisfying
from .scale import check_scale, needs_a_length

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
