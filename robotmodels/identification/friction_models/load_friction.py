"""Dry friction that grows with the load of the gears, found with the parameters of the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, read_only
from ..._outcomes import Outcome
from ...friction import LoadFriction
from ...inertia import PARAMETERS
from ...logs import Log
from ...minimal_parameters import BaseParameters
from ...model import RobotModel, check_model
from ..equations import Equations, equations
from ..preparation.processing import Processing, choose_processing
from .curves import (
    Fitted,
    OwnColumns,
    OwnEquations,
    chosen_factors,
    fitted,
    own_covariance,
    own_noise,
)
from .stribeck import with_dry_friction

_ITERATIONS = 30
_STILL = 1e-10
_SMALL = 1e-3
"""Step relative to the deviations."""
_SURE = 3.0
_STARTS = (0.0, 0.1)
_HELD = 3


class LoadFrictionStatus(Outcome):
    """What became of load-dependent friction.

    Examples
    --------
    >>> int(LoadFrictionStatus.SOLVED)
    0
    """

    SOLVED = 0, "The parameters solve the equations best."
    NOT_CONVERGED = 1, "The iterations ended before the parameters stood still."


@dataclass(frozen=True, slots=True, eq=False)
class LoadFrictionFit(Rebuilt):
    """Friction by load, of each joint. Read-only.

    Parameters
    ----------
    base : BaseParameters
        Of the robot, with viscous and Coulomb friction.
    values, deviations : ndarray, shape (b,)
        Of these, SI units.
    Fl, Fl_deviations : ndarray, shape (n,)
        Part of the load that friction takes.
    seen : ndarray of bool, shape (n,)
        Positive by more than three deviations.
    sigma : ndarray, shape (n,)
        Deviation of the residuals, N m or N.
    iterations : int
        Of Gauss-Newton.
    status : LoadFrictionStatus
        What became of it.
    """

    base: BaseParameters
    values: Array
    deviations: Array
    Fl: Array
    Fl_deviations: Array
    seen: NDArray[np.bool_]
    sigma: Array
    iterations: int
    status: LoadFrictionStatus

    def __post_init__(self) -> None:
        for name in ("values", "deviations", "Fl", "Fl_deviations", "sigma"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        object.__setattr__(self, "seen", read_only(self.seen, np.bool_))

    @property
    def friction(self) -> LoadFriction:
        """As a model of friction by load."""
        return LoadFriction(self.Fl)

    def columns(self) -> OwnColumns:
        """What it adds to equations, see `OwnEquations`."""
        return _loads(_links(self.base), self.values)


def fit_load_friction(
    model: RobotModel,
    log: Log,
    *,
    base: BaseParameters | None = None,
    processing: Processing | None = None,
) -> LoadFrictionFit:
    """Find friction ``Fl |load| sign(v)`` of each joint with base parameters and drives.

    The load is the torque of the links' parameters, as they are identified: the measured torque
    would bring its noise and the friction itself into the columns. What cannot be told from links,
    such as the rotor inertia of a first joint, counts as load.

    Parameters
    ----------
    model : RobotModel
        The robot.
    log : Log
        Of its joints, with loads that differ.
    base : BaseParameters, optional
        With Coulomb friction; default all drive parameters.
    processing : Processing, optional
        Default what the log suggests.

    Returns
    -------
    LoadFrictionFit
        Of all joints; ``seen`` says where it is there.

    Raises
    ------
    InvalidValueError
        A log of other joints; no Coulomb friction in ``base``.

    References
    ----------
    P. Hamon, M. Gautier and P. Garrec, "Dynamic identification of robots with a dry friction model
    depending on load and velocity", IEEE/RSJ IROS 2010, section III.

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v + np.sign(v))
    >>> found = fit_load_friction(arm, log)
    >>> found.status.name
    'SOLVED'
    """
    check_model(model)
    base = with_dry_friction(model, base)
    choices = choose_processing(log) if processing is None else processing
    system = equations(base, log, choices)
    n, b = model.n, len(base)
    links = _links(base)
    one = np.zeros((n, 1), dtype=np.int64)
    start = OwnEquations(system, _loads(links, np.zeros(b)), 1).reduced()
    sigma = own_noise(start)
    plain = fitted(chosen_factors(start, b, one), sigma).values
    # where a load does not change its sign, there may be a second, worse minimum
    ways = []
    for first in _STARTS:
        theta = np.concatenate((plain[:b], np.full(n, first)))
        for _ in range(_HELD if first else 0):
            # the other parameters come to terms with this friction before it may move
            tangents = _tangents(links, theta[:b], theta[b:])
            fixed = OwnEquations(system, tangents, 1).reduced()
            theta[:b] = fitted(chosen_factors(fixed, b, one - 1), sigma).values[:b]
        ways.append(_descended(system, links, theta, sigma))
    best = min(ways, key=lambda way: way.likelihood)
    covariance = own_covariance(best.equations, best.found, best.theta, best.sigma)
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    Fl = best.theta[b:]
    return LoadFrictionFit(
        base, best.theta[:b], deviations[:b], Fl, deviations[b:], Fl > _SURE * deviations[b:],
        np.sqrt(best.found.sums / np.maximum(start.counts, 1)), best.iterations, best.status,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """Where Gauss-Newton ended from one start."""

    theta: Array
    found: Fitted
    equations: OwnEquations
    sigma: Array
    likelihood: float
    iterations: int
    status: LoadFrictionStatus


def _descended(system: Equations, links: NDArray[np.bool_], theta: Array, sigma: Array) -> _Way:
    """Gauss-Newton whose steps are halved until they improve the fit."""
    n, b = system.model.n, len(system.names)
    one = np.zeros((n, 1), dtype=np.int64)
    status, iterations, settled = LoadFrictionStatus.NOT_CONVERGED, 0, False
    before, cost, held, size = theta, np.inf, False, np.zeros(len(theta))
    while True:
        iterations += 1
        columns = _tangents(links, theta[:b], theta[b:])
        reduced = OwnEquations(system, columns, 1, theta[b:, None]).reduced()
        chosen = chosen_factors(reduced, b, one)
        # at the point itself the residuals of the tangents are those of the model
        now = float((chosen.sums(theta) / sigma**2).sum())
        if now > cost * (1.0 + 1e-9) and iterations < _ITERATIONS:
            theta = 0.5 * (theta + before)
            if (np.abs(theta - before) <= _SMALL * size).all():
                # the kinks of |load|: nothing below is found within a part of the deviations
                theta, cost, held = before, np.inf, True
            continue
        found = fitted(chosen, sigma)
        if held and settled:
            status = LoadFrictionStatus.SOLVED
            break
        moved = np.abs(found.values - theta)
        size = np.sqrt(np.diag(found.inverse)) + 1e-12 * np.abs(found.values).max()
        if held or (moved <= _STILL * size).all() or (moved <= 1e-13 * np.abs(theta).max()).all():
            if settled:
                status = LoadFrictionStatus.SOLVED
                break
            # once more with the weights of residuals in which this friction is explained
            settled, held, sigma, now = True, False, own_noise(reduced), np.inf
        if iterations == _ITERATIONS:
            break
        before, cost, theta = theta, now, found.values
    local = OwnEquations(system, columns, 1, theta[b:, None], spread=True)
    theta = theta if held else found.values
    counts = np.maximum(reduced.counts, 1)
    likelihood = float(counts @ np.log(np.maximum(found.sums / counts, 1e-300)))
    return _Way(theta, found, local, sigma, likelihood, iterations, status)


def _links(base: BaseParameters) -> NDArray[np.bool_]:
    """Which base parameters are those of links."""
    inertial = set(PARAMETERS)
    return np.array([name.rstrip("0123456789") in inertial for name in base.names], dtype=bool)


def _loads(links: NDArray[np.bool_], values: Array) -> OwnColumns:
    """``|load| sign(v)`` of given parameters."""

    def columns(W: Array, v: Array) -> tuple[Array, Array]:
        load = W @ np.where(links, values, 0.0)
        return W, (np.abs(load) * np.sign(v))[:, :, None]

    return columns


def _tangents(links: NDArray[np.bool_], values: Array, Fl: Array) -> OwnColumns:
    """The same, with what the load changes by in the columns of the links."""

    def columns(W: Array, v: Array) -> tuple[Array, Array]:
        load = W @ np.where(links, values, 0.0)
        turned = Fl * np.sign(load) * np.sign(v)
        changed = W + turned[:, :, None] * np.where(links, W, 0.0)
        return changed, (np.abs(load) * np.sign(v))[:, :, None]

    return columns
