"""Inertia, drives and gravity, and what of a file has no place in a model."""

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
    """Gravity in the world frame, and sentences about where it comes from."""
    entries = file.entries("G", 3, "x, y and z in frame 0")
    if gravity is not None:
        return gravity, []
    if not entries:
        return GRAVITY, ["Gravity is not in the file; it is 9.81 m/s^2 downwards."]
    free = [bool(numbers.free(entry)) for entry in entries]
    if not any(free):
        return base[:3, :3] @ [numbers.number(entry) for entry in entries], []
    sideways = [not free[i] and numbers.number(entries[i]) != 0.0 for i in (0, 1)]
    upright = np.allclose(base[:3, 2], (0.0, 0.0, 1.0), atol=1e-12)
    if not free[2] or any(sideways) or not upright:
        for entry in entries:
            numbers.number(entry)
        return GRAVITY, []
    written = ", ".join(entry.text for entry in entries)
    return GRAVITY, [
        f"Gravity is symbolic in the file, G = {{{written}}}; it is 9.81 m/s^2 downwards."
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
    """Sentences about numbers that have no place in a model."""
    notes = []
    for key in DRIVES:
        for j, entry in enumerate(file.all_entries(key)):
            if sigma[j] == FIXED and not numbers.free(entry) and numbers.number(entry):
                notes.append(
                    f"{key}{j + 1} = {entry.text} is left out: frame {j + 1} is fixed and has no "
                    "drive."
                )
    loads = [
        key
        for key in WRENCHES
        if any(not numbers.free(e) and numbers.number(e) for e in file.all_entries(key))
    ]
    if loads:
        notes.append(
            f"The external wrenches {', '.join(loads)} are left out: they are arguments of the "
            "dynamic models."
        )
    return notes


def listed_parameters(names: list[str], links: int) -> str:
    """Names in short: a parameter that is missing for every link only once."""
    by_key: dict[str, list[str]] = {}
    for name in names:
        found = STANDARD_NAME.fullmatch(name)
        by_key.setdefault(found[1] if found else name, []).append(name)
    whole = [key for key, members in by_key.items() if len(members) >= links > 1]
    single = [name for key, members in by_key.items() if key not in whole for name in members]
    parts = [f"{' '.join(whole)} of all links"] if whole else []
    return " and ".join([*parts, ", ".join(single)] if single else parts)
