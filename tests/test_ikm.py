"""Inverse kinematic model: the decomposition, the methods, both orders, tasks and limits.

The kernels are held against NumPy's decomposition, written out here once more.
"""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from identities.random_robots import any_models, models, random_state, robot_size, seeds, within

import robotmodels as rm
from robotmodels.kinematics import (
    DampedInverse,
    Damping,
    FilteredInverse,
    IKMStatus,
    JointBounds,
    JointTask,
    PostureCriterion,
    PseudoInverse,
    dkm_second_order,
    ikm,
    ikm_second_order,
)
from robotmodels.kinematics.lengths import characteristic_length

REFERENCES = ("world_aligned", "local", "world")
POSITION = [1, 1, 1, 0, 0, 0]
TENTH = np.deg2rad(0.1)
METHODS = {
    "default": DampedInverse(),
    "pseudo": PseudoInverse(),
    "filtered": FilteredInverse(0.2),
    "weak": DampedInverse(0.3, 0.1),
    "constant": DampedInverse(largest=0.1, damping=Damping.CONSTANT),
    "smallest": DampedInverse(0.3, 0.1, Damping.SMALLEST_SINGULAR_VALUE),
    "manipulability": DampedInverse(0.05, 0.1, Damping.MANIPULABILITY),
}


# --- the same in NumPy -------------------------------------------------------------------------


def factors(method, s):
    """Factor of each of the singular values s (k,)."""
    if isinstance(method, PseudoInverse):
        keep = s > max(method.tolerance * s[0], 1e-13)
        return np.where(keep, 1.0, 0.0) / np.where(keep, s, 1.0)
    if isinstance(method, FilteredInverse):
        ratio = np.minimum(s / method.threshold, 1.0)
        below = ratio * (3 - 2 * ratio) / method.threshold
        return np.where(s < method.threshold, below, 1 / np.maximum(s, method.threshold))
    e, most = method.threshold, method.largest
    square = {
        Damping.CONSTANT: most**2 * np.ones_like(s),
        Damping.WEAK_DIRECTIONS: most**2 * np.maximum(1 - (s / e) ** 2, 0),
        Damping.SMALLEST_SINGULAR_VALUE: most**2 * np.maximum(1 - (s[-1:] / e) ** 2, 0)
        * np.ones_like(s),
        Damping.MANIPULABILITY: most**2 * np.maximum(1 - s.prod() / e, 0) ** 2 * np.ones_like(s),
    }[method.damping]  # fmt: skip
    tiny = s <= 1e-13
    return np.where(tiny, 0.0, s / np.where(tiny, 1.0, s**2 + square))


def scales(model, length=None, joint_weights=None, frame=None):
    """Factors of rows and of columns."""
    length = characteristic_length(model, frame) if length is None else length
    rows = np.array([1 / length] * 3 + [1.0] * 3)
    sliding = model.table.sigma[model.table.joint_rows] == 1
    weights = np.where(sliding, length**-2.0, 1.0) if joint_weights is None else joint_weights
    return rows, 1 / np.sqrt(weights)


def solved(J, twist, method, rows, columns, asked):
    """Joint velocities and singular values by NumPy."""
    A = (rows[:, None] * J * columns)[asked]
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    return columns * (Vt.T @ (factors(method, s) * (U.T @ (rows * twist)[asked]))), s, U


# --- first order against NumPy -----------------------------------------------------------------


