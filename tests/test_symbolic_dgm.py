"""The symbolic direct model: the book's and the exercise's formulas, and its numbers."""

import math
import pickle
import re

import numpy as np
import pytest
import sympy
from hypothesis import given
from identities.random_robots import models, random_angle, random_pose, robot_size

import robotmodels as rm
from robotmodels.se3 import from_rpy
from robotmodels.symbolic_dgm import explain_dgm

RIGHT = np.pi / 2
CATALOGUE = [name for name in rm.robots() if not name.startswith("erd:")]
FOREIGN = (
    "erd:panda",
    "erd:kinova",
    "erd:xarm7",
    "erd:talos_arm",
    "erd:so100",
    "erd:icub_left_arm",
)

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


def names(explanation):
    """Of the cosines in use."""
    return {s.name for s, _ in explanation.abbreviations if s.name.startswith("C")}


def check(model, explanation, rng, frame=None, tolerance=1e-12):
    q = rng.uniform(-np.pi, np.pi, size=(5, model.n))
    np.testing.assert_allclose(
        explanation.evaluate(q), rm.dgm(model, q, frame), rtol=0, atol=tolerance
    )


# --- the two documents ---------------------------------------------------------------------------


def test_rx90_is_example_1_2_letter_by_letter():
    rx90 = explain_dgm(rm.load("rx90"))
    assert str(rx90).endswith("\n" + EXAMPLE_1_2)
    for k, line in enumerate(EXAMPLE_1_2.splitlines()):
        expected = sympy.sympify(line.split(" = ")[1])
        assert sympy.expand(rx90.pose[k % 3, k // 3] - expected) == 0
    assert rx90.base is rx90.tool is None
    assert dict(rx90.constants) == {sympy.Symbol("D3"): 0.45, sympy.Symbol("RL4"): 0.45}
    theta2, theta3 = sympy.symbols("theta2 theta3")
    assert dict(rx90.abbreviations)[sympy.Symbol("C23")] == sympy.cos(theta2 + theta3)


def test_rx90_steps():
    rx90 = explain_dgm(rm.load("rx90"))
    assert [t.name for t in rx90.factors] == ["0T1", "1T2", "2T3", "3T4", "4T5", "5T6"]
    assert [t.name for t in rx90.products] == ["4T6", "3T6", "2T6", "1T6", "0T6"]
    assert rx90.products[1].motion == "3T4 4T6"
    C4, S4, RL4 = sympy.symbols("C4 S4 RL4")
    T = rx90.factors[3]
    assert T.motion == "Rot(x, -π/2) Rot(z, θ4) Trans(z, RL4)"
    assert (
        sympy.Matrix([[C4, -S4, 0, 0], [0, 0, 1, RL4], [-S4, -C4, 0, 0], [0, 0, 0, 1]]) == T.matrix
    )
    for s, of in ((rx90.s, 0), (rx90.n, 1), (rx90.a, 2), (rx90.P, 3)):
        assert s == rx90.pose[:3, of]


def test_lab_rr_is_equation_4_5():
    new = {"RL1": "l1", "XE": "l2", "C1": "c1", "S1": "s1", "C2": "c2", "S2": "s2"}
    c1, s1, c2, s2, l1, l2 = sympy.symbols("c1 s1 c2 s2 l1 l2")
    expected = sympy.Matrix(
        [
            [c1 * c2, -s1, c1 * s2, c1 * c2 * l2],
            [s1 * c2, c1, s1 * s2, s1 * c2 * l2],
            [-s2, 0, c2, l1 - l2 * s2],
            [0, 0, 0, 1],
        ]
    )
    model = rm.load("lab_rr")
    rr = explain_dgm(model, symbols=new)
    assert expected == rr.pose
    assert "⎢   -s2    0     c2  l1 - s2*l2 ⎥" in rr.text
    assert r"l_{1} - s_{2} \, l_{2}" in rr.latex
    assert dict(rr.constants) == {l1: 0.5, l2: 0.2}
    check(model, rr, np.random.default_rng(1))


# --- numbers -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*CATALOGUE, *FOREIGN])
def test_catalogue(name, rng):
    model = rm.load(name)
    check(model, explain_dgm(model), rng)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(rm.robots()) - {*CATALOGUE, *FOREIGN}))
def test_foreign_robots(name, rng):
    model = rm.load(name)
    check(model, explain_dgm(model), rng)


