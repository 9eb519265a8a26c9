"""The inverse geometric model through its one call: results, order, limits, statuses, mistakes."""

import json
import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import robotmodels as rm
from robotmodels.errors import InvalidValueError, NotARotationError, ShapeError
from robotmodels.igm.solutions import posture_distance

ORACLES = Path(__file__).parent / "oracles"


def random_q(model, count, seed=0):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, model.n))
    sigma = model.table.sigma[model.table.joint_rows]
    q[:, sigma == 1] *= 0.2
    return q


def checked(model, T, found, residual=1e-12):
    """What holds of every result."""
    T = np.asarray(T)
    q, valid = found.q, found.valid
    assert q.shape == (*T.shape[:-2], valid.shape[-1], model.n)
    assert np.all(np.isnan(q) == ~valid[..., None])
    assert not np.any(np.diff(valid.astype(int), axis=-1) > 0)
    assert np.all((found.branch != "") == valid)
    assert np.all(np.isin(found.status, (0, 1)) == valid.any(axis=-1))
    assert found.valid.shape[-1] == (found.count.max() if found.count.size else 0)
    again = rm.dgm(model, np.where(valid[..., None], q, 0.0))
    error = np.where(valid[..., None, None], again - T[..., None, :, :], 0.0)
    assert np.abs(error).max(initial=0.0) <= residual
    assert np.nanmax(found.residual, initial=0.0) <= residual
    turning = model.table.sigma[model.table.joint_rows] == 0
    angles = q[..., turning][valid]
    assert not np.any((angles > np.pi) | (angles <= -np.pi))
    return found


def distance(model, q, goal):
    turning = model.table.sigma[model.table.joint_rows] == 0
    return posture_distance(q, goal, turning)


@pytest.mark.parametrize("name", ["rx90", "ur5"])
def test_the_oracles_complete_sets(name):
    oracle = json.loads((ORACLES / f"igm_{name}.json").read_text())
    rows = oracle["robot"]
    table = rm.DHTable.from_rows(
        [
            {key: rows[key][j] for key in ("sigma", "alpha", "d", "theta", "r")}
            for j in range(rows["n"])
        ]
    )
    model = rm.RobotModel.from_table(table, tool=np.array(rows["tool"]))
    T = np.array([case["T"] for case in oracle["cases"]])
    found = checked(model, T, rm.igm(model, T))
    assert found.count.tolist() == [case["n_solutions"] for case in oracle["cases"]]
    for i, case in enumerate(oracle["cases"]):
        for q in case["solutions"]:
            assert np.nanmin(distance(model, found.q[i], np.array(q))) < 1e-6


@pytest.mark.parametrize("name", ["rx90", "stanford_arm", "erd:ur10", "erd:centauro_left_arm"])
def test_every_posture_and_the_one_it_came_from(name):
    Z, E = (rm.se3.from_rpy(x[:3], x[3:]) for x in np.random.default_rng(11).normal(size=(2, 6)))
    model, moved = rm.load(name), name.startswith("erd:")
    model = model.with_base(Z).with_tool(E) if moved else model
    q = random_q(model, 200)
    T = rm.dgm(model, q)
    found = checked(model, T, rm.igm(model, T, q), residual=2e-12 if moved else 1e-12)
    assert np.all(found.count % 2 == 0)
    # ordered by distance to the reference: the posture itself comes first
    away = distance(model, found.q, q[:, None])
    assert away[:, 0].max() < (1e-6 if moved else 1e-8)
    assert np.all(np.diff(away, axis=1)[found.valid[:, 1:]] >= 0)
    for i in range(0, 200, 40):
        single = rm.igm(model, T[i], q[i])
        np.testing.assert_allclose(single.q, found.q[i][found.valid[i]], rtol=0, atol=1e-13)
        assert single.branch.tolist() == found.branch[i][found.valid[i]].tolist()


@pytest.mark.parametrize("name", ["rx90", "puma560", "ur5", "kr6_r900"])
def test_branches_keep_their_label_along_a_path(name):
    """Postures move continuously where no singularity is crossed, and so do their labels."""
    model = rm.load(name)
    for seed in range(40):
        start = random_q(model, 1, seed)[0]
        q = start + np.linspace(0, 0.1, 60)[:, None] * np.cos(np.arange(model.n) + seed)
        found = rm.igm(model, rm.dgm(model, q))
        conditions = np.linalg.svd(rm.jacobian(model, q), compute_uv=False)[:, -1]
        if conditions.min() < 0.02 or len(set(found.count.tolist())) > 1:
            continue
        at = np.nanargmin(distance(model, found.q, q[:, None]), axis=1)
        labels = {found.branch[i][s] for i, s in enumerate(at)}
        assert len(labels) == 1
        # without a reference the rows are in the order of their labels
        assert all(list(row) == sorted(row) for row in found.code[:, : found.count[0]])
        assert all(len(set(row)) == len(row) for row in found.code[:, : found.count[0]])