@example(model=rm.load("panda"), seed=1)
@given(model=models(), seed=seeds)
def test_every_method_is_its_formula(model, seed):
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng, 4)
    twist = rng.normal(size=(4, 6))
    reference = REFERENCES[seed % 3]
    mask = rng.random(6) < 0.6
    mask[seed % 6] = True
    frame = int(rng.integers(0, model.f + 1))
    length, weights = rng.uniform(0.2, 2.0), rng.uniform(0.1, 10.0, model.n)
    rows, columns = scales(model, length, weights)
    for method in METHODS.values():
        found = ikm(model, q, twist, frame, reference, mask, method, weights, length)
        for i in range(4):
            J = rm.jacobian(model, q[i], frame, reference)
            v, s, _ = solved(J, twist[i], method, rows, columns, mask)
            # the slope of the factors between singular values and zero
            gain = max(factors(method, s).max(initial=10.0), min(method.gain, 1e3))
            within(found.singular_values[i], s, 1e-13 * max(1.0, s.max(initial=0)))
            # a perturbation of J by e changes v by some e gain^2
            if gain < 1e5:
                within(found.v[i], v, 1e-13 * (1 + gain**2) * (1 + s.max(initial=0)) * 10)
            size = max(1.0, np.abs(found.v[i]).max())
            within(found.achieved[i], mask * (J @ found.v[i]), 1e-12 * size)
            within(found.achieved[i] + found.error[i], mask * twist[i], 1e-9)


@given(model=any_models(), seed=seeds)
def test_the_range_of_the_jacobian_decides_the_status(model, seed):
    rng = np.random.default_rng(seed)
    q, v, _ = random_state(model, rng, 5)
    twist = rng.normal(size=(5, 6))
    twist[0], twist[1] = rm.dkm(model, q[0], v[0]), 0.0
    found = ikm(model, q, twist)
    rows, columns = scales(model)
    for i in range(5):
        A = rows[:, None] * rm.jacobian(model, q[i]) * columns
        U, s, _ = np.linalg.svd(A, full_matrices=False)
        size = np.linalg.norm(A)
        if ((s > 1e-12 * size) & (s < 1e-8 * size)).any():
            continue  # neither singular nor regular
        rank = int((s > 1e-10 * size).sum())
        assert found.rank[i] == rank
        reachable = U[:, :rank] @ (U[:, :rank].T @ (rows * twist[i]))
        # the range turns by what rounding is of the least singular value
        sure = 1e-13 + 1e-14 * size / s[:rank].min(initial=1.0)
        within(found.reachable[i] * rows, reachable, sure)
        missing = np.linalg.norm(rows * twist[i] - reachable)
        code = found.status[i]
        if missing > 1e-6:
            assert code in (IKMStatus.SINGULAR, IKMStatus.TOO_FEW_JOINTS)
        elif code == IKMStatus.MET:
            within(found.error[i], np.zeros(6), 1e-8 * max(1.0, np.abs(twist[i]).max()))
        else:
            assert code == IKMStatus.IN_PART
            assert s[rank - 1] < DampedInverse().threshold
    assert found.status[1] == IKMStatus.MET
    within(found.v[1], np.zeros(model.n), 0.0)


# --- near singular positions -------------------------------------------------------------------


def rx90_near(what, away=TENTH):
    """Posture of an RX-90 next to one singular position, regular otherwise.

    Its Jacobian is singular where C3 = 0 (elbow), S5 = 0 (wrist) or S23 RL4 - C2 D3 = 0 (shoulder).
    """
    q = np.array([0.3, -0.3, 0.6, -0.8, 1.1, 0.5])
    if what == "elbow":
        q[2] = -np.pi / 2 + away  # stretched; folded, at +90 deg, the shoulder is singular too
    elif what == "wrist":
        q[4] = away
    else:  # RL4 = D3
        q[1] = np.arctan2(1 - np.sin(q[2]), np.cos(q[2])) + away
    return q


@pytest.mark.parametrize("what", ["elbow", "wrist", "shoulder"])
def test_a_tenth_of_a_degree_from_the_singular_positions_of_an_rx90(what, rng):
    model, q = rm.load("rx90"), rx90_near(what)
    rows, _ = scales(model)
    twist = rng.normal(size=(2000, 6)) * 10.0 ** rng.uniform(-3, 1, (2000, 1))
    size = np.linalg.norm(rows * twist, axis=1)
    found, exact = ikm(model, q, twist), ikm(model, q, twist, method=PseudoInverse())
    assert (found.status == IKMStatus.IN_PART).all()
    assert (found.rank == 6).all()

    # bounded, where the exact solution is not
    speed = np.linalg.norm(found.v, axis=1)
    assert (speed <= DampedInverse().gain * size).all()
    assert np.linalg.norm(exact.v, axis=1).max() > 10 * speed.max()
    assert np.median(np.linalg.norm(exact.v, axis=1) / speed) > 5

    # only the weak direction misses anything
    J = rows[:, None] * rm.jacobian(model, q)
    U = np.linalg.svd(J)[0]
    error = found.error * rows
    assert (np.abs(error @ U[:, :5]) <= 1e-12 * np.maximum(size, 1)[:, None]).all()

    # plain damping of the same size misses more, for every twist
    for damping in (found.damping[0], DampedInverse().largest):
        plain = ikm(
            model, q, twist, method=DampedInverse(largest=damping, damping=Damping.CONSTANT)
        )
        missing = np.linalg.norm(plain.error * rows, axis=1)
        assert (np.linalg.norm(error, axis=1) < missing).all()


