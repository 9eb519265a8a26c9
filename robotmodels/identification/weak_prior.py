"""Shrinkage by a weak prior, scaled by the measured torques.

Source: C. Morris, "Parametric empirical Bayes inference", J. American Statistical Association 78,
1983.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..estimation.estimate import Estimate
from ..estimation.factor import TriangularFactors
from ..estimation.linear import first_weights, ridge
from ..geometry import PRISMATIC
from ..minimal_parameters import BaseParameters
from ..regressors import torque_regressor

_WEAK = 0.15
"""Least standard error, relative to the plausible size, of a poorly determined parameter."""
_NAMED = 8
_ALIKE = (("M", "MX", "MY", "MZ"), ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "Ia", "Iam"))
"""Parameter kinds with a common scale; every other kind has a separate scale."""
_SCALES = np.logspace(-2.5, 1.5, 17)
_ROUNDS = 3
_SAMPLES = 200
_LEAST = 0.01  # least torque of a considered joint, relative to the largest of the same unit


def plausible_sizes(
    base: BaseParameters, names: tuple[str, ...], q: Array, v: Array, a: Array, tau: Array
) -> Array:
    """Standard deviations (b,) of a prior around zero, from measured q, v, a and tau (N, n).

    A parameter of this size alone gives the measured torque at the joint with its largest effect,
    on a random motion as fast as the log.
    """
    model = base.model
    slides = np.asarray(model.table.sigma[model.table.joint_rows] == PRISMATIC)
    speed, rate, size = (np.sqrt(np.mean(x**2, axis=0)) for x in (v, a, tau))
    for kind in (slides, ~slides):
        if kind.any():
            speed[kind], rate[kind] = speed[kind].max(), rate[kind].max()
            size[kind] = np.maximum(size[kind], _LEAST * size[kind].max())
    rng, shape, span = np.random.default_rng(0), (_SAMPLES, model.n), np.ptp(q, axis=0)
    lower = np.maximum(model.lower, np.where(slides, q.min(axis=0) - span, -np.pi))
    upper = np.minimum(model.upper, np.where(slides, q.max(axis=0) + span, np.pi))
    postures = rng.uniform(lower, np.maximum(lower, upper), shape)
    motion = postures, speed * rng.normal(size=shape), rate * rng.normal(size=shape)
    W = torque_regressor(model, *motion, base.drive, columns=names, friction=base.friction)
    given = np.sqrt(np.mean(W**2, axis=0)) / np.where(size > 0.0, size, np.inf)[:, None]
    most = given.max(axis=0)
    return 1.0 / np.where(most > 0.0, most, 1.0)


def shrunk(
    factors: TriangularFactors,
    estimate: Estimate,
    standard_errors: Array,
    inflation: Array,
    sizes: Array,
    always: bool = False,
) -> Estimate | None:
    """Shrink an estimate towards zero where the log determines some parameters poorly."""
    weak = np.flatnonzero(standard_errors > _WEAK * sizes)
    if not (weak.size or always):
        return None
    correlated = max(1.0, float(np.median(inflation)))
    R, y, _ = factors.stacked(first_weights(factors) / correlated)
    kinds = [name.rstrip("0123456789") for name in factors.names]
    alike = {kind: group[0] for group in _ALIKE for kind in group}
    _, groups = np.unique([alike.get(kind, kind) for kind in kinds], return_inverse=True)
    shrunk_values = ridge(factors, None, _likely_sizes(R, y, sizes, groups), correlated**2)
    order = weak[np.argsort(-(standard_errors / sizes)[weak])]
    names = ", ".join(factors.names[k] for k in order[:_NAMED])
    poor = f"{len(weak)} of {len(factors.names)} parameters are poorly determined ({names})"
    note = (
        f"Shrinkage: {poor if weak.size else 'equations are few, or it was requested'}. All were "
        "estimated with a weak prior around zero, which hardly changes well-determined ones; the "
        "standard errors assume this prior. Wls(shrinkage=False) switches it off; a more exciting "
        "motion makes it unnecessary."
    )
    return replace(shrunk_values, status=estimate.status, notes=(*estimate.notes, note))


def _likely_sizes(R: Array, y: Array, sizes: Array, groups: NDArray[np.int64]) -> Array:
    """Sizes scaled group by group so that ``y = R x + white noise`` has the highest likelihood."""
    from scipy.linalg import cho_factor, cho_solve

    def unlikely(scales: Array) -> float:
        A = R * (sizes * scales[groups])
        factor = cho_factor(A @ A.T + np.eye(len(A)), lower=True, check_finite=False)
        half = 2.0 * np.log(np.diag(factor[0])).sum()
        return float(half + y @ cho_solve(factor, y, check_finite=False))

    scales = np.full(int(groups.max()) + 1, 0.3)
    for _ in range(_ROUNDS):
        for g in range(len(scales)):
            tried = np.repeat(scales[None], len(_SCALES), axis=0)
            tried[:, g] = _SCALES
            scales = tried[int(np.argmin([unlikely(x) for x in tried]))]
    return sizes * scales[groups]
