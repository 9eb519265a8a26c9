"""What the options of ``robotmodels identify`` choose for the fit."""

from __future__ import annotations

import argparse
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

from ...errors import InvalidValueError
from ...model import RobotModel
from ..numbers import joint_numbers
from ..source import robot_of

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from ...identification import Controller
    from ...inertia import InertialParameters

_MOST = 64


def prior(arguments: argparse.Namespace, model: RobotModel) -> InertialParameters | None:
    """Prior inertial parameters of ``--prior``: another robot's, or uniform bodies."""
    if arguments.prior is None:
        return None
    from ...minimal_parameters import uniform_bodies

    try:
        mass = float(arguments.prior)
    except ValueError:
        source = argparse.Namespace(**(vars(arguments) | {"robot": arguments.prior}))
        bodies = robot_of(source).inertia
        if bodies.f != model.f:
            raise InvalidValueError(
                f"--prior: {arguments.prior!r} has {bodies.f} links, the robot {model.f}."
            ) from None
        return bodies
    return uniform_bodies(model, mass)


def essential(text: str | None) -> bool | float | str:
    """The rule of ``--essential``: a ratio, a name, or none."""
    if text is None:
        return False
    try:
        return float(text)
    except ValueError:
        return text


def controller(arguments: argparse.Namespace, model: RobotModel) -> Controller | None:
    """The controller of ``--kp`` and ``--kd``."""
    if arguments.kp is None and arguments.kd is None:
        return None
    if arguments.kp is None or arguments.kd is None:
        raise InvalidValueError("--kp, --kd: a controller has both gains; give the other as well.")
    from ...identification import Controller

    kp, kd = (
        joint_numbers(getattr(arguments, name), model.n, f"--{name}") for name in ("kp", "kd")
    )
    return Controller(kp, kd)  # type: ignore[arg-type]  # both were given


def workers(count: int) -> AbstractContextManager[Executor | None]:
    """Processes that share the work."""
    if not 1 <= count <= _MOST:
        raise InvalidValueError(f"--workers: expected 1 to {_MOST}, got {count}.")
    if count == 1:
        return nullcontext()
    from concurrent.futures import ProcessPoolExecutor

    return ProcessPoolExecutor(count)