@pytest.mark.parametrize("what", ["elbow", "wrist", "shoulder"])
def test_at_a_singular_position_the_reachable_part_is_given(what, rng):
    model = rm.load("rx90")
    q = rx90_near(what, 0.0)
    twist = rng.normal(size=(100, 6))
    found = ikm(model, q, twist)
    assert (found.status == IKMStatus.SINGULAR).all()
    within(found.achieved, found.reachable, 1e-11)
    within(ikm(model, q, found.reachable).error, np.zeros((100, 6)), 1e-11)
    assert (ikm(model, q, found.reachable).status == IKMStatus.MET).all()
    assert (np.linalg.norm(found.error, axis=1) > 1e-6).all()
    assert "Singular position" in found.reason(0)


@pytest.mark.parametrize("speed", [0.01, 0.5, 3.0, 100.0])
def test_a_largest_speed_is_kept_at_the_least_error(speed, rng):
    model = rm.load("rx90")
    near = [rx90_near("wrist", away) for away in (1e-4, 1e-7)]
    q = np.concatenate([rng.uniform(-2, 2, (200, 6)), near])
    twist = rng.normal(size=(202, 6))
    rows, _ = scales(model)
    free = DampedInverse(threshold=0.0, largest=0.0, largest_speed=speed)
    found = ikm(model, q, twist, method=free)
    norm = np.linalg.norm(found.v, axis=1)
    assert (norm <= speed * (1 + 1e-15)).all()
    exact = ikm(model, q, twist, method=PseudoInverse())
    slow = np.linalg.norm(exact.v, axis=1) <= speed
    np.testing.assert_array_equal(found.v[slow], exact.v[slow])
    within(norm[~slow], np.full((~slow).sum(), speed), 1e-12 * speed)
    assert (found.damping[~slow] > 0).all()
    # at the least of |A v - b| with |v| <= speed its gradient is a positive multiple of v
    A, b = rows[:, None] * rm.jacobian(model, q[~slow]), rows * twist[~slow]
    v = found.v[~slow]
    slope = np.einsum("kij,ki->kj", A, b - np.einsum("kij,kj->ki", A, v))
    factor = (slope * v).sum(axis=1, keepdims=True) / speed**2
    assert (factor > 0).all()
    within(slope, factor * v, 1e-9)
    # together with the damping of weak directions, and weighted
    weights = np.array([1.0, 2.0, 0.5, 3.0, 1.0, 0.1])
    both = ikm(model, q, twist, method=DampedInverse(largest_speed=speed), joint_weights=weights)
    assert (np.sqrt((weights * both.v**2).sum(axis=1)) <= speed * (1 + 1e-15)).all()
    at = ikm(model, rx90_near("wrist", 0.0), twist[0], method=free)
    assert np.linalg.norm(at.v) <= speed * (1 + 1e-15)
    assert at.rank == 5


# --- robots that cannot do everything ----------------------------------------------------------


