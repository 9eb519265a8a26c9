"""Dexterity over configurations and over a workspace: sections 3.6.1 to 3.6.4 of the book.

The indices: ``inverse_condition``, least over largest singular value; ``manipulability``, the
product of the singular values; ``least_singular_value``; ``isotropy``, geometric over arithmetic
mean of the eigenvalues of ``J J^T``. Linear rows next to angular ones are divided by ``length``.

Parameters
----------
arm : RobotModel
    The robot.
q : array_like, shape (..., n)
    Configurations, rad or m.
over : Workspace, optional
    Of the same arm; default its positions. Its limits and obstacles count.
index : {"inverse_condition", "manipulability", "least_singular_value", "isotropy"}
    Which index.
measure : {"workspace", "joints"}
    Mean over the area or volume that is reached, of the best posture; or over the joints.
mask : array_like, shape (6,), optional
    Components that count; default the task of the arm.
length : float, optional
    Metres that count as much as a radian; default the reach of the arm.

Raises
------
ShapeError, InvalidValueError
    ``q`` of the wrong length, a length that is not above zero, an unknown index, a workspace of
    another arm or one in which nothing is reached.

References
----------
Seed book sections 3.6.1 to 3.6.4; C. Gosselin and J. Angeles, "A global performance index for the
kinematic optimization of robotic manipulators", Journal of Mechanical Design 113 (1991).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_mask, as_vector, read_only
from ..errors import InvalidValueError
from ..kinematics import dgm, jacobian
from ..kinematics.lengths import length_of
from ..model import RobotModel, check_model
from .accessibility import postures_of, with_free
from .arms import Result, checked_word, free_predicate, section_arm, task_rows, turned_inside
from .cells import Space, measure_of_cells, samples
from .workspace import Workspace, workspace

INDICES = ("inverse_condition", "manipulability", "least_singular_value", "isotropy")
_AT_A_TIME = 16384
_SAMPLES = 200000


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DexterityMap(Result):
    """Index of dexterity at the cells of a workspace.

    Parameters
    ----------
    best, mean : ndarray, shape (N,)
        Of the best posture, and the mean over the postures; NaN outside.
    """

    best: Array
    mean: Array

    def __iter__(self) -> Iterator[Array]:
        """The best and the mean, to be unpacked."""
        return iter((self.best, self.mean))

    def __repr__(self) -> str:
        known = self.best[~np.isnan(self.best)]
        text = f"best {known.min():.4g} to {known.max():.4g}" if known.size else "none"
        return f"<DexterityMap of {self.best.size} cells, {known.size} reached: {text}>"


class GlobalIndex(float):
    """Mean of an index.

    Attributes
    ----------
    spread : float
        Standard deviation over the same measure.
    """

    __slots__ = ("_spread",)
    _spread: float

    def __new__(cls, value: float, spread: float = 0.0) -> GlobalIndex:
        """A mean with its spread."""
        self = super().__new__(cls, value)
        self._spread = float(spread)
        return self

    @property
    def spread(self) -> float:
        """Standard deviation over the same measure."""
        return self._spread

    def __getnewargs__(self) -> tuple[float, float]:  # type: ignore[override]
        return float(self), self.spread

    def __repr__(self) -> str:
        return f"{float(self):.6g} (spread {self.spread:.3g})"


def isotropy_index(
    arm: RobotModel,
    q: ArrayLike,
    mask: ArrayLike | str | None = None,
    length: float | None = None,
) -> Array:
    """Isotropy index: geometric over arithmetic mean of the eigenvalues of ``J J^T``.

    Returns
    -------
    ndarray, shape (...)
        1 where the tool moves equally well in all directions, 0 in singular positions.

    Examples
    --------
    The arm of two links is isotropic for ``l1 = sqrt(2) l2`` at ``q2 = 3 pi / 4``.

    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.se3 import translation
    >>> table = DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, np.sqrt(2.0)])
    >>> arm = RobotModel.from_table(table, tool=translation(1, 0, 0))
    >>> float(isotropy_index(arm, [0.3, 0.75 * np.pi]).round(9))
    1.0
    """
    check_model(arm)
    q = as_vector(q, arm.n, "q")
    rows = _rows_of(arm, mask)
    values = index_values(arm, q.reshape(prod(q.shape[:-1]), arm.n), "isotropy", rows, length)
    return values.reshape(q.shape[:-1])


def dexterity_map(
    arm: RobotModel,
    over: Workspace | None = None,
    index: str = "inverse_condition",
    mask: ArrayLike | str | None = None,
    length: float | None = None,
) -> DexterityMap:
    """Index of dexterity at the cells of a workspace.

    Returns
    -------
    DexterityMap
        ``best`` and ``mean`` over the postures of each cell, aligned with ``over.points``. Where
        infinitely many postures reach a cell, over 200 000 samples of the joints.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r")
    >>> w = workspace(arm, limits=False, resolution=20)
    >>> dexterity_map(arm, w, "manipulability").best.shape
    (400,)
    """
    check_model(arm)
    checked_word(index, INDICES, "index")
    w, rows = _over(arm, over), _rows_of(arm, mask)
    best, mean = np.full(len(w.points), np.nan), np.full(len(w.points), np.nan)
    if w.status >= 3:
        return DexterityMap(read_only(best), read_only(mean))
    if w.kind in ("positions", "free", "primary", "secondary") and section_arm(arm) is None:
        _by_samples(arm, w, index, rows, length, best, mean)
        return DexterityMap(read_only(best), read_only(mean))
    place = place_of(w)
    is_free = free_predicate(arm, w.free)
    inner = np.flatnonzero(w.count > 0)
    T = w.poses[inner]
    for k in range(0, len(inner), _AT_A_TIME):
        part = slice(k, k + _AT_A_TIME)
        q, valid, _ = postures_of(arm, T[part], place)
        q, inside = turned_inside(arm, q, w.limits)
        valid &= inside
        if is_free is not None:
            valid = with_free(valid, q, is_free)
        values = np.full(valid.shape, np.nan)
        values[valid] = index_values(arm, q[valid], index, rows, length)
        count = np.maximum(valid.sum(axis=1), 1)
        best[inner[part]] = np.where(valid, values, -np.inf).max(axis=1, initial=-np.inf)
        mean[inner[part]] = np.where(valid, values, 0.0).sum(axis=1) / count
    best[np.isinf(best)] = np.nan
    return DexterityMap(read_only(best), read_only(mean))


def global_index(
    arm: RobotModel,
    index: str = "inverse_condition",
    measure: str = "workspace",
    over: Workspace | None = None,
    mask: ArrayLike | str | None = None,
    length: float | None = None,
) -> GlobalIndex:
    """Mean of an index of dexterity over the workspace or over the joint ranges.

    The two differ: configurations in which the tool moves far fill more of the workspace.

    Returns
    -------
    GlobalIndex
        The mean, a float, with its ``spread``.

    Examples
    --------
    The mean of ``|sin q2|`` over the joints is 2 / pi.

    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r")
    >>> mean = global_index(arm, "manipulability", "joints", workspace(arm, limits=False))
    >>> round(mean, 3), round(mean.spread, 3)
    (0.637, 0.308)
    """
    check_model(arm)
    checked_word(index, INDICES, "index")
    checked_word(measure, ("workspace", "joints"), "measure")
    rows = _rows_of(arm, mask)
    if measure == "joints":
        limits = True if over is None else _over(arm, over).limits
        q = samples(arm, limits, _SAMPLES)
        is_free = None if over is None else free_predicate(arm, over.free)
        if is_free is not None:
            q = q[is_free(q)]
        values = index_values(arm, q, index, rows, length)
        weights = np.ones(len(values))
    else:
        w = _over(arm, over)
        values = dexterity_map(arm, w, index, mask, length).best
        area, volume = measure_of_cells(Space(w.coordinates, w.frame), w.points, w.size)
        weights = np.where(np.isnan(values), 0.0, area if w.coordinates == "plane" else volume)
        values = np.nan_to_num(values)
    total = float(weights.sum())
    if not total > 0.0:
        raise InvalidValueError(f"{arm.name}: nothing is reached, so that there is no mean.")
    mean = float(weights @ values) / total
    return GlobalIndex(mean, float(np.sqrt(max(weights @ (values - mean) ** 2 / total, 0.0))))


def index_values(
    arm: RobotModel, q: Array, index: str, rows: NDArray[np.bool_], length: float | None
) -> Array:
    """Index at configurations (N, n)."""
    from .kernels import gram_values

    if arm.n == 0:
        return np.zeros(len(q))  # nothing moves
    mixed = rows[:3].any() and rows[3:].any()
    metres = length_of(arm, None, length) if mixed or length is not None else 1.0
    weights = np.repeat((1.0 / metres if mixed else 1.0, 1.0), 3)[rows]
    out = np.empty(len(q))
    for k in range(0, len(q), _AT_A_TIME):
        part = slice(k, k + _AT_A_TIME)
        J = np.ascontiguousarray(jacobian(arm, q[part])[:, rows])
        small = min(J.shape[1:])
        if index in ("manipulability", "isotropy"):
            values = np.empty((len(J), 2))
            gram_values(J, weights, values)
            out[part] = np.sqrt(values[:, 0])
            if index == "isotropy" and J.shape[1] > J.shape[2]:
                out[part] = 0.0  # some direction of the task is not reached at all
            elif index == "isotropy":
                mean = values[:, 1] / small
                root = values[:, 0] ** (1.0 / small)
                out[part] = np.divide(root, mean, out=np.zeros(len(J)), where=mean > 0.0)
            continue
        s = np.linalg.svd(J * weights[:, None], compute_uv=False)
        out[part] = s[:, -1]
        if index == "inverse_condition":
            top = s[:, 0]
            out[part] = np.divide(s[:, -1], top, out=np.zeros(len(J)), where=top > 0.0)
    return out


def place_of(w: Workspace) -> NDArray[np.bool_] | None:
    """The mask with which the postures of cells are solved."""
    if w.kind != "orientation":
        return np.repeat((True, False), 3)
    return None if w.coordinates == "plane" else w.mask


def _rows_of(arm: RobotModel, mask: ArrayLike | str | None) -> NDArray[np.bool_]:
    return task_rows(arm) if mask is None else as_mask(mask)


def _over(arm: RobotModel, over: Any) -> Workspace:
    if over is None:
        return workspace(arm)
    if not isinstance(over, Workspace):
        raise InvalidValueError(f"over: expected a Workspace, got {type(over).__name__}.")
    if over.model is not arm and over.model != arm:
        raise InvalidValueError(
            f"over: expected a workspace of {arm.name}, got one of {over.model.name}."
        )
    return over


def _by_samples(
    arm: RobotModel, w: Workspace, index: str, rows: NDArray[np.bool_], length: float | None,
    best: Array, mean: Array,
) -> None:  # fmt: skip
    """Best and mean over samples of the joints that fall into each cell."""
    q = samples(arm, w.limits, _SAMPLES)
    is_free = free_predicate(arm, w.free)
    if is_free is not None:
        q = q[is_free(q)]
    p = Space(w.coordinates, w.frame).of_world(dgm(arm, q)[:, :3, 3])
    low = w.points[0] - 0.5 * w.size
    cell = np.floor((p - low) / w.size).astype(int)
    good = np.all((cell >= 0) & (cell < w.shape), axis=1)
    at = np.ravel_multi_index(tuple(cell[good].T), w.shape)
    values = index_values(arm, q[good], index, rows, length)
    count = np.bincount(at, minlength=len(best))
    hit = (count > 0) & (w.count > 0)
    top = np.full(len(best), -np.inf)
    np.maximum.at(top, at, values)
    best[hit] = top[hit]
    mean[hit] = (np.bincount(at, values, len(best)) / np.maximum(count, 1))[hit]
