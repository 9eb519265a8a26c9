"""Report on an identification: a page of text with tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._arrays import Array
from ..estimation.estimate import EstimateStatus
from ..table_text import ReportSection, ReportTable, number_text, percent_text, table_of
from .report_tables import (
    data_section,
    errors_section,
    group_names,
    group_units,
    parameters_section,
    processing_section,
    standard_error_ratio,
)
from .residuals import SIGNIFICANCE, ResidualDiagnostics, residual_diagnostics
from .result import IdentificationResult, check_is_result
from .validation import poor_prediction
from .weak_parameters import (
    CORRELATED,
    WEAK,
    correlated_estimates,
    negative_parameters,
    weak_parameters,
)

if TYPE_CHECKING:
    from ..minimal_parameters import StandardParameters

_PAIRS = 12
_WORSE = 1.5
"""Ratio of held-out to in-sample errors above which joints are named."""
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

    References
    ----------
    Seed book section 1.6.5.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> arm, log = example_log()
    >>> print(report(fit(arm, log, drive=("Fv",))).splitlines()[0])
    Dynamic identification of planar_2r
    """
    check_is_result(result)
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
    estimate, details, names = result.estimate, result.details, result.names
    iterations = f", {estimate.iterations} iterations." if estimate.iterations > 1 else "."
    title, bound = result.method.title, f"{100.0 * WEAK:.0f} %"
    sentences = [warning] if warning else []
    sentences += [
        f"{result.reason()} {title[:1].upper()}{title[1:]} of {len(names)} parameters on "
        f"{result.factors.rows} equations ({result.equations.form.value}){iterations}",
        _prediction(result, bool(warning)),
    ]
    if weak := weak_parameters(estimate):
        sentences.append(
            f"{len(weak)} of {len(names)} parameters are poorly determined (relative standard "
            f"error above {bound}), the worst first: {', '.join(weak)}."
        )
    else:
        k = int(np.argmax(result.relative_errors))
        largest = percent_text(result.relative_errors[k])
        sentences.append(
            f"All parameters are determined: no relative standard error is above {bound} (largest "
            f"{largest}, {names[k]})."
        )
    if details.unidentifiable:
        sentences.append(f"The log does not determine: {', '.join(details.unidentifiable)}.")
    if details.dropped:
        sentences.append(f"Left out as not essential: {', '.join(details.dropped)}.")
    sentences += [_excitation(result, bool(weak)), _whiteness(result, diagnostics)]
    sentences += [one.sentence for one in negative_parameters(result.base, estimate)]
    return ReportSection("Verdict", tuple(f"* {sentence}" for sentence in sentences))


def _prediction(result: IdentificationResult, poor: bool) -> str:
    fitted, test = result.validation.in_sample, result.validation.held_out
    text = (
        f"Predicted torques differ from those of the log by {_span(fitted.relative)} of their "
        f"size, joint by joint (both filtered: {_span(fitted.filtered_relative)})"
    )
    if test is None:
        return (
            f"{text}. There is no held-out log: prediction of other motion is not tested; "
            "give test= (--test)."
        )
    text += (
        f"; from those of the held-out log by {_span(test.relative)} (both filtered: "
        f"{_span(test.filtered_relative)})."
    )
    if poor:
        return text
    worse = [
        f"{name} ({100 * fitted.relative[j]:.3g} -> {100 * test.relative[j]:.3g} %)"
        for j, name in enumerate(result.model.table.joint_names)
        if test.rmse[j] > _WORSE * fitted.rmse[j] and test.relative[j] > _WORSE * fitted.relative[j]
    ]
    if worse:
        return (
            f"{text} Errors of some joints are much larger there than on the log: "
            f"{', '.join(worse)}; a log that excites these joints more would generalise better."
        )
    return f"{text} The parameters generalise to motion that was not fitted."


def _span(values: Array) -> str:
    known = 100.0 * values[np.isfinite(values)]
    if not known.size:
        return "-"
    low, high = f"{known.min():.3g}", f"{known.max():.3g}"
    return f"{low} %" if len(values) == 1 else f"{low} to {high} %"


def _excitation(result: IdentificationResult, weak: bool) -> str:
    whole, scaled = result.condition, result.scaled_condition
    text = (
        f"The condition number of the regressor is {whole:.3g}, and {scaled:.3g} with columns of "
        "length one: "
    )
    if scaled > _GOOD_CONDITION:
        return (
            f"{text}above {_GOOD_CONDITION:.0f}, the motion poorly distinguishes some parameters; "
            "use an exciting trajectory."
        )
    text += "the motion distinguishes the parameters"
    if weak and whole > _GOOD_CONDITION:
        return f"{text}; those that are poorly determined have little effect on the torques."
    return f"{text}."


def _whiteness(result: IdentificationResult, diagnostics: ResidualDiagnostics) -> str:
    coloured = np.flatnonzero(diagnostics.white_p < SIGNIFICANCE)
    names = group_names(result)
    some = "" if len(coloured) == len(names) else f" of {', '.join(names[j] for j in coloured)}"
    text = f"The residuals{some} are correlated in time."
    text = text if len(coloured) else "The residuals are white."
    ratio = standard_error_ratio(result)
    ratio = ratio[np.isfinite(ratio)]
    lags = result.details.correlation_lags
    if not ratio.size:
        return text
    if not lags:
        return f"{text} The standard errors assume white residuals."
    middle = float(np.median(ratio))
    return (
        f"{text} The standard errors take correlation over {lags} equations into account; those "
        "for white residuals, which are usually published, are "
        f"{'smaller' if middle >= 1.0 else 'larger'} by a factor of "
        f"{max(middle, 1.0 / max(middle, 1e-9)):.2g} (median)."
    )


def _diagnostics(result: IdentificationResult, diagnostics: ResidualDiagnostics) -> ReportSection:
    rows = [
        (
            name,
            str(int(diagnostics.counts[j])),
            f"{number_text(diagnostics.std[j], 3)} {unit}",
            _signed(diagnostics.autocorrelation[j, 1]),
            _probability(diagnostics.white_p[j]),
            _signed(diagnostics.skewness[j]),
            _signed(diagnostics.kurtosis[j]),
            _probability(diagnostics.normal_p[j]),
        )
        for j, (name, unit) in enumerate(zip(group_names(result), group_units(result), strict=True))
    ]
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
    if not pairs:
        body.append(f"No two estimates are correlated by more than {CORRELATED}.")
        return ReportSection("Diagnostics", tuple(body))
    more = f" (the {_PAIRS} strongest of {len(pairs)})" if len(pairs) > _PAIRS else ""
    body.append(f"Estimates correlated by more than {CORRELATED}{more}:")
    listed = [(a, b, f"{c:+.3f}") for a, b, c in pairs[:_PAIRS]]
    body.append(table_of(("", "with", "correlation"), listed))
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
