"""Statistics of fits: leverage, tests of residuals, folds, strength of a prior."""

import numpy as np
import pytest
from scipy.stats import chi2, t

from robotmodels.errors import InvalidValueError
from robotmodels.estimation import (
    Prior,
    confidence_intervals,
    fit_diagnostics,
    fit_nonlinear,
)


def linear(seed=0, M=240, P=4, noise=0.1):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(M, P))
    y = A @ np.arange(1.0, P + 1) + noise * rng.normal(size=M)
    return A, y, lambda x: (A @ x - y, A)


def test_statistics_are_the_textbook_ones():
    A, y, linearise = linear()
    fit = fit_nonlinear(linearise, np.zeros(4), sigma=0.1)
    found = fit_diagnostics(fit)
    x, rest = np.linalg.lstsq(A, y)[:2]
    covariance = np.linalg.inv(A.T @ A) * rest[0] / 236
    s = np.sqrt(np.diag(covariance))
    assert np.allclose(fit.standard_errors, s)
    assert np.allclose(found.relative_standard_errors, s / x)
    assert np.allclose(found.correlation, covariance / np.outer(s, s))
    assert np.isclose(fit.scale**2, rest[0] / 236 / 0.01)
    assert np.isclose(found.condition, np.linalg.cond(A / np.linalg.norm(A, axis=0)))
    assert np.allclose(confidence_intervals(fit)[:, 1] - fit.x, t.ppf(0.975, 236) * s)
    for level in (0.0, 1.0, 95):
        with pytest.raises(InvalidValueError, match="above 0 and below 1"):
            confidence_intervals(fit, level)


@pytest.mark.parametrize("sigma", [0.08, 0.13])
def test_residual_size_is_tested_on_both_sides_and_relative_errors_are_positive(sigma):
    A, y, _ = linear()
    fit = fit_nonlinear(lambda x: (A @ x + y, A), np.zeros(4), sigma=sigma)
    found = fit_diagnostics(fit)
    assert (fit.x < 0.0).all()
    assert np.allclose(found.relative_standard_errors, -fit.standard_errors / fit.x)
    squares = float(np.sum((fit.residuals / sigma) ** 2))
    assert np.isclose(found.chi_squared.p, 2.0 * min(chi2.cdf(squares, 236), chi2.sf(squares, 236)))


@pytest.mark.parametrize("size", [1, 3])
def test_influence_is_that_of_leaving_a_measurement_out(size):
    A, y, linearise = linear(M=30)
    block = np.arange(30) // size
    fit = fit_nonlinear(linearise, np.zeros(4), block=block)
    found = fit_diagnostics(fit)
    H = A @ np.linalg.pinv(A)
    for b in (0, 4, 9):
        own = block == b
        assert np.isclose(found.leverage[b], np.trace(H[np.ix_(own, own)]))
        change = np.linalg.lstsq(A[~own], y[~own])[0] - fit.x
        expected = change @ np.linalg.solve(fit.covariance, change) / 4
        assert np.isclose(found.influence[b], expected)
    assert np.isclose(found.leverage.sum(), fit.freedom)


def test_leverage_is_reduced_by_the_prior():
    A, _, linearise = linear(M=30)
    prior = Prior(np.zeros(4), np.full(4, 0.2))
    fit = fit_nonlinear(linearise, np.zeros(4), prior=prior, sigma_known=True)
    hat = A @ np.linalg.inv(A.T @ A + 25.0 * np.eye(4)) @ A.T
    assert np.allclose(fit_diagnostics(fit).leverage, np.diag(hat))
    assert np.isclose(fit.freedom, np.trace(hat))
    A = np.array([[1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])  # the last stands alone
    fit = fit_nonlinear(lambda x: (A @ x - [1.0, 2.0, 3.5, 4.0], A), np.zeros(2))
    assert np.isinf(fit_diagnostics(fit).influence).tolist() == [False, False, False, True]


def test_residual_tests_reject_what_they_should_and_seldom_else():
    false = np.zeros(3)
    for seed in range(200):
        _, _, linearise = linear(seed, M=120)
        found = fit_diagnostics(fit_nonlinear(linearise, np.zeros(4), sigma=0.1))
        tests = (found.chi_squared, found.normality, found.independence)
        false += [not test.passed for test in tests]
    assert (false <= 9).all()  # 2 expected, as the level is 1 %
    A, y, linearise = linear(M=600)
    for sigma in (0.05, 0.2):
        size = fit_diagnostics(fit_nonlinear(linearise, np.zeros(4), sigma=sigma)).chi_squared
        assert not size.passed
        assert "standard deviations are wrong" in size.sentence
    drift = y + 0.2 * np.sin(np.arange(600) / 30)
    fit = fit_nonlinear(lambda x: (A @ x - drift, A), np.zeros(4), block=np.arange(600) // 3)
    order = fit_diagnostics(fit).independence
    z = fit.whitened.reshape(200, 3)
    assert not order.passed
    assert np.isclose(order.statistic, (z[:-1] * z[1:]).sum()
                      / np.sqrt((z[:-1] ** 2).sum() * (z[1:] ** 2).sum()))  # fmt: skip
    uniform = A @ np.ones(4) + np.random.default_rng(0).uniform(-1, 1, 600)
    assert not fit_diagnostics(
        fit_nonlinear(lambda x: (A @ x - uniform, A), np.zeros(4))
    ).normality.passed
    few = fit_diagnostics(fit_nonlinear(lambda x: (x - 1.0, np.eye(2)), np.zeros(2)))
    assert np.isnan(few.chi_squared.p)
    assert "few" in few.normality.sentence
    x = np.arange(50.0)
    exact = fit_diagnostics(fit_nonlinear(lambda a: ((a[0] - 2.0) * x, x[:, None]), [2.0]))
    assert exact.independence.passed
    assert "no residuals to test" in exact.independence.sentence
