"""Redundant arms: joints at the reference, the nearest value where it has no posture, relations."""

import pickle
from functools import cache

import numpy as np
import pytest

from robotmodels import se3
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.igm.arm_angle import ArmAngle
from robotmodels.igm.closed_form import prepare_closed_form
from robotmodels.igm.crossings import relations, solved_with_relations
from robotmodels.igm.elimination import EliminationArm
from robotmodels.igm.families import prepare
from robotmodels.igm.lock import Locked, prepare_locked
from robotmodels.igm.loop import JointChain, joint_chain
from robotmodels.igm.motion import tool_poses
from robotmodels.igm.redundant import Redundant, prepare_redundant
from robotmodels.igm.relations import prepare_related, search_related
from robotmodels.igm.solver import Tolerances, postures
from robotmodels.igm.virtual import VirtualJoint, with_virtual_joints
from robotmodels.robots import load

ARMS = (
    "panda", "erd:xarm7", "erd:talos_left_arm", "erd:tiago_arm", "erd:z1", "erd:baxter_left_arm",
    "erd:tiago_no_hand", "erd:baxter",
)  # fmt: skip


@cache
def arm(name):
    chain = joint_chain(load(name))
    return chain, prepare_redundant(chain, prepare)


def poses(chain, q):
    """Tool in R_0 at ``q (..., k)``."""
    return tool_poses(chain, q.reshape(-1, chain.k)).reshape(*q.shape[:-1], 4, 4)


def way(chain, found, q):
    """From ``q (N, k)`` to rows ``(N, S, k)``, angles by the shorter way round."""
    d = found - q[:, None]
    return np.where(chain.sigma == 0, (d + np.pi) % (2 * np.pi) - np.pi, d)


def random_postures(chain, count, seed=1):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, chain.k))
    return np.where(chain.sigma == 0, q, 0.1 * q)


def met(chain, found, U):
    """Largest error of the rows that are used; rows are packed."""
    there = found.valid
    assert np.array_equal(np.isnan(found.q).all(axis=-1), ~there)
    assert np.all(np.diff(there.astype(int), axis=1) <= 0)
    error = np.abs(poses(chain, found.q) - U[:, None]).max(axis=(-1, -2))[there]
    return error.max(initial=0.0)


# --- joints at the reference ---------------------------------------------------------------------


@pytest.mark.parametrize("name", ARMS)
def test_the_first_joints_take_the_reference(name):
    chain, solver = arm(name)
    assert isinstance(solver, Redundant)
    assert solver.order == tuple(range(chain.k - 6))
    q = random_postures(chain, 30)
    U = poses(chain, q)
    found = postures(solver, U, q, Tolerances())
    assert met(chain, found, U) <= 1e-12
    assert np.nanmin(np.abs(way(chain, found.q, q)).max(axis=-1), axis=1).max() < 1e-6
    first = list(solver.order)
    assert np.abs(way(chain, found.q, q)[..., first][found.valid]).max() == 0.0
    np.testing.assert_array_equal(found.family, found.valid)
    expected = np.isin(np.arange(chain.k), first)
    assert np.all(found.free[found.valid] == expected)
    # the same as with those joints locked
    for n in range(3):
        locks = {j: q[n, j] for j in first}
        locked = postures(
            prepare_locked(chain, locks, prepare), U[n : n + 1], q[n : n + 1], Tolerances()
        )
        rows = found.q[n, found.valid[n]]
        assert len(rows) == locked.valid.sum()
        for row in rows:
            assert np.abs(way(chain, locked.q, row[None]))[locked.valid].max(axis=-1).min() < 1e-8


@pytest.mark.parametrize("name", ["panda", "erd:talos_left_arm", "erd:z1"])
def test_where_the_reference_has_no_posture_the_nearest_value_is_taken(name):
    chain, solver = arm(name)
    q = random_postures(chain, 24, seed=2)
    U, zero = poses(chain, q), np.zeros_like(q)
    found = postures(solver, U, zero, Tolerances())
    assert met(chain, found, U) <= 1e-12
    assert found.valid.any(axis=1).all()
    value = found.q[..., 0]
    assert np.nanmax(np.nanmax(np.abs(value), axis=1) - np.nanmin(np.abs(value), axis=1)) < 1e-6
    off = np.flatnonzero(np.nanmin(np.abs(value), axis=1) > 1e-9)
    assert off.size >= 1
    reached = np.nanmin(np.abs(value), axis=1)

    def exists(at, n):
        """Rows with joint 1 locked, from a solver prepared for those values."""
        solver = prepare_locked(chain, {0: at}, prepare)
        tiled = np.repeat(U[n : n + 1], len(at), axis=0)
        return postures(solver, tiled, np.zeros((len(at), chain.k)), Tolerances()).valid.any(axis=1)

    for n in off[:2]:
        # nothing nearer on either side
        nearer = reached[n] * np.array([0.02, 0.3, 0.6, 0.9, 0.99, 0.999, 1.0 - 1e-6])
        assert not exists(np.concatenate((nearer, -nearer)), n).any()
        # and something as near as rounding allows
        beside = np.sign(value[n, 0]) * (reached[n] + 1e-7)
        assert exists(np.array([beside]), n).all()


