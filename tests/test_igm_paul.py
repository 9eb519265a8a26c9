"""Paul's method: the plans, the kernel that runs them, and the explanation of the same plans."""

import re
from functools import cache
from itertools import product
from math import acos, atan2, cos, hypot, pi, sin, sqrt

import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser
from numba import types as nb

import robotmodels as rm
from robotmodels import se3
from robotmodels.errors import InvalidValueError
from robotmodels.igm.loop import joint_chain
from robotmodels.igm.paul import derive_plan, explain_igm, layout
from robotmodels.igm.paul._types import solve, solve_rare
from robotmodels.kernels._compile import compiled

COMPLETE = (
    "lab_rr", "lab_rrt", "lab_trr", "planar_2r", "planar_3r", "gantry", "rx90", "tx40", "puma560",
    "stanford_arm", "cobra_s600", "ur5", "ur3e", "ur5e", "ur10e", "ur16e", "kr6_r900", "irb120",
    "irb140", "irb6640", "xarm5",
)  # fmt: skip
RIGHT = pi / 2
SHORT = {
    "planar RRR": ("RRR", (0, 0, 0)),
    "planar RPR": ("RPR", (0, RIGHT, -RIGHT)),
    "planar PRR": ("PRR", (0, RIGHT, 0)),
    "planar RRP": ("RRP", (0, 0, RIGHT)),
    "PPP": ("PPP", (0, RIGHT, RIGHT)),
    "cylindrical": ("RPP", (0, 0, RIGHT)),
    "spherical": ("RRP", (0, RIGHT, RIGHT)),
    "anthropomorphic": ("RRR", (0, RIGHT, 0)),
    "all axes square": ("RRR", (0, RIGHT, -RIGHT)),
    "antiparallel": ("RRR", (0, pi, pi)),
    "oblique": ("RRR", (0.3, 1.1, -0.7)),
    "oblique with slides": ("PRP", (0.3, 1.1, -0.7)),
    "oblique PPP": ("PPP", (0.3, 1.1, -0.7)),
    "SCARA": ("RRPR", (0, 0, pi, 0)),
    "one joint": ("R", (0.4,)),
    "one slide": ("P", (0.4,)),
    "two slides": ("PP", (0, 1.0)),
    "five": ("RRRRR", (0, RIGHT, 0, 0, RIGHT)),
}
WRIST = ({"alpha": -RIGHT, "r": 0.4}, {"alpha": RIGHT}, {"alpha": -RIGHT})
TURNED_ROUND = [{}, {"alpha": RIGHT}, {"alpha": -RIGHT, "r": -0.45}, {"alpha": RIGHT},
                {"d": -0.45}, {"alpha": -RIGHT}]  # fmt: skip
"""The RX-90 fixed by its flange: a spherical shoulder, solved on inverted equations."""


@cache
def model_of(name):
    """A robot by name, a short arm with random lengths, or one with every other length zero."""
    if name in COMPLETE or name[:4] == "erd:":
        return rm.load(name)
    if name == "turned round":
        return rm.RobotModel.from_table(rm.DHTable.from_rows(TURNED_ROUND))
    rng = np.random.default_rng(sum(map(ord, name)))
    sparse = name.startswith("sparse ")
    kinds, twists = SHORT[name.removeprefix("sparse ")]
    k = len(kinds)
    lengths = rng.uniform(0.1, 0.5, (k, 2)) * (rng.random((k, 2)) < (0.6 if sparse else 1.0))
    lengths[1:, 0] = np.where(lengths[1:, 0] == 0, 0.3, lengths[1:, 0])
    return arm_of(kinds, twists, lengths, rng, () if sparse else None)


def arm_of(kinds, twists, lengths, rng, base=None, wrist=()):
    """An arm between random transformations; ``base=()`` for none before it."""
    rows = [
        {"sigma": int(kind == "P"), "alpha": alpha, "d": d, "r": r, "theta": rng.uniform(-1, 1)}
        for kind, alpha, (d, r) in zip(kinds, twists, lengths, strict=True)
    ]
    ends = [se3.from_rpy(rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3)) for _ in range(2)]
    base, tool = ends if base is None else (None, se3.translation(0.2, 0, 0.1))
    return rm.RobotModel.from_table(rm.DHTable.from_rows([*rows, *wrist]), base=base, tool=tool)


