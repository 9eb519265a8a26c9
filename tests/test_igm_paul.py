"""Paul's method: the plans, the kernel that runs them, and the explanation of the same plans."""

import re
from functools import cache
from itertools import product
from math import acos, atan2, cos, hypot, pi, sin, sqrt

import numpy as np
import pytest
from numba import types as nb

import robotmodels as rm
from robotmodels import se3
from robotmodels.errors import InvalidValueError
from robotmodels.igm.chain import VirtualJoint, locked_chain, with_virtual_joints
from robotmodels.igm.loop import joint_chain
from robotmodels.igm.motion import tool_poses
from robotmodels.igm.paul import derive_plan, explain_igm, layout
from robotmodels.igm.paul._types import solve, solve_rare
from robotmodels.igm.paul.types import EquationType
from robotmodels.igm.paul.typeset import type_formula
from robotmodels.kernels._compile import compiled

COMPLETE = (
    "lab_rr", "lab_rrt", "lab_trr", "planar_2r", "planar_3r", "gantry", "rx90", "tx40", "puma560",
    "stanford_arm", "cobra_s600", "ur5", "ur3e", "ur5e", "ur10e", "ur16e", "kr6_r900", "irb120",
    "irb140", "irb6640", "xarm5",
)  # fmt: skip
RIGHT = pi / 2


@cache
def plan_of(name):
    return derive_plan(joint_chain(rm.load(name)))


@cache
def told_of(name):
    return explain_igm(rm.load(name))


def rotations(rng):
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q * np.sign(np.linalg.det(Q))


def random_pose(rng):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotations(rng), rng.uniform(-1, 1, 3)
    return T


def postures_at_random(plan, count, seed=0):
    q = np.random.default_rng(seed).uniform(-pi, pi, (count, plan.form.k))
    q[:, plan.form.sigma == 1] *= 0.2
    return q


def poses_of(model, plan, q):
    """Poses of the tool in R_0, by the direct model."""
    full = np.zeros((len(q), model.n))
    full[:, plan.chain.columns] = q
    return se3.inverse(model.base) @ rm.dgm(model, full)


def short(plan, way):
    return np.where(plan.form.sigma == 0, (way + pi) % (2 * pi) - pi, way)


def solved(plan, U, references=None):
    """Rows of the plan alone: joints (NaN where there is none) and what the kernel reports."""
    wanted = np.zeros((len(U), plan.form.k)) if references is None else references
    q, residual, marks = plan.program.run(plan.program.numbers, U, wanted)
    there = np.arange(q.shape[1]) < marks[:, :1]
    assert np.where(there, residual, 0.0).max() <= 1e-9
    return np.where(there[..., None], q, np.nan), marks


def checked(model, plan, q):
    """Solve the poses of q: every solution meets its pose; distance of the nearest one to q."""
    U = poses_of(model, plan, q)
    rows, marks = solved(plan, U)
    N, S, k = rows.shape
    valid = np.isfinite(rows[..., 0])
    reached = poses_of(model, plan, np.where(valid[..., None], rows, 0.0).reshape(-1, k))
    missing = np.abs(reached.reshape(N, S, 4, 4) - U[:, None]).max(axis=(2, 3))
    reliable = marks[:, 1] == 0
    assert np.where(valid & reliable[:, None], missing, 0.0).max() <= 2e-12
    turning = rows[valid][:, plan.form.sigma == 0]
    assert ((turning > -pi) & (turning <= pi)).all()
    gap = np.abs(short(plan, rows - q[:, None])).max(axis=2)
    return np.where(valid, gap, np.inf).min(axis=1), reliable, valid.sum(axis=1)


# the plans


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
    plan = plan_of(name)
    assert [step.type.name for step in plan.steps] == types
    assert plan.complete
    assert sorted(plan.solved) == list(range(plan.form.k))


# postures


@pytest.mark.parametrize("name", COMPLETE)
def test_every_posture_meets_its_pose_and_the_generating_one_is_found(name):
    plan, model = plan_of(name), rm.load(name)
    gap, reliable, count = checked(model, plan, postures_at_random(plan, 300))
    assert gap[reliable].max() < 1e-8
    assert reliable.mean() > 0.99
    if plan.form.k == 6:
        assert (count[reliable] % 2 == 0).all()


