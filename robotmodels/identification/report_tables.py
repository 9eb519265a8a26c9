"""Tables of the report on an identification, and parameters that a log determines poorly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._arrays import Array
from ..estimation.estimate import Estimate, correlated_pairs
from ..geometry import PRISMATIC
from ..minimal_parameters import BaseParameters
from ..model import RobotModel
from ..table_text import ReportSection, ReportTable, number_text, percent_text, table_of
from .forms import EquationForm
from .result import IdentificationResult
from .validation import Errors

CORRELATED = 0.9
"""Least absolute correlation of a listed pair of estimates."""
WEAK = 0.3
"""Relative standard error above which a parameter is poorly determined (book section 1.6.2.1)."""


class NegativeParameter(NamedTuple):
    """Negative estimate of a sum of nonnegative terms, its meaning and advice."""

    name: str
    certain: bool
    """Whether the estimate is more than two standard errors below zero."""
    sentence: str


def negative_parameters(base: BaseParameters, estimate: Estimate) -> tuple[NegativeParameter, ...]:
    """Sums of moments of inertia, masses, rotor inertias and frictions that are negative."""
    from ..minimal_parameters.constraints import positive_drives

    # the fixed order of a frame's ten: XX XY XZ YY YZ ZZ MX MY MZ M
    bodies = [10 * j + k for j in range(base.model.f) for k in (0, 3, 5, 9)]
    positive = np.zeros(len(base.parameter_names), dtype=bool)
    positive[[*bodies, *positive_drives(base).tolist()]] = True
    rows = dict(zip(base.names, base.matrix, strict=True))
    negative = []
    for name, value, error in zip(
        estimate.names, estimate.values.tolist(), estimate.standard_errors.tolist(), strict=True
    ):
        terms = np.flatnonzero(rows[name])
        if value < 0.0 and positive[terms].all() and (rows[name][terms] > 0.0).all():
            certain = value < -2.0 * error
            why = "more than noise explains" if certain else "within its standard error"
            added = " + ".join(base.parameter_names[k] for k in terms[:4])
            added += " + ..." if len(terms) > 4 else ""
            sentence = (
                f"{name} = {value:.3g} is negative, but {added} cannot be; it is "
                f"{why}. A physically consistent fit avoids it."
            )
            negative.append(NegativeParameter(name, certain, sentence))
    return tuple(negative)


def correlated_estimates(estimate: Estimate) -> tuple[tuple[str, str, float], ...]:
    """Pairs of estimates with a correlation above `CORRELATED`, the strongest first."""
    return correlated_pairs(estimate.correlation, estimate.names, CORRELATED)


def weak_parameters(estimate: Estimate) -> tuple[str, ...]:
    """Parameters with a relative standard error above `WEAK`, the largest first."""
    relative = estimate.relative_errors
    order = np.argsort(-relative, kind="stable")
    return tuple(estimate.names[k] for k in order if relative[k] > WEAK)


_NORMAL = 1.959964
_WIDTH = 29  # columns of text for the standard parameters of a base parameter
_ROUNDING = 1e-9


def effort_units(model: RobotModel) -> tuple[str, ...]:
    """Units of the joints' torques or forces."""
    sigma = model.table.sigma[model.table.joint_rows]
    return tuple("N" if kind == PRISMATIC else "N m" for kind in sigma.tolist())


def group_names(result: IdentificationResult) -> tuple[str, ...]:
    """Names of the groups of equations: joints, or the whole robot."""
    by_joint = result.equations.form.by_joint
    return tuple(result.model.table.joint_names) if by_joint else ("whole robot",)


def group_units(result: IdentificationResult) -> tuple[str, ...]:
    """Units of the residuals of the groups of equations."""
    form = result.equations.form
    if form.by_joint:
        return effort_units(result.model)
    return ("W",) if form is EquationForm.POWER else ("J",)


def parameter_units(result: IdentificationResult) -> tuple[str, ...]:
    """Units of the identified parameters."""
    table = result.base.value_table(result.base_values)
    units = dict(zip(table.names, table.units, strict=True))
    return tuple(units[name] for name in result.names)


def intervals(estimate: Estimate) -> Array:
    """Intervals (b, 2) that contain each true value with 95 % probability."""
    return estimate.values[:, None] + np.outer(estimate.standard_errors, (-_NORMAL, _NORMAL))


def standard_error_ratio(result: IdentificationResult) -> Array:
    """Ratio of standard errors to those for white residuals (b,); NaN where these are 0."""
    white = result.details.iid_standard_errors
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(white > 0.0, result.standard_errors / white, np.nan)


def data_section(result: IdentificationResult) -> ReportSection:
    """Section on the log: samples, sources, refused rows, ranges of the joints."""
    log, runs = result.equations.log, len(result.equations.log.starts)
    body: list[str | ReportTable] = [
        f"{len(log)} samples of {log.n} joints at {1.0 / log.dt:.6g} Hz, {log.duration:.4g} s"
        + (f" in {runs} recordings." if runs > 1 else ".")
    ]
    if log.delay:
        body.append(f"A delay of the torques of {1e3 * log.delay:.4g} ms was removed.")
    if log.sources:
        rows = [(source.name, str(source.rows), source.sha256[:16]) for source in log.sources]
        body.append(table_of(("source", "samples", "SHA-256 begins"), rows))
    parts = [
        f"{x.source}: {len(x.rows)} (rows {x.rows[0]} to {x.rows[-1]}), {x.reason}"
        for x in log.refused
    ]
    total = sum(len(part.rows) for part in log.refused)
    body.append(f"{total} rows were refused. {'; '.join(parts)}".strip())
    body.append(_ranges(result))
    return ReportSection("Data", tuple(body))


