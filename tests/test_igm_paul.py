"""Paul's method: the plans, the kernel that runs them, and the explanation of the same plans."""

import json
import re
from functools import cache
from itertools import product
from math import atan2, cos, pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from numba import types as nb

import robotmodels as rm
from robotmodels import se3
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.igm.closed_form import closed_form_postures, plan_loop
from robotmodels.igm.loop import joint_chain
from robotmodels.igm.paul import derive_plan, explain_igm, paul_postures
from robotmodels.igm.paul._run import solve
from robotmodels.igm.paul.equation_type import EquationType
from robotmodels.igm.paul.prose import type_formula
from robotmodels.kernels._compile import VECTOR, compiled

ORACLES = Path(__file__).parent / "oracles"
COMPLETE = (
    "lab_rr", "lab_rrt", "lab_trr", "planar_2r", "planar_3r", "gantry", "rx90", "tx40", "puma560",
    "stanford_arm", "cobra_s600", "ur5", "ur3e", "ur5e", "ur10e", "ur16e", "kr6_r900", "irb120",
    "irb140", "irb6640", "xarm5",
)  # fmt: skip
EIGHT = ("rx90", "tx40", "puma560", "stanford_arm", "kr6_r900", "irb120", "irb140", "irb6640",
         "ur5", "ur5e")  # fmt: skip
RIGHT = pi / 2


@cache
def plan_of(name):
    return derive_plan(joint_chain(rm.load(name)))


@cache
def told_of(name):
    return explain_igm(rm.load(name))


def rotations(rng):
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q * np.sign(np.linalg.det(Q))


def random_pose(rng):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotations(rng), rng.uniform(-1, 1, 3)
    return T


def postures_at_random(plan, count, seed=0):
    q = np.random.default_rng(seed).uniform(-pi, pi, (count, plan.form.k))
    q[:, plan.form.sigma == 1] *= 0.2
    return q


def poses_of(model, plan, q):
    """Poses of the tool in R_0, by the direct model."""
    full = np.zeros((len(q), model.n))
    full[:, plan.chain.columns] = q
    return se3.inverse(model.base) @ rm.dgm(model, full)


def short(plan, way):
    return np.where(plan.form.sigma == 0, (way + pi) % (2 * pi) - pi, way)


def checked(model, plan, q, references=None):
    """Solve the poses of q: everything returned meets its pose, and q is among it."""
    U = poses_of(model, plan, q)
    found = paul_postures(plan, U, references)
    N, S, k = found.q.shape
    reached = poses_of(model, plan, np.where(found.valid[..., None], found.q, 0.0).reshape(-1, k))
    missing = np.abs(reached.reshape(N, S, 4, 4) - U[:, None]).max(axis=(2, 3))
    assert np.where(found.valid, missing, 0.0).max() <= 2e-12
    assert np.nanmax(found.residual) <= 1e-12
    assert np.isnan(found.q[~found.valid]).all()
    assert (found.valid == (np.arange(S) < found.valid.sum(axis=1)[:, None])).all()
    turning = found.q[found.valid][:, plan.form.sigma == 0]
    assert ((turning > -pi) & (turning <= pi)).all()
    gap = np.abs(short(plan, found.q - q[:, None])).max(axis=2)
    return found, np.where(found.valid, gap, np.inf).min(axis=1)


# the plans


@pytest.mark.parametrize(
    ("name", "types"),
    [
        ("rx90", ["TYPE_2_ZERO", "TYPE_6", "TYPE_2_ZERO", "TYPE_3_DIRECT", "TYPE_3_DIRECT"]),
        ("puma560", ["TYPE_2", "TYPE_7", "TYPE_2_ZERO", "TYPE_3_DIRECT", "TYPE_3_DIRECT"]),
        ("ur5", ["TYPE_2", "TYPE_2_ZERO", "TYPE_3_DIRECT", "TYPE_3_DIRECT", "TYPE_8"]),
        ("stanford_arm", ["TYPE_2", "TYPE_2_ZERO", "TYPE_1", "TYPE_2_ZERO", "TYPE_3_DIRECT",
                          "TYPE_3_DIRECT"]),
        ("gantry", ["TYPE_1"] * 3 + ["TYPE_2_ZERO", "TYPE_3_DIRECT", "TYPE_3_DIRECT"]),
        ("lab_rr", ["TYPE_2_ZERO", "TYPE_3_DIRECT"]),
        ("lab_rrt", ["TYPE_2_ZERO", "TYPE_2_ZERO", "TYPE_1"]),
        ("lab_trr", ["TYPE_1", "TYPE_3_DIRECT", "TYPE_3_DIRECT"]),
    ],
)  # fmt: skip
def test_types_of_known_arms(name, types):
    plan = plan_of(name)
    assert [step.type.name for step in plan.steps] == types
    assert plan.complete
    assert sorted(plan.solved) == list(range(plan.form.k))


@pytest.mark.parametrize("name", ["crx10ia", "xarm6", "panda", "iiwa14"])
def test_arms_beyond_the_catalogue_stop_at_once(name):
    plan = plan_of(name)
    assert not plan.complete
    assert plan.remaining == tuple(range(plan.form.k))
    assert plan.program is None
    with pytest.raises(InvalidValueError, match="unsolved"):
        paul_postures(plan, np.eye(4)[None])


def test_a_plan_that_stops_in_the_middle_keeps_what_it_found():
    # a slide along its own axis is found, the general arm behind it is not
    rows = [{"sigma": 1}, *({"alpha": a, "d": 0.1 + a / 9, "r": 0.2} for a in (1.0, 1.3, 0.7, 1.1))]
    arm = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
    plan = derive_plan(joint_chain(arm))
    assert not plan.complete
    assert set(plan.solved) | set(plan.remaining) == set(range(5))
    assert explain_igm(arm).takes_over


def test_no_joint_moves_the_tool():
    with pytest.raises(InvalidValueError, match="no joint"):
        explain_igm(rm.RobotModel.from_table(rm.DHTable(antecedent=[0], sigma=[2])))


# postures


