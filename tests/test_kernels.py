"""Compiled kernels in the cases that no public call reaches; what they compute of ordinary robots
is held equal to Pinocchio in `identities`."""

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.kernels.decimation import add_rows
from robotmodels.kernels.erroneous_poses import erroneous_poses
from robotmodels.kernels.jerk_phases import polished_phases
from robotmodels.kernels.mass import joint_accelerations
from robotmodels.kernels.poses import improper_pose
from robotmodels.kernels.regressor_gradient import regressor_gradients
from robotmodels.kernels.regressors import torque_regressors
from robotmodels.se3 import from_rpy


def accelerations_of(mass, tau):
    """What `joint_accelerations` answers, and writes, for a mass matrix given as rotor inertia."""
    mass, tau = np.array(mass, dtype=float), np.atleast_2d(np.asarray(tau, dtype=float))
    n = len(mass)
    model = rm.RobotModel.from_table(rm.DHTable.from_rows([{"sigma": 1, "alpha": 0.3}] * n))
    rest, out = np.zeros(tau.shape), np.empty(tau.shape)
    code = joint_accelerations(
        rest, rest, tau, model.chain, np.zeros((n, 10)), model.gravity, mass, out
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


# --- derivatives -----------------------------------------------------------------------------


def small_tree():
    """Joints of both kinds behind and beside each other, one of them behind a fixed frame."""
    table = rm.DHTable(
        antecedent=[0, 1, 2, 2, 4, 5],
        sigma=[0, 1, 0, 2, 1, 0],
        alpha=[0.3, -0.7, 1.1, 0.4, -0.9, 0.6],
        d=[0.1, 0.4, -0.3, 0.2, 0.5, 0.3],
        theta=[0.0, 0.6, 0.0, -0.8, 0.5, 0.0],
        r=[0.2, 0.0, 0.3, -0.4, 0.0, 0.1],
    )
    model = rm.RobotModel.from_table(table)
    return model.with_base(from_rpy([0.3, -0.4, 0.8], [0.1, 0.2, 0.3]))


def test_contracted_regressors_change_as_their_gradient_says(rng):
    model = small_tree()
    motion = rng.uniform(-1.0, 1.0, (3, 1, model.n))
    place = np.arange(10 * model.f)
    G = rng.normal(size=(1, model.n, place.size))
    found = np.zeros(motion.shape)
    arm = (model.chain, model.gravity, place)
    regressor_gradients(*motion, *arm, G, *found)

    def contracted(change):
        W = np.empty(G.shape)
        torque_regressors(*(motion + change), *arm, W)
        return (G * W).sum()

    expected, h = np.empty(motion.shape), 1e-5
    for place_of_one in np.ndindex(motion.shape):
        one = np.zeros(motion.shape)
        one[place_of_one] = h
        expected[place_of_one] = (contracted(one) - contracted(-one)) / (2.0 * h)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)
    assert np.abs(expected).min() > 1e-3


# --- phases of constant jerk -----------------------------------------------------------------


def ends_of(durations, jerks, state):
    """States at the ends of phases, by summing the jerk's powers one after the other."""
    states = [np.array(state)]
    for t, j in zip(durations, jerks, strict=True):
        p, v, a = states[-1]
        states.append(np.array([p + v * t + a * t**2 / 2 + j * t**3 / 6, v + a * t + j * t**2 / 2,
                                a + j * t]))  # fmt: skip
    return np.array(states)


def test_phases_that_are_nearly_right_are_put_right(rng):
    """The goal is met to rounding, in the same time, and no phase without jerk accelerates more."""
    M = 6
    h = rng.uniform(0.2, 1.0, (M, 7))
    jerk = np.array([1.0, 0.0, -1.2, 0.0, -0.9, 0.0, 1.3]) * rng.uniform(0.5, 2.0, (M, 1))
    start = rng.normal(size=(M, 3))
    goal = np.array([ends_of(*one)[-1] for one in zip(h, jerk, start, strict=True)])
    near = h * (1.0 + 1e-6 * rng.normal(size=h.shape))
    near *= (h.sum(axis=1) / near.sum(axis=1))[:, None]
    level = np.array([ends_of(*one)[[1, 3, 5], 2] for one in zip(near, jerk, start, strict=True)])
    # the goal has to be met with the accelerations that the phases without jerk have
    for m in range(M):
        goal[m, 2] = level[m, 2] + jerk[m, 6] * near[m, 6]
    out, c = np.empty(h.shape), np.empty((M, 7, 4))
    polished_phases(near, jerk, start, goal, out, c)
    for m in range(M):
        states = ends_of(out[m], jerk[m], start[m])
        np.testing.assert_allclose(states[-1], goal[m], rtol=0, atol=3e-14)
        np.testing.assert_allclose(states[[1, 3, 5], 2], level[m], rtol=0, atol=1e-13)
        assert out[m].sum() == pytest.approx(near[m].sum(), rel=1e-14)
        np.testing.assert_allclose(out[m], near[m], rtol=1e-4)
        for k in range(7):
            np.testing.assert_allclose(c[m, k].sum(), states[k + 1, 0], rtol=0, atol=1e-13)
            slope = c[m, k, 1:] @ [1.0, 2.0, 3.0] / out[m, k]
            np.testing.assert_allclose(slope, states[k + 1, 1], rtol=0, atol=1e-12)


# --- postures and poses ----------------------------------------------------------------------


def test_poses_that_are_proper_to_rounding_and_others(rng):
    T = np.array([from_rpy(x[:3], x[3:]) for x in rng.uniform(-3.0, 3.0, (20, 6))])
    assert improper_pose(T) == -1
    assert improper_pose(T[:0]) == -1
    for change in range(7):
        bad = T.copy()
        if change == 0:
            bad[3, :3, 1] *= -1.0
        elif change == 1:
            bad[3, :3, 2] *= 1.0 + 1e-14
        elif change == 2:
            bad[3, :3, :3] = -bad[3, :3, :3]
        elif change == 3:
            bad[3, 3, 1] = 1e-300
        elif change == 4:
            bad[3, 1, 3] = np.nan
        elif change == 5:
            bad[3, 1, 1] = np.nan
        else:
            bad[3, :3, 0] += 1e-14 * bad[3, :3, 1]
        assert improper_pose(bad) == 3
        assert improper_pose(bad[4:]) == -1
