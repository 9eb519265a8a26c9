"""Sequential identification, joint by joint from the last to the first.

The torque of a joint depends on the links beyond it alone: the last joint's equations give
parameters of the last link, with these the equations of the joint before give those of its link,
and so on. Parameters that a step determines only in combination are left to later steps. Errors of
known values enter the covariance, but values are not improved later; weighted least squares, which
solves all steps at once, has smaller standard errors.

Parameters
----------
system : Equations
    Torque or momentum equations of a log, from `equations`.
factors : TriangularFactors
    Factors of the same equations.

Returns
-------
Estimate
    ``details`` is a tuple of `SequentialStep`.

Raises
------
InvalidValueError
    Equations of power or energy; fewer equations than parameters.

References
----------
Seed book section 1.6.4.

Examples
--------
>>> from robotmodels.datasets import example_log
>>> from robotmodels.identification import fit
>>> arm, log = example_log()
>>> result = fit(arm, log, "sequential", drive=("Fv",))
>>> [step.joints for step in result.estimate.details]
[(2,), (1,)]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...errors import InvalidValueError
from ...estimation.estimate import Estimate
from ...estimation.factor import TriangularFactors, triangle
from ...estimation.linear import check_count, inverse_std, residual_std
from ..equations import Equations
from .base import Method

_ZERO = 1e-12
"""Rank tolerance: norm of a column in a joint's equations relative to all equations."""
_RANK = 1e-7
"""Rank tolerance: singular value of the scaled columns relative to the largest."""


@dataclass(frozen=True, slots=True)
class SequentialStep:
    """Result of the equations of one joint, or of joints that motors couple.

    ``joints`` from 1; ``names`` determined in this step; those ``waiting`` for later steps; the
    number of ``equations``; ``sigma`` of their residuals, N m or N; ``condition`` of their columns.
    """

    joints: tuple[int, ...]
    names: tuple[str, ...]
    waiting: tuple[str, ...]
    equations: int
    sigma: float
    condition: float


@dataclass(frozen=True, slots=True, eq=False)
class Sequential(Method):
    """Sequential least squares, joint by joint from the last to the first."""

    name: ClassVar[str] = "sequential"
    title: ClassVar[str] = "sequential least squares, from the last joint to the first"

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters."""
        if not system.form.by_joint:
            raise InvalidValueError(
                "form: the sequential method needs equations of each joint; use form 'torque' or "
                f"'filtered' instead of {system.form.name.lower()!r}."
            )
        check_count(factors)
        known = _Known(len(factors.names))
        weights = 1.0 / _joint_std(factors)
        steps = tuple(_step(known, factors, joints, weights) for joints in _joint_groups(system))
        missing = [factors.names[k] for k in np.flatnonzero(~known.done)]
        if missing:  # by rounding only: the steps together have the rank of all equations
            raise InvalidValueError(
                f"log: no step determines {', '.join(missing)}; their columns are nearly "
                "dependent. Use weighted least squares, or fewer parameters."
            )
        sigma = residual_std(factors, known.values)
        return Estimate(
            factors.names,
            known.values,
            known.covariance,
            sigma,
            iterations=len(steps),
            details=steps,
        )


class _Known:
    """Values so far, their covariance, and equations (of unit noise) left to later steps."""

    def __init__(self, b: int) -> None:
        self.values = np.zeros(b)
        self.covariance = np.zeros((b, b))
        self.done = np.zeros(b, dtype=bool)
        self.left = np.zeros((0, b + 1))


def _joint_groups(system: Equations) -> list[tuple[int, ...]]:
    """Joints of each step, from 0, from the last to the first; coupled motors join them."""
    n = system.model.n
    label = list(range(n))
    transmission = system.model.transmission
    if transmission is not None:
        for motor in transmission.coupled_motors:
            joints = np.flatnonzero(transmission.weights[motor - 1]).tolist()
            first, last = min(joints), max(joints)
            for j in range(first, last + 1):
                label[j] = min(label[first], label[j])
    labels = sorted(set(label), reverse=True)
    return [tuple(j for j in range(n) if label[j] == k) for k in labels]


def _joint_std(factors: TriangularFactors) -> Array:
    """Standard deviations of the residuals of each joint's equations, solved alone (n,)."""
    sigma = np.zeros(len(factors.factors))
    for j, R in enumerate(factors.factors):
        A, y = R[:, :-1], R[:, -1]
        size = np.linalg.norm(A, axis=0)
        seen = size > 0.0
        U, s, _ = np.linalg.svd(A[:, seen] / size[seen], full_matrices=False)
        rank = int((s > _RANK * s.max(initial=0.0)).sum())
        e = y - U[:, :rank] @ (U[:, :rank].T @ y)
        sigma[j] = np.linalg.norm(e) / np.sqrt(max(int(factors.counts[j]) - rank, 1))
    return 1.0 / inverse_std(factors, sigma)