@pytest.mark.parametrize("name", COMPLETE)
def test_every_posture_meets_its_pose_and_the_generating_one_is_found(name):
    plan, model = plan_of(name), rm.load(name)
    found, gap = checked(model, plan, postures_at_random(plan, 300))
    assert gap.max() < 1e-8
    if plan.form.k == 6:
        assert (found.valid.sum(axis=1) % 2 == 0).all()


@pytest.mark.parametrize("name", EIGHT)
def test_same_postures_as_the_closed_forms(name):
    plan, model = plan_of(name), rm.load(name)
    U = poses_of(model, plan, postures_at_random(plan, 2000, seed=5))
    mine = paul_postures(plan, U)
    loop = plan_loop(plan.chain)
    assert loop is not None
    q, valid, _ = closed_form_postures(loop, plan.chain, U)
    sure = ~mine.delicate
    assert sure.sum() > 1980
    assert (mine.valid.sum(axis=1) == valid.sum(axis=1))[sure].all()
    gap = np.abs(short(plan, mine.q[:, :, None] - q[:, None])).max(axis=3)
    gap = np.where(mine.valid[:, :, None] & valid[:, None], gap, np.inf)
    assert np.where(mine.valid, gap.min(axis=2), 0.0)[sure].max() < 1e-7
    assert np.where(valid, gap.min(axis=1), 0.0)[sure].max() < 1e-7


@pytest.mark.parametrize(("name", "file"), [("rx90", "igm_rx90"), ("ur5", "igm_ur5")])
def test_complete_sets_of_the_oracles(name, file):
    plan = plan_of(name)
    for case in json.loads((ORACLES / f"{file}.json").read_text())["cases"]:
        if case["n_solutions"] is None:
            continue
        expected = np.array(case["solutions"]).reshape(-1, 6)
        found = paul_postures(plan, [case["T"]])
        got = found.q[0][found.valid[0]]
        gap = np.abs(short(plan, got[:, None] - expected)).max(axis=2)
        assert gap.shape == (case["n_solutions"],) * 2
        assert gap.min(axis=0).max() < 1e-7
        assert gap.min(axis=1).max() < 1e-7


def arm_of(rows, rng, rotated):
    table = rm.DHTable.from_rows(rows)
    base = random_pose(rng) if rotated else None
    tool = random_pose(rng) if rotated else se3.translation(0.2, 0, 0.1)
    return rm.RobotModel.from_table(table, base=base, tool=tool)


def rows_of(kinds, twists, lengths, offsets):
    rows = []
    for kind, alpha, (d, r), theta in zip(kinds, twists, lengths, offsets, strict=True):
        rows.append({"sigma": int(kind == "P"), "alpha": alpha, "d": d, "r": r, "theta": theta})
    return rows


THREE = {
    "planar RRR": ("RRR", (0, 0, 0)),
    "planar RPR": ("RPR", (0, RIGHT, -RIGHT)),
    "planar PRR": ("PRR", (0, RIGHT, 0)),
    "planar RRP": ("RRP", (0, 0, RIGHT)),
    "PPP": ("PPP", (0, RIGHT, RIGHT)),
    "cylindrical": ("RPP", (0, 0, RIGHT)),
    "spherical": ("RRP", (0, RIGHT, RIGHT)),
    "anthropomorphic": ("RRR", (0, RIGHT, 0)),
    "all axes square": ("RRR", (0, RIGHT, -RIGHT)),
    "antiparallel": ("RRR", (0, pi, pi)),
    "oblique": ("RRR", (0.3, 1.1, -0.7)),
    "oblique with slides": ("PRP", (0.3, 1.1, -0.7)),
    "oblique PPP": ("PPP", (0.3, 1.1, -0.7)),
    "SCARA": ("RRPR", (0, 0, pi, 0)),
    "one joint": ("R", (0.4,)),
    "one slide": ("P", (0.4,)),
    "two slides": ("PP", (0, 1.0)),
    "five": ("RRRRR", (0, RIGHT, 0, 0, RIGHT)),
}


@pytest.mark.parametrize("name", THREE)
@pytest.mark.parametrize("rotated", [False, True])
def test_short_arms_of_every_kind(name, rotated):
    rng = np.random.default_rng(sum(map(ord, name)))
    kinds, twists = THREE[name]
    k = len(kinds)
    lengths = rng.uniform(0.1, 0.5, (k, 2)) * (rng.random((k, 2)) < (1.0 if rotated else 0.6))
    lengths[1:, 0] = np.where(lengths[1:, 0] == 0, 0.3, lengths[1:, 0])
    arm = arm_of(rows_of(kinds, twists, lengths, rng.uniform(-1, 1, k)), rng, rotated)
    plan = derive_plan(joint_chain(arm))
    assert plan.complete
    _, gap = checked(arm, plan, postures_at_random(plan, 60, seed=1))
    assert gap.max() < 1e-6


WRIST = ({"alpha": -RIGHT, "r": 0.4}, {"alpha": RIGHT}, {"alpha": -RIGHT})


@pytest.mark.parametrize("kinds", ["RRR", "RPR", "PRR", "RRP", "PPR", "RPP", "PPP"])
def test_six_joint_arms_with_a_wrist(kinds):
    rng = np.random.default_rng(len(kinds) + ord(kinds[0]) + 2 * ord(kinds[1]) + 3 * ord(kinds[2]))
    done = 0
    every = list(product((0.0, RIGHT, -RIGHT), repeat=2))
    for twists in (every[i] for i in rng.permutation(9)[:4]):
        lengths = rng.uniform(0.1, 0.5, (3, 2))
        rows = rows_of(kinds, (0.0, *twists), lengths, rng.uniform(-1, 1, 3))
        arm = arm_of([*rows, *WRIST], rng, rotated=True)
        q = np.random.default_rng(2).uniform(-2, 2, (40, 6))
        q[:, arm.table.sigma == 1] *= 0.3
        if np.median(np.linalg.svd(rm.jacobian(arm, q), compute_uv=False)[:, -1]) < 1e-6:
            continue  # two slides in line: redundant
        plan = derive_plan(joint_chain(arm))
        if not plan.complete:
            continue  # needs Pieper's quartic
        done += 1
        found, gap = checked(arm, plan, q)
        regular = ~found.delicate
        assert gap[regular].max() < 1e-7
    assert done > 0


