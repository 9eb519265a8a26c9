"""The continuation of curves, on curves whose solutions are known."""

import numpy as np
import pytest
from numba import njit

from robotmodels.kernels import continuation


@njit
def residual(x, data, F, J):
    """A circle; or y = sin(x) with ``eps f(x)`` that is nearly met, f by its roots or a cosine."""
    kind, eps, roots = data
    J[:] = 0.0
    if kind == 0:
        F[0], F[1] = x[0] ** 2 + x[1] ** 2 - 1.0, 0.0
        J[0, 0], J[0, 1] = 2.0 * x[0], 2.0 * x[1]
        return
    F[0], J[0, 0], J[0, 1] = x[1] - np.sin(x[0]), -np.cos(x[0]), 1.0
    F[1], J[1, 0] = eps * np.cos(x[0]), -eps * np.sin(x[0])
    if kind == 2:
        F[1] = eps
        for r in roots:
            J[1, 0] = J[1, 0] * (x[0] - r) + F[1] if r != roots[0] else F[1]
            F[1] *= x[0] - r


_, begin, trace, solutions = continuation.curves_of(residual)


@njit
def traced(kind, eps, roots, start, period, most, longest):
    """Points of the curve both ways, what is missing there, why it ends, and the solutions."""
    data, n, rows = (kind, eps, roots), 2, 400
    work, curve = continuation.workspace(n), continuation.curve_of(rows, n)
    limits = (1e-10, 1e-4, longest, most, 10.0)
    beside = begin(data, start, curve, rows // 2, work, 1e-10)
    last, why = trace(data, period, curve, rows // 2, 1, limits, work)
    first, back = rows // 2, why
    if why != continuation.CLOSED:
        first, back = trace(data, period, curve, first, -1, limits, work)
    found, double = np.zeros((16, n)), np.zeros(16, np.int64)
    count = solutions(data, curve, first, last, 1e-14, found, double, work, 1e-10)
    part = slice(first, last + 1)
    return beside, curve[0][part], curve[3][part], (back, why), found[:count], double[:count]


# the kernel of these residuals takes ten seconds to compile; tests of `igm` and of singular curves
# follow such curves in every run
pytestmark = pytest.mark.nightly
NO_PERIOD, NO_ROOTS = np.zeros(2), np.zeros(1)


def test_a_closed_curve_of_fewer_equations_than_unknowns():
    beside, points, missing, ends, found, _ = traced(
        0, 0.0, NO_ROOTS, np.array([0.9, 0.5]), NO_PERIOD, 1.0, 0.2
    )
    assert beside < 1e-10
    assert ends[1] == continuation.CLOSED
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0, rtol=0, atol=1e-10)
    np.testing.assert_allclose(points[-1], points[0], rtol=0, atol=1e-12)
    angle = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert abs(abs(angle[-1] - angle[0]) - 2.0 * np.pi) < 1e-9
    assert np.abs(np.diff(angle)).max() < 0.25
    assert not missing.any()  # a continuum of solutions
    assert len(found) == 0


@pytest.mark.parametrize(
    "roots", [(-0.5, 1.0, 2.0), (0.3,), (1.0, 1.0 + 1e-4, -0.7), (0.9, 0.9 + 1e-2, 0.1, 0.15)]
)
@pytest.mark.parametrize("eps", [1e-2, 1e-5])
def test_solutions_on_a_nearly_singular_curve_are_all_found(roots, eps):
    _, _, missing, ends, found, double = traced(
        2, eps, np.array(roots), np.array([0.2, 0.1]), NO_PERIOD, 5.0 * eps, 0.1
    )
    assert ends == (continuation.OUTSIDE, continuation.OUTSIDE)
    expected = np.sort(roots)
    np.testing.assert_allclose(np.sort(found[:, 0]), expected, rtol=0, atol=2e-7)
    np.testing.assert_allclose(found[:, 1], np.sin(found[:, 0]), rtol=0, atol=1e-9)
    assert not double.any()
    assert (np.diff(np.sign(missing)) != 0).sum() <= len(roots)


def test_a_double_solution_is_one_and_marked():
    *_, found, double = traced(
        2, 1e-2, np.array([1.0, 1.0 + 1e-8]), np.array([0.2, 0.1]), NO_PERIOD, 0.1, 0.1
    )
    np.testing.assert_allclose(found, [[1.0, np.sin(1.0)]], rtol=0, atol=1e-7)
    assert double.tolist() == [1]


def test_periodic_unknowns_close_a_curve():
    _, points, _, ends, found, _ = traced(
        1, 1e-3, NO_ROOTS, np.array([0.2, 0.1]), np.array([2.0 * np.pi, 0.0]), 1.0, 0.1
    )
    assert ends[1] == continuation.CLOSED
    np.testing.assert_allclose(np.abs(points[-1] - points[0]), [2 * np.pi, 0.0], atol=1e-10)
    np.testing.assert_allclose(np.sort(np.cos(found[:, 0])), 0.0, atol=1e-9)
    np.testing.assert_allclose(np.sort(found[:, 1]), [-1.0, 1.0], atol=1e-9)


def test_a_curve_ends_where_its_room_or_its_step_ends():
    *_, ends, _, _ = traced(1, 1e-3, NO_ROOTS, np.array([0.2, 0.1]), NO_PERIOD, 1.0, 1e-2)
    assert ends == (continuation.NO_ROOM, continuation.NO_ROOM)
