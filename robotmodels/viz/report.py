"""Reports with their figures as one HTML file, readable offline and on paper.

Parameters
----------
result : CalibrationResult or IdentificationResult
    Of `calibration.fit` or `identification.fit`.
path : str or Path
    The HTML file.
test : Log, optional
    Held-out log, for the figures; the result contains its errors only.
robot : StandardParameters, optional
    Result of `consistent_robot`; the increase of its residuals is reported.

References
----------
Book sections 1.4 and 1.6.5.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Iterable
from functools import partial
from html import escape
from inspect import cleandoc
from io import BytesIO
from pathlib import Path
from string import Template

from ..calibration.report import report_sections as calibration_sections
from ..calibration.result import CalibrationResult
from ..errors import InvalidValueError
from ..identification.report import report_sections as identification_sections
from ..identification.result import IdentificationResult
from ..logs import Log
from ..minimal_parameters import StandardParameters
from ..table_text import ReportSection, ReportTable
from . import calibration, identification
from .processing import plot_processing
from .style import Figure

Drawing = Callable[..., "Figure"]
"""A function that draws a figure of a result; its summary is the caption."""


def html_report(result: CalibrationResult, path: str | Path) -> None:
    """Write the report on a calibration with its figures into one offline file."""
    found = calibration.as_result(result)
    figures: list[Drawing] = [
        calibration.plot_calibration_residuals,
        calibration.plot_calibration_in_space,
        calibration.plot_calibration_parameters,
        calibration.plot_calibration_correlations,
        calibration.plot_calibration_normality,
    ]
    title = f"Geometric calibration of {found.nominal.name}"
    _write(path, title, calibration_sections(found), figures, found)


def identification_html(
    result: IdentificationResult,
    path: str | Path,
    test: Log | None = None,
    robot: StandardParameters | None = None,
) -> None:
    """Write the report on an identification with its figures into one offline file."""
    found = identification.as_result(result, test)
    own = identification
    figures: list[Drawing] = [
        partial(own.plot_identification_torques, test=test),
        own.plot_identification_residuals,
        *([] if test is None else [partial(own.plot_identification_residuals, test=test)]),
        own.plot_identification_parameters,
        own.plot_identification_standard_errors,
        own.plot_identification_correlations,
        plot_processing,
    ]
    title = f"Dynamic identification of {found.model.name}"
    _write(path, title, identification_sections(found, robot), figures, found)


def _write(
    path: str | Path,
    title: str,
    sections: Iterable[ReportSection],
    figures: Iterable[Drawing],
    result: object,
) -> None:
    """Write a report with its figures into one file that needs no network."""
    template = Template(Path(__file__).with_name("report.html").read_text(encoding="utf-8"))
    text = template.substitute(
        title=escape(title),
        sections="\n".join(map(_section, sections)),
        figures="\n".join(_figure(draw, result) for draw in figures),
    )
    Path(path).write_text(text, encoding="utf-8")


def _figure(draw: Drawing, result: object) -> str:
    """A figure of a result as an embedded image; its caption is the summary of the function."""
    function, buffer = getattr(draw, "func", draw), BytesIO()
    caption = escape(cleandoc(function.__doc__ or "").split("\n\n")[0])
    if function is not draw and "residuals" in function.__name__:
        caption = f"Held-out log: {caption}"
    try:
        draw(result).savefig(buffer, format="svg", metadata={"Date": None})
    except InvalidValueError as reason:  # such as arrows in space where no position is measured
        return f"<p>{escape(str(reason).removeprefix('result: '))}</p>"
    image = "data:image/svg+xml;base64," + b64encode(buffer.getvalue()).decode("ascii")
    return f'<figure><img alt="{caption}" src="{image}"><figcaption>{caption}</figcaption></figure>'


def _section(section: ReportSection) -> str:
    """A title with paragraphs, list items and tables."""
    body = []
    for part in section.body:
        if isinstance(part, ReportTable):
            body.append(_table(part))
        elif part.startswith("* "):
            body.append(f"<p>&bull; {escape(part[2:])}</p>")
        else:
            body.append(f"<p>{escape(part)}</p>")
    return f"<h2>{escape(section.title)}</h2>\n" + "\n".join(body)


def _table(table: ReportTable) -> str:
    """A table that scrolls in its own box."""
    head = "".join(f"<th>{escape(name)}</th>" for name, _ in table.columns)
    rows = (
        "<tr>" + "".join(f"<td>{escape(cells[i])}</td>" for _, cells in table.columns) + "</tr>"
        for i in range(table.rows)
    )
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>\n'
        + "\n".join(rows)
        + "\n</tbody></table></div>"
    )