def test_an_arm_turned_round_has_the_same_postures_backwards():
    """The RX-90 fixed by its flange: a spherical shoulder, solved on inverted equations."""
    plan, model = plan_of("rx90"), rm.load("rx90")
    rows = [{}, {"alpha": RIGHT}, {"alpha": -RIGHT, "r": -0.45}, {"alpha": RIGHT}, {"d": -0.45},
            {"alpha": -RIGHT}]  # fmt: skip
    arm = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
    U = poses_of(model, plan, postures_at_random(plan, 100))
    backwards = derive_plan(joint_chain(arm))
    assert backwards.complete
    ours, theirs = paul_postures(backwards, se3.inverse(U)), paul_postures(plan, U)
    assert (ours.valid.sum(axis=1) == theirs.valid.sum(axis=1)).all()
    gap = np.abs(short(plan, ours.q[:, :, None] + theirs.q[:, None, :, ::-1])).max(axis=3)
    assert np.nanmax(np.nanmin(gap, axis=2)) < 1e-9


def test_batch_is_single_and_chunks_do_not_show():
    plan, model = plan_of("puma560"), rm.load("puma560")
    U = poses_of(model, plan, postures_at_random(plan, 4117))
    batch = paul_postures(plan, U)
    for n in (0, 15, 16, 4095, 4096, 4116):
        single = paul_postures(plan, U[n : n + 1])
        assert np.nanmax(np.abs(single.q[0] - batch.q[n])) < 1e-12
        assert (single.path[0] == batch.path[n]).all()


def test_no_pose_and_poses_that_are_none():
    plan = plan_of("rx90")
    empty = paul_postures(plan, np.empty((0, 4, 4)))
    assert empty.q.shape == (0, 8, 6)
    U = np.stack([np.full((4, 4), np.nan), np.full((4, 4), np.inf), se3.translation(0.3, 0.2, 0.4)])
    assert paul_postures(plan, U).valid.sum(axis=1).tolist() == [0, 0, 8]
    far = paul_postures(plan, se3.translation(3.0, 0, 0)[None])
    assert far.valid.sum() == 0
    with pytest.raises(ShapeError, match=r"U: expected shape \(N, 4, 4\)"):
        paul_postures(plan, np.eye(4))
    with pytest.raises(ShapeError, match="references"):
        paul_postures(plan, np.eye(4)[None], [1.0, 2.0])


def test_results_are_read_only():
    found = paul_postures(plan_of("lab_rr"), np.eye(4)[None])
    with pytest.raises(ValueError, match="read-only"):
        found.q[:] = 0.0


# singular poses


def away_from_other_singularities(model, plan, count):
    """Postures whose first joints and elbow are well placed: what is left is the wrist."""
    q = postures_at_random(plan, 4 * count, seed=3)
    q[:, 4] = 1.0 - plan.form.rows[4].offset
    smallest = np.linalg.svd(rm.jacobian(model, q), compute_uv=False)[:, -1]
    return q[smallest > 0.05][:count]


@pytest.mark.parametrize("name", ["rx90", "tx40", "puma560", "kr6_r900", "irb6640", "stanford_arm"])
@pytest.mark.parametrize("wrist", [0.0, 1e-15, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3])
def test_aligned_wrists_lose_no_branch(name, wrist):
    plan, model = plan_of(name), rm.load(name)
    q = away_from_other_singularities(model, plan, 20)
    assert len(q) > 10
    regular = paul_postures(plan, poses_of(model, plan, q)).valid.sum(axis=1)
    q[:, 4] = wrist - plan.form.rows[4].offset
    found, gap = checked(model, plan, q, references=q)
    # joints 4 and 6 each are as good as the wrist angle is large; their sum is not concerned
    assert gap.max() < 1e-9 + (1e-13 / wrist if wrist > 1e-13 else 0.0)
    assert found.delicate.all() == (wrist < 1e-6)
    free = found.free[..., 3] & found.valid
    if wrist > 1e-13:
        assert not free.any()
        assert found.valid.sum(axis=1).tolist() == regular.tolist()
        return
    # aligned: the two solutions of the wrist are one family, which takes the reference
    assert (found.valid.sum(axis=1) + free.sum(axis=1) == regular).all()
    assert free.any(axis=1).all()
    other = paul_postures(plan, poses_of(model, plan, q), q + 0.5 * np.eye(6)[3])
    free = other.free[..., 3] & other.valid
    wanted = np.broadcast_to(q[:, None, 3] + 0.5, free.shape)[free]
    assert np.abs(np.sin(other.q[..., 3][free] - wanted)).max() < 1e-12


def test_wrist_centre_on_the_first_axis_takes_the_reference():
    plan, model = plan_of("rx90"), rm.load("rx90")
    # S23 RL4 = C2 D3 with equal lengths: theta3 = pi/2 - 2 theta2 puts O4 on z0
    q = np.array([[0.7, 0.4, pi / 2 - 0.8, 0.3, 0.9, -0.5]])
    U = poses_of(model, plan, q)
    assert np.abs(U[0, :2, 3]).max() < 1e-15
    found = paul_postures(plan, U, [0.7, 0, 0, 0, 0, 0])
    assert found.delicate[0]
    assert found.valid.sum() == 4
    assert found.free[found.valid][:, 0].all()
    assert np.abs(found.q[found.valid][:, 0] - 0.7).max() < 1e-12
    assert np.nanmax(found.residual) < 1e-12


def test_stretched_elbow_is_one_posture_and_is_reached():
    plan, model = plan_of("rx90"), rm.load("rx90")
    q = np.array([[0.7, 0.4, -pi / 2, 0.3, 0.9, -0.5], [0.2, -0.8, -pi / 2, 1.3, -0.9, 0.5]])
    found, gap = checked(model, plan, q)
    assert found.delicate.all()
    # a double root: known to half of the digits, and given once
    assert gap.max() < 1e-6
    assert found.valid.sum(axis=1).tolist() == [4, 4]


def test_folded_elbow_leaves_two_joints_to_the_reference():
    # arm and forearm of equal length: the wrist centre is where axes 1 and 2 meet
    plan, model = plan_of("rx90"), rm.load("rx90")
    q = np.array([[0.7, 0.4, pi / 2, 0.3, 0.9, -0.5]])
    found, gap = checked(model, plan, q, references=q)
    assert gap.max() < 1e-9
    assert found.free[0, 0].tolist() == [True, True, False, False, False, False]


