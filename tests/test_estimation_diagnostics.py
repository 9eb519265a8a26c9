"""Statistics of fits: leverage, tests of residuals, folds, strength of a prior, several noises."""

import numpy as np
import pytest

from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.estimation import (
    Loss,
    Prior,
    StrengthSelection,
    confidence_intervals,
    fit_diagnostics,
    fit_nonlinear,
    held_out,
    k_folds,
    leave_one_group_out,
    leverage,
    linearity,
    select_strength,
    variance_components,
)


def linear(seed=0, M=240, P=4, noise=0.1):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(M, P))
    truth = np.arange(1.0, P + 1)
    y = A @ truth + noise * rng.normal(size=M)
    return A, y, truth, lambda x: (A @ x - y, A)


def test_statistics_are_the_textbook_ones():
    A, y, _, linearise = linear()
    fit = fit_nonlinear(linearise, np.zeros(4), sigma=0.1)
    found = fit_diagnostics(fit)
    x, rest = np.linalg.lstsq(A, y)[:2]
    covariance = np.linalg.inv(A.T @ A) * rest[0] / 236
    s = np.sqrt(np.diag(covariance))
    assert np.allclose(found.deviations, s)
    assert np.allclose(found.relative_deviations, s / x)
    assert np.allclose(found.correlation, covariance / np.outer(s, s))
    assert np.isclose(found.variance, rest[0] / 236 / 0.01)
    assert np.isclose(found.condition, np.linalg.cond(A))
    assert np.isclose(found.condition_scaled, np.linalg.cond(A / np.linalg.norm(A, axis=0)))
    from scipy.stats import t

    assert np.allclose(confidence_intervals(fit)[:, 1] - fit.x, t.ppf(0.975, 236) * s)


@pytest.mark.parametrize("sigma", [0.08, 0.09, 0.11, 0.13])
def test_sizes_of_residuals_are_judged_from_both_sides_and_deviations_have_no_sign(sigma):
    from scipy.stats import chi2

    A, y, _, _ = linear()
    fit = fit_nonlinear(lambda x: (A @ x + y, A), np.zeros(4), sigma=sigma)
    found = fit_diagnostics(fit)
    assert (fit.x < 0.0).all()
    assert np.allclose(found.relative_deviations, -fit.deviations / fit.x)
    squares = float(np.sum((fit.residuals / sigma) ** 2))
    tail = min(chi2.cdf(squares, 236), chi2.sf(squares, 236))
    assert np.isclose(found.chi_squared.p, 2.0 * tail)


def test_the_cautious_strength_is_the_strongest_within_a_standard_error_of_the_best():
    errors = 1.0 + np.array([[0.5, 0.7], [0.0, 0.0], [0.1, -0.05], [0.2, -0.05], [0.3, 0.3]])
    found = StrengthSelection(np.logspace(-2, 2, 5), errors)
    assert found.strength == 0.1
    assert found.cautious == 10.0


@pytest.mark.parametrize("size", [1, 3])
def test_influence_is_that_of_leaving_a_measurement_out(size):
    A, y, _, linearise = linear(M=30)
    block = np.arange(30) // size
    fit = fit_nonlinear(linearise, np.zeros(4), block=block)
    found = leverage(fit)
    H = A @ np.linalg.pinv(A)
    for b in (0, 4, 9):
        own = block == b
        assert np.isclose(found.leverage[b], np.trace(H[np.ix_(own, own)]))
        change = np.linalg.lstsq(A[~own], y[~own])[0] - fit.x
        expected = change @ np.linalg.solve(fit.covariance, change) / 4
        assert np.isclose(found.influence[b], expected)
    assert np.isclose(found.leverage.sum(), fit.freedom)


def test_shares_of_measurements_are_those_that_the_prior_leaves():
    A, _, _, linearise = linear(M=30)
    prior = Prior(np.zeros(4), np.full(4, 0.2))
    fit = fit_nonlinear(linearise, np.zeros(4), prior=prior, sigma_known=True)
    hat = A @ np.linalg.inv(A.T @ A + 25.0 * np.eye(4)) @ A.T
    assert np.allclose(leverage(fit).leverage, np.diag(hat))
    assert np.isclose(fit.freedom, np.trace(hat))


