"""The report on a calibration as one page of HTML with its figures, readable offline and on paper.

It is here and not in `calibration` because imports go down only: pictures know calibrations, and
calibrations know no pictures.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from ..calibration.report import report_sections
from ..calibration.report_parts import ReportSection, ReportTable
from ..calibration.result import CalibrationResult
from ..errors import InvalidValueError
from .plot_calibration_in_space import plot_calibration_in_space
from .plot_calibration_normality import plot_calibration_normality
from .plot_calibration_parameters import plot_calibration_correlations, plot_calibration_parameters
from .plot_calibration_residuals import as_result, plot_calibration_residuals

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE = """
body { font: 15px/1.45 system-ui, "Segoe UI", Helvetica, Arial, sans-serif; color: #1a1a1a;
  background: #fff; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; border-bottom: 2px solid #0073b3; padding-bottom: .3rem; }
h2 { font-size: 1.15rem; margin: 1.8rem 0 .4rem; }
p { margin: .4rem 0; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; margin: .6rem 0; font-size: .88rem;
  font-variant-numeric: tabular-nums; }
th, td { padding: .16rem .6rem; text-align: right; white-space: nowrap; }
th { border-bottom: 1.5px solid #555; font-weight: 600; }
td { border-bottom: 1px solid #e4e4e4; }
th:first-child, td:first-child { text-align: left; }
figure { margin: 1.2rem 0; text-align: center; }
figure img { max-width: 100%; height: auto; }
figcaption { font-size: .88rem; color: #444; text-align: left; }
@media print {
  @page { size: A4; margin: 14mm; }
  body { font-size: 10pt; max-width: none; margin: 0; padding: 0; }
  .scroll { overflow: visible; }
  table { font-size: 8.5pt; }
  th, td { padding: 1pt 5pt; }
  h2 { break-after: avoid; }
  thead { display: table-header-group; }
  tr, figure { break-inside: avoid; }
}
"""

_FIGURES: tuple[tuple[Callable[[CalibrationResult], Figure], str], ...] = (
    (
        plot_calibration_residuals,
        "Residuals (predicted minus measured) of each row over the number of the configuration, "
        "before (nominal table, base and tool fitted) and after; the scales of both sides differ.",
    ),
    (
        plot_calibration_in_space,
        "Errors of position where they were made, magnified as stated; crosses are outliers.",
    ),
    (plot_calibration_parameters, "Deviations of the parameters with their intervals."),
    (plot_calibration_correlations, "Correlations of the estimates."),
    (
        plot_calibration_normality,
        "Residuals in standard deviations: Gaussian ones follow the curve and the line.",
    ),
)


def html_report(result: CalibrationResult, path: str | Path) -> None:
    """Write the report on a calibration with its figures into one file that needs no network.

    Parameters
    ----------
    result : CalibrationResult
        Of `calibration.fit`.
    path : str or Path
        The HTML file.

    Raises
    ------
    InvalidValueError
        Not a result.
    MissingExtraError
        Matplotlib is not installed.
    OSError
        The file cannot be written.

    References
    ----------
    Seed book section 1.4.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> arm = rm.load("rx90")
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> result = calibration.fit(arm, calibration.Pose(q, rm.dgm(arm, q)), folds=0, held_out=0.0)
    >>> with TemporaryDirectory() as folder:
    ...     html_report(result, Path(folder) / "report.html")
    ...     (Path(folder) / "report.html").read_text(encoding="utf-8").count("<img ")
    5
    """
    found = as_result(result)
    title = f"Geometric calibration of {found.nominal.name}"
    parts = [f"<h1>{escape(title)}</h1>"]
    parts += [_section(section) for section in report_sections(found)]
    parts.append("<h2>Figures</h2>")
    for draw, caption in _FIGURES:
        try:
            figure = draw(found)
        except InvalidValueError as reason:  # such as arrows in space where no position is measured
            parts.append(f"<p>{escape(str(reason).removeprefix('result: '))}</p>")
            continue
        parts.append(
            f'<figure><img alt="{escape(caption)}" src="{_embedded(figure)}">'
            f"<figcaption>{escape(caption)}</figcaption></figure>"
        )
    page = (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
    )
    text = page + "\n".join(parts) + "\n</body>\n</html>\n"
    Path(path).write_text(text, encoding="utf-8")


def _section(section: ReportSection) -> str:
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


def _embedded(figure: Figure) -> str:
    buffer = BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + b64encode(buffer.getvalue()).decode("ascii")
