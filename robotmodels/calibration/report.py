"""What a calibration found and how far it can be trusted, on a page of text."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .. import se3
from .._arrays import Array
from ..estimation import confidence_intervals, fit_diagnostics
from ..geometry import PRISMATIC
from ..kinematics import operational_coordinates
from ..model import RobotModel
from ..table_text import ReportSection, ReportTable, table_of
from .errors_seen import BlockErrors
from .folds import suited_fixtures
from .identifiable import Reason
from .problem import stacked
from .report_parts import degrees, in_unit, millimetres, printed_unit

if TYPE_CHECKING:
    from .result import CalibrationResult

_STRONG = 0.9
"""Correlation from which a pair is listed."""
_PAIRS = 12
_OUTLIERS = 12


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
    """What the text and the page of a report say.

    Parameters
    ----------
    result : CalibrationResult
        Of `fit`.

    Returns
    -------
    tuple of ReportSection
        In the order in which they are read.

    Examples
    --------
    See `report_text`.
    """
    parts = (
        _outcome(result), _notes(result), _measured(result), _errors(result), _noise(result),
        _parameters(result), _places(result), _left_out(result), _trust(result), _outliers(result),
    )  # fmt: skip
    return tuple(section for section in parts if section is not None)


def _outcome(result: CalibrationResult) -> ReportSection:
    problem, fit = result.solution.problem, result.solution.fit
    sentences = [
        result.status.sentence,
        f"{problem.P} parameters and {problem.F} coordinates of fixtures from {problem.rows} rows "
        f"of {problem.blocks} measurements; loss {fit.loss.name.lower()}, {fit.iterations} steps."
        + (" With a prior." if np.isfinite(fit.prior.deviation).any() else "")
        + (f" {len(fit.dropped)} directions were left out." if len(fit.dropped) else ""),
    ]
    for unit, text in (("m", millimetres), ("rad", degrees)):
        before, after = result.before.summary(unit), result.after.summary(unit)
        if not after.blocks:
            continue
        aside = result.held_out or result.cross_validation
        found = f"Rms {'position' if unit == 'm' else 'angle'} error {text(before.rms)}"
        found += f" -> {text(after.rms)} {printed_unit(unit)}"
        if aside is not None and aside.after.summary(unit).blocks:
            found += f"; on data kept aside {text(aside.after.summary(unit).rms)}"
            found += f" {printed_unit(unit)}"
        sentences.append(found + ".")
    return ReportSection("Outcome", tuple(sentences))


def _measured(result: CalibrationResult) -> ReportSection:
    problem, model = result.solution.problem, result.nominal
    rows = [
        (
            str(k + 1), m.name, type(m).__name__, str(m.blocks), " ".join(m.axes),
            str(len(m.fixtures)), ", ".join(dict.fromkeys(_end(v.frame) for v in m.views)) or "-",
        )
        for k, m in enumerate(problem.measurements)
    ]  # fmt: skip
    headings = ("", "name", "kind", "number", "rows", "unknown fixtures", "end")
    views = [view.q for m in problem.measurements for view in m.views]
    body: list[str | ReportTable] = [table_of(headings, rows)]
    if views:
        body += ["Readings of the joints:", _ranges(model, np.concatenate(views))]
    return ReportSection("What was measured", tuple(body))


def _end(frame: str | int | None) -> str:
    return "tool" if frame is None else str(frame)


def _ranges(model: RobotModel, q: Array) -> ReportTable:
    rows = []
    prismatic = model.table.sigma[model.table.joint_rows] == PRISMATIC
    for j, name in enumerate(model.table.joint_names):
        unit = "m" if prismatic[j] else "rad"
        factor = 1e3 if prismatic[j] else 180.0 / np.pi
        low, high = float(q[:, j].min()), float(q[:, j].max())
        room = float(model.upper[j] - model.lower[j])
        share = f"{100.0 * (high - low) / room:.0f} %" if np.isfinite(room) and room > 0 else "-"
        rows.append(
            (str(j + 1), name, printed_unit(unit), f"{factor * low:.1f}", f"{factor * high:.1f}",
             f"{factor * float(q[:, j].std()):.1f}", share)
        )  # fmt: skip
    return table_of(("", "joint", "unit", "from", "to", "spread (std)", "of its range"), rows)


def _errors(result: CalibrationResult) -> ReportSection:
    rows = [
        _error_row("robot as given", result.given),
        _error_row("base and tool fitted", result.before),
        _error_row("calibrated", result.after),
    ]
    aside = result.cross_validation
    if aside is not None:
        rows.append(_error_row(f"{aside.folds} folds, before", aside.before))
        rows.append(_error_row(f"{aside.folds} folds, after", aside.after))
    if result.held_out is not None:
        rows.append(_error_row("held out, before", result.held_out.before))
        rows.append(_error_row("held out, after", result.held_out.after))
    headings = ("", "n", "rms mm", "mean", "max", "n", "rms deg", "mean", "max")
    table = table_of(headings, rows)
    shown = [bool(result.after.summary(unit).blocks) for unit in ("m", "rad")]
    columns = tuple(
        column
        for k, column in enumerate(table.columns)
        if k == 0 or shown[(k - 1) // 4]
    )  # fmt: skip
    sentences = [
        "Lengths of the residuals of each measurement. With base and tool fitted, the table is to "
        "blame for what is left. Folds and held out: measurements that the calibration had not "
        "seen (before it: base and tool fitted to all of them).",
    ]
    if aside is None and result.held_out is None:
        sentences.append(
            "No measurements were kept aside: how the robot errs elsewhere is not known."
        )
    return ReportSection("Errors before and after", (*sentences, ReportTable(columns)))


def _error_row(name: str, errors: BlockErrors) -> tuple[str, ...]:
    cells = [name]
    for unit, text in (("m", millimetres), ("rad", degrees)):
        s = errors.summary(unit)
        cells += [str(s.blocks), text(s.rms), text(s.mean), text(s.largest)]
    return tuple(cells)


def _noise(result: CalibrationResult) -> ReportSection:
    solution = result.solution
    rows, first = [], 0
    for k, (m, scale) in enumerate(
        zip(solution.problem.measurements, solution.scales, strict=True)
    ):
        count = m.blocks * len(m.axes)
        whitened = solution.fit.residuals[first : first + count].reshape(m.blocks, -1)
        first += count
        stated = m.sigma is not None or m.covariance is not None
        for unit in dict.fromkeys(m.units):
            of_unit = np.array([u == unit for u in m.units])
            if m.sigma is not None:
                size = float(np.sqrt(np.mean(m.sigma[:, of_unit] ** 2)))
            elif m.covariance is not None:
                diagonal = np.diagonal(m.covariance, axis1=1, axis2=2)
                size = float(np.sqrt(np.mean(diagonal[:, of_unit])))
            else:
                size = float(scale[of_unit].mean())
            rms = float(np.sqrt(np.mean(whitened[:, of_unit] ** 2)))
            rows.append(
                (str(k + 1), m.name, printed_unit(unit), in_unit(size, unit),
                 "stated" if stated else "estimated", f"{rms:.3g}")
            )  # fmt: skip
    headings = ("", "name", "unit", "std of a row", "", "rms residual / std")
    return ReportSection("Noise", (table_of(headings, rows),))


def _parameters(result: CalibrationResult) -> ReportSection:
    interval = confidence_intervals(result.solution.fit)[: len(result.names)]
    f = result.nominal.f
    body: list[str | ReportTable] = [
        f"Row 0 is the base, rows 1 to {f} are the frames of the table, rows from {f + 1} the "
        "measured ends. Deviations of base and ends count from where the fit placed them, the "
        "others from the nominal robot. Intervals are of the deviations."
    ]
    entries = result.parameters.entries
    order = sorted(range(len(entries)), key=lambda k: (entries[k].row, entries[k].element))
    start, std = result.parameters.nominal, result.standard_deviation
    for unit in dict.fromkeys(("m", "rad", *result.units)):
        rows = [
            (
                result.names[k], in_unit(start[k], unit), in_unit(result.deviation[k], unit),
                in_unit(result.values[k], unit), in_unit(std[k], unit),
                _percent(result.relative_deviation[k]), in_unit(interval[k, 0], unit),
                in_unit(interval[k, 1], unit),
            )
            for k in order
            if result.units[k] == unit
        ]  # fmt: skip
        if rows:
            head = f"{printed_unit(unit)}"
            headings = (head, "start", "deviation", "value", "std", "std/dev", "95 % from", "to")
            body.append(table_of(headings, rows))
    if result.fixtures:
        body.append(
            f"Fixtures: {len(result.fixtures)} coordinates of "
            f"{len({name.rsplit('.', 1)[0] for name in result.fixtures})} points, planes or "
            "targets were estimated along (result.fixtures)."
        )
    return ReportSection("Parameters", tuple(body))


def _percent(ratio: float) -> str:
    if ratio >= 10.0:
        return "> 1000 %"
    return f"{100.0 * ratio:.2g} %" if ratio < 0.995 else f"{100.0 * ratio:.0f} %"


def _places(result: CalibrationResult) -> ReportSection:
    nominal, model = result.nominal, result.model
    rows = []
    for name, given, found in (
        ("base given", nominal.base, None), ("calibrated", nominal.base, model.base),
        ("tool given", nominal.tool, None), ("calibrated", nominal.tool, model.tool),
    ):  # fmt: skip
        T = given if found is None else found
        moved = ("", "")
        if found is not None:
            between = se3.inverse(given) @ found
            turn = float(np.linalg.norm(operational_coordinates(between, "angle_axis")[3:]))
            distance = float(np.linalg.norm(between[:3, 3]))
            moved = (f"{1e3 * distance:.3f}", f"{np.rad2deg(turn):.3f}")
        rpy = np.rad2deg(operational_coordinates(T, "rpy_urdf")[3:])
        rows.append(
            (name, *(f"{1e3 * v:.3f}" for v in T[:3, 3]), *(f"{v:.3f}" for v in rpy), *moved)
        )
    headings = ("", "x mm", "y", "z", "roll deg", "pitch", "yaw", "moved mm", "turned deg")
    return ReportSection("Base and tool", (table_of(headings, rows),))


def _left_out(result: CalibrationResult) -> ReportSection:
    found = result.identifiable
    body: list[str | ReportTable] = [
        f"{found.count} of {len(found.candidates)} parameters are told by these measurements."
    ]
    for reason in (Reason.KNOWN, Reason.GAUGE, Reason.NO_EFFECT, Reason.NOISE):
        names = found.of_reason(reason)
        if names:
            body.append(f"{', '.join(names)}: {reason.value}.")
    into = found.regrouped_into
    if into:
        body.append(
            f"Seen only in combination ({Reason.REGROUPED.value}): a deviation of 1 (m, rad) "
            "acts like"
        )
        body.append(table_of(("parameter", "acts like"), _lines_of_sums(into)))
    low, high = found.gap
    body.append(
        f"Sines of the angles to the columns before: {low:.1e} is the smallest that was kept, "
        f"{high:.1e} the largest left out."
    )
    return ReportSection("Known, and not identifiable", tuple(body))


def _lines_of_sums(into: dict[str, dict[str, float]]) -> list[tuple[str, ...]]:
    from textwrap import wrap

    rows = []
    for name, terms in into.items():
        words = [f"{c:+.3g} {other}" for other, c in terms.items() if abs(c) > 1e-9]
        text = "   ".join(words) or "the unknown fixtures"
        first, *others = wrap(text, 78)
        rows += [(name, first), *(("", line) for line in others)]
    width = max(len(line) for _, line in rows)
    return [(name, line.ljust(width)) for name, line in rows]


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
    """Pairs of parameters whose estimates are strongly correlated, the strongest first.

    Parameters
    ----------
    result : CalibrationResult
        Of `fit`.
    least : float
        Size of the correlation from which a pair is listed.

    Returns
    -------
    list of (str, str, float)
        Names and correlation.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> arm = rm.load("rx90")
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> result = calibration.fit(arm, calibration.Pose(q, rm.dgm(arm, q)), folds=0, held_out=0.0)
    >>> all(abs(c) > 0.5 for *_, c in strong_correlations(result, 0.5))
    True
    """
    C, names = result.correlation, result.names
    rows, columns = np.nonzero(np.triu(np.abs(C) > least, k=1))
    pairs = [(names[i], names[j], float(C[i, j])) for i, j in zip(rows, columns, strict=True)]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def _outliers(result: CalibrationResult) -> ReportSection | None:
    fit, measurements = result.solution.fit, result.solution.problem.measurements
    if not len(fit.outliers):
        return None
    owner = np.repeat(np.arange(len(measurements)), [m.blocks for m in measurements])
    inside = np.concatenate([np.arange(m.blocks) for m in measurements])
    seen = np.array([bool(measurements[k].views) for k in owner])
    place = np.cumsum(seen) - 1
    rows = []
    for block in fit.outliers[:_OUTLIERS]:
        m, at = measurements[owner[block]], place[block]
        weight = float(fit.weights[fit.block == block].mean())
        lengths = ("-", "-")
        if seen[block]:
            p, angle = float(result.after.position[at]), float(result.after.angle[at])
            lengths = (millimetres(p), degrees(angle))
        rows.append((str(int(block)), m.name, str(int(inside[block]) + 1), *lengths,
                     f"{weight:.2g}"))  # fmt: skip
    more = (
        f" The worst {_OUTLIERS} of {len(fit.outliers)}:" if len(fit.outliers) > _OUTLIERS else ""
    )
    return ReportSection(
        "Outliers",
        (
            "Measurements that are longer than noise explains; they stay in the fit with their "
            f"weights.{more}",
            table_of(("block", "measurement", "row", "mm", "deg", "weight"), rows),
        ),
    )


def _notes(result: CalibrationResult) -> ReportSection | None:
    notes = [
        note for note in (*result.notes, *result.robot.notes) if note != result.status.sentence
    ]
    return ReportSection("Notes", tuple(f"* {note}" for note in notes)) if notes else None