def test_chains_with_locked_and_with_virtual_joints_have_plans():
    model = rm.load("rx90")
    chain = joint_chain(model)
    five = locked_chain(chain, {3: 0.0})
    plan = derive_plan(five)
    assert plan.complete
    q = postures_at_random(plan, 50)
    rows, _ = solved(plan, tool_poses(five, q))
    assert np.nanmin(np.abs(short(plan, rows - q[:, None])).max(axis=2), axis=1).max() < 1e-8
    arm = joint_chain(rm.load("lab_rrt"))
    frame = se3.from_rpy([0.3, 0.2, 0.1])
    longer, _ = with_virtual_joints(arm, [VirtualJoint(3, frame, 0)])
    assert derive_plan(longer).complete


def arm_of(rows, rng, rotated):
    table = rm.DHTable.from_rows(rows)
    base = random_pose(rng) if rotated else None
    tool = random_pose(rng) if rotated else se3.translation(0.2, 0, 0.1)
    return rm.RobotModel.from_table(table, base=base, tool=tool)


def rows_of(kinds, twists, lengths, offsets):
    rows = []
    for kind, alpha, (d, r), theta in zip(kinds, twists, lengths, offsets, strict=True):
        rows.append({"sigma": int(kind == "P"), "alpha": alpha, "d": d, "r": r, "theta": theta})
    return rows


