"""Criteria for the freedom of a redundant robot: a value, and joint velocities that improve it.

Book section 1.3.2.4; A. Liegeois 1977, A. Fournier 1980, T. Yoshikawa 1985, O. Khatib 1986,
A. A. Maciejewski and C. A. Klein 1985. `ikm` takes a criterion as ``secondary``: its gradient is
the z of ``v = J^+ x + (I - J^+ J) z``.

Parameters
----------
gain : float
    Positive factor of the gradient.
lower, upper : array_like, shape (n,) or (), optional
    Limits, rad or m; default the robot's. A joint with an infinite limit, or with no range, does
    not count.

Examples
--------
>>> from robotmodels.obstacles import Sphere
>>> from robotmodels.robots import load
>>> arm, q = load("planar_2r"), [0.0, 0.0]
>>> criterion = ObstacleCriterion([Sphere([0.5, 0.3, 0.0], 0.1)], influence=0.4)
>>> criterion.clearance(arm, q), criterion.gradient(arm, q).round(6) + 0.0
(array(0.2), array([-0.625,  0.   ]))
>>> PostureCriterion([0.0, 1.0], gain=2.0).gradient(arm, [0.5, 1.0]) + 0.0
array([-1.,  0.])
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import (
    Array,
    Rebuilt,
    as_exact,
    as_floats,
    as_mask,
    as_number,
    as_vector,
    read_only,
)
from ...errors import InvalidValueError, ShapeError
from ...model import RobotModel, check_model
from ...obstacles import Plane, clearance
from ...obstacles.clearance import (
    Segment,
    checked_obstacles,
    checked_segments,
    link_distances,
    links,
)
from ...obstacles.shapes import Obstacle
from ..jacobians import COMPONENTS, Reference, jacobian, jacobian_rate, reference_of
from .bounds import as_limit, check_order, for_joints

_CHUNK = 512
"""Configurations at a time: each takes n Jacobians."""


@runtime_checkable
class Criterion(Protocol):
    """Anything with a value and a gradient."""

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Value at each configuration: q (..., n) -> (...)."""
        ...

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Joint velocities that improve the value, rad/s or m/s: q (..., n) -> (..., n)."""
        ...


class _Squares(Rebuilt, ABC):
    """Weighted sum of squares of depths h (..., p) with slopes ``dh/dq`` (..., p, n)."""

    __slots__ = ()
    gain: float

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Weighted sum of the squared depths (...)."""
        h, _ = self._checked(model, q)
        return np.asarray((self._factor() * h**2).sum(axis=-1))

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Velocities (..., n) that make the depths smaller, rad/s or m/s."""
        h, slope = self._checked(model, q)
        return -2.0 * self.gain * ((self._factor() * h)[..., None, :] @ slope)[..., 0, :]

    def _factor(self) -> Array | float:
        return 0.5

    def _checked(self, model: RobotModel, q: ArrayLike) -> tuple[Array, Array]:
        check_model(model)
        return self._depths(model, as_vector(q, model.n, "q"))

    @abstractmethod
    def _depths(self, model: RobotModel, q: Array) -> tuple[Array, Array]:
        """Depths and their slopes at checked configurations."""


@dataclass(frozen=True, slots=True, eq=False)
class JointLimitCriterion(_Squares):
    """``sum(((q - middle) / (upper - lower))^2)`` over joints that have limits; small is good."""

    gain: float = 1.0
    lower: Array | None = None
    upper: Array | None = None

    def __post_init__(self) -> None:
        _set_numbers(self, "gain")
        _set_limits(self)

    def _depths(self, model: RobotModel, q: Array) -> tuple[Array, Array]:
        x, inverse = _places(model, q, self.lower, self.upper)
        return 0.5 * x, np.diag(inverse)

    def _factor(self) -> float:
        return 1.0


@dataclass(frozen=True, slots=True, eq=False)
class NearLimitCriterion(_Squares):
    """Half the sum of squares of the depths of joints in the margins of their ranges.

    ``h = (|x| - 1 + margin) / margin`` where positive, with x = -1 and 1 at the limits: 0 at the
    edge of the margin, 1 at the limit, more beyond. ``margin``, in (0, 1], is a part of half the
    range. Small is good.
    """

    margin: float = 0.3
    gain: float = 1.0
    lower: Array | None = None
    upper: Array | None = None

    def __post_init__(self) -> None:
        _set_numbers(self, "gain", "margin")
        if self.margin > 1.0:
            raise InvalidValueError(f"margin: expected at most 1, got {self.margin!r}.")
        _set_limits(self)

    def _depths(self, model: RobotModel, q: Array) -> tuple[Array, Array]:
        x, inverse = _places(model, q, self.lower, self.upper)
        depth = np.maximum(0.0, (np.abs(x) - 1.0 + self.margin) / self.margin)
        return depth * np.sign(x), np.diag(2.0 * inverse / self.margin)


@dataclass(frozen=True, slots=True, eq=False)
class PostureCriterion(_Squares):
    """Weighted distance from a posture, ``sum(weights (q - q_ref)^2) / 2``; small is good.

    ``q_ref (n,)`` in rad or m, ``weights (n,)`` not negative (default 1). The gain is the rate in
    1/s at which a joint of weight 1 returns. Whole turns are not removed from the difference.
    """

    q_ref: Array
    weights: Array | None = None
    gain: float = 1.0

    def __post_init__(self) -> None:
        q_ref = as_floats(self.q_ref, "q_ref")
        if q_ref.ndim != 1:
            raise ShapeError(f"q_ref: expected shape (n,), got {q_ref.shape}.")
        weights = np.ones(q_ref.size)
        if self.weights is not None:
            weights = as_exact(self.weights, q_ref.shape, "weights")
        if (weights < 0.0).any():
            raise InvalidValueError(f"weights: expected none below zero, got {weights}.")
        object.__setattr__(self, "q_ref", read_only(q_ref))
        object.__setattr__(self, "weights", read_only(weights))
        _set_numbers(self, "gain")

    def _depths(self, model: RobotModel, q: Array) -> tuple[Array, Array]:
        return q - for_joints(model, self.q_ref, "q_ref"), np.eye(model.n)

    def _factor(self) -> Array:
        return 0.5 * np.asarray(self.weights)


@dataclass(frozen=True, slots=True, eq=False)
class ManipulabilityCriterion(Rebuilt):
    """Manipulability ``sqrt(det(J J^T))`` of some rows of the Jacobian; large is good.

    With fewer joints than rows ``sqrt(det(J^T J))``: the product of the singular values in both
    cases. The gradient is exact and finite at singular positions too, where it points to one of
    the two sides. ``frame``, ``reference`` and ``mask`` as in `ikm`; ``length`` in metres is a
    constant factor of the value, unless there are fewer joints than rows.
    """

    gain: float = 1.0
    frame: str | int | None = None
    reference: Reference = "world_aligned"
    mask: NDArray[np.bool_] | None = None
    length: float = 1.0

    def __post_init__(self) -> None:
        _set_numbers(self, "gain", "length")
        reference_of(self.reference)
        mask = as_mask(self.mask, COMPONENTS)
        object.__setattr__(self, "mask", read_only(mask, np.bool_))

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Product of the singular values."""
        J = self._rows(jacobian(model, q, self.frame, self.reference))
        return np.asarray(np.linalg.svd(J, compute_uv=False).prod(axis=-1))

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Gradient of the manipulability times the gain."""
        check_model(model)
        q = as_vector(q, model.n, "q")
        rows = q.reshape(int(np.prod(q.shape[:-1])), model.n)
        parts = [self._slopes(model, rows[k : k + _CHUNK]) for k in range(0, len(rows), _CHUNK)]
        return self.gain * np.concatenate([np.empty((0, model.n)), *parts]).reshape(q.shape)

    def _slopes(self, model: RobotModel, q: Array) -> Array:
        J = self._rows(jacobian(model, q, self.frame, self.reference))
        U, S, Vt = np.linalg.svd(J, full_matrices=False)
        # dw = sum_i (product of the other singular values) u_i . dJ v_i: nothing is divided by
        others = np.ones_like(S)
        for i in range(S.shape[-1]):
            others[:, i] = np.delete(S, i, axis=-1).prod(axis=-1)
        adjugate = np.einsum("kai,ki,kib->kab", U, others, Vt)
        units = np.eye(model.n)
        rates = jacobian_rate(model, q[:, None], units, self.frame, self.reference)
        return np.einsum("kab,kjab->kj", adjugate, self._rows(rates))

    def _rows(self, J: Array) -> Array:
        factors = np.repeat([1.0 / self.length, 1.0], 3)[:, None]
        return (J * factors)[..., np.asarray(self.mask), :]


@dataclass(frozen=True, slots=True, eq=False)
class ObstacleCriterion(_Squares):
    """Half the sum of squares of the depths of links in the neighbourhood of obstacles.

    For a distance d between a link and an obstacle ``h = (influence - d) / influence`` where
    positive: 0 at the edge of the neighbourhood, 1 in contact, more inside. Links are straight
    segments between the origins of frames. A plane acts on their ends, a body on the nearest
    point. Links that no joint moves do not count. Small is good.

    Parameters
    ----------
    obstacles : Sphere, Box, Plane, Capsule of `obstacles`, or sequence of these
        At least one.
    influence : float
        Distance at which obstacles begin to matter, m.
    gain : float
        Factor of the gradient.
    radius : float
        Of the links, m.
    segments : sequence of pairs of frames, optional
        Names or numbers of frames (None is the tool) whose origins the segments join; twice the
        same frame is a point. Default every frame with its antecedent, and the tip with the tool.
    """

    obstacles: Sequence[Obstacle]
    influence: float = 0.1
    gain: float = 1.0
    radius: float = 0.0
    segments: Sequence[Segment] | None = None

    def __post_init__(self) -> None:
        bodies = checked_obstacles(self.obstacles)
        if not bodies:
            raise InvalidValueError("obstacles: expected at least one, got none.")
        object.__setattr__(self, "obstacles", bodies)
        object.__setattr__(self, "radius", as_number(self.radius, "radius", least=0.0))
        object.__setattr__(self, "segments", checked_segments(self.segments))
        _set_numbers(self, "influence", "gain")

    def clearance(self, model: RobotModel, q: ArrayLike) -> Array:
        """Least distance between links and obstacles, m: `obstacles.clearance`."""
        return clearance(model, q, self.obstacles, self.radius, segments=self.segments)

    def _depths(self, model: RobotModel, q: Array) -> tuple[Array, Array]:
        """Depths in the neighbourhood; planes act on the ends of links, bodies on the links."""
        rows = np.ascontiguousarray(q).reshape(int(np.prod(q.shape[:-1])), model.n)
        segments = links(model) if self.segments is None else self.segments
        points = [(frame, frame) for frame in dict.fromkeys(f for pair in segments for f in pair)]
        planes = [body for body in self.obstacles if isinstance(body, Plane)]
        bodies = [body for body in self.obstacles if not isinstance(body, Plane)]
        found = [
            link_distances(model, rows, part, self.radius, pairs)
            for part, pairs in ((planes, points), (bodies, segments))
            if part
        ]
        parts = (np.concatenate(part, axis=1) for part in zip(*found, strict=True))
        distance, slope = (part.reshape(*q.shape[:-1], *part.shape[1:]) for part in parts)
        depth = np.maximum(0.0, (self.influence - distance) / self.influence)
        return depth, -slope / self.influence


def _set_numbers(criterion: object, *names: str) -> None:
    """Replace fields by positive floats."""
    for name in names:
        object.__setattr__(criterion, name, as_number(getattr(criterion, name), name, above=0.0))


def _set_limits(criterion: object) -> None:
    """Replace the limits given to a criterion by read-only arrays."""
    for name in ("lower", "upper"):
        if getattr(criterion, name) is not None:
            object.__setattr__(criterion, name, as_limit(getattr(criterion, name), name))


def _places(
    model: RobotModel, q: Array, lower: Array | None, upper: Array | None
) -> tuple[Array, Array]:
    """Places in the ranges, -1 to 1, and the inverses of the widths, both 0 without a range."""
    low = for_joints(model, model.lower if lower is None else lower, "lower")
    high = for_joints(model, model.upper if upper is None else upper, "upper")
    check_order(model, low, high, low > high)
    counts = np.isfinite(low) & np.isfinite(high) & (low < high)
    middle, inverse = np.zeros(model.n), np.zeros(model.n)
    middle[counts] = 0.5 * (low[counts] + high[counts])
    inverse[counts] = 1.0 / (high[counts] - low[counts])
    return 2.0 * inverse * (q - middle), inverse
