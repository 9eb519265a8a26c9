"""Mass matrix and gravity torques over a range of one or two joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from operator import index
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_vector, read_only
from ..dynamics import gravity_torque, mass_matrix
from ..errors import InvalidValueError, ShapeError
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model


@dataclass(frozen=True, slots=True, eq=False)
class DynamicsMap:
    """Mass matrix and gravity torques over a grid of configurations; drawn by ``viz``.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    joints : tuple of int, length 1 or 2
        Columns of q, from 0, that vary.
    ranges : tuple of ndarray, shapes (N1,) and (N2,)
        Their values, rad or m, ascending.
    q : ndarray, shape (n,)
        Values of the others.
    mass : ndarray, shape (N1, n, n) or (N1, N2, n, n)
        Mass matrices.
    gravity : ndarray, shape (N1, n) or (N1, N2, n)
        Gravity torques, N m or N.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> dynamics_map(load("planar_2r"), 1, samples=5).mass.shape
    (5, 2, 2)
    """

    model: RobotModel
    joints: tuple[int, ...]
    ranges: tuple[Array, ...]
    q: Array
    mass: Array
    gravity: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "ranges", tuple(read_only(values) for values in self.ranges))
        for name in ("q", "mass", "gravity"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def coupling(self) -> Array:
        """How strongly joints move each other, from -1 to 1, shape (..., n, n).

        ``M_ij / sqrt(M_ii M_jj)``, which does not depend on units: 0 where the acceleration of one
        joint takes no torque of the other, NaN where a joint moves no inertia.
        """
        diagonal = np.einsum("...ii->...i", self.mass)
        size = np.sqrt(np.where(diagonal > 0.0, diagonal, np.nan))
        return self.mass / (size[..., :, None] * size[..., None, :])

    def __reduce__(self) -> tuple[Any, ...]:  # rebuilt, so that a copy is read-only as well
        return type(self), tuple(getattr(self, field.name) for field in fields(self))


def dynamics_map(
    model: RobotModel,
    joints: int | Sequence[int],
    q: ArrayLike | None = None,
    ranges: ArrayLike | None = None,
    samples: int | Sequence[int] | None = None,
    drive: bool = True,
) -> DynamicsMap:
    """Mass matrix and gravity torques while one or two joints go through a range.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    joints : int or sequence of two ints
        Columns of q, from 0.
    q : array_like, shape (n,), optional
        Values of the other joints, rad or m; default zero.
    ranges : array_like, shape (2,) or (2, 2), optional
        Lower and upper end of each joint's range; default its limits, or a whole turn (a metre of
        a prismatic joint) where it has none.
    samples : int or sequence of ints, optional
        Values of each joint, at least 2; default 181 of one joint, 61 each of two.
    drive : bool
        Whether rotor inertia is included.

    Returns
    -------
    DynamicsMap
        Grid of values.

    Raises
    ------
    InvalidValueError, ShapeError
        No such joints, the same twice, or more than two; ranges that do not ascend.

    References
    ----------
    Seed book section 1.5.1.3.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> grid = dynamics_map(load("rx90"), (1, 2), samples=(3, 4))
    >>> grid.mass.shape, grid.gravity.shape
    ((3, 4, 6, 6), (3, 4, 6))
    """
    check_model(model)
    chosen = _joints(joints, model.n)
    k = len(chosen)
    base = np.zeros(model.n) if q is None else as_exact(q, (model.n,), "q")
    if ranges is None:
        ends = np.array([_range(model, j) for j in chosen])
    else:
        ends = as_vector(ranges, 2, "ranges")
        if ends.shape not in ((k, 2), (2,) if k == 1 else (k, 2)):
            raise ShapeError(f"ranges: expected shape ({k}, 2), got {ends.shape}.")
        ends = ends.reshape(k, 2)
    if (ends[:, 0] >= ends[:, 1]).any():
        raise InvalidValueError(f"ranges: expected ascending ends, got {ends.tolist()}.")
    counts = _samples(samples, k)
    values = [np.linspace(a, b, count) for (a, b), count in zip(ends, counts, strict=True)]
    grid = np.empty((*counts, model.n))
    grid[:] = base
    for j, column in zip(chosen, np.meshgrid(*values, indexing="ij"), strict=True):
        grid[..., j] = column
    return DynamicsMap(
        model, chosen, tuple(values), base, mass_matrix(model, grid, drive),
        gravity_torque(model, grid),
    )  # fmt: skip


def _joints(joints: Any, n: int) -> tuple[int, ...]:
    try:
        given = [joints] if np.ndim(joints) == 0 else list(joints)
        chosen = tuple(index(j) for j in given)
    except TypeError:
        chosen = ()
    if not 1 <= len(chosen) <= 2 or len(set(chosen)) < len(chosen):
        raise InvalidValueError(
            f"joints: expected one or two different joints, got {joints!r:.60}."
        )
    if min(chosen) < 0 or max(chosen) >= n:
        raise InvalidValueError(f"joints: expected numbers from 0 to {n - 1}, got {joints!r:.60}.")
    return chosen


def _range(model: RobotModel, j: int) -> tuple[float, float]:
    lower, upper = float(model.lower[j]), float(model.upper[j])
    if np.isfinite(lower) and np.isfinite(upper) and lower < upper:
        return lower, upper
    prismatic = model.table.sigma[model.table.joint_rows[j]] == PRISMATIC
    return (0.0, 1.0) if prismatic else (-np.pi, np.pi)


def _samples(samples: Any, k: int) -> tuple[int, ...]:
    given: Any = (181 if k == 1 else 61) if samples is None else samples
    try:
        counts = tuple(index(x) for x in ([given] * k if np.ndim(given) == 0 else given))
    except TypeError:
        counts = ()
    if len(counts) != k or min(counts) < 2:
        many = "a whole number" if k == 1 else f"{k} whole numbers"
        raise InvalidValueError(f"samples: expected {many} from 2, got {samples!r:.60}.")
    return counts
