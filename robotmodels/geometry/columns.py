"""Columns of a table, checked: whole numbers, a tree of antecedents, limits that leave a range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_floats, as_reals
from ..errors import InvalidValueError, ShapeError, TableError
from .joint_kinds import FIXED, PRISMATIC, REVOLUTE

ANGLES = ("gamma", "beta", "alpha", "theta")
LENGTHS = ("b", "d", "r")
LIMITS = ("lower", "upper", "velocity", "effort")
_LARGEST = 2**31


def whole_numbers(value: ArrayLike, name: str, size: int | None = None) -> NDArray[np.int64]:
    """A column of whole numbers, one for each row."""
    array = as_floats(value, name)
    if array.ndim != 1 or (size is not None and array.size != size):
        wanted = "one number per row" if size is None else f"{size} numbers"
        raise ShapeError(f"{name}: expected {wanted}, got an array of shape {array.shape}.")
    if (array != np.round(array)).any() or (np.abs(array) > _LARGEST).any():
        raise TableError(f"{name}: expected whole numbers, got {array.tolist()}.")
    return array.astype(np.int64)


def check_structure(antecedent: NDArray[np.int64], sigma: NDArray[np.int64]) -> None:
    """Refuse antecedents that do not come first, and joints of no known kind."""
    for j, (a, s) in enumerate(zip(antecedent.tolist(), sigma.tolist(), strict=True), start=1):
        if not 0 <= a < j:
            raise TableError(
                f"Row {j} stands on frame {a}: an antecedent must be 0 (the base) or the number "
                f"of an earlier row, at most {j - 1}. A loop of antecedents has no base; number "
                "the frames from the base outwards."
            )
        if s not in (REVOLUTE, PRISMATIC, FIXED):
            raise TableError(
                f"Row {j}: sigma is 0 (revolute), 1 (prismatic) or 2 (fixed frame), got {s}."
            )


def checked_limits(given: Mapping[str, Any], n: int) -> dict[str, Array]:
    """Limits of the n moving joints; those that were left out are infinite."""
    limits = {}
    for key, default in (("lower", -np.inf), ("upper", np.inf), ("velocity", np.inf),
                         ("effort", np.inf)):  # fmt: skip
        value = given[key]
        array = np.full(n, default) if value is None else as_reals(value, key)
        if array.shape != (n,):
            raise ShapeError(
                f"{key}: expected one value for each of the {n} moving joints, shape ({n},), "
                f"got {array.shape}."
            )
        if np.isnan(array).any():
            raise InvalidValueError(f"{key}: NaN; leave the limit out or use infinity.")
        limits[key] = array
    if (limits["lower"] == np.inf).any() or (limits["upper"] == -np.inf).any():
        raise TableError(
            "a lower limit of +infinity, or an upper one of -infinity, leaves no range."
        )
    wrong = np.flatnonzero(~(limits["lower"] <= limits["upper"]))
    if wrong.size:
        i = int(wrong[0])
        raise TableError(
            f"Joint {i + 1}: the lower limit {limits['lower'][i]} is above the upper limit "
            f"{limits['upper'][i]}; exchange them."
        )
    for key in ("velocity", "effort"):
        if (limits[key] < 0).any():
            raise TableError(f"{key}: limits are magnitudes, got {limits[key].tolist()}.")
    return limits