THREE = {
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


@pytest.mark.sampled(12)
@pytest.mark.parametrize("name", THREE)
@pytest.mark.parametrize("rotated", [False, True])
def test_short_arms_of_every_kind(name, rotated):
    rng = np.random.default_rng(sum(map(ord, name)))
    kinds, twists = THREE[name]
    k = len(kinds)
    lengths = rng.uniform(0.1, 0.5, (k, 2)) * (rng.random((k, 2)) < (1.0 if rotated else 0.6))
    lengths[1:, 0] = np.where(lengths[1:, 0] == 0, 0.3, lengths[1:, 0])
    arm = arm_of(rows_of(kinds, twists, lengths, rng.uniform(-1, 1, k)), rng, rotated)
    plan = derive_plan(joint_chain(arm))
    assert plan.complete
    gap, reliable, _ = checked(arm, plan, postures_at_random(plan, 60, seed=1))
    assert gap[reliable].max() < 1e-6


WRIST = ({"alpha": -RIGHT, "r": 0.4}, {"alpha": RIGHT}, {"alpha": -RIGHT})


@pytest.mark.sampled(3)
@pytest.mark.parametrize("kinds", ["RRR", "RPR", "PRR", "RRP", "PPR", "RPP", "PPP"])
def test_six_joint_arms_with_a_wrist(kinds):
    rng = np.random.default_rng(len(kinds) + ord(kinds[0]) + 2 * ord(kinds[1]) + 3 * ord(kinds[2]))
    done = 0
    every = list(product((0.0, RIGHT, -RIGHT), repeat=2))
    for twists in (every[i] for i in rng.permutation(9)[:4]):
        lengths = rng.uniform(0.1, 0.5, (3, 2))
        rows = rows_of(kinds, (0.0, *twists), lengths, rng.uniform(-1, 1, 3))
        arm = arm_of([*rows, *WRIST], rng, rotated=True)
        q = np.random.default_rng(2).uniform(-2, 2, (40, 6))
        q[:, arm.table.sigma == 1] *= 0.3
        if np.median(np.linalg.svd(rm.jacobian(arm, q), compute_uv=False)[:, -1]) < 1e-6:
            continue  # two slides in line: redundant
        plan = derive_plan(joint_chain(arm))
        if not plan.complete:
            continue  # needs Pieper's quartic
        done += 1
        gap, reliable, _ = checked(arm, plan, q)
        assert gap[reliable].max() < 1e-7
    assert done > 0


def test_an_arm_turned_round_has_the_same_postures_backwards():
    """The RX-90 fixed by its flange: a spherical shoulder, solved on inverted equations."""
    plan, model = plan_of("rx90"), rm.load("rx90")
    rows = [{}, {"alpha": RIGHT}, {"alpha": -RIGHT, "r": -0.45}, {"alpha": RIGHT}, {"d": -0.45},
            {"alpha": -RIGHT}]  # fmt: skip
    arm = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
    U = poses_of(model, plan, postures_at_random(plan, 100))
    backwards = derive_plan(joint_chain(arm))
    assert backwards.complete
    (ours, mine), (theirs, marks) = solved(backwards, se3.inverse(U)), solved(plan, U)
    assert (mine[:, 0] == marks[:, 0]).all()
    for a, b in zip(ours, theirs, strict=True):
        gap = np.abs(short(plan, a[:, None] + b[:, ::-1])).max(axis=2)
        assert np.nanmax(np.nanmin(gap[: np.isfinite(a[:, 0]).sum()], axis=1)) < 1e-9


@pytest.mark.parametrize("name", ["rx90", "puma560", "stanford_arm"])
@pytest.mark.parametrize("wrist", [0.0, 1e-12, 1e-7, 1e-3])
def test_an_aligned_wrist_is_reported_and_loses_no_branch(name, wrist):
    plan, model = plan_of(name), rm.load(name)
    q = postures_at_random(plan, 80, seed=3)
    q[:, 4] = 1.0 - plan.form.rows[4].offset
    q = q[np.linalg.svd(rm.jacobian(model, q), compute_uv=False)[:, -1] > 0.05]
    regular = solved(plan, poses_of(model, plan, q))[1][:, 0]
    q[:, 4] = wrist - plan.form.rows[4].offset
    _, marks = solved(plan, poses_of(model, plan, q), q)
    assert (marks[:, 1] != 0).all() == (wrist < 1e-6)
    if wrist > 1e-9:
        assert (marks[:, 0] == regular).all()


@pytest.mark.parametrize("off", [se3.from_rpy([0.1, 0.0, 0.0]), se3.translation(0.0, 0.0, 0.01)])
def test_candidates_that_miss_the_pose_are_not_returned(off):
    plan, model = plan_of("lab_trr"), rm.load("lab_trr")
    U = poses_of(model, plan, postures_at_random(plan, 20)) @ off
    assert (solved(plan, U)[1][:, 0] == 0).all()


def test_structure_within_rounding_is_used_and_the_true_table_is_met():
    model = rm.load("puma560")
    rng = np.random.default_rng(4)
    table = model.table
    rough = table.replace(
        alpha=table.alpha + rng.uniform(-5e-10, 5e-10, 6), d=table.d + rng.uniform(-5e-10, 5e-10, 6)
    )
    arm = model.with_table(rough)
    plan = derive_plan(joint_chain(arm))
    assert [s.type for s in plan.steps] == [s.type for s in plan_of("puma560").steps]
    q = postures_at_random(plan, 40)
    found = rm.igm(arm, rm.dgm(arm, q))
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
        X, Y, Z = g
        middle, half = atan2(X, Y), acos(Z / hypot(X, Y))
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
        X1, Y1, Z1, X2, Y2, Z2 = g
        square = np.poly1d([Z1 / X1, Y1 / X1]) ** 2 + np.poly1d([Z2 / X2, Y2 / X2]) ** 2
        roots = (square - 1).roots
        return [(r, atan2((Y1 + Z1 * r) / X1, (Y2 + Z2 * r) / X2)) for r in roots]
    if code == layout.POLYNOMIAL:
        return [(r.real,) for r in np.roots(g[::-1]) if abs(r.imag) < 1e-9]
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
    padded = np.zeros(7)
    padded[: len(g)] = g
    solve_alone(code, padded, found, result)
    rows = found.reshape(4, 2, 3)[: result[0]]
    angles = np.arctan2(rows[..., 2], rows[..., 1])
    if code >= layout.LENGTH:
        angles[:, 0] = rows[:, 0, 0]
    return angles, int(result[1])


def coefficients(code, rng):
    """Coefficients of an equation that has solutions."""
    g, i, j, r = rng.normal(size=7), *rng.uniform(-3, 3, 3)
    if code == layout.ONE_EQUATION:
        return [g[0], g[1], g[0] * sin(i) + g[1] * cos(i)]
    if code == layout.TWO_EQUATIONS:
        return [
            g[0],
            g[1],
            g[0] * sin(i) + g[1] * cos(i),
            g[3],
            g[4],
            g[3] * sin(i) + g[4] * cos(i),
        ]
    if code == layout.TWO_ANGLES:
        W1, W2, X, Y, sense = *g[:4], rng.choice((-1.0, 1.0))
        Z1 = W1 * cos(j) + W2 * sin(j) - X * cos(i) - Y * sin(i)
        Z2 = sense * (W1 * sin(j) - W2 * cos(j)) - X * sin(i) + Y * cos(i)
        return [W1, W2, X, Y, Z1, Z2, sense]
    if code == layout.LENGTH_AND_ANGLE:
        X1, Z1, X2, Z2 = g[:4]
        return [X1, X1 * sin(j) - Z1 * r, Z1, X2, X2 * cos(j) - Z2 * r, Z2]
    if code == layout.QUARTIC:
        g[0] = -(g[1] * cos(i) + g[2] * sin(i) + g[3] * cos(2 * i) + g[4] * sin(2 * i))
        return g[:5]
    if code == layout.POLYNOMIAL:
        return rng.uniform(0.5, 2) * np.poly(np.arange(-1.5, 2.0) + 0.3 * rng.random(4))[::-1]
    return g[: {layout.LENGTH_TIMES_ANGLE: 4}.get(code, 2)]


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
        # stretched, out of reach, folded onto the first axis (type 7, then type 8)
        (layout.TWO_ANGLES, [0.0, 1.0, 0.0, 2.0, 1.0, 0.0, -1.0], 1, DOUBLE, -pi / 2),
        (layout.TWO_ANGLES, [0.0, 1.0, 0.0, 3.5, 1.0, 0.0, -1.0], 0, 0, None),
        (layout.TWO_ANGLES, [0.0, 1.0, 0.0, 0.0, 1.0, 0.0, -1.0], 1, FREE, 0.4),
        (layout.TWO_ANGLES, [0.3, 0.0, -0.4, 0.0, 0.7, 0.0, 1.0], 1, DOUBLE, 0.0),
        (layout.TWO_ANGLES, [0.3, 0.0, -0.4, 0.0, 0.71, 0.0, 1.0], 0, 0, None),
        (layout.TWO_ANGLES, [0.4, 0.0, -0.4, 0.0, 0.0, 0.0, 1.0], 1, FREE, 0.4),
        (layout.LENGTH_TIMES_ANGLE, [1.0, 0.0, 1.0, 0.0], 1, layout.FREE_2, 0.0),
        (layout.LENGTH_AND_ANGLE, [1.0, 1.0, 0.0, 1.0, 0.0, 1.0], 1, DOUBLE, 0.0),
        (layout.LENGTH_AND_ANGLE, [1.0, 1.1, 0.0, 1.0, 0.0, 1.0], 0, 0, None),
        (layout.POLYNOMIAL, [0.0] * 5, 1, FREE, 0.4),
        (layout.POLYNOMIAL, [1.0, 0.0, 1.0, 0.0, 0.0], 0, 0, None),
        (layout.POLYNOMIAL, [1.0, -2.0, 1.0, 0.0, 0.0], 1, DOUBLE, 1.0),
        (layout.QUARTIC, [0.0] * 5, 1, FREE, 0.4),
    ],
)
def test_special_positions_of_each_equation(code, g, count, flags, value):
    rows, found = solutions(code, g)
    assert len(rows) == count
    assert found & flags == flags
    if value is not None:
        assert abs(rows[0, 0] - value) < 1e-7


