"""Poses and Jacobians of random robots: three ways to the same numbers, and differences.

Everything is held for the tool, for frames by number and by name, for one configuration
(Pinocchio) and for batches (compiled kernels).
"""

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import (
    any_models,
    models,
    random_pose,
    random_state,
    robot_size,
    seeds,
    table_poses,
    within,
)

import robotmodels as rm

EPS = np.finfo(float).eps
# The step that balances a central difference: its truncation is h^2 / 6 times the third
# derivative, its rounding eps / h times the value. Both are near 1e-11 here.
STEP = EPS ** (1 / 3)
REFERENCES = ("world_aligned", "local", "world")


def difference_error(size, rate=1.0):
    """Bound on a central difference of numbers of this size that vary with sines of rate t."""
    return size * (STEP**2 * rate**3 / 6 + 20 * EPS / STEP)


def vee(W):
    """Vector of the skew-symmetric part of matrices (..., 3, 3)."""
    A = (W - np.swapaxes(W, -1, -2)) / 2
    return np.stack([A[..., 2, 1], A[..., 0, 2], A[..., 1, 0]], axis=-1)


def frames_of(model):
    """Every way to name a frame, with the frame that carries it and its pose there."""
    table = model.table
    yield None, model.tip, model.tool
    yield 0, 0, np.eye(4)
    for j in range(1, model.f + 1):
        yield j, j, np.eye(4)
        yield table.names[j - 1], j, np.eye(4)


@given(model=any_models(), seed=seeds)
def test_pinocchio_is_the_kernels_is_the_plain_product(model, seed):
    q, _, _ = random_state(model, np.random.default_rng(seed), 3)
    product = np.array([table_poses(model, row) for row in q])
    tolerance = 1e-12 * max(robot_size(model, row) for row in q)
    within(rm.link_poses(model, q), product, tolerance)
    within([rm.link_poses(model, row) for row in q], product, tolerance)
    world = np.concatenate([np.tile(model.base, (3, 1, 1, 1)), product], axis=1)
    for frame, parent, pose in frames_of(model):
        expected = world[:, parent] @ pose
        within(rm.dgm(model, q, frame), expected, tolerance)
        within([rm.dgm(model, row, frame) for row in q], expected, tolerance)


def twist_of_poses(before, now, after, reference):
    """Twists (..., 6) of the motion from one pose to another, by central differences."""
    rate = (after - before) / (2 * STEP)
    R, p = now[..., :3, :3], now[..., :3, 3]
    w = vee(rate[..., :3, :3] @ np.swapaxes(R, -1, -2))
    v = rate[..., :3, 3]
    if reference == "world":
        v = v - np.cross(w, p)
    if reference == "local":
        v, w = (np.einsum("...ji,...j->...i", R, x) for x in (v, w))
    return np.concatenate([v, w], axis=-1)


@pytest.mark.parametrize("reference", REFERENCES)
@given(model=any_models(), seed=seeds)
def test_jacobian_is_the_difference_of_poses(reference, model, seed):
    q, _, _ = random_state(model, np.random.default_rng(seed))
    steps = STEP * np.eye(model.n)
    tolerance = difference_error(robot_size(model, q))
    for frame, *_ in frames_of(model):
        twists = twist_of_poses(
            rm.dgm(model, q - steps, frame),
            rm.dgm(model, q, frame),
            rm.dgm(model, q + steps, frame),
            reference,
        )
        within(rm.jacobian(model, q, frame, reference), twists.T, tolerance)
        within(rm.jacobian(model, [q], frame, reference)[0], twists.T, tolerance)


@given(model=models(tree=True, gravity=False, drive=False, transmission=False), seed=seeds)
def test_named_frames_of_a_urdf(model, seed):
    """Every link of a URDF is a frame, where the robot it was written from has it."""
    q, _, _ = random_state(model, np.random.default_rng(seed))
    read = rm.RobotModel.from_urdf(rm.to_urdf(model))
    order = [model.table.joint_names.index(name) for name in read.table.joint_names]
    x, size = q[order], robot_size(model, q)
    world = np.concatenate([[model.base], table_poses(model, q)])
    for name, pose in zip(model.twin.names.frames, world, strict=True):
        within(rm.dgm(read, x, name), pose, 1e-12 * size)
    within(rm.dgm(read, x, model.twin.names.tool), rm.dgm(model, q), 1e-12 * size)
    steps = STEP * np.eye(read.n)
    for name in read.frame_names:
        pose = rm.dgm(read, x, name)
        within(rm.dgm(read, [x], name)[0], pose, 1e-12 * size)
        before, after = rm.dgm(read, x - steps, name), rm.dgm(read, x + steps, name)
        twists = twist_of_poses(before, pose, after, "world_aligned")
        within(rm.jacobian(read, x, name), twists.T, difference_error(size))
        within(rm.jacobian(read, [x], name)[0], twists.T, difference_error(size))


