"""All measurements of a calibration together: one vector of unknowns, one stack of rows.

Source: Seed book section 1.4.5.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt
from ..errors import InvalidValueError, ShapeError
from .differential import differential_model
from .expected_joints import expected_joints_text
from .measurements import Evaluation, Fixture, Linearised, Measurement, PointContact
from .measurements.noise import whitened
from .parameters import GeometricParameters


@dataclass(frozen=True, slots=True, eq=False)
class Problem(Rebuilt):
    """Parameters, measurements and their fixtures. The unknowns are [parameters, fixtures].

    Parameters
    ----------
    parameters : GeometricParameters
        P parameters of the robot.
    measurements : tuple of Measurement
        What was measured.
    fixtures : tuple of Fixture
        F unknowns of the measurements, each name once.
    factors : tuple
        For each measurement and view, ``parameters.factors(q)``.

    Examples
    --------
    >>> from robotmodels.calibration import Position, candidate_parameters
    >>> from robotmodels.robots import load
    >>> measured = Position(np.zeros((4, 6)), np.zeros((4, 3)))
    >>> problem_of(candidate_parameters(load("rx90")), [measured]).rows
    12
    """

    parameters: GeometricParameters
    measurements: tuple[Measurement, ...]
    fixtures: tuple[Fixture, ...]
    factors: tuple[tuple[Array, ...], ...]

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
    def block(self) -> NDArray[np.int64]:
        """Number of the block of each row, counted through all measurements, shape (M,)."""
        parts, first = [], 0
        for m in self.measurements:
            parts.append(np.repeat(np.arange(first, first + m.blocks), len(m.axes)))
            first += m.blocks
        return np.concatenate(parts)

    @property
    def blocks(self) -> int:
        """Number of blocks of all measurements."""
        return sum(m.blocks for m in self.measurements)

    @property
    def sees_base(self) -> bool:
        """Whether some measurement sees where the robot stands."""
        return any(m.sees_base for m in self.measurements)

    def columns(self, measurement: Measurement) -> NDArray[np.int64]:
        """Where the fixtures of a measurement are among all, shape (its F,)."""
        number = {fixture.name: k for k, fixture in enumerate(self.fixtures)}
        return np.array([number[fixture.name] for fixture in measurement.fixtures], dtype=np.int64)


def problem_of(
    parameters: GeometricParameters, measurements: Measurement | Iterable[Measurement]
) -> Problem:
    """Put measurements together.

    Parameters
    ----------
    parameters : GeometricParameters
        Of the robot; made for every end that is measured.
    measurements : iterable of Measurement
        One or more.

    Returns
    -------
    Problem
        Of the measurements as they are.

    Raises
    ------
    InvalidValueError, ShapeError
        No measurement, something else; readings of another robot; a fixture with two units.

    Examples
    --------
    >>> from robotmodels.calibration import PointContact, candidate_parameters
    >>> from robotmodels.robots import load
    >>> touched = PointContact(np.zeros((4, 6)), ["a", "a", "b", "b"])
    >>> problem_of(candidate_parameters(load("rx90")), [touched]).F
    6
    """
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
            if fixtures.setdefault(fixture.name, fixture).unit != fixture.unit:
                raise InvalidValueError(
                    f"fixture {fixture.name!r} is in m for one measurement and rad for another."
                )
    return Problem(
        parameters, measurements, tuple(fixtures.values()), _factors(parameters, measurements)
    )


def as_measurements(
    measurements: Measurement | Iterable[Measurement], name: str = "measurements"
) -> tuple[Measurement, ...]:
    """Check measurements: one or several."""
    if isinstance(measurements, Measurement):
        return (measurements,)
    found = tuple(measurements)
    if not found:
        raise InvalidValueError(f"{name}: expected one or more, got none.")
    for k, m in enumerate(found):
        if not isinstance(m, Measurement):
            raise InvalidValueError(
                f"{name}[{k}]: expected Pose, Position, PointContact or another kind of "
                f"measurement, got {type(m).__name__}."
            )
    return found


def _factors(
    parameters: GeometricParameters, measurements: tuple[Measurement, ...]
) -> tuple[tuple[Array, ...], ...]:
    return tuple(tuple(parameters.factors(view.q) for view in m.views) for m in measurements)


def measured_frames(measurements: Iterable[Measurement]) -> tuple[str | int | None, ...]:
    """Ends that measurements see, each once."""
    return tuple(dict.fromkeys(view.frame for m in measurements for view in m.views)) or (None,)


def evaluations(problem: Problem, xi: Array) -> list[list[Evaluation]]:
    """Poses and Psi of every view of every measurement. Shapes: xi (P,)."""
    return [
        [
            Evaluation(*differential_model(problem.parameters, view.q, xi, view.frame, factor))
            for view, factor in zip(m.views, factors, strict=True)
        ]
        for m, factors in zip(problem.measurements, problem.factors, strict=True)
    ]


def guessed_fixtures(problem: Problem, xi: Array) -> Array:
    """Initial values of all fixtures. Shapes: xi (P,) -> (F,)."""
    values = np.full(problem.F, np.nan)
    for m, seen in zip(problem.measurements, evaluations(problem, xi), strict=True):
        guess = m.guess(seen)
        if guess is not None:
            at = problem.columns(m)
            new = np.isnan(values[at])
            values[at[new]] = guess[new]
    if np.isnan(values).any():
        pairs = zip(problem.fixtures, values, strict=True)
        names = dict.fromkeys(f.name.rsplit(".", 1)[0] for f, v in pairs if np.isnan(v))
        touched = dict.fromkeys(
            f.name.rsplit(".", 1)[0]
            for m in problem.measurements if isinstance(m, PointContact) for f in m.fixtures
        )  # fmt: skip
        raise InvalidValueError(
            f"No measurement touches {', '.join(names)}. Touched points: "
            f"{', '.join(touched) or 'none'}."
        )
    return values


def linearised(problem: Problem, xi: Array, fixtures: Array) -> list[Linearised]:
    """Residuals and derivatives of each measurement. Shapes: xi (P,), fixtures (F,)."""
    return [
        m.linearise(seen, fixtures[problem.columns(m)])
        for m, seen in zip(problem.measurements, evaluations(problem, xi), strict=True)
    ]


def stacked(problem: Problem, x: Array, scales: tuple[Array, ...]) -> tuple[Array, Array]:
    """Whitened rows of all measurements.

    Shapes: x (P + F,), scales (k,) -> residual (M,), jacobian (M, P + F).
    """
    P = problem.P
    residual = np.empty(problem.rows)
    jacobian = np.zeros((problem.rows, P + problem.F))
    first = 0
    for m, part, scale in zip(
        problem.measurements, linearised(problem, x[:P], x[P:]), scales, strict=True
    ):
        rows = slice(first, first + part.residual.size)
        first = rows.stop
        residual[rows] = whitened(m, part.residual, scale).ravel()
        if part.by_parameters.shape[-1]:
            jacobian[rows, :P] = whitened(m, part.by_parameters, scale).reshape(-1, P)
        at = problem.columns(m)
        if len(at):
            jacobian[rows, P + at] = whitened(m, part.by_fixtures, scale).reshape(-1, len(at))
    return residual, jacobian


def satisfying(problem: Problem, xi: Array, fixtures: Array) -> Problem:
    """The problem with readings moved to satisfy the constraints exactly, to judge ranks."""
    from .measurements.satisfied import satisfied_measurement

    moved = []
    for m in problem.measurements:
        if not m.is_constraint:
            moved.append(m)
            continue
        new = satisfied_measurement(problem.parameters, m, xi, fixtures[problem.columns(m)])
        if new is not None:
            moved.append(new)
    measurements = tuple(moved)
    return replace(
        problem, measurements=measurements, factors=_factors(problem.parameters, measurements)
    )
