"""Base parameters by standard or printed name, and a table of values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt, read_only
from ..errors import nearest_names
from ..geometry import PRISMATIC
from ..regressors.columns import plain_name
from ..table_text import boxed

_LINK_UNITS = {"M": "kg", "MX": "kg m", "MY": "kg m", "MZ": "kg m"}
_TURNING = {"Ia": "kg m^2", "Fv": "N m s/rad"}
_SLIDING = {"Ia": "kg", "Fv": "N s/m"}
_OF_CYLINDERS = {"Kc": "N/m", "Pc": "N"}


class KeptNames(dict[str, Any]):
    """Dictionary by parameter names that also accepts printed names (``ZZ1R``)."""

    def __missing__(self, name: object) -> Any:
        if isinstance(name, str) and (plain := plain_name(name, self)) in self:
            return self[plain]
        near = nearest_names(str(name), tuple(self))
        hint = f" Did you mean {', '.join(near)}?" if near else ""
        raise KeyError(f"No base parameter {name!r}.{hint} It may be regrouped or without effect.")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BaseValues(Rebuilt, Mapping[str, float]):
    """Values of base parameters by name; prints as a table. Read-only.

    Parameters
    ----------
    names : tuple of str
        Standard names of the b kept parameters.
    printed : tuple of str
        The same with an R where others are regrouped into them.
    numbers : ndarray, shape (b,)
        Values.
    units : tuple of str
        Units.

    Examples
    --------
    >>> table = BaseValues(("ZZ1",), ("ZZ1R",), [2.0], ("kg m^2",))
    >>> table["ZZ1"], len(table)
    (2.0, 1)
    """

    names: tuple[str, ...]
    printed: tuple[str, ...]
    numbers: Any
    units: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", read_only(self.numbers))

    def __getitem__(self, name: str) -> float:
        return KeptNames(zip(self.names, self.numbers.tolist(), strict=True))[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __str__(self) -> str:
        return boxed(
            [
                ("parameter", list(self.printed)),
                ("value", [f"{x:.6g}" for x in self.numbers.tolist()]),
                ("unit", list(self.units)),
            ]
        )

    def __repr__(self) -> str:
        return f"<BaseValues: {len(self)} base parameters>"


def base_values(
    names: tuple[str, ...], matrix: Array, sigma: NDArray[np.int64], values: Array
) -> BaseValues:
    """Base parameters with their values and units.

    Shapes: matrix (b, p), sigma (f,), values (b,).
    """
    several = (matrix != 0.0).sum(axis=1) > 1
    printed = (f"{n}R" if more else n for n, more in zip(names, several, strict=True))
    units = tuple(_unit(name, sigma) for name in names)
    return BaseValues(names, tuple(printed), values, units)


def _unit(name: str, sigma: NDArray[np.int64]) -> str:
    kind = name.rstrip("0123456789")
    frame = int(name[len(kind) :])
    if unit := (_LINK_UNITS | _OF_CYLINDERS).get(kind):
        return unit
    if kind.isupper():
        return "kg m^2"
    slides = int(sigma[frame - 1]) == PRISMATIC
    plain = kind[:2]  # Iam, Fvm and frictions by direction are of the same unit
    if plain in _TURNING:
        return (_SLIDING if slides else _TURNING)[plain]
    return "N" if slides else "N m"
