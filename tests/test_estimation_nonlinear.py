"""Nonlinear least squares: a planar arm with errors of lengths and offsets, and decaying curves."""

import numpy as np
import pytest

from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.estimation import FitStatus, Loss, Prior, fit_nonlinear
from robotmodels.estimation.linearised import checked_problem, linear_problem
from robotmodels.estimation.losses import terms_of

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
    assert np.allclose(b.standard_errors / unit, a.standard_errors, rtol=1e-9)
    assert a.outliers.tolist() == b.outliers.tolist()


@pytest.mark.parametrize("loss", [Loss.HUBER, Loss.CAUCHY, Loss.TUKEY])
@pytest.mark.parametrize("seed", range(2))
def test_outliers_do_not_move_a_robust_fit_by_its_deviation(loss, seed):
    arm = Arm(seed, share=0.1)
    clean = Arm(seed, share=0.0)
    assert len(arm.bad) > 15
    fit, reference = arm.fit(loss), clean.fit()
    assert fit.iterations < 30  # Newton's, with the curvature of the loss
    limit = 1.0 if loss is not Loss.HUBER else 2.0  # the influence on Huber's is bounded, not zero
    moved = np.abs(fit.x - reference.x) / fit.standard_errors
    assert fit.converged
    assert np.sqrt((moved**2).mean()) < limit
    assert set(fit.outliers.tolist()) == set(arm.bad.tolist())
    assert (fit.weights[np.isin(fit.block, arm.bad)] < 0.05).all()
    r, J = arm(fit.x)  # the slope of the loss is rounding
    assert np.abs(J.T @ (fit.weights * r)).max() < 1e-11 * np.abs(J).T.dot(np.abs(r)).max()
    assert 0.9 < fit.scale < 1.25
    # squares are moved, so that the data are a test
    assert np.abs(arm.fit().x - reference.x).max() > 10 * fit.standard_errors.max()


def test_rows_may_come_in_any_order():
    arm = Arm(2, share=0.1)
    order = np.random.default_rng(0).permutation(600)
    mixed = fit_nonlinear(
        lambda x: tuple(part[order] for part in arm(x)), np.zeros(10), sigma=1e-4,
        block=7 + 3 * arm.block[order], loss="tukey",
    )  # fmt: skip
    plain = arm.fit(Loss.TUKEY)
    assert mixed.iterations == plain.iterations
    assert np.allclose(mixed.x, plain.x, rtol=0, atol=1e-14)
    assert set(mixed.outliers.tolist()) == set((7 + 3 * plain.outliers).tolist())
    assert np.allclose(mixed.weights, plain.weights[order], atol=1e-9)
    assert np.allclose(mixed.residuals, plain.residuals[order], atol=1e-14)


def test_median_of_residuals_counts_what_parameters_take():
    def scale(seed):
        rng = np.random.default_rng(seed)
        A, e = rng.normal(size=(40, 20)), rng.normal(size=40)
        return fit_nonlinear(lambda x: (A @ x - e, A), np.zeros(20), loss="huber").scale

    assert 0.9 < np.median([scale(seed) for seed in range(100)]) < 1.1


def test_robust_covariance_is_the_formula_of_huber():
    """Variance of the influence over its squared mean slope, with the correction for P / M."""
    rng = np.random.default_rng(0)
    A, e = rng.normal(size=(60, 5)), rng.standard_t(3, size=60)
    fit = fit_nonlinear(lambda x: (A @ x - e, A), np.zeros(5), loss="huber")
    u = fit.residuals / fit.scale
    psi = np.clip(u, -1.344998, 1.344998)
    inside = np.abs(u) < 1.344998
    more = 1 + 5 / 60 * inside.var() / inside.mean() ** 2
    noise = (fit.scale * more) ** 2 * (psi @ psi) / 55 / inside.mean() ** 2
    assert np.allclose(fit.covariance, noise * np.linalg.inv(A.T @ A), rtol=1e-5)


def test_outliers_of_squares_are_judged_by_deleted_residuals():
    rng = np.random.default_rng(1)
    A = rng.normal(size=(40, 4))
    A[0] *= 20.0  # this measurement draws the fit to itself
    y = 0.01 * rng.normal(size=40)
    y[0] += 3.0
    y[7:9] += 0.5
    fit = fit_nonlinear(lambda x: (A @ x - y, A), np.zeros(4))
    assert abs(fit.residuals[0]) < np.abs(fit.residuals[7:9]).min()
    assert set(fit.outliers.tolist()) == {0, 7, 8}
    assert not len(fit_nonlinear(lambda x: (A[1:7] @ x - y[1:7], A[1:7]), np.zeros(4)).outliers)


def test_known_deviation_is_taken_as_stated():
    arm = Arm(1)
    free, known = arm.fit(sigma=1e-5), arm.fit(sigma=1e-5, sigma_known=True)
    assert np.allclose(free.x, known.x)
    assert 9 < free.scale < 11
    assert np.allclose(known.standard_errors * free.scale, free.standard_errors)
    for sure, error in ((True, 1.0), (False, np.nan)):  # as many rows as parameters
        fit = fit_nonlinear(lambda x: (x - 1.0, np.eye(2)), np.zeros(2), sigma_known=sure)
        assert fit.converged
        assert np.allclose(fit.standard_errors, error, equal_nan=True)