# the explanation

SYMBOLS = {"sqrt": sqrt, "atan2": atan2, "cos": cos, "sin": sin, "π": pi}


class Numbers(dict):
    """Values of the symbols of an explanation at a posture and its pose."""

    def __init__(self, name, q):
        model, plan = rm.load(name), plan_of(name)
        U = plan.form.before @ poses_of(model, plan, q[None])[0] @ plan.form.after
        super().__init__(SYMBOLS)
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


def value_of(formula, known):
    return eval(formula, {"__builtins__": {}}, known)


def angle_gap(a, b):
    return abs((a - b + pi) % (2 * pi) - pi)


@pytest.mark.sampled(7)
@pytest.mark.parametrize("name", COMPLETE)
def test_printed_equations_and_formulas_hold(name):
    """Every equation printed is true of the arm, and every formula gives the joint it names."""
    told = told_of(name)
    rng = np.random.default_rng(6)
    for _ in range(5):
        q = rng.uniform(-1.5, 1.5, plan_of(name).form.k)
        for step in told.steps:
            for e in (1, -1):
                local, gaps = Numbers(name, q), [0.0]
                local["e"] = e
                for formula in step.formulas:
                    left, right = formula.split(", e = ")[0].split(" = ", 1)
                    if "squared and added" in left or "'" in left:
                        continue
                    value = value_of(right, local)
                    if re.fullmatch(r"(B|k|R|X|Y|Z|D|a)\d?", left):
                        local[left] = value
                    elif "θ" in left:
                        gap = angle_gap(value, value_of(left, local))
                        both = any(
                            f.startswith((f"{left}' =", f"({left})' =")) for f in step.formulas
                        )
                        gaps.append(min(gap, pi - gap) if both else gap)
                    else:
                        gaps.append(abs(value - value_of(left, local)))
                if max(gaps) < 1e-9:
                    break
            else:
                raise AssertionError(f"{name}: {step.formulas}")
            for equation in step.equations:
                left, right = (value_of(side, local) for side in equation.split(" = "))
                assert abs(left - right) < 1e-12, equation


