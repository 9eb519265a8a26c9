"""Covariance of an estimate: squares, robust losses and prior alike."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ._problem import Point, Problem, Weighing
from ._step import Linear, triangle
from .losses import Loss, expected_slope


def determined(problem: Problem, linear: Linear) -> float:
    """Parameters that the measurements determine: the rank, less what the prior holds."""
    _, information = problem.prior.rows(problem.prior.mean)
    return linear.rank - float(((information[:, None] * linear.back) ** 2).sum())


def covariance(
    problem: Problem,
    weighing: Weighing,
    point: Point,
    linear: Linear,
    freedom: float,
    sigma_known: bool,
    complete: bool,
) -> tuple[Array, float]:
    """Covariance of the estimate, and the standard deviation of residuals in stated ones.

    Shapes: -> covariance (P, P).
    """
    M, P = len(point.r), problem.P
    left = M - freedom
    if weighing.loss is Loss.SQUARES:
        variance = float(point.r @ point.r) / left if left > 0 else np.nan
        scale = float(np.sqrt(variance))
        noise = 1.0 if sigma_known else variance
        back, inner = linear.back, np.eye(linear.rank)
        _, information = problem.prior.rows(point.x)
        own = information[:, None] * back
        inner = noise * (inner - own.T @ own) + own.T @ own if information.any() else noise * inner
        whole = back @ inner @ back.T
    else:
        scale = weighing.scale
        noise, beta = _influence(problem, weighing, point, left)
        whole = _sandwich(problem, point, linear, noise, beta)
    if not complete and linear.rank < P:
        lost = np.abs(linear.V[linear.rank :]).max(axis=0) > 1e-8
        whole[lost, :] = whole[:, lost] = 0.0
        whole[lost, lost] = np.inf
    return (whole + whole.T) / 2, scale


def _influence(
    problem: Problem, weighing: Weighing, point: Point, left: float
) -> tuple[float, Array]:
    """Mean square of the influence, and mean curvature of the measurements of each size."""
    _, weight, slope = weighing.terms(point.length)
    rows = problem.rows
    expected = expected_slope(weighing.loss, rows)
    bend = slope + (rows - 1) * weight
    share = bend.sum() / (expected * rows).sum()
    if left <= 0 or share <= 0:
        return np.nan, expected
    square = float(((weight * point.length) ** 2).sum()) / left
    mean = bend.sum() / rows.sum()
    spread = float((rows * (bend / rows - mean) ** 2).sum() / rows.sum())
    more = 1 + (rows.sum() - left) / rows.sum() * spread / mean**2
    return square * more**2, expected * share


def _sandwich(problem: Problem, point: Point, linear: Linear, noise: float, beta: Array) -> Array:
    """Covariance from the unweighted rows: outliers are measurements too, where they were taken."""
    data = triangle(point.J)
    bent = data
    if np.ptp(beta) > 0:
        bent = triangle(point.J * problem.per_row(np.sqrt(beta))[:, None])
    elif len(beta):
        bent = data * np.sqrt(beta[0])
    _, information = problem.prior.rows(point.x)
    both = np.vstack((bent, np.diag(information))) if information.any() else bent
    _, s, V = np.linalg.svd(both / linear.columns, full_matrices=False)
    rank = min(linear.rank, int((s > 1e-13 * s[0]).sum()))
    back = (V[:rank] / s[:rank, None]).T / linear.columns[:, None]
    one, two = data @ back, information[:, None] * back
    middle = noise * (one.T @ one) + two.T @ two
    return back @ middle @ back.T
