"""Redundant arms: joints at the reference or the nearest value, relations, long slides, search."""

from functools import cache
from itertools import combinations

import numpy as np
import pytest

import robotmodels as rm

ARMS = (
    "panda", "erd:xarm7", "erd:talos_left_arm", "erd:z1", "erd:tiago_no_hand", "erd:baxter",
)  # fmt: skip


def turns(model):
    return model.table.sigma[model.table.joint_rows] == 0


def drawn(model, N, seed=1):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (N, model.n))
    return np.where(turns(model), q, 0.1 * q)


def delta(model, a, b):
    d = a - b
    return np.where(turns(model), (d + np.pi) % (2 * np.pi) - np.pi, d)


def nearest(model, found, q):
    """Distance of each configuration from the closest solution, (N,)."""
    d = np.abs(delta(model, found.q, q[:, None])).max(axis=-1)
    return np.where(found.valid, d, np.inf).min(axis=1, initial=np.inf)


def met(model, found, T, accuracy=1e-11):
    n, s = np.nonzero(found.valid)
    assert np.abs(rm.dgm(model, found.q[n, s]) - T[n]).max(initial=0.0) <= accuracy
    return found


@pytest.mark.parametrize("name", ARMS)
def test_the_first_joints_that_move_the_tool_take_the_reference(name):
    model = rm.load(name)
    q = drawn(model, 30)
    T = rm.dgm(model, q)
    found = met(model, rm.igm(model, T, q), T)
    assert nearest(model, found, q).max() < 1e-6
    free = found.free_joints[found.valid]
    assert np.all(free == free[0])
    first = np.flatnonzero(free[0])
    moving = np.flatnonzero(free[0] | found.family_joints[found.valid].any(axis=0))
    assert first.tolist() == moving[: len(first)].tolist()
    d = delta(model, found.q, q[:, None])[..., first]
    assert np.abs(d[found.valid]).max() < 1e-12
    assert np.all(found.status == rm.IGMStatus.REACHED_FAMILY)
    locked = rm.igm(model, T[0], q[0], lock={int(j): q[0, j] for j in first})
    assert locked.count == found.count[0]
    assert nearest(model, rm.igm(model, T[:1], q[:1]), locked.q[0][None]).max() < 1e-8


def test_a_planar_arm_of_four_joints():
    """Joint 1 takes its reference, or the nearest value at which joints 2 and 3 reach the wrist."""
    l1, l2, l3, l4 = 1.0, 0.4, 0.3, 0.2
    rows = [{"d": length} for length in (0.0, l1, l2, l3)]
    model = rm.RobotModel.from_table(rm.DHTable.from_rows(rows), tool=rm.se3.translation(l4, 0, 0))
    q = drawn(model, 6, seed=3)
    T = rm.dgm(model, q)
    found = met(model, rm.igm(model, T, q), T)
    assert nearest(model, found, q).max() < 1e-6
    assert np.all(found.status == rm.IGMStatus.REACHED_FAMILY)
    assert np.all(found.free_joints[found.valid] == [True, False, False, False])
    values, turned = np.linspace(-np.pi, np.pi, 200001), 0
    for reference in (0.0, 2.0):
        found = met(model, rm.igm(model, T, [reference, 0, 0, 0]), T)
        for n in range(len(T)):
            wrist = T[n, :2, 3] - l4 * T[n, :2, 0]
            reach = np.hypot(*(wrist - l1 * np.stack([np.cos(values), np.sin(values)], -1)).T)
            there = values[(abs(l2 - l3) <= reach) & (reach <= l2 + l3)]
            away = np.abs((there - reference + np.pi) % (2 * np.pi) - np.pi).min()
            first = found.q[n, found.valid[n], 0]
            assert first.size
            d = np.abs((first - reference + np.pi) % (2 * np.pi) - np.pi)
            assert np.abs(d - (away if away > 1e-4 else 0.0)).max() < 1e-4
            assert (found.status[n] == rm.IGMStatus.INCOMPLETE) == (away > 1e-4)
            turned += away > 1e-4
    assert turned >= 6


