"""Signs, order and unit of joints: hypotheses judged by the equations of all joints at once.

Source: Q. H. Vuong, "Likelihood ratio tests for model selection and non-nested hypotheses",
Econometrica 57(2), 1989.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...friction import Friction
from ...geometry import PRISMATIC
from ...model import RobotModel
from ...regressors import torque_regressor
from .delay_rows import FilteredSamples, shared_motors

_LIKELY, _CERTAIN = np.log(2.0), np.log(3.0)
"""Logarithms of the factors by which the residual variance of each joint concerned falls, in the
mean, where a hypothesis is doubtful or certain: less is within what errors of the model explain."""
_CYCLES, _SLOW = 6, 0.05
"""Reversals of a joint, at more than this part of its speed, below which a motion is too short for
a certain hypothesis."""
_HALF = 0.5
"""Part of the variance left of the torques concerned, relative to the log as given, of a certain
hypothesis at most."""
_SIGNIFICANT = 4.0
"""Standard errors by which the mean difference of the log-likelihoods must be positive."""
_BLOCKS = 20
"""Blocks of time whose mean log-likelihoods are taken as independent."""
_FLOOR = 1e-6
"""Residual variance relative to the torque's, below which fits count as equally good."""
_WEIGHTINGS = 4
_RIDGE = 1e-10
_NOTHING = 1e-9
_REVERSAL = 0.25
"""Periods of the filter's cutoff over which it spreads a reversal."""
_TURN = 2.0 * np.pi
"""Position that a joint must pass for degrees to be a hypothesis."""
_LIMITED = (0, 3, 5, 9)
"""Second moments and mass, where XX YY ZZ of a link are replaced by the second moments."""