@cache
def plan_of(name):
    return derive_plan(joint_chain(model_of(name)))


@cache
def explained(name):
    return explain_igm(model_of(name))


def postures_at_random(plan, count, seed=0):
    q = np.random.default_rng(seed).uniform(-pi, pi, (count, plan.form.k))
    q[:, plan.form.sigma == 1] *= 0.2
    return q


def poses_of(model, plan, q):
    """Poses of the tool in R_0, by the direct model."""
    full = np.zeros((len(q), model.n))
    full[:, plan.chain.columns] = q
    return se3.inverse(model.base) @ rm.dgm(model, full)


def solved(plan, U):
    """Rows of the plan alone: joints (NaN where there is none) and what the kernel reports."""
    q, residual, marks = plan.program.run(U, np.zeros((len(U), plan.form.k)))
    there = np.arange(q.shape[1]) < marks[:, :1]
    assert np.where(there, residual, 0.0).max() <= 1e-9
    return np.where(there[..., None], q, np.nan), marks


def check(model, plan, q, within):
    """Every solution meets its pose, and the posture that made the pose is among them."""
    U = poses_of(model, plan, q)
    rows, marks = solved(plan, U)
    valid, reliable = np.isfinite(rows[..., 0]), marks[:, 1] == 0
    i, _ = np.nonzero(valid & reliable[:, None])
    found = rows[valid & reliable[:, None]]
    np.testing.assert_allclose(poses_of(model, plan, found), U[i], rtol=0, atol=2e-12)
    turning = plan.form.sigma == 0
    assert ((found[:, turning] > -pi) & (found[:, turning] <= pi)).all()
    way = rows - q[:, None]
    gap = np.abs(np.where(turning, (way + pi) % (2 * pi) - pi, way)).max(axis=2)
    assert np.nanmin(gap[reliable], axis=1).max() < within
    return reliable, valid.sum(axis=1)[reliable]


# the plans and their postures


@pytest.mark.parametrize(
    ("name", "types"),
    [
        ("rx90", ["TYPE_2_ZERO", "TYPE_6", "TYPE_2_ZERO", "TYPE_3_DIRECT", "TYPE_3_DIRECT"]),
        ("puma560", ["TYPE_2", "TYPE_7", "TYPE_2_ZERO", "TYPE_3_DIRECT", "TYPE_3_DIRECT"]),
        ("ur5", ["TYPE_2", "TYPE_2_ZERO", "TYPE_3_DIRECT", "TYPE_3_DIRECT", "TYPE_8"]),
        ("stanford_arm", ["TYPE_2", "TYPE_2_ZERO", "TYPE_1", "TYPE_2_ZERO", "TYPE_3_DIRECT",
                          "TYPE_3_DIRECT"]),
        ("gantry", ["TYPE_1"] * 3 + ["TYPE_2_ZERO", "TYPE_3_DIRECT", "TYPE_3_DIRECT"]),
        ("lab_rr", ["TYPE_2_ZERO", "TYPE_3_DIRECT"]),
        ("lab_rrt", ["TYPE_2_ZERO", "TYPE_2_ZERO", "TYPE_1"]),
        ("lab_trr", ["TYPE_1", "TYPE_3_DIRECT", "TYPE_3_DIRECT"]),
    ],
)  # fmt: skip
def test_types_of_known_arms(name, types):
    assert [step.type.name for step in plan_of(name).steps] == types


@pytest.mark.parametrize("name", [*COMPLETE, "turned round"])
def test_every_posture_meets_its_pose_and_the_generating_one_is_found(name):
    plan = plan_of(name)
    assert plan.complete
    assert sorted(plan.solved) == list(range(plan.form.k))
    reliable, count = check(model_of(name), plan, postures_at_random(plan, 300), 1e-8)
    assert reliable.mean() > 0.99
    assert plan.form.k < 6 or (count % 2 == 0).all()


