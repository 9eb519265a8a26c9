"""Seven-joint arms: arm angle and locked joints against the direct model of the chain."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from robotmodels import se3
from robotmodels.igm import igm
from robotmodels.igm.arm_angle import arm_angle_of, arm_angle_postures, prepare_arm_angle
from robotmodels.igm.loop import JointChain, joint_chain
from robotmodels.igm.motion import tool_poses
from robotmodels.igm.solver import Tolerances
from robotmodels.kinematics import dgm
from robotmodels.robots import load

ARMS = (
    "iiwa14", "lwr4_plus", "erd:romeo_left_arm", "erd:human_right_arm", "erd:icub_left_arm",
    "random", "random level", "random skew",
)  # fmt: skip


def poses(chain, q):
    """Tool in R_0 at ``q (..., k)``."""
    return tool_poses(chain, q.reshape(-1, chain.k)).reshape(*q.shape[:-1], 4, 4)


def random_rotation(rng):
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return R * np.linalg.det(R)


def random_arm(kind, seed=0):
    """Shoulder and wrist with any frames on their axes; the elbow anywhere, or in one plane."""
    rng = np.random.default_rng(seed)
    D = np.tile(np.eye(4), (8, 1, 1))
    for k in range(8):
        D[k, :3, :3] = random_rotation(rng)
    if kind != "random skew":
        for k, sign in ((1, 1), (2, -1), (5, -1), (6, 1)):
            D[k] = se3.rotation("z", rng.uniform(-3, 3)) @ se3.rotation("x", sign * np.pi / 2)
            D[k] = D[k] @ se3.rotation("z", rng.uniform(-3, 3))
    for k in (0, 3, 4, 7):
        D[k, :3, 3] = rng.uniform(-0.5, 0.5, 3)
    if kind == "random level":  # shoulder and wrist level on the axis of the elbow
        D[4, 2, 3] = (se3.inverse(D[3]))[2, 3]
    # frames of the two spherical joints slid along their axes
    for first in (0, 4):
        for j in range(3):
            slide = np.eye(4)
            slide[2, 3] = rng.uniform(-0.3, 0.3)
            D[first + j] = D[first + j] @ slide
            D[first + j + 1] = se3.inverse(slide) @ D[first + j + 1]
    return JointChain(np.arange(7), np.zeros(7, np.int64), D, np.eye(4))


@cache
def arm(name):
    chain = random_arm(name) if name.startswith("random") else joint_chain(load(name))
    solver = prepare_arm_angle(chain)
    assert solver is not None
    return chain, solver


def turn(way):
    """Angles by their shorter way round."""
    return (way + np.pi) % (2 * np.pi) - np.pi


def gaps(found, q):
    """Largest difference in a joint between rows ``(..., S, 7)`` and postures ``(..., 7)``."""
    return np.abs(turn(found - q[..., None, :])).max(axis=-1)


def at_angles(solver, U, psi, references=None, tolerances=None):
    """Solutions at every arm angle of an array: fields of shape (N, A, 8, ...)."""
    N, psi = len(U), np.asarray(psi)
    psi = np.broadcast_to(psi, (N, psi.shape[-1]))
    A = psi.shape[1]
    references = np.zeros((N, 7)) if references is None else references
    found = arm_angle_postures(
        solver, np.repeat(U, A, axis=0), psi.ravel(), np.repeat(references, A, axis=0),
        tolerances or Tolerances(),
    )  # fmt: skip
    names = ("q", "valid", "residual", "double", "free", "family")
    arrays = {name: getattr(found, name) for name in names}
    return SimpleNamespace(**{k: v.reshape(N, A, *v.shape[1:]) for k, v in arrays.items()})


def solved(name, q, psi=None, references=None, limit=1e-12):
    """Rows at the arm angles of q (or at psi); every one of them meets its pose and its angle."""
    chain, solver = arm(name)
    U = poses(chain, q)
    own = arm_angle_of(solver, q)[:, None] if psi is None else psi
    found = at_angles(solver, U, own, references)
    there = found.valid
    error = np.abs(poses(chain, found.q) - U[:, None, None]).max(axis=(-1, -2))[there]
    assert error.size
    assert error.max() <= limit
    assert found.residual[there].max() <= limit
    assert np.array_equal(np.isnan(found.q), np.broadcast_to(~there[..., None], found.q.shape))
    assert np.all(np.diff(there.astype(int), axis=-1) <= 0)
    assert np.array_equal(found.family, there)
    assert np.all((found.q[there] > -np.pi) & (found.q[there] <= np.pi))
    return found


def random_postures(count, seed=1):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 7))


# --- arm angle -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ARMS)
def test_all_postures_at_the_arm_angle_of_a_posture(name):
    _, solver = arm(name)
    q = random_postures(400)
    found = solved(name, q)
    assert np.nanmin(gaps(found.q[:, 0], q), axis=1).max() < 1e-7
    assert not found.free.any()
    assert not found.double.any()
    if name == "random skew":  # shoulder or wrist cannot turn everywhere
        assert np.all(found.valid.sum(axis=-1) % 2 == 0)
        assert np.unique(found.valid.sum(axis=-1)).size > 1
    else:
        assert np.all(found.valid.sum(axis=-1) == 8)
    rows, there = found.q[:, 0], found.valid[:, 0]
    apart = np.abs(turn(rows[:, :, None] - rows[:, None])).max(axis=-1)
    apart[:, np.arange(8), np.arange(8)] = np.inf
    assert np.nanmin(apart) > 1e-6
    angles = arm_angle_of(solver, np.where(there[..., None], rows, 0.0))
    wrong = turn(angles - arm_angle_of(solver, q)[:, None])[there]
    # a rounded table moves the arm angle by as much as its axes miss each other
    assert np.abs(wrong).max() < (1e-7 if "icub" in name else 1e-11)


@pytest.mark.parametrize("name", ["iiwa14", "random", "random level"])
def test_the_arm_angle_is_where_the_elbow_is(name):
    """Measured on the chain itself: the foot of the shoulder on axis 4, about the line."""
    chain, solver = arm(name)
    q = random_postures(100, seed=4)
    psi = np.linspace(-np.pi, np.pi, 9)[1:]
    found = solved(name, q, psi=np.broadcast_to(psi, (100, 8)))
    chosen = found.q[:, :, 0]
    upper = JointChain(np.arange(3), chain.sigma[:3], chain.D[:4], np.eye(4))
    P = poses(upper, chosen[..., :3])  # frame of joint 4
    S = solver.shoulder
    W = (poses(chain, chosen) @ np.append(solver.wrist, 1.0))[..., :3]
    axis, origin = P[..., :3, 2], P[..., :3, 3]
    E = origin + np.sum((S - origin) * axis, axis=-1, keepdims=True) * axis
    line = (W - S) / np.linalg.norm(W - S, axis=-1, keepdims=True)

    def across(v):
        v = v - np.sum(v * line, axis=-1, keepdims=True) * line
        return v / np.linalg.norm(v, axis=-1, keepdims=True)

    plane, elbow = across(np.broadcast_to([0.0, 0.0, 1.0], line.shape)), across(E - S)
    measured = np.arctan2(np.sum(np.cross(plane, elbow) * line, axis=-1), np.sum(plane * elbow, -1))
    assert np.abs(turn(measured - psi)).max() < 1e-9


# --- singular postures ---------------------------------------------------------------------------


def angle_of_type_2(a, b, farthest):
    """Angle at which ``a . Rz b`` is least, or greatest."""
    return np.arctan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]) * -1 + (
        0.0 if farthest else np.pi
    )


def aligned(name):
    """Angles of joints 2, 4, 6 at which axes 1 and 3, the arm, axes 5 and 7 are in line."""
    chain, solver = arm(name)
    D, (s, w) = chain.D, solver.points
    return {
        1: angle_of_type_2(D[1][2, :3], D[2][:3, 2], True),
        3: angle_of_type_2(s, w, False),
        5: angle_of_type_2(D[5][2, :3], D[6][:3, 2], True),
    }


@pytest.mark.parametrize(
    ("places", "freed"),
    [((1,), (0,)), ((5,), (4,)), ((1, 5), (0, 4)), ((3,), ()), ((1, 3), (0,)), ((3, 5), (4,)),
     ((1, 3, 5), (0, 4))],
)  # fmt: skip
@pytest.mark.parametrize("name", ["iiwa14", "lwr4_plus", "erd:human_left_arm", "random level"])
def test_aligned_and_stretched_postures_take_the_reference(name, places, freed):
    q = random_postures(60, seed=6)
    for place in places:
        q[:, place] = aligned(name)[place]
    found = solved(name, q, references=q)
    gap = gaps(found.q[:, 0], q)
    assert np.nanmin(gap, axis=1).max() < 1e-6
    own = found.free[np.arange(60), 0, np.nanargmin(gap, axis=1)]
    np.testing.assert_array_equal(own, np.broadcast_to(np.isin(np.arange(7), freed), own.shape))
    assert found.double[found.valid].all() == (3 in places)
    # another reference at the same arm angle: the families at its values
    references = q + 0.3
    psi = arm_angle_of(arm(name)[1], q)[:, None]
    other = solved(name, q, psi=psi, references=references)
    for joint in freed:
        free = other.free[..., joint]
        assert free.any(axis=-1).all()
        wanted = np.broadcast_to(references[:, None, None, joint], free.shape)[free]
        assert np.abs(turn(other.q[..., joint][free] - wanted)).max() < 1e-12
    # an aligned shoulder or wrist is one branch at one root of joint 4, at the other it may be two
    counts = found.valid[:, 0].sum(axis=1)
    if 3 in places:
        assert np.all(counts == 4 >> len(freed))
    else:
        assert np.all((counts >= 8 >> len(freed)) & (counts <= {1: 6, 2: 5}[len(freed)]))


@pytest.mark.parametrize("joint", [1, 5])
@pytest.mark.parametrize("tiny", [1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3])
def test_both_branches_beside_an_aligned_joint(joint, tiny):
    """Its neighbours are known by their sum only, the better the farther it is from aligned."""
    q = random_postures(60, seed=7)
    q[:, joint] = tiny
    found = solved("iiwa14", q, references=q)
    rows = found.q[:, 0]
    way = np.abs(turn(rows - q[:, None]))
    others = np.delete(way, [joint - 1, joint, joint + 1], axis=-1).max(axis=-1)
    # the other branch turns both neighbours by half a turn: the sum is the same
    total = (rows - q[:, None])[..., [joint - 1, joint + 1]].sum(axis=-1)
    same = (others < 1e-9) & (np.abs(turn(total)) < 1e-9)
    for sign in (1, -1):
        there = same & (np.abs(rows[..., joint] - sign * tiny) < 1e-3 * tiny + 1e-12)
        assert there.any(axis=1).all()


def test_a_wrist_in_the_shoulder_keeps_the_upper_arm_at_the_reference():
    chain, solver = arm("iiwa14")
    D = np.array(chain.D)
    D[4, :3, 3] *= 0.42 / 0.4  # upper arm and forearm of one length
    equal = JointChain(chain.columns, chain.sigma, D, chain.base)
    solver = prepare_arm_angle(equal)
    s, w = solver.points
    assert np.isclose(np.linalg.norm(s), np.linalg.norm(w), rtol=0, atol=1e-15)
    q = random_postures(20, seed=8)
    q[:, 3] = np.arctan2(s[1], s[0]) - np.arctan2(w[1], w[0])
    found = at_angles(solver, poses(equal, q), [0.0, 1.0], q)
    assert np.nanmin(gaps(found.q[:, 1], q), axis=1).max() < 1e-7
    assert found.free[found.valid][:, :3].all()
    np.testing.assert_array_equal(found.q[:, 0], found.q[:, 1])


# --- out of reach, unusual -----------------------------------------------------------------------


def test_other_arms_have_no_arm_angle():
    for name in ("panda", "erd:xarm7", "rx90", "lab_rr", "erd:talos_left_arm"):
        assert prepare_arm_angle(joint_chain(load(name))) is None
    chain, _ = arm("iiwa14")
    # axes that miss each other by a millimetre
    D = np.array(chain.D)
    D[1, 0, 3] += 1e-3
    assert prepare_arm_angle(JointChain(chain.columns, chain.sigma, D, chain.base)) is None


# --- locked joints -------------------------------------------------------------------------------

LOCKED = [
    *((name, {joint: 0.7}) for name in ("iiwa14", "panda", "erd:xarm7") for joint in range(7)),
    *((name, {joint: 0.7}) for name, joint in [
        ("erd:talos_left_arm", 1), ("erd:talos_right_arm", 5), ("erd:baxter_left_arm", 3),
        ("erd:tiago_arm", 4), ("erd:tiago_pro_left_arm", 0), ("erd:pr2_left_arm", 0),
        ("erd:icub_left_arm", 2), ("erd:g1_left_arm", 0), ("erd:human_left_arm", 3)]),
    ("iiwa14", {5: 0.8, 2: 0.4}),
]  # fmt: skip


@pytest.mark.sampled(6)
@pytest.mark.parametrize(("name", "lock"), LOCKED)
def test_any_joint_may_be_locked(name, lock):
    model = load(name)
    q = random_postures(40, seed=13)
    q[:, list(lock)] = list(lock.values())
    T = dgm(model, q)
    found = igm(model, T, q, lock=lock)
    n, s = np.nonzero(found.valid)
    assert np.abs(dgm(model, found.q[n, s]) - T[n]).max() <= 1e-12
    assert np.all(found.q[n, s][:, list(lock)] == list(lock.values()))
    assert np.nanmin(gaps(found.q, q), axis=1).max() < 1e-6
    assert np.all((found.count + found.double.sum(axis=1)) % 2 == 0)
    assert not found.free_joints[..., list(lock)].any()
