"""Singular positions as formulas, against numbers and published factors."""

import pickle

import numpy as np
import pytest
from identities.random_robots import random_model

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.kinematics import SingularityKind
from robotmodels.symbolic import FormulaStatus, explain_singularities, singularity_map

CATALOGUE = [name for name in rm.robots() if not name.startswith("erd:")]
SIX = [name for name in CATALOGUE if rm.load(name).n == 6]
SHOULDER, ELBOW, WRIST = SingularityKind.SHOULDER, SingularityKind.ELBOW, SingularityKind.WRIST


def explained(name):
    return explain_singularities(rm.load(name))


def postures(model, rng, count):
    q = rng.uniform(-np.pi, np.pi, size=(count, model.n))
    prismatic = model.table.sigma[model.table.joint_rows] == 1
    return np.where(prismatic, rng.uniform(0.1, 0.9, size=q.shape), q)


@pytest.mark.parametrize("name", SIX)
def test_factors_and_their_zeros(name, rng):
    """The product is the determinant; where a factor is solved for a joint, rank is lost."""
    model, e = rm.load(name), explained(name)
    q = postures(model, rng, 200)
    D = np.linalg.det(rm.jacobian(model, q))
    np.testing.assert_allclose(e.determinant(q), D, rtol=0, atol=1e-12 * np.abs(D).max())
    product = np.prod(e.values(q) ** [f.power for f in e.factors], axis=-1)
    np.testing.assert_allclose(e.constant * product, D, rtol=0, atol=1e-12 * np.abs(D).max())
    checked = 0
    for factor in e.factors:
        q = postures(model, rng, 40)
        for zeros in factor.zeros(q).T:
            at, found = q.copy(), ~np.isnan(zeros)
            at[:, factor.solved_joint] = zeros
            at = at[found]
            np.testing.assert_allclose(factor.values(at), 0.0, atol=2e-8)
            smallest = np.linalg.svd(rm.jacobian(model, at), compute_uv=False)[:, -1]
            assert (smallest < 1e-7).all()
            checked += len(at)
    assert checked >= 30


ELBOWS = {
    "rx90": ("S23*RL4 - C2*D3", "C3"),
    "tx40": ("S23*RL4 + S2*D3", "S3"),
    "puma560": ("S23*RL4 - C23*D4 - C2*D3", "C3*RL4 + S3*D4"),
    "kr6_r900": ("D2 - C23*RL4 + S23*D4 + C2*D3", "S3*RL4 + C3*D4"),
    "irb140": ("D2 + C23*RL4 + S2*D3", "C3"),
    "irb6640": ("D2 + C23*RL4 + S23*D4 + S2*D3", "C3*RL4 + S3*D4"),
    "ur5e": ("S234*RL5 + C23*D4 + C2*D3", "S3"),
    "ur10e": ("S234*RL5 + C23*D4 + C2*D3", "S3"),
}


@pytest.mark.parametrize("name", ELBOWS)
def test_shoulder_elbow_wrist(name):
    e, (shoulder, elbow) = explained(name), ELBOWS[name]
    assert e.status is FormulaStatus.FACTORED
    assert {(f.kind, f.text) for f in e.factors} == {
        (SHOULDER, shoulder), (ELBOW, elbow), (WRIST, "S5"),
    }  # fmt: skip
    wrist = e.factor(WRIST)
    assert wrist.solution == "θ5 = 0 or π"
    assert wrist.meaning == f"axes 4 and 6 are {'parallel' if 'ur' in name else 'aligned'}"
    assert wrist.joints == (4,)
    assert "stretched or folded" in e.factor(ELBOW).meaning
    assert "axis 1" in e.factor(SHOULDER).meaning
    assert e.factor(SHOULDER).unit == "m"


