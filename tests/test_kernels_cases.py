"""Cases of the kernels that no ordinary robot meets."""

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.kernels.decimation import add_rows
from robotmodels.kernels.direct_dynamics import joint_accelerations
from robotmodels.kernels.erroneous_poses import erroneous_poses
from robotmodels.kernels.triangles import fold_equations, fold_rows
from robotmodels.se3 import from_rpy


def accelerations_of(mass, tau):
    """What `joint_accelerations` answers, and writes, for a mass matrix given as rotor inertia."""
    mass, tau = np.array(mass, dtype=float), np.atleast_2d(np.asarray(tau, dtype=float))
    n = len(mass)
    model = rm.RobotModel.from_table(rm.DHTable.from_rows([{"sigma": 1, "alpha": 0.3}] * n))
    rest, out = np.zeros(tau.shape), np.empty(tau.shape)
    code = joint_accelerations(
        rest, rest, tau, *model.chain, np.zeros((n, 10)), model.gravity, mass, out
    )
    return code, out


@pytest.mark.parametrize(
    "mass",
    [
        # what is left of the second pivot is nothing, and the third row has to take its place
        [[1, 1, 0], [1, 1, 1], [0, 1, 1]],
        # nothing on the diagonal at all
        [[0, 2, 0], [2, 0, 0], [0, 0, 3]],
        [[0, 0, 5], [0, -1, 0], [5, 0, 0]],
    ],
)
@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), (1e3, 1.0, 1e-3)], ids=["alike", "apart"])
def test_indefinite_mass_matrices_are_solved_by_exchanging_rows(mass, units):
    mass = np.array(mass) * np.outer(units, units)
    accelerations = np.array([[1.0, -2.0, 3.0], [0.5, 0.0, -4.0]]) / units
    code, out = accelerations_of(mass, accelerations @ mass)
    assert code == -2  # the first sample has a matrix with negative eigenvalues
    np.testing.assert_allclose(out * units, accelerations * units, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    "mass",
    [
        [[1, 1, 0], [1, 1, 0], [0, 0, 1]],
        [[1, 2, 3], [2, 4, 6], [3, 6, 9]],
        [[0, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[1, 2, 3], [2, 1, 3], [3, 3, 6]],  # indefinite, and the third row is the sum of the others
    ],
)
def test_singular_mass_matrices_are_told_whatever_their_sign(mass):
    code, out = accelerations_of(mass, [[1.0, 2.0, 3.0]])
    assert code == 0
    assert np.isnan(out).all()


@pytest.mark.parametrize("rows", [1, 3, 4, 66, 200])
def test_triangles_have_the_products_of_all_rows_folded_into_them(rng, rows):
    """R^T R = sum of A^T A over the pieces, also where columns are empty or one another's sums."""
    pieces = [rng.normal(size=(rows, 6)) for _ in range(3)]
    for A in pieces:
        A[:, 2] = 0.0
        A[:, 4] = A[:, 0] - 2.0 * A[:, 1]
    R = np.zeros((6, 6))
    for A in pieces:
        fold_rows(A, R)
    np.testing.assert_array_equal(R, np.triu(R))
    whole = np.vstack(pieces)
    np.testing.assert_allclose(R.T @ R, whole.T @ whole, rtol=0, atol=1e-12 * rows)


def test_triangles_of_equations_take_the_rows_and_columns_asked_for(rng):
    W, y = rng.normal(size=(150, 2, 7)), rng.normal(size=(150, 2))
    rows, columns = np.flatnonzero(rng.random(150) < 0.7), np.array([1, 2, 5])
    R = np.zeros((4, 4))
    fold_equations(W, y, 1, rows, columns, R)
    A = np.column_stack((W[rows, 1][:, columns], y[rows, 1]))
    np.testing.assert_allclose(R.T @ R, A.T @ A, rtol=0, atol=1e-11)


def test_a_parameter_that_acts_on_several_elements_moves_the_end_by_all_of_them(rng):
    """One deviation that is added to elements of two rows, one of them twice, with factors."""
    nominal = rng.uniform(-1.0, 1.0, (3, 7))
    sigma, joint = np.array([0, 1, 0]), np.arange(3)
    path, q = np.arange(3), rng.uniform(-1.0, 1.0, (2, 3))
    owner = np.array([0, 0, 0, 0, 1])
    row, element = np.array([0, 1, 1, 2, 2]), np.array([5, 3, 4, 2, 0])
    factor = rng.uniform(0.5, 2.0, (2, 5))
    before, after = from_rpy([0.1, 0.2, 0.3], [1, 2, 3]), from_rpy([0.3, -0.5, 0.1], [0.2, 0, 1])

    def poses(deviation):
        T, psi = np.empty((2, 4, 4)), np.empty((2, 6, 2))
        erroneous_poses(
            q, nominal, sigma, joint, path,
            np.ascontiguousarray(before[:3, :3]), np.ascontiguousarray(before[:3, 3]),
            np.ascontiguousarray(after[:3, :3]), np.ascontiguousarray(after[:3, 3]),
            np.asarray(deviation, dtype=float), owner, row, element, factor, T, psi,
        )  # fmt: skip
        return T, psi

    x, h = np.array([0.02, -0.03]), 1e-6
    T, psi = poses(x)
    for k in range(2):
        ahead, behind = (poses(x + s * h * np.eye(2)[k])[0] for s in (1.0, -1.0))
        rate = (ahead - behind) / (2.0 * h)
        turn = rate[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2)
        w = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=-1)
        np.testing.assert_allclose(psi[:, :3, k], rate[:, :3, 3], rtol=0, atol=1e-8)
        np.testing.assert_allclose(psi[:, 3:, k], w, rtol=0, atol=1e-8)


