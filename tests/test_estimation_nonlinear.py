"""Nonlinear least squares: a planar arm with errors of lengths and offsets, and decaying curves."""

import pickle

import numpy as np
import pytest

from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.estimation import (
    FitStatus,
    Loss,
    Prior,
    confidence_intervals,
    fit_nonlinear,
)

LENGTHS = np.array([0.5, 0.4, 0.3, 0.3, 0.2])


class Arm:
    """Positions of a planar chain: x is errors of 5 lengths (in a unit) and 5 angles."""

    def __init__(self, seed=0, N=300, noise=1e-4, share=0.0, outlier=0.02, unit=1.0):
        rng = np.random.default_rng(seed)
        self.unit = unit
        self.q = rng.uniform(-2, 2, (N, 5))
        self.truth = np.r_[rng.normal(0, 2e-3, 5) * unit, rng.normal(0, 3e-3, 5)]
        self.y = self.model(self.truth)[0] + noise * unit * rng.normal(size=(N, 2))
        self.bad = np.flatnonzero(rng.random(N) < share)
        self.y[self.bad] += outlier * unit * np.array([0.8, 0.6])
        self.block = np.repeat(np.arange(N), 2)

    def model(self, x):
        angle = np.cumsum(self.q + x[5:], axis=1)
        length = LENGTHS * self.unit + x[:5]
        c, s = np.cos(angle), np.sin(angle)
        J = np.empty((len(self.q), 2, 10))
        J[:, 0, :5], J[:, 1, :5] = c, s
        J[:, 0, 5:] = -np.cumsum((length * s)[:, ::-1], axis=1)[:, ::-1]
        J[:, 1, 5:] = np.cumsum((length * c)[:, ::-1], axis=1)[:, ::-1]
        return np.stack([(length * c).sum(1), (length * s).sum(1)], 1), J

    def __call__(self, x):
        p, J = self.model(x)
        return (p - self.y).ravel(), J.reshape(-1, 10)

    def fit(self, loss=Loss.SQUARES, **options):
        options = {"sigma": 1e-4 * self.unit, "block": self.block} | options
        return fit_nonlinear(self, np.zeros(10), loss=loss, **options)


@pytest.mark.parametrize("loss", Loss)
def test_exact_data_are_found_exactly(loss):
    arm = Arm(noise=0.0)
    fit = arm.fit(loss)
    assert fit.status is FitStatus.CONVERGED
    assert np.abs(fit.x - arm.truth).max() < 1e-14
    assert len(fit.outliers) == 0


@pytest.mark.parametrize("loss", Loss)
@pytest.mark.parametrize("share", [0.0, 0.1])
def test_millimetres_and_metres_give_the_same_answer(loss, share):
    one, other = (Arm(3, share=share, unit=unit) for unit in (1.0, 1000.0))
    unit = np.r_[np.full(5, 1000.0), np.ones(5)]
    a, b = one.fit(loss), other.fit(loss)
    assert a.converged
    assert b.converged
    assert np.abs(b.x / unit - a.x).max() < 1e-13
    assert np.allclose(b.deviations / unit, a.deviations, rtol=1e-9)
    assert a.outliers.tolist() == b.outliers.tolist()


def test_estimate_agrees_with_scipy():
    from scipy.optimize import least_squares

    arm = Arm(1, noise=1e-3)
    fit = arm.fit(sigma=1e-3)
    peer = least_squares(
        lambda x: arm(x)[0], np.zeros(10), lambda x: arm(x)[1], xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    assert np.abs(fit.x - peer.x).max() < 1e-10
    expected = np.linalg.inv(peer.jac.T @ peer.jac) * 2 * peer.cost / 590
    assert np.allclose(fit.covariance, expected, rtol=1e-6, atol=1e-16)
    # the estimate is where the slope of the sum is rounding
    r, J = arm(fit.x)
    assert np.abs(J.T @ r).max() < 1e-12 * np.linalg.norm(r) * np.linalg.norm(J)


@pytest.mark.parametrize("loss", [Loss.HUBER, Loss.CAUCHY, Loss.TUKEY])
@pytest.mark.parametrize("seed", range(4))
def test_outliers_do_not_move_a_robust_fit_by_its_deviation(loss, seed):
    arm = Arm(seed, share=0.1)
    clean = Arm(seed, share=0.0)
    assert len(arm.bad) > 15
    fit, reference = arm.fit(loss), clean.fit()
    limit = 1.0 if loss is not Loss.HUBER else 2.0  # the influence on Huber's is bounded, not zero
    moved = np.abs(fit.x - reference.x) / fit.deviations
    assert fit.converged
    assert np.sqrt((moved**2).mean()) < limit
    assert set(fit.outliers.tolist()) == set(arm.bad.tolist())
    assert (fit.weights[np.isin(fit.block, arm.bad)] < 0.05).all()
    assert 0.9 < fit.scale < 1.25
    # squares are moved, so that the data are a test
    assert np.abs(arm.fit().x - reference.x).max() > 10 * fit.deviations.max()


def test_estimate_of_tukey_is_a_stationary_point_of_its_loss():
    arm = Arm(2, share=0.1)
    fit = arm.fit(Loss.TUKEY)
    r, J = arm(fit.x)
    assert np.abs(J.T @ (fit.weights * r)).max() < 1e-11 * np.abs(J).T.dot(np.abs(r)).max()


def test_rows_may_come_in_any_order():
    arm = Arm(2, share=0.1)
    order = np.random.default_rng(0).permutation(600)
    mixed = fit_nonlinear(
        lambda x: tuple(part[order] for part in arm(x)), np.zeros(10), sigma=1e-4,
        block=7 + 3 * arm.block[order], loss="tukey",
    )  # fmt: skip
    plain = arm.fit(Loss.TUKEY)
    assert np.allclose(mixed.x, plain.x, rtol=0, atol=1e-14)
    assert set(mixed.outliers.tolist()) == set((7 + 3 * plain.outliers).tolist())
    assert np.allclose(mixed.weights, plain.weights[order], atol=1e-9)
    assert np.allclose(mixed.residuals, plain.residuals[order], atol=1e-14)


def decay(seed, outliers=0, N=80):
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 2, N)
    truth = np.array([2.0, 1.3, 0.5])
    y = truth[0] * np.exp(-truth[1] * t) + truth[2] + 0.02 * rng.normal(size=N)
    y[rng.permutation(N)[:outliers]] += 1.0

    def linearise(x):
        e = np.exp(-x[1] * t)
        return x[0] * e + x[2] - y, np.column_stack((e, -x[0] * t * e, np.ones(N)))

    return linearise, truth


