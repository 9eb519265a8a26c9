"""Tasks and arms of fewer than six: complete against an independent search, residuals on what is
asked alone, double roots, self-motions, tolerances."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import robotmodels as rm
from robotmodels.igm import search

WHOLE, POINT, POINTING, PLANE = "111111", "111000", "111110", "110001"
# joint kinds, and which joints are parallel to the one before
FEWER = (
    "lab_rr", "lab_rrt", "lab_trr", "planar_2r", "planar_3r", "cobra_s600", "xarm5",
    "R", "P", "RR", "RP", "PR", "PP", "RR/1", "RRR", "RRP", "RPR", "PRR", "RPP", "PPR", "PPP",
    "RRR/12", "RRP/1", "RRRR", "RRRP/12", "PRRR/23", "RPRP", "PPPR", "RRRRR/23", "PRRRR/2",
    "RRRRR",
)  # fmt: skip
MASKED = (
    ("lab_rr", POINT, "world"), ("lab_rrt", POINT, "world"), ("lab_trr", POINT, "tool"),
    ("RRR", POINT, "world"), ("RR", "011000", "world"), ("planar_2r", "110000", "world"),
    ("planar_2r", "110000", "tool"), ("RRRRR", POINTING, "tool"), ("RRRRR/23", POINTING, "tool"),
    ("xarm5", POINTING, "world"), ("RRRR/1", "110011", "world"), ("RP", "101000", "world"),
    ("RRP", POINT, "tool"), ("planar_3r", PLANE, "world"), ("cobra_s600", "111001", "world"),
    ("planar_3r", PLANE, "tool"), ("RRRR", "111001", "tool"), ("RRP", "101100", "world"),
    ("R", "000001", "tool"),
)  # fmt: skip
REDUNDANT = (
    ("rx90", POINT, "world"), ("rx90", POINTING, "tool"), ("planar_3r", "110000", "world"),
    ("cobra_s600", POINT, "world"), ("RR", "000001", "world"),
)  # fmt: skip


@cache
def arm(word):
    """An arm of the catalogue, or a random one with a base and a tool."""
    if word.islower():
        return rm.load(word)
    kinds, _, parallel = word.partition("/")
    rng = np.random.default_rng(sum(map(ord, word)))
    rows = []
    for i, kind in enumerate(kinds):
        alpha, theta = rng.uniform(0.4, 1.4) * rng.choice([-1, 1]), rng.uniform(-3.0, 3.0)
        d, r = rng.uniform(-0.5, 0.5, 2)
        alpha = 0.0 if str(i) in parallel else alpha
        rows.append({"sigma": int(kind == "P"), "alpha": alpha, "d": d, "theta": theta, "r": r})
    base, tool = (
        rm.se3.translation(*rng.uniform(-0.4, 0.4, 3)) @ rm.se3.from_rpy(rng.uniform(-3, 3, 3))
        for _ in range(2)
    )
    return rm.RobotModel.from_table(rm.DHTable.from_rows(rows), base=base, tool=tool)


def flags(mask):
    return np.array([c == "1" for c in mask])


def turns(model):
    return model.table.sigma[model.table.joint_rows] == 0


def drawn(model, N, seed=0):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (N, model.n))
    return np.where(turns(model), q, 0.2 * q)


def gaps(model, a, b):
    d = a - b
    return np.abs(np.where(turns(model), (d + np.pi) % (2 * np.pi) - np.pi, d)).max(axis=-1)


def error(model, T, q, mask, axes):
    """Missing components in the mask's axes: written here on its own."""
    P = rm.dgm(model, q)
    E = T[..., :3, :3] if axes == "tool" else np.broadcast_to(np.eye(3), T[..., :3, :3].shape)
    back = np.swapaxes(E, -1, -2)
    turn = Rotation.from_matrix(T[..., :3, :3] @ np.swapaxes(P[..., :3, :3], -1, -2)).as_rotvec()
    away = (back @ (T[..., :3, 3] - P[..., :3, 3])[..., None])[..., 0]
    return np.concatenate([away, (back @ turn[..., None])[..., 0]], axis=-1)[..., flags(mask)]


