"""The report on a calibration as one page of HTML with its figures, readable offline and on paper.

It is here and not in `calibration` because imports go down only: pictures know calibrations, and
calibrations know no pictures.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..calibration.report import report_sections
from ..calibration.result import CalibrationResult
from .plot_calibration_in_space import plot_calibration_in_space
from .plot_calibration_normality import plot_calibration_normality
from .plot_calibration_parameters import plot_calibration_correlations, plot_calibration_parameters
from .plot_calibration_residuals import as_result, plot_calibration_residuals
from .report_page import write_report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    (plot_calibration_parameters, "Corrections of the parameters with their intervals."),
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
    figures = [(partial(draw, found), caption) for draw, caption in _FIGURES]
    write_report(path, title, report_sections(found), figures)