@given(model=any_models(), seed=seeds)
def test_batches_references_and_joints_elsewhere(model, seed):
    """Single is batch, three references are one twist, only joints below a frame move it."""
    q, v, _ = random_state(model, np.random.default_rng(seed), 3)
    tolerance = 1e-12 * max(robot_size(model, row) for row in q)
    speed = max(1.0, np.abs(v).sum(axis=-1).max())
    for frame, parent, _ in frames_of(model):
        still = ~np.isin(model.table.joint_rows + 1, model.table.path(parent))
        jacobians = []
        for reference in REFERENCES:
            J = rm.jacobian(model, q, frame, reference)
            dJ = rm.jacobian_rate(model, q, v, frame, reference)
            singles = np.array([rm.jacobian(model, x, frame, reference) for x in q])
            rates = [
                rm.jacobian_rate(model, x, dx, frame, reference) for x, dx in zip(q, v, strict=True)
            ]
            within(singles, J, tolerance)
            within(rates, dJ, tolerance * speed)
            assert not np.concatenate([J, singles, dJ, rates])[..., still].any()
            jacobians.append(J)
        T = rm.dgm(model, q, frame)
        R = np.swapaxes(T[:, :3, :3], -1, -2)
        aligned, local, world = jacobians
        within(local[:, :3], R @ aligned[:, :3], tolerance)
        within(local[:, 3:], R @ aligned[:, 3:], tolerance)
        lever = np.cross(T[:, :3, 3, None], aligned[:, 3:], axis=1)
        within(world[:, :3], aligned[:, :3] + lever, tolerance)
        within(world[:, 3:], aligned[:, 3:], tolerance)


@pytest.mark.parametrize("reference", REFERENCES)
@given(model=any_models(), seed=seeds)
def test_jacobian_rate_is_the_difference_of_jacobians(reference, model, seed):
    q, v, _ = random_state(model, np.random.default_rng(seed))
    # along the motion every entry is a sum of sines of at most this rate
    rate = np.abs(v).sum()
    tolerance = difference_error(robot_size(model, q), max(1.0, rate))
    for frame, *_ in frames_of(model):
        before, after = rm.jacobian(model, q + STEP * np.outer([-1, 1], v), frame, reference)
        expected = (after - before) / (2 * STEP)
        within(rm.jacobian_rate(model, q, v, frame, reference), expected, tolerance)


@given(model=any_models(base=False), seed=seeds)
def test_the_base_moves_everything_along(model, seed):
    rng = np.random.default_rng(seed)
    q, v, _ = random_state(model, rng)
    Z = random_pose(rng)
    moved = model.with_base(Z)
    tolerance = 1e-12 * robot_size(moved, q)
    within(rm.dgm(moved, q), Z @ rm.dgm(model, q), tolerance)
    turned = (Z[:3, :3] @ rm.jacobian(model, q).reshape(2, 3, -1)).reshape(6, -1)
    within(rm.jacobian(moved, q), turned, tolerance)
    speed = max(1.0, np.abs(v).sum())
    for function in (rm.jacobian, lambda m, x, *k: rm.jacobian_rate(m, x, v, *k)):
        within(function(moved, q, None, "local"), function(model, q, None, "local"),
              tolerance * speed)  # fmt: skip


@given(model=models(tree=True, max_frames=10), seed=seeds)
def test_names_of_siblings_change_no_number(model, seed):
    """Pinocchio orders siblings by name; nothing of that is seen outside."""
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng)
    names = [model.table.names[i] for i in rng.permutation(model.f)]
    renamed = model.with_table(model.table.replace(names=names))
    size = robot_size(model, q)
    speed = max(1.0, np.abs(v).sum())
    within(rm.link_poses(renamed, q), rm.link_poses(model, q), 1e-12 * size)
    within(rm.jacobian(renamed, q), rm.jacobian(model, q), 1e-12 * size)
    within(rm.jacobian_rate(renamed, q, v), rm.jacobian_rate(model, q, v), 1e-12 * size * speed)
    tau = rm.idm(model, q, v, a)
    within(rm.idm(renamed, q, v, a), tau, 1e-12 * max(1.0, np.abs(tau).max()))
    M = rm.mass_matrix(model, q)
    within(rm.mass_matrix(renamed, q), M, 1e-12 * max(1.0, np.abs(M).max()))
