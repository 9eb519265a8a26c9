"""Operational coordinates: poses as vectors and back, rates, the Jacobian by differentiation.

Oracles: SciPy's Rotation where conventions coincide, brute force over the equivalent coordinates,
finite differences of fourth order, and the screw Jacobian as the other way to the same matrix.
"""

import itertools

import numpy as np
import pytest
from identities.random_robots import random_model, random_state, robot_size, within
from scipy.spatial.transform import Rotation

import robotmodels as rm
from robotmodels import se3
from robotmodels.kinematics import (
    OrientationKind,
    continuous_coordinates,
    coordinate_jacobian,
    coordinate_jacobian_rate,
    coordinate_rates,
    coordinate_rates_rate,
    is_representation_singular,
    operational_coordinates,
    pose_from_coordinates,
    twist_from_rates,
)
from robotmodels.kinematics.coordinates.rates import SINGULAR

EPS = np.finfo(float).eps
THERE_AND_BACK = 3 * 2 * np.pi * EPS  # three angles up to pi, each with two roundings
TURN = 2 * np.pi
KINDS = tuple(OrientationKind)
EULER = (OrientationKind.EULER, OrientationKind.EULER_ZYZ)
ROLL = (OrientationKind.ROLL_PITCH_YAW, OrientationKind.ROLL_PITCH_YAW_URDF)
ANGLES = (*EULER, *ROLL)
SCIPY = {"euler": "ZXZ", "euler_zyz": "ZYZ", "roll_pitch_yaw": "ZYX", "roll_pitch_yaw_urdf": "xyz"}

every_kind = pytest.mark.parametrize("kind", KINDS, ids=str)
every_angle = pytest.mark.parametrize("kind", ANGLES, ids=str)


def poses(R, rng):
    T = np.zeros((*R.shape[:-2], 4, 4))
    T[..., :3, :3], T[..., 3, 3] = R, 1.0
    T[..., :3, 3] = rng.normal(size=(*T.shape[:-2], 3))
    return T


def random_poses(rng, *batch):
    count = int(np.prod(batch))
    R = Rotation.random(count, rng=rng).as_matrix() if count else np.zeros((0, 3, 3))
    return se3.as_pose(poses(R, rng)).reshape(*batch, 4, 4)


def five_point(f, h):
    """First derivative at 0, error of the order of h^4."""
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)


def moved(T, twist, t):
    """Poses that have moved for a time t with a twist that stays the same in world axes."""
    T = T.copy()
    T[..., :3, :3] = Rotation.from_rotvec(twist[3:] * t).as_matrix() @ T[..., :3, :3]
    T[..., :3, 3] += twist[:3] * t
    return T


# --- there and back ----------------------------------------------------------------------------


@every_kind
def test_random_poses_come_back(kind, rng):
    T = random_poses(rng, 2000)
    x = operational_coordinates(T, kind)
    assert x.shape == (2000, kind.dimension)
    assert np.array_equal(x[:, :3], T[:, :3, 3])
    back = pose_from_coordinates(x, kind)
    assert np.abs(back - T).max() < THERE_AND_BACK
    assert np.array_equal(back[:, 3], T[:, 3])


@every_angle
@pytest.mark.parametrize("gap", [0.0, 1e-17, 1e-16, 5e-16, 1e-15, 1e-14, 1e-12, 1e-8, 1e-4])
def test_angles_are_exact_at_and_near_gimbal_lock(kind, gap, rng):
    x = rng.uniform(-np.pi, np.pi, size=(200, 6))
    lock = np.array([0.0, np.pi]) if kind in EULER else np.array([np.pi, -np.pi]) / 2
    x[:, 4] = lock[np.arange(200) % 2] + gap * np.where(np.arange(200) % 4 < 2, 1.0, -1.0)
    T = se3.as_pose(pose_from_coordinates(x, kind))
    for near in (None, x, x + rng.normal(size=x.shape)):
        y = operational_coordinates(T, kind, near)
        assert np.abs(pose_from_coordinates(y, kind) - T).max() < THERE_AND_BACK
    if gap == 0.0:
        y = operational_coordinates(T, kind)
        assert (y[:, 5 if kind is ROLL[1] else 3] == 0.0).all()
        assert is_representation_singular(T, kind).all()
        within(operational_coordinates(T, kind, near=x), x, 20 * EPS)


@every_angle
def test_angles_are_those_of_scipy(kind, rng):
    x = np.concatenate([np.zeros((1000, 3)), rng.normal(size=(1000, 3)) * 4], axis=1)
    R = Rotation.from_euler(SCIPY[kind.value], x[:, 3:])
    T = pose_from_coordinates(x, kind)
    within(T[:, :3, :3], R.as_matrix(), 1e-14)
    difference = operational_coordinates(T, kind)[:, 3:] - R.as_euler(SCIPY[kind.value])
    within(difference - TURN * np.rint(difference / TURN), np.zeros((1000, 3)), 1e-12)


