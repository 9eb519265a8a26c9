"""The Jacobian and its singular positions as formulas, against numbers."""

import gc
import math
import pickle
import sys

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from identities.random_robots import models, random_model, random_state, robot_size

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.kinematics.factors import jacobian_factors
from robotmodels.kinematics.formulas._chain import SymbolicChain
from robotmodels.kinematics.formulas._collect import formula
from robotmodels.kinematics.formulas._factoring import factored
from robotmodels.kinematics.formulas.explain_jacobian import explain_jacobian
from robotmodels.kinematics.formulas.explain_singularities import explain_singularities
from robotmodels.kinematics.formulas.singularity_explanation import (
    FormulaStatus,
    SingularityKind,
)
from robotmodels.kinematics.formulas.singularity_map import singularity_map

CATALOGUE = [name for name in rm.robots() if not name.startswith("erd:")]
SIX = [name for name in CATALOGUE if rm.load(name).n == 6]
SHOULDER, ELBOW, WRIST = SingularityKind.SHOULDER, SingularityKind.ELBOW, SingularityKind.WRIST


@pytest.fixture(scope="module")
def explained():
    """Explanations of singular positions, each made once."""
    known = {}

    def explain(name):
        if name not in known:
            known[name] = explain_singularities(rm.load(name))
        return known[name]

    return explain


def postures(model, rng, count):
    q = rng.uniform(-np.pi, np.pi, size=(count, model.n))
    prismatic = model.table.sigma[model.table.joint_rows] == 1
    return np.where(prismatic, rng.uniform(0.1, 0.9, size=q.shape), q)


def factor_texts(explanation):
    return {(f.kind.value, f.text) for f in explanation.factors}


# --- the three matrices --------------------------------------------------------------------------


def test_rx90_is_the_books_third_matrix():
    J = explain_jacobian(rm.load("rx90"))
    assert (J.projection, J.intermediate) == ("R_3", "R_4")
    C2, C3, S3, C4, S4, C5, S5, C23, S23, D3, RL4 = sympy.symbols(
        "C2 C3 S3 C4 S4 C5 S5 C23 S23 D3 RL4"
    )
    expected = sympy.Matrix(
        [
            [0, S3 * D3 - RL4, -RL4, 0, 0, 0],
            [0, C3 * D3, 0, 0, 0, 0],
            [S23 * RL4 - C2 * D3, 0, 0, 0, 0, 0],
            [S23, 0, 0, 0, S4, -C4 * S5],
            [C23, 0, 0, 1, 0, C5],
            [0, 1, 1, 0, C4, S4 * S5],
        ]
    )
    assert sympy.expand(J.reduced - expected) == sympy.zeros(6)
    assert J.lever == sympy.zeros(3, 1)
    assert J.second == sympy.eye(6)
    assert J.first[:3, :3] == J.rotation == J.first[3:, 3:]
    assert "3J6,4" in J.text
    assert "⎢ S23*RL4 - C2*D3             0     0  0   0       0 ⎥" in str(J)


@pytest.mark.parametrize("name", CATALOGUE)
def test_formulas_of_the_catalogue(name, rng):
    model = rm.load(name)
    q = postures(model, rng, 5)
    explanation = explain_jacobian(model)
    numbers = explanation.evaluate(q)
    np.testing.assert_allclose(numbers.jacobian, rm.jacobian(model, q), rtol=0, atol=1e-13)
    i, j = (int(frame[2:]) for frame in (explanation.projection, explanation.intermediate))
    factors = jacobian_factors(model, q, i, j)
    for part in ("rotation", "transport", "reduced"):
        np.testing.assert_allclose(getattr(numbers, part), getattr(factors, part), atol=1e-13)


def test_pairs_of_frames(rng):
    model = rm.load("puma560").with_base(rm.se3.from_rpy([0.1, 0.2, 0.3], [1, 2, 3]))
    model = model.with_tool(rm.se3.from_rpy([0.3, 0.1, -0.2], [0.1, 0, 0.2]))
    q = postures(model, rng, 3)
    for i, j in ((0, 0), (0, 6), (2, 4), (6, 0), (3, 6)):
        numbers = explain_jacobian(model, i, j).evaluate(q)
        factors = jacobian_factors(model, q, i, j)
        for part in ("rotation", "transport", "reduced"):
            np.testing.assert_allclose(getattr(numbers, part), getattr(factors, part), atol=1e-12)