def tasks(model, mask, axes, N, seed=0):
    """Configurations, and poses that differ from theirs in freed components."""
    q, rng = drawn(model, N, seed), np.random.default_rng(seed)
    T, free = rm.dgm(model, q), ~flags(mask)
    away = rng.uniform(-0.4, 0.4, (N, 3)) * free[:3]
    turn = rng.normal(size=(N, 3)) * free[3:]
    turn *= rng.uniform(0.0, 3.1, (N, 1)) / np.maximum(np.linalg.norm(turn, axis=1), 1e-9)[:, None]
    R = Rotation.from_rotvec(turn).as_matrix()
    if axes == "tool":
        T[:, :3, :3] = T[:, :3, :3] @ R
        T[:, :3, 3] += (T[:, :3, :3] @ away[..., None])[..., 0]
    else:
        T[:, :3, :3], T[:, :3, 3] = R @ T[:, :3, :3], T[:, :3, 3] + away
    return q, T


def solved(model, T, mask=WHOLE, axes="world", accuracy=2e-9, **options):
    """Solutions, each measured independently; distinct, packed, angles within half a turn."""
    chosen = None if mask == WHOLE else flags(mask)
    found = rm.igm(model, T, mask=chosen, mask_axes=axes, **options)
    n, s = np.nonzero(found.valid)
    assert np.abs(error(model, T[n], found.q[n, s], mask, axes)).max(initial=0.0) < accuracy
    angles = found.q[n, s][:, turns(model)]
    assert np.abs(angles).max(initial=0.0) <= np.pi + 1e-14
    assert np.all(np.diff(found.valid.astype(int), axis=1) <= 0)
    for i in range(found.valid.shape[1]):
        for j in range(i):
            both = found.valid[:, i] & found.valid[:, j]
            assert np.all(gaps(model, found.q[both, i], found.q[both, j]) > 1e-6)
    return found


def lost(model, found, q, within=1e-6):
    near = np.where(found.valid, gaps(model, found.q, q[:, None]), np.inf)
    return np.flatnonzero(near.min(axis=1, initial=np.inf) > within)


def independent(model, T, mask, axes, starts=60):
    """All solutions that damped Newton steps reach from spread starts, slopes by differences."""
    T, q = np.broadcast_to(T, (starts, 4, 4)), drawn(model, starts, 9)
    damping, e = np.full(starts, 1e-2), error(model, T, q, mask, axes)
    for _ in range(60):
        steps = 1e-6 * np.eye(model.n)
        sides = [[error(model, T, q + s * d, mask, axes) for s in (1, -1)] for d in steps]
        J = np.stack([(a - b) / 2e-6 for a, b in sides], -1)
        J[np.abs(J) > 1e3] = 0.0  # a rotation vector jumps at half a turn
        Jt = np.swapaxes(J, 1, 2)
        normal = Jt @ J + damping[:, None, None] * np.eye(model.n)
        trial = q - np.linalg.solve(normal, Jt @ e[..., None])[..., 0]
        trial = np.where(turns(model), np.angle(np.exp(1j * trial)), trial)
        next_e = error(model, T, trial, mask, axes)
        better = np.sum(next_e**2, axis=1) < np.sum(e**2, axis=1)
        q, e = np.where(better[:, None], trial, q), np.where(better[:, None], next_e, e)
        damping = np.clip(np.where(better, 0.2, 5.0) * damping, 1e-9, 1e6)
    distinct = []
    for x in q[np.abs(e).max(axis=1) < 1e-8]:
        if all(gaps(model, x, y) > 1e-3 for y in distinct):
            distinct.append(x)
    return distinct


@pytest.mark.sampled(12)
@pytest.mark.parametrize(
    ("word", "mask", "axes"), [(word, WHOLE, "world") for word in FEWER] + list(MASKED)
)
def test_random_tasks_give_their_configuration_back(word, mask, axes):
    model = arm(word)
    q, T = tasks(model, mask, axes, 12 if (word, mask) == ("RRRR", "111001") else 100)
    found = solved(model, T, mask, axes)
    assert lost(model, found, q).size == 0
    assert not found.free_joints.any()
    # orientations that a planar arm does not reach are searched, in tool axes
    searched = "may be missing" in found.method or (mask, axes) == (PLANE, "tool")
    assert np.all((found.status == rm.IGMStatus.INCOMPLETE) == searched)
    alone = rm.igm(model, T[0], mask=flags(mask), mask_axes=axes)
    np.testing.assert_allclose(alone.q[: alone.count], found.q[0, found.valid[0]], atol=1e-9)