def test_measurement_that_alone_determines_something_is_infinitely_influential():
    A = np.array([[1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    fit = fit_nonlinear(lambda x: (A @ x - [1.0, 2.0, 3.5, 4.0], A), np.zeros(2))
    assert np.isinf(leverage(fit).influence).tolist() == [False, False, False, True]


def test_residual_tests_speak_when_they_should_and_seldom_else():
    false = np.zeros(3)
    for seed in range(200):
        _, _, _, linearise = linear(seed, M=120)
        found = fit_diagnostics(fit_nonlinear(linearise, np.zeros(4), sigma=0.1))
        tests = (found.chi_squared, found.normality, found.independence)
        false += [not test.passed for test in tests]
    assert (false <= 9).all()  # 2 expected, as the level is 1 %
    A, y, _, linearise = linear(M=600)
    large = fit_diagnostics(fit_nonlinear(linearise, np.zeros(4), sigma=0.05)).chi_squared
    small = fit_diagnostics(fit_nonlinear(linearise, np.zeros(4), sigma=0.2)).chi_squared
    assert not large.passed
    assert "times as large" in large.sentence
    assert not small.passed
    assert "only" in small.sentence
    drift = y + 0.2 * np.sin(np.arange(600) / 30)
    fit = fit_nonlinear(lambda x: (A @ x - drift, A), np.zeros(4), block=np.arange(600) // 3)
    assert not fit_diagnostics(fit).independence.passed
    uniform = A @ np.ones(4) + np.random.default_rng(0).uniform(-1, 1, 600)
    assert not fit_diagnostics(
        fit_nonlinear(lambda x: (A @ x - uniform, A), np.zeros(4))
    ).normality.passed
    few = fit_diagnostics(fit_nonlinear(lambda x: (x - 1.0, np.eye(2)), np.zeros(2)))
    assert np.isnan(few.chi_squared.p)
    assert "few" in few.normality.sentence


def test_linearity_of_a_curve_and_of_a_line():
    t = np.linspace(0, 1, 30)
    y = np.exp(2.0 * t) + 0.01 * np.random.default_rng(0).normal(size=30)

    def curve(x):
        e = np.exp(x[0] * t)
        return e - y, (t * e)[:, None]

    bent = linearity(fit_nonlinear(curve, [0.0]), curve)
    assert bent.curvature[0] > 0.5
    assert "not enough" in bent.sentence
    assert abs(bent.ratios[0] - 1) > 10 * abs(bent.ratios[-1] - 1)
    assert abs(bent.ratios[-1] - 1) < 0.05
    near = linearity(fit_nonlinear(curve, [1.99]), curve)
    assert near.curvature[0] < 0.05
    assert "hold" in near.sentence


def test_folds_keep_groups_together():
    group = np.random.default_rng(0).integers(0, 23, 300)
    masks = k_folds(group, 5, rng=3)
    assert (masks.sum(axis=0) == 1).all()
    for mask in (*masks, held_out(group, 0.3, rng=1), *leave_one_group_out(group)):
        assert not np.intersect1d(group[mask], group[~mask]).size
    assert np.array_equal(masks, k_folds(group, 5, rng=3))
    assert not np.array_equal(masks, k_folds(group, 5, rng=4))
    assert leave_one_group_out(group).shape == (23, 300)
    assert held_out([1, 2], 0.01, rng=0).sum() == 1
    assert held_out(range(20), 0.3, rng=0).sum() == 6
    for k in (1, 24, True, 2.0):
        with pytest.raises(InvalidValueError, match="folds"):
            k_folds(group, k, rng=0)
    with pytest.raises(InvalidValueError, match="two groups"):
        leave_one_group_out([1, 1])
    with pytest.raises(InvalidValueError, match="whole"):
        k_folds([0.5, 1.0], 2, rng=0)
    with pytest.raises(ShapeError, match="each row"):
        held_out([[1, 2]], 0.5, rng=0)


@pytest.mark.parametrize("loss", [Loss.SQUARES, Loss.TUKEY])
def test_cross_validation_finds_the_strength_that_predicts(loss):
    rng = np.random.default_rng(1)
    A = rng.normal(size=(80, 40))
    truth = 0.1 * rng.normal(size=40)
    y = A @ truth + rng.normal(size=80)
    if loss is Loss.TUKEY:
        y[::10] += 100.0
    seen: list[float] = []
    prior = Prior(np.zeros(40), np.full(40, 0.1))
    found = select_strength(
        lambda x: (A @ x - y, A), np.zeros(40), prior, k_folds(range(80), 4, rng=0),
        strengths=np.logspace(-4, 4, 9), loss=loss, sigma_known=True, progress=seen.append,
    )  # fmt: skip
    assert 0.1 <= found.strength <= 10.0  # the prior is true
    assert not found.at_end
    assert found.cautious >= found.strength
    assert found.errors.shape == (9, 4)
    assert seen[-1] == 1.0
    assert len(seen) == 36
    assert (np.diff(seen) > 0).all()
    error = [
        np.linalg.norm(
            fit_nonlinear(
                lambda x: (A @ x - y, A), np.zeros(40), prior=prior.with_strength(strength),
                loss=loss, sigma_known=True,
            ).x - truth
        )
        for strength in (found.strength, 1e-4)
    ]  # fmt: skip
    assert error[0] < 0.7 * error[1]


def test_folds_that_cut_measurements_are_refused():
    _, _, _, linearise = linear(M=20)
    masks = k_folds(range(20), 4, rng=0)
    with pytest.raises(InvalidValueError, match="partly"):
        select_strength(
            linearise, np.zeros(4), Prior.none(4), masks, block=np.arange(20) // 2, strengths=[1.0]
        )
    with pytest.raises(ShapeError, match="masks"):
        select_strength(linearise, np.zeros(4), Prior.none(4), masks[:, :5])


@pytest.mark.parametrize("loss", [Loss.SQUARES, Loss.TUKEY])
def test_noise_of_positions_and_orientations_is_told_apart(loss):
    rng = np.random.default_rng(2)
    A = rng.normal(size=(3000, 8))
    group = np.tile([0, 0, 0, 1, 1, 1], 500)
    noise = np.where(group == 0, 2e-4, 3e-3)
    y = A @ np.ones(8) + noise * rng.normal(size=3000)
    if loss is Loss.TUKEY:
        y[group == 1] += np.where(rng.random(1500) < 0.05, 0.5, 0.0)
    stated = np.where(group == 0, 1e-3, 1e-3)
    block = 2 * (np.arange(3000) // 6) + group if loss is Loss.TUKEY else np.arange(3000) // 6
    found = variance_components(
        lambda x: (A @ x - y, A), np.zeros(8), group=group, sigma=stated, block=block, loss=loss
    )
    assert found.converged
    wanted = [0.2, 3.0]
    assert np.allclose(found.factors, wanted, rtol=0.05 if loss is Loss.SQUARES else 0.25)
    assert np.isclose(found.freedom.sum(), 2992)
    assert abs(found.fit.scale - 1) < 1e-3
    weighted = np.linalg.lstsq(A / noise[:, None], y / noise)[0]
    if loss is Loss.SQUARES:
        assert np.abs(found.fit.x - weighted).max() < 0.1 * found.fit.deviations.min()


def test_group_without_rows_left_over_keeps_its_deviation():
    rng = np.random.default_rng(0)
    A = np.zeros((41, 3))
    A[:40, :2] = rng.normal(size=(40, 2))
    A[40, 2] = 1.0
    y = 0.3 * rng.normal(size=41)
    group = np.r_[np.zeros(40, int), 9]
    found = variance_components(lambda x: (A @ x - y, A), np.zeros(3), group=group)
    assert found.converged
    assert found.undetermined.tolist() == [9]
    assert found.factors[1] == 1.0
    assert 0.2 < found.factors[0] < 0.4