def _ranges(result: IdentificationResult) -> ReportTable:
    log, factors = result.equations.log, result.factors
    rms = np.sqrt(np.einsum("ij,ij->j", log.tau, log.tau) / len(log))
    numbers = (log.q.min(axis=0), log.q.max(axis=0), rms, np.abs(log.tau).max(axis=0))
    low, high, size, top = ([f"{x:.4g}" for x in row] for row in numbers)
    units = effort_units(result.model)
    lengths = ["m" if unit == "N" else "rad" for unit in units]
    columns = [result.model.table.joint_names, lengths, low, high, units, size, top]
    headings = ["joint", "unit", "from", "to", "unit", "rms torque", "largest"]
    if len(factors.counts) == log.n:
        columns += [[str(int(x)) for x in row] for row in (factors.counts, factors.left_out)]
        headings += ["equations", "in dead band"]
    return table_of(tuple(headings), list(zip(*columns, strict=True)))


def processing_section(result: IdentificationResult) -> ReportSection:
    """Section on filters, decimation and dead bands, with the reasons."""
    chosen = result.equations.processing
    filtered = "no filter" if chosen.cutoff is None else f"filter of order {chosen.order} twice"
    lines = (
        *(f"* {note}" for note in chosen.notes),
        f"* Zero phase, {filtered}; central differences of order {chosen.accuracy}; "
        f"{chosen.rate:.4g} equations of each joint per second.",
    )
    return ReportSection("Processing", lines)


def errors_section(result: IdentificationResult) -> ReportSection:
    """Section on the errors of predicted torques."""
    body: list[str | ReportTable] = [
        "Measured less predicted torque at the rate of the log: root mean square, relative to that "
        "of the measured torque, mean. Filtered: the residuals of the equations, dead bands left "
        "out. All: root mean square of the relative errors.",
        _error_table(result, result.validation.in_sample, "on the log"),
    ]
    if (test := result.validation.held_out) is not None:
        body.append(f"Held out: {test.samples} samples that were not fitted.")
        body.append(_error_table(result, test, "held out"))
    return ReportSection("Errors", tuple(body))


def _error_table(result: IdentificationResult, errors: Errors, name: str) -> ReportTable:
    columns = [
        result.model.table.joint_names,
        effort_units(result.model),
        [number_text(x, 3) for x in errors.rmse],
        map(percent_text, errors.relative),
        [number_text(x, 2) for x in errors.bias],
        [number_text(x, 3) for x in errors.filtered_rmse],
        map(percent_text, errors.filtered_relative),
    ]
    rows = list(zip(*columns, strict=True))
    whole = [x[np.isfinite(x)] for x in (errors.relative, errors.filtered_relative)]
    one, two = (percent_text(np.sqrt(np.mean(x**2))) if x.size else "-" for x in whole)
    rows.append(("all", "", "", one, "", "", two))
    return table_of((name, "unit", "RMSE", "relative", "mean", "filtered", "relative"), rows)


def parameters_section(result: IdentificationResult) -> ReportSection:
    """A table of the parameters of each unit."""
    base, units, ends = result.base, parameter_units(result), intervals(result.estimate)
    regrouped = dict(zip(base.names, (base.matrix != 0.0).sum(axis=1) > 1, strict=True))
    body: list[str | ReportTable] = [
        "Each base parameter with those regrouped into it (factors are metres, or their squares; "
        f"`base.regrouping` has all). A star marks relative standard errors above {100 * WEAK:.0f} "
        "%. Frames are numbered as in the robot's table."
    ]
    tables: dict[str, list[tuple[str, ...]]] = {}
    for k, name in enumerate(result.names):
        relative = float(result.relative_errors[k])
        row = (
            f"{name}R" if regrouped[name] else name,
            regrouped_text(base, name),
            number_text(result.values[k]),
            number_text(result.standard_errors[k], 2),
            f"{percent_text(relative)}{'*' if relative > WEAK else ''}",
            number_text(ends[k, 0]),
            number_text(ends[k, 1]),
        )
        tables.setdefault(units[k], []).append(row)
    for unit, rows in tables.items():
        headings = (unit, "regrouped", "value", "std err", "rel.", "95 % from", "to")
        body.append(table_of(headings, rows))
    return ReportSection("Parameters", tuple(body))


def regrouped_text(base: BaseParameters, name: str, width: int = _WIDTH) -> str:
    """Standard parameters regrouped into a base parameter, as a text of limited width."""
    row, names = base.matrix[base.names.index(name)], base.parameter_names
    kept = names.index(name)
    others = np.flatnonzero(np.abs(row) > _ROUNDING * np.abs(row).max())
    words = []
    for k in [kept, *(k for k in others if k != kept)]:
        c = float(row[k])
        factor = "" if abs(abs(c) - 1.0) < _ROUNDING else f"{abs(c):.3g} "
        words.append(("- " if c < 0.0 else "+ ") + factor + names[k])
    text = " ".join(words).removeprefix("+ ")
    for shown in range(len(words) - 1, 0, -1):
        if len(text) <= width:
            break
        text = " ".join(words[:shown]).removeprefix("+ ") + f" ... {len(words) - shown} more"
    return text