@settings(max_examples=8)
@given(model=models(max_frames=5, inertia="physical"))
def test_formulas_of_random_robots(model):
    rng = np.random.default_rng(0)
    q, *_ = random_state(model, rng, 2)
    i, j = rng.integers(0, model.f + 1, size=2)
    size = max(robot_size(model, row) for row in q)
    for pair in ((None, None), (int(i), int(j))):
        explanation = explain_jacobian(model, *pair)
        np.testing.assert_allclose(
            explanation.evaluate(q).jacobian, rm.jacobian(model, q), rtol=0, atol=2e-12 * size
        )
        latex = explanation.latex
        assert latex.count("{") == latex.count("}")
        assert latex.count(r"\begin{") == latex.count(r"\end{")


def test_long_entries_are_nested():
    """Oblique axes everywhere: partial results get names, and the numbers stay right."""
    rng = np.random.default_rng(8)
    rows = [
        {"sigma": int(k == 3), "alpha": a, "d": d, "theta": t, "r": r}
        for k, (a, d, t, r) in enumerate(rng.uniform(0.2, 1.2, size=(8, 4)))
    ]
    model = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
    q = postures(model, rng, 3)
    for pair in ((None, None), (0, 0), (8, 8), (0, 8)):
        explanation = explain_jacobian(model, *pair)
        np.testing.assert_allclose(
            explanation.evaluate(q).jacobian, rm.jacobian(model, q), rtol=0, atol=1e-12
        )
        assert max(len(str(entry)) for entry in explanation.reduced) < 4000


def test_the_text_is_python(rng):
    """Every entry can be pasted into a program."""
    model = rm.load("xarm6")
    explanation = explain_jacobian(model, 0, 0)
    q = postures(model, rng, 1)[0]
    known = {s.name: value for s, value in explanation.numbers.constants}
    known |= {f"θ{k + 1}": x for k, x in enumerate(q)}
    known |= {"cos": math.cos, "sin": math.sin, "π": math.pi}
    column, found = None, {}
    for line in explanation.text.splitlines():
        left, _, right = line.partition(" = ")
        if line.startswith("  joint"):
            column = int(line.split()[1]) - 1
        elif line.startswith(("    v", "    w")):
            row = ("vx", "vy", "vz", "wx", "wy", "wz").index(left.strip())
            found[row, column] = eval(right, known)
        elif line.startswith("  ") and right and column is None and "(" not in left:
            known.setdefault(left.strip(), eval(right.split(" m ")[0].split(" rad ")[0], known))
    J = jacobian_factors(model, q, 0, 0).reduced
    assert len(found) >= 20
    for (row, k), value in found.items():
        assert value == pytest.approx(J[row, k], abs=1e-12)


def test_frames_of_the_matrices_are_checked():
    model = rm.load("rx90")
    with pytest.raises(rm.errors.FrameNotFoundError):
        explain_jacobian(model, 9)
    tool = model.with_tool(rm.se3.translation(0, 0, 0.1))
    at_tool = explain_jacobian(tool, 3, "tool")
    assert at_tool.lever == sympy.zeros(3, 1)
    q = np.linspace(0.1, 0.6, 6)
    np.testing.assert_allclose(
        at_tool.evaluate(q).jacobian, rm.jacobian(tool, q), rtol=0, atol=1e-13
    )
    panda = rm.load("erd:panda")
    fixed = next(
        name
        for name in panda.frame_names
        if panda.twin.frame(name).position.any() and name != panda.twin.names.tool
    )
    with pytest.raises(InvalidValueError, match="jacobian_factors"):
        explain_jacobian(panda, fixed)
    assert explain_jacobian(model, symbols={"RL4": "l4"}).text.count("l4") > 2
    with pytest.raises(InvalidValueError, match="does not occur"):
        explain_jacobian(model, symbols={"RL9": "l"})