# few digits, and tables that are nearly structured


def test_pose_a_and_b_of_the_exercise():
    plan = plan_of("lab_trr")
    A = [[0, 0, -1, 0.1414], [0, 1, 0, -0.3], [1, 0, 0, 0.8414], [0, 0, 0, 1]]
    B = [[-1, 0, 0, 0.4], [0, 1, 0, 0.2], [0, 0, -1, 0.5], [0, 0, 0, 1]]
    assert paul_postures(plan, [A]).valid.sum() == 0
    found = paul_postures(plan, [A], position_tolerance=1e-4, orientation_tolerance=1e-4)
    assert np.abs(found.q[0, 0] - [-0.3, -pi / 4, -pi / 4]).max() < 1e-4
    assert found.residual[0, 0] < 3e-5
    assert paul_postures(plan, [B], position_tolerance=1e-4).valid.sum() == 0


def test_structure_within_rounding_is_used_and_the_true_table_is_met():
    model = rm.load("puma560")
    rng = np.random.default_rng(4)
    table = model.table
    rough = table.replace(
        alpha=table.alpha + rng.uniform(-5e-10, 5e-10, 6), d=table.d + rng.uniform(-5e-10, 5e-10, 6)
    )
    arm = model.with_table(rough)
    plan = derive_plan(joint_chain(arm))
    assert [s.type for s in plan.steps] == [s.type for s in plan_of("puma560").steps]
    q = postures_at_random(plan, 40)
    found, gap = checked(arm, plan, q)
    assert found.valid.sum() == 40 * 8
    assert gap.max() < 1e-8


# the types, one by one


@compiled(nb.void(nb.Array(nb.uint32, 1, "C", readonly=True), VECTOR, VECTOR,
                  nb.Array(nb.float64, 2, "C"), nb.Array(nb.int64, 1, "C")))  # fmt: skip
def solve_alone(step, coefficients, references, found, result):
    from_registers = np.empty((coefficients.size, 1))
    wanted = np.empty((2, 1))
    from_registers[:, 0] = coefficients
    wanted[:, 0] = references
    result[0], result[1] = solve(step, 0, from_registers, 0, 1e-9, 1e-13, 1e-6, wanted, found, 0)


def solutions(code, coefficients, references=(0.4, -0.7)):
    step = np.zeros(24, np.uint32)
    step[0], step[8] = code, 1
    step[9 : 9 + len(coefficients)] = np.arange(len(coefficients))
    found, result = np.zeros((24, 1)), np.zeros(2, np.int64)
    solve_alone(step, np.array(coefficients, float), np.array(references, float), found, result)
    return found.reshape(4, 6)[: result[0]], int(result[1])


def among(rows, value, at=0, turning=True):
    way = rows[:, at] - value
    return np.abs((way + pi) % (2 * pi) - pi if turning else way).min() < 1e-7


def consistent(rows, at):
    assert np.abs(rows[:, at + 1] - np.cos(rows[:, at])).max() < 1e-14
    assert np.abs(rows[:, at + 2] - np.sin(rows[:, at])).max() < 1e-14


@pytest.fixture
def rng():
    return np.random.default_rng(8)


def test_type_1(rng):
    for X, r in rng.normal(size=(50, 2)):
        rows, flags = solutions(1, [X, X * r])
        assert rows.shape[0] == 1
        assert abs(rows[0, 0] - r) < 1e-12 * (1 + abs(r))
        assert flags == 0
    rows, flags = solutions(1, [0.0, 0.0])
    assert rows[0, 0] == 0.4
    assert flags == 2


def test_type_2(rng):
    for X, Y, t in rng.normal(size=(200, 3)) * (1, 1, 2):
        Z = X * sin(t) + Y * cos(t)
        rows, _ = solutions(2, [X, Y, Z])
        assert rows.shape[0] == 2
        assert among(rows, t)
        consistent(rows, 0)
        assert np.abs(X * rows[:, 2] + Y * rows[:, 1] - Z).max() < 1e-12
    for overshoot, count in ((0.0, 1), (1e-10, 1), (1e-3, 0)):
        rows, flags = solutions(2, [3.0, 4.0, 5.0 * (1 + overshoot)])
        assert rows.shape[0] == count
        if count:
            assert abs(rows[0, 0] - atan2(3, 4)) < 1e-7
            assert flags & 1
    rows, flags = solutions(2, [0.0, 0.0, 0.0])
    assert rows[0, 0] == 0.4
    assert flags & 2
    assert solutions(2, [0.0, 0.0, 0.5])[0].shape[0] == 0


def test_type_2_with_z_zero(rng):
    for X, Y in rng.normal(size=(100, 2)):
        rows, _ = solutions(9, [X, Y])
        assert rows.shape[0] == 2
        assert among(rows, atan2(-Y, X))
        assert among(rows, atan2(Y, -X))
        consistent(rows, 0)
    rows, flags = solutions(9, [0.0, 1e-15])
    assert rows[0, 0] == 0.4
    assert flags == 2
    assert solutions(9, [0.0, 1e-9])[1] == 8


def test_type_3(rng):
    for X1, Y1, X2, Y2, t in rng.normal(size=(200, 5)):
        C, S = cos(t), sin(t)
        rows, _ = solutions(3, [X1, Y1, X1 * S + Y1 * C, X2, Y2, X2 * S + Y2 * C])
        assert rows.shape[0] == 1
        assert among(rows, t)
        consistent(rows, 0)
        rows, _ = solutions(10, [abs(X1) * S, abs(X1) * C])
        assert abs(rows[0, 0] - atan2(S, C)) < 1e-14
    # the same equation twice: the joint is one of its solutions
    rows, flags = solutions(3, [1.0, 2.0, 1.5, 2.0, 4.0, 3.0])
    assert abs(rows[0, 2] + 2 * rows[0, 1] - 1.5) < 1e-12
    assert flags & 8
    assert solutions(3, [0.0] * 6)[1] == 2
    assert solutions(10, [0.0, 0.0])[1] == 2