@dataclass(frozen=True, slots=True, eq=False)
class JointSamples:
    """Filtered samples at which all joints' equations are compared. Shapes: q, v, a, tau (T, n)."""

    q: Array
    v: Array
    a: Array
    tau: Array
    cutoff: float

    @classmethod
    def of(cls, x: FilteredSamples) -> JointSamples:
        """Thinned rows of a filtered log."""
        q, v, a, tau = (values[x.places] for values in (x.q, x.v, x.a, x.tau))
        return cls(q, v, a, tau, x.cutoff)

    def read_as(self, hypothesis: Hypothesis) -> JointSamples:
        """Samples as a hypothesis reads them."""
        position, torque = hypothesis.position.T, hypothesis.torque.T
        return replace(
            self, q=self.q @ position, v=self.v @ position, a=self.a @ position,
            tau=self.tau @ torque,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """Hypothesis of flipped or swapped joints, and how well it fits.

    Shapes: position, torque (n, n).
    """

    joints: tuple[int, ...]
    position: Array
    torque: Array
    certain: bool
    left: float
    given: float
    significance: float

    @property
    def changes(self) -> tuple[bool, bool]:
        """Whether positions and torques are changed."""
        unit = np.eye(len(self.torque))
        return not np.array_equal(self.position, unit), not np.array_equal(self.torque, unit)

    @property
    def is_unit(self) -> bool:
        """Whether positions are in another unit."""
        size = np.abs(self.position)
        return bool((size[size > 0.0] != 1.0).any())


def better_hypotheses(
    samples: JointSamples, model: RobotModel, position_dependent: Friction | None = None
) -> tuple[Hypothesis, ...]:
    """Joint hypotheses that fit significantly better than the log as given, best first."""
    unit = np.eye(model.n)
    many = _reversals(samples.v) >= _CYCLES
    given = _Fit(samples, model, unit, position_dependent)
    base = given.constrained(unit)
    found: list[tuple[float, Hypothesis]] = []
    for position, torques in _readings(model, samples.q):
        same = np.array_equal(position, unit)
        fit = given if same else _Fit(samples, model, position, position_dependent)
        for joints, torque in torques:
            least = min(len(joints), 2) * _LIKELY
            # without limits it fits at least as well
            if fit.free(torque, base).gain(base) < least:
                continue
            other = fit.constrained(torque)
            gain, significance = other.gain(base), other.significance(base)
            left, before = (r.left(joints) for r in (other, base))
            # what other joints gain by it is no reason to turn this one
            if gain >= least and significance > _SIGNIFICANT and left < before:
                certain = gain >= min(len(joints), 2) * _CERTAIN and many and left < _HALF * before
                hypothesis = Hypothesis(
                    joints, position, torque, certain, left, before, significance
                )
                found.append((gain, hypothesis))
    found.sort(key=lambda pair: -pair[0])
    return tuple(hypothesis for gain, hypothesis in found if gain > found[0][0] - _LIKELY)


def _reversals(v: Array) -> int:
    """How often the joint that reverses most does so, its slowest motion left out."""
    found = 0
    for x in v.T:
        signs = np.sign(x[np.abs(x) > _SLOW * np.abs(x).max(initial=0.0)])
        found = max(found, int((np.diff(signs) != 0.0).sum()))
    return found


def _readings(
    model: RobotModel, q: Array
) -> Iterator[tuple[Array, list[tuple[tuple[int, ...], Array]]]]:
    """Matrices of the positions, each with joints concerned and matrices of the torques."""
    n = model.n
    unit = np.eye(n)
    changes: list[tuple[tuple[int, ...], Array]] = [
        ((j,), unit - 2.0 * np.diag(unit[j])) for j in range(n)
    ]
    for pair in combinations(range(n), 2):
        order = np.arange(n)
        order[list(pair)] = pair[::-1]
        changes.append((pair, unit[order]))
    every = [(tuple(range(n)), -unit)] if n > 1 else []
    yield unit, [*changes, *every]
    for joints, change in changes:
        yield change, [(joints, unit), (joints, change)]
    turning = model.table.sigma[model.table.joint_rows] != PRISMATIC
    if (np.abs(q[:, turning]) > _TURN).any():
        degrees = np.diag(np.where(turning, np.pi / 180.0, 1.0))
        yield degrees, [(tuple(np.flatnonzero(turning).tolist()), unit)]


@dataclass(frozen=True, slots=True, eq=False)
class _Residuals:
    """Residuals of all joints, shape (T, n), their variances and those of the torques."""

    e: Array
    variances: Array
    sizes: Array

    def gain(self, base: _Residuals) -> float:
        """Logarithm of the factor by which the product of the variances is less than another's."""
        return float(np.log(base.variances).sum() - np.log(self.variances).sum())

    def significance(self, base: _Residuals) -> float:
        """Mean difference of the log-likelihoods over its standard error."""
        own, other = (
            -0.5 * (np.log(r.variances) + r.e**2 / r.variances).sum(axis=1) for r in (self, base)
        )
        blocks = np.array_split(own - other, min(_BLOCKS, len(self.e)))
        means = np.array([block.mean() for block in blocks])
        error = means.std(ddof=1) / np.sqrt(len(means)) if len(means) > 1 else np.inf
        return float(means.mean() / max(error, 1e-300))

    def left(self, joints: tuple[int, ...]) -> float:
        """Mean part of the variance that is left of the torques of joints."""
        at = list(joints)
        return float((self.variances[at] / np.maximum(self.sizes[at], 1e-300)).mean())


class _Fit:
    """Least squares of the equations of all joints, positions through a matrix."""

    def __init__(
        self,
        samples: JointSamples,
        model: RobotModel,
        position: Array,
        position_dependent: Friction | None,
    ) -> None:
        q, v, a = (x @ position.T for x in (samples.q, samples.v, samples.a))
        W, limited = _columns(model, (q, v, a), samples.cutoff, position_dependent)
        size = np.sqrt(np.einsum("tnp,tnp->p", W, W))
        seen = np.flatnonzero(size > _NOTHING * size.max(initial=0.0))
        order = seen[np.argsort(limited[seen], kind="stable")]
        self.free_columns = int((~limited[order]).sum())
        self.W = np.ascontiguousarray((W[:, :, order] / size[order]).transpose(1, 0, 2))
        self.tau = samples.tau
        transposed = self.W.transpose(0, 2, 1)
        self.grams, self.moments = transposed @ self.W, transposed @ self.tau

    def free(self, torque: Array, near: _Residuals) -> _Residuals:
        """Residuals of least squares without limits, weighted by those of a fit that is near."""
        start = near.variances / np.maximum(near.sizes, 1e-300)
        return self._residuals(torque, self.W.shape[2], start, 2)

    def constrained(self, torque: Array) -> _Residuals:
        """Residuals of least squares without negative masses, rotors and friction."""
        return self._residuals(torque, self.free_columns)

    def _residuals(
        self, torque: Array, free: int, start: Array | float = 1.0, weightings: int = _WEIGHTINGS
    ) -> _Residuals:
        y = self.tau @ torque.T
        moments = np.einsum("jpk,jk->jp", self.moments, torque)
        sizes = y.var(axis=0)
        floor = np.maximum(_FLOOR * sizes, 1e-300)
        e, variances = y, np.maximum(start * sizes, floor)
        for _ in range(weightings):
            weights = 1.0 / variances
            x = _solved(np.tensordot(weights, self.grams, 1), weights @ moments, free)
            e = y - (self.W @ x).T
            variances = np.maximum((e**2).mean(axis=0), floor)
        return _Residuals(e, variances, sizes)


def _solved(A: Array, b: Array, free: int) -> Array:
    """Solution of normal equations whose unknowns after the first are not negative."""
    from scipy.linalg import cholesky, solve_triangular
    from scipy.optimize import nnls

    if not len(A):
        return b
    scale = np.sqrt(np.diag(A))
    R = cholesky(A / np.outer(scale, scale) + _RIDGE * np.eye(len(A)), check_finite=False)
    c = solve_triangular(R, b / scale, trans=1, check_finite=False)
    x = np.zeros(len(A))
    if free < len(A):
        x[free:] = nnls(R[free:, free:], c[free:])[0]
    if free:
        rest = c[:free] - R[:free, free:] @ x[free:]
        x[:free] = solve_triangular(R[:free, :free], rest, check_finite=False)
    return x / scale


def _columns(
    model: RobotModel,
    state: tuple[Array, Array, Array],
    cutoff: float,
    position_dependent: Friction | None,
) -> tuple[Array, NDArray[np.bool_]]:
    """Rows of all joints, shape (T, n, p), and which parameters cannot be negative."""
    q, v, a = state
    n, links = model.n, 10 * model.table.f
    W = torque_regressor(model, q, v, a, drive=("Ia", "Fv", "offset"), friction=position_dependent)
    bodies = W[:, :, :links].reshape(len(q), n, -1, 10)
    XX, YY, ZZ = (bodies[..., k].copy() for k in (0, 3, 5))
    # XX = Lyy + Lzz and so on: second moments Lxx, Lyy, Lzz of a body are not negative
    bodies[..., 0], bodies[..., 3], bodies[..., 5] = YY + ZZ, XX + ZZ, XX + YY
    steps = _dry_friction(model, v, a, cutoff)
    elastic = (q - q.mean(axis=0))[:, :, None] * np.eye(n)
    limited = np.zeros(W.shape[2] + steps.shape[2] + n, dtype=bool)
    limited[:links] = np.isin(np.arange(links) % 10, _LIMITED)
    limited[links : links + 2 * n] = True
    limited[W.shape[2] : W.shape[2] + n] = True
    return np.concatenate([W, steps, elastic], axis=2), limited


def _dry_friction(model: RobotModel, v: Array, a: Array, cutoff: float) -> Array:
    """Columns of Coulomb friction of joints and of motors that they share, shape (T, n, n + k).

    Readings change velocities sample by sample, so that the step at a reversal is not filtered but
    drawn out over as long.
    """
    weights = np.concatenate([np.eye(model.n), shared_motors(model)])
    speed, rate = v @ weights.T, a @ weights.T
    near = _REVERSAL / cutoff * np.sqrt((rate**2).mean(axis=0))
    steps = speed / np.where(near > 0.0, np.hypot(speed, near), 1.0)
    columns: Array = steps[:, None, :] * weights.T
    return columns
