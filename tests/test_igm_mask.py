"""Tasks that leave components free: postures, completeness, residuals on what is asked alone."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robotmodels import se3
from robotmodels.igm.components import Components, asked_errors, missing_components
from robotmodels.igm.families import prepare as family
from robotmodels.igm.loop import JointChain, joint_chain
from robotmodels.igm.mask import MaskedArm, MaskedByPose, prepare_masked
from robotmodels.igm.redundant import prepare_redundant
from robotmodels.igm.solver import Tolerances, postures
from robotmodels.igm.swing import SwingFilter, SwingSearch
from robotmodels.kinematics import dgm
from robotmodels.robots import load

EXACT = Tolerances()
POINT, POINTING, PLANE = "111000", "111110", "110001"
UP, SPIN = "000110", "000001"
# arm, mask, axes: as many joints as components, and fewer
FINITE = (
    ("lab_rr", POINT, "world"), ("lab_rrt", POINT, "world"), ("lab_trr", POINT, "tool"),
    ("RRR", POINT, "world"), ("RR", "011000", "world"), ("planar_2r", "110000", "world"),
    ("planar_2r", "110000", "tool"), ("RRRRR", POINTING, "tool"), ("RRRRR/23", POINTING, "tool"),
    ("RRRR", POINTING, "tool"), ("xarm5", POINTING, "world"), ("RRRR/1", "110011", "world"),
    ("RP", "101000", "world"), ("RRP", "111000", "tool"),
)  # fmt: skip
TWIST = (
    ("planar_3r", PLANE, "world"), ("planar_3r", PLANE, "tool"), ("cobra_s600", "111001", "world"),
    ("RRRR", "111001", "tool"), ("RRP", "101100", "world"), ("R", SPIN, "tool"),
    ("RRR", "111001", "world"),
)  # fmt: skip
REDUNDANT = (
    ("rx90", POINT, "world"), ("rx90", POINTING, "tool"), ("planar_3r", "110000", "world"),
    ("cobra_s600", POINT, "world"), ("RR", SPIN, "world"),
)  # fmt: skip


def prepare(chain):
    return prepare_redundant(chain, prepare) if chain.k > 6 else family(chain)


@cache
def arm(word):
    """An arm of the catalogue, or a random one; its base turned, so that R_0 is not the world."""
    if word.islower():
        return joint_chain(load(word))
    kinds, _, parallel = word.partition("/")
    rng = np.random.default_rng(len(word))
    D = np.tile(np.eye(4), (len(kinds) + 1, 1, 1))
    for i in range(len(D)):
        D[i, :3, :3] = Rotation.random(rng=rng).as_matrix()
        D[i, :3, 3] = rng.uniform(-0.5, 0.5, 3)
    for i in map(int, parallel):
        D[i, :3, :3] = se3.rotation("z", rng.uniform(-3, 3))[:3, :3]
    base = se3.from_rpy((0.3, -0.8, 2.0), (0.1, 0.2, 0.3))
    sigma = np.array([int(kind == "P") for kind in kinds])
    return JointChain(np.arange(len(kinds)), sigma, D, base)


def asked_of(mask, axes):
    return Components(tuple(c == "1" for c in mask), axes == "tool")


@cache
def solver(word, mask, axes):
    components = asked_of(mask, axes)
    return prepare_masked(arm(word), components.asked, components.in_tool_axes, prepare)


def tool(chain, q):
    T = np.broadcast_to(chain.D[0], (len(q), 4, 4))
    for k in range(chain.k):
        M = np.broadcast_to(np.eye(4), (len(q), 4, 4)).copy()
        if chain.sigma[k] == 0:
            M[:, :3, :3] = Rotation.from_rotvec(q[:, k, None] * [0.0, 0.0, 1.0]).as_matrix()
        else:
            M[:, 2, 3] = q[:, k]
        T = T @ M @ chain.D[k + 1]
    return T


def way(chain, U, q, components):
    """Missing translation and rotation vector in the mask's axes: written here on its own."""
    P = tool(chain, q)
    axes = U[:, :3, :3] if components.in_tool_axes else chain.base[:3, :3].T
    turn = Rotation.from_matrix(U[:, :3, :3] @ np.swapaxes(P[:, :3, :3], 1, 2)).as_rotvec()
    back = np.swapaxes(np.broadcast_to(axes, (len(q), 3, 3)), 1, 2)
    away = (back @ (U[:, :3, 3] - P[:, :3, 3])[..., None])[..., 0]
    return np.concatenate([away, (back @ turn[..., None])[..., 0]], axis=1)