def test_robots_of_few_joints_have_a_status(rng):
    for name, rank in (("planar_2r", 2), ("planar_3r", 3), ("lab_rr", 2), ("lab_rrt", 3),
                       ("cobra_s600", 4), ("xarm5", 5)):  # fmt: skip
        model = rm.load(name)
        q = rng.uniform(0.2, 0.9, (50, model.n))
        found = ikm(model, q, rng.normal(size=(50, 6)))
        assert (found.rank == rank).all()
        assert (found.status == IKMStatus.TOO_FEW_JOINTS).all()
        twist = rm.dkm(model, q, rng.normal(size=q.shape))
        met = ikm(model, q, twist, method=PseudoInverse())
        assert (met.status == IKMStatus.MET).all()
        within(met.error, np.zeros((50, 6)), 1e-11)
    # stretched, a planar arm is singular as well
    stretched = ikm(rm.load("planar_3r"), [0.3, 0.0, 0.0], [1.0, 0, 0, 0, 0, 0])
    assert stretched.rank == 2
    assert stretched.status == IKMStatus.SINGULAR
    planar = ikm(rm.load("planar_3r"), [0.3, 0.4, 0.5], [1.0, 0.2, 0, 0, 0, 0.3],
                 mask=[1, 1, 0, 0, 0, 1])  # fmt: skip
    assert planar.status == IKMStatus.MET


# --- secondary motions -------------------------------------------------------------------------


@given(model=models(), seed=seeds, name=st.sampled_from(sorted(METHODS)))
def test_a_secondary_motion_never_disturbs_the_task(name, model, seed):
    rng = np.random.default_rng(seed)
    q, z, _ = random_state(model, rng, 3)
    twist = rng.normal(size=(3, 6))
    mask = [POSITION, [1, 1, 1, 1, 1, 1], [0, 0, 1, 1, 0, 0]][seed % 3]
    reference = REFERENCES[seed % 3]
    weights = 10.0 ** rng.uniform(-1, 1, model.n)
    options = {"reference": reference, "mask": mask, "method": METHODS[name],
               "joint_weights": weights}  # fmt: skip
    without = ikm(model, q, twist, **options)
    found = ikm(model, q, twist, secondary=z, **options)
    J = rm.jacobian(model, q, None, reference)
    moved = np.einsum("nij,nj->ni", J, found.v - without.v) * mask
    size = max(robot_size(model, row) for row in q)
    # z is added to a v that the pseudo-inverse may have made huge: 1e-14 of it are its last digits
    speed = max(1.0, np.abs(z).max(), 1e-2 * np.abs(without.v).max())
    within(moved, np.zeros((3, 6)), 1e-12 * size * speed)
    np.testing.assert_array_equal(found.status, without.status)
    # what is left of z is the nearest motion, in the weighted norm, that does not move the task
    rows, columns = scales(model, None, weights)
    for i in range(3):
        A = (rows[:, None] * J[i] * columns)[np.array(mask) == 1]
        _, s, Vt = np.linalg.svd(A, full_matrices=False)
        norm = max(np.linalg.norm(A), 1.0)
        if ((s > 1e-15 * norm) & (s < 1e-9 * norm)).any():
            continue  # which of these are zero is a matter of rounding
        V = Vt[s >= 1e-9 * norm].T
        y = z[i] / columns
        sure = 1e-12 + 1e-13 * norm / s[s >= 1e-9 * norm].min(initial=norm)
        within((found.v - without.v)[i], columns * (y - V @ (V.T @ y)), sure * np.abs(y).max() * 3)


def test_criteria_and_sums_of_them(rng):
    model = rm.load("panda")
    q, twist, z = rng.normal(size=(3, 7)), rng.normal(size=(3, 6)), rng.normal(size=(3, 7))
    towards, back = PostureCriterion(np.ones(7), gain=2.0), PostureCriterion(np.zeros(7), gain=0.5)
    plain = ikm(model, q, twist, secondary=2 * (1 - q) - 0.5 * q + z)
    within(ikm(model, q, twist, secondary=[towards, z, back]).v, plain.v)
    # one posture, many twists
    one = ikm(model, q[0], twist, secondary=towards)
    within(one.v, ikm(model, q[[0, 0, 0]], twist, secondary=2 * (1 - q[[0, 0, 0]])).v)
    assert np.abs(one.v - ikm(model, q[0], twist).v).max() > 1e-3


# --- tasks and limits --------------------------------------------------------------------------