def test_prior_is_the_maximum_a_posteriori():
    rng = np.random.default_rng(0)
    A, y = rng.normal(size=(8, 12)), rng.normal(size=8)
    prior = Prior(rng.normal(size=12), rng.uniform(0.5, 2.0, 12), strength=3.0)

    def fit(**options):
        return fit_nonlinear(lambda x: (A @ x - y, A), np.zeros(12), prior=prior, **options)

    known, free = fit(sigma_known=True), fit()
    information = A.T @ A + np.diag(3.0 / prior.sigma**2)
    expected = np.linalg.solve(information, A.T @ y + 3.0 * prior.mean / prior.sigma**2)
    assert known.status is FitStatus.CONVERGED
    assert np.allclose(known.x, expected, rtol=1e-10)
    assert np.allclose(known.covariance, np.linalg.inv(information))
    assert 0 < known.freedom < 8
    # noise that is estimated counts for the measurements alone
    back = np.linalg.inv(information)
    middle = free.scale**2 * A.T @ A + np.diag(3.0 / prior.sigma**2)
    assert not 0.9 < free.scale < 1.1
    assert np.allclose(free.covariance, back @ middle @ back)
    assert fit(sigma_known=True, loss="huber").converged


def test_singular_direction_is_reported_and_the_rest_is_right():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(30, 5))
    A[:, 3], A[:, 4] = 2.0 * A[:, 2], 0.0
    y = A @ [1.0, 2.0, 3.0, 0.0, 0.0] + 0.01 * rng.normal(size=30)

    def fit(**options):
        return fit_nonlinear(lambda x: (A @ x - y, A), np.zeros(5), **options)

    for loss in Loss:
        singular, held = fit(loss=loss), fit(loss=loss, truncation=1e-9)
        assert singular.status is FitStatus.SINGULAR
        assert singular.rank == 3
        assert np.isinf(singular.standard_errors).tolist() == [False, False, True, True, True]
        along = singular.dropped @ np.diag(1.0 / np.array([1.0, 1.0, -2.0, 1.0, 1.0]))
        assert np.allclose(along[:, :2], 0.0, atol=1e-12)
        assert np.allclose(along[:, 2], along[:, 3], atol=1e-12)
        assert held.converged
        assert np.isfinite(held.standard_errors).all()
        assert np.allclose(held.x, singular.x)
        assert held.x[4] == 0.0
    known = Prior(np.zeros(5), [np.inf, np.inf, np.inf, 1.0, 1.0])
    assert fit(prior=known).converged


def test_far_start_and_wrong_jacobian():
    t = np.linspace(0.1, 2, 40)

    def rosenbrock(x):
        J = [[-20 * x[0], 10.0], [-1, 0]]
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]), np.array(J)

    fit = fit_nonlinear(rosenbrock, [-1.2, 1.0])
    assert fit.converged
    assert np.allclose(fit.x, 1.0, rtol=1e-10)
    uphill = fit_nonlinear(
        lambda x: (np.exp(-x[0] * t) - 0.5 * t, (t * np.exp(-x[0] * t))[:, None]), [1.0]
    )
    assert uphill.status is FitStatus.STALLED
    short = fit_nonlinear(rosenbrock, [-1.2, 1.0], iterations=2)
    assert (short.status, short.iterations) == (FitStatus.ITERATION_LIMIT, 2)


@pytest.mark.parametrize("damping", [0.0, 1e-6, 1.0])
def test_a_damped_step_is_that_of_marquardt_and_predicts_the_decrease(rng, damping):
    """(A^T A + damping s_1^2 D^2) dx = -A^T r, with D the lengths of the columns."""
    A, r = rng.normal(size=(30, 4)) * [1.0, 10.0, 0.01, 1.0], rng.normal(size=30)
    problem, point = checked_problem(lambda x: (A @ x + r, A), np.zeros(4), 1.0, None, None)
    linear = linear_problem(problem, terms_of(Loss.SQUARES, problem.rows, 1.0), point, 0.0)
    dx, gain, _ = linear.step(damping)
    D = np.linalg.norm(A, axis=0)
    s = np.linalg.svd(A / D, compute_uv=False)
    expected = np.linalg.solve(A.T @ A + damping * s[0] ** 2 * np.diag(D**2), -A.T @ r)
    np.testing.assert_allclose(dx * D, expected * D, rtol=0, atol=1e-12)
    left = A @ dx + r
    assert gain == pytest.approx(r @ r - left @ left, rel=1e-9)


def test_mistakes_are_named():
    def mean(x):
        return x - np.arange(4.0), np.ones((4, 1))

    fewer = iter((mean, lambda x: (np.zeros(3), np.ones((3, 1)))))
    for linearise, x0, options, error, words in (
        (mean, [], {}, ShapeError, "P at least 1"),
        (lambda x: (x - np.ones(4), np.ones((3, 1))), [0.0], {}, ShapeError, r"Jacobian \(4, 1\)"),
        (lambda x: (x + 1e200, np.eye(1)), [0.0], {}, InvalidValueError, "overflow at x0"),
        (lambda x: next(fewer)(x), [0.0], {}, ShapeError,
         r"residuals \(4,\) and a Jacobian \(4, 1\), got \(3,\)"),
        (mean, [0.0], {"sigma": -1.0}, InvalidValueError, "positive"),
        (mean, [0.0], {"block": [0.0, 1.0, 2.0, 3.0]}, ShapeError, "4 whole numbers, got 1 and fl"),
        (mean, [0.0], {"loss": "cubes"}, InvalidValueError, "tukey"),
        (mean, [0.0], {"prior": Prior.none(3)}, ShapeError, "a prior of 1 parameters"),
        (mean, [0.0], {"truncation": 2.0}, InvalidValueError, "truncation"),
        (mean, [0.0], {"iterations": 0}, InvalidValueError, "iterations"),
    ):  # fmt: skip
        with pytest.raises(error, match=words):
            fit_nonlinear(linearise, x0, **options)
    with pytest.raises(InvalidValueError, match="standard deviations"):
        Prior([0.0], [0.0])