# --- singular positions --------------------------------------------------------------------------


@pytest.mark.parametrize("name", SIX)
def test_product_of_factors_is_the_determinant(name, explained, rng):
    model, e = rm.load(name), explained(name)
    q = postures(model, rng, 200)
    D = np.linalg.det(rm.jacobian(model, q))
    np.testing.assert_allclose(e.determinant(q), D, rtol=0, atol=1e-12 * np.abs(D).max())
    product = np.prod(e.values(q) ** [f.power for f in e.factors], axis=-1)
    np.testing.assert_allclose(e.constant * product, D, rtol=0, atol=1e-12 * np.abs(D).max())


@pytest.mark.parametrize(
    ("name", "shoulder", "elbow"),
    [
        ("rx90", "S23*RL4 - C2*D3", "C3"),
        ("tx40", "S23*RL4 + S2*D3", "S3"),
        ("puma560", "S23*RL4 - C23*D4 - C2*D3", "C3*RL4 + S3*D4"),
        ("kr6_r900", "D2 - C23*RL4 + S23*D4 + C2*D3", "S3*RL4 + C3*D4"),
        ("irb140", "D2 + C23*RL4 + S2*D3", "C3"),
        ("irb6640", "D2 + C23*RL4 + S23*D4 + S2*D3", "C3*RL4 + S3*D4"),
        ("ur5e", "S234*RL5 + C23*D4 + C2*D3", "S3"),
        ("ur10e", "S234*RL5 + C23*D4 + C2*D3", "S3"),
    ],
)
def test_shoulder_elbow_wrist(name, shoulder, elbow, explained):
    e = explained(name)
    assert e.status is FormulaStatus.FACTORED
    assert factor_texts(e) == {("shoulder", shoulder), ("elbow", elbow), ("wrist", "S5")}
    assert e.factor(WRIST).solution == "θ5 = 0 or π"
    spherical = "parallel" if name.startswith("ur") else "aligned"
    assert e.factor(WRIST).meaning == f"axes 4 and 6 are {spherical}"
    assert "stretched or folded" in e.factor(ELBOW).meaning
    assert "axis 1" in e.factor(SHOULDER).meaning
    assert e.factor(WRIST).joints == (4,)
    assert e.factor(SHOULDER).unit == "m"


def test_rx90_text(explained):
    text = str(explained("rx90"))
    assert "Its determinant is -D3*RL4 * (S23*RL4 - C2*D3) * C3 * S5" in text
    assert "θ2 = atan2(D3 - S3*RL4, C3*RL4) or that plus π" in text
    latex = explained("rx90").latex
    assert r"S_{23} \, RL_{4} - C_{2} \, D_{3} = 0" in latex
    assert latex.count("{") == latex.count("}")
    assert explained("rx90")._repr_markdown_().startswith("**Singular positions of rx90")


def test_other_arms(explained):
    assert factor_texts(explained("gantry")) == {("wrist", "S5")}
    stanford = explained("stanford_arm")
    assert {(f.text, f.power) for f in stanford.factors} == {("S2", 1), ("S5", 1), ("r3", 2)}
    assert factor_texts(explained("cobra_s600")) == {("elbow", "S2")}
    assert "rows that are not zero, vx, vy, vz and w" in explained("cobra_s600").task
    assert factor_texts(explained("planar_3r")) == {("elbow", "S2")}
    for name, texts in {
        "planar_2r": {"S2"}, "lab_rr": {"C2"}, "lab_rrt": {"C2", "r3"}, "lab_trr": {"S3"},
    }.items():  # fmt: skip
        assert {f.text for f in explained(name).factors} == texts
        assert "position" in explained(name).task


@pytest.mark.parametrize("name", ["planar_2r", "lab_rr", "lab_rrt", "lab_trr"])
def test_positioners_lose_their_position(name, explained, rng):
    """The determinant of the position Jacobian, to its sign; of two joints, its area."""
    model, e = rm.load(name), explained(name)
    q = postures(model, rng, 50)
    J = rm.jacobian(model, q)[:, :3]
    area = np.sqrt(np.linalg.det(np.swapaxes(J, 1, 2) @ J))
    np.testing.assert_allclose(np.abs(e.determinant(q)), area, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["crx10ia", "xarm6"])
