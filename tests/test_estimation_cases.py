"""What estimation says to problems that are none, and to data with nothing in them."""

import numpy as np
import pytest

from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.estimation import (
    Loss,
    Prior,
    confidence_intervals,
    fit_diagnostics,
    fit_nonlinear,
    held_out,
    select_strength,
    variance_components,
)
from robotmodels.estimation._problem import Weighing, checked_problem
from robotmodels.estimation._step import linear_problem
from robotmodels.estimation.merging import merged_factor, merged_tree

Y = np.array([1.0, 2.0, 4.0, 3.0])


def mean_of(x):
    return x - Y, np.ones((4, 1))


@pytest.mark.parametrize(
    ("x0", "linearise", "error", "words"),
    [
        ([[0.0]], mean_of, ShapeError, r"x0: expected parameters of shape \(P,\)"),
        ([], mean_of, ShapeError, "P at least 1"),
        ([0.0], "mean", InvalidValueError, "linearise: expected a function of x"),
        ([0.0], lambda x: (x - Y, np.ones((3, 1))), ShapeError, r"a Jacobian \(M, 1\)"),
        ([0.0], lambda x: (1e200 * (x - Y), np.ones((4, 1))), InvalidValueError, "overflow at x0"),
    ],
)
def test_problems_that_are_none_are_named(x0, linearise, error, words):
    with pytest.raises(error, match=words):
        fit_nonlinear(linearise, x0)


def test_residuals_that_change_their_number_are_named():
    calls = []

    def fewer(x):
        calls.append(x)
        return mean_of(x) if len(calls) == 1 else (x - Y[:3], np.ones((3, 1)))

    with pytest.raises(ShapeError, match=r"residuals \(4,\) and a Jacobian \(4, 1\), got \(3,\)"):
        fit_nonlinear(fewer, [0.0])


@pytest.mark.parametrize("level", [0.0, 1.0, 95])
def test_levels_are_probabilities(level):
    with pytest.raises(InvalidValueError, match="between 0 and 1"):
        confidence_intervals(fit_nonlinear(mean_of, [0.0]), level)


@pytest.mark.parametrize(("group", "share"), [([0, 1, 2], 1.0), ([0, 1], 0.0), ([3, 3, 3], 0.5)])
def test_what_cannot_be_split_is_named(group, share):
    with pytest.raises(InvalidValueError, match=r"between 0 and 1|two groups or more"):
        held_out(group, share, 0)


def test_mistakes_in_priors():
    with pytest.raises(ShapeError, match="of one shape"):
        Prior([0.0, 0.0], [1.0])
    with pytest.raises(InvalidValueError, match="a strength from 0"):
        Prior([0.0], [1.0], -1.0)
    with pytest.raises(ShapeError, match="expected one of 1 parameters, got 2"):
        fit_nonlinear(mean_of, [0.0], prior=Prior([0.0, 0.0], [1.0, 1.0]))


@pytest.mark.parametrize(
    ("folds", "strengths", "words"),
    [
        (np.eye(4, dtype=bool), [-1.0, 1.0], "strengths: expected numbers from 0"),
        (np.ones((1, 4), dtype=bool), [1.0], "two or more"),
        (np.ones((2, 4), dtype=bool), [1.0], "some rows kept aside and some not"),
    ],
)
def test_mistakes_in_the_choice_of_a_strength(folds, strengths, words):
    with pytest.raises(InvalidValueError, match=words):
        select_strength(mean_of, [0.0], Prior([0.0], [1.0]), folds, strengths=strengths)


def test_groups_of_noise_have_a_number_for_each_row_and_progress_ends_at_one():
    with pytest.raises(InvalidValueError, match="a whole number for each row"):
        variance_components(mean_of, [0.0], group=[0.5, 1.0, 1.0, 2.0])
    with pytest.raises(ShapeError, match="group: expected one number for each of the 4 rows, got"):
        variance_components(mean_of, [0.0], group=[0, 0, 1])
    with pytest.raises(ShapeError, match="sigma"):
        variance_components(mean_of, [0.0], group=[0, 0, 1, 1], sigma=[1.0, 2.0])
    told = []
    variance_components(mean_of, [0.0], group=[0, 0, 1, 1], progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_exact_data_have_no_order_to_judge():
    t = np.arange(50.0)
    fit = fit_nonlinear(lambda x: (x[0] * t - 2.0 * t, t[:, None]), [2.0], sigma=0.1)
    found = fit_diagnostics(fit).independence
    assert np.isnan(found.statistic)
    assert np.isnan(found.p)
    assert found.passed
    assert "no residuals whose order" in found.sentence


def test_merging_nothing_is_nothing_and_order_is_kept():
    assert merged_tree([], lambda a, b: a + b) is None
    for count in range(1, 9):
        assert merged_tree(map(str, range(count)), lambda a, b: a + b) == "01234567"[:count]


def test_merged_factors_keep_products_and_leave_short_ones_alone(rng):
    A, B = rng.normal(size=(5, 4)), rng.normal(size=(6, 4))
    A[:, 1] = B[:, 1] = 0.0
    R = merged_factor(A, B)
    assert R.shape == (3, 4)
    np.testing.assert_allclose(R.T @ R, A.T @ A + B.T @ B, rtol=1e-13, atol=1e-13)
    few = merged_factor(A[:1], B[:2])
    np.testing.assert_array_equal(few, np.vstack((A[:1], B[:2])))


@pytest.mark.parametrize("damping", [0.0, 1e-6, 1e-2, 1.0, 100.0])
def test_a_damped_step_is_that_of_marquardt_and_predicts_what_it_gains(rng, damping):
    """(A^T A + damping s_1^2 D^2) dx = -A^T r, with D the lengths of the columns."""
    A, r = rng.normal(size=(30, 4)) * [1.0, 10.0, 0.01, 1.0], rng.normal(size=30)
    problem, point = checked_problem(lambda x: (A @ x + r, A), np.zeros(4), 1.0, None, None)
    linear = linear_problem(problem, Weighing.of(Loss.SQUARES, problem.rows, 1.0), point, 0.0, None)
    dx, gain, _ = linear.step(damping)
    D = np.linalg.norm(A, axis=0)
    s = np.linalg.svd(A / D, compute_uv=False)
    expected = np.linalg.solve(A.T @ A + damping * s[0] ** 2 * np.diag(D**2), -A.T @ r)
    np.testing.assert_allclose(dx * D, expected * D, rtol=0, atol=1e-12)
    left = A @ dx + r
    assert gain == pytest.approx(r @ r - left @ left, rel=1e-9)
