"""Linear models: independent columns, triangular factors."""

import numpy as np
import pytest

from robotmodels.errors import InvalidValueError
from robotmodels.estimation import column_basis
from robotmodels.estimation.covariance import jackknife_inflation
from robotmodels.estimation.factor import factors_of, merged, merged_all
from robotmodels.estimation.linear import solved


def test_random_ranks(rng):
    for _ in range(50):
        p, r = int(rng.integers(1, 12)), int(rng.integers(1, 12))
        W = rng.normal(size=(40, min(r, p))) @ rng.normal(size=(min(r, p), p))
        sizes = 10.0 ** rng.uniform(-4, 4, size=p)
        W *= sizes
        basis = column_basis(W, scale=1.0 / sizes)
        assert basis.rank == min(r, p)
        again = W[:, basis.kept] @ basis.coefficients
        assert np.allclose(again, W, rtol=0, atol=1e-8 * abs(W).max(axis=0))
        factor = column_basis(np.linalg.qr(W, mode="r"), scale=1.0 / sizes)
        assert factor.kept.tolist() == basis.kept.tolist()
        assert np.allclose(factor.coefficients, basis.coefficients, rtol=1e-8, atol=1e-8)


def test_gaps_of_empty_dependent_and_nearly_empty_columns(rng):
    W = rng.normal(size=(30, 6))
    W[:, 2] = 0.0
    W[:, 4] = W[:, 0] - W[:, 1]
    basis = column_basis(W)
    assert (basis.empty.tolist(), basis.dependent.tolist()) == ([2], [4])
    assert basis.coefficients[:, 4].tolist() == pytest.approx([1.0, -1.0, 0.0, 0.0])
    assert basis.gap[0] > 0.1
    assert basis.gap[1] < 1e-14
    W = rng.normal(size=(30, 6))
    W[:, 5] *= 1e-7  # independent of all, with little effect
    W[:, 3] = W[:, 0] + 1e-6 * W[:, 3]  # nearly dependent
    basis = column_basis(W)
    assert basis.kept.tolist() == [0, 1, 2, 3, 4, 5]
    assert basis.distance[3] == pytest.approx(1e-6, rel=0.5)
    assert basis.gap[0] == basis.distance[5] < 2e-7
    W[:, 5] *= 1e-8  # the distance of a dropped column is in the gap
    assert 1e-16 < column_basis(W).gap[1] < 2e-15


def test_short_columns_are_considered_last(rng):
    W = rng.normal(size=(40, 3))
    W[:, 0] = 1e-7 * W[:, 2]
    basis = column_basis(W)
    assert basis.kept.tolist() == [1, 2]
    assert basis.coefficients[:, 0].tolist() == pytest.approx([0.0, 1e-7], abs=1e-20)
    assert basis.coefficients[0, 0] == 0.0
    W[:, 0] = 0.1 * W[:, 2]  # columns of similar length are taken in their order
    assert column_basis(W).kept.tolist() == [0, 1]


def test_coefficients_that_are_rounding_are_zero(rng):
    kept = rng.normal(size=(50, 5))
    kept[:, 4] = kept[:, 0] + 1e-6 * kept[:, 4]  # magnifies rounding to 1e-10
    C = np.array([[1.0, 0.0], [0.0, 2.0], [0.0, 0.0], [3.0, 0.0], [0.0, 0.0]])
    basis = column_basis(np.hstack((kept, kept @ C)))
    assert basis.kept.tolist() == [0, 1, 2, 3, 4]
    assert ((basis.coefficients[:, 5:] != 0) == (C != 0)).all()
    assert np.allclose(basis.coefficients[:, 5:], C, atol=1e-14)


def test_merged_factors_have_the_products_of_both(rng):
    A, B = rng.normal(size=(5, 1, 3)), rng.normal(size=(6, 1, 3))
    A[:, :, 1] = B[:, :, 1] = 0.0
    parts = [
        factors_of(("a", "b", "c"), W, W[..., 0], np.ones(W.shape[:2], dtype=bool)) for W in (A, B)
    ]
    (R,) = merged(*parts).factors
    rows = np.vstack([np.column_stack((W[:, 0], W[:, 0, 0])) for W in (A, B)])
    assert R.shape == (3, 4)
    np.testing.assert_allclose(R.T @ R, rows.T @ rows, rtol=1e-13, atol=1e-13)
    few = factors_of(("a", "b", "c"), A[:1], A[:1, :, 0], np.ones((1, 1), dtype=bool))
    assert few.factors[0].shape == (1, 4)
    with pytest.raises(InvalidValueError, match="got none"):
        merged_all([])


def test_the_jackknife_is_that_of_estimates_without_one_segment(rng):
    A, e = rng.normal(size=(20, 12, 1, 3)), 0.1 * rng.normal(size=(20, 12, 1))
    x = np.array([1.0, 2.0, 3.0]) + rng.normal(size=(20, 3))  # different in each segment
    y, use = np.einsum("kimp,kp->kim", A, x) + e, np.ones((12, 1), dtype=bool)
    segments = [factors_of(("a", "b", "c"), A[k], y[k], use) for k in range(20)]
    whole = merged_all(segments)
    x, inverse, rest = solved(whole)
    errors = np.sqrt(rest / 237 * np.diag(inverse))
    others = [merged_all(segments[:k] + segments[k + 1 :]) for k in range(20)]
    moved = np.array([solved(other)[0] for other in others]) - x
    expected = np.sqrt(((moved**2).sum(axis=0) / errors**2).mean())
    found = jackknife_inflation(segments, whole, np.ones(1), errors)
    assert found > 1.0
    assert found == pytest.approx(expected, rel=1e-9)
    assert jackknife_inflation(segments, whole, np.ones(1), 10.0 * errors) == 1.0
