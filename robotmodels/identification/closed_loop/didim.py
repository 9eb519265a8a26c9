"""Direct and inverse dynamic identification models: measured torque, simulated motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array
from ..equations import Block, Equations
from ..methods.estimate import EstimateStatus, Method
from ..methods.least_squares import check_count, deviations_of, solved, weights_of
from ..scale.reduction import Reduction
from .blocks import given, reduced, sandwich, simulated_blocks
from .controller import Controller
from .estimate import SimulatedEstimate
from .instrumental import first_values, ran_away, torque_sizes
from .iteration import reweighted
from .loop import ClosedLoop, closed_loop
from .simulated import RanAwayError

_PARTS = 8
"""Parts of a sample over which torques of a controller that is not known are held."""
_MEMORY = 6
"""Steps that are mixed."""
_SINGULAR = 1e10
"""Condition from which a simulated motion tells nothing of some parameters."""


@dataclass(frozen=True, slots=True, eq=False)
class DidimStep:
    """Weighted least squares on the regressor of one simulation.

    Shapes: values, deviations (b,); inverse (b, b); sigma, weights, next_weights (m,).
    """

    values: Array
    deviations: Array
    inverse: Array
    sigma: Array
    weights: Array
    next_weights: Array
    condition: float
    cost: float = 0.0


def didim(
    system: Equations,
    reduction: Reduction,
    controller: Controller | None = None,
    start: ArrayLike | None = None,
    *,
    loop: ClosedLoop | None = None,
    iterations: int = 50,
    lags: int | None = None,
) -> SimulatedEstimate:
    """Direct and inverse dynamic identification models (DIDIM): torques alone are measured.

    The controlled robot is simulated with the last parameters; weighted least squares then explain
    the measured torque by the regressor of the simulated motion. Where the log has references, the
    measured positions take no part but for the parameters to begin with.

    Parameters
    ----------
    system : Equations
        Robot, log and choices.
    reduction : Reduction
        Of these equations; for the start and the sizes of the parameters.
    controller : Controller, optional
        That of the robot; default one that is tuned to follow closely.
    start : array_like, shape (b,), optional
        Parameters to begin with; default weighted least squares.
    loop : ClosedLoop, optional
        How the robot is simulated, instead of ``controller``.
    iterations : int
        Simulations at most.
    lags : int, optional
        As for `correlated_covariance`.

    Returns
    -------
    SimulatedEstimate
        Parameters with a covariance that holds for correlated residuals.

    Raises
    ------
    InvalidValueError, ShapeError
        Fewer equations than parameters; a controller that does not fit; a friction model.

    References
    ----------
    M. Gautier, A. Janot and P.-O. Vandanjon, "A new closed-loop output error method for parameter
    identification of robot dynamics", IEEE T-CST 21(2), 2013, section III.

    Examples
    --------
    >>> from robotmodels.identification import (
    ...     Log,
    ...     choose_processing,
    ...     equations,
    ...     reduce_equations,
    ... )
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(1600)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> system = equations(base, log, choose_processing(log))
    >>> found = didim(system, reduce_equations(system))
    >>> round(float(found.values[found.names.index("Fv1")]))
    2
    """
    check_count(reduction)
    first = first_values(reduction, start)
    if loop is None:
        loop = closed_loop(system, first, controller)
        if loop is not None and controller is None:
            loop = _quicker(system, first, loop)
    if loop is None:
        return ran_away(Method.DIDIM, system, loop)
    way = loop

    def blocks(values: Array) -> Iterator[Block]:
        return (block for _, block in simulated_blocks(system, way, values))

    def advance(values: Array, weights: Array | None) -> DidimStep:
        step = weighted_step(reduced(system, blocks(values)), values, weights)
        if not step.condition < _SINGULAR:  # so far astray is no motion of this log
            raise RanAwayError
        return step

    ended = reweighted(first, advance, torque_sizes(reduction), iterations, memory=_MEMORY)
    last = ended.last
    if last is None or ended.status is EstimateStatus.UNSTABLE:
        return ran_away(Method.DIDIM, system, loop, ended.iterations)
    equations = given(system, lambda: blocks(ended.values))
    spread = sandwich(equations, ended.values, last.weights, last.inverse, lags)
    notes = loop.notes
    if ended.status is not EstimateStatus.SOLVED:
        notes = (
            *notes,
            ended.status.sentence,
            "A simulated motion that changes more with the parameters than the torques tell (a "
            "joint of little inertia under friction, for instance) lets this iteration wander: "
            "take instrumental variables, which use the measured motion too.",
        )
    return SimulatedEstimate(
        Method.DIDIM, system.names, ended.values, spread.covariance, last.sigma, ended.status,
        ended.iterations, notes, last.deviations, spread.lags, last.condition, 1.0, loop,
    )  # fmt: skip


def _quicker(system: Equations, values: Array, loop: ClosedLoop) -> ClosedLoop:
    """The loop of a controller that is not known, with torques held for a part of a sample only.

    A torque that is held lags by half of its period. What nobody knows of the robot's own
    controller must not make the simulated one late, which would be taken for inertia and friction.
    """
    own = loop.controller
    quick = Controller(
        own.kp, own.kd, own.ki, own.limit, own.feed_forward, system.log.dt / _PARTS
    )  # fmt: skip
    found = closed_loop(system, values, quick)
    if found is None:
        return loop
    note = (
        f"Its torques are held for one of {_PARTS} parts of a sample. DIDIM explains torques by a "
        "motion that it simulates: without the robot's own controller and references (q_ref of the "
        "log) its deviations do not hold what the simulated controller does otherwise."
    )
    return replace(found, notes=(*loop.notes, note))


def weighted_step(found: Reduction, values: Array, weights: Array | None) -> DidimStep:
    """Weighted least squares on the equations of one simulation."""
    check_shown(found)
    if weights is None:
        weights = weights_of(deviations_of(found, values), found)
    solution, inverse, rest = solved(found, weights)
    scale = rest / max(found.rows - len(values), 1)
    sigma = deviations_of(found, solution)
    R, _, _ = found.stacked(weights)
    return DidimStep(
        solution, np.sqrt(np.maximum(scale * np.diag(inverse), 0.0)), inverse, sigma, weights,
        weights_of(sigma, found), float(np.linalg.cond(R / np.linalg.norm(R, axis=0))),
    )  # fmt: skip


def check_shown(found: Reduction) -> None:
    """Refuse equations in which a parameter takes no part."""
    from ...errors import InvalidValueError

    shown = np.any([R[:, :-1].any(axis=0) for R in found.factors], axis=0)
    if not shown.all():
        missing = ", ".join(found.names[k] for k in np.flatnonzero(~shown))
        raise InvalidValueError(
            f"log: nothing of the simulated motion shows {missing}; its joints do not leave the "
            "dead band. Give a smaller dead_band=, or drop these parameters."
        )
    check_count(found)