@pytest.mark.sampled(12)
@pytest.mark.parametrize("name", [p + name for name in SHORT for p in ("", "sparse ")])
def test_short_arms_of_every_kind(name):
    plan = plan_of(name)
    assert plan.complete
    check(model_of(name), plan, postures_at_random(plan, 60, seed=1), 1e-6)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("kinds", ["RRR", "RPR", "PRR", "RRP", "PPR", "RPP", "PPP"])
def test_six_joint_arms_with_a_wrist(kinds):
    rng = np.random.default_rng(len(kinds) + ord(kinds[0]) + 2 * ord(kinds[1]) + 3 * ord(kinds[2]))
    done = 0
    every = list(product((0.0, RIGHT, -RIGHT), repeat=2))
    for twists in (every[i] for i in rng.permutation(9)[:4]):
        arm = arm_of(kinds, (0.0, *twists), rng.uniform(0.1, 0.5, (3, 2)), rng, wrist=WRIST)
        q = np.random.default_rng(2).uniform(-2, 2, (40, 6))
        q[:, arm.table.sigma == 1] *= 0.3
        plan = derive_plan(joint_chain(arm))
        # two slides in line are redundant, other arms need Pieper's quartic
        s = np.linalg.svd(rm.jacobian(arm, q), compute_uv=False)[:, -1]
        if plan.complete and np.median(s) > 1e-6:
            done += 1
            check(arm, plan, q, 1e-7)
    assert done > 0


@pytest.mark.parametrize("off", [se3.from_rpy([0.1, 0.0, 0.0]), se3.translation(0.0, 0.0, 0.01)])
def test_candidates_that_miss_the_pose_are_not_returned(off):
    plan = plan_of("lab_trr")
    U = poses_of(model_of("lab_trr"), plan, postures_at_random(plan, 20)) @ off
    assert (solved(plan, U)[1][:, 0] == 0).all()


def test_structure_within_rounding_is_used_and_the_true_table_is_met():
    table, rng = rm.load("puma560").table, np.random.default_rng(4)
    alpha, d = (x + rng.uniform(-5e-10, 5e-10, 6) for x in (table.alpha, table.d))
    arm = rm.load("puma560").with_table(table.replace(alpha=alpha, d=d))
    plan = derive_plan(joint_chain(arm))
    assert [s.type for s in plan.steps] == [s.type for s in plan_of("puma560").steps]
    found = rm.igm(arm, rm.dgm(arm, postures_at_random(plan, 40)))
    assert (found.count == 8).all()
    assert found.residual.max() < 1e-12


# the types, one by one


def scalar_solutions(code, g):
    """The specification: values (and second values) of an equation with coefficients g."""
    if code == layout.ANGLE:
        return [(atan2(g[0], g[1]),)]
    if code == layout.OPPOSITE_ANGLES:
        return [(atan2(g[0], g[1]),), (atan2(-g[0], -g[1]),)]
    if code == layout.ONE_EQUATION:
        middle, half = atan2(g[0], g[1]), acos(g[2] / hypot(g[0], g[1]))
        return [(middle + half,), (middle - half,)]
    if code == layout.TWO_EQUATIONS:
        S, C = np.linalg.solve([[g[0], g[1]], [g[3], g[4]]], [g[2], g[5]])
        return [(atan2(S, C),)]
    if code == layout.TWO_ANGLES:
        W1, W2, X, Y, Z1, Z2, sense = g
        Z = W1**2 + W2**2 - X**2 - Y**2 - Z1**2 - Z2**2
        pairs = []
        for (i,) in scalar_solutions(
            layout.ONE_EQUATION, (2 * (Z1 * Y + Z2 * X), 2 * (Z1 * X - Z2 * Y), Z)
        ):
            one = X * cos(i) + Y * sin(i) + Z1
            two = sense * (X * sin(i) - Y * cos(i) + Z2)
            pairs.append((i, atan2(W2 * one + W1 * two, W1 * one - W2 * two)))
        return pairs
    if code == layout.LENGTH:
        return [(g[1] / g[0],)]
    if code == layout.LENGTH_TIMES_ANGLE:
        r = hypot(g[1] / g[0], g[3] / g[2])
        return [(e * r, atan2(e * g[1] / g[0], e * g[3] / g[2])) for e in (1, -1)]
    if code == layout.LENGTH_AND_ANGLE:
        X1, Y1, Z1, X2, Y2, Z2 = g[:6]
        square = np.poly1d([Z1 / X1, Y1 / X1]) ** 2 + np.poly1d([Z2 / X2, Y2 / X2]) ** 2
        roots = (square - 1).roots
        return [(r, atan2((Y1 + Z1 * r) / X1, (Y2 + Z2 * r) / X2)) for r in roots]
    if code == layout.POLYNOMIAL:
        return [(r.real,) for r in np.roots(g[4::-1]) if abs(r.imag) < 1e-9]
    z = np.roots([g[3] - 1j * g[4], g[1] - 1j * g[2], 2 * g[0], g[1] + 1j * g[2], g[3] + 1j * g[4]])
    return [(np.angle(x),) for x in z if abs(abs(x) - 1) < 1e-9]


