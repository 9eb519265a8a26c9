"""``robotmodels calibrate``: geometric parameters of a robot from files of measurements."""

from __future__ import annotations

import argparse
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InvalidValueError
from ..model import RobotModel
from .arguments import column, columns, given, joint_numbers, numbers, robot_of
from .option_words import in_options
from .output import Report, check_output, progress, with_extra

if TYPE_CHECKING:
    from ..calibration import Measurement, ParameterPrior

EXAMPLES = """\
examples:
  robotmodels calibrate --robot arm.urdf --measurements tracker.csv --kind position \\
      --lengths mm --angles deg --out report/
  robotmodels calibrate --robot rx90 --measurements camera.csv --kind pose \\
      --orientation quaternion --loss huber --json
  robotmodels calibrate --robot rx90 --measurements hole_0.csv hole_1.csv \\
      --kind point-contact --known-distance hole_0 hole_1 0.1 --parameters b7 d7 r7

Into the folder of --out go report.txt, report.html (text and figures, one offline file),
result.json (what --json prints) and calibrated.urdf (a robot read from a URDF keeps its own, with
other origins of joints). Without --out the report is printed."""
DESCRIPTION = """\
Geometric calibration: estimate the parameters that measurements determine, with their standard
errors; errors before and after, and on held-out measurements."""
USAGE = "robotmodels calibrate --robot ROBOT --measurements FILE [FILE ...] --kind KIND [options]"
OPTIONS = """\
@robot_option
the measurements:
--measurements FILE [required +] CSV files, or one folder
--kind KIND [required
    position|pose|orientation|distance|relative-pose|point-contact|frame-contact|plane-contact] kind
    of the measurements: %(choices)s
--pattern [=*.csv] of the files in a folder
@units
--joint-angles [rad|deg] unit of the readings of joints, if another
--orientation KIND [] how orientations are written: rpy_urdf, rpy, quaternion (scalar first),
    angle_axis, euler, ...
--joints COLUMN [+] columns of the readings of the joints, by name or number from 0
--other-joints COLUMN [+] columns of the readings at the other end of a distance
--columns COLUMN [+] columns of the measured values (x y z, then the orientation)
--label COLUMN [] column of the labels of touched points or planes; default: the names of the files
@delimiter
--frame [] measured end: a frame of the robot (default: the tool)
--sigma NUMBERS [] standard deviations of a measurement in m and rad: one, or one for each
    coordinate; default: estimated
--known-distance A B LENGTH [repeated 3] point contacts: distance of two touched points, in the unit
    of --lengths; may be repeated
the fit:
--parameters NAME [+] candidates, such as theta2 d3 (default: all)
--known NAME [+ =] parameters that stay as they are
--known-lengths NAME [+ =] the same, for lengths that give the scale
--fixed-base [flag] the base pose is exact
--fixed-tool [flag] the tool pose is exact
--gains [flag] errors of gain of the encoders
--eccentricity [flag] encoders off their axes
--compliance [none|joints|links|isotropic|uniform =none] elements that deflect under gravity
--loss [squares|huber|cauchy|tukey =squares] all but the first against outliers
--prior LENGTH ANGLE|none [] standard deviations of the table's lengths (m) and angles (rad) that
    are expected, or none (default: 1e-3 5e-3)
--folds [int =5] largest number of folds: whole places or runs of postures; 0 for none
--held-out SHARE [float =0.2] share of the places or postures that one more fit is tested on, 0 for
    none
--test FILE [+] files of measurements that only test the result
@output"""
NOT_REACHED = "the fit has not converged"


def run(arguments: argparse.Namespace) -> Report:
    """Run the command: read, fit, and print or write."""
    from ..calibration import KnownDistance, ParameterPrior, fit
    from ..calibration.report import files_sentence, report
    from ..calibration.write import result_data, write_result

    check_output(arguments)
    model = robot_of(arguments)
    measured = read(arguments, model, arguments.measurements)
    known = [
        KnownDistance(
            f"{measured.name}:{a}", f"{measured.name}:{b}",
            float(numbers(length, 1, "--known-distance")[0])
            * (1e-3 if arguments.lengths == "mm" else 1.0),
        )
        for a, b, length in arguments.known_distance
    ]  # fmt: skip
    prior: ParameterPrior | None = ParameterPrior()
    if arguments.prior is not None:
        prior = _prior(arguments.prior)
    aside: Measurement | float = arguments.held_out
    if arguments.test is not None:
        aside = read(arguments, model, arguments.test, name="test")
    try:
        with progress(arguments, "fitting") as bar:
            result = fit(
                model, [measured, *known], base=not arguments.fixed_base,
                tool=not arguments.fixed_tool, prior=prior, held_out=aside,
                progress=bar,
                **given(arguments, "parameters", "known", "known_lengths", "gains",
                        "eccentricity", "compliance", "loss", "folds"),
            )  # fmt: skip
    except InvalidValueError as error:
        raise InvalidValueError(_with_labels(str(error), measured)) from error
    options = arguments.options()
    notes = [in_options(_with_labels(note, measured), options) for note in result.notes]
    result = replace(result, notes=tuple(notes))
    tested = "" if isinstance(aside, float | int) else f"\n{files_sentence(aside)}\n"
    text = report(result) + tested

    def write(folder: Path) -> list[str]:
        from ..viz import html_report

        names, page = ["report.txt", "result.json", "calibrated.urdf"], folder / "report.html"
        (folder / "report.txt").write_text(text, encoding="utf-8")
        write_result(result, folder / "result.json")
        write_result(result, folder / "calibrated.urdf")
        return names + with_extra(page, lambda: html_report(result, page))

    head = text.split("\nMeasurements\n", 1)[0]
    head += "\n".join(files_sentence(m) for m in result.solution.problem.measurements if m.files)
    is_converged = result.solution.fit.converged
    head = (head + tested).rstrip()
    return Report(text.rstrip(), lambda: result_data(result), is_converged, head, write)


def read(
    arguments: argparse.Namespace, model: RobotModel, files: list[str], name: str | None = None
) -> Measurement:
    """The measurements of some files."""
    from ..calibration.read import read_measurements

    return read_measurements(
        files[0] if len(files) == 1 else files, arguments.kind, model,
        joints=columns(arguments.joints), columns=columns(arguments.columns),
        other_joints=columns(arguments.other_joints),
        label=None if arguments.label is None else column(arguments.label),
        sigma=joint_numbers(arguments.sigma, range(1, 7), "--sigma"), name=name,
        **given(arguments, "lengths", "angles", "joint_angles", "orientation", "pattern",
                "delimiter", "frame"),
    )  # fmt: skip


def _with_labels(message: str, measured: Measurement) -> str:
    """A message with points by their labels alone, as --known-distance names them."""
    return re.sub(rf"(?<![\w-]){re.escape(measured.name)}:(?=\S)", "", message)


def _prior(text: str) -> ParameterPrior | None:
    """Standard deviations of lengths and angles, or none."""
    from ..calibration import ParameterPrior

    if text.strip().lower() == "none":
        return None
    length, angle = numbers(text, 2, "--prior")
    return ParameterPrior(length=float(length), angle=float(angle))
