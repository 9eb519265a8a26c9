"""The direct model and the Jacobian as formulas: the book's and the exercise's, and in numbers."""

import math
import re

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from identities.random_robots import models, random_pose, random_state, robot_size

import robotmodels as rm
from robotmodels.errors import InvalidValueError
from robotmodels.se3 import from_rpy
from robotmodels.symbolic import explain_dgm, explain_jacobian

RIGHT = np.pi / 2
CATALOGUE = [name for name in rm.robots() if not name.startswith("erd:")]
FOREIGN = ("erd:panda", "erd:kinova", "erd:talos_arm", "erd:so100", "erd:icub_left_arm")

EXAMPLE_1_2 = """\
sx = C1*(C23*(C4*C5*C6 - S4*S6) - S23*S5*C6) - S1*(S4*C5*C6 + C4*S6)
sy = S1*(C23*(C4*C5*C6 - S4*S6) - S23*S5*C6) + C1*(S4*C5*C6 + C4*S6)
sz = S23*(C4*C5*C6 - S4*S6) + C23*S5*C6
nx = C1*(-C23*(C4*C5*S6 + S4*C6) + S23*S5*S6) + S1*(S4*C5*S6 - C4*C6)
ny = S1*(-C23*(C4*C5*S6 + S4*C6) + S23*S5*S6) - C1*(S4*C5*S6 - C4*C6)
nz = -S23*(C4*C5*S6 + S4*C6) - C23*S5*S6
ax = -C1*(C23*C4*S5 + S23*C5) + S1*S4*S5
ay = -S1*(C23*C4*S5 + S23*C5) - C1*S4*S5
az = -S23*C4*S5 + C23*C5
Px = -C1*(S23*RL4 - C2*D3)
Py = -S1*(S23*RL4 - C2*D3)
Pz = C23*RL4 + S2*D3"""


def arm(*rows, **parts):
    return rm.RobotModel.from_table(rm.DHTable.from_rows(rows), **parts)


def check(model, explanation, rng, frame=None, tolerance=1e-12):
    q = rng.uniform(-np.pi, np.pi, size=(5, model.n))
    np.testing.assert_allclose(
        explanation.evaluate(q), rm.dgm(model, q, frame), rtol=0, atol=tolerance
    )


def check_factors(model, explanation, q, i, j):
    numbers, factors = explanation.evaluate(q), rm.jacobian_factors(model, q, i, j)
    for part in ("rotation", "transport", "reduced"):
        np.testing.assert_allclose(getattr(numbers, part), getattr(factors, part), atol=1e-12)


# --- the two documents ---------------------------------------------------------------------------


