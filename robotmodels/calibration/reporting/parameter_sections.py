"""What a report tells of the parameters: values, base and tool, and what could not be told."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ... import se3
from ...estimation import confidence_intervals
from ...kinematics import operational_coordinates
from ...table_text import ReportSection, ReportTable, table_of
from ..identifiable import Reason
from .units import in_unit, printed_unit

if TYPE_CHECKING:
    from ..result import CalibrationResult


def parameter_section(result: CalibrationResult) -> ReportSection:
    """Deviations and values with their intervals, unit by unit."""
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
    if result.held_by_prior:
        body.append(f"Determined mainly by the prior: {', '.join(result.held_by_prior)}.")
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


def place_section(result: CalibrationResult) -> ReportSection:
    """Base and tool as given and as calibrated."""
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


def left_out_section(result: CalibrationResult) -> ReportSection:
    """What is known or cannot be told, and why."""
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