def test_a_batch_gives_what_its_poses_give():
    chain, solver = arm("panda")
    q = random_postures(chain, 8, seed=3)
    U = poses(chain, q)
    references = np.zeros_like(q)
    references[:4] = q[:4]
    found = postures(solver, U, references, Tolerances())
    again = pickle.loads(pickle.dumps(solver))
    for n in range(8):
        one = postures(again, U[n : n + 1], references[n : n + 1], Tolerances())
        rows, alone = found.q[n, found.valid[n]], one.q[0, one.valid[0]]
        assert rows.shape == alone.shape
        for row in rows:
            assert np.abs(way(chain, alone[None], row[None])).max(axis=-1).min() < 1e-9
    empty = postures(solver, U[:0], references[:0], Tolerances())
    assert empty.q.shape[0] == 0
    assert empty.q.shape[2] == 7


def test_out_of_reach():
    chain, solver = arm("panda")
    U = poses(chain, random_postures(chain, 3, seed=4))
    U[:, :3, 3] += 4.0
    assert not postures(solver, U, np.zeros((3, 7)), Tolerances()).valid.any()


def test_spherical_shoulders_go_by_the_arm_angle():
    assert isinstance(prepare_redundant(joint_chain(load("iiwa14")), prepare), ArmAngle)
    assert prepare_redundant(joint_chain(load("rx90")), prepare) is None


# --- virtual joints ------------------------------------------------------------------------------


def test_virtual_joints_are_never_set():
    """Pointing with an RX-90: its tool may turn about the tool's z axis."""
    chain = joint_chain(load("rx90"))
    frame = chain.D[6] @ se3.translation(0.1, 0.0, 0.05) @ se3.rotation("x", 0.4)
    longer, _ = with_virtual_joints(chain, [VirtualJoint(6, frame, 0)])
    solver = prepare_redundant(longer, prepare)
    assert solver.order == (0,)
    q = np.zeros((20, 7))
    q[:, :6] = random_postures(chain, 20, seed=5)
    U = poses(longer, q)
    found = postures(solver, U, q, Tolerances())
    assert met(longer, found, U) <= 1e-12
    assert np.nanmin(np.abs(way(longer, found.q, q)).max(axis=-1), axis=1).max() < 1e-6
    assert not found.free[..., 6].any()


def test_a_virtual_joint_at_the_base_is_left_open_too():
    """The height of the tool does not matter."""
    chain = joint_chain(load("rx90"))
    longer, places = with_virtual_joints(chain, [VirtualJoint(0, np.eye(4), 1)])
    solver = prepare_redundant(longer, prepare)
    assert solver.order == (int(places[1]),)  # joint 1 turns about the axis that is left open
    q = np.zeros((12, 7))
    q[:, places] = random_postures(chain, 12, seed=6)
    U = poses(longer, q)
    found = postures(solver, U, q, Tolerances())
    assert met(longer, found, U) <= 1e-12
    assert np.nanmin(np.abs(way(longer, found.q, q)).max(axis=-1), axis=1).max() < 1e-6
    # at another reference joint 2 is taken along as near as it can be
    other = postures(solver, U, q + 0.8, Tolerances())
    assert met(longer, other, U) <= 1e-12
    assert other.valid.any(axis=1).all()
    gap = np.abs(way(longer, other.q, q + 0.8))[..., places[1]]
    assert np.all(np.nanmax(gap, axis=1) <= 0.8 + 1e-9)


