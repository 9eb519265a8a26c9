"""The report on an identification as one page of HTML with its figures."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ..identification.consistency.result import ConsistentFit
from ..identification.reporting.text import report_sections
from ..identification.result import IdentificationResult
from ..logs import Log
from .plot_identification_parameters import (
    plot_identification_correlations,
    plot_identification_deviations,
    plot_identification_parameters,
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
    robot: ConsistentFit | None = None,
) -> None:
    """Write the report on an identification with its figures into one file that needs no network.

    Parameters
    ----------
    result : IdentificationResult
        Of `identification.fit`.
    path : str or Path
        The HTML file.
    test : Log, optional
        The log that was kept aside, for the figures; the result holds its errors only.
    robot : ConsistentFit, optional
        Of `consistent_robot`: what it costs is told too.

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
    >>> import robotmodels as rm
    >>> from robotmodels.identification import fit
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> arm, t = rm.load("planar_2r"), np.arange(0.0, 20.0, 0.01)[:, None]
    >>> arm, w = arm.with_inertia(uniform_bodies(arm, 5.0)), np.array([1.0, 1.7])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)
    >>> result = fit(arm, Log(0.01, q, rm.idm(arm, q, v, a)), decimation=1)
    >>> with TemporaryDirectory() as folder:
    ...     identification_html(result, Path(folder) / "report.html")
    ...     (Path(folder) / "report.html").read_text(encoding="utf-8").count("<img ")
    6
    """
    found = as_identification(result)
    check_test(found, test)
    figures = [
        (
            partial(plot_identification_torques, found, test),
            "Measured and predicted torques and their difference, with its size relative to the "
            "measured torque; grey: the joint is in its dead band.",
        ),
        (
            partial(plot_identification_residuals, found),
            "Residuals of the equations that were fitted, with two of their deviations, and their "
            "autocorrelation, with the band that holds 95 % of those of white residuals.",
        ),
    ]
    if test is not None:
        figures.append(
            (
                partial(plot_identification_residuals, found, test),
                "The same of the log that was kept aside.",
            )
        )
    figures += [
        (
            partial(plot_identification_parameters, found),
            "Parameters with 95 % intervals, as what each contributes to the torques of the log.",
        ),
        (
            partial(plot_identification_deviations, found),
            "Relative standard deviations; above the dashed line (30 %) the log does not show the "
            "parameter.",
        ),
        (partial(plot_identification_correlations, found), "Correlations of the estimates."),
        (
            partial(plot_processing, found),
            "What was kept of positions and torques, and what was cut off as noise (grey); below, "
            "what decided it: the bias that noise of the positions causes, and the number of "
            "equations.",
        ),
    ]
    title = f"Dynamic identification of {found.model.name}"
    write_report(path, title, report_sections(found, robot), figures)
