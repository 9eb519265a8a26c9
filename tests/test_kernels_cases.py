"""Cases of the kernels that no ordinary robot meets."""

import numpy as np
import pytest
from numba import njit

import robotmodels as rm
from robotmodels.igm import _homing
from robotmodels.igm._arrange import AT_LIMIT
from robotmodels.igm._regular import ordered_rows
from robotmodels.kernels.bounded_velocity import nearest_inside
from robotmodels.kernels.decimation import add_rows
from robotmodels.kernels.erroneous_poses import erroneous_poses
from robotmodels.kernels.inverses import inverses
from robotmodels.kernels.jerk_phases import polished_phases
from robotmodels.kernels.mass import joint_accelerations
from robotmodels.kernels.poses import improper_pose
from robotmodels.kernels.posture_chains import following_postures
from robotmodels.kernels.regressor_gradient import regressor_gradients
from robotmodels.kernels.regressors import torque_regressors
from robotmodels.se3 import from_rpy

# Python cannot call what is inside kernels, unless it calls nothing: then as it is written
eliminated, least_of_square, size_of = (
    getattr(kernel, "py_func", kernel)
    for kernel in (_homing.eliminated, _homing.least_of_square, _homing.size_of)
)


@njit
def shortest(r, m, x, work):
    return _homing.shortest(r, m, x, work)


@njit
def nearest(x, F, f, wish, lower, upper, v, active, sides, press, r, z, E, R):
    return nearest_inside(x, F, f, wish, lower, upper, v, active, sides, press, r, z, E, R)


@njit
def ordered(marks, labels, references, given, joints, boxed, q, errors, flags, code, status):
    return ordered_rows(
        marks, labels, references, given, joints, boxed, q, errors, flags, code, status
    )


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


# --- small systems ---------------------------------------------------------------------------


def test_inverses_of_small_matrices_with_and_without_an_exchange_of_rows(rng):
    A = rng.normal(size=(12, 3, 3))
    A[:4, 0, 0] = 0.0
    A[4] = np.eye(3)[[1, 2, 0]]
    A[5] = np.eye(3)[[1, 0, 2]]
    inverse, conditioning, sign = np.empty(A.shape), np.empty(12), np.empty(12)
    assert inverses(A, inverse, conditioning, sign) == -1
    np.testing.assert_allclose(inverse @ A, np.broadcast_to(np.eye(3), A.shape), atol=1e-12)
    np.testing.assert_array_equal(sign, np.sign(np.linalg.det(A)))
    expected = 3.0 / (np.linalg.norm(A, axis=(1, 2)) * np.linalg.norm(inverse, axis=(1, 2)))
    np.testing.assert_allclose(conditioning, expected, rtol=1e-12)
    A[7, :, 1] = 0.0
    assert inverses(A, inverse, conditioning, sign) == 7


def homing_work(r, m):
    wide = max(m, 6) + 1
    return (
        np.zeros(6), np.zeros((6, m)), np.zeros((6, wide)), np.zeros((wide, 2 * wide)),
        np.zeros(wide), np.zeros(m, np.int64), np.zeros((1, 3)), np.zeros((1, 3)),
    )  # fmt: skip


def test_square_systems_of_newtons_method(rng):
    for n in (1, 2, 3, 6):
        A, b, x = rng.normal(size=(n, n)), rng.normal(size=n), np.empty(n)
        if n > 1:
            A[0, 0] = 0.0
        assert eliminated(np.column_stack((A, b)), n, x)
        np.testing.assert_allclose(A @ x, b, rtol=0, atol=1e-12 * np.linalg.cond(A))
        least = least_of_square(A, n, np.empty((n, 2 * n)))
        assert least == pytest.approx(1.0 / np.linalg.norm(np.linalg.inv(A)), rel=1e-10)
    A[-1] = A[0] + 1e-9 * A[-1]
    assert not eliminated(np.column_stack((A, b)), 6, x)
    assert least_of_square(np.zeros((2, 2)), 2, np.empty((2, 4))) == 0.0