def test_rx90_is_the_example_of_the_book():
    steps = told_of("rx90").steps
    assert steps[0].matrix_equation == "1T0 U0 = 1T6"
    assert steps[0].formulas == ("θ1 = atan2(Py, Px)", "θ1' = θ1 + π")
    assert "O4 is on the axis of joint 1" in steps[0].undetermined
    assert steps[1].matrix_equation == "2T0 U0 = 2T6"
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
    assert "axes 4 and 6 are aligned" in steps[2].undetermined
    assert steps[3].equations == (
        "S5 = -C4*(C23*(C1*ax + S1*ay) + S23*az) + S4*(S1*ax - C1*ay)",
        "C5 = -S23*(C1*ax + S1*ay) + C23*az",
    )
    assert steps[4].equations == (
        "S6 = -S4*(C23*(C1*sx + S1*sy) + S23*sz) - C4*(S1*sx - C1*sy)",
        "C6 = -S4*(C23*(C1*nx + S1*ny) + S23*nz) - C4*(S1*nx - C1*ny)",
    )


def test_exercise_rr():
    told = told_of("lab_rr")
    assert told.steps[0].formulas == ("θ1 = atan2(Py, Px)", "θ1' = θ1 + π")  # (4.9)
    assert told.steps[1].formulas == ("θ2 = atan2(RL1 - Pz, C1*Px + S1*Py)",)  # (4.13)
    assert "loses" in told.text
    assert rm.igm(rm.load("lab_rr"), rm.dgm(rm.load("lab_rr"), [2.5, 0.4])).q.round(9).tolist() == [
        [2.5, 0.4]
    ]


def test_exercise_rrt_and_trr():
    rrt = told_of("lab_rrt")
    assert [s.joints for s in rrt.steps] == [("θ1",), ("θ2",), ("r3",)]
    assert rrt.steps[2].formulas == ("r3 = S2*(C1*Px + S1*Py) - C2*(RL1 - Pz)",)
    trr = told_of("lab_trr")
    assert trr.steps[0].formulas == ("r1 = Py",)
    assert [s.joints for s in trr.steps] == [("r1",), ("θ2",), ("θ3",)]


def test_ur5_sums_of_angles():
    told = told_of("ur5")
    assert told.steps[3].joints == ("θ2 + θ3 + θ4",)
    assert told.steps[4].joints == ("θ2", "θ2 + θ3")
    assert told.steps[4].formulas[-1] == "θ4 = (θ2 + θ3 + θ4) - (θ2 + θ3)"


ENVIRONMENT = re.compile(r"\\begin\{(align\*|equation\*)\}\n(.*?)\n\\end\{\1\}", re.DOTALL)


