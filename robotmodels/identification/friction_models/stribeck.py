"""Stribeck friction of each joint, found with the parameters of the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Rebuilt, as_floats, read_only
from ..._outcomes import Outcome
from ...errors import InvalidValueError
from ...friction import StribeckFriction
from ...logs import Log
from ...minimal_parameters import BaseParameters, base_parameters
from ...model import RobotModel, check_model
from ...table_text import boxed
from ..correlated import correlated_covariance
from ..equations import Equations, equations
from ..preparation.processing import Processing, choose_processing
from .curves import (
    OwnColumns,
    OwnEquations,
    chosen_factors,
    fitted,
    own_covariance,
    own_noise,
)

_GRID = 16
"""Velocities that are tried of each joint."""
_ITERATIONS = 40
_STILL = 1e-9
_CHANCE = 1e-3
"""Probability of chance, below which the curve is seen."""


class StribeckStatus(Outcome):
    """What became of the search for Stribeck's curve.

    Examples
    --------
    >>> int(StribeckStatus.SOLVED)
    0
    """

    SOLVED = 0, "The curves of the joints where one is seen fit best."
    NOT_SEEN = 1, "No joint shows Stribeck's curve beyond viscous and Coulomb friction."
    NOT_CONVERGED = 2, "The velocities did not stand still; use them with care."


@dataclass(frozen=True, slots=True, eq=False)
class StribeckFit(Rebuilt):
    """Stribeck's curve of each joint, with what says whether it is there. Read-only.

    Parameters
    ----------
    base : BaseParameters
        Of the robot, with viscous and Coulomb friction.
    values, deviations : ndarray, shape (b,)
        Of these, SI units; their ``Fc`` is what is left at high velocity.
    drop : ndarray, shape (n,)
        ``Fs - Fc``, N m or N; 0 where the curve is not seen.
    vs : ndarray, shape (n,)
        Stribeck velocity, rad/s or m/s; NaN where the curve is not seen.
    exponent : ndarray, shape (n,)
        Of each joint.
    drop_deviations, vs_deviations : ndarray, shape (n,)
        Standard deviations; NaN where the curve is not seen.
    p_value : ndarray, shape (n,)
        Probability that noise alone improves the fit as much, of an F test with two parameters and
        the number of independent residuals.
    seen : ndarray of bool, shape (n,)
        Whether the curve is seen, and falls.
    sigma : ndarray, shape (n,)
        Deviation of the residuals, N m or N.
    iterations : int
        Of the search.
    status : StribeckStatus
        What became of it.
    """

    base: BaseParameters
    values: Array
    deviations: Array
    drop: Array
    vs: Array
    exponent: Array
    drop_deviations: Array
    vs_deviations: Array
    p_value: Array
    seen: NDArray[np.bool_]
    sigma: Array
    iterations: int
    status: StribeckStatus

    def __post_init__(self) -> None:
        for name in (
            "values", "deviations", "drop", "vs", "exponent", "drop_deviations", "vs_deviations",
            "p_value", "sigma",
        ):  # fmt: skip
            object.__setattr__(self, name, read_only(getattr(self, name)))
        object.__setattr__(self, "seen", read_only(self.seen, np.bool_))

    @property
    def friction(self) -> StribeckFriction:
        """The friction of all joints; without a curve where none is seen.

        Raises
        ------
        InvalidValueError
            A viscous or Coulomb friction was identified as negative.
        """
        terms = dict(zip(self.base.names, self.values.tolist(), strict=True))
        frames = [int(row) + 1 for row in self.base.model.table.joint_rows]
        Fv = np.array([terms.get(f"Fv{j}", 0.0) for j in frames])
        Fc = np.array([terms.get(f"Fc{j}", 0.0) for j in frames])
        vs = np.where(self.seen, self.vs, 1.0)
        return StribeckFriction(Fv, Fc, Fc + self.drop, vs, self.exponent)

    def columns(self) -> OwnColumns:
        """What the curve adds to equations, see `OwnEquations`."""
        return _curves(np.where(self.seen, self.vs, 1.0)[:, None], self.exponent[:, None])

    def __str__(self) -> str:
        rows = zip(
            self.drop, self.drop_deviations, self.vs, self.vs_deviations, self.exponent,
            self.p_value, strict=True,
        )  # fmt: skip
        cells = [[f"{x:.3g}" for x in row] for row in rows]
        heads = ("Fs - Fc", "deviation", "vs", "deviation of vs", "exponent", "p")
        joints = [str(j + 1) for j in range(len(cells))]
        said = ["yes" if s else "no" for s in self.seen]
        table = boxed(
            [("joint", joints), *((h, [c[k] for c in cells]) for k, h in enumerate(heads)),
             ("seen", said)]
        )  # fmt: skip
        return f"{table}\n{self.status.sentence}"


def fit_stribeck(
    model: RobotModel,
    log: Log,
    *,
    exponents: Sequence[float] = (2.0,),
    base: BaseParameters | None = None,
    processing: Processing | None = None,
) -> StribeckFit:
    """Find Stribeck's curve of each joint together with base parameters and drives.

    For a velocity and an exponent the curve is linear in what friction drops by. So all velocities
    of a grid are columns of one reduction, the best of each joint is taken, and where it improves
    the fit beyond chance, its velocity is refined by Gauss-Newton with the other parameters.

    Parameters
    ----------
    model : RobotModel
        The robot.
    log : Log
        With slow motion too: what lies in the dead band tells nothing.
    exponents : sequence of float
        That are tried, such as ``(1.0, 2.0)``.
    base : BaseParameters, optional
        With viscous and Coulomb friction; default all drive parameters.
    processing : Processing, optional
        Default what the log suggests.

    Returns
    -------
    StribeckFit
        ``print`` shows the verdict of each joint.

    Raises
    ------
    InvalidValueError
        Exponents that are not positive; a log of other joints; no Coulomb friction in ``base``.

    References
    ----------
    Seed book section 1.5.1.4; B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, Automatica
    30(7), 1994, section 2; G. Golub and V. Pereyra, "Separable nonlinear least squares: the
    variable projection method and its applications", Inverse Problems 19, 2003.

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> fit_stribeck(arm, log).seen.shape
    (2,)
    """
    check_model(model)
    powers = as_floats(exponents, "exponents").reshape(-1)
    if not powers.size or (powers <= 0.0).any():
        raise InvalidValueError(f"exponents: expected positive numbers, got {exponents!r:.60}.")
    base = with_dry_friction(model, base)
    choices = choose_processing(log) if processing is None else processing
    system = equations(base, log, choices)
    n, b = model.n, len(base)
    low, high = _range(log, choices)
    grid = low[:, None] * (high / low)[:, None] ** np.linspace(0.0, 1.0, _GRID)
    vs = np.tile(grid, len(powers))
    delta = np.repeat(powers, _GRID) * np.ones((n, 1))
    whole = OwnEquations(system, _curves(vs, delta), vs.shape[1]).reduced()
    sigma = own_noise(whole)
    none = np.full((n, 1), -1)
    plain = fitted(chosen_factors(whole, b, none), sigma)
    which = none.copy()
    for _ in range(2):
        for j in range(n):
            costs = []
            for k in range(vs.shape[1]):
                which[j, 0] = k
                sums = fitted(chosen_factors(whole, b, which), sigma).sums
                costs.append(float((sums / sigma**2).sum()))
            which[j, 0] = int(np.argmin(costs))
    first = fitted(chosen_factors(whole, b, which), sigma)
    drop = first.values[b:].copy()
    p_value = np.ones(n)
    number = independent_residuals(system, plain.values[:b], sigma, whole.counts)
    for j in range(n):
        without = which.copy()
        without[j] = -1
        worse = fitted(chosen_factors(whole, b, without), sigma).sums - first.sums
        p_value[j] = chance(float((worse / sigma**2).sum()), number[j], whole.counts[j], 2)
    seen = (p_value < _CHANCE) & (drop > 0.0)
    rows = np.arange(n), which[:, 0]
    return _refined(system, vs[rows], delta[rows], drop, p_value, seen, sigma, number, (low, high))


def with_dry_friction(model: RobotModel, base: BaseParameters | None) -> BaseParameters:
    """Base parameters with the Coulomb friction that a curve is added to."""
    if base is None:
        return base_parameters(model, drive=True)
    base.check(model)
    if not any(name.rstrip("0123456789") == "Fc" for name in base.names):
        raise InvalidValueError(
            "base: expected Fc among its parameters, to which the friction is added; ask for "
            "base_parameters(model, drive=True)."
        )
    return base


def independent_residuals(
    system: Equations, values: Array, sigma: Array, counts: NDArray[np.int64]
) -> Array:
    """Numbers of independent residuals of the joints, from the correlation of successive ones."""
    spread = correlated_covariance(
        system, values, 1.0 / sigma, np.zeros((len(values), len(values))), 0
    )
    rho = np.clip(spread.correlation, 0.0, 0.99)
    return np.maximum(counts * (1.0 - rho) / (1.0 + rho), 3.0)


def chance(gain: float, independent: float, count: int, more: int) -> float:
    """Probability that noise improves a fit by so many squared deviations, with more parameters."""
    from scipy.stats import f

    return float(f.sf(max(gain, 0.0) * independent / max(count, 1) / more, more, independent))


def _range(log: Log, choices: Processing) -> tuple[Array, Array]:
    """Velocities between which a curve can be seen, of each joint."""
    v = np.abs(np.diff(log.q, axis=0)) / log.dt if log.v is None else np.abs(log.v)
    fast = np.maximum(np.percentile(v, 95.0, axis=0), 1e-12)
    return np.minimum(np.maximum(choices.dead_band, 1e-3 * fast), 0.25 * fast), 0.5 * fast


def _curves(vs: Array, exponent: Array) -> OwnColumns:
    """``exp(-|v / vs|^exponent) sign(v)`` of velocities ``(n, c)``."""

    def columns(W: Array, v: Array) -> tuple[Array, Array]:
        with np.errstate(over="ignore", under="ignore"):
            fallen = np.exp(-((np.abs(v)[:, :, None] / vs) ** exponent))
        return W, fallen * np.sign(v)[:, :, None]

    return columns


def _tangents(vs: Array, exponent: Array, drop: Array, seen: NDArray[np.bool_]) -> OwnColumns:
    """The curve, and what it changes by with the logarithm of its velocity."""

    def columns(W: Array, v: Array) -> tuple[Array, Array]:
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            ratio = (np.abs(v) / vs) ** exponent
            fallen = np.where(ratio < 700.0, np.exp(-ratio), 0.0) * np.sign(v) * seen
            slope = np.where(ratio < 700.0, ratio, 0.0) * exponent * fallen * drop
        return W, np.stack((fallen, slope), axis=2)

    return columns


def _refined(
    system: Equations, vs: ArrayLike, exponent: Array, drop: Array, p_value: Array,
    seen: NDArray[np.bool_], sigma: Array, number: Array, limits: tuple[Array, Array],
) -> StribeckFit:  # fmt: skip
    n, b = len(sigma), len(system.names)
    vs = np.array(vs)
    drop = np.where(seen, drop, 0.0)
    both = np.tile([0, 1], (n, 1))
    status = StribeckStatus.NOT_CONVERGED
    iterations = 0
    low, high = 0.1 * limits[0], 4.0 * limits[1]
    while True:
        iterations += 1
        local = OwnEquations(system, _tangents(vs, exponent, drop, seen), 2, spread=True)
        reduced = OwnEquations(system, local.columns, 2).reduced()
        found = fitted(chosen_factors(reduced, b, both), sigma)
        drop, step = found.values[b::2].copy(), np.clip(found.values[b + 1 :: 2], -0.5, 0.5)
        # a curve that only made up for a wrong one of another joint goes again
        kept = seen.copy()
        for j in np.flatnonzero(seen):
            without = both.copy()
            without[j] = -1
            worse = fitted(chosen_factors(reduced, b, without), sigma).sums - found.sums
            p_value[j] = chance(float((worse / sigma**2).sum()), number[j], reduced.counts[j], 2)
            kept[j] = p_value[j] < _CHANCE and drop[j] > 0.0
        if (kept != seen).any():
            seen, drop = kept, np.where(kept, drop, 0.0)
            continue
        vs = np.where(seen, np.clip(vs * np.exp(step), low, high), vs)
        if (np.abs(step[seen]) < _STILL).all():
            status = StribeckStatus.SOLVED if seen.any() else StribeckStatus.NOT_SEEN
            break
        if iterations == _ITERATIONS:
            break
    theta = found.values.copy()
    theta[b + 1 :: 2] = 0.0
    covariance = own_covariance(local, found, theta, sigma)
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return StribeckFit(
        system.base, found.values[:b], deviations[:b], drop, np.where(seen, vs, np.nan), exponent,
        np.where(seen, deviations[b::2], np.nan),
        np.where(seen, vs * deviations[b + 1 :: 2], np.nan), p_value, seen,
        np.sqrt(found.sums / np.maximum(reduced.counts, 1)), iterations, status,
    )  # fmt: skip
