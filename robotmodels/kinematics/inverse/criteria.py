"""Criteria for the freedom of a redundant robot: a value, and joint velocities that improve it.

Seed book section 1.3.2.4; A. Liegeois 1977, A. Fournier 1980, T. Yoshikawa 1985, O. Khatib 1986,
A. A. Maciejewski and C. A. Klein 1985. `ikm` takes a criterion as ``secondary``: its gradient is
the z of ``v = J^+ x + (I - J^+ J) z``.

Parameters
----------
gain : float
    Positive factor of the gradient.
lower, upper : array_like, shape (n,) or (), optional
    Limits, rad or m; default the robot's. A joint with an infinite limit, or with no range, does
    not count.

Raises
------
ShapeError, InvalidValueError
    Arrays of the wrong shape or NaN, numbers that are not positive; what does not fit the robot is
    refused when it is known.
"""

from __future__ import annotations

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
from ...obstacles.shapes import Obstacle, checked_length
from ..jacobians import COMPONENTS, Reference, jacobian, jacobian_rate, reference_of
from .bounds import as_limit, check_order, for_joints

_CHUNK = 512
"""Configurations at a time: each takes n Jacobians."""


@runtime_checkable
class Criterion(Protocol):
    """Anything with a value and a gradient.

    Examples
    --------
    >>> isinstance(PostureCriterion([0.0, 0.0]), Criterion)
    True
    """

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Value at each configuration: q (..., n) -> (...)."""
        ...

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Joint velocities that improve the value, rad/s or m/s: q (..., n) -> (..., n)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class JointLimitCriterion(Rebuilt):
    """``sum(((q - middle) / (upper - lower))^2)`` over joints that have limits; small is good.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> criterion = JointLimitCriterion(lower=[-1.0, -2.0], upper=[1.0, 2.0])
    >>> criterion.value(load("planar_2r"), [1.0, 0.0])
    array(0.25)
    >>> criterion.gradient(load("planar_2r"), [1.0, 1.0])
    array([-0.5  , -0.125])
    """

    gain: float = 1.0
    lower: Array | None = None
    upper: Array | None = None

    def __post_init__(self) -> None:
        _set_numbers(self, "gain")
        _set_limits(self)

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Sum of squared relative distances from the middle."""
        x, _ = _places(model, q, self.lower, self.upper)
        return np.asarray(0.25 * (x**2).sum(axis=-1))

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Velocities towards the middle."""
        x, inverse = _places(model, q, self.lower, self.upper)
        return -self.gain * inverse * x


@dataclass(frozen=True, slots=True, eq=False)
class NearLimitCriterion(Rebuilt):
    """Half the sum of squares of the depths of joints in the margins of their ranges.

    ``h = (|x| - 1 + margin) / margin`` where positive, with x = -1 and 1 at the limits: 0 at the
    edge of the margin, 1 at the limit, more beyond. ``margin``, in (0, 1], is a part of half the
    range. Small is good.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> criterion = NearLimitCriterion(margin=0.5, lower=-1.0, upper=1.0)
    >>> criterion.gradient(load("planar_2r"), [0.4, 1.0])
    array([-0., -2.])
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

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Half the sum of the squared depths."""
        x, _ = _places(model, q, self.lower, self.upper)
        return np.asarray(0.5 * (self._depths(x) ** 2).sum(axis=-1))

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Velocities away from near limits."""
        x, inverse = _places(model, q, self.lower, self.upper)
        return -self.gain * self._depths(x) * np.sign(x) * (2.0 * inverse / self.margin)

    def _depths(self, x: Array) -> Array:
        return np.maximum(0.0, (np.abs(x) - 1.0 + self.margin) / self.margin)


