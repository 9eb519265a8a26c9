"""Predicted error of another tool after a calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_vector
from ..errors import InvalidValueError
from ..estimation.linearised import inverse_factor
from ..se3 import skew
from .differential import differential_model
from .identifiable import Reason, all_deviations
from .parameters import ErrorLaw, GeometricParameters
from .prior import ParameterPrior, standard_deviations
from .problem import problem_of, stacked
from .robot import CalibratedRobot

if TYPE_CHECKING:
    from .result import CalibrationResult

_POSTURES = 200
"""Largest number of the measured postures that a prediction is made for."""
_LEAST_LENGTH = 0.1
"""Smallest length of the tool, relative to the size of the robot."""


class PredictedError(NamedTuple):
    """Predicted error of a tool that took no part in the calibration.

    Attributes
    ----------
    rms, largest : float
        Standard error of the tool's point, m: root mean square over postures and directions of the
        tool, and at the worst of them.
    angle : float
        Standard error of its orientation, rad, root mean square.
    nominal : float
        Distance between the nominal and the calibrated robot for the same tools, m, rms.
    length : float
        Distance of the tool's point from the last frame of the table, m.

    Examples
    --------
    >>> PredictedError(2e-4, 5e-4, 1e-3, 4e-3, 0.15).rms
    0.0002
    """

    rms: float
    largest: float
    angle: float
    nominal: float
    length: float


def other_tool_error(
    result: CalibrationResult, q: ArrayLike | None = None, length: float | None = None
) -> PredictedError:
    """Predicted error of another tool whose pose on the flange is known.

    Corrections that do not move the measured tool can move another. The covariance of the fit, and
    the default prior of parameters that were not estimated, are propagated to other tools. If the
    measurements do not determine the base, a rigid motion is fitted to the error.

    Parameters
    ----------
    result : CalibrationResult
        Of `fit`.
    q : array_like, shape (N, n), optional
        Readings of the joints at which the tool works, rad or m; default those of the measurements.
    length : float, optional
        Distance of the tool's point from the last frame, m; default that of the present tool, and
        at least a tenth of the robot's size. Tools point along the six half-axes of the frame.

    Returns
    -------
    PredictedError
        Standard errors: the error exceeds them in about one case of three.

    Raises
    ------
    ShapeError, InvalidValueError
        Not N rows of n finite numbers; a length that is not positive.

    References
    ----------
    Seed book section 1.4.4.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> arm, rng = rm.load("rx90"), np.random.default_rng(0)
    >>> q = rng.uniform(-1.5, 1.5, (40, 6))
    >>> p = rm.dgm(arm, q)[:, :3, 3] + 1e-4 * rng.normal(size=(40, 3))
    >>> result = calibration.fit(arm, calibration.Position(q, p), folds=0, held_out=0.0)
    >>> found = other_tool_error(result)      # the positions of a point on the last axis
    >>> found.rms > 3e-4, found.length
    (True, 0.1)
    """
    problem = result.solution.problem
    if q is None:
        readings = [view.q for m in problem.measurements for view in m.views]
        postures = np.unique(np.concatenate(readings), axis=0)
        postures = postures[:: -(-len(postures) // _POSTURES)]
    else:
        postures = np.atleast_2d(as_vector(q, result.nominal.n, "q"))
    skeleton = result.identifiable.candidates.skeleton
    model = result.model
    if length is None:
        length = max(float(np.linalg.norm(model.tool[:3, 3])), _LEAST_LENGTH * skeleton.size)
    elif not (np.isfinite(length) and length > 0.0):
        raise InvalidValueError(f"length: expected a positive length in metres, got {length!r}.")
    parameters, factor, deviation = _posterior(result)
    if not len(parameters):  # base and tool alone were in doubt
        return PredictedError(0.0, 0.0, 0.0, 0.0, length)
    points, moved = _moved(parameters, deviation, result.robot, postures, length)
    columns = moved @ np.column_stack([factor, deviation])
    if not problem.sees_base:
        rigid = np.concatenate([np.tile(np.eye(3), (len(points), 1, 1)), -skew(points)], axis=2)
        fitted = np.linalg.lstsq(rigid.reshape(-1, 6), columns[:, :3].reshape(3 * len(points), -1))
        columns[:, :3] -= rigid @ fitted[0]
        columns[:, 3:] -= fitted[0][3:]
    squares = columns**2
    position = squares[:, :3, :-1].sum(axis=(1, 2))
    return PredictedError(
        float(np.sqrt(position.mean())), float(np.sqrt(position.max())),
        float(np.sqrt(squares[:, 3:, :-1].sum(axis=(1, 2)).mean())),
        float(np.sqrt(squares[:, :3, -1].sum(axis=1).mean())), float(length),
    )  # fmt: skip


def _posterior(result: CalibrationResult) -> tuple[GeometricParameters, Array, Array]:
    """Unknown candidates, a factor F of their covariance F F^T, and their corrections."""
    found, solution = result.identifiable, result.solution
    fit, estimated = solution.fit, solution.problem.parameters
    f = estimated.model.f
    left_out = {
        entry.name
        for entry in found.candidates.entries
        if entry.name not in estimated.names
        and (
            found.reasons.get(entry.name) in (Reason.KNOWN, Reason.GAUGE)
            or (entry.law is ErrorLaw.CONSTANT and not 0 < entry.row <= f)
        )
    }
    parameters = found.candidates.without(left_out)
    problem = problem_of(parameters, solution.problem.measurements)
    deviation = all_deviations(parameters, estimated, solution.deviation)
    _, J = stacked(problem, np.concatenate([deviation, solution.fixtures]), solution.scales)
    if not fit.sigma_known:
        J = J / max(fit.scale, 1.0)  # below 1 the data are exact
    weighted = np.sqrt(fit.weights)[:, None] * J
    information = np.zeros(J.shape[1])
    information[: problem.P] = 1.0 / standard_deviations(ParameterPrior(), problem)
    at = parameters.index(estimated.names)
    information[at] = np.sqrt(fit.prior.strength) / fit.prior.sigma[: len(at)]
    R = np.asarray(np.linalg.qr(np.vstack([weighted, np.diag(information)]), mode="r"))
    # directions without information (a tool that is not measured) move no other tool
    return parameters, inverse_factor(R)[: problem.P], deviation


def _moved(
    parameters: GeometricParameters,
    deviation: Array,
    robot: CalibratedRobot,
    q: Array,
    length: float,
) -> tuple[Array, Array]:
    """Points of six tools at N postures (6 N, 3), and how parameters move them (6 N, 6, P)."""
    frame = parameters.skeleton.frames[0]
    T, psi = differential_model(parameters, q, deviation, frame)
    end = robot.end(frame)
    assert end is not None
    tip = T @ se3.inverse(end.pose)
    axes = length * np.concatenate([np.eye(3), -np.eye(3)])
    points = tip[:, None, :3, 3] + axes @ np.swapaxes(tip[:, :3, :3], 1, 2)
    turned = psi[:, None, 3:] * (parameters.rows <= parameters.model.f)
    moved = psi[:, None, :3] * (parameters.rows <= parameters.model.f)
    moved = moved - skew(points - T[:, None, :3, 3]) @ turned
    both = np.concatenate([moved, np.broadcast_to(turned, moved.shape)], axis=2)
    return points.reshape(-1, 3), both.reshape(-1, 6, len(parameters))
