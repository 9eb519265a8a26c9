"""The equations of a robot with and without a load, and their solution."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from ..._arrays import Array
from ...errors import InvalidValueError
from ...estimation import column_basis
from ...estimation.columns import ColumnBasis
from ...inertia import PARAMETERS
from ...logs import Log
from ...minimal_parameters import BaseParameters
from ..consistency.real_body import nearest_body
from ..correlated import correlated_covariance
from ..equations import Equations, equations
from ..preparation.processing import Processing, choose_processing
from ..result import IdentificationResult
from ..scale.reduction import Reduction
from .loaded import (
    MappedEquations,
    SeveralLogs,
    column_lengths,
    mapped_reduction,
    payload_columns,
    reduced_side,
    residual_noise,
)

_NOTHING = 1e-7
_EXACT = 1e-13
"""Deviation relative to a parameter, below which it is rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class PayloadProblem:
    """Reduced equations of a robot with and without a load.

    Shapes: sigma (n,), prior (r, k + 1).
    """

    base: BaseParameters
    frame: str | int | None
    names: tuple[str, ...]
    basis: ColumnBasis
    parts: tuple[MappedEquations, ...]
    reduction: Reduction
    sigma: Array
    prior: Array


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Estimate of the k unknowns. Shapes: values (k,), covariance (k, k), sigma (n,)."""

    values: Array
    covariance: Array
    sigma: Array
    cost: float
    solved: bool


def payload_problem(
    base: BaseParameters, loaded: Log, reference: IdentificationResult | Log,
    frame: str | int | None, own: tuple[str, ...], processing: Processing | None,
    executor: Executor | None,
) -> PayloadProblem:  # fmt: skip
    """Equations of the loaded log together with what is known of the robot without load."""
    known = reference if isinstance(reference, IdentificationResult) else None
    robot = base.names if known is None else known.names
    kinds = {name: name.rstrip("0123456789") for name in robot}
    inertial = set(PARAMETERS)
    possible = sorted({kind for kind in kinds.values() if kind not in inertial})
    for kind in own:
        if kind not in possible:
            raise InvalidValueError(
                f"own: {kind!r} is no kind of drive or friction parameter that is identified; "
                f"there are {', '.join(possible) or 'none'}."
            )
    again = [name for name in robot if kinds[name] in own]
    loads = tuple(f"{name} load" for name in PARAMETERS)
    names = (*robot, *(f"{name} loaded" for name in again), *loads)
    place = {name: k for k, name in enumerate(base.names)}
    bare = np.zeros((len(base), len(names)))
    bare[[place[name] for name in robot], range(len(robot))] = 1.0
    full = bare.copy()
    for k, name in enumerate(again):
        full[:, robot.index(name)] = 0.0
        full[place[name], len(robot) + k] = 1.0
    full[:, -10:] = payload_columns(base, frame)
    if isinstance(reference, IdentificationResult):
        choices = reference.system.processing if processing is None else processing
        logs, maps = (loaded,), [full]
    else:
        choices = choose_processing(reference) if processing is None else processing
        logs, maps = (reference, loaded), [bare, full]
    if any(abs(log.dt - choices.dt) > 1e-9 * choices.dt for log in logs):
        raise InvalidValueError(
            "loaded: its sampling period is not that of the reference; read_log(..., period=) "
            "resamples, or give processing= for this period with an identified robot."
        )
    systems = [equations(base, log, choices) for log in logs]
    reductions = [reduced_side(system, None, executor) for system in systems]
    whole = mapped_reduction(reductions, maps, names)
    sigma = residual_noise(whole)
    R = np.vstack([F[:, :-1] / s for F, s in zip(whole.factors, sigma, strict=True)])
    first = 0 if known is None else len(robot)
    basis = _after(column_basis(R[:, first:], nothing=_NOTHING), first)
    kept = basis.kept
    parts = tuple(
        MappedEquations(system, M[:, kept], tuple(names[k] for k in kept))
        for system, M in zip(systems, maps, strict=True)
    )
    columns = [*kept.tolist(), len(names)]
    reduction = Reduction(
        parts[0].names, tuple(F[:, columns] for F in whole.factors), whole.counts, whole.left_out
    )
    prior = np.zeros((0, len(kept) + 1)) if known is None else _prior(known, len(kept))
    return PayloadProblem(base, frame, names, basis, parts, reduction, sigma, prior)


def _after(basis: ColumnBasis, first: int) -> ColumnBasis:
    """The basis with so many columns before it that are all kept."""
    k, c = basis.coefficients.shape
    coefficients = np.zeros((first + k, first + c))
    coefficients[:first, :first] = np.eye(first)
    coefficients[first:, first:] = basis.coefficients
    return ColumnBasis(
        np.concatenate((np.arange(first), basis.kept + first)), basis.empty + first, coefficients,
        np.concatenate((np.ones(first), basis.distance)),
    )  # fmt: skip


def _prior(known: IdentificationResult, k: int) -> Array:
    """The identified robot as equations of unit noise."""
    values = known.values
    least = _EXACT * np.maximum(np.abs(values), 1e-3 * np.abs(values).max(initial=1e-300))
    size = np.maximum(known.deviations, least)
    correlation = known.estimate.covariance / np.outer(size, size)
    share, vectors = np.linalg.eigh(correlation + np.diag(1.0 - np.diag(correlation)))
    share = np.maximum(share, 1e-10)
    rows = np.zeros((len(values), k + 1))
    rows[:, : len(values)] = (vectors / np.sqrt(share)).T / size
    rows[:, -1] = rows[:, : len(values)] @ values
    return rows


def solve_payload(problem: PayloadProblem, consistent: bool) -> Solution:
    """Joint estimate of robot and load by weighted least squares."""
    reduction, prior = problem.reduction, problem.prior
    weighted = [F / s for F, s in zip(reduction.factors, problem.sigma, strict=True)]
    rows = np.vstack((*weighted, prior))
    k = rows.shape[1] - 1
    size = column_lengths(rows[:, :k])
    R = np.asarray(np.linalg.qr(np.column_stack((rows[:, :k] / size, rows[:, k])), mode="r"))
    if len(R) < k:
        raise InvalidValueError(
            f"loaded: {reduction.rows} equations for {k} parameters are too few; give a longer log "
            "or a smaller decimation."
        )
    inverse = np.linalg.inv(R[:k, :k]) / size[:, None]
    values = inverse @ R[:k, k]
    information = inverse @ inverse.T
    spread = correlated_covariance(
        cast(Equations, SeveralLogs(problem.parts)), values, 1.0 / problem.sigma, information
    )
    known = inverse @ (inverse.T @ prior[:, :k].T)
    covariance = spread.covariance + known @ known.T
    best = Solution(values, covariance, problem.sigma, 0.0, True)
    return _held_to_bodies(problem, best, R, size) if consistent else best


def _held_to_bodies(problem: PayloadProblem, best: Solution, R: Array, size: Array) -> Solution:
    """The best solution whose load is a real body, the robot's parameters free to follow."""
    k, first = len(size), len(problem.names) - 10
    r = int((problem.basis.kept < first).sum())
    U, y = R[r:k, r:k] * size[r:], R[r:k, k]
    groups = problem.basis.coefficients[r:, first:]
    body = nearest_body(U @ groups, y)
    if body is None:
        return replace(best, solved=False)
    inner = groups @ body
    rest = R[:r, k] - (R[:r, r:k] * size[r:]) @ inner
    outer = np.linalg.solve(R[:r, :r], rest) / size[:r] if r else np.zeros(0)
    left = float((R[k:, k] ** 2).sum())
    more = float(np.sum((U @ inner - y) ** 2))
    # of exact data what is left is rounding, and the noise it is counted in a small part of it
    cost = more / max(left, float(problem.reduction.rows))
    return replace(best, values=np.concatenate((outer, inner)), cost=cost)
