"""What a calibration found and how far it can be trusted, on a page of text."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import Array
from ...estimation import fit_diagnostics
from ...estimation.correlation import correlated_pairs
from ...table_text import ReportSection, ReportTable, table_of
from ..folds import suited_fixtures
from ..notes import is_implausible
from ..parameters import ErrorLaw
from ..problem import stacked
from .measured_sections import error_section, measured_section, noise_section, outlier_section
from .parameter_sections import left_out_section, parameter_section, place_section
from .units import degrees, millimetres, printed_unit

if TYPE_CHECKING:
    from ..result import CalibrationResult

_STRONG = 0.9
"""Correlation from which a pair is listed."""
_PAIRS = 12


def report_text(result: CalibrationResult) -> str:
    """All of a calibration as text of 100 columns.

    Parameters
    ----------
    result : CalibrationResult
        Of `fit`.

    Returns
    -------
    str
        Sections with tables; lengths in mm, angles in degrees.

    References
    ----------
    Seed book section 1.4.4.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> arm = rm.load("rx90")
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> result = calibration.fit(arm, calibration.Position(q, rm.dgm(arm, q)[:, :3, 3]), folds=0)
    >>> print(report_text(result).splitlines()[0])
    Geometric calibration of rx90
    """
    title = f"Geometric calibration of {result.nominal.name}"
    parts = [section.text() for section in report_sections(result)]
    return "\n\n".join([f"{title}\n{'=' * len(title)}", *parts]) + "\n"


def report_sections(result: CalibrationResult) -> tuple[ReportSection, ...]:
    """Sections of a report, for text and page."""
    parts = (
        _outcome(result), _notes(result), measured_section(result), error_section(result),
        noise_section(result), parameter_section(result), place_section(result),
        left_out_section(result), _trust(result), outlier_section(result),
    )  # fmt: skip
    return tuple(section for section in parts if section is not None)


def _outcome(result: CalibrationResult) -> ReportSection:
    problem, fit = result.solution.problem, result.solution.fit
    sentences = [
        result.status.sentence,
        f"{problem.P} parameters and {problem.F} coordinates of fixtures from {problem.rows} rows "
        f"of {problem.blocks} measurements; loss {fit.loss.name.lower()}, {fit.iterations} steps."
        + _prior_text(result)
        + (f" {len(fit.dropped)} directions were left out." if len(fit.dropped) else ""),
    ]
    own = result.held_out  # measurements that the user kept aside come first, then all folds
    aside = own if own is not None and own.partition is None else result.cross_validation or own
    for unit, text in (("m", millimetres), ("rad", degrees)):
        before, after = result.before.summary(unit), result.after.summary(unit)
        if not after.blocks:
            continue
        found = f"Rms {'position' if unit == 'm' else 'angle'} error {text(before.rms)}"
        found += f" -> {text(after.rms)} {printed_unit(unit)}"
        if aside is not None and aside.after.summary(unit).blocks:
            found += f"; on data kept aside {text(aside.after.summary(unit).rms)}"
            found += f" {printed_unit(unit)}"
        sentences.append(found + ".")
    if not is_implausible(result.solution):
        tool = result.other_tool
        sentences.append(
            f"Predicted standard error of another tool (its pose on the flange known, its point "
            f"{1e3 * tool.length:.0f} mm from the last frame) in the measured postures: "
            f"{1e3 * tool.rms:.2g} mm and {np.rad2deg(tool.angle):.2g} deg; with the nominal robot "
            f"{1e3 * tool.nominal:.2g} mm."
        )
    return ReportSection("Outcome", tuple(sentences))


def _prior_text(result: CalibrationResult) -> str:
    """Prior standard deviations of the table's lengths and angles, as used."""
    prior, f = result.solution.fit.prior, result.nominal.f
    used = {}
    for entry, size in zip(result.parameters.entries, prior.sigma, strict=False):
        if np.isfinite(size) and 0 < entry.row <= f and entry.law is ErrorLaw.CONSTANT:
            used.setdefault(entry.element.is_length, size / np.sqrt(prior.strength))
    texts = [f"{1e3 * used[k]:.3g} {'mm' if k else 'mrad'}" for k in (True, False) if k in used]
    if texts:
        return f" Prior standard deviations of the table: {', '.join(texts)}."
    return " With a prior." if np.isfinite(prior.sigma).any() else " Without a prior."


def _trust(result: CalibrationResult) -> ReportSection:
    fit = result.solution.fit
    found = fit_diagnostics(fit)
    body: list[str | ReportTable] = [
        f"Condition number {result.again.condition:.3g} (columns of length 1). Residuals are "
        f"{fit.scale:.3g} times their standard deviations; {fit.freedom_left:.0f} rows are left "
        "over.",
        _one_step(result),
    ]
    tests = [found.normality, found.independence]
    if fit.sigma_known:
        tests.insert(0, found.chi_squared)
    for test in tests:
        chance = "" if np.isnan(test.p) else f" (p = {test.p:.2g})"
        body.append(f"{test.sentence.rstrip('.')}{chance}.")
    pairs = strong_correlations(result)
    if pairs:
        rows = [(a, b, f"{c:+.3f}") for a, b, c in pairs[:_PAIRS]]
        more = f" (the {_PAIRS} strongest of {len(pairs)})" if len(pairs) > _PAIRS else ""
        body.append(f"Estimates correlated by more than {_STRONG}{more}:")
        body.append(table_of(("", "with", "correlation"), rows))
    else:
        body.append(f"No two estimates are correlated by more than {_STRONG}.")
    return ReportSection("How far to trust it", tuple(body))


def _one_step(result: CalibrationResult) -> str:
    """Whether the linear step from the start does what it predicts."""
    solution = result.solution
    problem = solution.problem
    nothing = np.zeros(problem.P)
    start = np.concatenate([nothing, suited_fixtures(problem, nothing, {})])
    r, J = stacked(problem, start, solution.scales)
    weights = np.sqrt(solution.fit.weights)
    length = np.linalg.norm(weights[:, None] * J, axis=0)
    length[length == 0.0] = 1.0
    step = np.linalg.lstsq(weights[:, None] * J / length, -weights * r, rcond=1e-9)[0] / length
    found = (
        _rms(weights * r), _rms(weights * (r + J @ step)),
        _rms(weights * stacked(problem, start + step, solution.scales)[0]),
        _rms(weights * stacked(problem, solution.fit.x, solution.scales)[0]),
    )  # fmt: skip
    return (
        f"One linear step from the start: rms residual {found[0]:.4g} standard deviations, "
        f"predicted {found[1]:.4g}, reached {found[2]:.4g}; the fit ends at {found[3]:.4g}."
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def strong_correlations(
    result: CalibrationResult, least: float = _STRONG
) -> list[tuple[str, str, float]]:
    """Pairs of parameters whose estimates are strongly correlated, the strongest first."""
    return list(correlated_pairs(result.correlation, result.names, least))


def _notes(result: CalibrationResult) -> ReportSection | None:
    notes = [
        note for note in (*result.notes, *result.robot.notes) if note != result.status.sentence
    ]
    return ReportSection("Notes", tuple(f"* {note}" for note in notes)) if notes else None