@given(model=models(max_frames=6, inertia="physical"))
def test_random_robots(model):
    q = np.random.default_rng(0).uniform(-3, 3, size=model.n)
    explanation = explain_dgm(model)
    np.testing.assert_allclose(
        explanation.evaluate(q), rm.dgm(model, q), rtol=0, atol=2e-12 * robot_size(model, q)
    )
    text = explanation.text
    assert "nan" not in text
    latex = explanation.latex
    assert latex.count("{") == latex.count("}")
    assert latex.count(r"\left(") == latex.count(r"\right)")
    assert latex.count(r"\begin{") == latex.count(r"\end{")


@pytest.mark.parametrize("name", ["rx90", "tx40", "panda", "xarm6", "crx10ia", "cobra_s600"])
def test_the_text_is_python(name, rng):
    """Every line of the result can be pasted into a program."""
    model = rm.load(name)
    explanation = explain_dgm(model)
    q = rng.uniform(-3, 3, size=model.n)
    known = {s.name: value for s, value in explanation.constants}
    known |= {
        v.name.replace("theta", "θ"): x for v, x in zip(explanation.variables, q, strict=True)
    }
    functions = {"cos": math.cos, "sin": math.sin, "sqrt": math.sqrt, "π": math.pi}
    part = explanation.text.split("Abbreviations\n")[1].split("\n\n")[0]
    for line in part.splitlines():
        left, right = line.split(" = ")
        known[left.strip()] = eval(right, functions, known)
    lines = [line for line in explanation.text.splitlines() if re.match("[snaP][xyz] = ", line)]
    values = [eval(line.split(" = ")[1], functions, known) for line in lines[-12:]]
    np.testing.assert_allclose(
        np.reshape(values, (4, 3)).T, rm.dgm(model, q)[:3], rtol=0, atol=1e-12
    )


def test_evaluate_takes_batches_and_refuses_what_dgm_refuses():
    model = rm.load("rx90")
    explanation = explain_dgm(model)
    assert explanation.evaluate(np.zeros((2, 3, 6))).shape == (2, 3, 4, 4)
    assert explanation.evaluate(np.zeros((0, 6))).shape == (0, 4, 4)
    with pytest.raises(rm.errors.ShapeError):
        explanation.evaluate(np.zeros(5))
    with pytest.raises(rm.errors.InvalidValueError):
        explanation.evaluate([0, 0, 0, 0, 0, np.nan])


def test_written_out_has_only_variables_and_constants():
    model = rm.load("stanford_arm")
    explanation = explain_dgm(model)
    free = explanation.written_out().free_symbols
    assert free <= {*explanation.variables, *(s for s, _ in explanation.constants)}
    q = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    values = dict(zip(explanation.variables, q, strict=True)) | dict(explanation.constants)
    numbers = np.array(explanation.written_out().subs(values).evalf(), dtype=float)
    np.testing.assert_allclose(numbers, rm.dgm(model, q), rtol=0, atol=1e-14)


# --- sums of angles ------------------------------------------------------------------------------


def test_three_parallel_axes():
    ur = explain_dgm(rm.load("ur5"))
    C23, C234 = sympy.symbols("C23 C234")
    assert {C23, C234} <= ur.pose.free_symbols
    assert not {sympy.Symbol("C3"), sympy.Symbol("C34")} & ur.pose.free_symbols
    assert ur.pose[2, 3].coeff(sympy.Symbol("D3")) == sympy.Symbol("S2")


def test_opposite_axes_are_subtracted():
    crx = explain_dgm(rm.load("crx10ia"))
    theta2, theta3 = sympy.symbols("theta2 theta3")
    assert dict(crx.abbreviations)[sympy.Symbol("C2m3")] == sympy.cos(theta2 - theta3)
    assert "C2m3 = cos(θ2 - θ3)" in crx.text
    assert "C_{2-3}" in crx.latex