def test_type_4(rng):
    for X1, X2, r, t in rng.normal(size=(200, 4)):
        rows, _ = solutions(4, [X1, X1 * r * sin(t), X2, X2 * r * cos(t)])
        assert rows.shape[0] == 2
        assert among(rows, r, turning=False)
        consistent(rows, 3)
        assert np.abs(X1 * rows[:, 0] * rows[:, 5] - X1 * r * sin(t)).max() < 1e-12
        assert np.abs(X2 * rows[:, 0] * rows[:, 4] - X2 * r * cos(t)).max() < 1e-12
    rows, flags = solutions(4, [1.0, 0.0, 1.0, 0.0])
    assert rows[0, 0] == 0.0
    assert rows[0, 3] == -0.7
    assert flags & 4


def test_type_5(rng):
    for X1, Z1, X2, Z2, r, t in rng.normal(size=(200, 6)):
        Y1, Y2 = X1 * sin(t) - Z1 * r, X2 * cos(t) - Z2 * r
        rows, _ = solutions(5, [X1, Y1, Z1, X2, Y2, Z2])
        assert rows.shape[0] == 2
        assert among(rows, r, turning=False)
        assert np.abs(X1 * np.sin(rows[:, 3]) - Y1 - Z1 * rows[:, 0]).max() < 1e-9
        assert np.abs(X2 * np.cos(rows[:, 3]) - Y2 - Z2 * rows[:, 0]).max() < 1e-9
    # a line that touches the circle, and one that misses it
    rows, flags = solutions(5, [1.0, 1.0, 0.0, 1.0, 0.0, 1.0])
    assert rows.shape[0] == 1
    assert flags & 1
    assert solutions(5, [1.0, 1.1, 0.0, 1.0, 0.0, 1.0])[0].shape[0] == 0


def test_types_6_and_7(rng):
    for W1, W2, X, Y, i, j in rng.normal(size=(200, 6)):
        for w1, sense in ((0.0, -1.0), (W1, 1.0), (W1, -1.0)):
            Z1 = w1 * cos(j) + W2 * sin(j) - X * cos(i) - Y * sin(i)
            Z2 = sense * (w1 * sin(j) - W2 * cos(j)) - X * sin(i) + Y * cos(i)
            rows, _ = solutions(6, [w1, W2, X, Y, Z1, Z2, sense])
            assert rows.shape[0] == 2
            assert among(rows, i)
            assert among(rows, j, at=3)
            consistent(rows, 0)
            consistent(rows, 3)
            a, b = rows[:, 0], rows[:, 3]
            one = w1 * np.cos(b) + W2 * np.sin(b) - X * np.cos(a) - Y * np.sin(a) - Z1
            two = sense * (w1 * np.sin(b) - W2 * np.cos(b)) - X * np.sin(a) + Y * np.cos(a) - Z2
            assert max(np.abs(one).max(), np.abs(two).max()) < 1e-10
    # stretched: a double root; farther: none; folded onto the first axis: free
    assert solutions(6, [0.0, 1.0, 0.0, 2.0, 1.0, 0.0, -1.0])[1] & 1
    assert solutions(6, [0.0, 1.0, 0.0, 3.5, 1.0, 0.0, -1.0])[0].shape[0] == 0
    rows, flags = solutions(6, [0.0, 1.0, 0.0, 0.0, 1.0, 0.0, -1.0])
    assert rows[0, 0] == 0.4
    assert flags & 2


def test_type_8(rng):
    for X, Y, i, j in rng.normal(size=(200, 4)):
        Z1, Z2 = X * cos(i) + Y * cos(i + j), X * sin(i) + Y * sin(i + j)
        rows, _ = solutions(8, [X, Y, Z1, Z2])
        assert rows.shape[0] == 2
        assert among(rows, i)
        assert among(rows, i + j, at=3)
        consistent(rows, 0)
        consistent(rows, 3)
        assert np.abs(X * rows[:, 1] + Y * rows[:, 4] - Z1).max() < 1e-11
        assert np.abs(X * rows[:, 2] + Y * rows[:, 5] - Z2).max() < 1e-11
    rows, flags = solutions(8, [0.4, 0.3, 0.7, 0.0])
    assert flags & 1
    assert np.abs(rows[:, [0, 3]]).max() < 1e-7
    assert solutions(8, [0.4, 0.3, 0.71, 0.0])[0].shape[0] == 0
    assert solutions(8, [0.4, 0.3, 0.09, 0.0])[0].shape[0] == 0
    rows, flags = solutions(8, [0.4, 0.4, 0.0, 0.0])
    assert rows[0, 0] == 0.4
    assert flags & 2
    assert abs(abs(rows[0, 3] - rows[0, 0]) - pi) < 1e-12


def test_quartic_in_an_angle(rng):
    grid = np.linspace(-pi, pi, 4001)
    for t, *g in rng.normal(size=(60, 5)):
        a0 = -(g[0] * cos(t) + g[1] * sin(t) + g[2] * cos(2 * t) + g[3] * sin(2 * t))

        def value(x, a0=a0, g=g):
            return (a0 + g[0] * np.cos(x) + g[1] * np.sin(x) + g[2] * np.cos(2 * x)
                    + g[3] * np.sin(2 * x))  # fmt: skip

        rows, flags = solutions(11, [a0, *g])
        assert among(rows, t)
        assert np.abs(value(rows[:, 0])).max() < 1e-8
        changes = int((np.diff(np.sign(value(grid))) != 0).sum())
        if not flags & 1:
            assert rows.shape[0] == changes
    assert solutions(11, [0.0] * 5)[1] == 2
    # (1 - cos)^2: a double root at 0
    rows, flags = solutions(11, [1.5, -2.0, 0.0, 0.5, 0.0])
    assert np.abs(rows[:, 0]).max() < 1e-3
    assert flags & 1


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_polynomial_in_a_length(rng, degree):
    for _ in range(50):
        roots = rng.uniform(-2, 2, degree)
        if degree > 1 and np.diff(np.sort(roots)).min() < 0.05:
            continue
        g = np.zeros(5)
        g[: degree + 1] = rng.uniform(0.5, 2) * np.poly(roots)[::-1]
        rows, _ = solutions(12, g)
        assert np.allclose(np.sort(rows[:, 0]), np.sort(roots), atol=1e-7)
    assert solutions(12, [0.0] * 5)[1] == 2
    assert solutions(12, [1.0, 0.0, 1.0, 0.0, 0.0])[0].shape[0] == 0
    rows, flags = solutions(12, [1.0, -2.0, 1.0, 0.0, 0.0])
    assert rows.shape[0] == 1
    assert flags & 1


