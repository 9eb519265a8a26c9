"""Proof that a joint path passes no singular position, by a bound on the least singular value.

A singular value changes by at most the norm of the change of the matrix. Each column of the
derivative of the Jacobian by a joint is a product of axes and levers, so that its length is at
most the lever: the lengths of the links from the axis on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..igm.loop import joint_chain
from ..kinematics import jacobian
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel

_EVALUATIONS = 200000
_SLACK = 1e-12  # of singular values by rounding
_KEPT = 0.25  # of the smaller end that the bound of a piece must keep


class Bound(NamedTuple):
    """Rows of the task, the length of a radian (m), slopes (n,) of the least singular value."""

    model: RobotModel
    rows: NDArray[np.bool_]
    columns: NDArray[np.int64]
    length: float
    slopes: Array

    def least(self, q: Array) -> Array:
        """Least singular values (N,) of the task's rows, linear ones over the length."""
        J = jacobian(self.model, q)[:, self.rows][..., self.columns]
        weights = np.repeat((1.0 / self.length, 1.0), 3)[self.rows]
        return np.asarray(np.linalg.svd(J * weights[:, None], compute_uv=False)[:, -1], float)


def bound_of(model: RobotModel, rows: NDArray[np.bool_], strokes: Array | None = None) -> Bound:
    """The bound for a task; ``strokes`` are the largest absolute values (n,) of slides.

    For whole poses the tool is left off: where it is does not change what is singular.
    """
    if rows.all():
        model = model.with_tool(np.eye(4))
    chain = joint_chain(model)
    k, D, sigma = chain.k, chain.D, chain.sigma
    slides = np.zeros(k) if strokes is None else np.where(sigma == 1, strokes[chain.columns], 0.0)
    links = np.linalg.norm(D[1:, :3, 3], axis=1) + np.append(slides[1:], 0.0)
    # greatest distance of the tool from each axis: along the axis the first link does not count
    levers = np.array([
        np.hypot(*D[j + 1, :2, 3]) + (slides[j + 1] if j + 1 < k else 0.0) + links[j + 1 :].sum()
        for j in range(k)
    ])  # fmt: skip
    length = characteristic_length(model)
    squares = np.zeros(model.n)
    for i in range(k):
        for j in range(k):
            near, far = min(i, j), max(i, j)
            if sigma[near] == 1:
                continue  # a slide of an axis nearer the base moves no axis and no lever
            linear = 1.0 if sigma[far] == 1 else levers[far]
            turned = float(i < j and sigma[j] == 0)
            squares[chain.columns[i]] += (linear / length) ** 2 * rows[:3].any()
            squares[chain.columns[i]] += turned * rows[3:].any()
    return Bound(model, rows, chain.columns, length, np.sqrt(squares))


def certified(bound: Bound, path: Array) -> float:
    """Lower bound of the least singular value along a polyline (N, n); 0 if there is no proof."""
    a, b = path[:-1], path[1:]
    low, high = bound.least(a), bound.least(b)
    margin, spent = np.inf, len(path)
    while True:
        fall = np.abs(b - a) @ bound.slopes
        between = 0.5 * (low + high - fall)
        ends = np.minimum(low, high)
        if ends.size and not ends.min() > _SLACK:
            return 0.0
        done = between >= _KEPT * ends
        margin = min(margin, float(between[done].min(initial=np.inf)))
        if done.all():
            return max(margin - _SLACK, 0.0)
        spent += int((~done).sum())
        if spent > _EVALUATIONS:
            return 0.0
        a, b, low, high = a[~done], b[~done], low[~done], high[~done]
        middle = 0.5 * (a + b)
        value = bound.least(middle)
        a, b = np.concatenate((a, middle)), np.concatenate((middle, b))
        low, high = np.concatenate((low, value)), np.concatenate((value, high))