@pytest.mark.parametrize(
    ("word", "mask", "axes"),
    [
        ("planar_3r", WHOLE, "world"), ("cobra_s600", WHOLE, "world"), ("RRR", WHOLE, "world"),
        ("RRRR", WHOLE, "world"), ("RRRRR/23", WHOLE, "world"), ("lab_rrt", POINT, "world"),
        ("RRR", POINT, "world"), ("RR", "011000", "world"), ("RRRRR/23", POINTING, "tool"),
        ("RRRR/1", "110011", "world"), ("planar_3r", PLANE, "world"), ("RRRR", "111001", "tool"),
    ],
)  # fmt: skip
@pytest.mark.nightly
def test_as_many_solutions_as_an_independent_search(word, mask, axes):
    model = arm(word)
    _, T = tasks(model, mask, axes, 2, seed=1)
    found = solved(model, T, mask, axes)
    for n in range(len(T)):
        others = independent(model, T[n], mask, axes)
        assert 1 <= len(others) <= found.count[n]
        for x in others:
            assert gaps(model, found.q[n, found.valid[n]], x).min() < 1e-5


@pytest.mark.parametrize(("word", "mask", "axes"), REDUNDANT)
def test_joints_that_a_task_leaves_free_take_the_reference(word, mask, axes):
    model = arm(word)
    q, T = tasks(model, mask, axes, 4)
    found = solved(model, T, mask, axes, q_ref=q)
    assert lost(model, found, q).size == 0
    assert np.all(found.free_joints[found.valid].sum(axis=1) == model.n - flags(mask).sum())
    n, s = np.nonzero(found.valid)
    d = np.abs(found.q[n, s] - q[n])[found.free_joints[n, s]]
    assert np.minimum(d, 2 * np.pi - d).max() < 1e-9
    others = solved(model, T, mask, axes)
    assert np.all(others.count > 0)


@pytest.mark.parametrize(
    "word", ["lab_rrt", "lab_trr", "cobra_s600", "xarm5", "RRR", "RRP", "RRRR"]
)
def test_right_angles_and_configurations_beside_them(word):
    model, rng = arm(word), np.random.default_rng(2)
    q = rng.integers(-1, 3, (100, model.n)) * np.pi / 2
    q = np.where(turns(model), q, 0.1 * q)
    for distance in (0.0, 1e-9, 1e-6, 1e-3):
        beside = q + distance * rng.normal(size=q.shape)
        found = solved(model, rm.dgm(model, beside), q_ref=beside, accuracy=1e-8)
        assert lost(model, found, beside, 1e-5).size == 0


def squared_arm(joints, slides, rng):
    """Axes at right angles, parallel or, one time in six, at any angle; half of the lengths 0."""
    rows = []
    for i in range(joints):
        alpha = rng.choice([*np.array([0, 0, 1, -1, -1]) * np.pi / 2, rng.uniform(0.3, 1.2)])
        d, r = rng.uniform(-0.5, 0.5, 2) * rng.integers(0, 2, 2)
        rows.append({"sigma": int(i in slides), "alpha": alpha, "d": d, "r": r})
    return rm.RobotModel.from_table(rm.DHTable.from_rows(rows), tool=rm.se3.translation(0.1, 0, 0))