def _step(
    known: _Known, factors: TriangularFactors, joints: tuple[int, ...], weights: Array
) -> SequentialStep:
    """Estimate parameters from the equations of some joints and those left by earlier steps."""
    b = len(known.values)
    new_rows = np.vstack([weights[j] * factors.factors[j] for j in joints])
    rows = np.vstack((known.left, new_rows))
    lengths = [np.linalg.norm(R[:, :b], axis=0) for R in factors.factors]
    longest = np.sqrt(np.sum((weights[:, None] * lengths) ** 2, axis=0))
    sizes = np.linalg.norm(rows[:, :b], axis=0)
    new = np.flatnonzero(~known.done & (sizes > _ZERO * longest))
    count = int(sum(factors.counts[j] for j in joints))
    told, waiting, condition = new[:0], new[:0], 1.0
    if new.size:
        U, s, Vt = np.linalg.svd(rows[:, new] / sizes[new])
        rank = int((s > _RANK * s[0]).sum())
        condition = float(s[0] / s[rank - 1])
        # a parameter is determined if no combination without effect contains it
        combined = np.abs(Vt[rank:]).max(axis=0, initial=0.0) > np.sqrt(_RANK)
        told, waiting = new[~combined], new[combined]
        inverse = (Vt[:rank].T / s[:rank]) @ U[:, :rank].T / sizes[new][:, None]
        _determine(known, told, inverse[~combined], rows)
        # equations of the undetermined parameters, projected off the determined ones
        Q = np.linalg.qr(rows[:, told], mode="complete")[0][:, told.size :]
        rest = Q.T @ rows if waiting.size else np.zeros((0, b + 1))
        rest[:, told] = 0.0
        known.left = triangle(rest) if len(rest) > b + 1 else rest
    e = new_rows[:, b] - new_rows[:, :b] @ known.values
    if waiting.size:
        columns = new_rows[:, waiting]
        e -= columns @ np.linalg.lstsq(columns, e, rcond=_RANK)[0]
    mean = np.mean([1.0 / weights[j] for j in joints])
    name = factors.names.__getitem__
    return SequentialStep(
        tuple(j + 1 for j in joints),
        tuple(map(name, told.tolist())),
        tuple(map(name, waiting.tolist())),
        count,
        float(np.linalg.norm(e) / np.sqrt(max(count - new.size, 1)) * mean),
        condition,
    )


def _determine(known: _Known, new: NDArray[np.int64], inverse: Array, rows: Array) -> None:
    """Set new values, and their covariance from noise and the errors of known values."""
    done = np.flatnonzero(known.done)
    known.values[new] = inverse @ (rows[:, -1] - rows[:, done] @ known.values[done])
    effect = -inverse @ rows[:, done]
    cross = effect @ known.covariance[np.ix_(done, done)]
    known.covariance[np.ix_(new, done)] = cross
    known.covariance[np.ix_(done, new)] = cross.T
    known.covariance[np.ix_(new, new)] = inverse @ inverse.T + cross @ effect.T
    known.done[new] = True