def test_latex_says_what_the_text_says():
    tool = from_rpy([0.3, 0.0, 0.2], [0.1, 0, 0])
    model = rm.load("cobra_s600").with_base(from_rpy([0, 0, 0], [0, 0, 1e-5])).with_tool(tool)
    explanation = explain_dgm(model)
    latex = explanation.latex
    for word in re.findall(r"\b[A-Z]?[a-z]{3,}\b", explanation.text):
        assert word in latex, word
    assert r"3 & 1 & \pi & 0.275 & 0 & r_{3} \\" in latex
    assert r"D_{3} &= 0.275 \, \mathrm{m} \quad (d_{3})" in latex
    assert r"1 \cdot 10^{-5} \, \mathrm{m} \quad (z\text{ of the base})" in latex
    assert r"(\text{angle about }z\text{ of the tool})" in latex
    assert r"C_{1+2-4} &= \cos\left(\theta_{1} + \theta_{2} - \theta_{4}\right)" in latex
    assert r"$\mathbf{Z}$, the pose of $R_{0}$ in the world" in latex
    words = re.sub(r"\\begin\{(\w+\*)\}.*?\\end\{\1\}", "", latex, flags=re.DOTALL)
    words = re.sub(r"\$[^$]*\$", "", words)
    assert words.isascii()
    assert not re.search(r"(?<!\\)[_^&#%$]", words), words


