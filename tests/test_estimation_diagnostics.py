"""Statistics of fits: leverage, tests of residuals, folds, strength of a prior."""

import numpy as np
import pytest
from scipy.stats import chi2, t

from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.estimation import (
    Loss,
    Prior,
    confidence_intervals,
    fit_diagnostics,
    fit_nonlinear,
    k_folds,
)
from robotmodels.estimation.strength import select_strength


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
        with pytest.raises(InvalidValueError, match="between 0 and 1"):
            confidence_intervals(fit, level)


@pytest.mark.parametrize("sigma", [0.08, 0.09, 0.11, 0.13])
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
    for sigma, words in ((0.05, "times as large"), (0.2, "only")):
        size = fit_diagnostics(fit_nonlinear(linearise, np.zeros(4), sigma=sigma)).chi_squared
        assert not size.passed
        assert words in size.sentence
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


def test_folds_keep_groups_together():
    group = np.random.default_rng(0).integers(0, 23, 300)
    masks = k_folds(group, 5, rng=3)
    assert (masks.sum(axis=0) == 1).all()
    for mask in masks:
        assert not np.intersect1d(group[mask], group[~mask]).size
    assert np.array_equal(masks, k_folds(group, 5, rng=3))
    assert not np.array_equal(masks, k_folds(group, 5, rng=4))
    assert k_folds(range(20), 3, rng=0).sum(axis=1).tolist() == [7, 7, 6]
    for k in (1, 24, True, 2.0):
        with pytest.raises(InvalidValueError, match="folds"):
            k_folds(group, k, rng=0)
    with pytest.raises(InvalidValueError, match="whole"):
        k_folds([0.5, 1.0], 2, rng=0)
    with pytest.raises(ShapeError, match="each row"):
        k_folds([[1, 2]], 2, rng=0)


@pytest.mark.parametrize("loss", [Loss.SQUARES, Loss.TUKEY])
def test_cross_validation_finds_the_strength_that_predicts(loss):
    rng = np.random.default_rng(1)
    A = rng.normal(size=(80, 40))
    truth = 0.1 * rng.normal(size=40)
    y = A @ truth + rng.normal(size=80)
    if loss is Loss.TUKEY:
        y[::10] += 100.0
    prior = Prior(np.zeros(40), np.full(40, 0.1))
    folds, strengths, block = k_folds(range(80), 4, rng=0), np.logspace(-4, 4, 9), np.arange(80)

    def linearise(x):
        return A @ x - y, A

    found = select_strength(linearise, np.zeros(40), prior, folds, strengths, block, loss)
    assert 0.1 <= found.strength <= 10.0  # the prior is true
    assert found.errors.shape == (9, 4)
    error = [
        np.linalg.norm(
            fit_nonlinear(linearise, np.zeros(40), prior=prior.with_strength(s), loss=loss).x
            - truth
        )
        for s in (found.strength, 1e-4)
    ]
    assert error[0] < 0.7 * error[1]
    with pytest.raises(InvalidValueError, match="both parts"):
        select_strength(linearise, np.zeros(40), prior, folds, strengths, block // 2)
