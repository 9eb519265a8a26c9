"""Shrinkage by a weak prior: how large parameters may be, given the torques measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._arrays import Array
from ..geometry import PRISMATIC
from ..minimal_parameters import BaseParameters
from ..regressors import torque_regressor
from .methods.estimate import Estimate
from .methods.least_squares import ordinary, weights_of
from .methods.ridge import ridge
from .scale.reduction import Reduction

_WEAK = 0.5
"""Standard error of a parameter, in deviations of the prior, from which the prior matters."""
_NAMED = 8
_SAMPLES = 200
_LEAST = 0.01
"""Least torque of a joint that is taken into account, relative to the largest of its kind."""


def plausible_sizes(
    base: BaseParameters, names: tuple[str, ...], v: Array, a: Array, tau: Array
) -> Array:
    """Standard deviations (b,) of a prior around zero, from measured v, a and tau (N, n).

    On a random motion as fast as that of the fastest joint of its kind, a parameter would by itself
    give about the torque that was measured, at the joint where it acts most. Parameters that the
    motion shows are hardly drawn by it; those that it does not show stay small.
    """
    model = base.model
    slides = np.asarray(model.table.sigma[model.table.joint_rows] == PRISMATIC)
    speed, rate, size = (np.sqrt(np.mean(x**2, axis=0)) for x in (v, a, tau))
    for kind in (slides, ~slides):
        if kind.any():
            speed[kind], rate[kind] = speed[kind].max(), rate[kind].max()
            size[kind] = np.maximum(size[kind], _LEAST * size[kind].max())
    rng = np.random.default_rng(0)
    shape = (_SAMPLES, model.n)
    q = rng.uniform(np.maximum(model.lower, -np.pi), np.minimum(model.upper, np.pi), shape)
    W = torque_regressor(
        model, q, speed * rng.normal(size=shape), rate * rng.normal(size=shape), base.drive,
        columns=names, friction=base.friction,
    )  # fmt: skip
    given = np.sqrt(np.mean(W**2, axis=0)) / np.where(size > 0.0, size, np.inf)[:, None]
    most = given.max(axis=0)
    return 1.0 / np.where(most > 0.0, most, 1.0)


def shrunk(
    reduction: Reduction,
    estimate: Estimate,
    deviations: Array,
    inflation: Array,
    sizes: Array,
    always: bool = False,
) -> Estimate | None:
    """Shrink an estimate toward zero where the log leaves parameters less certain than the prior.

    The size of the prior relative to ``sizes`` is that of the greatest marginal likelihood
    (empirical Bayes). None where every parameter is known much better than that: then the prior
    would hardly change it.

    References
    ----------
    C. Morris, "Parametric empirical Bayes inference", J. American Statistical Association 78, 1983.
    """
    correlated = max(1.0, float(np.median(inflation)))
    R, y, _ = reduction.stacked(weights_of(ordinary(reduction).sigma, reduction) / correlated)
    U, s, _ = np.linalg.svd(R * sizes)
    z, grid = (U.T @ y) ** 2, np.logspace(-1.5, 1.5, 31)
    gain = 1.0 + (grid[:, None] * s) ** 2
    scale = float(grid[int(np.argmin((np.log(gain) + z / gain).sum(axis=1)))])
    weak = np.flatnonzero(deviations > _WEAK * scale * sizes)
    if not (weak.size or always):
        return None
    found = ridge(reduction, None, scale * sizes, correlated**2)
    order = weak[np.argsort(-(deviations / sizes)[weak])]
    names = ", ".join(reduction.names[k] for k in order[:_NAMED])
    more = f" and {len(order) - _NAMED} others" if len(order) > _NAMED else ""
    note = (
        f"Shrinkage: the log leaves {len(weak)} of {len(reduction.names)} parameters less certain "
        f"than their plausible sizes ({names}{more}); all are estimated with a weak prior around "
        "zero, which changes hardly any but these. Their standard errors hold as far as the prior "
        "does. shrinkage=False leaves the prior out; a more exciting motion makes it needless."
    )
    return replace(
        found, method=estimate.method, status=estimate.status, notes=(*estimate.notes, note)
    )