@pytest.mark.parametrize(("loss", "outliers"), [("squares", 0), ("tukey", 8)])
def test_intervals_contain_the_truth_as_often_as_they_say(loss, outliers):
    inside = np.zeros(3)
    for seed in range(500):
        linearise, truth = decay(seed, outliers)
        fit = fit_nonlinear(linearise, [1.0, 1.0, 0.0], loss=loss)  # sigma 1 is far off: estimated
        low, high = confidence_intervals(fit, 0.95).T
        inside += (low <= truth) & (truth <= high)
        assert fit.converged
    assert 0.92 <= inside.mean() / 500 <= 0.97, inside


def test_blocks_of_three_rows_have_covered_intervals_too():
    rng = np.random.default_rng(4)
    inside = 0.0
    for _ in range(200):
        A = rng.normal(size=(120, 4))
        truth = rng.normal(size=4)
        y = A @ truth + rng.normal(size=120)
        y[:12] += 50.0
        fit = fit_nonlinear(
            lambda x, A=A, y=y: (A @ x - y, A), np.zeros(4), block=np.arange(120) // 3, loss="tukey"
        )
        low, high = confidence_intervals(fit).T
        inside += ((low <= truth) & (truth <= high)).mean()
    assert 0.92 <= inside / 200 <= 0.97


def test_the_median_of_residuals_counts_what_parameters_take():
    def scale(seed):
        rng = np.random.default_rng(seed)
        A, e = rng.normal(size=(40, 20)), rng.normal(size=40)
        return fit_nonlinear(lambda x: (A @ x - e, A), np.zeros(20), loss="huber").scale

    assert 0.9 < np.median([scale(seed) for seed in range(100)]) < 1.1


def test_known_deviation_is_taken_as_stated():
    arm = Arm(1)
    free, known = arm.fit(sigma=1e-5), arm.fit(sigma=1e-5, sigma_known=True)
    assert np.allclose(free.x, known.x)
    assert 9 < free.scale < 11
    assert np.allclose(known.deviations * free.scale, free.deviations)


def test_prior_is_the_maximum_a_posteriori():
    rng = np.random.default_rng(0)
    A, y = rng.normal(size=(8, 12)), rng.normal(size=8)
    prior = Prior(rng.normal(size=12), rng.uniform(0.5, 2.0, 12), strength=3.0)
    fit = fit_nonlinear(lambda x: (A @ x - y, A), np.zeros(12), prior=prior, sigma_known=True)
    information = A.T @ A + np.diag(3.0 / prior.deviation**2)
    expected = np.linalg.solve(information, A.T @ y + 3.0 * prior.mean / prior.deviation**2)
    assert fit.status is FitStatus.CONVERGED
    assert np.allclose(fit.x, expected, rtol=1e-10)
    assert np.allclose(fit.covariance, np.linalg.inv(information))
    assert 0 < fit.freedom < 8
    # noise that is estimated counts for the measurements alone
    free = fit_nonlinear(lambda x: (A @ x - y, A), np.zeros(12), prior=prior)
    back = np.linalg.inv(information)
    middle = free.scale**2 * A.T @ A + np.diag(3.0 / prior.deviation**2)
    assert not 0.9 < free.scale < 1.1
    assert np.allclose(free.covariance, back @ middle @ back)
    robust = fit_nonlinear(
        lambda x: (A @ x - y, A), np.zeros(12), prior=prior, sigma_known=True, loss="huber"
    )
    assert robust.converged


