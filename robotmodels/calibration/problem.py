"""All measurements of a calibration: one vector of unknowns, one stack of rows.

Book section 1.4.5.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel
from .differential import differential_model
from .measurements import Evaluation, Fixture, Linearised, Measurement, PointContact, whitened
from .measurements.kinds import satisfied_measurement
from .parameters import GeometricParameters


@dataclass(frozen=True, slots=True, eq=False)
class Problem(Rebuilt):
    """Parameters, measurements and their F fixtures; the unknowns are [parameters, fixtures].

    ``factors`` are ``parameters.factors(q)`` of each measurement and view.
    """

    parameters: GeometricParameters
    measurements: tuple[Measurement, ...]
    fixtures: tuple[Fixture, ...]
    factors: tuple[tuple[Array, ...], ...] = field(init=False)

    def __post_init__(self) -> None:
        factors = (
            tuple(self.parameters.factors(view.q) for view in m.views) for m in self.measurements
        )
        object.__setattr__(self, "factors", tuple(factors))

    @property
    def P(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    @property
    def F(self) -> int:
        """Number of fixtures."""
        return len(self.fixtures)

    @property
    def rows(self) -> int:
        """Number of residuals."""
        return sum(m.blocks * len(m.axes) for m in self.measurements)

    @property
    def row_slices(self) -> list[slice]:
        """Rows of each measurement among all."""
        ends = np.cumsum([0, *(m.blocks * len(m.axes) for m in self.measurements)]).tolist()
        return [slice(*both) for both in pairwise(ends)]

    @property
    def block(self) -> NDArray[np.int64]:
        """Number of the block of each row, counted through all measurements, shape (M,)."""
        rows = [np.full(m.blocks, len(m.axes)) for m in self.measurements]
        return np.repeat(np.arange(self.blocks), np.concatenate(rows))

    @property
    def blocks(self) -> int:
        """Number of blocks of all measurements."""
        return sum(m.blocks for m in self.measurements)

    @property
    def sees_base(self) -> bool:
        """Whether some measurement depends on the base."""
        return any(m.sees_base for m in self.measurements)

    def columns(self, measurement: Measurement) -> NDArray[np.int64]:
        """Numbers of the fixtures of a measurement among all, shape (its F,)."""
        number = {fixture.name: k for k, fixture in enumerate(self.fixtures)}
        return np.array([number[fixture.name] for fixture in measurement.fixtures], dtype=np.int64)


def problem_of(
    parameters: GeometricParameters, measurements: Measurement | Iterable[Measurement]
) -> Problem:
    """Problem of one or more measurements of a robot."""
    measurements = as_measurements(measurements)
    fixtures: dict[str, Fixture] = {}
    n = parameters.model.n
    for k, m in enumerate(measurements):
        for view in m.views:
            if view.q.shape[1] != n:
                raise ShapeError(
                    f"measurements[{k}] ({m.name}): expected readings of {n} joints, shape "
                    f"(N, {n}), got {view.q.shape}.{expected_joints_text(parameters.model)}"
                )
        for fixture in m.fixtures:
            fixtures.setdefault(fixture.name, fixture)
    return Problem(parameters, measurements, tuple(fixtures.values()))


def expected_joints_text(model: RobotModel) -> str:
    """Sentence on the expected joints; empty if all move the tool."""
    moving = model.twin.frame(None).path.tolist()
    names = model.table.joint_names
    rows = zip(names, model.table.joint_rows, strict=True)
    idle = [name for name, row in rows if row + 1 not in moving]
    if not idle:
        return ""
    return (
        f" Readings of all {model.n} joints of the model are needed: {', '.join(names)}. "
        f"{', '.join(idle)} do not move the tool; read the robot with tip_link='LINK' to leave "
        "them out."
    )


def as_measurements(
    measurements: Measurement | Iterable[Measurement], name: str = "measurements"
) -> tuple[Measurement, ...]:
    """Check measurements: one or several."""
    if isinstance(measurements, Measurement):
        return (measurements,)
    found = tuple(measurements) if isinstance(measurements, Iterable) else (measurements,)
    if not found:
        raise InvalidValueError(f"{name}: expected one or more, got none.")
    for k, m in enumerate(found):
        if not isinstance(m, Measurement):
            raise InvalidValueError(
                f"{name}[{k}]: expected Pose, Position, PointContact or another kind of "
                f"measurement, got {type(m).__name__}."
            )
    return found


def measured_frames(measurements: Iterable[Measurement]) -> tuple[str | int | None, ...]:
    """Ends that are measured, each once."""
    return tuple(dict.fromkeys(view.frame for m in measurements for view in m.views)) or (None,)


def evaluations(problem: Problem, xi: Array) -> list[list[Evaluation]]:
    """Poses and Psi of every view of every measurement. Shapes: xi (P,)."""
    return [
        [
            differential_model(problem.parameters, view.q, xi, view.frame, factor)
            for view, factor in zip(m.views, factors, strict=True)
        ]
        for m, factors in zip(problem.measurements, problem.factors, strict=True)
    ]


def guessed_fixtures(problem: Problem, xi: Array) -> Array:
    """Initial values of all fixtures. Shapes: xi (P,) -> (F,)."""
    values = np.full(problem.F, np.nan)
    for m, poses in zip(problem.measurements, evaluations(problem, xi), strict=True):
        guess = m.guess(poses)
        if guess is not None:
            at = problem.columns(m)
            new = np.isnan(values[at])
            values[at[new]] = guess[new]
    if np.isnan(values).any():
        pairs = zip(problem.fixtures, values, strict=True)
        names = dict.fromkeys(f.name.rsplit(".", 1)[0] for f, v in pairs if np.isnan(v))
        contacts = [m for m in problem.measurements if isinstance(m, PointContact)]
        touched = dict.fromkeys(f"{m.name}:{label}" for m in contacts for label in m.unknown)
        raise InvalidValueError(
            f"No measurement touches {', '.join(names)}. Touched points: "
            f"{', '.join(touched) or 'none'}."
        )
    return values


def linearised(problem: Problem, xi: Array, fixtures: Array) -> list[Linearised]:
    """Residuals and derivatives of each measurement. Shapes: xi (P,), fixtures (F,)."""
    return [
        m.linearise(poses, fixtures[problem.columns(m)])
        for m, poses in zip(problem.measurements, evaluations(problem, xi), strict=True)
    ]


def stacked(problem: Problem, x: Array, scales: tuple[Array, ...]) -> tuple[Array, Array]:
    """Whitened rows of all measurements.

    Shapes: x (P + F,), scales (k,) -> residual (M,), jacobian (M, P + F).
    """
    P = problem.P
    residual, jacobian = np.empty(problem.rows), np.zeros((problem.rows, P + problem.F))
    parts = zip(linearised(problem, x[:P], x[P:]), scales, problem.row_slices, strict=True)
    for m, (part, scale, rows) in zip(problem.measurements, parts, strict=True):
        residual[rows] = whitened(m, part.residual, scale).ravel()
        if part.by_parameters.shape[-1]:
            jacobian[rows, :P] = whitened(m, part.by_parameters, scale).reshape(-1, P)
        at = problem.columns(m)
        if len(at):
            jacobian[rows, P + at] = whitened(m, part.by_fixtures, scale).reshape(-1, len(at))
    return residual, jacobian


def satisfying(problem: Problem, xi: Array, fixtures: Array) -> Problem:
    """The problem with readings moved to satisfy the constraints exactly, for rank decisions."""
    moved = [
        satisfied_measurement(problem.parameters, m, xi, fixtures[problem.columns(m)])
        if m.is_constraint
        else m
        for m in problem.measurements
    ]
    measurements = tuple(m for m in moved if m is not None)
    return replace(problem, measurements=measurements)
