"""What ``robotmodels identify`` hands over: the report, and the robot of real bodies."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import InvalidValueError, RobotModelsError
from ..output import Report, with_extra
from ..streams import say

if TYPE_CHECKING:
    from ...identification import ConsistentFit, IdentificationResult, Log
    from ...inertia import InertialParameters


def report(result: IdentificationResult, test: Log | None, robot: ConsistentFit | None) -> Report:
    """An identification in every form."""
    from ...identification.reporting.result_data import result_data
    from ...identification.reporting.text import report_text
    from ...identification.reporting.write import write_result

    text = report_text(result, robot)

    def write(folder: Path) -> list[str]:
        from ...viz import identification_html

        names = ["report.txt", "result.json"]
        (folder / "report.txt").write_text(text, encoding="utf-8")
        write_result(result, folder / "result.json", robot)
        if robot is not None:
            write_result(result, folder / "identified.urdf", robot)
            names.append("identified.urdf")
        page = folder / "report.html"
        return names + with_extra(page, lambda: identification_html(result, page, test, robot))

    head = text.split("\n\nData\n", 1)[0]
    return Report(text.rstrip(), head.rstrip(), lambda: result_data(result, robot), write)


def real_bodies(
    result: IdentificationResult, prior: InertialParameters | None, asked: bool
) -> ConsistentFit | None:
    """Physically consistent robot; unless requested, a failure is only reported."""
    from ...identification.consistency.identified_robot import consistent_robot, prior_bodies
    from ...identification.consistency.result import ConsistentStatus

    try:
        if prior is None:
            prior, sentences = prior_bodies(result.model)
            for sentence in sentences:
                say(sentence)
        found = consistent_robot(result, prior)
    except RobotModelsError as error:
        if asked:
            raise
        say(f"no identified.urdf: {error}")
        return None
    if found.status is ConsistentStatus.FAILED:
        if asked:
            raise InvalidValueError(f"--consistent: {found.reason()}")
        say(f"no identified.urdf: {found.reason()}")
        return None
    return found
