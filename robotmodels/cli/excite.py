"""``robotmodels excite``: an exciting trajectory for the base parameters of a robot."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._arrays import Array, as_number
from ..errors import InvalidValueError
from .arguments import given, joint_numbers, robot_of
from .output import Report, check_output, progress, with_extra

if TYPE_CHECKING:
    from ..obstacles import Box

EXAMPLES = """\
examples:
  robotmodels excite --robot planar_2r --duration 10 --harmonics 3 --starts 1 --out motion/
  robotmodels excite --robot ur10e --acceleration 4 --box -inf -inf 0.1 inf inf inf \\
      --seed 1 --starts 1 --iterations 5 --random 5 --json
  robotmodels excite --robot arm.urdf --kind spline --drive Fv Fc offset --starts 1 --iterations 20

Into the folder of --out go trajectory.csv (or .npz, .yaml: --format), trajectory.json (the
coefficients and all numbers, what --json prints), trajectory.png (if Matplotlib is installed) and
summary.txt. Without --out the summary is printed."""
DESCRIPTION = """\
Exciting trajectory: a periodic motion within the limits of a robot on which its base parameters are
identified best, with analytic gradients from several starts."""
USAGE = "robotmodels excite --robot ROBOT [options]"
OPTIONS = """\
@robot_option
the motion:
--duration [float =10.0] of one period, s
--kind [fourier|spline =fourier] finite Fourier series or quintic spline
--harmonics [int =5] of the series
--points [int] of the spline (default: twice the harmonics)
--drive KIND [* Ia|Fv|Fc|offset =Ia Fv Fc] drive parameters to be identified: Ia Fv Fc offset, or
    none (default: Ia Fv Fc)
the limits:
--velocity NUMBERS [] greatest velocity, rad/s or m/s: one, or one for each joint
--acceleration NUMBERS [] greatest acceleration, rad/s^2 or m/s^2: one, or one for each joint
--torque-limits NUMBERS [] greatest torques, N m or N: one, or one for each joint (default: those of
    the robot)
--box NUMBERS [repeated] box that the tool stays in: lower x y z, upper x y z, m; inf for no face;
    may be repeated
--keep-out NUMBERS [repeated] box that the tool keeps out of: lower x y z, upper x y z, m; inf for
    no face; may be repeated
the search:
--criterion [condition|log-det =condition] criterion that is minimised
--sigma NUMBERS [] standard deviations of the torques, N m or N: one, or one for each joint
--starts [int] motions that are improved (default: 8, or as many as the budget has)
--random COUNT [int] random motions, of which the best are improved (default: 100, or as many as the
    budget has)
--iterations [int] largest number for each stage of a start (default: what the budget has)
--seed [int =0] of the random generator
@output
--rate [float] with --out: samples per second in the file (default: 1000)
--format [csv|npz|yaml] with --out: of the samples; yaml: ROS JointTrajectory (default: csv)
--degrees [flag] with --out: revolute joints in degrees in the file; --json stays in radians"""
NOT_REACHED = "no motion within all limits was found"


def run(arguments: argparse.Namespace) -> Report:
    """Run the command: search, and print or write."""
    from ..identification.excitation import exciting_trajectory, write_trajectory
    from ..identification.excitation.result import excitation_data
    from ..obstacles import Box
    from ..trajectories import MotionLimits

    check_output(arguments)
    model = robot_of(arguments)
    if arguments.seed < 0:
        raise InvalidValueError(f"--seed: expected a number from 0, got {arguments.seed}.")
    stray = [name for name in ("rate", "format", "degrees") if getattr(arguments, name)]
    if stray and arguments.out is None:
        raise InvalidValueError(f"--{stray[0]}: describes the file of --out; give --out as well.")
    if arguments.degrees and arguments.format == "yaml":
        raise InvalidValueError("--degrees: ROS reads radians; leave it out with --format yaml.")
    rate = 1000.0 if arguments.rate is None else as_number(arguments.rate, "--rate", above=0.0)
    boxes, workspace = _boxes(arguments.box, "--box"), None
    if boxes:  # what is inside of all
        lower = np.max([box.lower for box in boxes], axis=0)
        upper = np.min([box.upper for box in boxes], axis=0)
        if not (lower < upper).all():
            raise InvalidValueError("--box: the boxes have no common point.")
        workspace = Box(lower, upper)
    limits = MotionLimits.of_model(model)
    for name in ("velocity", "acceleration"):
        most = _each(getattr(arguments, name), model.n, f"--{name}")
        if most is not None:
            limits = replace(limits, **{name: most, f"{name}_lower": -most})
    with progress(arguments, "searching") as bar:
        found = exciting_trajectory(
            model, drive=tuple(arguments.drive) or False, limits=limits,
            torque_limits=_each(arguments.torque_limits, model.n, "--torque-limits"),
            sigma=_each(arguments.sigma, model.n, "--sigma"), workspace=workspace,
            obstacles=_boxes(arguments.keep_out, "--keep-out"),
            baseline=arguments.random, rng=arguments.seed,
            progress=bar,
            **given(arguments, "duration", "harmonics", "points", "kind", "criterion", "starts",
                    "iterations"),
        )  # fmt: skip

    def write(folder: Path) -> list[str]:
        from ..viz import plot_excitation

        names = [f"trajectory.{arguments.format or 'csv'}", "trajectory.json", "summary.txt"]
        write_trajectory(found, folder / names[0], rate, degrees=arguments.degrees)
        write_trajectory(found, folder / "trajectory.json")
        (folder / "summary.txt").write_text(f"{found}\n", encoding="utf-8")
        picture = folder / "trajectory.png"
        return names + with_extra(picture, lambda: plot_excitation(found).savefig(picture))

    is_reached = found.status.name != "INFEASIBLE"
    return Report(str(found), lambda: excitation_data(found), is_reached, str(found), write)


def _each(text: str | None, n: int, option: str) -> Array | None:
    """One for each joint."""
    values = joint_numbers(text, n, option)
    return None if values is None else np.full(n, values)


def _boxes(given: list[str], option: str) -> list[Box]:
    from ..obstacles import Box

    boxes = []
    for text in given:
        try:  # infinity means that there is no face
            corners = np.array(list(map(float, text.replace(",", " ").split())))
            boxes.append(Box(*corners.reshape(2, 3)))
        except InvalidValueError as error:
            raise InvalidValueError(f"{option}: {error}") from error
        except ValueError:
            raise InvalidValueError(f"{option}: expected six numbers in m, got {text!r}.") from None
    return boxes