def test_rx90_is_example_1_2_letter_by_letter():
    rx90 = explain_dgm(rm.load("rx90"))
    assert str(rx90).endswith("\n" + EXAMPLE_1_2)
    for k, line in enumerate(EXAMPLE_1_2.splitlines()):
        expected = sympy.sympify(line.split(" = ")[1])
        assert sympy.expand(rx90.pose[k % 3, k // 3] - expected) == 0
    assert rx90.base is rx90.tool is None
    RL4, D3, C23 = sympy.symbols("RL4 D3 C23")
    assert dict(rx90.constants) == {D3: 0.45, RL4: 0.45}
    theta2, theta3 = sympy.symbols("theta2 theta3")
    assert dict(rx90.abbreviations)[C23] == sympy.cos(theta2 + theta3)
    assert [t.name for t in rx90.factors] == ["0T1", "1T2", "2T3", "3T4", "4T5", "5T6"]
    assert [t.name for t in rx90.products] == ["4T6", "3T6", "2T6", "1T6", "0T6"]
    assert rx90.products[1].motion == "3T4 4T6"
    assert rx90.factors[3].motion == "Rot(x, -π/2) Rot(z, θ4) Trans(z, RL4)"
    for part, of in ((rx90.s, 0), (rx90.n, 1), (rx90.a, 2), (rx90.P, 3)):
        assert part == rx90.pose[:3, of]


def test_lab_rr_is_equation_4_5():
    new = {"RL1": "l1", "XE": "l2", "C1": "c1", "S1": "s1", "C2": "c2", "S2": "s2"}
    rr = explain_dgm(rm.load("lab_rr"), symbols=new)
    expected = sympy.sympify(
        "[[c1*c2, -s1, c1*s2, c1*c2*l2], [s1*c2, c1, s1*s2, s1*c2*l2],"
        "[-s2, 0, c2, l1 - l2*s2], [0, 0, 0, 1]]"
    )
    assert rr.pose == sympy.Matrix(expected)
    assert "⎢   -s2    0     c2  l1 - s2*l2 ⎥" in rr.text
    assert r"l_{1} - s_{2} \, l_{2}" in rr.latex
    assert {symbol.name: value for symbol, value in rr.constants} == {"l1": 0.5, "l2": 0.2}


def test_rx90_has_the_third_matrix_of_the_book():
    J = explain_jacobian(rm.load("rx90"))
    assert (J.projection, J.intermediate) == ("R_3", "R_4")
    expected = sympy.sympify(
        "[[0, S3*D3 - RL4, -RL4, 0, 0, 0], [0, C3*D3, 0, 0, 0, 0],"
        "[S23*RL4 - C2*D3, 0, 0, 0, 0, 0], [S23, 0, 0, 0, S4, -C4*S5],"
        "[C23, 0, 0, 1, 0, C5], [0, 1, 1, 0, C4, S4*S5]]"
    )
    assert sympy.expand(J.reduced - sympy.Matrix(expected)) == sympy.zeros(6)
    assert J.lever == sympy.zeros(3, 1)
    assert J.second == sympy.eye(6)
    assert J.first[:3, :3] == J.rotation == J.first[3:, 3:]
    assert "⎢ S23*RL4 - C2*D3             0     0  0   0       0 ⎥" in str(J)
    assert r"{}^{3}\mathbf{J}_{6,4} =" in J.latex


# --- numbers -------------------------------------------------------------------------------------


@pytest.mark.sampled(10)
@pytest.mark.parametrize("name", [*CATALOGUE, *FOREIGN])
def test_catalogue(name, rng):
    model = rm.load(name)
    check(model, explain_dgm(model), rng)
    if name in CATALOGUE:
        q = rng.uniform(-np.pi, np.pi, size=(5, model.n))
        J = explain_jacobian(model)
        check_factors(model, J, q, *(int(frame[2:]) for frame in (J.projection, J.intermediate)))


@pytest.mark.nightly
@settings(max_examples=15)
@given(model=models(max_frames=5, inertia="physical"))
def test_random_robots(model):
    rng = np.random.default_rng(0)
    q, *_ = random_state(model, rng, 2)
    i, j = (int(k) for k in rng.integers(0, model.f + 1, size=2))
    size = max(robot_size(model, row) for row in q)
    pose = explain_dgm(model)
    assert "nan" not in pose.text
    np.testing.assert_allclose(pose.evaluate(q), rm.dgm(model, q), rtol=0, atol=2e-12 * size)
    J = rm.jacobian(model, q)
    jacobians = [explain_jacobian(model), explain_jacobian(model, i, j)]
    for found in jacobians:
        np.testing.assert_allclose(found.evaluate(q).jacobian, J, rtol=0, atol=2e-12 * size)
    for latex in (pose.latex, *(found.latex for found in jacobians)):
        for left, right in ((r"\{", r"\}"), (r"\\left\(", r"\\right\)"), (r"\\begin", r"\\end")):
            assert len(re.findall(left, latex)) == len(re.findall(right, latex))


@pytest.mark.nightly
def test_pairs_of_frames(rng):
    model = rm.load("puma560").with_base(from_rpy([0.1, 0.2, 0.3], [1, 2, 3]))
    model = model.with_tool(from_rpy([0.3, 0.1, -0.2], [0.1, 0, 0.2]))
    q = rng.uniform(-3, 3, size=(3, 6))
    for i, j in ((0, 0), (0, 6), (2, 4), (6, 0)):
        check_factors(model, explain_jacobian(model, i, j), q, i, j)
    at_tool = explain_jacobian(model, 3, "tool")
    assert at_tool.lever == sympy.zeros(3, 1)
    J = rm.jacobian(model, q)
    np.testing.assert_allclose(at_tool.evaluate(q).jacobian, J, rtol=0, atol=1e-12)


def values_in(text, constants, q):
    """Names and values of the lines ``name = formula`` of a printed explanation, run as Python."""
    known = {"cos": math.cos, "sin": math.sin, "sqrt": math.sqrt, "π": math.pi}
    known |= {s.name: value for s, value in constants} | {f"θ{k + 1}": x for k, x in enumerate(q)}
    for line in text.split("Abbreviations\n")[1].splitlines():
        left, equal, right = line.strip().partition(" = ")
        if equal and left.isidentifier():
            known[left] = eval(right, known)
    return known


@pytest.mark.parametrize("name", ["panda", "xarm6", "crx10ia"])
def test_the_text_is_python(name, rng):
    """Every line of the result can be pasted into a program."""
    model = rm.load(name)
    q = rng.uniform(-3, 3, size=model.n)
    pose, J = explain_dgm(model), explain_jacobian(model, 0, 0)
    known = values_in(pose.text, pose.constants, q)
    T = [[known[vector + axis] for vector in "snaP"] for axis in "xyz"]
    np.testing.assert_allclose(T, rm.dgm(model, q)[:3], rtol=0, atol=1e-12)
    reduced = rm.jacobian_factors(model, q, 0, 0).reduced
    head, _, columns = J.text.rpartition("\n  joint 1\n")
    for k, column in enumerate(columns.split("\n  joint ")):
        known = values_in(f"{head}\n{column}", J.numbers.constants, q)
        found = [known.get(row, 0.0) for row in ("vx", "vy", "vz", "wx", "wy", "wz")]
        np.testing.assert_allclose(found, reduced[:, k], rtol=0, atol=1e-12)


# --- sums of angles, and constants ---------------------------------------------------------------


def test_parallel_axes_are_added_and_opposite_ones_subtracted():
    ur = explain_dgm(rm.load("ur5"))
    D3, S2 = sympy.symbols("D3 S2")
    used = {s.name for s in ur.pose.free_symbols}
    assert {"C23", "C234"} <= used
    assert not {"C3", "C34"} & used
    assert ur.pose[2, 3].coeff(D3) == S2
    crx = explain_dgm(rm.load("crx10ia"))
    assert "C2m3 = cos(θ2 - θ3)" in crx.text
    assert "C_{2-3}" in crx.latex


def test_angles_are_exact_or_symbols(rng):
    model = arm({"theta": np.pi / 4}, {"alpha": np.pi / 3, "d": 0.2}, {"alpha": -np.pi / 6})
    exact = explain_dgm(model)
    assert not [s for s, _ in exact.constants if s.name.startswith(("A", "TH"))]
    assert exact.factors[1].matrix[2, 2] == sympy.Rational(1, 2)
    assert exact.factors[2].matrix[2, 2] == sympy.sqrt(3) / 2
    assert r"\frac{\sqrt{3}}{2}" in exact.latex
    assert "C1p45 = cos(θ1 + π/4)" in exact.text
    check(model, exact, rng)
    model = arm({"alpha": RIGHT + 1e-9}, {"d": 1e-9, "beta": 1e-6})
    near = explain_dgm(model)
    assert {s.name for s, _ in near.constants} == {"A1", "B2", "D2"}
    check(model, near, rng)
    # offsets of 3/4 pi and pi are one of -pi/4
    model = arm({"theta": 0.75 * np.pi}, {"theta": np.pi, "d": 0.4})
    assert "C12m45 = cos(θ1 + θ2 - π/4)" in explain_dgm(model).text
    check(model, explain_dgm(model), rng)


def test_long_results_are_cut_into_named_parts(rng):
    """An arm with every parameter oblique would otherwise print millions of terms."""
    keys = dict.fromkeys(("gamma", "beta", "alpha", "theta"), (0.1, 1.4))
    keys |= dict.fromkeys(("b", "d", "r"), (-1, 1))
    rows = [{k: rng.uniform(*ends) for k, ends in keys.items()} for _ in range(6)]
    model = arm(*rows, base=random_pose(rng), tool=random_pose(rng))
    pose = explain_dgm(model)
    assert "U1 = " in pose.text
    assert len(pose.text) < 200_000
    check(model, pose, rng, tolerance=1e-13 * 50)
    rows = [{k: row[k] for k in ("alpha", "d", "theta", "r")} for row in (*rows, *rows[:2])]
    rows[3]["sigma"] = 1
    model, q = arm(*rows), rng.uniform(-1, 1, size=(3, 8))
    for pair in ((None, None), (0, 8)):
        J = explain_jacobian(model, *pair)
        np.testing.assert_allclose(J.evaluate(q).jacobian, rm.jacobian(model, q), atol=1e-12)
        assert max(len(str(entry)) for entry in J.reduced) < 4000


# --- the result as a value, LaTeX and names ------------------------------------------------------


def test_new_names_are_checked():
    for symbols, message in (
        ({"D9": "x"}, "'D9' does not occur"),
        ({"RL2": "x"}, "Did you mean 'RL1'"),
        ({"RL1": "XE"}, "two quantities"),
        ({"RL1": "2l"}, "letters"),
        ({"RL1": 3}, "got 3"),
        ("RL1", "mapping"),
    ):
        for explain in (explain_dgm, explain_jacobian, rm.explain_singularities):
            with pytest.raises(InvalidValueError, match=message):
                explain(rm.load("lab_rr"), symbols=symbols)
