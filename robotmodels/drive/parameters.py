"""Drive parameters of the joints and their kinds: rotor inertia, friction and offset.

Book sections 1.5.1.4 (friction) and 1.5.1.5 (rotor inertia).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal, Self

import numpy as np

from .._arrays import LARGEST, Value, as_bounded, check_same_length, read_only
from .._choices import chosen
from ..errors import InertiaError, InvalidValueError
from ..table_text import joints_text


class DriveKind(Enum):
    """One kind of drive parameters; those of coupled motors belong to the kind that they couple."""

    IA = "Ia"
    FV = "Fv"
    FC = "Fc"
    OFFSET = "offset"

    @property
    def coupling(self) -> str | None:
        """Name of the coupling term of this kind; offsets have none."""
        return None if self is DriveKind.OFFSET else f"{self.value}m"


DriveWord = Literal["Ia", "Fv", "Fc", "offset"]
Drives = bool | DriveKind | DriveWord | Iterable[DriveKind | DriveWord]
"""All drive parameters, none, or those of some kinds."""


def drive_kinds(drive: Drives) -> tuple[DriveKind, ...]:
    """The requested kinds of drive parameters, in the order of the columns."""
    if isinstance(drive, (bool, np.bool_)):
        return tuple(DriveKind) if drive else ()
    if isinstance(drive, (DriveKind, str)):
        drive = (drive,)
    if not isinstance(drive, Iterable):
        raise InvalidValueError(
            "drive: expected True, False, or kinds of drive parameters such as ('Ia', 'Fv'), got "
            f"{drive!r:.60}."
        )
    requested = {chosen(DriveKind, kind, "drive") for kind in drive}
    return tuple(kind for kind in DriveKind if kind in requested)


def check_all_or_none(drive: object) -> bool:
    """Raise for kinds of drives where only True or False is supported."""
    if isinstance(drive, (bool, np.bool_)):
        return bool(drive)
    raise InvalidValueError(
        f"drive: expected True or False here, got {drive!r:.60}; kinds of drive parameters are for "
        "regressors and base parameters, and model.with_drive(...) removes single terms."
    )


@dataclass(frozen=True, slots=True, eq=False)
class DriveParameters(Value):
    """Drive parameters of each joint, on the joint side.

    ``tau_drive = Ia * a + Fv * v + Fc * sign(v) + offset``. Any real values are allowed.

    Parameters
    ----------
    Ia : array_like, shape (n,), optional
        Inertia of rotor and gears on the joint side (gear ratio squared times rotor inertia),
        kg m^2 or kg.
    Fv, Fc, offset : array_like, shape (n,), optional
        Viscous friction, N m s/rad or N s/m; Coulomb friction and constant torque or force, N m or
        N. Those left out are zero; give at least one.
    """

    Ia: Any = None
    Fv: Any = None
    Fc: Any = None
    offset: Any = None

    def __post_init__(self) -> None:
        given = {kind.value: getattr(self, kind.value) for kind in DriveKind}
        values = {name: as_bounded(v, name, LARGEST) for name, v in given.items() if v is not None}
        if not values:
            raise InertiaError("Give at least one of Ia, Fv, Fc, offset, each of shape (n,).")
        zero = np.zeros(check_same_length(values, "Drive"))
        for name in given:
            object.__setattr__(self, name, read_only(values.get(name, zero)))

    def __str__(self) -> str:
        return joints_text({kind.value: getattr(self, kind.value) for kind in DriveKind})

    @classmethod
    def zeros(cls, n: int) -> Self:
        """Drives of n joints without inertia, friction or offset."""
        return cls(Ia=np.zeros(n))

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.Ia.size

    @property
    def is_zero(self) -> bool:
        """Whether every parameter is zero."""
        return not (self.Ia.any() or self.Fv.any() or self.Fc.any() or self.offset.any())
