"""Singular positions of an arm: signs of the factors of the determinant, and proofs of regularity.

A singular value changes by at most the norm of the change of the matrix. Each column of the
derivative of the Jacobian by a joint is a product of axes and levers, so that its length is at
most the lever: the lengths of the links from the axis on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..igm.loop import joint_chain
from ..kinematics import jacobian
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel
from ..symbolic import explain_singularities
from .arms import Flags, Ints, section_arm, task_rows

_CHUNK = 65536
_EVALUATIONS = 200000
_SLACK = 1e-12  # of singular values by rounding
_KEPT = 0.25  # of the smaller end that the bound of a piece must keep


@dataclass(frozen=True, slots=True, eq=False)
class Factors:
    """Factors of the determinant of an arm: names, the joints (columns of q) of each, values."""

    model: RobotModel
    names: tuple[str, ...]
    joints: tuple[tuple[int, ...], ...]
    formulas: tuple[Any, ...]
    rows: Flags

    def values(self, q: Array) -> Array:
        """Values (N, k) of the factors at configurations (N, n)."""
        if self.formulas:
            return np.stack([factor.values(q) for factor in self.formulas], axis=-1)
        arm = section_arm(self.model)
        if arm is not None and not self.rows[3:].any():
            return arm.values(q[:, arm.columns[1:]])[:, 6:7]
        out = np.empty((len(q), 1))
        columns = joint_chain(self.model).columns
        for k in range(0, len(q), _CHUNK):
            J = jacobian(self.model, q[k : k + _CHUNK])[:, self.rows][..., columns]
            out[k : k + _CHUNK, 0] = np.linalg.det(J)
        return out

    def codes(self, q: Array) -> Ints:
        """Signs (N,) of all factors as one number: bit i is set where factor i is positive."""
        return np.asarray((self.values(q) > 0.0) @ (1 << np.arange(len(self.joints))))


def sign_factors(model: RobotModel, mask: ArrayLike | str | None = None) -> Factors | None:
    """Factors of the square matrix that decides; None if it is not square, or never regular."""
    rows = task_rows(model, mask)
    columns = joint_chain(model).columns
    if columns.size == 0 or (rows.sum() != columns.size and section_arm(model) is None):
        return None
    if mask is None:
        explained = explain_singularities(model)
        if explained.constant == 0.0:
            return None
        if np.isfinite(explained.constant):
            kept = tuple(f for f in explained.factors if not f.never_zero)
            names, joints = tuple(f.text for f in kept), tuple(f.joints for f in kept)
            return Factors(model, names, joints, kept, rows)
    return determinant(model, rows)


def determinant(model: RobotModel, rows: Flags | None = None) -> Factors:
    """The determinant itself as the only factor, for a task or that of the arm."""
    joints = tuple(int(c) for c in joint_chain(model).columns)
    rows = task_rows(model) if rows is None else rows
    return Factors(model, ("determinant",), (joints,), (), rows)


class Bound(NamedTuple):
    """Rows of the task, the length of a radian (m), slopes (n,) of the least singular value."""

    model: RobotModel
    rows: Flags
    columns: Ints
    length: float
    slopes: Array

    def least(self, q: Array) -> Array:
        """Least singular values (N,) of the task's rows, linear ones over the length."""
        J = jacobian(self.model, q)[:, self.rows][..., self.columns]
        weights = np.repeat((1.0 / self.length, 1.0), 3)[self.rows]
        return np.asarray(np.linalg.svd(J * weights[:, None], compute_uv=False)[:, -1], float)


def bound_of(model: RobotModel, rows: Flags, strokes: Array | None = None) -> Bound:
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
