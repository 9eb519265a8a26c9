"""Report on a calibration as text and sections, and its residuals row by row for figures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array
from ..estimation import confidence_intervals, fit_diagnostics
from ..estimation.correlation import correlated_pairs
from ..geometry import PRISMATIC
from ..kinematics import operational_coordinates
from ..table_text import (
    ReportSection,
    ReportTable,
    degrees,
    in_unit,
    millimetres,
    percent_text,
    printed_unit,
    table_of,
)
from .identifiable import Reason
from .measurements import Measurement
from .notes import implausible
from .parameters import ErrorLaw
from .problem import evaluations, linearised
from .result import CalibrationResult
from .solve import states_noise
from .validation import Errors, suited_fixtures

_STRONG = 0.9  # correlation from which a pair is listed
_LISTED = 12


def report(result: CalibrationResult) -> str:
    """Report on a calibration as text of 100 columns.

    Parameters
    ----------
    result : CalibrationResult
        Of `fit`.

    Returns
    -------
    str
        Sections with tables; lengths in mm, angles in degrees.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> arm = rm.load("rx90")
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> result = calibration.fit(arm, calibration.Position(q, rm.dgm(arm, q)[:, :3, 3]), folds=0)
    >>> print(report(result).splitlines()[0])
    Geometric calibration of rx90
    """
    title = f"Geometric calibration of {result.nominal.name}"
    parts = [section.text() for section in report_sections(result)]
    return "\n\n".join([f"{title}\n{'=' * len(title)}", *parts]) + "\n"


def report_sections(result: CalibrationResult) -> tuple[ReportSection, ...]:
    """Sections of a report, for text and page."""
    sections = (
        _outcome(result),
        _notes(result),
        _measurements(result),
        _errors(result),
        _noise(result),
        _parameters(result),
        _base_and_tool(result),
        _left_out(result),
        _trust(result),
        _outliers(result),
    )
    return tuple(section for section in sections if section.body)


def _outcome(result: CalibrationResult) -> ReportSection:
    problem, fit, validation = result.solution.problem, result.solution.fit, result.validation
    sentences = [
        result.reason(),
        f"{problem.P} parameters and {problem.F} coordinates of fixtures from {problem.rows} rows "
        f"of {problem.blocks} measurements; loss {fit.loss.name.lower()}, {fit.iterations} steps."
        + _prior_text(result)
        + (f" {len(fit.dropped)} directions were left out." if len(fit.dropped) else ""),
    ]
    test = validation.held_out  # measurements that the user held out come first, then all folds
    if test is None or test.description:
        test = validation.folds or test
    kept_aside = {} if test is None else test.rms
    for unit, rms in validation.in_sample.rms.items():
        text = f"Rms {'position' if unit == 'm' else 'angle'} error "
        text += f"{in_unit(validation.nominal.rms[unit], unit)} -> {in_unit(rms, unit)} "
        text += printed_unit(unit)
        if unit in kept_aside:
            text += f"; on held-out data {in_unit(kept_aside[unit], unit)} {printed_unit(unit)}"
        sentences.append(f"{text}.")
    if not implausible(result.solution):
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


def _notes(result: CalibrationResult) -> ReportSection:
    notes = (note for note in (*result.notes, *result.robot.notes) if note != result.reason())
    return ReportSection("Notes", tuple(f"* {note}" for note in notes))


def _measurements(result: CalibrationResult) -> ReportSection:
    measurements = result.solution.problem.measurements
    rows = []
    for k, m in enumerate(measurements):
        ends = dict.fromkeys("tool" if v.frame is None else str(v.frame) for v in m.views)
        counts = str(m.blocks), " ".join(m.axes), str(len(m.fixtures))
        rows.append((str(k + 1), m.name, type(m).__name__, *counts, ", ".join(ends) or "-"))
    headings = ("", "name", "kind", "number", "rows", "unknown fixtures", "end")
    body: list[str | ReportTable] = [table_of(headings, rows)]
    body += filter(None, map(files_sentence, measurements))
    views = [view.q for m in measurements for view in m.views]
    if views:
        body += ["Readings of the joints:", _ranges(result, np.concatenate(views))]
    return ReportSection("Measurements", tuple(body))


def files_sentence(measurement: Measurement) -> str:
    """Files that a measurement was read from; empty if it was not."""
    files = ", ".join(str(file) for file in measurement.files)
    return f"Read for {measurement.name}: {files}." if files else ""


def _ranges(result: CalibrationResult, q: Array) -> ReportTable:
    model, rows = result.nominal, []
    for j, name in enumerate(model.table.joint_names):
        slides = model.table.sigma[model.table.joint_rows[j]] == PRISMATIC
        factor = 1e3 if slides else 180.0 / np.pi
        low, high = float(q[:, j].min()), float(q[:, j].max())
        width = float(model.upper[j] - model.lower[j])
        share = f"{100.0 * (high - low) / width:.0f} %" if 0 < width < np.inf else "-"
        numbers = (f"{factor * x:.1f}" for x in (low, high, float(q[:, j].std())))
        rows.append((str(j + 1), name, printed_unit("m" if slides else "rad"), *numbers, share))
    return table_of(("", "joint", "unit", "from", "to", "spread (std)", "of its range"), rows)


def _errors(result: CalibrationResult) -> ReportSection:
    validation = result.validation
    named: list[tuple[str, Errors]] = [
        ("robot as given", validation.given),
        ("base and tool fitted", validation.nominal),
        ("calibrated", validation.in_sample),
    ]
    sentences = [
        "Lengths of the residuals of each measurement. With base and tool fitted, the residuals "
        "are those of the table. Folds and held out: measurements that took no part in the "
        "calibration (before it: base and tool fitted to all of them)."
    ]
    for held, name in ((validation.folds, "folds"), (validation.held_out, "held out")):
        if held is not None:
            name = f"{held.fits} folds" if name == "folds" else name
            named += [(f"{name}, before", held.nominal), (f"{name}, after", held)]
            if held.description:
                sentences.append(f"{name.capitalize()}: {held.description} held out.")
    if validation.folds is None and validation.held_out is None:
        sentences.append("No measurements were held out: the prediction error is unknown.")
    units = tuple(validation.in_sample.count)
    headings = [""]
    for unit in units:
        headings += ["n", f"rms {printed_unit(unit)}", "mean", "max"]
    rows = []
    for name, errors in named:
        cells = [name]
        for unit in units:
            sizes = (x.get(unit, np.nan) for x in (errors.rms, errors.mean, errors.max))
            cells += [str(errors.count.get(unit, 0)), *(in_unit(x, unit) for x in sizes)]
        rows.append(tuple(cells))
    return ReportSection("Errors before and after", (*sentences, table_of(tuple(headings), rows)))


def _noise(result: CalibrationResult) -> ReportSection:
    solution = result.solution
    rows, first = [], 0
    parts = zip(solution.problem.measurements, solution.scales, strict=True)
    for k, (m, scale) in enumerate(parts):
        count = m.blocks * len(m.axes)
        whitened = solution.fit.residuals[first : first + count].reshape(m.blocks, -1)
        first += count
        variance = np.broadcast_to(scale**2, whitened.shape)
        if m.sigma is not None:
            variance = m.sigma**2
        elif m.covariance is not None:
            variance = np.diagonal(m.covariance, axis1=1, axis2=2)
        source = "stated" if states_noise(m) else "estimated"
        for unit in dict.fromkeys(m.units):
            of_unit = np.array(m.units) == unit
            std, rms = (np.sqrt(np.mean(x[:, of_unit])) for x in (variance, whitened**2))
            cells = printed_unit(unit), in_unit(float(std), unit), source, f"{rms:.3g}"
            rows.append((str(k + 1), m.name, *cells))
    headings = ("", "name", "unit", "std of a row", "", "rms residual / std")
    return ReportSection("Noise", (table_of(headings, rows),))


def _parameters(result: CalibrationResult) -> ReportSection:
    interval = confidence_intervals(result.solution.fit)[: len(result.names)]
    f, entries = result.nominal.f, result.parameters.entries
    body: list[str | ReportTable] = [
        f"Row 0 is the base, rows 1 to {f} are the frames of the table, rows from {f + 1} the "
        "measured ends. Corrections of base and ends count from where the fit placed them, the "
        "others from the nominal robot. Intervals are of the corrections."
    ]
    order = sorted(range(len(entries)), key=lambda k: (entries[k].row, entries[k].element))
    start, relative = result.parameters.nominal, result.relative_errors
    columns = start, result.corrections, result.values, result.standard_errors
    for unit in dict.fromkeys(("m", "rad", *result.units)):
        rows = [
            (
                result.names[k],
                *(in_unit(column[k], unit) for column in columns),
                percent_text(relative[k]),
                *(in_unit(end, unit) for end in interval[k]),
            )
            for k in order
            if result.units[k] == unit
        ]
        if rows:
            words = ("start", "correction", "value", "std err", "rel.", "95 % from", "to")
            body.append(table_of((printed_unit(unit), *words), rows))
    if result.held_by_prior:
        body.append(f"Determined mainly by the prior: {', '.join(result.held_by_prior)}.")
    if result.fixtures:
        body.append(
            f"Fixtures: {len(result.fixtures)} coordinates of "
            f"{len({name.rsplit('.', 1)[0] for name in result.fixtures})} points, planes or "
            "targets were estimated too (result.fixtures)."
        )
    return ReportSection("Parameters", tuple(body))


def _base_and_tool(result: CalibrationResult) -> ReportSection:
    rows = []
    for name in ("base", "tool"):
        given, found = getattr(result.nominal, name), getattr(result.model, name)
        between = se3.inverse(given) @ found
        turn = float(np.linalg.norm(operational_coordinates(between, "angle_axis")[3:]))
        moved = f"{1e3 * np.linalg.norm(between[:3, 3]):.3f}", f"{np.rad2deg(turn):.3f}"
        for label, T, end in ((f"{name} given", given, ("", "")), ("calibrated", found, moved)):
            rpy = np.rad2deg(operational_coordinates(T, "rpy_urdf")[3:])
            rows.append((label, *(f"{x:.3f}" for x in (*(1e3 * T[:3, 3]), *rpy)), *end))
    headings = ("", "x mm", "y", "z", "roll deg", "pitch", "yaw", "moved mm", "turned deg")
    return ReportSection("Base and tool", (table_of(headings, rows),))


def _left_out(result: CalibrationResult) -> ReportSection:
    found = result.identifiable
    body: list[str | ReportTable] = [
        f"{found.count} of {len(found.candidates)} parameters are identifiable."
    ]
    reasons = (Reason.KNOWN, Reason.GAUGE, Reason.NO_EFFECT, Reason.NOISE)
    names = {why: ", ".join(found.of_reason(why)) for why in reasons}
    body += [f"{listed}: {why.value}." for why, listed in names.items() if listed]
    if found.regrouped_into:
        body.append(
            f"Only in combination ({Reason.REGROUPED.value}); a correction of 1 (m, rad) has "
            "the effect of:"
        )
    for name, terms in found.regrouped_into.items():
        words = (f"{c:+.3g} {other}" for other, c in terms.items() if abs(c) > 1e-9)
        body.append(f"* {name}: {' '.join(words) or 'the unknown fixtures'}")
    body.append(
        f"Sines of the angles to the columns before: {found.gap[0]:.1e} is the smallest that was "
        f"kept, {found.gap[1]:.1e} the largest left out."
    )
    return ReportSection("Known, and not identifiable", tuple(body))


def _trust(result: CalibrationResult) -> ReportSection:
    fit = result.solution.fit
    found = fit_diagnostics(fit)
    body: list[str | ReportTable] = [
        f"Condition number {result.identifiable_after.condition:.3g} (columns of length 1). "
        f"Residuals are {fit.scale:.3g} times their standard deviations; {fit.freedom_left:.0f} "
        "degrees of freedom are left."
    ]
    tests = [found.chi_squared] if fit.sigma_known else []
    for test in (*tests, found.normality, found.independence):
        p = "" if np.isnan(test.p) else f" (p = {test.p:.2g})"
        body.append(f"{test.sentence.rstrip('.')}{p}.")
    pairs = correlated_pairs(result.correlation, result.names, _STRONG)
    if pairs:
        more = f" (the {_LISTED} strongest of {len(pairs)})" if len(pairs) > _LISTED else ""
        body.append(f"Estimates correlated by more than {_STRONG}{more}:")
        rows = [(a, b, f"{c:+.3f}") for a, b, c in pairs[:_LISTED]]
        body.append(table_of(("", "with", "correlation"), rows))
    else:
        body.append(f"No two estimates are correlated by more than {_STRONG}.")
    return ReportSection("Quality of the fit", tuple(body))


def _outliers(result: CalibrationResult) -> ReportSection:
    fit, errors = result.solution.fit, result.validation.in_sample
    blocks = [(m, b) for m in result.solution.problem.measurements for b in range(m.blocks)]
    place = np.cumsum([bool(m.views) for m, _ in blocks]) - 1
    rows = []
    for block in fit.outliers[:_LISTED].tolist():
        m, inside = blocks[block]
        lengths = ("-", "-")
        if m.views:
            at = place[block]
            lengths = millimetres(float(errors.position[at])), degrees(float(errors.angle[at]))
        origin = m.origin
        where = (origin[inside].name, origin[inside].row) if origin else (m.name, inside + 1)
        weight = float(fit.weights[fit.block == block].mean())
        rows.append((str(block + 1), where[0], str(where[1]), *lengths, f"{weight:.2g}"))
    if not rows:
        return ReportSection("Outliers", ())
    more = len(fit.outliers) > _LISTED
    text = (
        "Measurements whose residuals are larger than noise explains; they stay in the fit with "
        "their weights. Numbers and rows count from 1."
        + (f" The worst {_LISTED} of {len(fit.outliers)}:" if more else "")
    )
    headings = ("number", "measurement or file", "row", "mm", "deg", "weight")
    return ReportSection("Outliers", (text, table_of(headings, rows)))


# --- residuals row by row -------------------------------------------------------------------------


class MeasuredResiduals(NamedTuple):
    """Residuals of one measurement.

    Shapes: before, after, whitened (B, k); p (B, 3); blocks, outlier (B,).
    """

    measurement: Measurement
    before: Array
    after: Array
    whitened: Array
    p: Array
    blocks: NDArray[np.int64]
    outlier: NDArray[np.bool_]


def measured_residuals(result: CalibrationResult) -> tuple[MeasuredResiduals, ...]:
    """Residuals of every measurement of a calibration, before and after it."""
    solution = result.solution
    problem, fit, nominal = solution.problem, solution.fit, np.zeros(solution.problem.P)
    before = linearised(problem, nominal, suited_fixtures(problem, nominal))
    after = linearised(problem, solution.corrections, solution.fixtures)
    seen = evaluations(problem, solution.corrections)
    found, row, block = [], 0, 0
    for m, old, new, views in zip(problem.measurements, before, after, seen, strict=True):
        whitened = fit.whitened[row : row + m.blocks * len(m.axes)].reshape(m.blocks, -1)
        blocks = np.arange(block, block + m.blocks)
        p = views[0].T[:, :3, 3] if views else np.full((m.blocks, 3), np.nan)
        outlier = np.isin(blocks, fit.outliers)
        found.append(MeasuredResiduals(m, old.residual, new.residual, whitened, p, blocks, outlier))
        row, block = row + whitened.size, block + m.blocks
    return tuple(found)
