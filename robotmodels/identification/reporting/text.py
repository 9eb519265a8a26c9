"""What an identification found and how far it can be trusted, on a page of text."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import Array
from ...estimation.diagnostics import ResidualTest
from ...logs import Log
from ...table_text import ReportSection, ReportTable, table_of
from ..validation import Validation
from .diagnostics import (
    NOT_SEEN,
    STRONG,
    ResidualDiagnostics,
    not_seen,
    residual_diagnostics,
    strong_correlations,
    understatement,
    wrong_signs,
)
from .parameters import (
    effort_units,
    kind_names,
    kind_units,
    number,
    parameter_tables,
    percent,
)

if TYPE_CHECKING:
    from ..consistency.result import ConsistentFit
    from ..result import IdentificationResult

_PAIRS = 12
_UNEXPLAINED = 0.3
"""Part of a joint's filtered torque left over, above which something is wrong."""
_MORE = 1.5
"""Errors on data kept aside, relative to those on the log, from which they are named."""
_GOOD_CONDITION = 100.0


def report_text(result: IdentificationResult, robot: ConsistentFit | None = None) -> str:
    """All of an identification as text of 100 columns.

    Parameters
    ----------
    result : IdentificationResult
        Of `fit`.
    robot : ConsistentFit, optional
        Of `consistent_robot`: what it costs is told too.

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
    """What the text and the page of a report say.

    Parameters
    ----------
    result : IdentificationResult
        Of `fit`.
    robot : ConsistentFit, optional
        Of `consistent_robot`.

    Returns
    -------
    tuple of ReportSection
        In the order in which they are read.

    Examples
    --------
    See `report_text`.
    """
    found = residual_diagnostics(result.system, result.values)
    parts = (
        _verdict(result, found), _data(result), _processing(result), _errors(result),
        _parameters(result), _trust(result, found), _real(robot), _notes(result),
    )  # fmt: skip
    return tuple(part for part in parts if part is not None)


def _verdict(result: IdentificationResult, found: ResidualDiagnostics) -> ReportSection:
    estimate = result.estimate
    sentences = [
        f"{estimate.status.sentence} {_capital(estimate.method.value)} of "
        f"{len(result.names)} parameters on {result.reduction.rows} equations "
        f"({result.system.form.value})"
        + (f", {estimate.iterations} iterations." if estimate.iterations > 1 else "."),
        _prediction(result),
    ]
    sentences = [*_doubts(result), *sentences]
    weak = not_seen(estimate)
    if weak:
        sentences.append(
            f"{len(weak)} of {len(result.names)} parameters are not seen (relative deviation above "
            f"{100.0 * NOT_SEEN:.0f} %), the least first: {', '.join(weak)}."
        )
    else:
        sentences.append(
            "All parameters are seen: no relative deviation is above "
            f"{100.0 * NOT_SEEN:.0f} % (largest {_largest_percent(result)})."
        )
    if result.unseen:
        sentences.append(f"The log does not tell apart: {', '.join(result.unseen)}.")
    if result.not_essential:
        sentences.append(f"Left out as not essential: {', '.join(result.not_essential)}.")
    sentences.append(_excitation(result))
    sentences.append(_whiteness(result, found))
    sentences += [sign.sentence for sign in wrong_signs(result.base, estimate)]
    return ReportSection("Verdict", tuple(f"* {sentence}" for sentence in sentences))


def _doubts(result: IdentificationResult) -> list[str]:
    """What comes before all else: joints whose torques the model does not explain."""
    names = result.model.table.joint_names
    share = result.fitted.filtered_relative
    bad = [f"{names[j]} ({100.0 * share[j]:.3g} %)" for j in np.flatnonzero(share > _UNEXPLAINED)]
    if not bad:
        return []
    return [
        f"Doubtful: much of the filtered torque is not explained: {', '.join(bad)}. The order of "
        "the joints, signs, zeros, units, the sampling period or the model are wrong for them, or "
        "they hardly move. Parameters of these joints are not to be used before that is known."
    ]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _largest_percent(result: IdentificationResult) -> str:
    k = int(np.argmax(result.relative_deviations))
    return f"{percent(result.relative_deviations[k])}, {result.names[k]}"


def _prediction(result: IdentificationResult) -> str:
    own, aside = result.fitted, result.held_out
    names = result.model.table.joint_names
    worst = np.fmax(own.relative, -np.inf if aside is None else aside.relative)
    lost = [f"{name} ({100 * worst[j]:.3g} %)" for j, name in enumerate(names) if worst[j] >= 1.0]
    text = (
        f"Predicted torques differ from those of the log by {_span(own.relative)} of their size, "
        f"joint by joint (filtered alike: {_span(own.filtered_relative)})"
    )
    if aside is None:
        if lost:
            text += f". {_lost(lost)}"
        return (
            f"{text.rstrip('.')}. No log was kept aside: how well other motion is predicted is not "
            "known; give test= (--test)."
        )
    text += (
        f"; from those kept aside by {_span(aside.relative)} "
        f"(filtered alike: {_span(aside.filtered_relative)})."
    )
    more = [
        f"{name} ({100 * own.relative[j]:.3g} -> {100 * aside.relative[j]:.3g} %)"
        for j, name in enumerate(names)
        if aside.rmse[j] > _MORE * own.rmse[j] and aside.relative[j] > _MORE * own.relative[j]
    ]
    if lost:
        return f"{text} {_lost(lost)}"
    if more:
        return (
            f"{text} Some err by much more there than on the log: {', '.join(more)}; the "
            "parameters do not carry over to that motion. Use a log that excites these joints more."
        )
    return f"{text} The parameters carry over to motion that was not fitted."


def _lost(joints: list[str]) -> str:
    return (
        f"The prediction is farther off than no torque at all of {', '.join(joints)}: the "
        "parameters are not to be used for that."
    )


def _span(values: Array) -> str:
    if not np.isfinite(values).any():
        return "-"
    low, high = 100.0 * float(np.nanmin(values)), 100.0 * float(np.nanmax(values))
    return f"{low:.3g} %" if len(values) == 1 else f"{low:.3g} to {high:.3g} %"


def _excitation(result: IdentificationResult) -> str:
    whole, scaled = result.condition, result.condition_scaled
    text = (
        f"The condition number of the regressor is {whole:.3g} as it is and {scaled:.3g} with "
        "columns of length one: "
    )
    if scaled > _GOOD_CONDITION:
        return (
            f"{text}above {_GOOD_CONDITION:.0f}, the motion hardly tells some parameters apart; an "
            "exciting trajectory would."
        )
    text += "the motion tells the parameters apart"
    if not_seen(result.estimate) and whole > _GOOD_CONDITION:
        return f"{text}; those that are not seen act little on the torques."
    return f"{text}."


def _whiteness(result: IdentificationResult, found: ResidualDiagnostics) -> str:
    factor = understatement(result)
    factor = factor[np.isfinite(factor)]
    names = kind_names(result)
    coloured = [names[j] for j, test in enumerate(found.whiteness) if not test.passed]
    if not coloured:
        text = "The residuals are white."
    elif len(coloured) == len(names):
        text = "The residuals are correlated in time."
    else:
        text = f"The residuals of {', '.join(coloured)} are correlated in time."
    if not factor.size:
        return text
    if not result.lags:
        return f"{text} The deviations hold for white residuals."
    middle = float(np.median(factor))
    way = "smaller" if middle >= 1.0 else "larger"
    return (
        f"{text} The deviations here take correlation over {result.lags} equations into account; "
        f"those for white residuals, which are usually published, are {way} by a factor of "
        f"{max(middle, 1.0 / max(middle, 1e-9)):.2g} (median)."
    )


def _data(result: IdentificationResult) -> ReportSection:
    log = result.system.log
    runs = len(log.starts)
    body: list[str | ReportTable] = [
        f"{len(log)} samples of {log.n} joints at {1.0 / log.dt:.6g} Hz, {log.duration:.4g} s"
        + (f" in {runs} recordings." if runs > 1 else ".")
    ]
    if log.delay:
        body.append(f"{1e3 * log.delay:.4g} ms of delay of the torques were taken out.")
    if log.sources:
        rows = [(source.name, str(source.rows), source.sha256[:16]) for source in log.sources]
        body.append(table_of(("source", "samples", "SHA-256 begins"), rows))
    body.append(_refused(log))
    body.append(_ranges(result))
    return ReportSection("Data", tuple(body))


def _refused(log: Log) -> str:
    if not log.refused:
        return "No rows were refused."
    total = sum(len(some.rows) for some in log.refused)
    parts = [
        f"{some.source}: {len(some.rows)} ({_rows(some.rows)}), {some.reason.rstrip('.')}"
        for some in log.refused
    ]
    return f"{total} rows were refused. {'; '.join(parts)}."


def _rows(rows: tuple[int, ...]) -> str:
    """Runs of numbers, the first few."""
    runs: list[list[int]] = []
    for k in rows:
        if runs and k == runs[-1][1] + 1:
            runs[-1][1] = k
        else:
            runs.append([k, k])
    words = [str(a) if a == b else f"{a} to {b}" for a, b in runs[:5]]
    return ("rows " if len(rows) > 1 else "row ") + ", ".join(words) + (
        ", ..." if len(runs) > 5 else ""
    )  # fmt: skip


def _ranges(result: IdentificationResult) -> ReportTable:
    log, counts = result.system.log, result.reduction
    table = result.model.table
    low, high = log.q.min(axis=0), log.q.max(axis=0)
    rms = np.sqrt(np.einsum("ij,ij->j", log.tau, log.tau) / len(log))
    top = np.maximum(log.tau.max(axis=0), -log.tau.min(axis=0))
    whole = len(counts.counts) == log.n
    rows = []
    for j, name in enumerate(table.joint_names):
        effort = effort_units(result.model)[j]
        cells = [
            name, "m" if effort == "N" else "rad", f"{low[j]:.4g}", f"{high[j]:.4g}", effort,
            f"{rms[j]:.4g}", f"{top[j]:.4g}",
        ]  # fmt: skip
        if whole:
            cells += [str(int(counts.counts[j])), str(int(counts.left_out[j]))]
        rows.append(tuple(cells))
    headings = ["joint", "unit", "from", "to", "unit", "rms torque", "largest"]
    headings += ["equations", "in dead band"] if whole else []
    return table_of(tuple(headings), rows)


def _processing(result: IdentificationResult) -> ReportSection:
    chosen = result.system.processing
    names = result.model.table.joint_names
    filtered = (
        "none"
        if chosen.cutoff is None
        else f"{chosen.cutoff:.4g} Hz (-3 dB), zero phase, order {chosen.order} twice"
    )
    cut = chosen.torque_cutoff
    thinned = (
        "none"
        if cut is None
        else f"one of {chosen.decimation}, low-pass at {cut:.4g} Hz, {chosen.rate:.4g} Hz after it"
    )
    slides = effort_units(result.model)
    band = ", ".join(
        f"{name} {width:.2g} {'m/s' if unit == 'N' else 'rad/s'}"
        for name, width, unit in zip(names, chosen.dead_band.tolist(), slides, strict=True)
    )
    lines = [
        f"* Low-pass of the positions: {filtered}.",
        f"* Derivatives: central differences of order {chosen.accuracy}.",
        f"* Decimation of regressor and torque: {thinned}.",
        f"* Dead band of the velocities: {band}.",
        f"* Cut at both ends of each recording: {chosen.edges} samples "
        f"({chosen.edges * chosen.dt:.3g} s).",
        "Why: " + " ".join(chosen.notes),
    ]
    return ReportSection("Processing", tuple(lines))


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
        f"{robot.status.sentence} Its residuals are {robot.price:.3g} % more than those of least "
        f"squares (root of the weighted squares); none has {100.0 * robot.gap:.1g} % less."
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
    # the reasons of the processing stand with the processing
    told = set(result.system.processing.notes)
    notes = [note for note in dict.fromkeys(result.notes) if note not in told]
    return ReportSection("Notes", tuple(f"* {note}" for note in notes)) if notes else None
