"""The tip of a robot: which link it is without ``tip_link``, and joints that do not move it."""

from itertools import pairwise

import numpy as np
import pytest
from identities.random_robots import random_table

import robotmodels as rm
from robotmodels.kinematics.lengths import characteristic_length
from robotmodels.trajectories import joint_path

LIMIT = '<limit lower="-2" upper="2" velocity="3" effort="4"/>'
NAMES = ("tool0", "tcp", "tool", "ee_link", "flange", "hand")
# robots with joints that do not move the tip: their tips now
TREES = {
    "erd:panda": "panda_hand_tcp",
    "erd:bravo7_gripper": "bravo_finger_jaws_base_link",
    "erd:allegro_right_hand": "link_15.0_tip",
    "erd:baxter": "left_gripper_base_link",
    "erd:alex_sake_hands": "RightSakePalmLink",
    "erd:tiago": "hand_palm_link",
    "erd:tiago_pro": "gripper_right_base_link",
}


# --- the tip of a URDF --------------------------------------------------------------------------


def urdf(*joints):
    """A URDF from (parent, child) for a joint that moves and (parent, child, "fixed")."""
    links = dict.fromkeys(name for parent, child, *_ in joints for name in (parent, child))
    text = "".join(f'<link name="{name}"/>' for name in links)
    for k, (parent, child, *kind) in enumerate(joints):
        text += (
            f'<joint name="to_{child}" type="{kind[0] if kind else "revolute"}">'
            f'<parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="0.1 {0.01 * k} 0.2" rpy="0.{k % 7} 0.4 -0.3"/><axis xyz="0 0 1"/>'
            f"{LIMIT}</joint>"
        )
    return f'<robot name="r">{text}</robot>'


def arm(length, end="hand_base"):
    """Joints of an arm from base to the link ``wrist``, and ``end`` fixed to it."""
    names = ["base", *(f"l{k}" for k in range(1, length)), "wrist"]
    return [*pairwise(names), ("wrist", end, "fixed")]


def fingers(*lengths, on="hand_base"):
    """Fingers of some joints each."""
    out = []
    for i, length in enumerate(lengths):
        names = [on, *(f"finger{i}_{k}" for k in range(length))]
        out += pairwise(names)
    return out


def tip_of(text):
    """Name of the link whose frame is the tool, the only one there."""
    model = rm.RobotModel.from_urdf(text)
    return [f.name for f in model.frames if f.parent == model.tip
            and np.array_equal(f.pose, model.tool)]  # fmt: skip


@pytest.mark.parametrize(
    ("length", "lengths"),
    [(3, (1, 1)), (4, (1, 1, 1)), (7, (2, 2, 1, 2)), (6, (1, 2)), (8, (4, 3, 3))],
)
def test_the_arm_ends_before_its_fingers(length, lengths):
    text = urdf(*arm(length), *fingers(*lengths))
    assert tip_of(text) == ["hand_base"]
    model = rm.RobotModel.from_urdf(text)
    assert model.n == length + sum(lengths), "the fingers stay joints"
    assert model.tip == length
    assert any(f"before {sum(lengths)} moving joints" in note for note in model.notes)


@pytest.mark.parametrize("first", range(len(NAMES)))
def test_links_named_as_tools_come_first_in_their_order(first):
    """Anywhere on the body that carries the fingers, in any order of the file."""
    named = [("wrist" if i % 2 else "hand_base", NAMES[i], "fixed") for i in range(first, 6)]
    text = urdf(*arm(5), *reversed(named), *fingers(1, 1))
    assert tip_of(text) == [NAMES[first]]
    # exact names only
    text = urdf(*arm(5), ("wrist", f"my_{NAMES[first]}", "fixed"), *fingers(1, 1))
    assert tip_of(text) == ["hand_base"]


@pytest.mark.parametrize(
    ("joints", "tip"),
    [
        # two arms, and legs: the last one, to its hand if it has one
        ([("base", "x"), *fingers(6, 6, on="x")], "finger1_5"),
        (fingers(3, 3, 3, 3, on="base"), "finger3_2"),
        ([*fingers(6, on="base"), *arm(6), ("hand_base", "jaw"), ("hand_base", "other")],
         "hand_base"),
        # a camera that turns beside the arm does not end it, wherever it stands in the file
        ([*arm(6), ("l3", "camera")], "camera"),
        ([*arm(3)[:2], ("l2", "camera"), ("l2", "a"), ("a", "b"), ("b", "end")], "end"),
        ([*arm(5)[:4], ("l4", "camera"), ("l4", "a"), ("a", "b"), ("b", "end")], "end"),
        # a mobile base and a torso with a head before the arm
        ([*arm(2, "torso"), ("torso", "head"), *fingers(5, on="torso")], "finger0_4"),
        # a hand alone, longer than what carries it
        ([("base", "palm"), *fingers(3, 3, on="palm")], "finger1_2"),
    ],
)  # fmt: skip
def test_where_version_01_stays(joints, tip):
    assert tip_of(urdf(*joints)) == [tip]


