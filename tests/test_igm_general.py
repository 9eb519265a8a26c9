"""The general six-joint inverse against printed postures, independent searches and itself."""

from functools import cache

import numpy as np
import pytest
from identities.chain_search import apart, draw, searched
from scipy.optimize import brentq

import robotmodels as rm
from robotmodels.igm.elimination import elimination_solutions, prepare_elimination
from robotmodels.igm.loop import JointChain, joint_chain
from robotmodels.igm.motion import tool_poses as poses
from robotmodels.robots import load

REVOLUTE = (0, 0, 0, 0, 0, 0)


# --- arms, their direct model and an independent search -----------------------------------------


def random_transform(rng):
    T = np.eye(4)
    T[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T[:3, 0] *= np.linalg.det(T[:3, :3])
    T[:3, 3] = rng.uniform(-0.5, 0.5, 3)
    return T


@cache
def random_arm(seed, sigma=REVOLUTE):
    rng = np.random.default_rng(seed)
    D = np.array([random_transform(rng) for _ in range(7)])
    return JointChain(np.arange(6), np.array(sigma, np.int64), D, np.eye(4))


@cache
def arm(name):
    return joint_chain(load(name))


@cache
def solver_of(chain):
    return prepare_elimination(chain)


def check(chain, U, q, valid, within=2e-13):
    """Every valid row meets its pose and is there once; the others are NaN."""
    assert np.all(np.isfinite(q) == valid[..., None])
    assert np.all(valid == (np.arange(valid.shape[1]) < valid.sum(axis=1)[:, None]))
    i, _ = np.nonzero(valid)
    np.testing.assert_allclose(poses(chain, q[valid]), U[i], rtol=0, atol=within)
    angles = q[valid][:, chain.sigma == 0]
    assert np.all((angles > -np.pi) & (angles <= np.pi))
    between = apart(chain, q[:, :, None], q[:, None]) + 10.0 * np.eye(q.shape[1])
    assert np.nanmin(between) > 1e-7


def lost(chain, wanted, q, valid, within=1e-6):
    """How many of ``wanted (N, 6)`` are not among the postures."""
    d = np.where(valid, apart(chain, np.nan_to_num(q), wanted[:, None]), np.inf)
    return int(np.sum(d.min(axis=1) > within))


# --- the literature ------------------------------------------------------------------------------

# Manocha and Canny 1994, table I (classical parameters), the hand and table III; problem 6 of
# C. Wampler and A. Morgan, Mechanism and Machine Theory 26(1), 1991. Degrees, two decimals.
MANOCHA_CANNY_HAND = np.array(
    [
        [-0.7601, -0.6416, 0.1022, -1.1401],
        [0.1333, 0.0, 0.9910, 0.0],
        [-0.6359, 0.7669, 0.0855, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
MANOCHA_CANNY = np.array(
    [
        [-96.28, -6.27, 179.96, 38.48, 52.55, -39.40],
        [-120.78, 172.33, -179.07, 31.33, -146.71, 142.82],
        [88.67, -176.72, -176.72, -63.24, 157.19, 140.43],
        [113.84, 5.30, -177.74, -55.92, -62.98, -43.37],
        [-178.12, 108.19, -147.73, -5.69, -164.67, 179.58],
        [168.32, -103.89, 146.60, -17.24, -171.87, 98.16],
        [-12.94, -105.09, -114.97, 3.02, 7.41, -79.42],
        [2.51, 108.07, 112.04, -10.52, 0.00, -0.10],
        [2.51, 108.07, -67.95, -169.47, 179.99, 179.89],
        [-12.94, -105.09, 65.02, 176.97, 172.58, 100.57],
        [168.32, -103.89, -33.39, -162.75, -8.12, -81.83],
        [-178.12, 108.19, 32.26, -174.30, -15.32, -0.41],
        [88.67, -176.72, 3.27, -116.75, 22.80, -39.56],
        [-96.28, -6.27, -0.03, 141.51, 127.44, 140.59],
        [-120.78, 172.33, 0.92, 148.66, -33.28, -37.17],
        [113.84, 5.30, 2.25, -124.07, -117.01, 136.62],
    ]
)


@cache
def manocha_canny():
    table, tool = rm.DHTable.from_standard(
        [
            {"theta": 0.0, "d": d, "a": a, "alpha": np.deg2rad(alpha)}
            for a, d, alpha in zip(
                (0.3, 1.0, 0.0, 1.5, 0, 0), (0, 0, 0.2, 0, 0, 0), (90, 1) * 3, strict=True
            )
        ]
    )
    return joint_chain(rm.RobotModel.from_table(table, tool=tool))


def test_the_sixteen_postures_of_manocha_and_canny():
    chain = manocha_canny()
    printed = np.deg2rad(MANOCHA_CANNY)
    T = poses(chain, printed)
    np.testing.assert_allclose(T, np.broadcast_to(MANOCHA_CANNY_HAND, T.shape), atol=4e-4)
    # The hand is printed to four decimals, the mean over the printed postures knows it better.
    U = np.mean(T, axis=0)
    V, _, W = np.linalg.svd(U[:3, :3])
    U[:3, :3] = V @ W
    q, valid = elimination_solutions(solver_of(chain), U[None])
    assert valid.all()
    check(chain, U[None], q, valid)
    d = apart(chain, q[0][:, None], printed[None])
    match = np.argmin(d, axis=1)
    assert sorted(match) == list(range(16))
    # degrees: the printed decimals, and their rounding seen through the Jacobian
    assert np.rad2deg(d.min(axis=1)).max() < 0.02


# --- random arms, and arms of the catalogue with an offset wrist ---------------------------------


@pytest.mark.parametrize(
    ("chain", "most"),
    [(random_arm(10, tuple(int(k == slide) for k in range(6))), 2) for slide in range(-1, 6)]
    + [(arm("crx10ia"), 16), (arm("crx10ia_l"), 16), (arm("xarm6"), 12)],
)
def test_random_poses_give_back_every_configuration(chain, most):
    solver = solver_of(chain)
    assert solver.missed == 0
    q0 = draw(chain, 300, np.random.default_rng(4))
    U = poses(chain, q0)
    q, valid = elimination_solutions(solver, U)
    check(chain, U, q, valid)
    assert lost(chain, q0, q, valid) == 0
    assert np.all(valid.sum(axis=1) % 2 == 0)
    assert valid.sum(axis=1).max() >= most
    one, alone = elimination_solutions(solver, U[200:201])
    assert alone.sum() == valid[200].sum()
    assert all(apart(chain, row, q[200][valid[200]]).min() < 1e-9 for row in one[0][alone[0]])


@pytest.mark.parametrize(("seed", "sigma"), [(0, REVOLUTE), (1, REVOLUTE), (2, (0, 1, 0, 0, 0, 0))])
@pytest.mark.nightly
def test_the_count_is_that_of_an_independent_search(seed, sigma, rng):
    chain = random_arm(seed, sigma)
    U = poses(chain, draw(chain, 2, np.random.default_rng(seed + 50)))
    q, valid = elimination_solutions(solver_of(chain), U)
    for n in range(2):
        others = searched(chain, U[n], rng, 3000)
        assert len(others) == valid[n].sum()
        nearest = [apart(chain, one, q[n][valid[n]]).min() for one in others]
        assert max(nearest) < 1e-6


# --- singular poses ------------------------------------------------------------------------------


@pytest.mark.parametrize("eps", [0.0, 1e-9, 1e-6, 1e-5, 1e-4, 1e-3])
def test_folds_of_random_arms(eps, rng):
    """Poses on and beside singular ones, where two solutions meet, by the direct model alone."""
    alpha, (d, r) = rng.uniform(0.3, 2.8, 6), rng.normal(0.0, 0.5, (2, 6))
    model = rm.RobotModel.from_table(
        rm.DHTable(antecedent=range(6), sigma=[0] * 6, alpha=alpha, d=d, r=r)
    )

    def determinant(t, a, way):
        return np.linalg.det(rm.jacobian(model, a + t * way))

    q0 = []
    while len(q0) < 40:
        line = rng.uniform(-np.pi, np.pi, 6), rng.uniform(-1.0, 1.0, 6)
        if determinant(0.0, *line) * determinant(1.0, *line) < 0.0:
            t = brentq(determinant, 0.0, 1.0, line, xtol=1e-15)
            q0.append(line[0] + (t + eps) * line[1])
    found = rm.igm(model, rm.dgm(model, q0))
    away = np.abs(np.remainder(found.q - np.array(q0)[:, None] + np.pi, 2 * np.pi) - np.pi)
    assert np.nanmin(away.max(axis=-1), axis=1).max() < (1e-5 if eps < 1e-5 else 1e-8)
    double = found.double.any(axis=1)
    if eps <= 1e-9:
        assert double.sum() >= 36
    if eps >= 1e-4:
        assert not double.any()
        assert (found.count % 2 == 0).all()


@pytest.mark.parametrize(("eps", "share"), [(1e-5, 0.15), (1e-4, 0.02), (3e-4, 0.0)])
def test_beside_a_self_motion(eps, share):
    """Axis 3 of the CRX at -90 deg brings four axes together, which turn with the tool at rest.

    The arm is stretched there: the pose changes with the square of eps, and solutions may be
    missed within some 1e-5 of it.
    """
    chain = arm("crx10ia")
    q0 = draw(chain, 200, np.random.default_rng(12))
    q0[:, 2] = -np.pi / 2 + eps
    U = poses(chain, q0)
    q, valid = elimination_solutions(solver_of(chain), U)
    check(chain, U, q, valid, within=1e-12)
    assert lost(chain, q0, q, valid, within=1e-5) <= share * 200


# --- borders -------------------------------------------------------------------------------------


def test_frames_far_out_on_their_axes():
    # as tables put them where the common normal of two axes is 5e4 m away
    chain = random_arm(7)
    assert prepare_elimination(arm("planar_3r")) is None
    assert prepare_elimination(random_arm(0, (1, 0, 1, 0, 0, 0))) is None
    D = chain.D.copy()
    slide = np.eye(4)
    slide[2, 3] = 5e4
    D[2], D[3] = D[2] @ slide, np.linalg.inv(slide) @ D[3]
    moved = JointChain(chain.columns, chain.sigma, D, chain.base)
    q0 = draw(chain, 50, np.random.default_rng(2))
    q, valid = elimination_solutions(prepare_elimination(moved), poses(chain, q0))
    assert lost(chain, q0, q, valid) == 0
