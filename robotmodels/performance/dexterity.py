"""Dexterity over configurations and over a workspace: sections 3.6.1 to 3.6.4 of the book.

Parameters
----------
arm, mask, executor, progress
    See `robotmodels.performance`; by default the components are those of the task of the arm.
q : array_like, shape (..., n)
    Configurations, rad or m.
length : float, optional
    Metres that count as much as a radian; default the reach of the arm. Linear rows beside angular
    ones are divided by it.
over : Workspace, optional
    Of the same arm; default its positions. Its limits and obstacles count.
index : {"inverse_condition", "manipulability", "least_singular_value", "isotropy"}
    Least over largest singular value; product of the singular values; the least one;
    `isotropy_index`.
measure : {"workspace", "joints"}
    Mean over the area or volume that is reached, of the best posture; or over the joints. The two
    differ: configurations in which the tool moves far fill more of the workspace.

Returns
-------
ndarray, DexterityMap or GlobalIndex
    Index (...); its ``best`` and ``mean`` (N,) over the postures of each cell, aligned with
    ``over.points``, NaN outside (where infinitely many postures reach a cell over samples of the
    joints); its mean, a float, with the standard deviation ``spread``.

References
----------
C. Gosselin, J. Angeles, Journal of Mechanical Design 113 (1991).

Examples
--------
>>> from robotmodels.robots import load
>>> arm = load("planar_2r")
>>> isotropy_index(arm, [[0.3, 0.0], [0.3, 1.57]]).round(2)
array([0.  , 0.67])
>>> w = workspace(arm, limits=False, resolution=20)
>>> dexterity_map(arm, w, "manipulability").best.shape
(400,)
>>> round(global_index(arm, "manipulability", "joints", w), 3)       # the mean of |sin q2|
0.637
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, Value, as_mask, as_vector
from .._arrays.tasks import Progress, Workers
from .._choices import as_instance, one_of
from ..errors import InvalidValueError
from ..kinematics import jacobian
from ..kinematics.lengths import length_of
from ..model import RobotModel, check_model
from .arms import Flags, JointSpace, task_rows
from .cells import SAMPLES
from .workspace import Workspace, postures_in, workspace

INDICES = ("inverse_condition", "manipulability", "least_singular_value", "isotropy")
_AT_A_TIME = 16384


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DexterityMap(Frozen, Value):
    """Index of dexterity at the cells of a workspace: ``best`` and ``mean`` (N,)."""

    best: Array
    mean: Array

    def __iter__(self) -> Iterator[Array]:
        """The best and the mean, to be unpacked."""
        return iter((self.best, self.mean))


class GlobalIndex(float):
    """Mean of an index, a float with its ``spread``."""

    __slots__ = ("spread",)
    spread: float

    def __new__(cls, value: float, spread: float = 0.0) -> GlobalIndex:
        """Keep the spread beside the mean."""
        self = super().__new__(cls, value)
        self.spread = float(spread)
        return self

    def __repr__(self) -> str:
        return f"{float(self):.6g} (spread {self.spread:.3g})"


def isotropy_index(
    arm: RobotModel, q: ArrayLike, mask: ArrayLike | str | None = None, length: float | None = None
) -> Array:
    """Isotropy index (section 3.6.3): geometric over arithmetic mean of eigenvalues of ``J J^T``.

    1 where the tool moves equally well in all directions, 0 in singular positions.
    """
    check_model(arm)
    q = as_vector(q, arm.n, "q")
    values = _index_of(arm, "isotropy", mask, length)(q.reshape(prod(q.shape[:-1]), arm.n))[0]
    return values.reshape(q.shape[:-1])


def dexterity_map(
    arm: RobotModel,
    over: Workspace | None = None,
    index: str = "inverse_condition",
    mask: ArrayLike | str | None = None,
    length: float | None = None,
    executor: Executor | None = None,
    progress: Progress = None,
) -> DexterityMap:
    """Index of dexterity at the cells of a workspace."""
    check_model(arm)
    one_of(index, INDICES, "index")
    w, work = workspace_of(arm, over), Workers(executor, progress)
    best, mean = np.full(len(w.points), np.nan), np.full(len(w.points), np.nan)
    index_of = _index_of(arm, index, mask, length)
    if (w.count > 0).any():
        cells, q = postures_in(w, work.part(0.0, 0.5))
        (values,) = work.part(0.5, 1.0).rows(index_of, _AT_A_TIME, q)
        total, count = (np.bincount(cells, x, len(best)) for x in (values, None))
        np.fmax.at(best, cells, values)
        mean[count > 0] = total[count > 0] / count[count > 0]
    return DexterityMap(best, mean)


def global_index(
    arm: RobotModel,
    index: str = "inverse_condition",
    measure: str = "workspace",
    over: Workspace | None = None,
    mask: ArrayLike | str | None = None,
    length: float | None = None,
    executor: Executor | None = None,
    progress: Progress = None,
) -> GlobalIndex:
    """Mean of an index of dexterity over the workspace or over the joint ranges."""
    check_model(arm)
    one_of(index, INDICES, "index")
    one_of(measure, ("workspace", "joints"), "measure")
    if measure == "joints":
        joints = JointSpace(arm, True) if over is None else workspace_of(arm, over).joints
        q, index_of = joints.samples(SAMPLES), _index_of(arm, index, mask, length)
        (values,) = Workers(executor, progress).rows(index_of, _AT_A_TIME, q)
        weights = np.ones(len(values))
    else:
        w = workspace_of(arm, over)
        values = dexterity_map(arm, w, index, mask, length, executor, progress).best
        area = w.cells.measures()[w.coordinates != "plane"]
        weights, values = np.where(np.isnan(values), 0.0, area), np.nan_to_num(values)
    total = float(weights.sum())
    if not total > 0.0:
        raise InvalidValueError(f"{arm.name}: nothing is reached, so that there is no mean.")
    mean = float(weights @ values) / total
    return GlobalIndex(mean, float(np.sqrt(max(weights @ (values - mean) ** 2 / total, 0.0))))


def _index_of(
    arm: RobotModel, index: str, mask: ArrayLike | str | None, length: float | None
) -> Callable[[Array], tuple[Array]]:
    """The index as a function of configurations (N, n)."""
    rows = task_rows(arm) if mask is None else as_mask(mask)
    mixed = bool(rows[:3].any() and rows[3:].any())
    metres = length_of(arm, None, length) if arm.n and (mixed or length is not None) else 1.0
    weights = np.repeat((1.0 / metres if mixed else 1.0, 1.0), 3)[rows]
    return partial(_index_values, arm, index, rows, weights)


def _index_values(
    arm: RobotModel, index: str, rows: Flags, weights: Array, q: Array
) -> tuple[Array]:
    out = np.zeros(len(q))
    for k in range(0, len(q) if arm.n else 0, _AT_A_TIME):
        part = slice(k, k + _AT_A_TIME)
        J = jacobian(arm, q[part])[:, rows] * weights[:, None]
        m, n = J.shape[1:]
        if index in ("manipulability", "isotropy"):
            wide = J if m <= n else np.swapaxes(J, 1, 2)
            square = np.linalg.det(J if m == n else wide @ np.swapaxes(wide, 1, 2))
            measure = np.abs(square) if m == n else np.sqrt(np.maximum(square, 0.0))
            if index == "isotropy":  # zero where some direction of the task is not reached at all
                mean = np.einsum("kij,kij->k", J, J) / m
                root = measure ** (2.0 / m) * (m <= n)
                measure = np.divide(root, mean, out=np.zeros(len(J)), where=mean > 0.0)
            out[part] = measure
        else:
            s = np.linalg.svd(J, compute_uv=False)
            top = s[:, 0] if index == "inverse_condition" else np.ones(len(s))
            out[part] = np.divide(s[:, -1], top, out=np.zeros(len(s)), where=top > 0.0)
    return (out,)


def workspace_of(arm: RobotModel, over: Any) -> Workspace:
    """The given workspace: that of the positions without one."""
    if over is None:
        return workspace(arm)
    over = as_instance(over, Workspace, "over")
    if over.model is not arm and over.model != arm:
        raise InvalidValueError(
            f"over: expected a workspace of {arm.name}, got one of {over.model.name}."
        )
    return over