@compiled(nb.void(nb.int64, nb.Array(nb.float64, 1, "C"), nb.Array(nb.float64, 2, "C"),
                  nb.Array(nb.int64, 1, "C")))  # fmt: skip
def solve_alone(code, g, found, result):
    eps, wanted = (1e-9, 1e-13, 1e-6), (0.4, -0.7)
    if code == layout.QUARTIC or code > layout.LENGTH:
        result[0], result[1] = solve_rare(code, g, eps, wanted, found, 0, 0)
    else:
        result[0], result[1] = solve(code, g, eps, wanted, found, 0, 0)


def solutions(code, g):
    """Values of both unknowns as the kernel gives them, and its flags."""
    found, result = np.zeros((24, 1)), np.zeros(2, np.int64)
    solve_alone(code, np.concatenate([g, np.zeros(7 - len(g))]), found, result)
    rows = found.reshape(4, 2, 3)[: result[0]]
    angles = np.arctan2(rows[..., 2], rows[..., 1])
    if code >= layout.LENGTH:
        angles[:, 0] = rows[:, 0, 0]
    return angles, int(result[1])


def coefficients(code, rng):
    """Coefficients of an equation that has solutions: some of them follow from the others."""
    g, i, j, r = rng.normal(size=7), *rng.uniform(-3, 3, 3)
    S, C = sin(i), cos(i)
    if code == layout.ONE_EQUATION:
        g[2] = g[0] * S + g[1] * C
    elif code == layout.TWO_EQUATIONS:
        g[2], g[5] = g[0] * S + g[1] * C, g[3] * S + g[4] * C
    elif code == layout.TWO_ANGLES:
        g[6] = rng.choice((-1.0, 1.0))
        g[4] = g[0] * cos(j) + g[1] * sin(j) - g[2] * C - g[3] * S
        g[5] = g[6] * (g[0] * sin(j) - g[1] * cos(j)) - g[2] * S + g[3] * C
    elif code == layout.LENGTH_AND_ANGLE:
        g[1], g[4] = g[0] * S - g[2] * r, g[3] * C - g[5] * r
    elif code == layout.QUARTIC:
        g[0] = -(g[1] * C + g[2] * S + g[3] * cos(2 * i) + g[4] * sin(2 * i))
    elif code == layout.POLYNOMIAL:
        g[:5] = rng.uniform(0.5, 2) * np.poly(np.arange(-1.5, 2.0) + 0.3 * rng.random(4))[::-1]
    return g


