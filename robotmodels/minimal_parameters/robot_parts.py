"""From a vector of standard parameters back to inertia, drives, transmission and friction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._arrays import Array
from ..drive import DriveKind, DriveParameters, Transmission, drive_kinds
from ..inertia import InertialParameters
from ..regressors import parameter_vector
from .result import BaseParameters


class RobotParts(NamedTuple):
    """Parts of a robot described by a vector of standard parameters. Shapes: friction (k, n)."""

    inertia: InertialParameters
    drive: DriveParameters
    transmission: Transmission | None
    friction: Array | None


def robot_parts(base: BaseParameters, x: Array, drives: DriveParameters) -> RobotParts:
    """The robot of standard parameters. Shapes: x (p,)."""
    f, n = base.model.f, base.model.n
    transmission = base.model.transmission
    kinds = drive_kinds(base.drive)
    end = 10 * f + n * len(kinds)
    found = dict(zip((k.value for k in kinds), x[10 * f : end].reshape(-1, n), strict=True))
    rest = {kind.value: getattr(drives, kind.value) for kind in DriveKind}
    drives = DriveParameters(**{**rest, **found})
    if transmission is not None and transmission.coupled_motors:
        motors = np.array(transmission.coupled_motors) - 1
        terms = {
            k.coupling: getattr(transmission, k.coupling).copy() for k in DriveKind if k.coupling
        }
        for kind in kinds:
            if kind.coupling is not None:
                terms[kind.coupling][motors] = x[end : end + len(motors)]
                end += len(motors)
        transmission = Transmission(transmission.matrix, transmission.offset, **terms)
    friction = None if base.friction is None else x[end:].reshape(-1, n)
    inertia = InertialParameters(x[: 10 * f].reshape(f, 10))
    return RobotParts(inertia, drives, transmission, friction)


def standard_vector(
    base: BaseParameters, bodies: InertialParameters, drives: DriveParameters
) -> Array:
    """Standard parameters of the model with other bodies and drives. Shapes: -> (p,)."""
    robot = base.model.with_inertia(bodies).with_drive(drives)
    return parameter_vector(robot, base.drive, base.friction)