@pytest.mark.parametrize("turn", [RIGHT, -RIGHT, 0.3])
def test_parallel_axes_on_both_sides_of_a_prismatic_joint(turn, rng):
    """Also if the sliding direction is oblique: the two constant rotations cancel."""
    model = arm(
        {"d": 0.1},
        {"sigma": 1, "alpha": turn, "d": 0.2, "r": 0.1},
        {"sigma": 0, "alpha": -turn, "d": 0.3},
        tool=[[1, 0, 0, 0.2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
    )
    explanation = explain_dgm(model)
    check(model, explanation, rng)
    if turn != 0.3:  # the oblique slide stands between two turns about x
        assert "C13" in {s.name for s in explanation.pose.free_symbols}
    assert "RL2 + r2" in explanation.text


def test_constants_that_cancel_disappear():
    xarm = explain_dgm(rm.load("xarm6"))
    assert {"C2TH2", "C23"} <= names(xarm)
    model = arm({"alpha": 0.3}, {"sigma": 2, "alpha": -0.3})
    assert explain_dgm(model, 2).pose.free_symbols >= set(sympy.symbols("C1 CA1"))
    straight = arm({"theta": 0.7}, {"theta": -0.7 + RIGHT})
    assert explain_dgm(straight).pose[0, 0] == -sympy.Symbol("S12")
    bent = arm({}, {"sigma": 2, "alpha": np.pi / 4}, {"alpha": np.pi / 4})
    assert explain_dgm(bent).pose[2, 1] == sympy.Symbol("C3")


def test_exact_angles_stay_exact(rng):
    model = arm({"theta": np.pi / 4}, {"alpha": np.pi / 3, "d": 0.2}, {"alpha": -np.pi / 6})
    explanation = explain_dgm(model)
    assert not [s for s, _ in explanation.constants if s.name.startswith(("A", "TH"))]
    assert explanation.factors[1].matrix[2, 2] == sympy.Rational(1, 2)
    assert explanation.factors[2].matrix[2, 2] == sympy.sqrt(3) / 2
    assert "C1p45 = cos(θ1 + π/4)" in explanation.text
    check(model, explanation, rng)


def test_nearly_exact_angles_are_not_rounded(rng):
    model = arm({"alpha": RIGHT + 1e-9}, {"d": 1e-9, "beta": 1e-6})
    explanation = explain_dgm(model)
    assert {s.name for s, _ in explanation.constants} == {"A1", "B2", "D2"}
    check(model, explanation, rng)


def test_long_results_are_cut_into_named_parts(rng):
    """An arm with every parameter oblique would otherwise print millions of terms."""
    angle, length = (lambda: rng.uniform(0.1, 1.4)), (lambda: rng.uniform(-1, 1))
    keys = {"gamma": angle, "beta": angle, "alpha": angle, "theta": angle, "b": length,
            "d": length, "r": length}  # fmt: skip
    model = arm(
        *({k: make() for k, make in keys.items()} for _ in range(6)),
        base=random_pose(rng), tool=random_pose(rng),
    )  # fmt: skip
    explanation = explain_dgm(model)
    assert "U1" in {s.name for s, _ in explanation.abbreviations}
    assert len(explanation.text) < 200_000
    check(model, explanation, rng, tolerance=1e-13 * 50)


def test_many_frames_have_unambiguous_names(rng):
    model = arm(*({"d": 0.1} for _ in range(12)))
    explanation = explain_dgm(model, 3)
    assert "C1_2_3" in names(explanation)
    check(model, explanation, rng, 3)


# --- frames, base, tool --------------------------------------------------------------------------


def test_frames(rng):
    model = rm.load("erd:ur5")
    for frame in (0, 1, 4, "base", *model.frame_names[-3:]):
        explanation = explain_dgm(model, frame)
        check(model, explanation, rng, frame)
    assert explain_dgm(model, 0).factors == ()
    assert explain_dgm(model, 2).frame == "R_2"
    with pytest.raises(rm.errors.FrameNotFoundError):
        explain_dgm(model, "nope")


def test_branches(rng):
    table = rm.DHTable(
        antecedent=[0, 1, 1, 3],
        sigma=[0, 0, 2, 1],
        gamma=[0, 0, 0.4, 0],
        b=[0, 0, 0.2, 0],
        alpha=[0, 0, RIGHT, 0],
        d=[0, 0.3, 0.1, 0],
    )
    model = rm.RobotModel.from_table(table)
    for frame in range(5):
        check(model, explain_dgm(model, frame), rng, frame)
    branch = explain_dgm(model)
    assert [t.name for t in branch.factors] == ["0T1", "1T3", "3T4"]
    assert "C1G3" in names(branch)
    assert "G3 = 0.4 rad (gamma3)" in branch.text
    assert [v.name for v in branch.variables] == ["theta1", "theta2", "r4"]


def test_base_and_tool_have_their_steps(rng):
    model = rm.load("rx90").with_base(random_pose(rng)).with_tool(random_pose(rng))
    explanation = explain_dgm(model)
    check(model, explanation, rng)
    for step, pose in ((explanation.base, model.base), (explanation.tool, model.tool)):
        assert step is not None
        names = {s.name for s in step.matrix.free_symbols}
        assert len(names) == 9
        assert step.name in "ZE"
        assert pose.shape == (4, 4)
    assert "Components of Z 0T6 E [1.10]" in explanation.text
    assert r"\mathbf{Z} \, {}^{0}\mathbf{T}_{6} \, \mathbf{E}" in explanation.latex


@pytest.mark.parametrize("pitch", [RIGHT, -RIGHT, RIGHT - 1e-8, RIGHT - 3e-13])
def test_tools_at_gimbal_lock(pitch, rng):
    for _ in range(5):
        roll, yaw = random_angle(rng), random_angle(rng)
        model = rm.load("lab_rr").with_tool(from_rpy([roll, pitch, yaw], [0.1, 0, 0]))
        check(model, explain_dgm(model), rng)


# --- the result as a value -----------------------------------------------------------------------


def test_it_is_a_value():
    a, b = explain_dgm(rm.load("lab_rr")), explain_dgm(rm.load("lab_rr"))
    assert a == b
    assert hash(a) == hash(b)
    assert pickle.loads(pickle.dumps(a)) == a
    assert repr(a) == "<DirectModelExplanation of lab_rr: pose of the tool in the world>"
    assert a._repr_latex_() == a.latex
    shown = a._repr_markdown_()
    title = r"**Direct geometric model of lab\_rr: pose of the tool in the world**"
    assert shown.startswith(title + "\n\n$$\n\\begin{array}{c|")
    blocks = a.latex.count(r"\begin{align*}") + a.latex.count(r"\begin{equation*}")
    assert (
        shown.count("$$\n\\begin{") + shown.count("$$\n{}^") + shown.count("$$\n\\mathbf") == blocks
    )
    assert len(re.findall(r"^\$\$$", shown, re.MULTILINE)) == 2 * blocks
    words = re.sub(r"\$[^$]+\$", "", re.sub(r"\$\$.*?\$\$", "", shown, flags=re.DOTALL))
    assert set(re.findall(r"\\.", words)) == {r"\_"}
    with pytest.raises(AttributeError):
        a.text = ""  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(
    ("symbols", "message"),
    [
        ({"D9": "x"}, "'D9' does not occur"),
        ({"RL2": "x"}, "Did you mean 'RL1'"),
        ({"RL1": "XE"}, "two things"),
        ({"RL1": "2l"}, "identifier|letters"),
        ({"RL1": 3}, "got 3"),
        ("RL1", "mapping"),
    ],
)
def test_new_names_are_checked(symbols, message):
    with pytest.raises(rm.errors.InvalidValueError, match=message):
        explain_dgm(rm.load("lab_rr"), symbols=symbols)
