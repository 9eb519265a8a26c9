"""Predicted error of another tool after a calibration.

The covariance of the fit, and the default prior of parameters that were not estimated, are
propagated to other tools; if the base is unknown, a rigid motion is fitted to the error.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_vector
from ..errors import InvalidValueError
from ..estimation.linearised import inverse_factor
from ..se3 import skew
from .differential import differential_model
from .identifiable import Reason
from .parameters import ErrorLaw, GeometricParameters
from .prior import ParameterPrior, standard_deviations
from .problem import problem_of, stacked

_POSTURES = 200  # largest number of the measured postures that a prediction is made for
_LEAST_LENGTH = 0.1  # smallest length of the tool, relative to the size of the robot


class PredictedError(NamedTuple):
    """Standard errors of a tool that took no part in the calibration, m and rad."""

    rms: float  # of the tool's point, over postures and directions
    largest: float
    angle: float
    nominal: float  # rms distance between nominal and calibrated robot for the same tools
    length: float  # distance of the tool's point from the last frame of the table


def other_tool_error(
    result: Any, q: ArrayLike | None = None, length: float | None = None
) -> PredictedError:
    """Predicted error of another tool, its pose on the flange known, along the six half-axes.

    ``q (N, n)``: where it works, default as measured; ``length``: default as the present tool, m.
    """
    problem, robot = result.solution.problem, result.robot
    if q is None:
        readings = [view.q for m in problem.measurements for view in m.views]
        postures = np.unique(np.concatenate(readings), axis=0)
        postures = postures[:: -(-len(postures) // _POSTURES)]
    else:
        postures = np.atleast_2d(as_vector(q, robot.model.n, "q"))
    if length is None:
        least = _LEAST_LENGTH * problem.parameters.table.size
        length = max(float(np.linalg.norm(robot.model.tool[:3, 3])), least)
    elif not (np.isfinite(length) and length > 0.0):
        raise InvalidValueError(f"length: expected a positive length in metres, got {length!r}.")
    parameters, factor, corrections = _posterior(result)
    if not len(parameters):  # base and tool alone were unknown
        return PredictedError(0.0, 0.0, 0.0, 0.0, length)
    frame = parameters.table.frames[0]
    end = robot.end(frame)
    assert end is not None
    T, psi = differential_model(parameters, postures, corrections, frame)
    tip = T @ se3.inverse(end.pose)
    axes = length * np.concatenate([np.eye(3), -np.eye(3)])
    points = tip[:, None, :3, 3] + axes @ np.swapaxes(tip[:, :3, :3], 1, 2)
    # effects of the parameters, base and tool aside, on six tools at N postures, (6 N, 6, .)
    effects = np.column_stack([factor, corrections])
    psi = (psi * (parameters.rows <= parameters.model.f))[:, None] @ effects
    moved = psi[:, :, :3] - skew(points - T[:, None, :3, 3]) @ psi[:, :, 3:]
    turned = np.broadcast_to(psi[:, :, 3:], moved.shape)
    columns = np.concatenate([moved, turned], axis=2).reshape(-1, 6, moved.shape[-1])
    if not problem.sees_base:  # up to a rigid motion
        points = points.reshape(-1, 3)
        rigid = np.concatenate([np.tile(np.eye(3), (len(points), 1, 1)), -skew(points)], axis=2)
        fitted = np.linalg.lstsq(rigid.reshape(-1, 6), columns[:, :3].reshape(3 * len(points), -1))
        columns[:, :3] -= rigid @ fitted[0]
        columns[:, 3:] -= fitted[0][3:]
    moved, turned = ((columns[:, k : k + 3] ** 2).sum(axis=1) for k in (0, 3))
    at, angle = moved[:, :-1].sum(axis=1), turned[:, :-1].sum(axis=1)
    means = at.mean(), at.max(), angle.mean(), moved[:, -1].mean()
    rms, largest, turn, nominal = (float(np.sqrt(x)) for x in means)
    return PredictedError(rms, largest, turn, nominal, float(length))


def _posterior(result: Any) -> tuple[GeometricParameters, Array, Array]:
    """Unknown candidates, a factor F of their covariance F F^T, and their corrections."""
    identifiable, solution = result.identifiable, result.solution
    fit, estimated = solution.fit, solution.problem.parameters
    entries = identifiable.candidates.entries
    known = {*identifiable.of_reason(Reason.KNOWN), *identifiable.of_reason(Reason.GAUGE)}
    known |= {
        e.name for e in entries if e.law is ErrorLaw.CONSTANT and not estimated.is_of_table(e)
    }
    parameters = identifiable.candidates.without(known - {*estimated.names})
    problem = problem_of(parameters, solution.problem.measurements)
    at = parameters.index(estimated.names)
    corrections = np.zeros(len(parameters))
    corrections[at] = solution.corrections
    _, J = stacked(problem, np.concatenate([corrections, solution.fixtures]), solution.scales)
    if not fit.sigma_known:
        J = J / max(fit.scale, 1.0)  # below 1 the data are exact
    information = np.zeros(J.shape[1])
    information[: problem.P] = 1.0 / standard_deviations(ParameterPrior(), problem)
    information[at] = np.sqrt(fit.prior.strength) / fit.prior.sigma[: len(at)]
    rows = np.vstack([np.sqrt(fit.weights)[:, None] * J, np.diag(information)])
    # directions without information (a tool that is not measured) move no other tool
    factor = inverse_factor(np.asarray(np.linalg.qr(rows, mode="r")))
    return parameters, factor[: problem.P], corrections