def test_arms_whose_determinant_does_not_factor_say_so(name, explained):
    e = explained(name)
    assert e.status is FormulaStatus.NOT_FACTORED
    assert "does not factor" in e.text
    assert len(e.factors) == 1
    assert e.factors[0].solved_joint is not None


@pytest.mark.parametrize("name", SIX)
def test_zeros_are_singular(name, explained, rng):
    """Where a factor is solved for a joint, the Jacobian loses rank there."""
    model, e = rm.load(name), explained(name)
    checked = 0
    for factor in e.factors:
        q = postures(model, rng, 40)
        zeros = factor.zeros(q)
        for side in range(2):
            found = ~np.isnan(zeros[:, side])
            at = q[found]
            at[:, factor.solved_joint] = zeros[found, side]
            if not len(at):
                continue
            np.testing.assert_allclose(factor.values(at), 0.0, atol=2e-8)
            smallest = np.linalg.svd(rm.jacobian(model, at), compute_uv=False)[:, -1]
            assert smallest.max() < 1e-7
            checked += len(at)
    assert checked >= 30


@pytest.mark.parametrize("name", ["iiwa14", "lwr4_plus"])
def test_seven_joints_with_spherical_shoulder_and_wrist(name, explained):
    """M. Shimizu et al., "Analytical inverse kinematic computation for 7-DOF redundant
    manipulators with joint limits", 2008: the elbow stretched, and pairs of joints."""
    e = explained(name)
    assert e.status is FormulaStatus.MINORS
    assert {c.text for c in e.conditions} == {
        "S4 = 0", "S2 = 0 and C3 = 0", "S2 = 0 and S6 = 0", "C5 = 0 and S6 = 0",
    }  # fmt: skip
    assert [c.kind for c in e.conditions][:2] == [ELBOW, SHOULDER]
    with pytest.raises(InvalidValueError, match="no determinant"):
        e.determinant(np.zeros(7))


@pytest.mark.parametrize("name", ["iiwa14", "lwr4_plus", "xarm5"])
def test_conditions_are_where_rank_is_lost(name, explained, rng):
    model, e = rm.load(name), explained(name)
    full = min(6, model.n)
    for condition in e.conditions:
        q = postures(model, rng, 60)
        # in this order none moves a joint of one that is solved already
        for factor in sorted(condition.factors, key=lambda f: len(f.joints)):
            side = rng.integers(0, 2)
            q[:, factor.solved_joint] = factor.zeros(q)[:, side]
            q = q[~np.isnan(q).any(axis=1)]
        q = q[condition.holds(q, 1e-8)]
        assert len(q) >= 10
        s = np.linalg.svd(rm.jacobian(model, q), compute_uv=False)
        assert s[:, full - 1].max() < 1e-7
        # one factor less is not enough
        for factor in condition.factors if len(condition.factors) > 1 else ():
            moved = q.copy()
            moved[:, factor.solved_joint] += 0.4
            rest = [f for f in condition.factors if f is not factor]
            kept = np.all([np.abs(f.values(moved)) < 1e-8 for f in rest], axis=0)
            others = [c for c in e.conditions if c is not condition]
            free = kept & ~np.any([c.holds(moved, 0.05) for c in others], axis=0)
            s = np.linalg.svd(rm.jacobian(model, moved[free]), compute_uv=False)
            assert (s[:, full - 1] > 1e-4).all()
    assert len(e.conditions) >= 2


def test_singular_positions_found_in_numbers_fulfil_a_condition(explained, rng):
    """Independently: minimise the smallest singular value, and look which condition holds."""
    from scipy.optimize import minimize

    model, e = rm.load("iiwa14"), explained("iiwa14")

    def smallest(q):
        return np.linalg.svd(rm.jacobian(model, q), compute_uv=False)[-1]

    found = 0
    for q in postures(model, rng, 12):
        result = minimize(smallest, q, method="Nelder-Mead", options={"maxiter": 1500})
        if result.fun < 1e-5:
            found += 1
            assert any(c.holds(result.x, 0.02) for c in e.conditions)
    assert found >= 3