OTHERS = {
    "gantry": ({"S5"}, "all six rows"),
    "stanford_arm": ({"S2", "S5", "r3"}, "all six rows"),
    "cobra_s600": ({"S2"}, "rows that are not zero, vx, vy, vz and w"),
    "planar_3r": ({"S2"}, ""),
    "planar_2r": ({"S2"}, "position"),
    "lab_rr": ({"C2"}, "position"),
    "lab_rrt": ({"C2", "r3"}, "position"),
    "lab_trr": ({"S3"}, "position"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_arms(name, rng):
    model, e, (texts, task) = rm.load(name), explained(name), OTHERS[name]
    assert {f.text for f in e.factors} == texts
    assert task in e.task
    if name == "stanford_arm":
        assert {f.text: f.power for f in e.factors}["r3"] == 2
    if task == "position":  # to its sign; of two joints, the area of the two columns
        q = postures(model, rng, 50)
        J = rm.jacobian(model, q)[:, :3]
        area = np.sqrt(np.linalg.det(np.swapaxes(J, 1, 2) @ J))
        np.testing.assert_allclose(np.abs(e.determinant(q)), area, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["crx10ia", "xarm6"])
def test_determinants_that_do_not_factor(name):
    e = explained(name)
    assert e.status is FormulaStatus.NOT_FACTORED
    assert "does not factor" in e.text
    assert [f.solved_joint is not None for f in e.factors] == [True]


@pytest.mark.parametrize("name", ["iiwa14", "lwr4_plus"])
def test_seven_joints_with_spherical_shoulder_and_wrist(name):
    """M. Shimizu et al., "Analytical inverse kinematic computation for 7-DOF redundant
    manipulators with joint limits", 2008: the elbow stretched, and pairs of joints."""
    e = explained(name)
    assert e.status is FormulaStatus.MINORS
    assert {c.text for c in e.conditions} == {
        "S4 = 0", "S2 = 0 and C3 = 0", "S2 = 0 and S6 = 0", "C5 = 0 and S6 = 0",
    }  # fmt: skip
    assert [c.kind for c in e.conditions][:2] == [ELBOW, SHOULDER]
    assert "without joint 1: " in e.text
    with pytest.raises(InvalidValueError, match="no determinant"):
        e.determinant(np.zeros(7))


@pytest.mark.parametrize("name", ["iiwa14", "xarm5"])
def test_conditions_are_where_rank_is_lost(name, rng):
    model, e = rm.load(name), explained(name)
    full = min(6, model.n)

    def above(q):
        return np.linalg.svd(rm.jacobian(model, q), compute_uv=False)[:, full - 1]

    for condition in e.conditions:
        q = postures(model, rng, 60)
        # in this order none moves a joint of one that is solved already
        for factor in sorted(condition.factors, key=lambda f: len(f.joints)):
            q[:, factor.solved_joint] = factor.zeros(q)[:, rng.integers(0, 2)]
            q = q[~np.isnan(q).any(axis=1)]
        q = q[condition.holds(q, 1e-8)]
        assert len(q) >= 10
        assert above(q).max() < 1e-7
        # one factor less is not enough
        for factor in condition.factors if len(condition.factors) > 1 else ():
            moved = q.copy()
            moved[:, factor.solved_joint] += 0.4
            rest = [f for f in condition.factors if f is not factor]
            kept = np.all([np.abs(f.values(moved)) < 1e-8 for f in rest], axis=0)
            others = [c for c in e.conditions if c is not condition]
            free = kept & ~np.any([c.holds(moved, 0.05) for c in others], axis=0)
            assert (above(moved[free]) > 1e-4).all()
    assert len(e.conditions) >= 2


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_random_arms(seed):
    """No structure at all: still the determinant, written out or from the matrix."""
    rng = np.random.default_rng(seed)
    model = random_model(rng, f=6, prismatic=bool(seed % 2), inertia=None)
    e = explain_singularities(model)
    q = postures(model, rng, 30)
    J = rm.jacobian(model, q)
    if e.status is FormulaStatus.NEVER_FULL_RANK:
        assert np.linalg.svd(J, compute_uv=False)[:, -1].max() < 1e-8
        np.testing.assert_array_equal(e.determinant(q), 0.0)
    else:
        size = np.prod(np.linalg.norm(J, axis=1), axis=-1).max()
        np.testing.assert_allclose(e.determinant(q), np.linalg.det(J), rtol=0, atol=1e-14 * size)


@pytest.mark.nightly
def test_products_are_taken_apart():
    e = explained("panda")
    assert e.status is FormulaStatus.MINORS
    assert len(e.factors) == 12
    assert sum(len(f.text) < 80 for f in e.factors) == 6


def test_always_singular():
    """The first two axes coincide."""
    rows = [{}, {}, {"alpha": 1.0}, {"d": 0.4}, {"alpha": -1.0, "r": 0.3}, {"alpha": 1.0}]
    e = explain_singularities(rm.RobotModel.from_table(rm.DHTable.from_rows(rows)))
    assert (e.status, e.determinant(np.zeros(6))) == (FormulaStatus.NEVER_FULL_RANK, 0.0)


def test_batches_pickles_and_mistakes():
    e = explained("rx90")
    q = np.random.default_rng(0).normal(size=(2, 3, 6))
    for function in (e.values, e.determinant, e.factors[0].values, e.factors[0].zeros):
        np.testing.assert_array_equal(function(q)[1, 2], function(q[1, 2]))
        assert function(q[:0]).shape == (0, *function(q).shape[1:])
    again = pickle.loads(pickle.dumps(e))
    np.testing.assert_array_equal(again.values(q), e.values(q))
    with pytest.raises(ShapeError):
        e.values(np.zeros(5))
    assert e.factor("elbow") is e.factor(ELBOW)
    with pytest.raises(InvalidValueError, match="0 factors"):
        e.factor(SingularityKind.OTHER)


# --- maps ----------------------------------------------------------------------------------------


def test_map_of_the_determinant_and_of_a_factor():
    model = rm.load("rx90")
    at = np.array([0.3, 0.1, 0.2, 0.4, 0.9, 0.6])
    grid = singularity_map(model, (1, "joint_3"), at, (7, 9))
    assert (grid.names, grid.joints.tolist()) == (("joint_2", "joint_3"), [1, 2])
    np.testing.assert_allclose(grid.first[[0, -1]], [-np.pi, np.pi])
    limited = rm.load("irb120")
    axis = singularity_map(limited, (1, 2), samples=(2, 2)).second
    np.testing.assert_allclose(axis, [limited.lower[2], limited.upper[2]])
    q = np.tile(at, (7, 9, 1))
    q[..., 1], q[..., 2] = grid.first[:, None], grid.second
    np.testing.assert_allclose(grid.values, np.linalg.det(rm.jacobian(model, q)), atol=1e-14)
    elbow = singularity_map(model, (1, 2), at, (3, 5), ELBOW, [[0, 1], [0, 2]])
    np.testing.assert_allclose(elbow.values, np.tile(np.cos(np.linspace(0, 2, 5)), (3, 1)))
    assert (elbow.label, elbow.units) == ("elbow: C3", ("rad", "rad", "1"))
    shoulder = explained("rx90").factor(SHOULDER)
    assert singularity_map(model, (1, 2), at, (3, 5), shoulder).units[2] == "m"


def test_mistakes_in_a_map_are_refused():
    wrong = [(1, 1), (1, 6), (1,), "ab", 1, None, {1, 2}, (1, "elbow"), (True, 2), (1.5, 2)]
    cases = [{"joints": joints} for joints in wrong]
    cases += [{"samples": (0, 3)}, {"samples": 5}, {"ranges": [[1, 0], [0, 1]]}]
    cases += [{"at": np.zeros((2, 6))}, {"factor": SingularityKind.OTHER}]
    for arguments in cases:
        with pytest.raises((InvalidValueError, ShapeError)):
            singularity_map(rm.load("rx90"), **{"joints": (1, 2), **arguments})
