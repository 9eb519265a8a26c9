"""What a report tells of the log and of its processing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...logs import Log
from ...table_text import ReportSection, ReportTable, table_of
from .parameters import effort_units

if TYPE_CHECKING:
    from ..result import IdentificationResult


def data_section(result: IdentificationResult) -> ReportSection:
    """What was recorded, what was refused of it, and what each joint did."""
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


def processing_section(result: IdentificationResult) -> ReportSection:
    """How the log was filtered and thinned, and why."""
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