@pytest.mark.sampled(8)
@pytest.mark.parametrize("seed", range(80))
def test_a_pose_made_by_the_direct_model_is_never_out_of_reach(seed):
    # most are singular for a closed form, whose free joints take a reference without solution:
    # planar sub-chains, axes that coincide, right angles
    rng = np.random.default_rng(seed)
    joints = (5, 5, 4, 6)[seed % 4]
    model = squared_arm(joints, rng.choice(joints, seed % 3 // 2), rng)
    q = rng.integers(-1, 3, (150, joints)) * np.pi / 2
    q[100:] = drawn(model, 50, seed)
    T = rm.dgm(model, np.where(turns(model), q, 0.2 * q))
    found = rm.igm(model, T)
    unreachable = [rm.IGMStatus.TOO_FAR, rm.IGMStatus.TOO_NEAR]
    assert not np.isin(found.status, [*unreachable, rm.IGMStatus.ORIENTATION_NOT_AVAILABLE]).any()
    assert (found.count > 0).sum() >= 149


def test_a_self_motion_met_by_most_starts_is_completed_a_few_times(monkeypatch):
    rows = zip([0, 90, 90, 180, 0, 90], [0, 0.2, 0.32, 0.37, 0.18, 0], strict=True)
    table = rm.DHTable.from_rows(
        [{"sigma": int(j == 0), "alpha": a, "d": d, "r": 0.17 * (j == 1)}
         for j, (a, d) in enumerate(rows)],
        degrees=True,
    )  # fmt: skip
    model, calls = rm.RobotModel.from_table(table), []
    monkeypatch.setattr(
        search, "completed", lambda *x, f=search.completed: calls.append(1) or f(*x)
    )
    found = rm.igm(model, rm.dgm(model, [0, -2, 1, 1, 0, 0]))
    assert found.status == rm.IGMStatus.REACHED_FAMILY
    assert found.count == 2
    assert 0 < len(calls) < 100


@pytest.mark.parametrize("word", ["lab_trr", "xarm5", "RRR", "PRR", "RRRRR/23"])
def test_poses_with_few_digits(word):
    model, rng = arm(word), np.random.default_rng(3)
    q = drawn(model, 60, 3)
    T = rm.dgm(model, q)
    T[:, :3, 3] += rng.uniform(-1e-5, 1e-5, (60, 3))
    T[:, :3, :3] = (
        T[:, :3, :3] @ Rotation.from_rotvec(rng.uniform(-1e-5, 1e-5, (60, 3))).as_matrix()
    )
    wide = {"position_tolerance": 1e-4, "orientation_tolerance": 1e-4}
    found = solved(model, T, accuracy=2e-4, q_ref=q, **wide)
    # beside a fold an angle is good to the root of the error of the pose
    assert lost(model, found, q, 3e-2).size == 0
    assert not rm.igm(model, T).valid.any()


def test_double_roots_and_self_motions():
    scara = arm("cobra_s600")
    for elbow, double in ((0.0, True), (0.4, False)):
        found = rm.igm(scara, rm.dgm(scara, [0.3, elbow, 0.1, 0.5]))
        assert found.count == (1 if double else 2)
        assert bool(found.double.any()) == double
    # the tool of the planar arm folded back onto its first axis: joints 1 and 3 turn
    # against each other
    planar = arm("planar_3r")
    found = rm.igm(planar, rm.dgm(planar, [0.4, np.pi, 0.7]), q_ref=[0.9, 0.0, 0.0])
    np.testing.assert_allclose(found.q, [[0.9, np.pi, 0.2]], atol=1e-9)
    assert found.free_joints.tolist() == [[True, False, False]]
    # its position without orientation where the tool point is on the last axis
    short = planar.with_tool(np.eye(4))
    q = [0.3, 0.8, -0.9]
    found = rm.igm(short, rm.dgm(short, q), q_ref=q, mask=flags("110000"))
    assert found.count == 2
    assert np.all(found.free_joints == [False, False, True])
    np.testing.assert_allclose(found.q[:, 2], -0.9)
    # two equal links folded: the point is on the first axis, whose joint takes the reference
    equal = rm.RobotModel.from_table(
        rm.DHTable.from_rows([{}, {"d": 1.0}]), tool=rm.se3.translation(1.0, 0.0, 0.0)
    )
    folded = rm.igm(equal, rm.dgm(equal, [0.4, np.pi]), q_ref=[0.9, 0.0], mask=flags("110000"))
    np.testing.assert_allclose(np.abs(folded.q), [[0.9, np.pi]], atol=1e-6)
    assert folded.free_joints.tolist() == [[True, False]]
