"""Logs of ``robotmodels identify``: reading, delay, split into fitted and held-out parts."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from ...errors import InvalidValueError
from ...model import RobotModel
from ..columns import column, columns
from ..numbers import joint_numbers, numbers

if TYPE_CHECKING:
    from ...identification import Log
    from ...identification.delay import Synchronisation


def logs(arguments: argparse.Namespace, model: RobotModel) -> tuple[Log, Log | None]:
    """The log to fit and the held-out log."""
    from ...identification.delay import synchronisation
    from ...logs import with_delay

    ways = (arguments.test, arguments.test_rows, arguments.test_share)
    if sum(way is not None for way in ways) > 1:
        raise InvalidValueError("--test, --test-rows and --test-share: give one of them.")
    if arguments.test_torques_from is not None and arguments.test is None:
        raise InvalidValueError("--test-torques-from: it belongs to --test.")
    whole = _read(arguments, model, arguments.log, arguments.torques_from)
    other = None
    if arguments.test is not None:
        other = _read(arguments, model, arguments.test, arguments.test_torques_from)
    if arguments.delay is not None:
        if arguments.delay == "auto":
            delay = _estimated_delay(synchronisation(whole, model))
        else:
            delay = float(numbers(arguments.delay, 1, "--delay")[0])
        whole = with_delay(whole, delay)
        other = None if other is None else with_delay(other, delay)
    first, last = (0, len(whole))
    if arguments.rows is not None:
        first, last = _range(arguments.rows, len(whole), "--rows")
    if arguments.test_rows is not None:
        if arguments.rows is None:
            raise InvalidValueError("--test-rows: give the fitted rows by --rows.")
        start, stop = _range(arguments.test_rows, len(whole), "--test-rows")
        if max(first, start) < min(last, stop):
            raise InvalidValueError(
                f"--test-rows: rows {start} to {stop} are not held out where {first} to {last} "
                "are fitted; give rows that do not overlap."
            )
        other = whole.rows(start, stop)
    elif (share := arguments.test_share) is not None:
        if not 0.0 < share < 1.0:
            raise InvalidValueError(
                f"--test-share: expected a share between 0 and 1, got {share:g}."
            )
        middle = first + round((1.0 - share) * (last - first))
        other = whole.rows(middle, last)
        last = middle
    return whole.rows(first, last), other


def _range(rows: list[int], N: int, option: str) -> tuple[int, int]:
    """First row and the one after the last, from 0."""
    start, stop = (row + N if row < 0 else row for row in rows)
    if not 0 <= start < stop <= N:
        raise InvalidValueError(
            f"{option}: expected a first row and the one after the last within the {N} rows of the "
            f"log, got {rows[0]} {rows[1]}."
        )
    return start, stop


def _estimated_delay(estimate: Synchronisation) -> float:
    """Estimated delay, if it is determined."""
    from ...identification.delay import SynchronisationStatus

    if estimate.status is SynchronisationStatus.AT_THE_END:
        raise InvalidValueError(
            "--delay auto: the torques fit best at an end of the delays tried "
            f"({1e3 * estimate.delays[0]:.0f} to {1e3 * estimate.delays[-1]:.0f} ms); "
            "check whether positions and torques belong to the same motion, and give the delay "
            "in seconds."
        )
    if not estimate.status.is_success:
        raise InvalidValueError(
            f"--delay auto: {estimate.status.sentence} Give the delay in seconds, or leave it out."
        )
    return float(estimate.delay)


def _read(
    arguments: argparse.Namespace, model: RobotModel, files: list[str], torques: list[str] | None
) -> Log:
    from ...logs import read_log

    time: Any = arguments.time
    if time is not None:
        time = False if time == "none" else column(time)
    if arguments.motor_side and arguments.gears is not None:
        raise InvalidValueError("--motor-side and --gears: give one of them.")
    if arguments.motor_side and model.transmission is None:
        raise InvalidValueError(
            f"--motor-side: {model.name!r} has no transmission; give the ratios by --gears."
        )
    return read_log(
        files, torques_from=torques, positions=_columns(arguments.positions),
        torques=_columns(arguments.torques), velocities=_or_none(arguments.velocities),
        accelerations=_or_none(arguments.accelerations),
        position_references=_or_none(arguments.references), time=time, dt=arguments.dt,
        times=arguments.times, angles=arguments.angles, lengths=arguments.lengths,
        signs=joint_numbers(arguments.signs, model.n, "--signs"),
        gears=joint_numbers(arguments.gears, model.n, "--gears"),
        transmission=model.transmission if arguments.motor_side else None,
        drive_gains=joint_numbers(arguments.drive_gains, model.n, "--drive-gains"),
        offsets=joint_numbers(arguments.offsets, model.n, "--offsets"), model=model,
        delimiter=arguments.delimiter,
    )  # fmt: skip


def _columns(words: list[str] | None) -> list[int | str] | int | str | None:
    names = columns(words)
    # one word may be a pattern, or the name of a matrix
    return names[0] if names is not None and len(names) == 1 else names


def _or_none(words: list[str] | None) -> Any:
    return False if words == ["none"] else _columns(words)
