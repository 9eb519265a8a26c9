"""Choices for the fit from the options of ``robotmodels identify``."""

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

    from ...identification.methods.base import Method
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


def method_of_options(arguments: argparse.Namespace, model: RobotModel) -> Method:
    """The method of ``--method``; gains of ``--kp`` and ``--kd`` are for simulating methods."""
    from dataclasses import replace

    import numpy as np

    from ...identification import Controller, Ridge
    from ...identification.method_names import method_of

    method = method_of(arguments.method)
    if isinstance(method, Ridge) and method.prior is None:
        method = replace(method, prior=model)
    gains = [arguments.kp, arguments.kd]
    if gains == [None, None]:
        return method
    if None in gains:
        raise InvalidValueError("--kp, --kd: a controller has both gains; give the other as well.")
    if not hasattr(method, "controller"):
        raise InvalidValueError(
            f"--kp, --kd: the method {method.name!r} does not simulate the robot; they are for iv, "
            "didim and cloe."
        )
    kp, kd = (
        np.broadcast_to(np.asarray(joint_numbers(gain, model.n, "--kp, --kd")), (model.n,))
        for gain in gains
    )
    return replace(method, controller=Controller(kp, kd))


def workers(count: int) -> AbstractContextManager[Executor | None]:
    """Worker processes."""
    if not 1 <= count <= _MOST:
        raise InvalidValueError(f"--workers: expected 1 to {_MOST}, got {count}.")
    if count == 1:
        return nullcontext()
    from concurrent.futures import ProcessPoolExecutor

    return ProcessPoolExecutor(count)
