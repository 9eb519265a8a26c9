"""What a report tells of the measurements: what they are of, how they err, which stand out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import Array
from ...geometry import PRISMATIC
from ...model import RobotModel
from ...table_text import ReportSection, ReportTable, table_of
from ..errors_seen import BlockErrors
from ..measurements import Measurement
from .units import degrees, in_unit, millimetres, printed_unit

if TYPE_CHECKING:
    from ..result import CalibrationResult

_OUTLIERS = 12


def measured_section(result: CalibrationResult) -> ReportSection:
    """Kinds and numbers of measurements, and readings of the joints."""
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
    body += [sentence for m in problem.measurements if (sentence := files_sentence(m))]
    if views:
        body += ["Readings of the joints:", _ranges(model, np.concatenate(views))]
    return ReportSection("What was measured", tuple(body))


def files_sentence(measurement: Measurement) -> str:
    """Files that a measurement was read from; empty if it was not."""
    files = ", ".join(str(file) for file in measurement.files)
    return f"Read for {measurement.name}: {files}." if files else ""


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


def error_section(result: CalibrationResult) -> ReportSection:
    """Errors before and after, and on data that was kept aside."""
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
    for kept in (aside, result.held_out):
        if kept is not None and kept.partition is not None:
            name = "Held out" if kept is result.held_out else f"{kept.folds} folds"
            sentences.append(f"{name}: {kept.partition.manner} kept aside.")
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


def noise_section(result: CalibrationResult) -> ReportSection:
    """Standard deviations that were stated or estimated, and residuals beside them."""
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


def outlier_section(result: CalibrationResult) -> ReportSection | None:
    """Measurements whose residuals are larger than noise explains."""
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
        at, origin = int(inside[block]), m.origin
        where = (origin[at].name, str(origin[at].row)) if origin else (m.name, str(at + 1))
        rows.append((str(int(block) + 1), *where, *lengths, f"{weight:.2g}"))
    more = (
        f" The worst {_OUTLIERS} of {len(fit.outliers)}:" if len(fit.outliers) > _OUTLIERS else ""
    )
    return ReportSection(
        "Outliers",
        (
            "Measurements whose residuals are larger than noise explains; they stay in the fit "
            f"with their weights. Numbers and rows count from 1.{more}",
            table_of(("number", "measurement or file", "row", "mm", "deg", "weight"), rows),
        ),
    )