def test_a_point_for_a_ur5_at_a_reference_that_does_not_reach_it():
    """A spherical joint at the tool leaves the orientation open: three joints take part."""
    chain = joint_chain(load("ur5"))
    ball = [
        VirtualJoint(6, chain.D[6] @ se3.rotation(axis, angle), 0)
        for axis, angle in (("z", 0.0), ("x", np.pi / 2), ("y", np.pi / 2))
    ]
    longer, _ = with_virtual_joints(chain, ball)
    solver = prepare_redundant(longer, prepare)
    assert solver.order[:2] == (0, 1)
    q = np.zeros((2, 9))
    q[:, :6] = random_postures(chain, 2, seed=12)
    q[:, 6:] = 0.4, 1.0, -0.3
    U = poses(longer, q)
    found = postures(solver, U, np.zeros_like(q), Tolerances())
    assert met(longer, found, U) <= 1e-12
    assert found.valid.any(axis=1).all()
    assert not found.free[..., 6:].any()


def test_a_joint_that_does_not_move_is_not_freed():
    """Four parallel axes, joints 2 to 5, move among themselves while joint 1 stands still."""
    D = np.tile(np.eye(4), (9, 1, 1))
    D[1] = se3.rotation("x", 0.3)
    for j in range(2, 5):
        D[j, 0, 3] = 0.3  # four parallel axes: 2 to 5
    D[5] = se3.translation(0.2, 0, 0) @ se3.rotation("x", 1.2)
    D[6] = se3.translation(0.1, 0.2, 0) @ se3.rotation("y", 0.9)
    D[7] = se3.translation(0.1, 0, 0.2) @ se3.rotation("x", -0.7)
    chain = JointChain(np.arange(7), np.array([1, 0, 0, 0, 0, 0, 0]), D[:8], np.eye(4))
    solver = prepare_redundant(chain, lambda rest: EliminationArm(rest, rest, 1.0, ()))
    assert solver.order == (1,)
    # with joints 3 and 5 as the only ones that may be set
    assert prepare_redundant(
        chain, lambda rest: EliminationArm(rest, rest, 1.0, ()), [2, 4]
    ).order == (2,)
    assert (
        prepare_redundant(chain, lambda rest: EliminationArm(rest, rest, 1.0, ()), [0, 5, 6])
        is None
    )


def test_an_arm_without_a_family_at_the_reference_is_found_from_other_joints():
    """Only closed forms are allowed: the Panda without joint 1 has none, without others it has."""
    chain, whole = arm("panda")
    solver = prepare_redundant(chain, prepare_closed_form)
    assert solver.order == (0,)
    assert solver.sampled != (0,)
    assert "found from joint" in solver.method
    q = random_postures(chain, 6, seed=8)
    U = poses(chain, q)
    found = postures(solver, U, q, Tolerances())
    assert met(chain, found, U) <= 1e-12
    expected = postures(whole, U, q, Tolerances())
    both = 0
    for n in range(6):
        gap = np.abs(way(chain, found.q[n : n + 1], expected.q[n][expected.valid[n]][0][None]))
        assert np.nanmax(np.nanmin(gap[..., 0], axis=1)) < 1e-9
        for row in found.q[n, found.valid[n]]:
            assert (
                np.abs(way(chain, expected.q[n][None], row[None]))
                .max(axis=-1)[expected.valid[n][None]]
                .min()
                < 1e-7
            )
        both += found.valid[n].sum()
    assert both == expected.valid.sum()


# --- relations between joints --------------------------------------------------------------------


def found_by_newton(chain, U, A, b, starts=1500):
    """Postures of one pose under relations from random starts; distinct to 1e-5."""
    wanted = relations(chain, np.array(A, float), np.array(b, float))
    q = np.random.default_rng(11).uniform(-np.pi, np.pi, (starts, chain.k))
    q, converged = solved_with_relations(chain, U, wanted, q, np.zeros(starts, np.int64))
    rows = []
    for row in q[converged]:
        row = (row + np.pi) % (2 * np.pi) - np.pi
        if all(np.abs((row - r + np.pi) % (2 * np.pi) - np.pi).max() > 1e-5 for r in rows):
            rows.append(row)
    return np.array(rows)


RELATIONS = [
    ("iiwa14", [1, 0, 1, 0, 0, 0, 0]),
    ("iiwa14", [0, 0, 1, 0, 1, 0, 0]),
    ("panda", [1, 0, 1, 0, 0, 0, 0]),
    ("panda", [0.5, 0, 0, -0.3, 0, 0, 1.2]),
    ("erd:talos_left_arm", [0, 2, 0, 1, 0, 0, 0]),
]