@dataclass(frozen=True, slots=True, eq=False)
class PostureCriterion(Rebuilt):
    """Weighted distance from a posture, ``sum(weights (q - q_ref)^2) / 2``; small is good.

    ``q_ref (n,)`` in rad or m, ``weights (n,)`` not negative (default 1). The gain is the rate in
    1/s at which a joint of weight 1 returns. Whole turns are not removed from the difference.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> posture = PostureCriterion([0.0, 1.0], gain=2.0)
    >>> posture.value(load("planar_2r"), [0.5, 1.0])
    array(0.125)
    >>> posture.gradient(load("planar_2r"), [0.5, 1.0])
    array([-1., -0.])
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

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Half the weighted squared distance."""
        away = self._away(model, q)
        return np.asarray(0.5 * (np.asarray(self.weights) * away**2).sum(axis=-1))

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Velocities towards the posture."""
        return -self.gain * np.asarray(self.weights) * self._away(model, q)

    def _away(self, model: RobotModel, q: ArrayLike) -> Array:
        check_model(model)
        if self.q_ref.shape != (model.n,):
            raise ShapeError(
                f"q_ref: expected shape ({model.n},), one value for each joint of the robot, got "
                f"{self.q_ref.shape}."
            )
        return as_vector(q, model.n, "q") - self.q_ref


@dataclass(frozen=True, slots=True, eq=False)
class ManipulabilityCriterion(Rebuilt):
    """Manipulability ``sqrt(det(J J^T))`` of some rows of the Jacobian; large is good.

    With fewer joints than rows ``sqrt(det(J^T J))``: the product of the singular values in both
    cases. The gradient is exact and finite at singular positions too, where it points to one of
    the two sides. ``frame``, ``reference`` and ``mask`` as in `ikm`; ``length`` in metres is a
    constant factor of the value, unless there are fewer joints than rows.

    Examples
    --------
    A planar arm with links of 1 m, ``w = |sin q2|``:

    >>> from robotmodels.robots import load
    >>> criterion = ManipulabilityCriterion(mask=[1, 1, 0, 0, 0, 0])
    >>> criterion.value(load("planar_2r"), [0.3, np.pi / 6])
    array(0.5)
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
class ObstacleCriterion(Rebuilt):
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

    Examples
    --------
    >>> from robotmodels.obstacles import Sphere
    >>> from robotmodels.robots import load
    >>> criterion = ObstacleCriterion([Sphere([0.5, 0.3, 0.0], 0.1)], influence=0.4)
    >>> criterion.clearance(load("planar_2r"), [0.0, 0.0])
    array(0.2)
    >>> criterion.gradient(load("planar_2r"), [0.0, 0.0]).round(6)
    array([-0.625,  0.   ])
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
        object.__setattr__(self, "radius", checked_length(self.radius, "radius"))
        object.__setattr__(self, "segments", checked_segments(self.segments))
        _set_numbers(self, "influence", "gain")

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Half the sum of the squared depths."""
        check_model(model)
        q = as_vector(q, model.n, "q")
        depth, _ = self._depths(model, q)
        return np.asarray(0.5 * (depth**2).sum(axis=-1)).reshape(q.shape[:-1])

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Velocities away from obstacles that are near."""
        check_model(model)
        q = as_vector(q, model.n, "q")
        depth, slope = self._depths(model, q)
        push = depth * (self.gain / self.influence)
        return np.einsum("kp,kpj->kj", push, slope).reshape(q.shape)

    def clearance(self, model: RobotModel, q: ArrayLike) -> Array:
        """Least distance between links and obstacles, m: `obstacles.clearance`."""
        return clearance(model, q, self.obstacles, self.radius, segments=self.segments)

    def _depths(self, model: RobotModel, q: Array) -> tuple[Array, Array]:
        """Depths in the neighbourhood and gradients of the distances, of points for planes."""
        q = np.ascontiguousarray(q).reshape(int(np.prod(q.shape[:-1])), model.n)
        segments = links(model) if self.segments is None else self.segments
        points = [(frame, frame) for frame in dict.fromkeys(f for pair in segments for f in pair)]
        planes = [body for body in self.obstacles if isinstance(body, Plane)]
        bodies = [body for body in self.obstacles if not isinstance(body, Plane)]
        found = [
            link_distances(model, q, part, self.radius, pairs)
            for part, pairs in ((planes, points), (bodies, segments))
            if part
        ]
        distance, slope = (np.concatenate(part, axis=1) for part in zip(*found, strict=True))
        return np.maximum(0.0, (self.influence - distance) / self.influence), slope


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
    model: RobotModel, q: ArrayLike, lower: Array | None, upper: Array | None
) -> tuple[Array, Array]:
    """Places in the ranges, -1 to 1, and the inverses of the widths, both 0 without a range."""
    check_model(model)
    low = for_joints(model, model.lower if lower is None else lower, "lower")
    high = for_joints(model, model.upper if upper is None else upper, "upper")
    check_order(model, low, high, low > high)
    counts = np.isfinite(low) & np.isfinite(high) & (low < high)
    middle, inverse = np.zeros(model.n), np.zeros(model.n)
    middle[counts] = 0.5 * (low[counts] + high[counts])
    inverse[counts] = 1.0 / (high[counts] - low[counts])
    return 2.0 * inverse * (as_vector(q, model.n, "q") - middle), inverse
