"""Report on an identification: a page of text with tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._arrays import Array
from ..estimation.estimate import EstimateStatus
from ..table_text import ReportSection, ReportTable, number_text, percent_text, table_of
from .report_tables import (
    CORRELATED,
    WEAK,
    correlated_estimates,
    data_section,
    errors_section,
    group_names,
    group_units,
    negative_parameters,
    parameters_section,
    processing_section,
    standard_error_ratio,
    weak_parameters,
)
from .result import IdentificationResult, check_result
from .validation import SIGNIFICANCE, ResidualDiagnostics, poor_prediction, residual_diagnostics

if TYPE_CHECKING:
    from ..minimal_parameters import StandardParameters

_PAIRS = 12
_WORSE = 1.5  # ratio of held-out to in-sample errors above which joints are named
_GOOD_CONDITION = 100.0


def report(result: IdentificationResult, robot: StandardParameters | None = None) -> str:
    """Report on an identification as text of 100 columns.

    Parameters
    ----------
    result : IdentificationResult
        Result of `fit`.
    robot : StandardParameters, optional
        Result of `consistent_robot`, whose residuals are compared.

    Returns
    -------
    str
        Verdict, data, processing, errors, parameters, diagnostics, notes.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> arm, log = example_log()
    >>> print(report(fit(arm, log, drive=("Fv",))).splitlines()[0])
    Dynamic identification of planar_2r
    """
    check_result(result, solved=False)
    title = f"Dynamic identification of {result.model.name}"
    parts = [section.text() for section in report_sections(result, robot)]
    return "\n\n".join([f"{title}\n{'=' * len(title)}", *parts]) + "\n"


def report_sections(
    result: IdentificationResult, robot: StandardParameters | None = None
) -> tuple[ReportSection, ...]:
    """Sections of a report, for text and for pages."""
    data = data_section(result), processing_section(result)
    if result.status is EstimateStatus.UNSTABLE:
        line = f"* {result.reason()} Method: {result.method.title}."
        return ReportSection("Verdict", (line,)), *data, *_notes(result, "")
    diagnostics = residual_diagnostics(result.equations, result.values)
    sides = result.validation.in_sample, result.validation.held_out
    warning = poor_prediction(result.model, result.equations.processing, *sides)
    return (
        _verdict(result, diagnostics, warning),
        *data,
        errors_section(result),
        parameters_section(result),
        _diagnostics(result, diagnostics),
        *([] if robot is None else [_consistent(robot)]),
        *_notes(result, warning),
    )


def _verdict(
    result: IdentificationResult, diagnostics: ResidualDiagnostics, warning: str
) -> ReportSection:
    """Outcome, quality of the predictions, and parameters that are not determined."""
    estimate, names = result.estimate, result.names
    iterations = f", {estimate.iterations} iterations." if estimate.iterations > 1 else "."
    title, k = result.method.title, int(np.argmax(result.relative_errors))
    weak, scaled = weak_parameters(estimate), result.scaled_condition
    sentences = [warning] if warning else []
    sentences += [
        f"{result.reason()} {title[:1].upper()}{title[1:]} of {len(names)} parameters on "
        f"{result.factors.rows} equations ({result.equations.form.value}){iterations}",
        _prediction(result, bool(warning)),
        f"Largest relative standard error: {percent_text(result.relative_errors[k])} ({names[k]}). "
        f"Poorly determined (above {100.0 * WEAK:.0f} %): {', '.join(weak) or 'none'}.",
    ]
    sentences.append(
        f"The condition number of the regressor is {result.condition:.3g}, and {scaled:.3g} with "
        "columns of length one"
        + ("; use an exciting trajectory." if scaled > _GOOD_CONDITION else ".")
    )
    sentences.append(_whiteness(result, diagnostics))
    sentences += [one.sentence for one in negative_parameters(result.base, estimate)]
    return ReportSection("Verdict", tuple(f"* {sentence}" for sentence in sentences))


def _prediction(result: IdentificationResult, poor: bool) -> str:
    fitted, test = result.validation.in_sample, result.validation.held_out
    text = "Errors of predicted torques relative to their size, joint by joint (both filtered): "
    text += f"{_span(fitted.relative)} ({_span(fitted.filtered_relative)}) on the log"
    if test is None:
        return f"{text}. There is no held-out log: prediction of other motion is not tested."
    text += f", {_span(test.relative)} ({_span(test.filtered_relative)}) on the held-out log."
    if poor:
        return text
    worse = [
        f"{name} ({100 * fitted.relative[j]:.3g} -> {100 * test.relative[j]:.3g} %)"
        for j, name in enumerate(result.model.table.joint_names)
        if test.rmse[j] > _WORSE * fitted.rmse[j] and test.relative[j] > _WORSE * fitted.relative[j]
    ]
    if worse:
        return f"{text} Much larger there: {', '.join(worse)}; excite these joints more."
    return f"{text} The parameters generalise to motion that was not fitted."


def _span(values: Array) -> str:
    known = 100.0 * values[np.isfinite(values)]
    return f"{known.min():.3g} to {known.max():.3g} %" if known.size else "-"


def _whiteness(result: IdentificationResult, diagnostics: ResidualDiagnostics) -> str:
    coloured = np.flatnonzero(diagnostics.white_p < SIGNIFICANCE)
    names = ", ".join(group_names(result)[j] for j in coloured)
    ratio = standard_error_ratio(result)
    ratio = ratio[np.isfinite(ratio)]
    middle = float(np.median(ratio)) if ratio.size else 1.0
    return (
        f"Residuals that are correlated in time: {names or 'none'}. Standard errors take "
        f"{result.details.correlation_lags} lags into account; they are {middle:.2g} times "
        "(median) those for white residuals, which are usually published."
    )


def _diagnostics(result: IdentificationResult, diagnostics: ResidualDiagnostics) -> ReportSection:
    stds = zip(diagnostics.std, group_units(result), strict=True)
    columns = [
        group_names(result),
        [str(count) for count in diagnostics.counts.tolist()],
        [f"{number_text(std, 3)} {unit}" for std, unit in stds],
        map(_signed, diagnostics.autocorrelation[:, 1]),
        map(_probability, diagnostics.white_p),
        map(_signed, diagnostics.skewness),
        map(_signed, diagnostics.kurtosis),
        map(_probability, diagnostics.normal_p),
    ]
    rows = list(zip(*columns, strict=True))
    headings = ("residuals", "number", "std", "lag 1", "white: p", "skewness", "kurtosis")
    low, high = result.details.rank_gap
    body: list[str | ReportTable] = [
        "Correlation of successive residuals (lag 1), test of Ljung and Box over "
        f"{diagnostics.lags} equations, and of normality with the variances of correlated "
        f"residuals; p below {SIGNIFICANCE:g} rejects the assumption.",
        table_of((*headings, "normal: p"), rows),
        f"Columns of the regressor: {low:.1e} is the smallest independent part of a column that is "
        f"kept, {high:.1e} the largest of one that is not.",
    ]
    pairs = correlated_estimates(result.estimate)
    body.append(f"Estimates correlated by more than {CORRELATED}: {len(pairs) or 'none'}.")
    if pairs:
        listed = [(a, b, f"{c:+.3f}") for a, b, c in pairs[:_PAIRS]]
        body.append(table_of(("the strongest", "with", "correlation"), listed))
    return ReportSection("Diagnostics", tuple(body))


def _signed(value: float) -> str:
    return "-" if not np.isfinite(value) else f"{value:+.2f}"


def _probability(p: float) -> str:
    return "-" if np.isnan(p) else "< 1e-9" if p < 1e-9 else f"{p:.2g}"


def _consistent(robot: StandardParameters) -> ReportSection:
    columns = zip(robot.base.names, robot.requested, robot.base_values, strict=True)
    rows = [(name, number_text(free), number_text(real)) for name, free, real in columns]
    body: list[str | ReportTable] = [
        " ".join((robot.status.sentence, robot.fit.stopped)).strip()
        + f" Its residuals are {robot.residual_increase:.3g} % larger than those of least squares "
        f"(root of the weighted squares). {robot.optimality}",
        *(f"* {sentence}" for sentence in robot.fit.active),
        table_of(("base", "least squares", "consistent robot"), rows),
    ]
    return ReportSection("Physically consistent robot", tuple(body))


def _notes(result: IdentificationResult, warning: str) -> tuple[ReportSection, ...]:
    # processing notes are in their section, the warning in the verdict
    shown = {*result.equations.processing.notes, warning}
    notes = [f"* {note}" for note in dict.fromkeys(result.notes) if note not in shown]
    return (ReportSection("Notes", tuple(notes)),) if notes else ()