@pytest.mark.nightly
def test_the_three_singular_positions_of_the_rx90():
    """Section 1.2.3, notes on singular positions: shoulder, wrist, elbow, and combinations."""
    model = rm.load("rx90")
    q = random_q(model, 40, 9)
    q[:, 2] = np.linspace(-1.2, 1.2, 40)  # off the elbow's singularity
    q[:, 4] += 0.3 * np.sign(q[:, 4])
    shoulder = q.copy()
    shoulder[:, 1] = 0.5 * (0.5 * np.pi - q[:, 2])  # S23 RL4 = C2 D3 with D3 = RL4
    both, elbow, folded = shoulder.copy(), q.copy(), q.copy()
    both[:, 4] = 0.0
    elbow[:, 2] = -0.5 * np.pi  # C3 = 0, stretched
    folded[:, 2] = 0.5 * np.pi  # C3 = 0, folded: O_4 is in O_1, about which the arm turns freely
    results = []
    for q in (shoulder, both, elbow, folded):
        results.append(rm.igm(model, rm.dgm(model, q), q))
        assert distance(model, results[-1].q[:, 0], q).max() < 1e-6
    assert np.all(results[0].free_joints[:, 0, 0])
    # two curves of postures cross there: one turns the wrist alone, the other the shoulder
    assert np.all(results[1].free_joints[:, 0, 3])
    assert np.all(np.any(results[1].free_joints[:, :, 0], axis=1))
    assert np.all(results[2].double[:, 0])
    assert np.all(results[2].status == rm.IGMStatus.REACHED)
    assert np.nanmax(results[2].residual) <= 1e-12
    assert np.all(results[3].status == rm.IGMStatus.REACHED_FAMILY)


def test_batches_single_poses_and_nothing():
    model = rm.load("irb140")
    q = random_q(model, 6).reshape(2, 3, 6)
    T = rm.dgm(model, q)
    found = checked(model, T, rm.igm(model, T))
    assert found.status.shape == (2, 3)
    assert found.count.dtype.kind == "i"
    one = rm.igm(model, T[1, 2].tolist())
    np.testing.assert_allclose(one.q, found.q[1, 2][found.valid[1, 2]], rtol=0, atol=1e-13)
    pinned = rm.igm(model, pin.SE3(T[1, 2]))
    np.testing.assert_allclose(pinned.q, one.q, atol=1e-12)
    none = rm.igm(model, np.empty((0, 4, 4)))
    assert none.q.shape[0] == 0
    assert none.count.shape == (0,)
    # references broadcast with poses
    many = rm.igm(model, T[0, 0], q.reshape(6, 6))
    assert many.q.shape[0] == 6
    assert distance(model, many.q[0, 0], q[0, 0]) < 1e-9
    assert pickle.loads(pickle.dumps(found)).branch.tolist() == found.branch.tolist()
    with pytest.raises(ValueError, match="read-only"):
        found.q[...] = 0


@pytest.mark.parametrize("tolerance", [1e-9, 1.1e-9], ids=["by the plan", "by another method"])
@pytest.mark.parametrize("given", [True, False], ids=["reference", "no reference"])
@pytest.mark.parametrize("name", ["ur5", "lab_rrt", "planar_3r"])
def test_solutions_within_limits_are_all_solutions_turned_and_sorted(name, given, tolerance):
    model, rng = rm.load(name), np.random.default_rng(3)
    low, high = -rng.uniform(1.0, 6.0, model.n), rng.uniform(1.0, 6.0, model.n)
    model = model.with_table(model.table.replace(lower=low, upper=high))
    T, turning = rm.dgm(model, random_q(model, 30)), model.table.sigma == 0
    reference = rng.uniform(low, high) if given else None
    every = rm.igm(model, T, reference, position_tolerance=tolerance)
    found = rm.igm(model, T, reference, limits=True, position_tolerance=tolerance)
    goal = reference if given else 0.5 * (low + high)
    for rows, ours in zip(every.q, found.q, strict=True):
        shortest = [distance(model, q, goal) if given else 0.0 for q in rows]
        assert not given or np.all(np.diff([d for d in shortest if d == d]) >= 0.0)
        expected = []
        for q in rows[np.isfinite(rows[:, 0])].copy():
            # of all values inside the limits the nearest to the goal
            for j in np.flatnonzero(turning):
                same = q[j] + 2.0 * np.pi * np.arange(-3, 4)
                same = same[(same >= low[j]) & (same <= high[j])]
                q[j] = same[np.abs(same - goal[j]).argmin()] if same.size else np.nan
            if ((low <= q) & (q <= high)).all():
                expected.append(q)
        if given:
            expected.sort(key=lambda q: np.linalg.norm(q - goal))
        ours = ours[np.isfinite(ours[:, 0])]
        np.testing.assert_allclose(ours, np.reshape(expected, ours.shape), rtol=0, atol=1e-9)
    assert np.array_equal(found.within_limits, found.valid)
    assert (found.count < every.count).any()