@pytest.mark.parametrize("name", ["lab_rrt", "cobra_s600", "ur5", "erd:kinova", "erd:borinot_arm"])
def test_latex_is_read_by_a_parser_of_it(name):
    from matplotlib.mathtext import MathTextParser

    parser, latex = MathTextParser("path"), told_of(name).latex
    rows = [row for kind, body in ENVIRONMENT.findall(latex) if kind == "align*"
            for row in body.split(" \\\\\n")]  # fmt: skip
    inline = re.findall(r"\$([^$]+)\$", ENVIRONMENT.sub("", latex))
    assert len(rows) > 3
    for formula in {*rows, *inline}:
        parser.parse(f"${formula.replace('&', '')}$")


@pytest.mark.parametrize("type_", list(EquationType))
def test_formulas_of_the_types_are_typeset(type_):
    from matplotlib.mathtext import MathTextParser

    formula = type_formula(type_.formula)
    MathTextParser("path").parse(f"${formula.latex}$")
    assert formula.text == type_.formula
    assert not re.search(r"[A-Za-z]\d|theta(?<!\\theta)|\+-", formula.latex)
    if type_ is EquationType.TYPE_7:
        assert r"\pm (W_{1} \, S_{j} - W_{2} \, C_{j}) = X \, S_{i}" in formula.latex


def test_offsets_are_multiples_of_pi_where_they_are():
    assert "offset: q2 = θ2 - π/2." in told_of("lab_rrt").text
    assert "offset: q2 = θ2 + π/2, q3 = θ3 - π/2, q6 = θ6 - π." in told_of("tx40").text
    assert "q2 = θ2 + 1.38491787287, q3" in told_of("xarm5").text
    assert "offset" not in told_of("erd:ur5").text  # 5e-12 rad: the table prints none either
    for name in COMPLETE:
        assert "1.5707963" not in told_of(name).text + told_of(name).latex


def test_an_offset_is_of_the_joint_that_the_model_counts():
    """Frame 2 is fixed and joint 1 of the model is a side branch: numbers of q, frames of θ."""
    table = rm.DHTable(
        antecedent=[0, 0, 2, 3], sigma=[0, 0, 0, 2], d=[0, 0.1, 0.3, 0.2],
        alpha=[0, 0, RIGHT, 0], theta=[0, 0, RIGHT / 2, 0], mu=[1, 1, 1, 0],
    )  # fmt: skip
    told = explain_igm(rm.RobotModel.from_table(table))
    assert [step.joints for step in told.steps] == [("θ2",), ("θ3",)]
    assert "offset: q3 = θ3 - π/4." in told.text


@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("crx10ia", "Raghavan"),
        ("xarm6", "Raghavan"),
        ("panda", "a locked joint (`lock` of `igm`), as the arm has no arm angle"),
        ("erd:baxter_left_arm", "a locked joint"),
        ("iiwa14", "the arm angle (`arm_angle` of `igm`), as shoulder and wrist are spherical"),
    ],
)
def test_what_takes_over(name, method):
    assert method in told_of(name).takes_over


@pytest.mark.parametrize(
    ("name", "step", "words"),
    [
        ("ur5", 1, "axes 2 and 6 are parallel"),
        ("ur3e", 1, "axes 2 and 6 are parallel"),
        ("rx90", 2, "axes 4 and 6 are aligned"),
        ("irb140", 2, "axes 4 and 6 are aligned"),
        ("gantry", 3, "axes 4 and 6 are aligned"),
    ],
)
def test_axes_that_cannot_meet_are_parallel_not_aligned(name, step, words):
    assert words in told_of(name).steps[step].undetermined


@pytest.mark.parametrize("model", ["rx90", None, rm.load("rx90").table])
def test_only_a_model_is_explained(model):
    with pytest.raises(InvalidValueError, match="model: expected a RobotModel, got "):
        explain_igm(model)


def test_pieper_takes_over_where_a_wrist_needs_a_quartic():
    rows = [{}, {"alpha": 1.0, "d": 0.3, "r": 0.1}, {"alpha": 0.7, "d": 0.4, "r": 0.2}, *WRIST]
    told = explain_igm(rm.RobotModel.from_table(rm.DHTable.from_rows(rows)))
    assert not told.complete
    assert "Pieper" in told.takes_over