@pytest.mark.parametrize("name", TREES)
def test_tips_of_trees(name):
    model = rm.load(name)
    q = np.random.default_rng(0).uniform(-1, 1, model.n)
    assert np.array_equal(rm.dgm(model, q), rm.dgm(model, q, TREES[name]))


# --- joints that do not move the tip ------------------------------------------------------------


def with_side_joints(rng, model, more):
    """The robot with joints on side branches, somewhere in the table; its own columns of q."""
    f, table = model.f, model.table
    side = random_table(rng, more, limits=False)
    carriers = [*(table.antecedent - 1), *(int(rng.integers(-1, f + i)) for i in range(more))]
    place = np.zeros(f + more + 1)
    for j, carrier in enumerate(carriers):
        place[j] = place[carrier] + rng.random()  # behind its carrier, -1 is the base
    order = np.argsort(place[:-1])
    number = np.append(np.argsort(order) + 1, 0)

    def both(name):
        return np.concatenate((getattr(table, name), getattr(side, name)))

    fields = ("sigma", "mu", "gamma", "b", "beta", "alpha", "d", "theta", "r")
    moving = both("sigma") != 2
    joints = [(np.cumsum(moving) - 1)[j] for j in order if moving[j]]
    grown = rm.DHTable(
        antecedent=[number[carriers[j]] for j in order],
        **{name: both(name)[order] for name in fields},
        **{name: both(name)[joints] for name in ("lower", "upper")},
    )
    tip = int(number[model.tip - 1])
    tree = rm.RobotModel.from_table(grown, base=model.base, tool=model.tool, tip=tip)
    return tree, np.array([joints.index(k) for k in range(model.n)])


ALONE = ("puma560", "stanford_arm", "iiwa14", "cobra_s600", "lab_trr")


@pytest.mark.parametrize("name", ALONE)
def test_side_joints_change_nothing(name):
    """Postures, counts, statuses and families are those of the arm alone; they keep q_ref."""
    rng = np.random.default_rng(ALONE.index(name))
    alone = rm.load(name)
    tree, own = with_side_joints(rng, alone, int(rng.integers(1, 5)))
    still = np.setdiff1d(np.arange(tree.n), own)
    q = rng.uniform(-1.5, 1.5, (4, tree.n))
    q[:, own] = np.clip(q[:, own], np.maximum(alone.lower, -3), np.minimum(alone.upper, 3))
    T = rm.dgm(tree, q)
    np.testing.assert_allclose(T, rm.dgm(alone, q[:, own]), atol=1e-14)
    T[3, :3, 3] += 50.0  # out of reach
    # by which rows of Jacobians are compared
    assert characteristic_length(tree) == characteristic_length(alone)
    for given in (True, False):
        found = rm.igm(tree, T, q if given else None)
        wanted = rm.igm(alone, T, q[:, own] if given else None)
        assert np.array_equal(found.count, wanted.count)
        assert np.array_equal(found.status, wanted.status)
        for one, other in zip(found.q[found.valid], wanted.q[wanted.valid], strict=True):
            np.testing.assert_allclose(one[own], other, atol=1e-6)
        for field in ("free_joints", "family_joints"):
            marks = getattr(found, field)
            assert not marks[..., still].any()
            assert np.array_equal(marks[..., own], getattr(wanted, field))
        rows = found.valid.nonzero()
        rest = q[rows[0]][:, still] if given else 0.0
        assert np.all(found.q[rows][:, still] == rest)
    near = rm.igm(tree, T[:3], q[:3]).nearest(q[:3])
    np.testing.assert_allclose(near, q[:3], atol=1e-6)


def test_fingers_whose_limits_leave_zero_out():
    """With limits they take the nearest value inside, in every inverse model."""
    model = rm.RobotModel.from_urdf(urdf(*arm(6), *fingers(1, 1)))
    lower, upper = model.lower.copy(), model.upper.copy()
    lower[6], upper[7] = 0.5, -0.25
    model = model.with_table(model.table.replace(lower=lower, upper=upper))
    q = np.array([0.3, -0.4, 0.5, 0.6, -0.7, 0.8, 0.0, 0.0])
    T = rm.dgm(model, q)
    for found in (rm.igm(model, T, limits=True), rm.igm_numeric(model, T, limits=True)):
        assert found.count > 0
        assert np.all(found.q[found.valid][:, 6:] == [0.5, -0.25])
        assert found.within_limits[found.valid].all()
    assert np.all(joint_path(model, T[None]).q[:, 6:] == [0.5, -0.25])
    inside = rm.igm(model, T, np.r_[q[:6], 1.0, -1.0], limits=True)
    assert np.all(inside.q[inside.valid][:, 6:] == [1.0, -1.0])