def test_quaternion_and_vector_are_those_of_scipy(rng):
    T = random_poses(rng, 1000)
    R = Rotation.from_matrix(T[:, :3, :3])
    Q = R.as_quat(canonical=True, scalar_first=True)
    within(operational_coordinates(T, "quaternion")[:, 3:], Q, 1e-14)
    within(operational_coordinates(T, "angle axis")[:, 3:], R.as_rotvec(), 1e-13)


# --- near --------------------------------------------------------------------------------------


def equivalents(kind, y):
    """Coordinates of the orientations of the same rotation, some turns around."""
    if kind in ANGLES:
        first, middle, last = y
        mirrored = -middle if kind in EULER else np.pi - middle
        for base in (y, (first + np.pi, mirrored, last + np.pi)):
            for turns in itertools.product(range(-2, 3), repeat=3):
                yield np.add(base, np.multiply(TURN, turns))
    elif kind is OrientationKind.QUATERNION:
        yield from (y, -y)
    elif kind is OrientationKind.ANGLE_AXIS:
        angle = np.linalg.norm(y)
        yield from (y * (1 + TURN * k / angle) for k in range(-3, 4))
    else:
        yield y


@every_kind
def test_near_is_the_nearest_of_all_equivalents(kind, rng):
    for T in random_poses(rng, 60):
        x = operational_coordinates(T, kind)
        near = x + np.r_[0, 0, 0, 4 * rng.normal(size=x.size - 3)].clip(-9, 9)
        y = operational_coordinates(T, kind, near)
        distances = [np.linalg.norm(e - near[3:]) for e in equivalents(kind, x[3:])]
        assert np.linalg.norm(y[3:] - near[3:]) == pytest.approx(min(distances), abs=1e-13)
        assert np.abs(pose_from_coordinates(y, kind) - T).max() < 40 * EPS
        within(operational_coordinates(T, kind, near=y), y, 1e-14)


def wandering(rng, count, size=1.0):
    """A smooth motion that turns over several times."""
    t = np.linspace(0, 1, count)
    phases = rng.uniform(0, TURN, size=(3, 3))
    turns = rng.normal(size=(3, 3)) * 4 * size
    angles = np.sin(TURN * np.outer(t, (1, 2, 3))[:, None] + phases) @ turns
    angles = np.einsum("tij,j->ti", np.sin(TURN * t[:, None, None] * [1, 2, 3] + phases), [4, 2, 1])
    R = Rotation.from_rotvec(size * angles).as_matrix()
    T = np.zeros((count, 4, 4))
    T[:, :3, :3], T[:, 3, 3] = R, 1.0
    T[:, :3, 3] = np.sin(np.outer(t, [1, 2, 3]))
    return se3.as_pose(T)


@pytest.mark.sampled(5)
@every_kind
@pytest.mark.parametrize("with_near", [False, True])
def test_a_sequence_is_each_sample_near_the_one_before(kind, with_near, rng):
    for size in (0.01, 1.0):
        T = wandering(rng, 300, size)
        # samples of exactly no rotation, and at gimbal lock of each kind, in the middle and at ends
        T[[0, 50, 51, 299], :3, :3] = np.eye(3)
        T[[100, 101], :3, :3] = se3.rotation("y", np.pi / 2)[:3, :3]
        T[[150], :3, :3] = se3.rotation("x", np.pi)[:3, :3]
        T[[151, 152], :3, :3] = (se3.rotation("y", -np.pi / 2) @ se3.rotation("x", 1))[:3, :3]
        near = None
        if with_near:
            near = operational_coordinates(T[0], kind, near=10 * rng.normal(size=kind.dimension))
            near[3:] += 0.3 * rng.normal(size=kind.dimension - 3)
        x = continuous_coordinates(T, kind, near)
        if with_near:
            within(x[0], operational_coordinates(T[0], kind, near), 1e-13)
        for i in range(1, len(T)):
            within(x[i], operational_coordinates(T[i], kind, near=x[i - 1]), 1e-12)
        turns = max(1.0, np.abs(x[:, 3:]).max() / np.pi)
        assert np.abs(pose_from_coordinates(x, kind) - T).max() < turns * THERE_AND_BACK


@every_angle
def test_a_sequence_that_begins_at_gimbal_lock_begins_with_the_angle_it_leaves_with(kind):
    x = np.zeros((5, 6))
    first = 5 if kind is ROLL[1] else 3
    x[:, first] = 0.7
    x[:, 4] = (0.0 if kind in EULER else np.pi / 2) - np.array([0, 0, 0.1, 0.2, 0.3])
    x[:, 4] = np.abs(x[:, 4])
    x[:, 8 - first] = [0.1, 0.2, 0.3, 0.4, 0.5]
    within(continuous_coordinates(pose_from_coordinates(x, kind), kind), x, 1e-14)


# --- rates -------------------------------------------------------------------------------------