def test_base_and_tool_do_not_matter(explained):
    model = rm.load("irb120")
    moved = model.with_base(rm.se3.from_rpy([0.3, -0.4, 0.5], [1, 2, 3]))
    moved = moved.with_tool(rm.se3.from_rpy([0.1, 0.2, 0.3], [0.1, 0.2, 0.3]))
    assert factor_texts(explain_singularities(moved)) == factor_texts(explained("irb120"))


def test_trees_and_fixed_frames(rng):
    """An arm on a branch, behind a fixed frame: its joints alone count."""
    rows = [
        {"sigma": 1, "antecedent": 0, "d": 0.2},
        {"sigma": 2, "antecedent": 0, "alpha": 0.3, "d": 0.1},
        {"sigma": 0, "antecedent": 2, "alpha": 0.4},
        {"sigma": 0, "antecedent": 3, "alpha": np.pi / 2},
        {"sigma": 0, "antecedent": 1, "r": 0.3},
        {"sigma": 0, "antecedent": 4, "d": 0.5},
        {"sigma": 0, "antecedent": 6, "alpha": -np.pi / 2, "r": 0.4},
        {"sigma": 0, "antecedent": 7, "alpha": np.pi / 2},
        {"sigma": 0, "antecedent": 8, "alpha": -np.pi / 2},
    ]
    model = rm.RobotModel.from_table(rm.DHTable.from_rows(rows), tip=9)
    e = explain_singularities(model)
    assert {f.kind for f in e.factors} == {SHOULDER, ELBOW, WRIST}
    assert e.factor(WRIST).joints == (6,)
    q = rng.uniform(-3, 3, size=(50, 8))
    moving = [1, 2, 4, 5, 6, 7]
    D = np.linalg.det(rm.jacobian(model, q)[..., moving])
    np.testing.assert_allclose(e.determinant(q), D, rtol=0, atol=1e-13)
    other = explain_singularities(model, 5)
    assert other.status is not FormulaStatus.NO_JOINTS
    none = explain_singularities(model, 2)
    assert none.status is FormulaStatus.NO_JOINTS
    assert none.values(q).shape == (50, 0)


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_random_arms(seed):
    """No structure at all: still the determinant, written out or from the matrix."""
    rng = np.random.default_rng(seed)
    model = random_model(rng, f=6, prismatic=bool(seed % 2), inertia=None)
    e = explain_singularities(model)
    q = postures(model, rng, 30)
    D = np.linalg.det(rm.jacobian(model, q))
    J = rm.jacobian(model, q)
    if e.status is FormulaStatus.NEVER_FULL_RANK:
        assert np.linalg.svd(J, compute_uv=False)[:, -1].max() < 1e-8
        np.testing.assert_array_equal(e.determinant(q), 0.0)
    else:
        columns = np.prod(np.linalg.norm(J, axis=1), axis=-1)
        np.testing.assert_allclose(e.determinant(q), D, rtol=0, atol=1e-14 * columns.max())


def test_long_determinants_come_from_their_matrix(monkeypatch, rng):
    # by its name in full: the room's door has the function under the same name
    monkeypatch.setattr(sys.modules[explain_singularities.__module__], "_MOST_TERMS", 5)
    model = rm.load("xarm6")
    e = explain_singularities(model)
    assert e.status is FormulaStatus.TOO_LONG
    q = postures(model, rng, 20)
    D = np.linalg.det(rm.jacobian(model, q))
    np.testing.assert_allclose(e.determinant(q), D, rtol=0, atol=1e-13)
    (factor,) = e.factors
    assert factor.expression is None
    with pytest.raises(InvalidValueError, match="singularity_map"):
        factor.zeros(q)