@pytest.mark.parametrize(("name", "row"), RELATIONS)
def test_every_posture_that_obeys_a_relation(name, row):
    chain = joint_chain(load(name))
    A = np.array([row], float)
    q = random_postures(chain, 3, seed=9)
    for n in range(3):
        b = A @ q[n]
        solver = prepare_related(chain, A, b, prepare)
        U = poses(chain, q[n : n + 1])
        found = postures(solver, U, np.zeros((1, 7)), Tolerances())
        assert met(chain, found, U) <= 1e-12
        rows = found.q[0, found.valid[0]]
        off = rows @ A[0] - b
        if np.array_equal(A, np.round(A)):
            off = (off + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(off).max() < 1e-9
        assert np.abs(way(chain, rows[None], q[n : n + 1])).max(axis=-1).min() < 1e-6
        if n < 1:
            independent = found_by_newton(chain, U, A, b, 400)
            if not np.array_equal(A, np.round(A)):
                independent = independent[np.abs(independent @ A[0] - b) < 1e-7]
            assert len(independent) >= 4
            gap = np.abs(
                way(chain, np.broadcast_to(rows, (len(independent), *rows.shape)), independent)
            )
            assert gap.max(axis=-1).min(axis=-1).max() < 1e-5
            assert len(rows) >= len(independent)


@pytest.mark.parametrize(("name", "joint"), [("iiwa14", 2), ("panda", 0), ("panda", 4)])
def test_a_relation_of_one_joint_is_a_lock(name, joint):
    chain = joint_chain(load(name))
    q = random_postures(chain, 6, seed=10)
    q[:, joint] = 0.3
    U = poses(chain, q)
    A = np.zeros((1, 7))
    A[0, joint] = 2.0
    locked = prepare_related(chain, A, [0.6], prepare)
    assert isinstance(locked, Locked)
    expected = postures(locked, U, q, Tolerances())
    # and the search along the families finds the same
    found = postures(search_related(chain, A / 2.0, np.array([0.3]), prepare), U, q, Tolerances())
    assert met(chain, found, U) <= 1e-12
    np.testing.assert_array_equal(found.valid.sum(axis=1), expected.valid.sum(axis=1))
    for n in range(6):
        for row in expected.q[n, expected.valid[n]]:
            assert np.nanmin(np.abs(way(chain, found.q[n][None], row[None])).max(axis=-1)) < 1e-6


def test_two_relations_of_eight_joints():
    baxter = load("erd:baxter")  # with a finger as the tip, which is the eighth joint
    chain = joint_chain(baxter.with_tool(np.eye(4), tip=baxter.tip + 2))
    rng = np.random.default_rng(12)
    q = random_postures(chain, 3, seed=13)
    A = np.zeros((2, 8))
    A[0, :4], A[1, 4:] = rng.normal(size=4), rng.normal(size=4)
    # one of them a lock: the other is searched along a family
    A[0] = np.eye(8)[0]
    solver = prepare_related(chain, A, A @ q[0], prepare)
    assert isinstance(solver, Locked)
    U = poses(chain, q[:1])
    found = postures(solver, U, q[:1], Tolerances())
    assert met(chain, found, U) <= 1e-12
    assert np.nanmin(np.abs(way(chain, found.q, q[:1])).max(axis=-1)) < 1e-6
    # both of several joints: random starts, and the method says so
    A[0] = [1, 0, -1, 0, 0, 0, 0, 0]
    A[1] = [0, 0, 0, 0, 1, 0, 1, 0]
    solver = prepare_related(chain, A, A @ q[1], prepare)
    assert "may miss" in solver.method
    U = poses(chain, q[1:2])
    found = postures(solver, U, q[1:2], Tolerances())
    assert met(chain, found, U) <= 1e-12
    rows = found.q[0, found.valid[0]]
    assert np.abs((rows @ A.T - A @ q[1] + np.pi) % (2 * np.pi) - np.pi).max() < 1e-9
    assert np.abs(way(chain, rows[None], q[1:2])).max(axis=-1).min() < 1e-6


def test_relations_that_are_none():
    chain = joint_chain(load("panda"))
    for A, b in (([[1, 0, 0]], [0.0]), ([[0] * 7], [0.0]), ([[np.nan] * 7], [0.0]), ([[1] * 7], 0)):
        with pytest.raises((ShapeError, InvalidValueError), match="A"):
            prepare_related(chain, A, b, prepare)
    assert prepare_related(joint_chain(load("rx90")), np.ones((1, 6)), [0.0], prepare) is None
