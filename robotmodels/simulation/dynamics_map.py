"""Mass matrix and gravity torques over a range of one or two joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, as_each, as_exact, as_floats
from ..dynamics import gravity_torque, mass_matrix
from ..errors import InvalidValueError
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model


@dataclass(frozen=True, slots=True, eq=False)
class DynamicsMap(Frozen):
    """Mass matrix and gravity torques over a grid of configurations. Read-only.

    Parameters
    ----------
    model, joints, q
        As for `dynamics_map`.
    ranges : tuple of ndarray, shapes (N1,) and (N2,)
        Values of the joints that vary, rad or m, ascending.
    mass, gravity : ndarray, shape (N1, n, n) or (N1, N2, n, n), (N1, n) or (N1, N2, n)
        Mass matrices; gravity torques, N m or N.
    """

    model: RobotModel
    joints: tuple[int, ...]
    ranges: tuple[Array, ...]
    q: Array
    mass: Array
    gravity: Array

    @property
    def coupling(self) -> Array:
        """Inertial coupling ``M_ij / sqrt(M_ii M_jj)``, from -1 to 1, shape (..., n, n).

        It does not depend on units; NaN where a joint moves no inertia.
        """
        diagonal = np.einsum("...ii->...i", self.mass)
        size = np.sqrt(np.where(diagonal > 0.0, diagonal, np.nan))
        return self.mass / (size[..., :, None] * size[..., None, :])


def dynamics_map(
    model: RobotModel,
    joints: int | Sequence[int],
    q: ArrayLike | None = None,
    ranges: ArrayLike | None = None,
    samples: int | Sequence[int] | None = None,
    drive: bool = True,
) -> DynamicsMap:
    """Mass matrix and gravity torques over a range of one or two joints (book section 1.5.1.3).

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    joints : int or sequence of two ints
        Columns of q, from 0.
    q : array_like, shape (n,), optional
        Values of the other joints, rad or m; default zero.
    ranges : array_like, shape (2,) or (2, 2), optional
        Ends of each joint's range; default its limits, or a whole turn (a metre) without them.
    samples : int or sequence of ints, optional
        Values of each joint, at least 2; default 181 of one joint, 61 each of two.
    drive : bool
        Whether rotor inertia is included.

    Returns
    -------
    DynamicsMap
        Grid of values.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> dynamics_map(load("rx90"), (1, 2), samples=(3, 4)).mass.shape
    (3, 4, 6, 6)
    """
    check_model(model)
    n, columns = model.n, np.atleast_1d(np.asarray(joints))
    k = columns.size
    numbers = columns.dtype.kind in "iu" and columns.shape in ((1,), (2,))
    if not numbers or len({*columns.tolist()} & {*range(n)}) < k:
        raise InvalidValueError(
            f"joints: expected one or two different joints, numbers from 0 to {n - 1}, got "
            f"{joints!r:.60}."
        )
    base = np.zeros(n) if q is None else as_exact(q, (n,), "q")
    if ranges is None:
        limits = np.stack([model.lower, model.upper], axis=1)
        slide = model.table.sigma[model.table.joint_rows] == PRISMATIC
        whole = np.where(slide[:, None], [0.0, 1.0], [-np.pi, np.pi])
        known = np.isfinite(limits).all(axis=1) & (model.lower < model.upper)
        ends = np.where(known[:, None], limits, whole)[columns]
    else:
        given = as_floats(ranges, "ranges")
        ends = as_exact(given[None] if k == given.ndim == 1 else given, (k, 2), "ranges")
    if (ends[:, 0] >= ends[:, 1]).any():
        raise InvalidValueError(f"ranges: expected ascending ends, got {ends.tolist()}.")
    counts = as_each(samples, k, "samples", least=2.0, finite=True, default=181 if k == 1 else 61)
    sizes = counts.astype(int).tolist()
    if sizes != counts.tolist():
        raise InvalidValueError(f"samples: expected whole numbers, got {counts.tolist()}.")
    values = [np.linspace(a, b, size) for (a, b), size in zip(ends, sizes, strict=True)]
    grid = np.broadcast_to(base, (*sizes, n)).copy()
    for j, column in zip(columns, np.meshgrid(*values, indexing="ij"), strict=True):
        grid[..., j] = column
    mass, gravity = mass_matrix(model, grid, drive), gravity_torque(model, grid)
    return DynamicsMap(model, tuple(columns.tolist()), tuple(values), base, mass, gravity)
