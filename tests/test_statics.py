"""The static model and its inverse on random robots: virtual work, equilibrium, open rests."""

import numpy as np
import pinocchio as pin
from hypothesis import given
from identities.random_robots import (
    any_models,
    random_pose,
    random_state,
    robot_size,
    seeds,
    within,
)

import robotmodels as rm
from robotmodels import se3
from robotmodels.kinematics import (
    static_torque,
    static_wrench,
    transported_wrench,
)

REFERENCES = ("world_aligned", "local", "world")


# ---------------------------------------------------------------- torques


@given(model=any_models(), seed=seeds)
def test_torque_is_that_of_the_dynamic_model_at_rest(model, seed):
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng, 3)
    w, rest = 10.0 * rng.normal(size=(3, 6)), np.zeros(model.n)
    size = max(robot_size(model, row) for row in q)
    held = rm.idm(model, q, rest, rest, w, drive=False)
    weight = rm.gravity_torque(model, q)
    tolerance = 1e-12 * (100.0 * size + np.abs(held).max() + np.abs(weight).max())
    within(static_torque(model, q, w), held - weight, tolerance)
    within(static_torque(model, q, w, gravity=True), held, tolerance)
    for x, u, tau in zip(q, w, held, strict=True):
        within(static_torque(model, x, u, gravity=True), tau, tolerance)


@given(model=any_models(), seed=seeds)
def test_power_in_is_power_out(model, seed):
    """Virtual work, for every frame and reference: tau . v = w . twist."""
    rng = np.random.default_rng(seed)
    q, v, _ = random_state(model, rng)
    w = rng.normal(size=6)
    size = robot_size(model, q) * max(1.0, np.abs(v).sum())
    for frame in (None, 0, *range(1, model.f + 1), *model.table.names):
        for reference in REFERENCES:
            tau = static_torque(model, q, w, frame, reference)
            within(tau @ v, w @ rm.dkm(model, q, v, frame, reference), 1e-12 * size)


@given(model=any_models(), seed=seeds)
def test_the_same_wrench_elsewhere_needs_the_same_torques(model, seed):
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng, 2)
    w, T = rng.normal(size=(2, 6)), rm.dgm(model, q)
    tau = static_torque(model, q, w, reference="local")
    for wrench, frame, reference in (
        (transported_wrench(w, T), None, "world"),
        # what the tool does, the frame that carries it does
        (transported_wrench(w, model.tool), model.tip, "local"),
    ):
        moved = static_torque(model, q, wrench, frame, reference)
        within(moved, tau, 1e-12 * max(robot_size(model, row) for row in q) ** 2)


def test_transport_is_that_of_pinocchio_and_composes(rng):
    w = rng.normal(size=(5, 6))
    A, B = random_pose(rng), np.array([random_pose(rng) for _ in range(5)])
    acted = [pin.SE3(b).act(pin.Force(x)).vector for b, x in zip(B, w, strict=True)]
    within(transported_wrench(w, B), acted, 1e-14)
    within(transported_wrench(transported_wrench(w, B), A), transported_wrench(w, A @ B), 1e-13)
    within(transported_wrench(transported_wrench(w, B), se3.inverse(B)), w, 1e-13)
    within(transported_wrench(w[0], B), [transported_wrench(w[0], b) for b in B], 1e-15)
    within(transported_wrench(w[0], pin.SE3(A)), transported_wrench(w[0], A), 0)
    assert transported_wrench(w[:0], A).shape == (0, 6)
    assert transported_wrench(w[:, None], B).shape == (5, 5, 6)


# ---------------------------------------------------------------- the inverse


def weighted(model, q, length, reference="world_aligned", frame=None):
    """The Jacobian without units, and the factors of its columns."""
    joints = np.where(model.table.sigma[model.table.joint_rows] == 1, length, 1.0)
    rows = np.repeat((1.0 / length, 1.0), 3)
    return rows[:, None] * rm.jacobian(model, q, frame, reference) * joints, joints


@given(model=any_models(), seed=seeds)
def test_equilibrium_and_what_is_left_open(model, seed):
    """Any torques are a balanced part and a residual; any wrench is found up to what is free."""
    rng = np.random.default_rng(seed)
    q, tau, _ = random_state(model, rng)
    length = rng.uniform(0.2, 2.0)
    for reference in REFERENCES:
        J, joints = weighted(model, q, length, reference)
        s = np.linalg.svd(J, compute_uv=False)
        rank = int((s > 1e-9 * s.max(initial=0.0)).sum())
        # rounding over the smallest value kept, and what is lost with the largest one dropped
        largest = s.max(initial=0.0)
        dropped = s[rank] if rank < len(s) else 0.0
        condition = largest / s[rank - 1] if rank else 1.0
        noise = 1e-13 * condition + 10 * dropped * (1.0 / s[rank - 1] if rank else 1.0)
        w = rng.normal(size=6)
        for torques in (tau, static_torque(model, q, w, reference=reference)):
            found = static_wrench(model, q, torques, reference=reference, length=length)
            size = max(1.0, np.linalg.norm(joints * torques))
            back = static_torque(model, q, found.wrench, reference=reference)
            within(joints * (back + found.residual), joints * torques, noise * size)
            # the residual is what no wrench balances, and it moves no tool
            within(J @ (joints * found.residual), np.zeros(6), noise * size * max(1.0, largest))
            # free wrenches: as many as the rank lacks, orthonormal, without torque
            k = int(found.undetermined)
            assert k == 6 - rank
            free = found.directions[:k]
            unit = free / np.repeat((1.0, length), 3)
            within(unit @ unit.T, np.eye(k), 1e-13)
            assert not found.directions[k:].any()
            felt = static_torque(model, q, free, reference=reference) if k else np.zeros((0, 1))
            bound = (1e-13 * largest + dropped) * length
            assert np.linalg.norm(joints * felt, axis=-1).max(initial=0.0) <= 2 * bound
            # the smallest wrench has nothing of them
            normal = found.wrench / np.repeat((1.0, length), 3)
            within(unit @ normal, np.zeros(k), 1e-12 * max(1.0, np.linalg.norm(normal)))
            assert bool(found.status & 1) == (k > 0)
        if dropped < 1e-14 * largest:
            assert not found.status & 2
        if rank == 6:
            within(found.wrench, w, noise * 10 * max(1.0, length, 1 / length))
