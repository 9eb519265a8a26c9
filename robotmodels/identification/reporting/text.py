"""What an identification found and how far it can be trusted, on a page of text."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import Array
from ...estimation.diagnostics import ResidualTest
from ...table_text import ReportSection, ReportTable, table_of
from ..methods.estimate import EstimateStatus
from ..validation import Validation
from .data_section import data_section, processing_section
from .parameters import effort_units, kind_names, kind_units, number, parameter_tables, percent
from .residuals import ResidualDiagnostics, residual_diagnostics
from .verdict import doubts, verdict, without_values
from .weak_parameters import NOT_SEEN, STRONG, strong_correlations

if TYPE_CHECKING:
    from ..consistency.result import ConsistentFit
    from ..result import IdentificationResult

_PAIRS = 12


def report_text(result: IdentificationResult, robot: ConsistentFit | None = None) -> str:
    """All of an identification as text of 100 columns.

    Parameters
    ----------
    result : IdentificationResult
        Of `fit`.
    robot : ConsistentFit, optional
        Of `consistent_robot`: what it costs is given too.

    Returns
    -------
    str
        Sections with tables, SI units.

    References
    ----------
    Seed book section 1.6.5.

    Examples
    --------
    >>> import robotmodels as rm
    >>> from robotmodels.identification import Log, fit
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> arm, t = rm.load("planar_2r"), np.arange(0.0, 20.0, 0.01)[:, None]
    >>> arm, w = arm.with_inertia(uniform_bodies(arm, 5.0)), np.array([1.0, 1.7])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)
    >>> result = fit(arm, Log(0.01, q, rm.idm(arm, q, v, a)), decimation=1)
    >>> print(report_text(result).splitlines()[0])
    Dynamic identification of planar_2r
    """
    title = f"Dynamic identification of {result.model.name}"
    parts = [section.text() for section in report_sections(result, robot)]
    return "\n\n".join([f"{title}\n{'=' * len(title)}", *parts]) + "\n"


def report_sections(
    result: IdentificationResult, robot: ConsistentFit | None = None
) -> tuple[ReportSection, ...]:
    """Sections of a report, for text and page."""
    if result.estimate.status is EstimateStatus.UNSTABLE:
        rest = data_section(result), processing_section(result), _notes(result)
        return without_values(result), *(part for part in rest if part is not None)
    found = residual_diagnostics(result.system, result.values)
    parts = (
        verdict(result, found), data_section(result), processing_section(result), _errors(result),
        _parameters(result), _trust(result, found), _real(robot), _notes(result),
    )  # fmt: skip
    return tuple(part for part in parts if part is not None)


def _errors(result: IdentificationResult) -> ReportSection:
    body: list[str | ReportTable] = [
        "Measured less predicted torque at the rate of the log: root mean square, relative to that "
        "of the measured torque, mean. Filtered: the residuals of the equations, dead bands left "
        "out. All: root mean square of the relative errors.",
        _error_table(result, result.fitted, "on the log"),
    ]
    aside = result.held_out
    if aside is None:
        body.append("No log was kept aside.")
    else:
        body.append(f"Kept aside: {aside.samples} samples that were not fitted.")
        body.append(_error_table(result, aside, "kept aside"))
    return ReportSection("Errors", tuple(body))


def _error_table(result: IdentificationResult, side: Validation, name: str) -> ReportTable:
    units, names = effort_units(result.model), result.model.table.joint_names
    by_joint = _by_joint(result, side)
    rows = []
    for j, joint in enumerate(names):
        cells = [
            joint, units[j], number(side.rmse[j], 3), percent(side.relative[j]),
            number(side.bias[j], 2),
        ]  # fmt: skip
        if by_joint:
            cells += [number(side.filtered_rmse[j], 3), percent(side.filtered_relative[j])]
        rows.append(tuple(cells))
    rows.append(
        ("all", "", "", _joined(side.relative), "",
         *(("", _joined(side.filtered_relative)) if by_joint else ()))
    )  # fmt: skip
    more = ("filtered", "relative") if by_joint else ()
    return table_of((name, "unit", "RMSE", "relative", "mean", *more), rows)


def _by_joint(result: IdentificationResult, side: Validation) -> bool:
    """Whether equations are of joints, and not of another form."""
    return len(side.filtered_rmse) == len(result.model.table.joint_names)


def _joined(values: Array) -> str:
    finite = values[np.isfinite(values)]
    return percent(float(np.sqrt(np.mean(finite**2)))) if finite.size else "-"


def _parameters(result: IdentificationResult) -> ReportSection:
    body: list[str | ReportTable] = [
        "Each base parameter with what is regrouped into it (numbers are metres, or their squares; "
        f"`base.regrouping` has all). A star marks relative deviations above {100 * NOT_SEEN:.0f} "
        "%: not seen. Frames are numbered as in the robot's table."
    ]
    body += parameter_tables(result)
    return ReportSection("Parameters", tuple(body))


def _trust(result: IdentificationResult, found: ResidualDiagnostics) -> ReportSection:
    names = kind_names(result)
    units = kind_units(result)
    rows = [
        (
            name, str(int(found.counts[j])), f"{number(found.deviation[j], 3)} {units[j]}",
            _signed(found.autocorrelation[j, 1]), _chance(found.whiteness[j]),
            _signed(found.skewness[j]), _signed(found.kurtosis[j]), _chance(found.normality[j]),
        )
        for j, name in enumerate(names)
    ]  # fmt: skip
    headings = (
        "residuals", "number", "deviation", "next", "white: p", "skewness", "kurtosis", "normal: p"
    )  # fmt: skip
    low, high = result.gap
    body: list[str | ReportTable] = [
        f"Correlation of successive residuals (next), test of Ljung and Box over {found.lags} "
        "equations, and of normality with the variances of correlated residuals; p below 0.01 "
        "speaks against it.",
        table_of(headings, rows),
        f"Columns of the regressor: {low:.1e} is the smallest part of its own that one that was "
        f"kept has, {high:.1e} the largest of one that was not.",
    ]
    pairs = strong_correlations(result.estimate)
    if pairs:
        more = f" (the {_PAIRS} strongest of {len(pairs)})" if len(pairs) > _PAIRS else ""
        body.append(f"Estimates correlated by more than {STRONG}{more}:")
        body.append(
            table_of(
                ("", "with", "correlation"), [(a, b, f"{c:+.3f}") for a, b, c in pairs[:_PAIRS]]
            )
        )
    else:
        body.append(f"No two estimates are correlated by more than {STRONG}.")
    return ReportSection("How far to trust it", tuple(body))


def _signed(value: float) -> str:
    return "-" if not np.isfinite(value) else f"{value:+.2f}"


def _chance(test: ResidualTest) -> str:
    if np.isnan(test.p):
        return "-"
    return "< 1e-9" if test.p < 1e-9 else f"{test.p:.2g}"


def _real(robot: ConsistentFit | None) -> ReportSection | None:
    if robot is None:
        return None
    body: list[str | ReportTable] = [
        " ".join((robot.status.sentence, robot.stopped)).strip()
        + f" Its residuals are {robot.price:.3g} % more than those of least squares (root of the "
        f"weighted squares). {robot.optimality}"
    ]
    body += [f"* {sentence}" for sentence in robot.active]
    rows = [
        (name, number(free), number(real))
        for name, free, real in zip(
            robot.names, robot.least_squares, robot.base_values, strict=True
        )
    ]
    body.append(table_of(("base", "least squares", "real robot"), rows))
    return ReportSection("Robot of real bodies", tuple(body))


def _notes(result: IdentificationResult) -> ReportSection | None:
    # the reasons of the processing stand with the processing, doubts in the verdict
    shown_elsewhere = {*result.system.processing.notes, *doubts(result)}
    notes = [note for note in dict.fromkeys(result.notes) if note not in shown_elsewhere]
    return ReportSection("Notes", tuple(f"* {note}" for note in notes)) if notes else None