@pytest.mark.parametrize("code", range(10))
def test_the_kernel_solves_each_equation_as_the_scalar_specification(code):
    rng = np.random.default_rng(8)
    for _ in range(200):
        g = coefficients(code, rng)
        expected, (rows, _) = scalar_solutions(code, g), solutions(code, g)
        assert len(rows) == len(expected)
        turning = [code < layout.LENGTH, True]
        gap = np.abs(rows[:, None, : len(expected[0])] - np.array(expected))
        shorter = np.abs(np.angle(np.exp(1j * gap)))
        gap = np.where(turning[: gap.shape[2]], shorter, gap).max(axis=2)
        assert max(gap.min(axis=0).max(), gap.min(axis=1).max()) < 1e-7


FREE, DOUBLE = layout.FREE_1, layout.DOUBLE


@pytest.mark.parametrize(
    ("code", "g", "count", "flags", "value"),
    [
        (layout.ANGLE, [0.0, 0.0], 1, FREE, 0.4),
        (layout.OPPOSITE_ANGLES, [0.0, 1e-15], 1, FREE, 0.4),
        (layout.OPPOSITE_ANGLES, [0.0, 1e-9], 2, layout.SMALL, 0.0),
        (layout.LENGTH, [0.0, 0.0], 1, FREE, 0.4),
        # exactly tangent, tangent but for rounding, out of reach, undetermined, contradictory
        (layout.ONE_EQUATION, [3.0, 4.0, 5.0], 1, DOUBLE, atan2(3, 4)),
        (layout.ONE_EQUATION, [3.0, 4.0, 5.0 + 5e-10], 1, DOUBLE, atan2(3, 4)),
        (layout.ONE_EQUATION, [3.0, 4.0, 5.005], 0, 0, None),
        (layout.ONE_EQUATION, [0.0, 0.0, 0.0], 1, FREE, 0.4),
        (layout.ONE_EQUATION, [0.0, 0.0, 0.5], 0, layout.SMALL, None),
        # the same equation twice
        (layout.TWO_EQUATIONS, [1.0, 0.0, 0.5, 2.0, 0.0, 1.0], 1, layout.SMALL, 5 * pi / 6),
        (layout.TWO_EQUATIONS, [0.0] * 6, 1, FREE, 0.4),
        # stretched, folded onto the first axis (type 7, then type 8)
        (layout.TWO_ANGLES, [0.0, 1.0, 0.0, 2.0, 1.0, 0.0, -1.0], 1, DOUBLE, -pi / 2),
        (layout.TWO_ANGLES, [0.0, 1.0, 0.0, 0.0, 1.0, 0.0, -1.0], 1, FREE, 0.4),
        (layout.TWO_ANGLES, [0.3, 0.0, -0.4, 0.0, 0.7, 0.0, 1.0], 1, DOUBLE, 0.0),
        (layout.TWO_ANGLES, [0.4, 0.0, -0.4, 0.0, 0.0, 0.0, 1.0], 1, FREE, 0.4),
        (layout.LENGTH_TIMES_ANGLE, [1.0, 0.0, 1.0, 0.0], 1, layout.FREE_2, 0.0),
        (layout.LENGTH_AND_ANGLE, [1.0, 1.0, 0.0, 1.0, 0.0, 1.0], 1, DOUBLE, 0.0),
        (layout.LENGTH_AND_ANGLE, [1.0, 1.1, 0.0, 1.0, 0.0, 1.0], 0, 0, None),
        (layout.POLYNOMIAL, [1.0, 0.0, 1.0, 0.0, 0.0], 0, 0, None),
        (layout.POLYNOMIAL, [1.0, -2.0, 1.0, 0.0, 0.0], 1, DOUBLE, 1.0),
        (layout.QUARTIC, [0.0] * 5, 1, FREE, 0.4),
    ],
)
def test_special_positions_of_each_equation(code, g, count, flags, value):
    rows, found = solutions(code, g)
    assert len(rows) == count
    assert found & flags == flags
    assert value is None or abs(rows[0, 0] - value) < 1e-7


# the explanation


