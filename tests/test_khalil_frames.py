"""Frames of any joint tree: same poses, no huge lengths, and the zeros the book's rules allow."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from identities.random_robots import random_pose, seeds

import robotmodels as rm
from robotmodels import se3
from robotmodels.khalil_frames import JointAxis, khalil_frames

Z = np.array([0.0, 0.0, 1.0])


def table_of(joints, frames):
    return rm.DHTable(
        antecedent=[j.antecedent for j in joints],
        sigma=[j.sigma for j in joints],
        **{c: getattr(frames, c) for c in ("gamma", "b", "beta", "alpha", "d", "theta", "r")},
    )


def source_poses(joints, q):
    """Link poses straight from origins and axes (Rodrigues), no table involved."""
    poses = [np.eye(4)]
    for joint, x in zip(joints, q, strict=True):
        motion, K = np.eye(4), se3.skew(joint.axis)
        if joint.sigma:
            motion[:3, 3] = x * joint.axis
        else:
            motion[:3, :3] += np.sin(x) * K + (1 - np.cos(x)) * K @ K
        poses.append(poses[joint.antecedent] @ joint.origin @ motion)
    return np.array(poses[1:])


def table_link_poses(joints, frames, q):
    poses = [frames.base]
    for j, T in enumerate(rm.link_transforms(table_of(joints, frames), q)):
        poses.append(poses[joints[j].antecedent] @ T)
    return np.array(poses[1:]) @ frames.link_poses


def assert_same_robot(joints, tolerance=1e-12):
    """The table moves every link as the source does; returns the frames."""
    frames = khalil_frames(joints)
    rng = np.random.default_rng(0)
    for q in (np.zeros(len(joints)), *rng.uniform(-3, 3, size=(3, len(joints)))):
        wanted = source_poses(joints, q)
        size = max(1.0, np.abs(wanted[:, :3, 3]).max())
        assert np.abs(table_link_poses(joints, frames, q) - wanted).max() < tolerance * size
    return frames


def random_axis(rng):
    if rng.random() < 0.6:
        return np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
    u = rng.normal(size=3)
    return u / np.linalg.norm(u)


def random_origin(rng):
    """Aligned, turned by right angles, turned by almost nothing, or anything; often no shift."""
    kind = rng.integers(4)
    T = np.eye(4)
    if kind == 1:
        T = se3.rotation("xyz"[rng.integers(3)], rng.integers(-2, 3) * np.pi / 2)
    elif kind == 2:
        small = rng.normal(size=2) * 10.0 ** rng.integers(-16, -1, size=2)
        T = se3.rotation("x", small[0]) @ se3.rotation("y", small[1])
        T = T @ se3.rotation("z", rng.normal())
    elif kind == 3:
        T = random_pose(rng, 0.0)
    T[:3, 3] = rng.normal(size=3) * (rng.random(3) < 0.5)
    return T


def random_tree(rng, f, branching=0.3):
    return [
        JointAxis(
            int(rng.integers(0, j + 1)) if rng.random() < branching else j,
            int(rng.random() < 0.3),
            random_origin(rng),
            random_axis(rng),
        )
        for j in range(f)
    ]


@given(seeds, st.integers(1, 9), st.sampled_from([0.0, 0.3, 0.9]))
def test_random_trees_keep_their_poses_and_their_size(seed, f, branching):
    """q keeps its sign and zero; no parameter is longer than the robot times 1 / 0.02."""
    rng = np.random.default_rng(seed)
    joints = random_tree(rng, f, branching)
    frames = assert_same_robot(joints)
    size = 1.0 + sum(np.linalg.norm(j.origin[:3, 3]) for j in joints)
    for lengths in (frames.b, frames.d, frames.r, frames.base[:3, 3]):
        assert np.abs(lengths).max() < 60 * size


@pytest.mark.parametrize("tilt", [0.0, *(10.0**k for k in range(-16, -1, 3)), 0.019, 0.021])
@pytest.mark.parametrize("flip", [False, True], ids=["parallel", "antiparallel"])
@pytest.mark.parametrize("about", ["x", "xy"])
@pytest.mark.parametrize("sigma", [0, 1])
def test_nearly_parallel_axes_never_run_away(tilt, flip, about, sigma):
    """Without beta the common perpendicular of axes 1e-8 rad apart is thousands of km away."""
    turn = np.eye(4)
    for axis in about:
        turn = turn @ se3.rotation(axis, tilt)
    if flip:
        turn = turn @ se3.rotation("x", np.pi)
    joints = [
        JointAxis(0, 0, np.eye(4), Z),
        JointAxis(1, sigma, se3.translation(0.3, 0.4, 0.2) @ turn, Z),
        JointAxis(2, 0, se3.translation(0.1, -0.2, 0.3), np.array([1.0, 0.0, 0.0])),
        JointAxis(1, sigma, se3.translation(-0.3, 0.1, 0.0) @ turn, Z),
    ]
    frames = assert_same_robot(joints)
    for lengths in (frames.b, frames.d, frames.r):
        assert np.abs(lengths).max() < 60
    if tilt < 1e-13 / 2:
        assert np.array_equal(frames.beta, np.zeros(4)), "rounding of the input is not geometry"
        # a flip, and the plane x z of the foot, leave alpha = 0 or pi
        assert np.abs(frames.alpha[1]) in (0.0, np.pi)
    elif tilt > 0.02:
        assert np.array_equal(frames.beta, np.zeros(4)), "the common perpendicular is at hand"


# --- tables that already follow the rules come back -----------------------------------------------

FOLLOWING = ("rx90", "puma560", "ur5", "ur10e", "iiwa14", "panda", "irb140", "irb6640", "xarm6")


@pytest.mark.parametrize("name", FOLLOWING)
def test_tables_that_follow_the_rules_come_back(name):
    """Table -> URDF -> table: every column, with the zeros where the book has them."""
    table = rm.load(name).table
    r = np.array(table.r)
    r[[0, -1]] = 0.0  # R_0 is R_1, and nothing but the tool is beyond the last joint
    table = table.replace(r=r)
    again = rm.RobotModel.from_urdf(rm.to_urdf(rm.RobotModel.from_table(table))).table
    assert again.names == table.names
    for column in ("antecedent", "sigma", "mu", "gamma", "b", "beta", "lower", "upper"):
        assert np.array_equal(getattr(again, column), getattr(table, column)), column
    for column in ("alpha", "d", "theta", "r"):
        got, wanted = getattr(again, column), getattr(table, column)
        assert np.abs(got - wanted).max() < 1e-14, column
        assert (got[wanted == 0] == 0).all(), f"{column} has a zero that is only nearly one"


@given(seeds, st.booleans())
def test_extracting_twice_changes_nothing(seed, tree):
    """The rules leave no choice to chance: their own result is where they lead again."""
    rng = np.random.default_rng(seed)
    joints = random_tree(rng, 6, branching=0.4 * tree)
    once = khalil_frames(joints)
    factors = rm.link_transforms(table_of(joints, once), np.zeros(6))
    own = [JointAxis(j.antecedent, j.sigma, T, Z) for j, T in zip(joints, factors, strict=True)]
    assert_same_robot(own)
    twice = khalil_frames(own)
    size = 1.0 + np.abs([once.b, once.d, once.r]).max()
    assert np.abs(twice.base[:3, 3]).max() < 1e-10 * size
    for column in ("b", "d", "r"):
        assert np.abs(getattr(twice, column) - getattr(once, column)).max() < 1e-9 * size, column
