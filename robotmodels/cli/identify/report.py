"""Output of ``robotmodels identify``: the report, and a physically consistent robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import InvalidValueError, RobotModelsError
from ..output import Report, with_extra
from ..streams import say

if TYPE_CHECKING:
    from ...identification import IdentificationResult, Log
    from ...inertia import InertialParameters
    from ...minimal_parameters import StandardParameters


def report(
    result: IdentificationResult, test: Log | None, robot: StandardParameters | None
) -> Report:
    """An identification in every form."""
    from ...identification import report as text_of
    from ...identification import write_result
    from ...identification.result_file import result_data

    text = text_of(result, robot)

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
) -> StandardParameters | None:
    """Physically consistent robot; unless requested, a failure is only reported."""
    from ...identification.consistent import consistent_robot, prior_bodies

    try:
        if prior is None:
            prior, sentences = prior_bodies(result.model)
            for sentence in sentences:
                say(sentence)
        robot = consistent_robot(result, prior)
    except RobotModelsError as error:
        if asked:
            raise
        say(f"no identified.urdf: {error}")
        return None
    if not robot.is_usable:
        if asked:
            raise InvalidValueError(f"--consistent: {robot.reason()}")
        say(f"no identified.urdf: {robot.reason()}")
        return None
    return robot
