"""Joint space, task and section of an arm: shared by the analyses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from math import pi, tau
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, as_flag, as_mask
from ..errors import InvalidValueError, ShapeError
from ..geometry import REVOLUTE
from ..igm.loop import joint_chain
from ..igm.position import prepare_position, solved_positions
from ..kinematics import dgm, jacobian
from ..kinematics.lengths import characteristic_length, spread_configurations
from ..model import RobotModel, check_model
from ..obstacles import clearance
from ..obstacles.clearance import checked_obstacles

Flags = NDArray[np.bool_]
Ints = NDArray[np.int64]
T = TypeVar("T")
PLACE = np.repeat((True, False), 3)
_SLACK = 1e-9  # rad or m, of limits


def per_model(function: Callable[..., T]) -> Callable[..., T]:
    """Keep what a function of a model returns for as long as the model is in use."""
    known: WeakKeyDictionary[RobotModel, dict[Any, T]] = WeakKeyDictionary()

    @wraps(function)
    def kept(model: RobotModel, *given: Any) -> T:
        of_model = known.setdefault(model, {})
        if given not in of_model:
            of_model[given] = function(model, *given)
        return of_model[given]

    return kept


@dataclass(frozen=True, slots=True, eq=False)
class JointSpace:
    """Joint space of an arm: its limits if they count, and what is free of collisions."""

    model: RobotModel
    limits: bool
    free: Any = None

    def is_free(self, q: Array) -> Flags:
        """Which configurations (N, n) are free of collisions."""
        if not callable(self.free):
            return np.asarray(clearance(self.model, q, self.free) > 0.0)
        flags = np.asarray(self.free(q))
        if flags.shape != q.shape[:-1] or flags.dtype != np.bool_:
            raise ShapeError(
                f"free: expected a function of q (N, {self.model.n}) that returns bool (N,), got "
                f"{flags.dtype} {flags.shape} for q {q.shape}."
            )
        return flags

    def within(self, q: Array) -> tuple[Array, Flags]:
        """Configurations (..., n) turned by whole turns into the limits, and whether they fit."""
        if self.limits:
            return self.turned(q, q)[:2]
        return q, np.asarray(np.isfinite(q).all(axis=-1))

    def turned(self, low: Array, high: Array) -> tuple[Array, Flags, Array]:
        """Ranges (..., n) of motions by whole turns into the limits: low ends, fits, turns."""
        lower, upper = self.model.lower, self.model.upper
        with np.errstate(invalid="ignore"):
            least = np.ceil((lower - low - _SLACK) / tau)
            least = np.where(np.isfinite(lower), least, np.floor((upper - high + _SLACK) / tau))
            outside = turning(self.model) & np.isfinite(least) & ((low < lower) | (high > upper))
            turns = np.where(outside, tau * least, 0.0)
            fits = (low + turns >= lower - _SLACK) & (high + turns <= upper + _SLACK)
        return low + turns, np.asarray(fits.all(axis=-1)), turns

    def ranges(self, columns: ArrayLike | None = None) -> tuple[Array, Flags]:
        """Ranges (n, 2) of the joints, and which are whole circles (n,) that close in themselves.

        A prismatic joint among the columns (default those that move the tool) needs limits.
        """
        model, turns = self.model, turning(self.model)
        bounded = np.isfinite(model.lower) & np.isfinite(model.upper) & (self.limits | ~turns)
        requested = joint_chain(model).columns if columns is None else np.asarray(columns)
        slides = np.intersect1d(np.flatnonzero(~turns & ~bounded), requested)
        if slides.size:
            raise InvalidValueError(
                f"{model.name}: joint {slides[0] + 1} slides without limits, so that its range is "
                "infinite; give the table `lower` and `upper`."
            )
        low = np.where(bounded, model.lower, np.where(turns, -pi, -np.inf))
        high = np.where(bounded, model.upper, np.where(turns, pi, np.inf))
        return np.stack((low, high), axis=1), turns & ~bounded

    def samples(self, count: int) -> Array:
        """Free configurations (N, n), of ``count`` that fill the ranges; still joints at zero."""
        columns = joint_chain(self.model).columns
        low, high = self.ranges()[0][columns].T
        q = np.zeros((count, self.model.n))
        q[:, columns] = low + (high - low) * sequence(count, columns.size)
        return q if self.free is None else q[self.is_free(q)]


def joint_space(model: RobotModel, limits: Any = True, free: Any = None) -> JointSpace:
    """The joint space of an arm, checked; obstacles are kept as a tuple."""
    check_model(model)
    obstacles = free if free is None or callable(free) else checked_obstacles(free)
    return JointSpace(model, as_flag(limits, "limits"), obstacles)


def turning(model: RobotModel) -> Flags:
    """Which joints (n,) are revolute."""
    return np.asarray(model.table.sigma[model.table.joint_rows] == REVOLUTE)


def wrapped(x: Array, turns: Flags) -> Array:
    """Differences of joint positions, angles in [-pi, pi)."""
    return np.where(turns, (x + np.pi) % tau - np.pi, x)


@dataclass(frozen=True, slots=True, eq=False)
class SectionArm:
    """Three joints for a position as the kernels take them, ``frame`` from section to world.

    Of two joints in a plane the first is a virtual slide, column -1. Shapes: D (4, 4, 4).
    """

    kinds: Ints
    D: Array
    columns: Ints
    local: Array
    frame: Array
    size: float

    @property
    def radial(self) -> bool:
        """Whether the first coordinate is the distance from the first axis."""
        return bool(self.kinds[0] == 0)

    @property
    def turns(self) -> Flags:
        """Which of the last two joints are revolute."""
        return np.asarray(self.kinds[1:] == 0)

    def values(self, x: Array) -> Array:
        """Rows of `kernels.section_values`, coordinates as in ``frame``. Shapes: (N, 2), (N, 9)."""
        from .kernels import VALUES, section_values

        out = np.empty((len(x), VALUES))
        section_values(self.kinds, self.local, np.ascontiguousarray(x), out)
        return out

    def world(self, section: Array) -> Array:
        """World positions of points (N, 2) of the section."""
        return np.asarray(section @ self.frame[:3, :2].T + self.frame[:3, 3])

    def postures(self, positions: Array) -> tuple[Array, Flags, Flags]:
        """All postures of world positions (N, 3): q (N, 4, 3), valid, not singular (N, 4)."""
        q, _, marks = solved_positions(
            self.kinds, self.D, positions, np.zeros((len(positions), 3)), self.size, 1e-12,
            1e-9 * self.size,
        )  # fmt: skip
        valid = marks >= 0
        if self.columns[0] < 0:
            valid &= np.abs(q[..., 0]) <= 1e-7 * self.size
        return q, valid, valid & (marks == 0)

    def model_postures(self, model: RobotModel, q: Array) -> Array:
        """Postures (..., 3) in the columns of the model (..., n), other joints at zero."""
        out = np.zeros((*q.shape[:-1], model.n))
        for k, column in enumerate(self.columns):
            if column >= 0:
                out[..., column] = q[..., k]
        return out


@per_model
def section_arm(model: RobotModel) -> SectionArm | None:
    """The section of an arm whose position three joints, or two in a plane, determine."""
    chain = joint_chain(model)
    D, kinds, columns = model.base @ chain.D[0], chain.sigma, chain.columns
    rest = chain.D[1:]
    if chain.k == 2:
        normal = plane_normal(model)
        if normal is None:
            return None
        # a slide along the normal of the plane, before the first joint
        slide = np.eye(4)
        slide[:3, :3] = axes_along(normal)
        rest = np.array([se3.inverse(slide) @ D, *rest])
        D, kinds, columns = slide, np.array([1, *kinds]), np.array([-1, *columns])
        tip = dgm(model, np.zeros(model.n))[:3, 3]  # any position gives the height of the plane
        D[:3, 3] = normal * (normal @ tip)
        rest[0] = se3.inverse(D) @ model.base @ chain.D[0]
    elif chain.k != 3 or prepare_position(chain) is None:
        return None
    whole = np.array([D, *rest])
    own, frame = axis_frames(D, radial=bool(kinds[0] == 0))
    local = np.array([se3.inverse(own) @ D, *rest])
    size = float(np.linalg.norm(whole[1:, :3, 3], axis=1).sum()) or 1.0
    kinds, columns = np.asarray(kinds, np.int64), np.asarray(columns, np.int64)
    return SectionArm(kinds, whole, columns, local, frame, size)


def axis_frames(D: Array, radial: bool) -> tuple[Array, Array]:
    """Frame along the first axis, and its columns in the order of the section's coordinates.

    Radial: the distance from the axis, the height, the third; the origin on the axis.
    """
    own, origin = np.eye(4), D[:3, 3]
    R = own[:3, :3] = axes_along(D[:3, 2])
    height = R[:, 2] * (R[:, 2] @ origin)
    own[:3, 3] = origin - height if radial else height
    return own, own[:, [0, 2, 1, 3]] * (1.0, 1.0, -1.0, 1.0) if radial else own


def axes_along(axis: Array) -> Array:
    """Orthonormal columns e1, e2, e3 with e3 along an axis, its largest component positive."""
    e3 = axis * np.sign(axis[np.argmax(np.abs(axis))])
    first = np.eye(3)[0] if abs(e3[0]) < 0.9 else np.eye(3)[1]
    e1 = first - e3 * (e3 @ first)
    e1 /= np.linalg.norm(e1)
    return np.column_stack((e1, np.cross(e3, e1), e3))


def plane_normal(model: RobotModel) -> Array | None:
    """Normal of the plane in which all joints move the tool; None if there is none."""
    if joint_chain(model).k == 0:
        return None
    columns = np.concatenate(np.moveaxis(_some_jacobians(model, 16)[:, :3], -1, 1), axis=0)
    _, s, vectors = np.linalg.svd(columns)
    if s[1] <= 1e-9 * s[0] or s[2] > 1e-9 * s[0]:
        return None
    return np.asarray(vectors[2])


def _some_jacobians(model: RobotModel, count: int) -> Array:
    """Jacobians (count, 6, n) at random configurations, one by one: nothing is compiled."""
    spread = spread_configurations(model, count, np.random.default_rng(3))
    return np.array([jacobian(model, q) for q in spread])


def task_rows(model: RobotModel, mask: ArrayLike | str | None = None) -> Flags:
    """Components of the twist that the postures of an arm mean (6,): by the mask, or by its joints.

    Up to three joints the position if it has as many freedoms, else the rows that move at all if
    they are as many as the joints, else all six.
    """
    check_model(model)
    if mask is not None:
        return as_mask(mask)
    k = joint_chain(model).k
    J = _some_jacobians(model, 8)
    length = characteristic_length(model)
    moved = np.abs(J).max(axis=(0, 2), initial=0.0) > 1e-9 * np.repeat((length, 1.0), 3)
    position = np.linalg.matrix_rank(J[:, :3] / length, tol=1e-9).max(initial=0)
    if k <= 3 and position == k:
        return np.repeat((True, False), 3) & moved
    return moved if moved.sum() == k else np.ones(6, np.bool_)


def leaves_a_family(model: RobotModel, mask: Flags | None = None) -> bool:
    """Whether the requested rows (default all six) leave infinitely many postures."""
    k = joint_chain(model).k
    if k == 0:
        return False
    rows = as_mask(mask)
    weights = np.repeat((1.0 / characteristic_length(model), 1.0), 3)[rows]
    J = _some_jacobians(model, 8)
    rank = np.linalg.matrix_rank(J[:, rows] * weights[:, None], tol=1e-9) if rows.any() else 0
    return int(np.max(rank)) < k


def sequence(count: int, dimensions: int) -> Array:
    """Points (count, dimensions) that fill the unit cube evenly: additive recurrence."""
    g = 2.0
    for _ in range(60):
        g = (1.0 + g) ** (1.0 / (dimensions + 1))
    steps = g ** -np.arange(1.0, dimensions + 1)
    return np.asarray((0.5 + np.arange(1, count + 1)[:, None] * steps) % 1.0)