def test_augmented_tasks_are_of_the_same_importance(rng):
    model = rm.load("panda")
    q, twist = rng.uniform(-1, 1, (30, 7)), rng.normal(size=(30, 6))
    rate = rng.normal(size=(30, 1))
    found = ikm(model, q, twist, augmented=[JointTask(rate, joints=[2])])
    assert found.singular_values.shape == (30, 7)
    rows, _ = scales(model)
    for i in range(30):
        J = np.vstack([rm.jacobian(model, q[i]), np.eye(7)[2]])
        A = np.r_[rows, 1.0][:, None] * J
        within(found.singular_values[i], np.linalg.svd(A, compute_uv=False), 1e-12)
        if found.singular_values[i, -1] > 0.01:
            within(found.v[i], np.linalg.solve(J, np.r_[twist[i], rate[i]]), 1e-9)
            assert found.status[i] == IKMStatus.MET
    # more than seven joints can do
    over = ikm(model, q[0], twist[0], augmented=[JointTask([0.5, 0.1], joints=[2, 0])])
    assert over.status == IKMStatus.TOO_FEW_JOINTS
    assert np.linalg.norm(over.error) > 1e-3
    assert np.linalg.norm(over.task_errors[0]) > 1e-3
    within(over.achieved, rm.dkm(model, q[0], over.v), 1e-11)


def test_limits_hold_and_the_direction_is_kept(rng):
    model = rm.load("panda")
    q = rng.uniform(model.lower, model.upper, (200, 7))
    twist = 3.0 * rng.normal(size=(200, 6))
    found = ikm(model, q, twist, limits=True, method=PseudoInverse())
    assert (np.abs(found.v) <= model.table.velocity).all()
    slowed = found.scale < 1 - 1e-9
    assert slowed.sum() > 20
    assert (found.status[slowed] == IKMStatus.LIMITED).all()
    assert (found.status[~slowed] == IKMStatus.MET).all()
    assert found.limited[slowed].any(axis=1).all()
    within(found.achieved, found.scale[:, None] * twist, 1e-9)
    within(found.achieved, rm.dkm(model, q, found.v), 1e-11)
    assert "limits" in found.reason(int(np.flatnonzero(slowed)[0]))
    bounds = JointBounds(velocity=0.2, step=0.01)
    slow = ikm(model, q, twist, limits=bounds, method=PseudoInverse())
    assert (np.abs(slow.v) <= 0.2).all()
    assert (slow.scale <= found.scale + 1e-12).all()


# --- second order ------------------------------------------------------------------------------


@given(model=any_models(), seed=seeds)
def test_accelerations_are_those_of_the_jacobian_and_its_rate(model, seed):
    reference = REFERENCES[seed % 3]
    q, v, a = random_state(model, np.random.default_rng(seed))
    frame = [None, 0, model.f, 1][seed % 4]
    J = rm.jacobian(model, q, frame, reference)
    expected = J @ a + rm.jacobian_rate(model, q, v, frame, reference) @ v
    speed = max(1.0, np.abs(v).sum() + np.sqrt(np.abs(a).sum()))
    tolerance = 1e-12 * robot_size(model, q) * speed**2
    within(dkm_second_order(model, q, v, a, frame, reference), expected, tolerance)
    batch = dkm_second_order(model, [q, q], [v, v], [a, a], frame, reference)
    within(batch, [expected, expected], tolerance)


@given(model=models(), seed=seeds)
def test_the_second_order_inverse_gives_the_acceleration(model, seed):
    reference = REFERENCES[seed % 3]
    q, v, a0 = random_state(model, np.random.default_rng(seed))
    wanted = dkm_second_order(model, q, v, a0, None, reference)
    found = ikm_second_order(model, q, v, wanted, reference=reference)
    within(found.v, v, 0.0)
    size = robot_size(model, q)
    achieved = dkm_second_order(model, q, v, found.a, None, reference)
    within(found.achieved, achieved, 1e-11 * size * max(1.0, np.abs(found.a).max()))
    within(found.achieved + found.error, wanted, 1e-11 * size)
    if found.singular_values[-1] >= 0.05:
        assert found.status == IKMStatus.MET
        within(found.error, np.zeros(6), 1e-11 * size)
