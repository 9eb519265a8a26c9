"""Kinds of drive parameters, and which of them a caller means."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from typing import Literal

import numpy as np

from .._choices import chosen
from ..errors import InvalidValueError


class DriveKind(Enum):
    """One kind of drive parameters; those of coupled motors belong to the kind that they couple.

    Examples
    --------
    >>> DriveKind.IA.value, DriveKind.IA.coupling
    ('Ia', 'Iam')
    """

    IA = "Ia"
    FV = "Fv"
    FC = "Fc"
    OFFSET = "offset"

    @property
    def coupling(self) -> str | None:
        """Name of what couples motors in this kind; an offset couples nothing."""
        return None if self is DriveKind.OFFSET else f"{self.value}m"


DriveWord = Literal["Ia", "Fv", "Fc", "offset"]
Drives = bool | DriveKind | DriveWord | Iterable[DriveKind | DriveWord]
"""All drive parameters, none, or those of some kinds."""


def drive_kinds(drive: Drives) -> tuple[DriveKind, ...]:
    """Which kinds of drive parameters are meant.

    Parameters
    ----------
    drive : bool, DriveKind, str, or collection of these
        All kinds, none, or some, as members or in words: ``("Ia", "Fv", "Fc")``.

    Returns
    -------
    tuple of DriveKind
        In the order of the regressors' columns, each once.

    Raises
    ------
    InvalidValueError
        Something else.

    Examples
    --------
    >>> [kind.value for kind in drive_kinds(("Fc", "Ia"))]
    ['Ia', 'Fc']
    """
    if isinstance(drive, (bool, np.bool_)):
        return tuple(DriveKind) if drive else ()
    if isinstance(drive, (DriveKind, str)):
        drive = (drive,)
    if not isinstance(drive, Iterable):
        raise InvalidValueError(
            "drive: expected True, False, or kinds of drive parameters such as ('Ia', 'Fv'), got "
            f"{drive!r:.60}."
        )
    asked = {chosen(DriveKind, kind, "drive") for kind in drive}
    return tuple(kind for kind in DriveKind if kind in asked)


def check_all_or_none(drive: object) -> bool:
    """Refuse kinds of drives where all or none act: torques are those of the model's drives.

    Parameters
    ----------
    drive : bool
        What the caller passed.

    Returns
    -------
    bool
        The same.

    Raises
    ------
    InvalidValueError
        Something else.

    Examples
    --------
    >>> check_all_or_none(True)
    True
    """
    if isinstance(drive, (bool, np.bool_)):
        return bool(drive)
    raise InvalidValueError(
        f"drive: expected True or False here, got {drive!r:.60}; kinds of drive parameters are for "
        "regressors and base parameters, and model.with_drive(...) takes single terms away."
    )