@pytest.mark.parametrize(("r", "m"), [(6, 7), (3, 6), (4, 4), (6, 4), (5, 2)])
@pytest.mark.parametrize("dependent", [False, True])
def test_shortest_steps_of_newtons_method_are_those_of_the_pseudo_inverse(rng, r, m, dependent):
    A, b = rng.normal(size=(r, m)), rng.normal(size=r)
    if dependent:
        A[-1] = A[0]
        A[:, -1] = A[:, 0]
    work, x = homing_work(r, m), np.empty(m)
    work[2][:r, :m], work[2][:r, m] = A, b
    least = shortest(r, m, x, work)
    np.testing.assert_allclose(x, np.linalg.pinv(A, rcond=1e-9) @ b, rtol=0, atol=1e-11)
    values = np.linalg.svd(A, compute_uv=False)
    assert least == pytest.approx(values[min(r, m) - 1], rel=1e-9, abs=1e-14)


def test_the_size_of_an_error_is_the_larger_part_that_is_asked_for():
    e = np.array([3.0, 4.0, 12.0, 1.0, 2.0, 2.0])
    for mask, size in [
        ([1, 1, 1, 1, 1, 1], 13.0), ([1, 1, 0, 1, 1, 1], 5.0), ([0, 0, 0, 1, 1, 1], 3.0),
        ([1, 0, 0, 0, 1, 0], 3.0), ([0, 0, 0, 1, 0, 0], 1.0),
    ]:  # fmt: skip
        assert size_of(e, np.array(mask)) == size



@pytest.mark.parametrize(("f", "n"), [(1, 4), (3, 5), (5, 8), (6, 6)])
def test_velocities_inside_bounds_are_the_nearest_by_their_multipliers(rng, f, n):
    """What is missing of the wish is what the active bounds press, none of them outwards."""
    found = 0
    for _ in range(30):
        basis = np.linalg.qr(rng.normal(size=(n, n)))[0].T
        F, inside = np.ascontiguousarray(basis[:f]), rng.uniform(-1.0, 1.0, n)
        x = inside - F.T @ (F @ inside)
        lower, upper = inside - rng.uniform(0.0, 0.5, n), inside + rng.uniform(0.0, 0.5, n)
        wish = inside + 4.0 * rng.normal(size=n)
        v, sides, press, r, z = (np.zeros(n) for _ in range(5))
        active, E, R = np.zeros(n, np.int64), np.zeros((n, n)), np.zeros((n, n))
        k, joint, _, _ = nearest(
            x, F, f, wish, lower, upper, v, active, sides, press, r, z, E, R
        )  # fmt: skip
        assert joint == -1
        assert ((v >= lower - 1e-11) & (v <= upper + 1e-11)).all()
        np.testing.assert_allclose(v - F.T @ (F @ v), x, rtol=0, atol=1e-12)
        bound = np.where(sides > 0.0, upper[active], lower[active])[:k]
        np.testing.assert_allclose(v[active[:k]], bound, rtol=0, atol=1e-11)
        pressed = F[:, active[:k]] @ (sides[:k] * press[:k])
        np.testing.assert_allclose(F @ (wish - v), pressed, rtol=0, atol=1e-10)
        assert (press[:k] >= 0.0).all()
        found += k
    assert found > 20


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


def test_postures_go_on_where_they_change_least():
    """A way through a half turn is short, and beside a length of metres angles count by chords."""
    periodic, following = np.array([True, False]), np.empty((1, 3), np.int64)
    valid = np.ones((2, 3), np.bool_)
    now = [[3.0, 0.0], [-1.0, 0.2], [0.5, -0.3]]
    later = [[-3.1, 0.0], [-0.9, 0.2], [0.6, -0.3]]
    for order in ([0, 1, 2], [2, 0, 1], [1, 0, 2]):
        q = np.array([now, np.array(later)[order]])
        following_postures(q, valid, periodic, 0.5, following)
        np.testing.assert_array_equal(following[0], np.argsort(order))
    # the nearest by the chord is another one than by twice the chord's angle, or by signed lengths
    q = np.array([[[0.0, 0.0]] * 3, [[3.0, 0.0], [0.0, 1.5], [1.0, -3.0]]])
    following_postures(q, valid, periodic, 0.5, following)
    np.testing.assert_array_equal(following[0], [1, 1, 1])
    # near enough for all: nothing is compared, though another one would be nearer
    q = np.array([[[0.0, 0.0], [3.1, 0.0], [1.0, 1.0]], [[0.3, 0.0], [-2.9, 0.0], [1.0, 1.3]]])
    following_postures(q, valid, periodic, 0.5, following)
    np.testing.assert_array_equal(following[0], [0, 1, 2])


