"""One step of the instrumental variables on a small system, by the formulas of the textbooks."""

import numpy as np

from robotmodels.estimation.factor import factors_of
from robotmodels.identification.closed_loop.instrumental import instrument_step
from robotmodels.identification.forms import Block


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
    factors = factors_of(("a", "b", "c"), W, block.y, block.use)
    found = instrument_step(factors, start, iter([(Z, block)]), size)
    z, w = Z[:, 0], W[:, 0]
    np.testing.assert_allclose(found.values, np.linalg.solve(z.T @ w, z.T @ y), rtol=1e-10)
    sigma = np.sqrt(((y - w @ start) ** 2).sum() / (N - 3))
    np.testing.assert_allclose(found.sigma, [sigma], rtol=1e-12)
    back = np.linalg.inv(z.T @ w)
    expected = sigma * np.sqrt(np.diag(back @ (z.T @ z) @ back.T))
    np.testing.assert_allclose(found.standard_errors, expected, rtol=1e-9)