@pytest.mark.parametrize("piece", [1, 3, 5, 40])
def test_thinned_rows_are_the_weighted_sums_around_their_centres(rng, piece):
    """By the definition, whatever the pieces that rows come in, and for rows that are left out."""
    N, step, centre = 40, 3, 4
    rows, use = rng.normal(size=(N, 2, 3)), rng.random((N, 2)) < 0.8
    taps = np.array([0.1, 0.2, 0.5, 0.9, 0.5, 0.2, 0.1])
    sums, weights = np.zeros((9, 2, 3)), np.zeros((9, 2))
    for first in range(0, N, piece):
        some = slice(first, first + piece)
        kept = use[some].astype(np.int64).ravel()
        own = np.ascontiguousarray(rows[some])
        add_rows(own, kept, np.array([0, 1]), taps, step, first, centre, sums, weights)
    expected, total = np.zeros_like(sums), np.zeros_like(weights)
    for o in range(9):
        for away in range(-3, 4):
            i = centre + o * step + away
            if 0 <= i < N:
                expected[o] += taps[away + 3] * rows[i] * use[i][:, None]
                total[o] += taps[away + 3] * use[i]
    expected[:, 1, 0] = 0.0  # columns before the first one that counts are not touched
    np.testing.assert_allclose(sums, expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(weights, total, rtol=0, atol=1e-14)


@pytest.mark.parametrize("reference", ["world_aligned", "local", "world"])
@pytest.mark.parametrize("name", ["rx90", "stanford_arm"])
def test_a_tool_far_from_its_frame_accelerates_as_its_velocity_changes(rng, name, reference):
    model = rm.load(name)
    model = model.with_tool(from_rpy([0.3, -0.5, 0.9], [0.4, -0.7, 0.5]))
    q, v, a = rng.uniform(-1.0, 1.0, (3, 6, model.n)) * [[[1.0]], [[2.0]], [[3.0]]]
    h = 1e-5

    def twist(t):
        return rm.dkm(model, q + t * v + 0.5 * t * t * a, v + t * a, reference=reference)

    expected = (twist(h) - twist(-h)) / (2.0 * h)
    found = rm.dkm_second_order(model, q, v, a, reference=reference)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)