def test_why_a_pose_has_no_posture():
    model = rm.load("rx90")
    T = rm.dgm(model, [0.3, 0.4, 0.5, 0.6, 0.7, 0.8])
    far = T.copy()
    far[:3, 3] = 4.0, 0, 0
    found = rm.igm(model, np.array([T, far]))
    assert found.count.tolist() == [8, 0]
    assert found.status.tolist() == [rm.IGMStatus.REACHED, rm.IGMStatus.TOO_FAR]
    assert "too far" in found.reason(1)
    assert "m." in found.reason(1)
    assert np.isnan(found.closest[0]).all()
    assert np.isfinite(found.closest[1]).all()
    # a five-fold longer forearm leaves a hole around the shoulder
    t = model.table
    long = rm.RobotModel.from_table(
        rm.DHTable(antecedent=t.antecedent, sigma=t.sigma, alpha=t.alpha, d=t.d, theta=t.theta,
                   r=np.array(t.r) * 5)
    )  # fmt: skip
    near = np.eye(4)
    near[:3, 3] = 0.2, 0.1, 0.1
    assert rm.igm(long, near).status == rm.IGMStatus.TOO_NEAR
    assert rm.igm(model, far).q.shape == (0, 6)
    # the tool point is in reach, but not with this orientation: half a tool's length inside
    tool = np.eye(4)
    tool[2, 3] = 0.6
    handed = model.with_tool(tool)
    out = rm.dgm(handed, [0.3, 0.0, 0.5 * np.pi, 0.0, 0.0, 0.0])
    turned = out.copy()
    turned[:3, :3] = out[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    assert rm.igm(handed, turned).status == rm.IGMStatus.ORIENTATION_NOT_AVAILABLE


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"T": np.eye(3)}, ShapeError, "4, 4"),
        ({"T": np.full((4, 4), np.nan)}, InvalidValueError, "finite"),
        ({"T": np.diag([2.0, 1, 1, 1])}, NotARotationError, "rotation"),
        ({"T": np.diag([-1.0, 1, 1, 1])}, NotARotationError, "rotation"),
        ({"T": rm.se3.translation(1.7e308, -1.7e308, 0)}, InvalidValueError, "1e\\+100 m, got"),
        ({"T": rm.se3.translation(0, 0, 2e100)[None], "lock": {0: 0}}, InvalidValueError, "got"),
        ({"q_ref": [0.0] * 5}, ShapeError, "q_ref"),
        ({"q_ref": [np.nan] * 6}, InvalidValueError, "q_ref"),
        ({"mask": [0] * 6}, InvalidValueError, "nothing"),
        ({"mask": [1, 1, 1]}, ShapeError, "mask"),
        ({"mask": [2, 1, 1, 1, 1, 1]}, InvalidValueError, "zeros and ones"),
        ({"mask_axes": "base"}, InvalidValueError, "mask_axes"),
        ({"limits": 1}, InvalidValueError, "limits"),
        ({"position_tolerance": 0}, InvalidValueError, "position_tolerance"),
        ({"orientation_tolerance": "1e-3"}, InvalidValueError, "orientation_tolerance"),
        ({"lock": {7: 0.1}}, InvalidValueError, "columns of q"),
        ({"lock": {"joint": 0.1}}, InvalidValueError, "no joint is called"),
        ({"lock": {0: np.nan}}, InvalidValueError, "finite"),
        ({"lock": {1: True}}, InvalidValueError, "joint 1: .*finite number, got True"),
        ({"lock": [1]}, InvalidValueError, "mapping"),
        ({"arm_angle": 0.3}, InvalidValueError, "arm_angle"),
        ({"relations": [1]}, InvalidValueError, "pair"),
        ({"relations": ([[1.0] * 7], [0.0])}, ShapeError, "relations"),
        ({"relations": ([[1.0] * 6], [0.0])}, InvalidValueError, "more than six"),
        ({"relations": ([[0.0] * 7], [0.0]), "model": rm.load("panda")}, InvalidValueError, "rank"),
        ({"relations": ([[1.0] * 6], [0.0]), "lock": {0: 1}}, InvalidValueError, "together"),
        ({"model": "rx90"}, InvalidValueError, "RobotModel"),
    ],
)
def test_mistakes_are_named(change, error, words):
    given = {"model": rm.load("rx90"), "T": np.eye(4), **change}
    with pytest.raises(error, match=words):
        rm.igm(**given)


