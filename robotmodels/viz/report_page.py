"""Reports as one page of HTML with their figures, readable offline and on paper."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InvalidValueError
from ..table_text import ReportSection, ReportTable

if TYPE_CHECKING:
    from collections.abc import Callable

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


def write_report(
    path: str | Path,
    title: str,
    sections: Iterable[ReportSection],
    figures: Iterable[tuple[Callable[[], Figure], str]],
) -> None:
    """Write a report with its figures into one file that needs no network."""
    parts = [f"<h1>{escape(title)}</h1>"]
    parts += [_section(section) for section in sections]
    drawn = [_figure(draw, caption) for draw, caption in figures]
    parts += ["<h2>Figures</h2>", *drawn] if drawn else []
    page = (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
    )
    text = page + "\n".join(parts) + "\n</body>\n</html>\n"
    Path(path).write_text(text, encoding="utf-8")


def _figure(draw: Callable[[], Figure], caption: str) -> str:
    try:
        figure = draw()
    except InvalidValueError as reason:  # such as arrows in space where no position is measured
        return f"<p>{escape(str(reason).removeprefix('result: '))}</p>"
    return (
        f'<figure><img alt="{escape(caption)}" src="{_embedded(figure)}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


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