def tame_poses(kind, rng, count):
    """Poses and coordinates of any solution, away from the singularities."""
    x = np.zeros((4 * count, kind.dimension))
    T = random_poses(rng, 4 * count)
    x = operational_coordinates(T, kind)
    x = operational_coordinates(T, kind, near=x + 4 * rng.normal(size=x.shape))
    tame = np.abs(coordinate_rates(T, kind, near=x)).max(axis=(1, 2)) < 4
    return T[tame][:count], x[tame][:count]


@every_kind
def test_rates_and_their_rates_are_differences_of_coordinates(kind, rng):
    T, x = tame_poses(kind, rng, 40)
    assert len(T) >= 30
    E = coordinate_rates(T, kind, near=x)
    for _ in range(3):
        twist = rng.normal(size=6)

        def coordinates(t, twist=twist):
            return operational_coordinates(moved(T, twist, t), kind, x)

        def rates(t, twist=twist):
            return coordinate_rates(moved(T, twist, t), kind, x)

        within(E @ twist, five_point(coordinates, 2e-4), 1e-9)
        dE = coordinate_rates_rate(T, twist, kind, near=x)
        within(dE, five_point(rates, 2e-4), 1e-7)
        assert np.abs(dE).max() > 0.1


@every_kind
def test_twist_from_rates_is_a_left_inverse(kind, rng):
    T, x = tame_poses(kind, rng, 200)
    E, B = coordinate_rates(T, kind, near=x), twist_from_rates(T, kind, near=x)
    within(B @ E, np.broadcast_to(np.eye(6), (len(T), 6, 6)), 1e-14)
    if kind not in (*ANGLES, OrientationKind.ANGLE_AXIS):
        # least squares: what is admissible is found by an orthogonal projection
        within(B, np.linalg.pinv(E), 1e-13)
    else:
        within(E @ B, np.broadcast_to(np.eye(6), (len(T), 6, 6)), 1e-13)


@every_angle
@pytest.mark.parametrize("gap", [0.0, 1e-16, 1e-13, 2e-12, 1e-9])
def test_rates_do_not_exist_at_gimbal_lock(kind, gap, rng):
    x = rng.uniform(-3, 3, size=(100, 6))
    x[:, 4] = (0.0 if kind in EULER else np.pi / 2) + gap
    T = pose_from_coordinates(x, kind)
    singular = is_representation_singular(T, kind)
    assert (singular == (gap < SINGULAR)).all()
    for E, block in (
        (coordinate_rates(T, kind), np.eye(3)),
        (coordinate_rates_rate(T, np.ones(6), kind), np.zeros((3, 3))),
    ):
        assert np.isnan(E[:, 3:]).all() == (gap < SINGULAR)
        assert np.isnan(E[:, 3:]).any() == (gap < SINGULAR)
        within(E[:, :3, :3], np.broadcast_to(block, (100, 3, 3)), 0)
        within(E[:, :3, 3:], np.zeros((100, 3, 3)), 0)
        within(E[:, 3:, :3], np.full((100, 3, 3), np.nan if gap < SINGULAR else 0.0), 0)
    # the twist of given rates exists always, but not for every twist are there rates
    B = twist_from_rates(T, kind)
    assert np.isfinite(B).all()
    assert (np.linalg.svd(B, compute_uv=False)[:, -1] < 2 * max(gap, EPS)).all()


# --- Jacobian of the coordinates ---------------------------------------------------------------


def tame_robots(rng, count, kind):
    """Random robots of every sort with a configuration where the coordinates change gently."""
    found = 0
    while found < count:
        model = random_model(
            rng, f=int(rng.integers(2, 8)), tree=bool(found % 2), fixed=True, tip="any"
        )
        q, v, _ = random_state(model, rng)
        E = coordinate_rates(rm.dgm(model, q), kind)
        if np.abs(E).max() < 4:  # also False for NaN
            found += 1
            yield model, q, v


@every_kind
def test_coordinate_jacobian_is_the_difference_of_coordinates(kind, rng):
    for model, q, v in tame_robots(rng, 12, kind):
        size, speed = robot_size(model, q), np.abs(v).sum()
        x = operational_coordinates(rm.dgm(model, q), kind)
        x[3:] = operational_coordinates(rm.dgm(model, q), kind, x + 4 * rng.normal(size=x.size))[3:]
        J = coordinate_jacobian(model, q, kind, near=x)
        for column, e in zip(J.T, np.eye(model.n), strict=True):
            rates = five_point(
                lambda t, m=model, p=q, e=e, x=x: operational_coordinates(
                    rm.dgm(m, p + t * e), kind, x
                ),
                2e-4,
            )
            within(column, rates, 1e-8 * size)
        dJ = coordinate_jacobian_rate(model, q, v, kind, near=x)
        along = five_point(
            lambda t, m=model, q=q, v=v, x=x: coordinate_jacobian(m, q + t * v, kind, near=x),
            2e-4 / speed,
        )
        within(dJ, along, 1e-7 * size * speed)
