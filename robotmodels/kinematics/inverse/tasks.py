"""Tasks of a redundant robot beside the twist: rows ``J v = rate`` of its joint velocities.

Book section 1.3.2.4; J. Baillieul 1985 (functions of the configuration). Tasks are given to
`ikm` as ``augmented`` or ``tasks``. In `ikm_second_order` their rates are accelerations,
``J a + dJ/dt v = rate``.

Parameters
----------
rate : array_like, shape (..., m)
    Rates wanted of the m components (m/s, rad/s; accelerations for `ikm_second_order`); the
    leading axes broadcast with those of the configurations.
frame, first, second : str or int, optional
    Names or numbers of frames; default the tool.
reference : {"world_aligned", "local", "world"}
    Point and axes of the twist, as of `jacobian`.
mask : array_like, optional
    Ones for the components that are requested; default all.
length : float, optional
    Metres that count as one radian; default `characteristic_length` of the frame, as in `ikm`.
weights : array_like, shape (m,), optional
    Positive factors that make the rows comparable; default 1. Arguments are
    checked against the robot when it is known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial, wraps
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import (
    Array,
    Rebuilt,
    as_core,
    as_exact,
    as_floats,
    as_mask,
    as_vector,
    read_only,
)
from ...errors import InvalidValueError, ShapeError
from ...geometry import PRISMATIC
from ...model import RobotModel, check_model
from ..jacobians import COMPONENTS, Reference, jacobian, jacobian_rate, reference_of
from ..lengths import length_of
from ..poses import dgm

_STEP = 1e-3
"""Step of the differences of fourth order, rad or m: truncation and rounding are near 1e-13."""

Rows = tuple[Array, Array | None, Array]
"""J (N, m, n), ``dJ/dt v`` (N, m) or None for zero, and weights (m,)."""


class Level(NamedTuple):
    """Rows ``J v = rate - drift`` of one priority.

    Shapes: J (N, m, n); rate, drift (N, m); weights (m,), positive factors of the rows.
    """

    J: Array
    rate: Array
    drift: Array
    weights: Array


@dataclass(frozen=True, slots=True, eq=False)
class Task(Rebuilt):
    """Rates that are requested, and the function that gives their rows.

    Parameters
    ----------
    rate : array_like, shape (..., m)
        Rates wanted.
    rows : callable
        ``rows(model, q, v)`` with q (N, n), and v (N, n) or None where velocities are requested,
        gives J (N, m, n), ``dJ/dt v`` (N, m) or None for zero, and the weights (m,).
    made_by : tuple, optional
        Function and arguments of the builders of this file, from which a pickle makes the task.

    Examples
    --------
    The difference of two joints is to decrease:

    >>> from robotmodels import ikm, load
    >>> row = np.array([[[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0]]])
    >>> task = Task([-0.1], lambda model, q, v: (np.repeat(row, len(q), 0), None, np.ones(1)))
    >>> v = ikm(load("panda"), [0.1, 0.2, 0.3, -1.4, 0.5, 1.6, 0.7], np.zeros(6), tasks=[task]).v
    >>> float((v[0] - v[6]).round(12))
    -0.1
    """

    rate: Array
    rows: Callable[[RobotModel, Array, Array | None], Rows]
    made_by: tuple[Callable[..., Task], tuple[Any, ...], dict[str, Any]] | None = field(
        default=None, repr=False
    )

    def __reduce__(self) -> tuple[Any, ...]:  # functions in functions cannot be pickled
        if self.made_by is None:
            return Rebuilt.__reduce__(self)
        builder, arguments, options = self.made_by
        return partial(builder, **options), arguments

    def __post_init__(self) -> None:
        rate = as_floats(self.rate, "rate")
        if rate.ndim == 0:
            raise ShapeError("rate: expected shape (..., m), got (); one component is [rate].")
        object.__setattr__(self, "rate", read_only(rate))

    def level(self, model: RobotModel, q: ArrayLike, v: ArrayLike | None = None) -> Level:
        """Rows at configurations: N is the product of the leading axes of q."""
        check_model(model)
        q = as_vector(q, model.n, "q")
        batch, N, m = q.shape[:-1], int(np.prod(q.shape[:-1])), self.rate.shape[-1]
        speeds = None if v is None else as_vector(v, model.n, "v")
        if speeds is not None and speeds.shape != q.shape:
            raise ShapeError(f"v: expected the shape of q, {q.shape}, got {speeds.shape}.")
        flat = (
            None if x is None else np.ascontiguousarray(x).reshape(N, model.n) for x in (q, speeds)
        )
        J, drift, weights = self.rows(model, *flat)  # type: ignore[arg-type]
        try:
            rate = np.broadcast_to(self.rate, (*batch, m)).reshape(N, m)
        except ValueError:
            raise ShapeError(
                f"rate: its shape {self.rate.shape} does not broadcast to {(*batch, m)}: the "
                f"leading axes of the configurations and the {m} components of the task."
            ) from None
        J = as_exact(J, (N, m, model.n), "J")
        return Level(J, rate, np.zeros((N, m)) if drift is None else drift, weights)


def _remembered(builder: Callable[..., Task]) -> Callable[..., Task]:
    """Builder whose tasks keep its arguments, from which copies and pickles are rebuilt."""

    @wraps(builder)
    def build(*arguments: Any, **options: Any) -> Task:
        return replace(builder(*arguments, **options), made_by=(build, arguments, options))

    return build


@_remembered
def TwistTask(
    rate: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
    mask: ArrayLike | str | None = None,
    length: float | None = None,
) -> Task:
    """Twist ``[v; w]`` of a frame, or some of its six components."""
    reference_of(reference)
    selected = np.flatnonzero(as_mask(mask, COMPONENTS))
    rate = as_core(rate, (6,), "rate")[..., selected]

    def rows(model: RobotModel, q: Array, v: Array | None) -> Rows:
        weights = np.repeat([1.0 / length_of(model, frame, length), 1.0], 3)[selected]
        J = jacobian(model, q, frame, reference)[:, selected]
        if v is None:
            return J, None, weights
        rates = jacobian_rate(model, q, v, frame, reference)[:, selected]
        return J, np.einsum("kij,kj->ki", rates, v), weights

    return Task(rate, rows)


@_remembered
def PositionTask(
    rate: ArrayLike,
    frame: str | int | None = None,
    point: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    length: float | None = None,
) -> Task:
    """Velocity in world axes of a point given in a frame (shape (3,), m; default its origin)."""
    selected = np.flatnonzero(as_mask(mask, ("x", "y", "z")))
    rate = as_core(rate, (3,), "rate")[..., selected]
    point = read_only(np.zeros(3) if point is None else as_exact(point, (3,), "point"))

    def rows(model: RobotModel, q: Array, v: Array | None) -> Rows:
        from ...kernels.poses import accelerations, jacobians

        path, rotation, position = model.twin.frame(frame).kernel_arguments
        place = path, rotation, position + rotation @ point
        J, drift = np.empty((len(q), 6, model.n)), np.empty((len(q), 6))
        jacobians(q, model.chain, *place, 0, J)
        if v is not None:
            accelerations(q, v, np.zeros_like(q), model.chain, *place, 0, drift)
        weights = np.full(len(selected), 1.0 / length_of(model, frame, length))
        return J[:, selected], None if v is None else drift[:, selected], weights

    return Task(rate, rows)


@_remembered
def JointTask(rate: ArrayLike, joints: Sequence[int | str], length: float | None = None) -> Task:
    """Velocities of k joints, given as columns of q (from 0) or by name."""
    if isinstance(joints, (str, int)) or not 0 < len(set(joints)) == len(joints):
        raise InvalidValueError(
            f"joints: expected a sequence of different joints such as [0, 2], got {joints!r}."
        )
    joints = tuple(joints)

    def rows(model: RobotModel, q: Array, v: Array | None) -> Rows:
        columns = joint_columns(model, joints)
        J = np.tile(np.eye(model.n)[columns], (len(q), 1, 1))
        slides = model.table.sigma[model.table.joint_rows][columns] == PRISMATIC
        return J, None, np.where(slides, 1.0 / length_of(model, None, length), 1.0)

    return Task(as_core(rate, (len(joints),), "rate"), rows)


@_remembered
def DistanceTask(
    rate: ArrayLike,
    first: str | int = 0,
    second: str | int | None = None,
    length: float | None = None,
) -> Task:
    """Rate (shape (...), m/s) of the distance between the origins of two frames.

    Where the origins coincide the distance has no derivative, and the row of J is zero.
    """

    def rows(model: RobotModel, q: Array, v: Array | None) -> Rows:
        apart = dgm(model, q, second)[:, :3, 3] - dgm(model, q, first)[:, :3, 3]
        distance = np.linalg.norm(apart, axis=-1)
        inverse = np.divide(1.0, distance, out=np.zeros_like(distance), where=distance > 0.0)
        unit = apart * inverse[:, None]
        J = (jacobian(model, q, second) - jacobian(model, q, first))[:, :3]
        row = np.einsum("ki,kij->kj", unit, J)[:, None]
        weights = np.array([1.0 / length_of(model, second, length)])
        if v is None:
            return row, None, weights
        rates = (jacobian_rate(model, q, v, second) - jacobian_rate(model, q, v, first))[:, :3]
        velocity = np.einsum("kij,kj->ki", J, v)
        along = np.einsum("ki,ki->k", unit, velocity)
        drift = np.einsum("ki,kij,kj->k", unit, rates, v)
        drift += inverse * (np.einsum("ki,ki->k", velocity, velocity) - along**2)
        return row, drift[:, None], weights

    return Task(as_floats(rate, "rate")[..., None], rows)


@_remembered
def FunctionTask(
    gradient: Callable[[Array], ArrayLike],
    rate: ArrayLike,
    gradient_rate: Callable[[Array, Array], ArrayLike] | None = None,
    weights: ArrayLike | None = None,
) -> Task:
    """Rates of m functions of the configuration by their gradients, ``gradient(q)`` (N, m, n).

    ``gradient_rate(q, v)`` gives their time derivatives; by default differences of the gradient
    along the motion, over 1e-3 of joint travel. One function may give (N, n).
    """
    for name, function in (("gradient", gradient), ("gradient_rate", gradient_rate)):
        if not callable(function) and (function is not None or name == "gradient"):
            raise InvalidValueError(
                f"{name}: expected a function, got {type(function).__name__}; arrays are given to "
                "LinearTask."
            )
    m = np.shape(rate)[-1] if np.ndim(rate) else 0
    factors = _weights(weights, m)

    def checked(value: ArrayLike, q: Array, name: str) -> Array:
        array = as_floats(value, f"the value of {name}")
        if m == 1 and array.shape == q.shape:
            return array[:, None]
        shape = (len(q), m, q.shape[1])
        if array.shape != shape:
            raise ShapeError(
                f"{name}: expected an array of shape {shape} (configurations, functions, joints) "
                f"from the function, got {array.shape}."
            )
        return array

    def rows(model: RobotModel, q: Array, v: Array | None) -> Rows:
        J = checked(gradient(q), q, "gradient")
        if v is None:
            return J, None, factors
        if gradient_rate is not None:
            rates = checked(gradient_rate(q, v), q, "gradient_rate")
            return J, np.einsum("kij,kj->ki", rates, v), factors
        speed = np.linalg.norm(v, axis=-1, keepdims=True)
        h = _STEP * np.divide(v, speed, out=np.zeros_like(v), where=speed > 0.0)
        slope = sum(
            factor * checked(gradient(q + k * h), q, "gradient")
            for k, factor in ((1, 8.0), (-1, -8.0), (2, -1.0), (-2, 1.0))
        )
        return J, np.einsum("kij,kj->ki", slope, v) * (speed / (12.0 * _STEP)), factors

    return Task(as_floats(rate, "rate"), rows)


@_remembered
def LinearTask(
    J: ArrayLike,
    rate: ArrayLike,
    drift: ArrayLike | None = None,
    weights: ArrayLike | None = None,
) -> Task:
    """Rows given as arrays: J (..., m, n) and, for accelerations, ``dJ/dt v`` as drift (..., m)."""
    J = read_only(as_floats(J, "J"))
    if J.ndim < 2:
        raise ShapeError(f"J: expected shape (..., m, n), got {J.shape}.")
    m = J.shape[-2]
    given = read_only(np.zeros(m) if drift is None else as_core(drift, (m,), "drift"))
    factors = _weights(weights, m)

    def rows(model: RobotModel, q: Array, v: Array | None) -> Rows:
        n = J.shape[-1]
        if n != model.n:
            raise ShapeError(f"J: expected {model.n} columns, one for each joint, got {n}.")
        try:
            each = np.broadcast_to(J.reshape(prod(J.shape[:-2]), m, n), (len(q), m, n))
            drifts = np.broadcast_to(given.reshape(-1, m), (len(q), m))
        except ValueError:
            raise ShapeError(
                f"J, drift: expected one for each of the {len(q)} configurations or one for all, "
                f"got shapes {J.shape} and {given.shape}."
            ) from None
        return each, None if v is None else drifts, factors

    return Task(as_core(rate, (m,), "rate"), rows)


def _weights(weights: ArrayLike | None, m: int) -> Array:
    if weights is None:
        return np.ones(m)
    weights = as_exact(weights, (m,), "weights")
    if not (weights > 0.0).all():
        raise InvalidValueError(
            f"weights: expected positive numbers, got {weights}; leave rows out that should have "
            "none."
        )
    return weights


def joint_columns(model: RobotModel, joints: Sequence[int | str]) -> list[int]:
    """Columns of q of different joints given by number or name."""
    names = model.table.joint_names
    known: dict[Any, int] = {k: k for k in range(model.n)}
    known |= {name: k for k, name in enumerate(names)}
    columns = []
    for joint in joints:
        kind = isinstance(joint, (int, np.integer, str)) and not isinstance(joint, bool)
        if not kind or joint not in known:
            raise InvalidValueError(
                f"joints: the robot has no joint {joint!r}; give columns of q, 0 to {model.n - 1}, "
                f"or names: {', '.join(names)}."
            )
        columns.append(known[joint])
    if len(set(columns)) < len(columns):
        raise InvalidValueError(f"joints: expected different joints, got {joints!r}.")
    return columns
