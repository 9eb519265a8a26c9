"""Report on a calibration as text and sections, and its residuals row by row for figures."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array
from ..estimation import confidence_intervals, fit_diagnostics
from ..estimation.estimate import correlated_pairs
from ..geometry import PRISMATIC
from ..kinematics import operational_coordinates
from ..table_text import ReportSection as Section
from ..table_text import degrees, in_unit, millimetres, percent_text, printed_unit, table_of
from .measurements import Measurement
from .notes import implausible
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


def report_sections(result: CalibrationResult) -> tuple[Section, ...]:
    """Sections of a report, for text and page."""
    parts = (_outcome, _notes, _measurements, _errors, _noise, _parameters, _base_and_tool)
    sections = [part(result) for part in (*parts, _left_out, _trust, _outliers)]
    return tuple(section for section in sections if section.body)


def _outcome(result: CalibrationResult) -> Section:
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
    for unit, rms in validation.in_sample.rms.items():
        text = f"Rms {'position' if unit == 'm' else 'angle'} error "
        text += f"{in_unit(validation.nominal.rms[unit], unit)} -> {in_unit(rms, unit)} "
        text += printed_unit(unit)
        if test is not None and unit in test.rms:
            text += f"; on held-out data {in_unit(test.rms[unit], unit)} {printed_unit(unit)}"
        sentences.append(f"{text}.")
    if not implausible(result.solution):
        tool = result.other_tool
        sentences.append(
            f"Predicted standard error of another tool (its pose on the flange known, its point "
            f"{1e3 * tool.length:.0f} mm from the last frame) in the measured postures: "
            f"{1e3 * tool.rms:.2g} mm and {np.rad2deg(tool.angle):.2g} deg; with the nominal robot "
            f"{1e3 * tool.nominal:.2g} mm."
        )
    return Section("Outcome", tuple(sentences))


def _prior_text(result: CalibrationResult) -> str:
    """Prior standard deviations of the table's lengths and angles, as used."""
    prior, used = result.solution.fit.prior, {}
    for entry, size in zip(result.parameters.entries, prior.sigma, strict=False):
        if np.isfinite(size) and result.parameters.is_of_table(entry):
            used.setdefault(entry.element.is_length, size / np.sqrt(prior.strength))
    texts = [f"{1e3 * used[k]:.3g} {'mm' if k else 'mrad'}" for k in (True, False) if k in used]
    return f" Prior standard deviations of the table: {', '.join(texts) or 'none'}."


def _notes(result: CalibrationResult) -> Section:
    notes = (note for note in (*result.notes, *result.robot.notes) if note != result.reason())
    return Section("Notes", tuple(f"* {note}" for note in notes))


def _measurements(result: CalibrationResult) -> Section:
    measurements = result.solution.problem.measurements
    rows = []
    for k, m in enumerate(measurements):
        ends = dict.fromkeys("tool" if v.frame is None else str(v.frame) for v in m.views)
        counts = str(m.blocks), " ".join(m.axes), str(len(m.fixtures))
        rows.append((str(k + 1), m.name, type(m).__name__, *counts, ", ".join(ends) or "-"))
    headings = ("", "name", "kind", "number", "rows", "unknown fixtures", "end")
    body = [table_of(headings, rows), *filter(None, map(files_sentence, measurements))]
    model, q = result.nominal, [view.q for m in measurements for view in m.views]
    joints = []
    for j, (name, values) in enumerate(zip(model.table.joint_names, np.vstack(q).T, strict=True)):
        slides = model.table.sigma[model.table.joint_rows[j]] == PRISMATIC
        width = float(model.upper[j] - model.lower[j])
        share = f"{100.0 * np.ptp(values) / width:.0f} %" if 0 < width < np.inf else "-"
        factor = 1e3 if slides else 180.0 / np.pi
        sizes = (f"{factor * x:.1f}" for x in (values.min(), values.max(), values.std()))
        joints.append((str(j + 1), name, printed_unit("m" if slides else "rad"), *sizes, share))
    headings = ("", "joint", "unit", "from", "to", "spread (std)", "of its range")
    return Section("Measurements", (*body, "Readings of the joints:", table_of(headings, joints)))


def files_sentence(measurement: Measurement) -> str:
    """Files that a measurement was read from; empty if it was not."""
    files = ", ".join(f"{name} ({rows} rows)" for name, rows in measurement.files)
    return f"Read for {measurement.name}: {files}." if files else ""