def test_always_singular():
    rows = [{"sigma": 0, "alpha": a, "d": d} for a, d in ((0, 0), (0, 0.3), (0, 0.3)) * 2]
    rows[5]["alpha"] = 0.5
    e = explain_singularities(rm.RobotModel.from_table(rm.DHTable.from_rows(rows)))
    assert e.status in (FormulaStatus.NEVER_FULL_RANK, FormulaStatus.MINORS)
    twice = [{"sigma": 0, "alpha": a} for a in (0, 0, np.pi / 2, np.pi / 2, np.pi / 2, np.pi / 2)]
    e = explain_singularities(rm.RobotModel.from_table(rm.DHTable.from_rows(twice)))
    assert e.text


def test_batches_pickles_and_mistakes(explained):
    e = explained("rx90")
    for batch in ((), (3,), (2, 3), (0,), (2, 0)):
        q = np.ones((*batch, 6))
        assert e.values(q).shape == (*batch, 3)
        assert e.determinant(q).shape == batch
        assert e.factors[0].values(q).shape == batch
        assert e.factors[0].zeros(q).shape == (*batch, 2)
    again = pickle.loads(pickle.dumps(e))
    np.testing.assert_array_equal(again.values(np.ones(6)), e.values(np.ones(6)))
    with pytest.raises(ShapeError):
        e.values(np.zeros(5))
    with pytest.raises(InvalidValueError, match="SingularityKind"):
        e.factor("elbow")
    with pytest.raises(InvalidValueError, match="0 factors"):
        e.factor(SingularityKind.OTHER)


# --- factoring -----------------------------------------------------------------------------------


def test_products_of_closed_forms_are_taken_apart():
    model = rm.load("puma560")
    chain = SymbolicChain(model, model.twin.frame(None))
    ring = chain.ring
    g = {str(s): ring.generator(s) for s in ring.symbols}
    S23 = g["S2"] * g["C3"] + g["C2"] * g["S3"]
    C23 = g["C2"] * g["C3"] - g["S2"] * g["S3"]
    shoulder = g["D3"] * g["C2"] + g["D4"] * C23 - g["RL4"] * S23
    elbow = g["D4"] * g["S3"] + g["RL4"] * g["C3"]
    cases = [
        (shoulder * elbow, {elbow: 1, shoulder: 1}),
        (3 * g["D3"] * shoulder * elbow * g["S5"] * g["C3"],
         {g["C3"]: 1, g["S5"]: 1, elbow: 1, shoulder: 1}),
        (elbow**2, {elbow: 2}),
        ((g["C4"] ** 2 - 1) * elbow, {g["S4"]: 2, elbow: 1}),
        (g["C3"] * (1 + g["C3"]), {g["C3"]: 1, -1 - g["C3"]: 1}),
        ((g["D3"] + g["D4"]) * elbow, {elbow: 1}),
        (shoulder + elbow, {shoulder + elbow: 1}),
    ]  # fmt: skip
    for p, expected in cases:
        p = ring.reduced(p)
        found = factored(p, chain)
        assert {q: k for q, k in found.factors if q in expected} | {
            -q: k for q, k in found.factors if -q in expected
        } == expected
        assert len(found.factors) == len(expected)
        whole = found.constant
        for q, k in found.factors:
            for _ in range(k):
                whole = ring.times(whole, q)
        assert whole == p
    assert chain.notation.text(formula(ring.reduced(S23 * g["S4"]), chain)) == "S23*S4"


# --- maps ----------------------------------------------------------------------------------------


def test_map_of_the_determinant_and_of_a_factor(explained):
    model = rm.load("rx90")
    at = np.array([0.3, 0.1, 0.2, 0.4, 0.9, 0.6])
    grid = singularity_map(model, (1, "joint_3"), at, (7, 9))
    assert grid.values.shape == (7, 9)
    assert grid.names == ("joint_2", "joint_3")
    assert grid.joints.tolist() == [1, 2]
    assert np.isinf(model.lower[1])
    np.testing.assert_allclose(grid.first[[0, -1]], [-np.pi, np.pi])
    limited = rm.load("irb120")
    axis = singularity_map(limited, (1, 2), samples=(2, 2)).second
    np.testing.assert_allclose(axis, [limited.lower[2], limited.upper[2]])
    q = np.array(at)
    q[1], q[2] = grid.first[2], grid.second[5]
    D = np.linalg.det(rm.jacobian(model, q))
    assert grid.values[2, 5] == pytest.approx(D, abs=1e-14)
    assert not grid.values.flags.writeable
    elbow = singularity_map(model, (1, 2), at, (3, 5), SingularityKind.ELBOW, [[0, 1], [0, 2]])
    np.testing.assert_allclose(elbow.values, np.tile(np.cos(np.linspace(0, 2, 5)), (3, 1)))
    assert elbow.label == "elbow: C3"
    assert elbow.units == ("rad", "rad", "1")
    factor = explained("rx90").factor(SHOULDER)
    same = singularity_map(model, (1, 2), at, (3, 5), factor)
    assert same.units[2] == "m"


