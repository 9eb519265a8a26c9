"""A singular factor, or the determinant, over two joint ranges: data for a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from operator import index
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Rebuilt, as_exact, as_vector, read_only
from ...errors import InvalidValueError, ShapeError, nearest_names
from ...geometry import PRISMATIC
from ...model import RobotModel, check_model

if TYPE_CHECKING:
    from ..singularity_kind import SingularityKind
    from .singularity_explanation import SingularityFactor


@dataclass(frozen=True, slots=True, eq=False)
class SingularityMap(Rebuilt):
    """Values of a singular factor or of the determinant over two joints; drawn by ``viz``.

    The robot is singular where the value is zero.

    Parameters
    ----------
    model_name : str
        Name of the robot.
    joints : ndarray of int, shape (2,)
        Columns of q, from 0, of the two joints.
    names : tuple of str, length 2
        Names of the two joints.
    first, second : ndarray, shapes (na,), (nb,)
        Their values, rad or m, ascending.
    values : ndarray, shape (na, nb)
        Entry [a, b] belongs to ``first[a]``, ``second[b]``.
    label : str
        What the values are, such as ``"elbow: C3"``.
    units : tuple of str, length 3
        Units of ``first``, ``second`` and ``values``, such as ``("rad", "rad", "m^2")``; ``"1"``
        where there is none.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> grid = singularity_map(load("rx90"), joints=(1, 2), samples=(5, 7))
    >>> grid.values.shape, grid.units
    ((5, 7), ('rad', 'rad', 'm^3'))
    """

    model_name: str
    joints: NDArray[np.int64]
    names: tuple[str, str]
    first: Array
    second: Array
    values: Array
    label: str
    units: tuple[str, str, str]

    def __repr__(self) -> str:
        names, units, size = self.names, self.units, self.values.shape
        unit = "" if units[2] == "1" else f" {units[2]}"
        text = "no values"
        if self.values.size:
            text = f"{self.values.min():.4g} to {self.values.max():.4g}{unit}"
        return (
            f"<SingularityMap of {self.model_name} over {names[0]} and {names[1]}, {size[0]} by "
            f"{size[1]}: {self.label:.60} from {text}>"
        )


def singularity_map(
    model: RobotModel,
    joints: Sequence[int | str],
    at: ArrayLike | None = None,
    samples: tuple[int, int] = (121, 121),
    factor: SingularityFactor | SingularityKind | None = None,
    ranges: ArrayLike | None = None,
) -> SingularityMap:
    """Values of a singular factor, or of the determinant, over the ranges of two joints.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    joints : pair of int or str
        Columns of q, from 0, or names of two different joints.
    at : array_like, shape (n,), optional
        Where the other joints stand, rad or m; default all zero.
    samples : pair of int, optional
        Numbers of values of each joint, at least 1.
    factor : SingularityFactor or SingularityKind, optional
        A factor of ``explain_singularities(model)``, or its kind if one factor has it; default
        the determinant of the square matrix that decides.
    ranges : array_like, shape (2, 2), optional
        Lower and upper value of each of the two joints, rad or m; default their limits, and
        from -pi to pi for a revolute joint without.

    Returns
    -------
    SingularityMap
        The two axes and the values.

    Raises
    ------
    ShapeError, InvalidValueError
        ``joints`` are not two different joints, ``at``, ``samples`` or ``ranges`` do not fit,
        a prismatic joint has no limits, several or no factors are of the kind, or the robot has
        no determinant (it is redundant, say): choose a factor.

    References
    ----------
    Seed book section 1.3.1.3.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> grid = singularity_map(load("rx90"), (2, 4), samples=(3, 3), ranges=[[-1, 1], [0, 3]])
    >>> grid.names, float(grid.values[1, 0])
    (('joint_3', 'joint_5'), 0.0)
    """
    from .explain_singularities import explain_singularities
    from .singularity_explanation import SingularityFactor

    check_model(model)
    columns = _columns(model, joints)
    q = np.zeros(model.n) if at is None else as_vector(at, model.n, "at")
    if q.ndim != 1:
        raise ShapeError(f"at: expected one configuration ({model.n},), got shape {q.shape}.")
    counts = _counts(samples)
    axes = [
        np.linspace(low, high, count)
        for (low, high), count in zip(_ranges(model, columns, ranges), counts, strict=True)
    ]
    grid = np.tile(q, (*counts, 1))
    grid[..., columns[0]] = axes[0][:, None]
    grid[..., columns[1]] = axes[1]
    if factor is None:
        _refuse_redundant(model)
        explanation = explain_singularities(model)
        values = explanation.determinant(grid)
        label, unit = "determinant", explanation.unit
    else:
        chosen = (
            factor
            if isinstance(factor, SingularityFactor)
            else explain_singularities(model).factor(factor)
        )
        values = chosen.values(grid)
        label, unit = f"{chosen.kind.value}: {chosen.text}", chosen.unit
    rows = model.table.joint_rows[columns]
    own = tuple("m" if model.table.sigma[row] == PRISMATIC else "rad" for row in rows)
    names = tuple(str(model.table.names[row]) for row in rows)
    return SingularityMap(
        model_name=model.name,
        joints=read_only(columns, np.int64),
        names=(names[0], names[1]),
        first=read_only(axes[0]),
        second=read_only(axes[1]),
        values=read_only(values),
        label=label,
        units=(own[0], own[1], unit),
    )


def _refuse_redundant(model: RobotModel) -> None:
    """More joints than six never make a square matrix: no formulas are needed to know."""
    count = int(np.isin(model.table.joint_rows + 1, model.twin.frame(None).path).sum())
    if count > 6:
        raise InvalidValueError(
            f"{model.name}: there is no determinant ({count} joints move the tool, the matrix is "
            "not square); pass one of explain_singularities(model).factors as factor."
        )


def _columns(model: RobotModel, joints: Sequence[int | str]) -> list[int]:
    names = [str(model.table.names[row]) for row in model.table.joint_rows]
    if (
        isinstance(joints, str)
        or not isinstance(joints, (Sequence, np.ndarray))
        or len(joints) != 2
    ):
        raise InvalidValueError(
            f"joints: expected two joints, columns of q or names, such as (1, 2), got {joints!r}."
        )
    columns = []
    for joint in joints:
        if isinstance(joint, str):
            if joint not in names:
                near = nearest_names(joint, names) or names
                raise InvalidValueError(
                    f"joints: no joint is called {joint!r}; there is {', '.join(near)}."
                )
            columns.append(names.index(joint))
            continue
        try:
            column = index(joint)
        except TypeError:
            raise InvalidValueError(
                f"joints: expected columns of q or names of joints, got {joint!r}."
            ) from None
        if isinstance(joint, (bool, np.bool_)) or not 0 <= column < model.n:
            raise InvalidValueError(
                f"joints: columns of q run from 0 to {model.n - 1}, got {joint!r}."
            )
        columns.append(column)
    if columns[0] == columns[1]:
        raise InvalidValueError(f"joints: expected two different joints, got {joints!r}.")
    return columns


def _counts(samples: tuple[int, int]) -> tuple[int, int]:
    try:
        first, second = (index(count) for count in samples)
    except (TypeError, ValueError):
        raise InvalidValueError(
            f"samples: expected two whole numbers such as (121, 121), got {samples!r}."
        ) from None
    if min(first, second) < 1:
        raise InvalidValueError(f"samples: expected at least one value a joint, got {samples!r}.")
    return first, second


def _ranges(
    model: RobotModel, columns: list[int], ranges: ArrayLike | None
) -> list[tuple[float, float]]:
    if ranges is not None:
        pairs = [(float(low), float(high)) for low, high in as_exact(ranges, (2, 2), "ranges")]
        for low, high in pairs:
            if low >= high:
                raise InvalidValueError(
                    f"ranges: expected the lower value first, got {low:g} and {high:g}."
                )
        return pairs
    found = []
    for column in columns:
        low, high = float(model.lower[column]), float(model.upper[column])
        row = model.table.joint_rows[column]
        if model.table.sigma[row] == PRISMATIC:
            if not np.isfinite([low, high]).all():
                raise InvalidValueError(
                    f"ranges: the prismatic joint {model.table.names[row]!r} has no limits; pass "
                    "the ranges of both joints, such as [[-3.1, 3.1], [0, 0.5]]."
                )
        elif not np.isfinite([low, high]).all():
            low, high = -pi, pi
        found.append((low, high))
    return found