def tasks(chain, components, count, seed=0):
    """Postures, and poses that differ from theirs in what is free, up to near half a turn."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, (count, chain.k))
    q = np.where(chain.sigma == 0, q, 0.2 * q)
    U = tool(chain, q)
    free = ~np.array(components.asked)
    away, turn = (
        rng.uniform(-0.4, 0.4, (count, 3)) * free[:3],
        rng.normal(size=(count, 3)) * free[3:],
    )
    length = np.linalg.norm(turn, axis=1, keepdims=True)
    turn *= rng.uniform(0.0, 3.1, (count, 1)) / np.maximum(length, 1e-9)
    world = chain.base[:3, :3].T
    if components.in_tool_axes:
        U[:, :3, :3] = U[:, :3, :3] @ Rotation.from_rotvec(turn).as_matrix()
        U[:, :3, 3] += (U[:, :3, :3] @ away[..., None])[..., 0]
    else:
        U[:, :3, :3] = Rotation.from_rotvec(turn @ world.T).as_matrix() @ U[:, :3, :3]
        U[:, :3, 3] += away @ world.T
    return q, U


def gaps(chain, a, b):
    d = a - b
    return np.abs(np.where(chain.sigma == 0, (d + np.pi) % (2 * np.pi) - np.pi, d)).max(axis=-1)


def check(chain, U, found, components):
    """Rows packed and distinct; each meets what is asked of it, measured independently."""
    assert np.all(np.isnan(found.q) == ~found.valid[..., None])
    assert np.all(np.diff(found.valid.astype(int), axis=1) <= 0)
    n, s = np.nonzero(found.valid)
    missing = way(chain, U[n], found.q[n, s], components)[:, np.array(components.asked)]
    assert np.abs(missing).max(initial=0.0) < 2e-9
    assert found.residual[n, s].max(initial=0.0) <= 1e-9
    for i in range(found.valid.shape[1]):
        for j in range(i):
            both = found.valid[:, i] & found.valid[:, j]
            assert np.all(gaps(chain, found.q[both, i], found.q[both, j]) > 1e-6)


def lost(chain, found, q):
    near = np.where(found.valid, gaps(chain, found.q, q[:, None]), np.inf)
    return np.flatnonzero(near.min(axis=1, initial=np.inf) > 1e-6)


def newton_postures(chain, U, components, starts=60):
    """All postures that damped Newton steps reach from spread starts, slopes by differences."""
    asked, U = np.array(components.asked), np.broadcast_to(U, (starts, 4, 4))

    def missing(q):
        return way(chain, U, q, components)[:, asked]

    rng = np.random.default_rng(9)
    q = rng.uniform(-np.pi, np.pi, (starts, chain.k))
    damping, e = np.full(starts, 1e-2), missing(q)
    for _ in range(60):
        J = np.stack([(missing(q + d) - missing(q - d)) / 2e-6 for d in 1e-6 * np.eye(chain.k)], -1)
        # a rotation vector jumps at half a turn
        J[np.abs(J) > 1e3] = 0.0
        Jt = np.swapaxes(J, 1, 2)
        normal = Jt @ J + damping[:, None, None] * np.eye(chain.k)
        trial = q - np.linalg.solve(normal, Jt @ e[..., None])[..., 0]
        next_e = missing(trial)
        better = np.sum(next_e**2, axis=1) < np.sum(e**2, axis=1)
        q, e = np.where(better[:, None], trial, q), np.where(better[:, None], next_e, e)
        damping = np.clip(np.where(better, 0.2, 5.0) * damping, 1e-9, 1e6)
    distinct = []
    for x in q[np.abs(e).max(axis=1) < 1e-8]:
        if all(gaps(chain, x, y) > 1e-3 for y in distinct):
            distinct.append(x)
    return distinct


@pytest.mark.parametrize(("word", "mask", "axes"), FINITE + TWIST)
def test_random_tasks_give_their_posture_back(word, mask, axes):
    chain, components = arm(word), asked_of(mask, axes)
    known = solver(word, mask, axes)
    assert known.chain is chain
    by_pose = isinstance(known, (MaskedByPose, SwingSearch))
    q, U = tasks(chain, components, 12 if by_pose else 100)
    found = postures(known, U, np.zeros_like(q), EXACT)
    check(chain, U, found, components)
    if not found.family.any():
        assert lost(chain, found, q).size == 0
    assert found.valid.any(axis=1).all()
    one = postures(known, U[:1], np.zeros((1, chain.k)), EXACT)
    assert one.valid.sum() == found.valid[0].sum()
    np.testing.assert_allclose(one.q[0, : one.valid.sum()], found.q[0, found.valid[0]], atol=1e-10)
    assert not postures(known, U[:0], q[:0], EXACT).valid.any()


@pytest.mark.parametrize(
    ("word", "mask", "axes"),
    [
        ("lab_rrt", POINT, "world"), ("RR", "011000", "world"), ("RRRRR/23", POINTING, "tool"),
        ("RRRR/1", "110011", "world"), ("planar_3r", PLANE, "world"), ("RRRR", "111001", "tool"),
        ("RRR", "111001", "world"),
    ],
)  # fmt: skip
def test_as_many_postures_as_an_independent_search(word, mask, axes):
    chain, components = arm(word), asked_of(mask, axes)
    q, U = tasks(chain, components, 2, seed=1)
    found = postures(solver(word, mask, axes), U, np.zeros_like(q), EXACT)
    for n in range(len(q)):
        others = newton_postures(chain, U[n], components)
        assert len(others) <= found.valid[n].sum()
        for x in others:
            assert gaps(chain, found.q[n, found.valid[n]], x).min() < 1e-5


@pytest.mark.parametrize(("word", "mask", "axes"), REDUNDANT)
def test_redundant_tasks(word, mask, axes):
    chain, components = arm(word), asked_of(mask, axes)
    q, U = tasks(chain, components, 4)
    known = solver(word, mask, axes)
    found = postures(known, U, q, EXACT)
    check(chain, U, found, components)
    assert lost(chain, found, q).size == 0
    assert found.family[found.valid].all()
    # one joint takes its reference for each dimension of the family
    free = found.free[found.valid].sum(axis=1)
    assert np.all(free == chain.k - sum(components.asked))
    n, s = np.nonzero(found.valid)
    at_reference = np.abs(found.q[n, s] - q[n])[found.free[n, s]]
    assert np.max(np.minimum(at_reference, 2 * np.pi - at_reference)) < 1e-9
    others = postures(known, U, np.zeros_like(q), EXACT)
    check(chain, U, others, components)
    assert others.valid.any(axis=1).all()


def test_what_serves_what():
    assert isinstance(solver("lab_trr", POINT, "tool"), MaskedArm)
    assert "Pieper" in solver("lab_trr", POINT, "tool").method
    assert isinstance(solver("xarm5", POINTING, "world"), MaskedByPose)
    assert isinstance(solver("RRRR", "111001", "tool"), SwingSearch)
    assert isinstance(solver("RRR", "111001", "world"), SwingFilter)


def test_the_position_of_pose_b_is_a_double_root():
    B = np.array([[[-1, 0, 0, 0.4], [0, 1, 0, 0.2], [0, 0, -1, 0.5], [0, 0, 0, 1.0]]])
    known = solver("lab_trr", POINT, "tool")
    found = postures(known, B, np.zeros((1, 3)), EXACT)
    assert found.valid.sum() == 1
    np.testing.assert_allclose(found.q[0, 0], [0.2, 0.0, 0.0], atol=1e-9)
    assert found.double[0, 0]
    assert not found.family.any()
    away, turn = missing_components(known.chain, B, found.q[0], known.components)
    np.testing.assert_allclose(away, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(turn), np.pi, atol=1e-9)
    # a little out of reach: no posture, unless the tolerance says it counts
    B[0, 0, 3] += 2e-5
    assert not postures(known, B, np.zeros((1, 3)), EXACT).valid.any()
    near = postures(known, B, np.zeros((1, 3)), Tolerances(1e-4, 1e-4))
    assert near.valid.sum() == 1
    np.testing.assert_allclose(near.residual[0, 0], 2e-5, rtol=1e-3)


def test_the_straight_path_of_the_exercise():
    known, model = solver("lab_trr", POINT, "tool"), load("lab_trr")
    start = dgm(model, [-0.3, -np.pi / 4, -np.pi / 4])
    path = np.tile(start, (50, 1, 1))
    path[:, :3, 3] = np.linspace(start[:3, 3], [0.4, 0.2, 0.5], 50)
    found = postures(known, path, np.zeros((50, 3)), EXACT)
    check(known.chain, path, found, known.components)
    np.testing.assert_array_equal(found.valid.sum(axis=1), [*[2] * 49, 1])


@pytest.mark.parametrize("axes", ["world", "tool"])
def test_a_pose_that_a_scara_arm_reaches_in_full(axes):
    # nothing is to be freed: the two postures of the whole pose
    chain = arm("cobra_s600")
    q = np.array([[0.3, -0.7, 0.1, 1.2], [-2.0, 1.5, 0.05, -0.4]])
    found = postures(solver("cobra_s600", "111001", axes), tool(chain, q), np.zeros((2, 4)), EXACT)
    assert lost(chain, found, q).size == 0
    np.testing.assert_array_equal(found.valid.sum(axis=1), [2, 2])


def test_a_tool_point_on_the_last_axis():
    # the position of the second link's end is free of the third joint, which stays where it was
    chain = arm("planar_3r")
    D = chain.D.copy()
    D[3, :3, 3] = 0.0
    short = JointChain(chain.columns, chain.sigma, D, chain.base)
    known = prepare_masked(short, asked_of("110000", "world").asked, False, prepare)
    q = np.array([[0.3, 0.8, -0.9]])
    found = postures(known, tool(short, q), q, EXACT)
    assert found.valid.sum() == 2
    np.testing.assert_array_equal(found.free[0, 0], [False, False, True])
    np.testing.assert_allclose(found.q[0, :2, 2], -0.9)


def test_errors_are_those_of_the_asked_components():
    chain = arm("RRR")
    for mask, axes in (("101000", "world"), ("110011", "tool"), ("001100", "world")):
        components = asked_of(mask, axes)
        q, U = tasks(chain, asked_of("000000", axes), 20)
        missing = way(chain, U, q, components) * np.array(components.asked)
        away, turn = asked_errors(chain, U, q, components)
        np.testing.assert_allclose(away, np.linalg.norm(missing[:, :3], axis=1), atol=1e-12)
        np.testing.assert_allclose(turn, np.linalg.norm(missing[:, 3:], axis=1), atol=1e-9)
