"""Inertia, drives and gravity, and notes on entries of a file that a model cannot hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..drive import DriveParameters
from ..errors import ParFileError
from ..geometry import FIXED
from ..inertia import InertialParameters
from ..model import GRAVITY
from .keywords import BASE_MOTION, DRIVES, DYNAMICS, STANDARD_NAME, WRENCHES
from .numbers import Numbers
from .statements import ParFile


def dynamics(
    file: ParFile, numbers: Numbers, links: int, sigma: list[int]
) -> tuple[InertialParameters, DriveParameters, list[str]]:
    """Inertia of all frames, drives of all joints, and the names that have no number."""
    parameters = np.zeros((len(sigma), len(DYNAMICS)))
    silent: dict[str, None] = {}
    for column, key in enumerate(DYNAMICS):
        for j, entry in enumerate(file.entries(key, links, f"NL = {links} links")):
            if key in DRIVES and sigma[j] == FIXED:
                continue
            own = [s for s in numbers.free(entry) if STANDARD_NAME.fullmatch(s)]
            parameters[j, column] = numbers.number(entry, zero=own)
            silent |= dict.fromkeys(own)
    moving = np.array(sigma) != FIXED
    Ia, Fv, Fc = parameters[moving, -3:].T
    return InertialParameters(parameters[:, :-3]), DriveParameters(Ia=Ia, Fv=Fv, Fc=Fc), [*silent]


def gravity_of(
    file: ParFile, numbers: Numbers, base: Array, gravity: ArrayLike | None
) -> tuple[ArrayLike, list[str]]:
    """Gravity in the world frame, and a note where the file has no numbers for it."""
    entries = file.entries("G", 3, "x, y and z in frame 0")
    if gravity is not None:
        return gravity, []
    if entries and not any(numbers.free(entry) for entry in entries):
        return base[:3, :3] @ [numbers.number(entry) for entry in entries], []
    written = f"symbolic in the file, G = {{{', '.join(e.text for e in entries)}}}"
    return GRAVITY, [
        f"Gravity is {written if entries else 'not in the file'}; it is 9.81 m/s^2 downwards."
    ]


def check_rigid_fixed(file: ParFile, numbers: Numbers) -> None:
    """Refuse a base that moves and joints that are flexible."""
    for keyword in BASE_MOTION:
        for entry in file.entries(keyword, 3, "x, y and z"):
            if numbers.free(entry) or numbers.number(entry):
                raise ParFileError(
                    f"{entry.place}: the base moves ({entry.text}), which is not supported yet; "
                    "write 0."
                )
    for entry in file.all_entries("eta"):
        if numbers.number(entry):
            raise ParFileError(
                f"{entry.place}: flexible joints are not supported yet; write 0 to read the robot "
                "as rigid."
            )


def left_out(file: ParFile, numbers: Numbers, sigma: list[int]) -> list[str]:
    """Sentences about numbers that have no place in a model: drives of fixed frames, wrenches."""
    return [
        f"{key}{j + 1} = {entry.text} is left out: "
        + ("wrenches are arguments of the dynamic models." if key in WRENCHES
           else f"frame {j + 1} is fixed and has no drive.")
        for key in (*DRIVES, *WRENCHES)
        for j, entry in enumerate(file.all_entries(key))
        if not numbers.free(entry) and numbers.number(entry)
        and (key in WRENCHES or sigma[j] == FIXED)
    ]  # fmt: skip
