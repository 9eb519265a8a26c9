"""A singular factor, or the determinant, over two joint ranges: data for a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, Value, as_count, as_exact
from ..errors import InvalidValueError
from ..geometry import PRISMATIC
from ..kinematics import SingularityKind
from ..kinematics.inverse.tasks import joint_columns
from ..model import RobotModel, check_model
from .factor import SingularityFactor
from .singularities import explain_singularities


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingularityMap(Frozen, Value):
    """Values of a singular factor or of the determinant over two joints; drawn by ``viz``.

    The robot is singular where the value is zero.

    Parameters
    ----------
    model_name : str
        Name of the robot.
    joints, names : ndarray of int, shape (2,), and tuple of str
        Columns of q, from 0, and names of the two joints.
    first, second : ndarray, shapes (na,), (nb,)
        Their values, rad or m, ascending.
    values : ndarray, shape (na, nb)
        Entry [a, b] belongs to ``first[a]``, ``second[b]``.
    label : str
        The quantity, such as ``"elbow: C3"``.
    units : tuple of str, length 3
        Of ``first``, ``second`` and ``values``: ``"rad"``, ``"m^2"``, ``"1"`` where there is none.
    """

    model_name: str
    joints: NDArray[np.int64]
    names: tuple[str, str]
    first: Array
    second: Array
    values: Array
    label: str
    units: tuple[str, str, str]


def singularity_map(
    model: RobotModel,
    joints: Sequence[int | str],
    at: ArrayLike | None = None,
    samples: tuple[int, int] = (121, 121),
    factor: SingularityFactor | SingularityKind | None = None,
    ranges: ArrayLike | None = None,
) -> SingularityMap:
    """Values of a singular factor, or of the determinant, over the ranges of two joints.

    Book section 1.3.1.3.

    Parameters
    ----------
    joints : pair of int or str
        Columns of q, from 0, or names of two different joints.
    at : array_like, shape (n,), optional
        Values of the other joints, rad or m; default all zero.
    samples : pair of int, optional
        Numbers of values of each joint, at least 1.
    factor : SingularityFactor or SingularityKind, optional
        A factor of ``explain_singularities(model)``, or its kind if one factor has it; default
        the determinant of the square matrix that decides.
    ranges : array_like, shape (2, 2), optional
        Lower and upper value of each of the two joints, rad or m; default their limits, and
        from -pi to pi for a revolute joint without.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> grid = singularity_map(load("rx90"), (2, 4), samples=(3, 3), ranges=[[-1, 1], [0, 3]])
    >>> grid.names, float(grid.values[1, 0])
    (('joint_3', 'joint_5'), 0.0)
    """
    check_model(model)
    if not isinstance(joints, (list, tuple, np.ndarray)) or len(joints) != 2:
        raise InvalidValueError(
            f"joints: expected two joints, columns of q or names, such as (1, 2), got {joints!r}."
        )
    columns = joint_columns(model, joints)
    q = np.zeros(model.n) if at is None else as_exact(at, (model.n,), "at")
    if np.shape(samples) != (2,):
        raise InvalidValueError(
            f"samples: expected two numbers, such as (121, 121), got {samples!r}."
        )
    counts = [as_count(count, "samples", 1) for count in samples]
    limits = _limits(model, columns) if ranges is None else as_exact(ranges, (2, 2), "ranges")
    if not (limits[:, 0] < limits[:, 1]).all():
        raise InvalidValueError(f"ranges: expected the lower value first, got {limits.tolist()}.")
    first, second = (np.linspace(limits[k, 0], limits[k, 1], counts[k]) for k in range(2))
    grid = np.tile(q, (*counts, 1))
    grid[..., columns[0]] = first[:, None]
    grid[..., columns[1]] = second
    if factor is None:
        explanation = explain_singularities(model)
        values, label, unit = explanation.determinant(grid), "determinant", explanation.unit
    else:
        if not isinstance(factor, SingularityFactor):
            factor = explain_singularities(model).factor(factor)
        values, unit = factor.values(grid), factor.unit
        label = f"{factor.kind.value}: {factor.text}"
    rows = model.table.joint_rows[columns]
    own = ["m" if model.table.sigma[row] == PRISMATIC else "rad" for row in rows]
    names = [str(model.table.names[row]) for row in rows]
    pair, units = (names[0], names[1]), (own[0], own[1], unit)
    return SingularityMap(model.name, np.array(columns), pair, first, second, values, label, units)


def _limits(model: RobotModel, columns: list[int]) -> Array:
    limits = np.stack([model.lower[columns], model.upper[columns]], axis=1)
    for k, row in enumerate(model.table.joint_rows[columns]):
        if np.isfinite(limits[k]).all():
            continue
        if model.table.sigma[row] == PRISMATIC:
            raise InvalidValueError(
                f"ranges: the prismatic joint {model.table.names[row]!r} has no limits; pass "
                "the ranges of both joints, such as [[-3.1, 3.1], [0, 0.5]]."
            )
        limits[k] = -np.pi, np.pi
    return limits
