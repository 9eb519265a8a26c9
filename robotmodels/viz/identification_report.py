"""The report on an identification as one page of HTML with its figures."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ..identification.report import report_sections
from ..identification.result import IdentificationResult
from ..logs import Log
from ..minimal_parameters import StandardParameters
from .plot_identification_parameters import (
    plot_identification_correlations,
    plot_identification_parameters,
    plot_identification_standard_errors,
)
from .plot_identification_processing import plot_processing
from .plot_identification_residuals import plot_identification_residuals
from .plot_identification_torques import (
    as_identification,
    check_test,
    plot_identification_torques,
)
from .report_page import write_report


def identification_html(
    result: IdentificationResult,
    path: str | Path,
    test: Log | None = None,
    robot: StandardParameters | None = None,
) -> None:
    """Write the report on an identification with its figures into one file that needs no network.

    Parameters
    ----------
    result : IdentificationResult
        Result of `identification.fit`.
    path : str or Path
        The HTML file.
    test : Log, optional
        Held-out log, for the figures; the result contains its errors only.
    robot : StandardParameters, optional
        Result of `consistent_robot`; the increase of its residuals is reported.

    Raises
    ------
    InvalidValueError, ShapeError
        Not a result; not a log of its joints.
    MissingExtraError
        Matplotlib is not installed.
    OSError
        The file cannot be written.

    References
    ----------
    Seed book section 1.6.5.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> result = fit(*example_log())
    >>> with TemporaryDirectory() as folder:
    ...     identification_html(result, Path(folder) / "report.html")
    ...     (Path(folder) / "report.html").read_text(encoding="utf-8").count("<img ")
    6
    """
    identification = as_identification(result)
    check_test(identification, test)
    figures = [
        (
            partial(plot_identification_torques, identification, test),
            "Measured and predicted torques and their difference, with its size relative to the "
            "measured torque; grey: the joint is in its dead band.",
        ),
        (
            partial(plot_identification_residuals, identification),
            "Residuals of the fitted equations, with two standard deviations, and their "
            "autocorrelation, with the 95 % band of white residuals.",
        ),
    ]
    if test is not None:
        figures.append(
            (
                partial(plot_identification_residuals, identification, test),
                "The same for the held-out log.",
            )
        )
    figures += [
        (
            partial(plot_identification_parameters, identification),
            "Parameters with 95 % intervals, as their contributions to the torques of the log.",
        ),
        (
            partial(plot_identification_standard_errors, identification),
            "Relative standard errors; above the dashed line (30 %) the log does not determine the "
            "parameter.",
        ),
        (
            partial(plot_identification_correlations, identification),
            "Correlations of the estimates.",
        ),
        (
            partial(plot_processing, identification),
            "Spectra of positions and torques, kept and cut off as noise (grey); below, "
            "the criteria: the bias that noise of the positions causes, and the number of "
            "equations.",
        ),
    ]
    title = f"Dynamic identification of {identification.model.name}"
    write_report(path, title, report_sections(identification, robot), figures)
