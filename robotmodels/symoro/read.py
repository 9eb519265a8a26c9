"""A SYMORO file as a robot."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from numpy.typing import ArrayLike

from ..errors import ParFileError, RobotModelsWarning
from ..geometry import FIXED, DHTable
from ..model import RobotModel
from .dynamics import check_rigid_fixed, dynamics, gravity_of, left_out
from .frames import base_pose, counts, geometry
from .numbers import Numbers, checked_values
from .statements import ParFile


def read_par(
    path: str | Path,
    values: Mapping[str, float] | None = None,
    gravity: ArrayLike | None = None,
) -> RobotModel:
    """Read a SYMORO ``.par`` file in the syntax of SYMORO+ or OpenSYMORO.

    The symbol in a joint's own column (theta if revolute, r if prismatic) is its variable,
    whatever its name; a constant added to it is the offset, so ``q`` is SYMORO's. All other symbols
    get numbers from ``values``. Dynamic parameters that are plain symbols (``XX1``,
    ``FV2``) and are not in ``values`` are 0; a warning and the model's ``notes`` list them.

    Parameters
    ----------
    path : str or Path
        The file. UTF-8 or Latin-1.
    values : mapping of str to float, optional
        Numbers for the file's symbols, e.g. ``{"D3": 0.45}``: metres, radians, SI.
    gravity : array_like, shape (3,), optional
        Acceleration in the world frame, m/s^2, instead of the file's. The file's ``G`` is the
        acceleration of gravity in frame 0: ``{0, 0, G3}`` with z0 upwards needs ``G3 = -9.81``.
        If it is symbolic along a vertical z0 and not in ``values``, it is 9.81 downwards.

    Returns
    -------
    RobotModel
        Named as the file says, else after the file; ``Z`` is its base, ``IA``, ``FV``, ``FS``
        are its ``Ia``, ``Fv``, ``Fc``. The tip is the last frame.

    Raises
    ------
    ParFileError, TableError, InvalidValueError
        Not a ``.par`` file; lists of the wrong length, symbols without a number, a variable with
        another sign or factor than +1; loops (see `robotmodels.loops.read_par`), floating or mobile
        bases, flexible joints; antecedents out of order; a value that is not a finite number.

    References
    ----------
    W. Khalil and D. Creusot, "SYMORO+: a system for the symbolic modelling of robots", Robotica
    15, 1997. Book section 1.2.1, Table 1.1.

    Examples
    --------
    >>> import tempfile
    >>> lists = "NL=1; NJ=1; ant={0}; sigma={0}; alpha={Pi/2}; d={D1}; theta={t1}; r={0}"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "arm.par"
    ...     _ = path.write_text(lists.replace(";", chr(10)))
    ...     read_par(path, values={"D1": 0.4}).table.d
    array([0.4])
    """
    return read_tree(path, values, gravity)[0]


def read_tree(
    path: str | Path,
    values: Mapping[str, float] | None,
    gravity: ArrayLike | None,
    loops: bool = False,
) -> tuple[RobotModel, list[tuple[int, int]]]:
    """Spanning tree of a file, and the two frames of each cut joint; see `read_par`."""
    if not isinstance(path, (str, Path)):
        raise ParFileError(f"path: expected a str or Path, got {type(path).__name__}.")
    file = ParFile(Path(path))
    numbers = Numbers(file, checked_values(values, file))
    links, joints, f = counts(file, loops)
    columns = geometry(file, numbers, joints, f)
    cuts = [(j + 1, joints + j - links + 1) for j in range(links, joints)]
    for first, _ in cuts:  # a closure replaces a cut revolute joint
        columns["sigma"][first - 1] = columns["sigma"][first - 1] or FIXED
    inertia, drive, silent = dynamics(file, numbers, links, columns["sigma"])
    base = base_pose(file, numbers)
    acceleration, gravity_notes = gravity_of(file, numbers, base, gravity)
    check_rigid_fixed(file, numbers)
    numbers.check_complete()
    table = DHTable(**columns)

    alarms = [f"{word!r} is not a keyword of SYMORO and is left out" for word in file.unknown]
    if silent:
        more = len(silent) - 6
        alarms.append(
            f"{', '.join(silent[:6])}{f' and {more} more' if more > 0 else ''} have no numbers "
            f"and are 0 (pass values={{{silent[0]!r}: ...}} for the dynamic models)"
        )
    if alarms:
        warnings.warn(f"{file.label}: {'; '.join(alarms)}.", RobotModelsWarning, stacklevel=3)
    notes = [f"{alarm[0].upper()}{alarm[1:]}." for alarm in alarms]
    notes += gravity_notes + left_out(file, numbers, columns["sigma"])
    model = RobotModel.from_table(
        table, inertia=inertia, drive=drive, base=base, gravity=acceleration, name=file.name
    )
    return replace(model, notes=tuple(notes)), cuts