# the explanation

SYMBOLS = {"sqrt": sqrt, "atan2": atan2, "cos": cos, "sin": sin, "π": pi}


class Numbers(dict):
    """Values of the symbols of an explanation at a posture and its pose."""

    def __init__(self, name, q):
        model, plan = rm.load(name), plan_of(name)
        U = plan.form.before @ poses_of(model, plan, q[None])[0] @ plan.form.after
        super().__init__(SYMBOLS)
        self |= {c + a: U[i, j] for j, c in enumerate("snaP") for i, a in enumerate("xyz")}
        self |= {name: value for name, _, value, _ in plan.arm.constants}
        for row, value in zip(plan.form.rows, q, strict=True):
            self[f"{'r' if row.sigma else 'θ'}{row.frame}"] = value + row.offset

    def __missing__(self, name):
        # C2m3 is the cosine of theta2 - theta3
        if not re.fullmatch(r"[CS](m?\d)+", name):
            raise KeyError(name)
        total = sum((-1 if m else 1) * self[f"θ{j}"] for m, j in re.findall(r"(m?)(\d)", name))
        return (cos if name[0] == "C" else sin)(total)


def value_of(formula, known):
    return eval(formula, {"__builtins__": {}}, known)


def angle_gap(a, b):
    return abs((a - b + pi) % (2 * pi) - pi)


@pytest.mark.parametrize("name", COMPLETE)
def test_printed_equations_and_formulas_hold(name):
    """Every equation printed is true of the arm, and every formula gives the joint it names."""
    told = told_of(name)
    rng = np.random.default_rng(6)
    for _ in range(5):
        q = rng.uniform(-1.5, 1.5, plan_of(name).form.k)
        for step in told.steps:
            for e in (1, -1):
                local, gaps = Numbers(name, q), [0.0]
                local["e"] = e
                for formula in step.formulas:
                    left, right = formula.split(", e = ")[0].split(" = ", 1)
                    if "squared and added" in left or "'" in left:
                        continue
                    value = value_of(right, local)
                    if re.fullmatch(r"(B|k|R|X|Y|Z|D|a)\d?", left):
                        local[left] = value
                    elif "θ" in left:
                        gap = angle_gap(value, value_of(left, local))
                        both = any(
                            f.startswith((f"{left}' =", f"({left})' =")) for f in step.formulas
                        )
                        gaps.append(min(gap, pi - gap) if both else gap)
                    else:
                        gaps.append(abs(value - value_of(left, local)))
                if max(gaps) < 1e-9:
                    break
            else:
                raise AssertionError(f"{name}: {step.formulas}")
            for equation in step.equations:
                left, right = (value_of(side, local) for side in equation.split(" = "))
                assert abs(left - right) < 1e-12, equation


def test_rx90_is_the_example_of_the_book():
    steps = told_of("rx90").steps
    assert steps[0].matrix_equation == "1T0 U0 = 1T6"
    assert steps[0].formulas == ("θ1 = atan2(Py, Px)", "θ1' = θ1 + π")
    assert "O4 is on the axis of joint 1" in steps[0].undetermined
    assert steps[1].matrix_equation == "2T0 U0 = 2T6"
    assert steps[1].formulas == (
        "B1 = C1*Px + S1*Py",
        "squared and added: X*S2 + Y*C2 = Z",
        "X = -2*Pz*D3",
        "Y = -2*B1*D3",
        "Z = RL4**2 - B1**2 - Pz**2 - D3**2",
        "S2 = (X*Z + e*Y*sqrt(X**2 + Y**2 - Z**2))/(X**2 + Y**2)",
        "C2 = (Y*Z - e*X*sqrt(X**2 + Y**2 - Z**2))/(X**2 + Y**2), e = +1 or -1",
        "θ2 = atan2(S2, C2)",
        "θ3 = atan2((-B1*C2 - Pz*S2 + D3)/RL4, (-B1*S2 + Pz*C2)/RL4)",
    )
    assert steps[2].formulas == (
        "θ4 = atan2(S1*ax - C1*ay, -C23*(C1*ax + S1*ay) - S23*az)", "θ4' = θ4 + π",
    )  # fmt: skip
    assert "axes 4 and 6 are aligned" in steps[2].undetermined
    assert steps[3].equations == (
        "S5 = -C4*(C23*(C1*ax + S1*ay) + S23*az) + S4*(S1*ax - C1*ay)",
        "C5 = -S23*(C1*ax + S1*ay) + C23*az",
    )
    assert steps[4].equations == (
        "S6 = -S4*(C23*(C1*sx + S1*sy) + S23*sz) - C4*(S1*sx - C1*sy)",
        "C6 = -S4*(C23*(C1*nx + S1*ny) + S23*nz) - C4*(S1*nx - C1*ny)",
    )