def _errors(result: CalibrationResult) -> Section:
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
    units, headings, rows = tuple(validation.in_sample.count), [""], []
    for unit in units:
        headings += ["n", f"rms {printed_unit(unit)}", "mean", "max"]
    for name, errors in named:
        cells = [name]
        for unit in units:
            sizes = (x.get(unit, np.nan) for x in (errors.rms, errors.mean, errors.max))
            cells += [str(errors.count.get(unit, 0)), *(in_unit(x, unit) for x in sizes)]
        rows.append(tuple(cells))
    return Section("Errors before and after", (*sentences, table_of(tuple(headings), rows)))


def _noise(result: CalibrationResult) -> Section:
    solution, rows = result.solution, []
    parts = zip(solution.scales, solution.problem.row_slices, strict=True)
    for k, (m, (scale, at)) in enumerate(zip(solution.problem.measurements, parts, strict=True)):
        whitened = solution.fit.residuals[at].reshape(m.blocks, -1)
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
    return Section("Noise", (table_of(headings, rows),))


def _parameters(result: CalibrationResult) -> Section:
    interval = confidence_intervals(result.solution.fit)[: len(result.names)]
    f, entries = result.nominal.f, result.parameters.entries
    body: list[Any] = [
        f"Row 0 is the base, rows 1 to {f} are the frames of the table, rows from {f + 1} the "
        "measured ends. Corrections of base and ends count from where the fit placed them, the "
        "others from the nominal robot. Intervals are of the corrections."
    ]
    order = sorted(range(len(entries)), key=lambda k: (entries[k].row, entries[k].element))
    relative = result.relative_errors
    columns = result.parameters.nominal, result.corrections, result.values, result.standard_errors
    for unit in dict.fromkeys(("m", "rad", *result.units)):
        rows = []
        for k in (k for k in order if result.units[k] == unit):
            sizes = (in_unit(column[k], unit) for column in columns)
            ends = (in_unit(end, unit) for end in interval[k])
            rows.append((result.names[k], *sizes, percent_text(relative[k]), *ends))
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
    return Section("Parameters", tuple(body))


def _base_and_tool(result: CalibrationResult) -> Section:
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
    return Section("Base and tool", (table_of(headings, rows),))


def _left_out(result: CalibrationResult) -> Section:
    found = result.identifiable
    head = f"{found.count} of {len(found.candidates)} parameters are identifiable."
    return Section("Known, and not identifiable", (head, *found.left_out()))


def _trust(result: CalibrationResult) -> Section:
    fit = result.solution.fit
    found = fit_diagnostics(fit)
    body: list[Any] = [
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
    return Section("Quality of the fit", tuple(body))


def _outliers(result: CalibrationResult) -> Section:
    fit, errors = result.solution.fit, result.validation.in_sample
    blocks = [(m, b) for m in result.solution.problem.measurements for b in range(m.blocks)]
    place = np.cumsum([bool(m.views) for m, _ in blocks]) - 1
    rows = []
    for block in fit.outliers[:_LISTED].tolist():
        m, inside = blocks[block]
        at, lengths = place[block], ("-", "-")
        if m.views:
            lengths = millimetres(float(errors.position[at])), degrees(float(errors.angle[at]))
        where = m.origin[inside] if m.origin else (m.name, inside + 1)
        weight = float(fit.weights[fit.block == block].mean())
        rows.append((str(block + 1), where[0], str(where[1]), *lengths, f"{weight:.2g}"))
    if not rows:
        return Section("Outliers", ())
    more = f" The worst {_LISTED} of {len(fit.outliers)}:" if len(fit.outliers) > _LISTED else ""
    text = (
        "Measurements whose residuals are larger than noise explains; they stay in the fit with "
        f"their weights. Numbers and rows count from 1.{more}"
    )
    headings = ("number", "measurement or file", "row", "mm", "deg", "weight")
    return Section("Outliers", (text, table_of(headings, rows)))


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
    parts = zip(
        problem.measurements,
        linearised(problem, nominal, suited_fixtures(problem, nominal)),
        linearised(problem, solution.corrections, solution.fixtures),
        evaluations(problem, solution.corrections),
        problem.row_slices,
        strict=True,
    )
    found, block = [], 0
    for m, old, new, views, rows in parts:
        blocks = np.arange(block, block + m.blocks)
        block += m.blocks
        p = views[0].T[:, :3, 3] if views else np.full((m.blocks, 3), np.nan)
        whitened, outlier = fit.whitened[rows].reshape(m.blocks, -1), np.isin(blocks, fit.outliers)
        found.append(MeasuredResiduals(m, old.residual, new.residual, whitened, p, blocks, outlier))
    return tuple(found)