def test_arm_angles_are_an_axis_behind_the_poses_and_joints_are_locked_by_name():
    model = rm.load("iiwa14")
    q = np.random.default_rng(4).uniform(-1.5, 1.5, (20, 7))
    T, angles = rm.dgm(model, q), [-0.5, 0.0, 2.0]
    by_angle = rm.igm(model, T, arm_angle=angles)
    checked(model, np.repeat(T[:, None], 3, axis=1), by_angle)
    assert by_angle.q.shape == (20, 3, 8, 7)
    assert np.all(by_angle.status == rm.IGMStatus.REACHED)
    np.testing.assert_allclose(rm.igm(model, T, arm_angle=2.0).q, by_angle.q[:, 2], atol=1e-12)
    for column in (0, 2, 4, 6):
        for name in (column, str(model.table.names[model.table.joint_rows[column]])):
            locked = rm.igm(model, T[0], q[0], lock={name: q[0, column]})
            assert distance(model, locked.q[0], q[0]) < 1e-8
            np.testing.assert_allclose(locked.q[:, column], q[0, column], atol=1e-12)
            assert locked.status == rm.IGMStatus.REACHED
            assert not locked.free_joints.any()


def test_poses_and_positions_of_the_exercise():
    """The exercise's poses A and B."""
    trr = rm.load("lab_trr")
    A = [[0, 0, -1, 0.1414], [0, 1, 0, -0.3], [1, 0, 0, 0.8414], [0, 0, 0, 1]]
    B = [[-1, 0, 0, 0.4], [0, 1, 0, 0.2], [0, 0, -1, 0.5], [0, 0, 0, 1]]
    assert rm.igm(trr, A).count == 0
    found = rm.igm(trr, A, position_tolerance=1e-4, orientation_tolerance=1e-4)
    np.testing.assert_allclose(found.q, [[-0.3, -np.pi / 4, -np.pi / 4]], atol=1e-4)
    assert rm.igm(trr, B).status == rm.IGMStatus.ORIENTATION_NOT_AVAILABLE
    assert "off by 180 deg" in rm.igm(trr, B).reason()
    point = [1, 1, 1, 0, 0, 0]
    reached = rm.igm(trr, B, mask=point)
    np.testing.assert_allclose(reached.q, [[0.2, 0, 0]], atol=1e-7)
    assert reached.double.all()
    path = rm.trajectories.cartesian_trajectory(np.array(A, float), np.array(B, float), 50)
    along = rm.igm(trr, path, mask=point)
    assert np.all(along.status == rm.IGMStatus.REACHED)


def test_a_family_whose_curve_does_not_close():
    """Wrist aligned and elbow stretched to rounding: the walk along the family has to end."""
    model = rm.load("ur5e")
    q = [-1.3277221066477949, -1.5804047667774181, -2.7642736666289568e-17]
    q = np.array([*q, 1.5040466962268813, np.pi, -2.5498385378908077])
    T = rm.dgm(model, q)
    found = checked(model, T, rm.igm(model, T, q))
    assert found.status == rm.IGMStatus.REACHED_FAMILY
    assert distance(model, found.q[0], q) < 1e-6


def test_a_path_through_the_solutions_is_continuous():
    model = rm.load("rx90")
    start = [0.3, 0.4, 1.2, 0.3, 0.9, 0.3]
    q = start + np.linspace(0.0, 1.0, 50)[:, None] * [7.0, 0.2, 0.3, -9.0, 0.3, 3.0]
    found = rm.igm(model, rm.dgm(model, q))
    np.testing.assert_allclose(found.path(q[0]), q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.path(q[0] + 0.2), q, rtol=0, atol=1e-9)
    assert found.path(q[0] + 2.0 * np.pi)[0, 0] == pytest.approx(q[0, 0] + 2.0 * np.pi)
    T = rm.dgm(model, q)
    T[7, :3, 3] = 9.0
    with pytest.raises(InvalidValueError, match=r"pose 7 has no solution: .* too far"):
        rm.igm(model, T).path(q[0])
    with pytest.raises(ShapeError, match="poses of shape"):
        rm.igm(model, T[0]).path(q[0])