def test_rx90_formulas_equal_the_book_term_by_term():
    """The seed's formulas, written here by hand, against the printed ones on random numbers."""
    steps = told_of("rx90").steps
    rng = np.random.default_rng(9)
    names = "sx sy sz nx ny nz ax ay az Px Py Pz D3 RL4 C1 S1 C2 S2 C23 S23 C4 S4"
    book = {
        "X": "-2*Pz*D3",
        "Y": "-2*B1*D3",
        "Z": "RL4**2 - D3**2 - Pz**2 - B1**2",
        "B1": "Px*C1 + Py*S1",
        "S5": "-C4*(C23*(C1*ax + S1*ay) + S23*az) + S4*(S1*ax - C1*ay)",
        "C5": "-S23*(C1*ax + S1*ay) + C23*az",
        "S6": "-C4*(S1*sx - C1*sy) - S4*(C23*(C1*sx + S1*sy) + S23*sz)",
        "C6": "-C4*(S1*nx - C1*ny) - S4*(C23*(C1*nx + S1*ny) + S23*nz)",
        "θ1": "atan2(Py, Px)",
        "θ3": "atan2((-Pz*S2 - B1*C2 + D3)/RL4, (-B1*S2 + Pz*C2)/RL4)",
        "θ4": "atan2(S1*ax - C1*ay, -C23*(C1*ax + S1*ay) - S23*az)",
    }
    printed = dict(
        line.split(" = ", 1) for step in steps for line in (*step.equations, *step.formulas)
        if " = " in line
    )  # fmt: skip
    for _ in range(20):
        known = SYMBOLS | dict(zip(names.split(), rng.normal(size=22), strict=True))
        known["B1"] = known["Px"] * known["C1"] + known["Py"] * known["S1"]
        for left, right in book.items():
            ours, theirs = (value_of(x, known) for x in (printed[left], right))
            assert abs(ours - theirs) < 1e-12, left


def test_exercise_rr():
    told = told_of("lab_rr")
    assert told.steps[0].formulas == ("θ1 = atan2(Py, Px)", "θ1' = θ1 + π")  # (4.9)
    assert told.steps[1].formulas == ("θ2 = atan2(RL1 - Pz, C1*Px + S1*Py)",)  # (4.13)
    assert "loses" in told.text
    both = paul_postures(plan_of("lab_rr"), [rm.dgm(rm.load("lab_rr"), [2.5, 0.4])])
    assert both.q[0, both.valid[0]].round(9).tolist() == [[2.5, 0.4]]


def test_exercise_rrt_and_trr():
    rrt = told_of("lab_rrt")
    assert [s.joints for s in rrt.steps] == [("θ1",), ("θ2",), ("r3",)]
    assert rrt.steps[2].formulas == ("r3 = S2*(C1*Px + S1*Py) - C2*(RL1 - Pz)",)
    trr = told_of("lab_trr")
    assert trr.steps[0].formulas == ("r1 = Py",)
    assert [s.joints for s in trr.steps] == [("r1",), ("θ2",), ("θ3",)]


def test_ur5_sums_of_angles():
    told = told_of("ur5")
    assert told.steps[3].joints == ("θ2 + θ3 + θ4",)
    assert told.steps[4].joints == ("θ2", "θ2 + θ3")
    assert told.steps[4].formulas[-1] == "θ4 = (θ2 + θ3 + θ4) - (θ2 + θ3)"


WORDS_NOT_TYPESET = re.compile("sqrt|alpha|theta")
ENVIRONMENT = re.compile(r"\\begin\{(align\*|equation\*)\}\n(.*?)\n\\end\{\1\}", re.DOTALL)


def assert_sound_latex(latex):
    """Balanced, every row aligned once, nothing outside mathematics that belongs inside."""
    nested = []
    for what, name in re.findall(r"\\(begin|end)\{([^}]*)\}", latex):
        if what == "begin":
            nested.append(name)
        else:
            assert nested.pop() == name
    assert not nested
    depth = 0
    for brace in re.findall(r"(?<!\\)[{}]", latex):
        depth += 1 if brace == "{" else -1
        assert depth >= 0
    assert depth == 0
    for name, body in ENVIRONMENT.findall(latex):
        assert body.count(r"\left") == body.count(r"\right")
        assert "\n\n" not in body
        if name == "align*":
            assert all(row.count("&") == 1 for row in body.split("\\\\\n")), body
        else:
            head, *rows = [row for row in body.splitlines() if "&" in row]
            assert all(row.count("&") == head.count("&") for row in rows)
    words = re.sub(r"(?<!\\)\$[^$]*\$", "", ENVIRONMENT.sub("", latex))
    assert words.isascii()
    assert not re.search(r"(?<!\\)[_^&#%$]", words), words
    assert set(re.findall(r"\\([a-z]+)", words)) <= {
        "textbf", "texttt", "textasciicircum", "textasciitilde",
    }  # fmt: skip


@pytest.mark.parametrize("name", ["lab_rrt", "cobra_s600", "ur5", "erd:kinova", "erd:borinot_arm"])
def test_latex_is_read_by_a_parser_of_it(name):
    from matplotlib.mathtext import MathTextParser

    parser, latex = MathTextParser("path"), told_of(name).latex
    rows = [row for kind, body in ENVIRONMENT.findall(latex) if kind == "align*"
            for row in body.split(" \\\\\n")]  # fmt: skip
    inline = re.findall(r"\$([^$]+)\$", ENVIRONMENT.sub("", latex))
    assert len(rows) > 3
    for formula in {*rows, *inline}:
        parser.parse(f"${formula.replace('&', '')}$")


@pytest.mark.parametrize("type_", list(EquationType))
def test_formulas_of_the_types_are_typeset(type_):
    from matplotlib.mathtext import MathTextParser

    formula = type_formula(type_.formula)
    MathTextParser("path").parse(f"${formula.latex}$")
    assert formula.text == type_.formula
    assert not re.search(r"[A-Za-z]\d|theta(?<!\\theta)|\+-", formula.latex)
    if type_ is EquationType.TYPE_7:
        assert r"\pm (W_{1} \, S_{j} - W_{2} \, C_{j}) = X \, S_{i}" in formula.latex