@pytest.mark.parametrize("named", [True, False], ids=["named", "not named"])
@pytest.mark.parametrize("boxed", [False, True], ids=["free", "within limits"])
@pytest.mark.parametrize("given", [True, False], ids=["reference", "no reference"])
def test_postures_of_a_plan_are_ordered_as_they_are_sorted(rng, given, boxed, named):
    N, S, n = 12, 5, 3
    q = rng.uniform(-np.pi, np.pi, (N, S, n))
    count = rng.integers(0, S + 1, N)
    joints = np.array([[-2.0, -6.0, -1.0], [3.0, 6.0, 2.0], [1.0, 1.0, 0.0]])
    references = rng.uniform(-6.0, 6.0, (N, n))
    ways = np.array([rng.permutation(S) for _ in range(N)])
    labels = np.array([7, 3, 9, 1, 5], np.int16) if named else np.empty(0, np.int16)
    marks = np.column_stack((count, np.zeros(N, int), np.zeros((N, S), int), ways))
    residual, flags = rng.random((N, S)), np.zeros((2, N, S), np.bool_)
    code, status = np.zeros((N, S), np.int16), np.zeros(N, np.int8)
    found, errors = q.copy(), residual.copy()
    most = ordered(
        marks, labels, references, int(given), joints, int(boxed), found, errors, flags, code,
        status,
    )  # fmt: skip
    low, high, turns = joints[0], joints[1], joints[2] == 1.0
    sizes = []
    for p in range(N):
        rows = []
        for i in range(count[p]):
            x = q[p, i].copy()
            goal = references[p] if given else 0.5 * (low + high)
            if boxed:
                # of all values inside the limits the nearest to the goal
                for j in np.flatnonzero(turns):
                    same = x[j] + 2.0 * np.pi * np.arange(-3, 4)
                    same = same[(same >= low[j] - AT_LIMIT) & (same <= high[j] + AT_LIMIT)]
                    x[j] = same[np.abs(same - goal[j]).argmin()] if same.size else np.nan
                if not ((x >= low - AT_LIMIT) & (x <= high + AT_LIMIT)).all():
                    continue
            way = x - references[p]
            if not boxed:
                way[turns] = np.angle(np.exp(1j * way[turns]))
            key = np.linalg.norm(way) if given else 0.0
            rows.append((key, labels[ways[p, i]] if named else 0, tuple(x), residual[p, i]))
        rows.sort()
        sizes.append(len(rows))
        k = len(rows)
        np.testing.assert_array_equal(flags[0, p], np.arange(S) < k)
        if not rows:
            continue
        np.testing.assert_allclose(found[p, :k], [row[2] for row in rows], rtol=0, atol=1e-14)
        np.testing.assert_array_equal(errors[p, :k], [row[3] for row in rows])
        if named:
            np.testing.assert_array_equal(code[p, :k], [row[1] for row in rows])
        else:
            ascending = sorted(row[2] for row in rows)
            np.testing.assert_array_equal(code[p, :k], [ascending.index(row[2]) for row in rows])
        inside = ((found[p, :k] >= low - AT_LIMIT) & (found[p, :k] <= high + AT_LIMIT)).all(axis=1)
        np.testing.assert_array_equal(flags[1, p, :k], inside)
        assert np.isnan(found[p, k:]).all()
    # poses without a posture are left to others
    assert most == -1 - max(sizes)