def test_singular_direction_is_reported_and_the_rest_is_right():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(30, 4))
    A[:, 3] = 2.0 * A[:, 2]
    y = A @ [1.0, 2.0, 3.0, 0.0] + 0.01 * rng.normal(size=30)
    fit = fit_nonlinear(lambda x: (A @ x - y, A), np.zeros(4))
    assert fit.status is FitStatus.SINGULAR
    assert fit.rank == 3
    assert np.isinf(fit.deviations).tolist() == [False, False, True, True]
    direction = fit.dropped[0] / fit.dropped[0][3]
    assert np.allclose(direction, [0, 0, -2, 1], atol=1e-12)
    held = fit_nonlinear(lambda x: (A @ x - y, A), np.zeros(4), truncation=1e-9)
    assert held.converged
    assert np.isfinite(held.deviations).all()
    assert np.allclose(held.x, fit.x)
    known = Prior(np.zeros(4), [np.inf, np.inf, np.inf, 1.0])
    assert fit_nonlinear(lambda x: (A @ x - y, A), np.zeros(4), prior=known).converged


def test_column_without_effect_is_singular():
    A = np.column_stack((np.ones(5), np.zeros(5)))
    fit = fit_nonlinear(lambda x: (A @ x - np.arange(5.0), A), np.zeros(2))
    assert fit.status is FitStatus.SINGULAR
    assert np.isclose(fit.x[0], 2.0)
    assert np.isinf(fit.deviations[1])
    assert np.isfinite(fit.deviations[0])


def test_condition_of_a_million_keeps_its_digits():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(500, 6))
    A[:, 5] = A[:, 4] + 1e-6 * A[:, 5]
    truth = np.arange(1.0, 7.0)
    fit = fit_nonlinear(lambda x: (A @ (x - truth), A), np.zeros(6))
    assert fit.converged
    assert np.abs(fit.x - truth).max() < 1e-8
    assert fit.singular_values[0] / fit.singular_values[-1] > 1e6


def test_far_start_and_wrong_jacobian():
    t = np.linspace(0.1, 2, 40)

    def rosenbrock(x):
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]), np.array(
            [[-20 * x[0], 10.0], [-1, 0]]
        )

    for damping in (0.0, 0.1):
        fit = fit_nonlinear(rosenbrock, [-1.2, 1.0], damping=damping, iterations=200)
        assert fit.converged
        assert np.allclose(fit.x, 1.0, rtol=1e-10)
    uphill = fit_nonlinear(
        lambda x: (np.exp(-x[0] * t) - 0.5 * t, (t * np.exp(-x[0] * t))[:, None]), [1.0]
    )
    assert uphill.status is FitStatus.STALLED
    short = fit_nonlinear(rosenbrock, [-1.2, 1.0], iterations=2)
    assert short.status is FitStatus.ITERATION_LIMIT
    assert short.iterations == 2


def test_trial_that_is_not_a_number_is_damped():
    y = np.array([0.1, 0.2, 0.3])

    def linearise(x):
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.log(x[0]) * np.ones(3) - np.log(y), np.full((3, 1), 1 / x[0])

    fit = fit_nonlinear(linearise, [5.0])  # the first full step is below zero
    assert fit.converged
    assert np.isclose(fit.x[0], np.exp(np.log(y).mean()))
    assert fit.steps[0, 3] > 0


def test_as_many_rows_as_parameters_leave_no_noise_to_estimate():
    fit = fit_nonlinear(lambda x: (x - 1.0, np.eye(2)), np.zeros(2))
    assert fit.converged
    assert np.isnan(fit.deviations).all()
    known = fit_nonlinear(lambda x: (x - 1.0, np.eye(2)), np.zeros(2), sigma_known=True)
    assert np.allclose(known.deviations, 1.0)


def test_mistakes_are_named():
    def linear(x):
        return x - 1.0, np.eye(2)

    for options, error, text in (
        ({"sigma": -1.0}, InvalidValueError, "positive"),
        ({"sigma": [1.0, 2.0, 3.0]}, ShapeError, "sigma"),
        ({"block": [0.0, 1.0]}, InvalidValueError, "whole"),
        ({"block": [0]}, ShapeError, "block"),
        ({"loss": "cubes"}, InvalidValueError, "tukey"),
        ({"prior": Prior.none(3)}, ShapeError, "prior"),
        ({"truncation": 2.0}, InvalidValueError, "truncation"),
        ({"iterations": 0}, InvalidValueError, "iterations"),
    ):
        with pytest.raises(error, match=text):
            fit_nonlinear(linear, np.zeros(2), **options)
    with pytest.raises(InvalidValueError, match="finite"):
        fit_nonlinear(lambda x: (x * np.nan, np.eye(2)), np.zeros(2))
    with pytest.raises(ShapeError, match="Jacobian"):
        fit_nonlinear(lambda x: (x, np.ones((3, 2))), np.zeros(2))
    with pytest.raises(InvalidValueError, match="standard deviations"):
        Prior([0.0], [0.0])


def test_fit_pickles_read_only():
    fit = pickle.loads(pickle.dumps(Arm(0).fit()))
    assert fit.converged
    assert not fit.covariance.flags.writeable
    assert not fit.x.flags.writeable
