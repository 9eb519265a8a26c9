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
    """The bodies of ``--prior``: of another robot, or uniform ones of a mass.

    Parameters
    ----------
    arguments : Namespace
        With ``prior``.
    model : RobotModel
        The robot that is identified.

    Returns
    -------
    InertialParameters or None
        None without the option.

    Raises
    ------
    RobotModelsError
        An unknown robot, or one with another number of links.
    """
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
    """The rule of ``--essential``: a ratio, a name, or none.

    Parameters
    ----------
    text : str or None
        What was given.

    Returns
    -------
    bool, float or str
        As `fit` takes it.

    Examples
    --------
    >>> essential("20"), essential("aic"), essential(None)
    (20.0, 'aic', False)
    """
    if text is None:
        return False
    try:
        return float(text)
    except ValueError:
        return text


def controller(arguments: argparse.Namespace, model: RobotModel) -> Controller | None:
    """The controller of ``--kp`` and ``--kd``.

    Parameters
    ----------
    arguments : Namespace
        With ``kp`` and ``kd``.
    model : RobotModel
        The robot.

    Returns
    -------
    Controller or None
        None without the options.

    Raises
    ------
    InvalidValueError
        One without the other, or no gains.
    """
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
    """Processes that share the work.

    Parameters
    ----------
    count : int
        How many.

    Returns
    -------
    context manager
        Of an executor, or of None for this process alone.

    Raises
    ------
    InvalidValueError
        None, or too many.

    Examples
    --------
    >>> with workers(1) as executor:
    ...     executor is None
    True
    """
    if not 1 <= count <= _MOST:
        raise InvalidValueError(f"--workers: expected 1 to {_MOST}, got {count}.")
    if count == 1:
        return nullcontext()
    from concurrent.futures import ProcessPoolExecutor

    return ProcessPoolExecutor(count)
