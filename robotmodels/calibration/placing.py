"""The nominal robot where it stands best, with the tool that suits it best: where a fit begins."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from ..model import RobotModel
from .candidates import candidate_parameters
from .errors_seen import BlockErrors, block_errors
from .identifiable import identifiable_on
from .measurements import Measurement
from .parameters import ErrorLaw, GeometricParameters
from .problem import problem_of
from .registration import registered
from .robot import calibrated_model
from .solve import first_scales, solve

_ROUGH = 1e-6


class PlacedRobot(NamedTuple):
    """A robot with fitted base and tool."""

    model: RobotModel
    errors: BlockErrors


def placed_robot(
    candidates: GeometricParameters, measured: Sequence[Measurement], fixed: Collection[str]
) -> PlacedRobot | None:
    """Fit base and tool alone (seed book, section 1.4.4.3)."""
    model = candidates.model

    def of_place(parameters: GeometricParameters) -> list[str]:
        f = model.f
        names = [
            e.name for e in parameters.entries
            if e.law is ErrorLaw.CONSTANT and (e.row == 0 or e.row > f)
        ]  # fmt: skip
        return [name for name in names if name not in fixed and name in candidates.names]

    names = of_place(candidates)
    if not names:
        return None
    rows = {candidates.entries[k].row for k in candidates.index(names)}
    if not fixed:
        start = registered(model, measured, base=0 in rows, tool=any(rows - {0}))
        model = with_gravity_kept(start, model)
    frames = candidates.skeleton.frames
    for _ in range(2):  # once more, as a tool off the last axis tells more than one on it
        few = candidate_parameters(model, frames).subset(names)
        found = identifiable_on(few, measured, scale_is_known=True)
        if not len(found.kept):
            return None
        problem = problem_of(found.kept, measured)
        solution = solve(problem, scales=first_scales(problem), tolerance=_ROUGH)
        placed = calibrated_model(solution.problem.parameters, solution.deviation).model
        model = with_gravity_kept(placed, model)
        if len(found.kept) == len(names):
            break
    errors = block_errors(solution.problem, solution.deviation, solution.fixtures)
    return PlacedRobot(model, errors)


def with_gravity_kept(placed: RobotModel, model: RobotModel) -> RobotModel:
    """Robot with another base and the gravity of the old one in R_0."""
    turned = placed.base[:3, :3] @ model.base[:3, :3].T @ model.gravity
    return placed.with_gravity(turned)
