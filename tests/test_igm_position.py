"""Three joints for a position: every order of revolute and prismatic joints against a search."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import brentq

import robotmodels as rm
from robotmodels import se3

POSITION = [1, 1, 1, 0, 0, 0]
ORDERS = list(product((0, 1), repeat=3))
STRUCTURES = {
    "general": {},
    "first axes parallel": {(1, "alpha"): 0.0},
    "last axes parallel": {(2, "alpha"): 0.0},
    "first axes meet": {(1, "d"): 0.0},
    "last axes meet": {(2, "d"): 0.0},
    "elbow arm": {(1, "alpha"): np.pi / 2, (1, "d"): 0.0, (2, "alpha"): 0.0},
}


def arm(order, rng, structure="general"):
    names = ("alpha", "d", "theta", "r")
    rows = [
        {"sigma": kind, **dict(zip(names, rng.uniform(0.3, 1.2, 4), strict=True))} for kind in order
    ]
    for (row, name), value in STRUCTURES[structure].items():
        rows[row][name] = value
    table = rm.DHTable.from_rows(rows)
    return rm.RobotModel.from_table(table, tool=se3.translation(*rng.uniform(0.2, 0.8, 3)))


def difference(model, a, b):
    turning = model.table.sigma == 0
    d = np.abs(np.where(turning, (a - b + np.pi) % (2.0 * np.pi) - np.pi, a - b))
    return d.max(axis=-1)


def searched(model, p, rng, starts=400):
    """Configurations by Newton's method from many random starts."""
    q = np.where(
        model.table.sigma == 0,
        rng.uniform(-np.pi, np.pi, (starts, 3)),
        rng.uniform(-4.0, 4.0, (starts, 3)),
    )
    for _ in range(50):
        e = p - rm.dgm(model, q)[:, :3, 3]
        step = (np.linalg.pinv(rm.jacobian(model, q)[:, :3], rcond=1e-12) @ e[..., None])[..., 0]
        q = q + step * np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=1), 1e-9))[:, None]
    met = np.linalg.norm(rm.dgm(model, q)[:, :3, 3] - p, axis=1) < 1e-10
    found = []
    for row in q[met]:
        if all(difference(model, row, other) > 1e-5 for other in found):
            found.append(row)
    return np.array(found)


@pytest.mark.sampled(12)
@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("order", ORDERS, ids=str)
def test_all_solutions_are_found(order, structure):
    """As many as an independent search finds, the generating one among them."""
    rng = np.random.default_rng([*order, list(STRUCTURES).index(structure)])
    model = arm(order, rng, structure)
    q0 = rng.uniform(-1.5, 1.5, (20, 3))
    T = rm.dgm(model, q0)
    T[:, :3, :3] = np.eye(3)
    redundant = np.linalg.matrix_rank(rm.jacobian(model, q0[0])[:3], tol=1e-9) < 3
    found = rm.igm(model, T[:1] if redundant else T, mask=POSITION)
    assert ("quartic" in found.method) == (not redundant)
    if redundant:
        assert found.count[0] > 0
        return
    i, _ = np.nonzero(found.valid)
    p = rm.dgm(model, found.q[found.valid])[:, :3, 3]
    np.testing.assert_allclose(p, T[i, :3, 3], atol=1e-11)
    assert np.nanmin(difference(model, found.q, q0[:, None]), axis=1).max() < 1e-6
    assert not found.double.any()
    assert len(searched(model, T[0, :3, 3], rng)) == found.count[0]


@pytest.mark.parametrize("order", [(0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0)], ids=str)
def test_two_solutions_in_one_are_double(order):
    """Where the determinant of the Jacobian changes sign two solutions merge."""
    rng = np.random.default_rng(3)
    model = arm(order, rng)

    def determinant(q):
        return np.linalg.det(rm.jacobian(model, q)[:3])

    tried = 0
    while tried < 10:
        a = rng.uniform(-3.0, 3.0, 3)
        b = a + rng.uniform(-1.0, 1.0, 3)
        if determinant(a) * determinant(b) < 0.0:
            t = brentq(lambda t, a=a, b=b: determinant(a + t * (b - a)), 0.0, 1.0, xtol=1e-15)
            q = a + t * (b - a)
            found = rm.igm(model, rm.dgm(model, q), mask=POSITION)
            away = difference(model, found.q, q)
            near = found.valid & (away < 1e-3)
            assert np.nanmin(away) < 3e-6
            assert found.double[near].any() or near.sum() == 2
            assert (found.valid & ~near).sum() % 2 == 0
            tried += 1


def test_first_joint_is_free_where_the_point_is_on_its_axis():
    rows = [{"sigma": 0}, {"sigma": 0, "alpha": np.pi / 2}, {"sigma": 0, "d": 0.5}]
    table = rm.DHTable.from_rows(rows)
    model = rm.RobotModel.from_table(table, tool=se3.translation(0.5, 0.0, 0.0))
    q = np.array([0.7, np.pi / 2 - 0.4, 0.8])
    found = rm.igm(model, rm.dgm(model, q), q_ref=q, mask=POSITION)
    assert found.status == rm.IGMStatus.REACHED_FAMILY
    assert found.free_joints[found.valid].tolist() == [[True, False, False]] * int(found.count)
    assert difference(model, found.nearest(q), q) < 1e-9
    np.testing.assert_allclose(found.q[:, 0], 0.7)
