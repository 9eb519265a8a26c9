"""Infinite families settled at the reference values, against independent searches."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from identities.chain_search import apart, draw, missing, searched

import robotmodels as rm
from robotmodels.igm.constraints import constraints
from robotmodels.igm.families import prepare
from robotmodels.igm.kernels.singular import curve
from robotmodels.igm.loop import JointChain, joint_chain
from robotmodels.igm.motion import jacobians
from robotmodels.igm.motion import tool_poses as poses
from robotmodels.igm.postures import no_postures
from robotmodels.igm.self_motions import SelfMotions
from robotmodels.igm.singular import complete
from robotmodels.igm.solver import Tolerances, postures
from robotmodels.robots import load
from robotmodels.se3 import inverse

TOLERANCES = Tolerances()


@cache
def arm(name, backwards=False):
    chain = joint_chain(load(name))
    if backwards:
        chain = JointChain(
            chain.columns,
            np.ascontiguousarray(chain.sigma[::-1]),
            np.ascontiguousarray(inverse(chain.D)[::-1]),
            chain.base,
        )
    return chain, prepare(chain)


def settled(chain, solver, q, reference):
    """Postures of the poses of q; each meets its pose and is there once, packed."""
    U = poses(chain, q)
    references = np.full(q.shape, reference)
    found = postures(solver, U, references, TOLERANCES)
    out = complete(chain, U, found, references, TOLERANCES)
    assert np.all(np.diff(out.valid.astype(int), axis=1) <= 0)
    n, r = np.nonzero(out.valid)
    assert np.abs(missing(U[n], poses(chain, out.q[n, r]))).max() < 1e-12
    assert np.nanmax(out.residual) < 1e-12
    for i in range(len(q)):
        rows = out.q[i][out.valid[i]]
        gaps = apart(chain, rows[:, None], rows[None]) + np.eye(len(rows))
        assert gaps.min() > 1e-6
    assert not out.free[~out.family].any()
    assert np.all(out.moving >= out.free)
    assert np.all(out.moving.any(axis=-1) == out.family)
    return U, found, out


def agrees_with_search(chain, U, out, reference, rng):
    """Every posture a search finds at the values of the free joints is there."""
    count = 0
    for n in range(len(U)):
        members = out.q[n][out.family[n]]
        for free in np.unique(out.free[n][out.family[n]], axis=0):
            others = searched(chain, U[n], rng, free=free, values=reference)
            for one in others:
                assert apart(chain, one, out.q[n][out.valid[n]]).min() < 1e-5
            rows = members[(out.free[n][out.family[n]] == free).all(axis=1)]
            at_reference = np.abs(rows[:, free] - reference).max(axis=1) < 1e-9
            assert at_reference.sum() <= len(others)
            assert at_reference.any() == bool(others)
            count += len(others)
    return count


# --- which joint is free -------------------------------------------------------------------------


@pytest.mark.parametrize("reference", [0.0, 0.3, -2.0])
def test_what_the_closed_forms_settled_is_left_alone(reference, rng):
    chain, solver = arm("rx90")
    q = draw(chain, 5, rng)
    q[:, 4] = 0.0
    _, found, out = settled(chain, solver, q, reference)
    np.testing.assert_array_equal(found.q, out.q)
    assert out.family.sum() == 10
    np.testing.assert_array_equal(np.unique(out.free[out.family], axis=0), [[0, 0, 0, 1, 0, 0]])
    np.testing.assert_array_equal(np.unique(out.moving[out.family], axis=0), [[0, 0, 0, 1, 0, 1]])
    assert np.abs(out.q[out.family][:, 3] - reference).max() < 1e-15


def test_the_wrist_of_a_ur_frees_joint_two(rng):
    chain, solver = arm("ur5e")
    q = draw(chain, 6, rng)
    q[:, 4] = 0.0
    U, found, out = settled(chain, solver, q, 0.3)
    np.testing.assert_array_equal(np.unique(out.free[out.family], axis=0), [[0, 1, 0, 0, 0, 0]])
    np.testing.assert_array_equal(np.unique(out.moving[out.family], axis=0), [[0, 1, 1, 1, 0, 1]])
    # walking the curves from members elsewhere comes to the same postures
    moved = replace(found, free=np.zeros_like(found.free))
    again = complete(chain, U, moved, np.full((6, 6), 0.3), TOLERANCES)
    at = np.abs(out.q[..., 1] - 0.3) < 1e-9
    assert at[out.family].any()
    for n in range(6):
        for row in out.q[n][out.family[n] & at[n]]:
            assert apart(chain, row, again.q[n][again.valid[n]]).min() < 1e-7


@pytest.mark.parametrize("name", ["rx90", "irb140", "ur5e"])
def test_a_wrist_at_the_base_frees_the_first_joint(name, rng):
    chain, solver = arm(name, backwards=True)
    q = draw(chain, 4, rng)
    q[:, 1] = 0.0
    U, _, out = settled(chain, solver, q, 0.3)
    assert out.family.any(axis=1).all()
    assert np.all(out.free[out.family] == [1, 0, 0, 0, 0, 0])
    assert agrees_with_search(chain, U, out, 0.3, rng) >= 4


def test_a_closed_curve_ends_where_it_began(rng):
    chain, _ = arm("ur5e", backwards=True)
    q = draw(chain, 1, rng)
    q[:, 1] = 0.0
    U, points = poses(chain, q)[0], np.empty((2, 600, 6))
    along = SelfMotions(constraints(chain), U, np.zeros(6)).directions(q[0], 0)[0][0]
    count, closed = curve(chain.sigma, chain.D, U, q[0], along, 0, *points)
    assert closed
    gap = (points[0, count - 1] - q[0]) / (2 * np.pi)
    np.testing.assert_allclose(gap, gap.round(), rtol=0, atol=1e-9)


def shoulder_singular(chain, N, rng):
    """Postures of the RX-90 with the centre of the wrist on axis 1."""
    q = draw(chain, N, rng)
    bend = rng.uniform(-1.0, 1.0, N)
    # C2 D3 = S23 RL4 with D3 = RL4
    q[:, 1], q[:, 2] = (np.pi / 2 - bend) / 2, bend
    return q


@pytest.mark.parametrize("wrist", [0.0, 0.7])
def test_two_dimensions(wrist, rng):
    # the forearm of the RX-90 folded onto the upper arm: five axes meet in the shoulder
    chain, solver = arm("rx90", backwards=True)
    q = draw(chain, 2, rng)
    q[:, 3], q[:, 1] = -np.pi / 2, wrist
    U, _, out = settled(chain, solver, q, 0.3)
    assert np.all(out.free[out.family] == [1, 1, 0, 0, 0, 0])
    assert np.all(out.moving[out.family] == [1, 1, 1, 0, 1, 1])
    assert agrees_with_search(chain, U, out, 0.3, rng) >= 2


def test_a_stretched_elbow_adds_no_dimension(rng):
    chain, solver = arm("rx90", backwards=True)
    q = draw(chain, 3, rng)
    q[:, 3], q[:, 1] = np.pi / 2, 0.0
    _, _, out = settled(chain, solver, q, 0.3)
    assert np.all(out.free[out.family] == [1, 0, 0, 0, 0, 0])
    assert np.all(out.moving[out.family] == [1, 0, 1, 0, 0, 0])
    # facing the wrist and turned away from it, each once, though an elbow alone has two in one
    stretched = np.abs(out.q[..., 3] - np.pi / 2) < 1e-6
    np.testing.assert_array_equal(np.sum(out.family & stretched, axis=1), [2, 2, 2])
    assert np.all(out.family == out.valid)


# --- values that no posture has ------------------------------------------------------------------


def test_the_nearest_value_where_the_reference_is_out_of_reach(rng):
    chain, solver = arm("ur5e", backwards=True)
    q = draw(chain, 8, rng)
    q[:, 1], q[:, 2:5] = 0.0, 0.3 * q[:, 2:5]
    U, _, out = settled(chain, solver, q, 2.5)
    nearest = np.abs(np.remainder(out.q[..., 0] - 2.5 + np.pi, 2 * np.pi) - np.pi)
    short = np.argwhere(out.family & (nearest > 1e-6))
    assert len(short) > 1
    for n, r in short:
        # at a turning point the Jacobian of the other joints is singular
        J = jacobians(chain, out.q[n, r][None])[0]
        assert np.linalg.svd(J[:, 1:])[1][-1] < 1e-6
        closer = out.q[n, r, 0] + 1e-3 * np.sign(
            np.remainder(2.5 - out.q[n, r, 0] + np.pi, 2 * np.pi) - np.pi
        )
        free = np.arange(6) == 0
        for one in searched(chain, U[n], rng, 200, free, closer):
            assert apart(chain, one, out.q[n, r]) > 0.05


def test_prismatic_joints_that_make_up_for_each_other(rng):
    D = np.tile(np.eye(4), (4, 1, 1))
    D[2, 0, 3] = 0.4
    D[1, :3, 3] = 0.1, 0.2, 0.3
    chain = JointChain(np.arange(3), np.array([1, 1, 0]), D, np.eye(4))
    q = np.array([[0.4, -0.3, 0.5]])
    found = no_postures(1, 2, 3)
    found.q[0, 0], found.valid[0, 0], found.family[0, 0], found.residual[0, 0] = q, True, True, 0.0
    out = complete(chain, poses(chain, q), found, np.full((1, 3), 7.5), TOLERANCES)
    np.testing.assert_allclose(out.q[0, 0], [7.5, -7.4, 0.5], atol=1e-12)
    assert out.valid.sum() == 1
    np.testing.assert_array_equal(out.free[0, 0], [1, 0, 0])
    np.testing.assert_array_equal(out.moving[0, 0], [1, 1, 0])


# --- double roots and borders --------------------------------------------------------------------


def test_double_roots(rng):
    chain, solver = arm("rx90")
    q = draw(chain, 3, rng)
    q[1, 2] = -np.pi / 2  # stretched
    q[2, 2], q[2, 4] = -np.pi / 2, 0.0  # and a wrist aligned: half of them are a family
    out = settled(chain, solver, q, 0.0)[2]
    assert not out.double[~out.valid].any()
    assert not out.double[0].any()
    np.testing.assert_array_equal(out.double[1], out.valid[1])
    # a singular shoulder is a family, no double root
    assert not settled(chain, solver, shoulder_singular(chain, 2, rng), 0.0)[2].double.any()


@pytest.mark.parametrize("name", ["rx90", "ur5e"])
def test_whole_turns_of_the_reference_change_no_solution(name, rng):
    model = rm.load(name)
    for _ in range(20):
        q = rng.uniform(-2.8, 2.8, 6)
        q[3], q[4] = rng.choice([0.0, np.pi / 2, np.pi]), rng.choice([0.0, np.pi])
        T, reference = rm.dgm(model, q), rng.uniform(-3.0, 3.0, 6)
        turned = reference + 2 * np.pi * rng.integers(-1, 2, 6)
        found, again = (rm.igm(model, T, q_ref=ref).q for ref in (reference, turned))
        rows, others = (
            sorted(np.mod(x + 1e-7, 2 * np.pi).round(5).tolist()) for x in (found, again)
        )
        assert np.shape(rows) == np.shape(others)
        assert np.allclose(rows, others, atol=2e-5)
