"""Second part of the demonstration: identification of a robot from its log.

Source: Seed book sections 1.6.2 and 1.6.5.
"""

from __future__ import annotations

import textwrap
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._arrays import Array
from ..errors import MissingExtraError, UrdfWarning

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    from ..datasets import Tx40Log
    from ..identification import IdentificationResult, Log
    from ..minimal_parameters import StandardParameters
    from .output import Bar

_TERMINAL = 88  # columns, as the headings of the demonstration
_PUBLISHED_RMSE = (6.40, 8.21, 4.13, 1.72, 2.65, 1.72)
"""N m: errors of the best published fit for each joint, on the held-out rows."""


def identify_tx40(
    folder: Path, progress: Callable[[str], AbstractContextManager[Bar | None]]
) -> None:
    """Identify the Staubli TX40 from its log, print the result, and write files."""
    from ..datasets import load_tx40
    from ..identification import check_log, fit, synchronisation
    from ..identification.checks import check_joints
    from ..identification.report import report_sections

    data = load_tx40()
    model, log = data.model, data.log
    print(log)
    _print(f"{data.source}; {data.licence}")
    print("Checking it (compiles the first time on this machine only) ...", flush=True)
    started = time.perf_counter()
    findings = (*check_log(log, model), *check_joints(log, model))
    _print("\n".join(map(str, findings)) or "The checks of the log found nothing.")
    _print(str(synchronisation(log, model)))
    with progress("the whole log") as bar:
        whole = fit(model, log, progress=bar and bar.fraction)
    print(f"  identified after {time.perf_counter() - started:.1f} s\n")
    print(comparison(data, whole))
    first = log.rows(data.training.start, data.training.stop)
    last = log.rows(data.held_out.start, data.held_out.stop)
    started = time.perf_counter()
    with progress("without the rows that test") as bar:
        trained = fit(model, first, test=last, progress=bar and bar.fraction)
    seconds = time.perf_counter() - started
    print(f"\nFitted on samples {data.training.start} to {data.training.stop} ({seconds:.1f} s, "
          f"with all checks); torques of samples {data.held_out.start}\nto {data.held_out.stop} as "
          "predicted, root mean square error in N m, unfiltered:")  # fmt: skip
    held_out = trained.validation.held_out
    assert held_out is not None  # a test was given
    for word, row in (("here", held_out.rmse), ("published, best", np.array(_PUBLISHED_RMSE))):
        print(f"  {word:16s}" + "".join(f"{error:8.2f}" for error in row))
    print(f"\n{report_sections(trained)[0].text()}\n")
    robot = _real_bodies(trained)
    _write(trained, robot, folder)
    _draw(trained, last, robot, folder)


def comparison(data: Tx40Log, result: IdentificationResult) -> str:
    """Identified and published values side by side, and how many agree."""
    from ..identification.weak_parameters import weak_parameters

    both = [one for one in data.published if one.name in result.names]
    weak = weak_parameters(result.estimate)
    lines = ["Weighted least squares, SI units, with standard errors: here they hold for",
             "residuals that are correlated in time, the published ones for white residuals.",
             f"{'':10s}{'here':>10s}{'':10s}{'published':>12s}"]  # fmt: skip
    for one in both:
        if one.name not in weak:
            x, s = result.value(one.name), result.standard_error(one.name)
            lines.append(f"  {one.name:8s}{x:10.4f} +-{s:7.4f}{one.wls:12.4f} "
                         f"+-{one.wls_deviation:7.4f}")  # fmt: skip
    off: Array = np.array([abs(result.value(one.name) - one.wls) for one in both])
    estimated: Array = np.array([result.standard_error(one.name) for one in both])
    published: Array = np.array([one.wls_deviation for one in both])
    unlisted = sum(one.name in weak for one in both)
    return "\n".join([
        *lines,
        f"  and {unlisted} whose relative standard error is above 30 %.",
        f"{np.sum(off <= 2.0 * estimated)} of {len(both)} are within two of our standard errors.",
        f"{np.sum(off <= 2.0 * published)} of {len(both)} are within two published ones.",
    ])  # fmt: skip


def _real_bodies(result: IdentificationResult) -> StandardParameters | None:
    from ..identification import consistent_robot

    try:
        robot = consistent_robot(result)
    except MissingExtraError as error:
        _print(f"No physically consistent robot, no URDF: {error}")
        return None
    print(
        f"Physical bodies and drives: residuals {robot.residual_increase:.2f} % above least squares"
    )
    return robot


def _write(result: IdentificationResult, robot: StandardParameters | None, folder: Path) -> None:
    from ..identification import report, write_result

    text = folder / "tx40-report.txt"
    text.write_text(report(result, robot), encoding="utf-8")
    print(f"Report: {text.resolve()}")
    numbers = folder / "tx40-result.json"
    write_result(result, numbers, robot)
    print(f"Result for programs: {numbers.resolve()}")
    if robot is not None:
        urdf = folder / "tx40-identified.urdf"
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UrdfWarning)
            write_result(result, urdf, robot)
        print(f"URDF: {urdf.resolve()}")
        for warning in caught:
            _print(f"Note: {warning.message}")


def _draw(
    result: IdentificationResult, test: Log, robot: StandardParameters | None, folder: Path
) -> None:
    from ..viz import identification_html

    page = folder / "tx40-report.html"
    try:
        identification_html(result, page, test, robot)
    except MissingExtraError as error:
        _print(f"No figures: {error}")
        return
    print(f"Page with figures: {page.resolve()} (open it in a browser)")


def _print(text: str) -> None:
    for line in text.splitlines():
        print(textwrap.fill(line, _TERMINAL, break_on_hyphens=False, break_long_words=False))