class Numbers(dict):
    """Values of the symbols of an explanation at a posture and its pose."""

    def __init__(self, name, q):
        plan = plan_of(name)
        U = plan.form.before @ poses_of(model_of(name), plan, q[None])[0] @ plan.form.after
        super().__init__(sqrt=sqrt, atan2=atan2, cos=cos, sin=sin, π=pi)
        self |= {c + a: U[i, j] for j, c in enumerate("snaP") for i, a in enumerate("xyz")}
        self |= {name: value for name, _, value, _ in plan.arm.constants}
        for row, value in zip(plan.form.rows, q, strict=True):
            self[f"{'r' if row.sigma else 'θ'}{row.frame}"] = value + row.offset

    def __missing__(self, name):
        # C2m3 is the cosine of theta2 - theta3
        if not re.fullmatch(r"[CS](m?\d)+", name):
            raise KeyError(name)
        total = sum((-1 if m else 1) * self[f"θ{j}"] for m, j in re.findall(r"(m?)(\d)", name))
        return (cos if name[0] == "C" else sin)(total)

    def value(self, formula):
        return eval(formula, {"__builtins__": {}}, self)


def misses(name, step, q, e):
    """How far the formulas of a step are from the posture, and its equations from zero."""
    known, gaps = Numbers(name, q), [0.0]
    known["e"] = e
    for formula in step.formulas:
        left, equal, right = formula.split(", e = ")[0].partition(" = ")
        if not equal or "squared and added" in left or "'" in left:
            continue
        value = known.value(right)
        if re.fullmatch(r"(B|k|R|X|Y|Z|D|a)\d?", left):
            known[left] = value
            continue
        gap = abs(value - known.value(left))
        if "θ" in left:
            gap = abs((gap + pi) % (2 * pi) - pi)
            both = any(f.startswith((f"{left}' =", f"({left})' =")) for f in step.formulas)
            gap = min(gap, pi - gap) if both else gap
        gaps.append(gap)
    sides = [map(known.value, equation.split(" = ")) for equation in step.equations]
    return max(gaps), max(abs(left - right) for left, right in sides)


@pytest.mark.sampled(9)
@pytest.mark.parametrize("name", [*COMPLETE, *SHORT])
def test_printed_equations_and_formulas_hold(name):
    """Every equation printed is true of the arm, and every formula gives the joint it names."""
    rng = np.random.default_rng(6)
    for _ in range(5):
        q = rng.uniform(-1.5, 1.5, plan_of(name).form.k)
        for step in explained(name).steps:
            (one, zero), (other, _) = (misses(name, step, q, e) for e in (1, -1))
            assert min(one, other) < 1e-9, step.formulas
            assert zero < 1e-12, step.equations