# --- relations ------------------------------------------------------------------------------------

RELATIONS = [
    ("iiwa14", [1, 0, 1, 0, 0, 0, 0]),
    ("iiwa14", [0, 0, 1, 0, 1, 0, 0]),
    ("panda", [0.5, 0, 0, -0.3, 0, 0, 1.2]),
    ("erd:talos_left_arm", [0, 2, 0, 1, 0, 0, 0]),
]


def relation_errors(A, b, q):
    off = q @ A.T - b
    if np.array_equal(A, np.round(A)):
        off = (off + np.pi) % (2 * np.pi) - np.pi
    return np.abs(off).max(initial=0.0)


@pytest.mark.parametrize(("name", "row"), RELATIONS)
def test_solutions_that_obey_a_relation(name, row):
    model, A = rm.load(name), np.array([row], float)
    q = drawn(model, 3, seed=9)
    T = rm.dgm(model, q)
    for n in range(3):
        found = met(model, rm.igm(model, T[n : n + 1], relations=(A, A @ q[n])), T[n : n + 1])
        assert relation_errors(A, A @ q[n], found.q[found.valid]) < 1e-9
        assert nearest(model, found, q[n : n + 1]).max() < 1e-6
        assert found.status == rm.IGMStatus.INCOMPLETE
        if np.array_equal(A, np.round(A)):
            # angles count modulo a turn
            again = rm.igm(model, T[n], relations=(A, A @ q[n] + 2 * np.pi))
            assert again.count == found.count[0]


@pytest.mark.parametrize(("name", "joint"), [("iiwa14", 2), ("panda", 4)])
def test_a_relation_of_one_joint_is_a_lock(name, joint):
    model = rm.load(name)
    q = drawn(model, 6, seed=10)
    q[:, joint] = 0.3
    T = rm.dgm(model, q)
    row = 2.0 * np.eye(7)[[joint]]
    found, locked = (
        rm.igm(model, T, q, relations=(row, [0.6])),
        rm.igm(model, T, q, lock={joint: 0.3}),
    )
    np.testing.assert_array_equal(found.count, locked.count)
    np.testing.assert_allclose(found.q, locked.q, atol=1e-8)
    assert np.all(found.status == rm.IGMStatus.REACHED)


# --- slides ---------------------------------------------------------------------------------------


@cache
def sliding_arm(slides, seed):
    rng = np.random.default_rng(seed)
    rows = [
        {"sigma": int(i in slides), "alpha": a, "d": d, "theta": t, "r": r}
        for i, (a, d, t, r) in enumerate(rng.uniform(-1, 1, (6, 4)) * [1.5, 0.4, 3.0, 0.4])
    ]
    return rm.RobotModel.from_table(
        rm.DHTable.from_rows(rows), tool=rm.se3.translation(0.1, 0, 0.2)
    )


@pytest.mark.parametrize(
    "slides", [*combinations(range(6), 2)][::2] + [*combinations(range(6), 3)][::3]
)
@pytest.mark.nightly
def test_two_and_three_prismatic_joints(slides):
    model = sliding_arm(slides, 21 + sum(slides))
    q = drawn(model, 20)
    T = rm.dgm(model, q)
    found = met(model, rm.igm(model, T), T)
    assert nearest(model, found, q).max() < 1e-6
    if len(slides) == 3:
        # a wrist reaches an orientation in two ways, and each leaves one set of lengths
        assert np.sum(found.count == 2) >= (19 if "may be missing" in found.method else 20)
    elif "may be missing" not in found.method:
        assert np.all((found.count + found.double.sum(axis=1)) % 2 == 0)


