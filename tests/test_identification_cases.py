"""Steps of the estimators on small systems, by the formulas of the textbooks."""

import numpy as np

from robotmodels.estimation.factor import TriangularFactors
from robotmodels.estimation.linear import ordinary
from robotmodels.identification.closed_loop.method import instrument_step
from robotmodels.identification.forms import Block

NAMES = ("a", "b", "c")


def reduction_of(*systems):
    """Of equations A x = y, kind by kind."""
    factors = [np.linalg.qr(np.column_stack(pair), mode="r") for pair in systems]
    counts = np.array([len(y) for _, y in systems])
    return TriangularFactors(NAMES, tuple(factors), counts, np.zeros_like(counts))


def test_the_deviation_of_a_few_equations_counts_what_parameters_take(rng):
    """RSS / (N - b) for one kind, as any table of a regression has it."""
    A, y = rng.normal(size=(12, 3)), rng.normal(size=12)
    x, squares, *_ = np.linalg.lstsq(A, y)
    found = ordinary(reduction_of((A, y)))
    np.testing.assert_allclose(found.values, x, rtol=1e-12)
    np.testing.assert_allclose(found.sigma, np.sqrt(squares / 9), rtol=1e-12)
    np.testing.assert_allclose(
        found.covariance, squares[0] / 9 * np.linalg.inv(A.T @ A), rtol=1e-10, atol=1e-12
    )


def test_deviations_of_two_kinds_share_what_parameters_take(rng):
    """By the traces of the parts of the hat matrix."""
    systems = [(rng.normal(size=(n, 3)) * s, rng.normal(size=n)) for n, s in ((30, 1.0), (15, 0.2))]
    whole = np.vstack([A for A, _ in systems])
    x = np.linalg.lstsq(whole, np.concatenate([y for _, y in systems]))[0]
    inverse = np.linalg.inv(whole.T @ whole)
    expected = [
        np.sqrt(((y - A @ x) ** 2).sum() / (len(y) - np.trace(A @ inverse @ A.T)))
        for A, y in systems
    ]
    np.testing.assert_allclose(ordinary(reduction_of(*systems)).sigma, expected, rtol=1e-11)


def test_a_step_of_instruments_is_the_instrumental_estimate(rng):
    """(Z^T W)^-1 Z^T y from anywhere, with s^2 (Z^T W)^-1 Z^T Z (W^T Z)^-1.

    Instruments that are far from the regressor, so that no product can stand for another one.
    """
    N = 200
    W, Z = rng.normal(size=(N, 1, 3)), rng.normal(size=(N, 1, 3))
    W = 0.3 * W + 0.7 * Z @ rng.normal(size=(3, 3))
    y = W[:, 0] @ [1.0, -2.0, 3.0] + 0.01 * rng.normal(size=N)
    block = Block(np.arange(N) * 1.0, W, y[:, None], np.ones((N, 1), bool), np.ones((N, 1)))
    start, size = np.array([0.9, -2.1, 3.2]), np.array([1.0, 0.5, 2.0])
    found = instrument_step(NAMES, start, lambda: [(Z, block)], size)
    z, w = Z[:, 0], W[:, 0]
    np.testing.assert_allclose(found.values, np.linalg.solve(z.T @ w, z.T @ y), rtol=1e-10)
    sigma = np.sqrt(((y - w @ start) ** 2).sum() / (N - 3))
    np.testing.assert_allclose(found.sigma, [sigma], rtol=1e-12)
    back = np.linalg.inv(z.T @ w)
    expected = sigma * np.sqrt(np.diag(back @ (z.T @ z) @ back.T))
    np.testing.assert_allclose(found.standard_errors, expected, rtol=1e-9)
