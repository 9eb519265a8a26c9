"""Alignment of base and tool: the start of a fit, and the reference of true errors."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from .. import se3
from .._arrays import Array
from ..errors import InvalidValueError
from ..kinematics import dgm
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel
from .candidates import candidate_parameters
from .extended_table import Frame
from .identifiable import identifiable_on
from .measurements import Measurement, Pose, Position
from .measurements.motions import best_motion, nearest_rotation
from .parameters import ErrorLaw, GeometricParameters
from .problem import problem_of
from .robot import as_calibrated, calibrated_model, calibrated_pose, with_moved_tool
from .solve import ROUGH, first_scales, solve
from .validation import Errors, errors_of

_NEAR = 0.2  # mean residual, in lengths of the robot, above which base and tool are aligned first
_ALIKE = 1.0 + 2.0 * np.cos(0.5)
"""Mean trace of the rotations from nominal to measured poses below which they are too."""


def align_base_and_tool(
    candidates: GeometricParameters, measured: Sequence[Measurement], fixed: Collection[str]
) -> tuple[RobotModel, Errors] | None:
    """Robot with base and tool fitted alone, and its errors; None if they are fixed or unknown."""
    model = candidates.model
    names = [
        e.name
        for e in candidates.entries
        if e.law is ErrorLaw.CONSTANT and not candidates.is_of_table(e) and e.name not in fixed
    ]
    if not names:
        return None
    rows = {candidates.entries[k].row for k in candidates.index(names)}
    if not fixed:
        start = _kabsch_alignment(model, measured, base=0 in rows, tool=any(rows - {0}))
        model = _with_gravity_of(start, model)
    for _ in range(2):  # a tool off the last axis determines more than one on it
        few = candidate_parameters(model, candidates.table.frames).subset(names)
        kept = identifiable_on(few, measured, scale_is_known=True).kept
        if not len(kept):
            return None
        problem = problem_of(kept, measured)
        solution = solve(problem, scales=first_scales(problem), tolerance=ROUGH)
        model = _with_gravity_of(calibrated_model(kept, solution.corrections).model, model)
        if len(kept) == len(names):
            break
    return model, errors_of(problem, solution.corrections, solution.fixture_values)


def _with_gravity_of(placed: RobotModel, model: RobotModel) -> RobotModel:
    """Robot with another base and the gravity of the old one in R_0."""
    return placed.with_gravity(placed.base[:3, :3] @ model.base[:3, :3].T @ model.gravity)


def _kabsch_alignment(
    model: RobotModel, measurements: Sequence[Measurement], base: bool, tool: bool
) -> RobotModel:
    """Robot with base and tool aligned to the measured positions, where they are far off."""
    usable = [
        m
        for m in measurements
        if isinstance(m, Pose | Position) and all(m.rows[:3]) and m.frame is None
    ]
    if not usable or not (base or tool):
        return model
    measured = np.concatenate([m.T[:, :3, 3] if isinstance(m, Pose) else m.p for m in usable])
    computed = np.concatenate([dgm(model, m.q)[:, :3, 3] for m in usable])
    poses = [m for m in usable if isinstance(m, Pose) and all(m.rows)]
    turned = (dgm(model, m.q)[:, :3, :3].swapaxes(1, 2) @ m.T[:, :3, :3] for m in poses)
    error = np.mean(np.linalg.norm(measured - computed, axis=1))
    if error < _NEAR * characteristic_length(model) and all(
        np.trace(R, axis1=1, axis2=2).mean() > _ALIKE for R in turned
    ):
        return model
    if base:
        model = model.with_base(best_motion(computed, measured) @ model.base)
    if tool and poses:
        found = np.concatenate([se3.inverse(dgm(model, m.q)) @ m.T for m in poses])
        offset = found.mean(axis=0)
        offset[:3, :3] = nearest_rotation(offset[:3, :3])
        model = with_moved_tool(model, model.tool @ offset)
    return model


# --- errors relative to a known robot -------------------------------------------------------------


class TrueErrors(NamedTuple):
    """Position errors: as given, with the base fitted, and with base and tool point fitted."""

    as_given: Errors
    base_fitted: Errors
    base_and_tool_fitted: Errors


def true_errors(robot: Any, real: Any, q: ArrayLike, frame: Frame = None) -> TrueErrors:
    """Absolute accuracy: position errors of a model, calibrated robot or result of a fit.

    ``real``: the true one; ``q (N, n)``: three or more readings that the fit did not have.
    """
    poses = []
    for x in (robot, real):
        is_model = isinstance(x, RobotModel)
        T = dgm(x, q, frame) if is_model else calibrated_pose(as_calibrated(x), q, frame)
        poses.append(T.reshape(-1, 4, 4))
    if len(poses[0]) < 3:
        raise InvalidValueError(
            f"q: expected three configurations or more to fit a base, got {len(poses[0])}."
        )
    R, p, goal = poses[0][:, :3, :3], poses[0][:, :3, 3], poses[1][:, :3, 3]

    def left(point: Array) -> Array:
        at = p + R @ point
        Z = best_motion(at, goal)
        return at @ Z[:3, :3].T + Z[:3, 3] - goal

    tool = least_squares(
        lambda x: left(x).ravel(), np.zeros(3), "3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    none = np.full(len(p), np.nan)
    gaps = p - goal, left(np.zeros(3)), left(tool.x)
    return TrueErrors(*(Errors(np.linalg.norm(gap, axis=1), none) for gap in gaps))