RAIL = (
    {"sigma": 1, "d": 0.2}, {"alpha": np.pi / 2, "d": 0.2}, {"alpha": -np.pi / 2},
    {"alpha": np.pi / 2, "theta": np.pi / 2, "r": 0.25}, {"d": 0.2}, {"d": 0.2, "alpha": 0.7},
)  # fmt: skip


@pytest.mark.parametrize("far", [30.0, 1e3, -1e4])
def test_how_far_a_rail_is_run_out_changes_nothing_else(far):
    model = rm.RobotModel.from_table(rm.DHTable.from_rows(RAIL))
    q = drawn(model, 12)
    out = far * (~turns(model))
    near, away = rm.igm(model, rm.dgm(model, q)), rm.igm(model, rm.dgm(model, q + out))
    np.testing.assert_array_equal(near.count, away.count)
    assert nearest(model, away, q + out).max() < 1e-7
    n, s = np.nonzero(away.valid)
    assert np.abs(rm.dgm(model, away.q[n, s]) - rm.dgm(model, q + out)[n]).max() < 1e-10
    assert away.residual[n, s].max() < 1e-10
    T = rm.dgm(model, q[0] + out)
    pointed = rm.igm(model, T, q[0] + out + 0.01, mask=[1, 1, 1, 0, 1, 1], mask_axes="tool")
    np.testing.assert_allclose(pointed.q[:, 0], (q[0] + out)[0] + 0.01, rtol=0, atol=1e-11)


def test_a_rail_out_of_reach_of_its_reference_is_brought_as_near_as_it_gets():
    """The rail slides across three parallel axes: 0 is too far, the nearest value is taken."""
    rows = (
        {"sigma": 1}, {"alpha": np.pi / 2, "d": 0.2}, {"d": 0.4}, {"alpha": np.pi / 2, "r": 0.3},
        {"alpha": -np.pi / 2}, {"alpha": np.pi / 2},
    )  # fmt: skip
    model = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
    T = rm.dgm(model, [100.5, -0.9, -1.8, -1.9, 1.25, 1.65])
    found = rm.igm(model, T)
    assert found.count == 2  # stretched out, the wrist either way
    assert np.all(found.free_joints == [True, False, False, False, False, False])
    assert np.all(found.family_joints == [False, True, True, True, True, True])
    rail = found.q[0, 0]
    assert rm.igm(model, T, lock={0: rail - 1e-3}).count == 0
    assert rm.igm(model, T, lock={0: rail + 1e-3}).count > 0


def test_arms_without_a_moving_joint():
    model, values = rm.load("iiwa14"), np.full(7, 0.4)
    T = rm.dgm(model, values)
    found = rm.igm(model, T, lock=dict.fromkeys(range(7), 0.4))
    assert found.count == 1
    assert found.status == rm.IGMStatus.REACHED
    assert rm.igm(model, T, lock=dict.fromkeys(range(7), 0.5)).count == 0
    still = rm.RobotModel.from_table(rm.DHTable.from_rows([{"sigma": 2, "d": 0.3}]))
    assert rm.igm(still, rm.se3.translation(0.3, 0, 0)).count == 1
    assert rm.igm(still, rm.se3.translation(5, 0, 0)).status == rm.IGMStatus.TOO_FAR


def test_solutions_by_search_are_incomplete_behind_a_mask():
    rows = [
        {"sigma": 1},
        {"alpha": 0.5, "d": 0.3, "r": 0.1},
        {"sigma": 1, "alpha": 1.1, "d": 0.2, "theta": 0.3},
        {"alpha": 0.9, "d": 0.25, "r": 0.2},
    ]
    model = rm.RobotModel.from_table(
        rm.DHTable.from_rows(rows), tool=rm.se3.translation(0.1, 0, 0.2)
    )
    found = rm.igm(model, rm.dgm(model, [0.2, 0.5, 0.3, 0.7]), mask=[1, 0, 1, 1, 1, 1])
    assert "Newton" in found.method
    assert found.status == rm.IGMStatus.INCOMPLETE