def test_latex_says_what_the_text_says():
    latex = told_of("lab_rrt").latex
    assert r"2 & 0 & -\pi/2 & 0 & \theta_{2} + \pi/2 & 0" in latex
    assert r"$\mathbf{U}_0 = \mathbf{T}$: the desired pose" in latex
    assert r"$\mathbf{E}$ the tool" in latex
    assert r"RL_{1} &= 0.5 \quad (r_{1})" in latex
    assert r"$q_{2} = \theta_{2} - \frac{\pi}{2}$" in latex
    assert r"$\theta_{1}$ is free where $P_{x} = 0$ and $P_{y} = 0$ ($O_{3}$ is on" in latex
    assert latex.count(r"r_{3} &=") == 1
    latex = told_of("rx90").latex
    assert r"$\theta_{4}$ has $S_{5} > 0$ and $\theta_{4}'$ has $S_{5} < 0$." in latex
    assert "fall together where $X^2 + Y^2 = Z^2$ (stretched or folded)" in latex
    assert r"D_{3} &= 0.45 \quad (d_{3})" in latex
    assert r"with $X_{1} = Y_{2}, \; Y_{1} = X_{2} = 0$: $X_{1} \, S = Z_{1}" in latex
    assert r"\text{(squared and added)}" in latex
    ur5, cobra = told_of("ur5").latex, told_of("cobra_s600").latex
    assert r"\mathbf{U}_0 = \mathbf{Z}^{-1} \, \mathbf{T} \, \mathbf{E}^{-1}" in ur5
    assert r"\theta_{3} &= (\theta_{2} + \theta_{3}) - \theta_{2}" in ur5
    assert cobra.count("r_{3} &=") == 1
    assert "S_{1+2-4}" in cobra
    assert "12-4" not in cobra
    assert r"$S_{1+2-4}$ of $\theta_{1} + \theta_{2} - \theta_{4}$" in cobra


@pytest.mark.parametrize("name", ["lab_rrt", "ur5", "panda", "gantry", "crx10ia"])
def test_a_notebook_shows_markdown(name):
    """Notebooks typeset Markdown and the mathematics in it, no other LaTeX."""
    told = told_of(name)
    shown = told._repr_markdown_()
    title, _, rest = shown.partition("\n\n")
    escaped_name = name.replace("_", r"\_")
    assert title == f"**Inverse geometric model of {escaped_name} by Paul's method**"
    assert rest.startswith("$$\n\\begin{array}{c|")
    blocks = re.findall(r"^\$\$\n(.*?)\n\$\$$", shown, re.MULTILINE | re.DOTALL)
    assert len(blocks) == len(ENVIRONMENT.findall(told.latex))
    words = re.sub(r"\$\$.*?\$\$", "", shown, flags=re.DOTALL)
    assert words.count("**Step") == len(told.steps)
    words = re.sub(r"\$[^$]+\$", "", words)
    assert set(re.findall(r"\\.", words)) <= {r"\_"}
    assert "*}" not in shown
    if not told.complete:
        assert "`igm`" in shown or "elimination" in shown


def test_offsets_are_multiples_of_pi_where_they_are():
    assert "offset: q2 = θ2 - π/2." in told_of("lab_rrt").text
    assert "offset: q2 = θ2 + π/2, q3 = θ3 - π/2, q6 = θ6 - π." in told_of("tx40").text
    assert "q2 = θ2 + 1.38491787287, q3" in told_of("xarm5").text
    assert "offset" not in told_of("erd:ur5").text  # 5e-12 rad: the table prints none either
    for name in COMPLETE:
        assert "1.5707963" not in told_of(name).text + told_of(name).latex


def test_an_offset_is_of_the_joint_that_the_model_counts():
    """Frame 2 is fixed and joint 1 of the model is a side branch: numbers of q, frames of θ."""
    table = rm.DHTable(
        antecedent=[0, 0, 2, 3], sigma=[0, 0, 0, 2], d=[0, 0.1, 0.3, 0.2],
        alpha=[0, 0, RIGHT, 0], theta=[0, 0, RIGHT / 2, 0], mu=[1, 1, 1, 0],
    )  # fmt: skip
    told = explain_igm(rm.RobotModel.from_table(table))
    assert [step.joints for step in told.steps] == [("θ2",), ("θ3",)]
    assert "offset: q3 = θ3 - π/4." in told.text


def test_names_of_any_letters_are_typeset():
    table = rm.DHTable(antecedent=[0], sigma=[0], d=[0.0])
    model = rm.RobotModel.from_table(table, name="a_b & 50% {c} #1 $x^2~")
    told = explain_igm(model)
    assert_sound_latex(told.latex)
    assert r"a\_b \& 50\% \{c\} \#1 \$x\textasciicircum{}2\textasciitilde{}" in told.latex


@pytest.mark.parametrize("name", [n for n in rm.robots() if not n.startswith("erd:")])
def test_every_robot_of_the_catalogue_is_explained(name):
    told = told_of(name)
    assert str(told) == told.text
    assert told._repr_latex_() == told.latex
    assert_sound_latex(told.latex)
    assert all(step.latex in told.latex for step in told.steps)
    for word in re.findall("[A-Za-z]{4,}", WORDS_NOT_TYPESET.sub("", told.text)):
        assert word in told.latex, word
    assert name in repr(told)
    if told.complete:
        assert "At most" in told.text
        assert not told.takes_over
    else:
        assert "stops here" in told.text
        assert told.takes_over in told.text


@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("crx10ia", "Raghavan"),
        ("xarm6", "Raghavan"),
        ("panda", "a locked joint (`lock` of `igm`), as the arm has no arm angle"),
        ("erd:baxter_left_arm", "a locked joint"),
        ("iiwa14", "the arm angle (`arm_angle` of `igm`), as shoulder and wrist are spherical"),
    ],
)
def test_what_takes_over(name, method):
    assert method in told_of(name).takes_over


@pytest.mark.parametrize(
    ("name", "step", "words"),
    [
        ("ur5", 1, "axes 2 and 6 are parallel"),
        ("ur3e", 1, "axes 2 and 6 are parallel"),
        ("rx90", 2, "axes 4 and 6 are aligned"),
        ("irb140", 2, "axes 4 and 6 are aligned"),
        ("gantry", 3, "axes 4 and 6 are aligned"),
    ],
)
def test_axes_that_cannot_meet_are_parallel_not_aligned(name, step, words):
    assert words in told_of(name).steps[step].undetermined


@pytest.mark.parametrize("model", ["rx90", None, rm.load("rx90").table])
def test_only_a_model_is_explained(model):
    with pytest.raises(InvalidValueError, match="model: expected a RobotModel, got "):
        explain_igm(model)


def test_pieper_takes_over_where_a_wrist_needs_a_quartic():
    rows = [{}, {"alpha": 1.0, "d": 0.3, "r": 0.1}, {"alpha": 0.7, "d": 0.4, "r": 0.2}, *WRIST]
    told = explain_igm(rm.RobotModel.from_table(rm.DHTable.from_rows(rows)))
    assert not told.complete
    assert "Pieper" in told.takes_over