def test_rx90_is_the_example_of_the_book():
    steps = explained("rx90").steps
    assert [s.matrix_equation for s in steps[:2]] == ["1T0 U0 = 1T6", "2T0 U0 = 2T6"]
    assert steps[0].formulas == ("θ1 = atan2(Py, Px)", "θ1' = θ1 + π")
    assert steps[1].formulas == (
        "B1 = C1*Px + S1*Py",
        "squared and added: X*S2 + Y*C2 = Z",
        "X = -2*Pz*D3",
        "Y = -2*B1*D3",
        "Z = RL4**2 - B1**2 - Pz**2 - D3**2",
        "S2 = (X*Z + e*Y*sqrt(X**2 + Y**2 - Z**2))/(X**2 + Y**2)",
        "C2 = (Y*Z - e*X*sqrt(X**2 + Y**2 - Z**2))/(X**2 + Y**2), e = +1 or -1",
        "θ2 = atan2(S2, C2)",
        "θ3 = atan2((-B1*C2 - Pz*S2 + D3)/RL4, (-B1*S2 + Pz*C2)/RL4)",
    )
    assert steps[2].formulas == (
        "θ4 = atan2(S1*ax - C1*ay, -C23*(C1*ax + S1*ay) - S23*az)", "θ4' = θ4 + π",
    )  # fmt: skip
    assert [equation for s in steps[3:] for equation in s.equations] == [
        "S5 = -C4*(C23*(C1*ax + S1*ay) + S23*az) + S4*(S1*ax - C1*ay)",
        "C5 = -S23*(C1*ax + S1*ay) + C23*az",
        "S6 = -S4*(C23*(C1*sx + S1*sy) + S23*sz) - C4*(S1*sx - C1*sy)",
        "C6 = -S4*(C23*(C1*nx + S1*ny) + S23*nz) - C4*(S1*nx - C1*ny)",
    ]


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        # the exercise, eq. (4.9) and (4.13)
        ("lab_rr", ["θ1 = atan2(Py, Px)", "θ1' = θ1 + π", "θ2 = atan2(RL1 - Pz, C1*Px + S1*Py)",
                    "atan2 gives the quadrant, which arctan(y/x) does not"]),
        ("lab_rrt", ["r3 = S2*(C1*Px + S1*Py) - C2*(RL1 - Pz)", "offset: q2 = θ2 - π/2."]),
        ("lab_trr", ["r1 = Py"]),
        ("rx90", ["O4 is on the axis of joint 1", "axes 4 and 6 are aligned"]),
        ("gantry", ["axes 4 and 6 are aligned"]),
        ("ur3e", ["axes 2 and 6 are parallel"]),
        ("ur5", ["axes 2 and 6 are parallel", "Step 4: θ2 + θ3 + θ4 (", "Step 5: θ2 and θ2 + θ3 (",
                 "θ4 = (θ2 + θ3 + θ4) - (θ2 + θ3)"]),
        ("tx40", ["offset: q2 = θ2 + π/2, q3 = θ3 - π/2, q6 = θ6 - π."]),
        ("xarm5", ["q2 = θ2 + 1.38491787287, q3"]),
        # numbers of q, frames of θ: frame 2 is fixed and joint 1 of the model is a side branch
        ({"antecedent": [0, 0, 2, 3], "sigma": [0, 0, 0, 2], "d": [0, 0.1, 0.3, 0.2],
          "alpha": [0, 0, RIGHT, 0], "theta": [0, 0, RIGHT / 2, 0], "mu": [1, 1, 1, 0]},
         ["Step 1: θ2", "Step 2: θ3", "offset: q3 = θ3 - π/4."]),
        ("crx10ia", ["solved by Raghavan"]),
        ("panda", ["solved by a locked joint (`lock` of `igm`), as the arm has no arm angle"]),
        ("iiwa14", ["the arm angle (`arm_angle` of `igm`), as shoulder and wrist are spherical"]),
        ({"antecedent": range(6), "sigma": [0] * 6, "alpha": [0, 1.0, 0.7, -RIGHT, RIGHT, -RIGHT],
          "d": [0, 0.3, 0.4, 0, 0, 0], "r": [0, 0.1, 0.2, 0.4, 0, 0]},
         ["Paul's method stops here", "solved by Pieper's"]),
    ],
)  # fmt: skip
def test_lines_of_explanations(name, lines):
    model = rm.load(name) if isinstance(name, str) else rm.RobotModel.from_table(rm.DHTable(**name))
    text = explain_igm(model).text
    assert not [line for line in lines if line not in text]
    assert "1.5707963" not in text


ENVIRONMENT = re.compile(r"\\begin\{(align\*|equation\*)\}\n(.*?)\n\\end\{\1\}", re.DOTALL)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", ["cobra_s600", "ur5", "erd:kinova", "erd:borinot_arm", *SHORT])
def test_latex_is_read_by_a_parser_of_it(name):
    parser, latex = MathTextParser("path"), explained(name).latex
    rows = [row for kind, body in ENVIRONMENT.findall(latex) if kind == "align*"
            for row in body.split(" \\\\\n")]  # fmt: skip
    inline = re.findall(r"\$([^$]+)\$", ENVIRONMENT.sub("", latex))
    assert rows
    for formula in {*rows, *inline}:
        parser.parse(f"${formula.replace('&', '')}$")
        assert not re.search(r"\*|(?<!\\)theta|\+-|(?<![\\A-Za-z])[A-Za-z]\d", formula)


@pytest.mark.parametrize("model", ["rx90", None])
def test_only_a_model_is_explained(model):
    with pytest.raises(InvalidValueError, match="model: expected a RobotModel, got "):
        explain_igm(model)