def test_map_of_a_stroke_and_of_seven_joints():
    stanford = rm.load("stanford_arm")
    grid = singularity_map(stanford, (1, 2), samples=(4, 5), ranges=[[-1, 1], [0, 0.5]])
    assert grid.units == ("rad", "m", "m^2")
    iiwa = rm.load("iiwa14")
    with pytest.raises(InvalidValueError, match="no determinant"):
        singularity_map(iiwa, (1, 3))
    grid = singularity_map(iiwa, (1, 3), samples=(3, 4), factor=ELBOW)
    np.testing.assert_allclose(np.abs(grid.values), np.abs(np.tile(np.sin(grid.second), (3, 1))))


@pytest.mark.parametrize(
    "arguments",
    [
        {"joints": (1, 1)},
        {"joints": (1, 6)},
        {"joints": (1,)},
        {"joints": "ab"},
        {"joints": (1, "elbow")},
        {"joints": (True, 2)},
        {"joints": (1.5, 2)},
        {"joints": (1, 2), "samples": (0, 3)},
        {"joints": (1, 2), "samples": 5},
        {"joints": (1, 2), "ranges": [[1, 0], [0, 1]]},
        {"joints": (1, 2), "at": np.zeros((2, 6))},
        {"joints": (1, 2), "factor": SingularityKind.OTHER},
    ],
)
def test_mistakes_in_a_map_are_refused(arguments):
    with pytest.raises((InvalidValueError, ShapeError)):
        singularity_map(rm.load("rx90"), **arguments)


def test_a_stroke_without_limits_needs_a_range():
    table = rm.DHTable.from_rows([{"sigma": 1}, {"sigma": 0, "alpha": 1.0, "d": 0.2}])
    model = rm.RobotModel.from_table(table)
    with pytest.raises(InvalidValueError, match="no limits"):
        singularity_map(model, (0, 1))


def test_explanations_are_kept_as_long_as_the_model():
    arm = rm.load("rx90")
    first = explain_singularities(arm)
    assert explain_singularities(arm) is first
    assert explain_singularities(arm, frame=6) is not first
    assert explain_singularities(arm) is first
    # by identity: another model, though equal, has its own
    other = arm.with_tool(np.eye(4))
    assert explain_singularities(other) is not first
    for frame in (1, 2, 3, 4, 5, 6, "joint_3", "joint_4", "joint_5"):
        explain_singularities(arm, frame)
    assert explain_singularities(arm).text == first.text
    known = sys.modules[explain_singularities.__module__]._KNOWN
    key = id(arm)
    assert len(known[key][1]) <= 8
    del arm
    gc.collect()
    assert key not in known


def test_maps_refuse_and_print():
    arm = rm.load("rx90")
    for joints in (1, None, "joint_1", (1,), {1, 2}):
        with pytest.raises(InvalidValueError, match="joints: expected two joints"):
            singularity_map(arm, joints=joints)
    text = repr(singularity_map(arm, (1, 2), at=[0, 0, 0, 0, 1, 0], samples=(5, 7)))
    assert "joint_2 and joint_3, 5 by 7: determinant" in text
    assert len(text) < 160
    # seven joints: refused without the formulas, which take seconds
    panda = rm.load("panda")
    with pytest.raises(InvalidValueError, match="no determinant"):
        singularity_map(panda, (1, 2))
    assert id(panda) not in sys.modules[explain_singularities.__module__]._KNOWN
