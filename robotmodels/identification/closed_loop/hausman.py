"""Durbin-Wu-Hausman test: whether noise in the regressor biases least squares."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, read_only
from ...errors import InvalidValueError
from ...estimation import column_basis
from ...estimation.merging import merged_factor, merged_tree
from ..correlated import correlated_covariance
from ..equations import Block, Equations
from .blocks import given, simulated_blocks
from .estimate import SimulatedEstimate
from .simulated import RanAwayError

_NOTHING = 1e-9
"""Part of the torque below which nothing of the regressor is left unexplained."""
_KEPT = 256_000_000
"""Bytes of blocks that are kept from one joint's test to the next."""


@dataclass(frozen=True, slots=True, eq=False)
class HausmanResult(Rebuilt):
    """Verdict on least squares, for the whole and joint by joint. Read-only.

    Parameters
    ----------
    statistic : float
        Of all joints together: the square of a normal variable if least squares are not biased.
        NaN where the robot could not be simulated.
    p : float
        Probability of one as large by chance.
    joint_statistic, joint_p : ndarray, shape (n,)
        Of each joint's own equations; NaN for a joint without any.
    share : float
        Part of the torque that comes of what the instruments do not explain of the regressor.
    lags : int
        Equations over which correlation of the residuals was taken into account.
    level : float
        Of the verdict.
    """

    statistic: float
    p: float
    joint_statistic: Array
    joint_p: Array
    share: float
    lags: int
    level: float

    def __post_init__(self) -> None:
        for name in ("joint_statistic", "joint_p"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def biased(self) -> bool:
        """Whether the test speaks against least squares."""
        return bool(self.p < self.level)

    @property
    def biased_joints(self) -> NDArray[np.bool_]:
        """Whose own equations speak against least squares, shape (n,); each at the level."""
        return self.joint_p < self.level

    @property
    def sentence(self) -> str:
        """What a person reads."""
        if np.isnan(self.p):
            return "Whether least squares are biased was not tested: the robot was not simulated."
        if self.biased:
            return (
                f"Least squares are biased (Durbin-Wu-Hausman, p = {self.p:.2g}): residuals go "
                "with what the simulated robot does not explain of the regressor. Filter the "
                "positions better, or use instrumental variables."
            )
        return f"Nothing speaks against least squares (Durbin-Wu-Hausman, p = {self.p:.2g})."


def hausman_test(
    system: Equations, estimate: SimulatedEstimate, level: float = 0.05, lags: int | None = None
) -> HausmanResult:
    """Durbin-Wu-Hausman test of the regressor, with the simulated one as instruments.

    In the form of an augmented regression: the first stage explains the regressor W by that of the
    simulated robot, Z; what is left, V, is noise of the positions (and of the model). Where it is
    correlated with the residuals, least squares are biased, and then V has a coefficient of its
    own in ``y = W b + (V b_iv) g + e``. Noise in the regressor makes ``V b_iv`` appear in the
    residuals as it is, so that this one direction is tested for ``g = 0``; a test of all columns
    of V spreads its power over as many directions and, with correlated residuals, rejects too
    often. The variance of g holds for residuals that are correlated in time and between joints.

    Parameters
    ----------
    system : Equations
        The equations that least squares would solve.
    estimate : SimulatedEstimate
        Of `instrumental` on these equations: its parameters, its deviations for the weights, and
        the simulation that gives the instruments.
    level : float
        Probability of a false alarm.
    lags : int, optional
        As for `correlated_covariance`.

    Returns
    -------
    HausmanResult
        Statistic, probability, and a sentence.

    Raises
    ------
    InvalidValueError
        A level that is not between 0 and 1; an estimate of other parameters.

    See Also
    --------
    fit : ``result = fit(model, log, "iv")`` has both, ``result.system`` and ``result.estimate``.

    References
    ----------
    J. Hausman, "Specification tests in econometrics", Econometrica 46(6), 1978; A. Janot, P.-O.
    Vandanjon and M. Gautier, "A Durbin-Wu-Hausman test for industrial robot identification", IEEE
    ICRA 2014; W. Newey and K. West, Econometrica 55(3), 1987.

    Examples
    --------
    >>> from robotmodels.identification import (
    ...     Log,
    ...     choose_processing,
    ...     equations,
    ...     instrumental,
    ...     reduce_equations,
    ... )
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> system = equations(base, log, choose_processing(log))
    >>> found = instrumental(system, reduce_equations(system))
    >>> bool(hausman_test(system, found).statistic >= 0.0)
    True
    """
    if not 0.0 < level < 1.0:
        raise InvalidValueError(f"level: expected a number between 0 and 1, got {level!r}.")
    if estimate.names != system.names:
        raise InvalidValueError(
            "estimate: it is of other parameters than these equations; estimate them by "
            "instrumental(system, ...) first."
        )
    n = system.model.n
    nothing = np.full(n, np.nan)
    if estimate.loop is None or not np.isfinite(estimate.deviations).all():
        return HausmanResult(np.nan, np.nan, nothing, nothing, np.nan, 0, level)
    loop, b_iv = estimate.loop, estimate.values

    def pairs() -> Iterator[tuple[Array, Block]]:
        for piece, block in simulated_blocks(system, loop, b_iv):
            own = system.block(piece)
            yield block.W, replace(own, use=own.use & block.use)

    try:
        both = _kept(system, pairs)
        factors = _factors(both, n)
    except RanAwayError:  # the last step of an estimate that did not converge
        return HausmanResult(np.nan, np.nan, nothing, nothing, np.nan, 0, level)
    length = float(np.sqrt(sum(R[:, -1] @ R[:, -1] for R in factors)))
    weights = 1.0 / np.maximum(estimate.sigma, 1e-12 * max(length, 1e-300))
    whole = _tested(system, both, factors, weights, b_iv, lags)
    single = [
        _tested(system, both, factors, weights * (np.arange(n) == j), b_iv, lags) for j in range(n)
    ]
    return HausmanResult(
        whole.statistic, whole.p, np.array([one.statistic for one in single]),
        np.array([one.p for one in single]), whole.share, whole.lags, level,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Tested:
    statistic: float
    p: float
    share: float
    lags: int


def _tested(
    system: Equations,
    both: Callable[[], Iterator[tuple[Array, Block]]],
    factors: list[Array],
    weights: Array,
    b_iv: Array,
    lags: int | None,
) -> _Tested:
    """Augmented regression of weighted equations: their factors, and one pass for the spread."""
    from scipy.stats import chi2

    b = len(b_iv)
    stacked = [w * R for w, R in zip(weights, factors, strict=True) if w > 0.0 and len(R)]
    if not stacked:
        return _Tested(np.nan, np.nan, np.nan, 0)
    R = np.vstack(stacked)
    RZ, RW, Ry = R[:, :b], R[:, b : 2 * b], R[:, -1]
    size = np.linalg.norm(RZ, axis=0)
    seen = size > 0.0
    RZ = RZ[:, seen] / size[seen]
    fitted = RW @ b_iv
    # what the instruments explain of the torque that the regressor gives
    first = np.zeros(b)
    first[seen] = np.linalg.lstsq(RZ, fitted, rcond=1e-10)[0] / size[seen]
    left = fitted - R[:, :b] @ first
    share = float(np.linalg.norm(left) / max(np.linalg.norm(Ry), 1e-300))
    if not share > _NOTHING:
        return _Tested(0.0, 1.0, share, 0)
    kept = column_basis(RW).kept
    X = np.column_stack((RW[:, kept], left))
    lengths = np.linalg.norm(X, axis=0)
    inverse = np.linalg.pinv(X / lengths, rcond=1e-10)
    values = inverse @ Ry / lengths
    information = inverse @ inverse.T / lengths[:, None] / lengths

    def augmented() -> Iterator[Block]:
        for Z, own in both():
            extra = own.W @ b_iv - Z @ first
            W = np.concatenate((own.W[:, :, kept], extra[:, :, None]), axis=2)
            yield replace(own, W=W)

    spread = correlated_covariance(given(system, augmented), values, weights, information, lags)
    variance = float(spread.covariance[-1, -1])
    if not variance > 0.0:
        return _Tested(np.nan, np.nan, share, spread.lags)
    statistic = float(values[-1] ** 2 / variance)
    return _Tested(statistic, float(chi2.sf(statistic, 1)), share, spread.lags)


def _factors(both: Callable[[], Iterator[tuple[Array, Block]]], n: int) -> list[Array]:
    """Of each joint, R with ``R^T R = [Z W y]^T [Z W y]``."""
    leaves = ([_factor(Z, own, j) for j in range(n)] for Z, own in both())
    found = merged_tree(
        leaves, lambda a, c: [merged_factor(x, y) for x, y in zip(a, c, strict=True)]
    )
    if found is None:
        raise InvalidValueError("log: no equations; give a longer log or smaller edges=.")
    return found


def _factor(Z: Array, own: Block, j: int) -> Array:
    use = own.use[:, j]
    rows = np.column_stack((Z[use, j], own.W[use, j], own.y[use, j]))
    return merged_factor(np.zeros((0, rows.shape[1])), rows)


def _kept(
    system: Equations, pairs: Callable[[], Iterator[tuple[Array, Block]]]
) -> Callable[[], Iterator[tuple[Array, Block]]]:
    """The same pairs, made once if all of them together are small."""
    rows = len(system.log) // system.processing.decimation + 1
    if 16 * rows * system.model.n * len(system.names) > _KEPT:
        return pairs
    whole = list(pairs())
    return lambda: iter(whole)
