"""The table: fields and defaults, degrees, classical tables, printing, and being a value."""

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import random_angle, random_length, random_table, seeds

import robotmodels as rm
from robotmodels import se3
from robotmodels.errors import RobotModelsError
from robotmodels.geometry import constant_factors

ANGLES, LENGTHS = ("gamma", "beta", "alpha", "theta"), ("b", "d", "r")


# --- fields and defaults -----------------------------------------------------------------------


def test_rows_carry_every_field():
    row = {
        "antecedent": 0, "sigma": 1, "mu": 0, "gamma": 0.1, "b": 0.2, "beta": 0.3, "alpha": 0.4,
        "d": 0.5, "theta": 0.6, "r": 0.7, "lower": -1, "upper": 2, "velocity": 3, "effort": 4,
        "name": "slide",
    }  # fmt: skip
    table = rm.DHTable.from_rows([row])
    for key, value in row.items():
        got = table.names[0] if key == "name" else getattr(table, key)[0]
        assert got == value, key


def test_degrees_cover_angles_and_the_limits_of_revolute_joints():
    rows = [
        {"gamma": 10, "beta": 20, "alpha": 30, "theta": 40, "r": 50, "b": 60, "d": 70,
         "lower": -90, "upper": 180, "velocity": 360, "effort": 5},
        {"sigma": 1, "theta": 45, "r": 0.5, "lower": -0.3, "upper": 0.4, "velocity": 2},
    ]  # fmt: skip
    table = rm.DHTable.from_rows(rows, degrees=True)
    for column, value in zip(ANGLES, (10, 20, 30, 40), strict=True):
        assert getattr(table, column)[0] == pytest.approx(np.deg2rad(value), rel=1e-15)
    assert (table.b[0], table.d[0], table.r[0]) == (60, 70, 50), "lengths stay metres"
    assert table.theta[1] == pytest.approx(np.pi / 4)
    assert table.lower == pytest.approx([-np.pi / 2, -0.3])
    assert table.upper == pytest.approx([np.pi, 0.4])
    assert table.velocity == pytest.approx([2 * np.pi, 2])
    assert table.effort[0] == 5


# --- what the numbers mean -----------------------------------------------------------------------


@given(seeds)
def test_a_factor_is_the_product_of_its_seven_motions(seed):
    """Rot(z, gamma) Trans(z, b) Rot(y, beta) Rot(x, alpha) Trans(x, d) Rot(z, theta + q) ..."""
    rng = np.random.default_rng(seed)
    table = random_table(rng, f=4, tree=True, fixed=True)
    q = rng.normal(size=table.n)
    theta, r = table.theta.copy(), table.r.copy()
    for i, k in enumerate(table.joint_rows):
        (r if table.sigma[k] == 1 else theta)[k] += q[i]
    got = rm.link_transforms(table, q)
    for k in range(table.f):
        wanted = (
            se3.rotation("z", table.gamma[k]) @ se3.translation(0, 0, table.b[k])
            @ se3.rotation("y", table.beta[k]) @ se3.rotation("x", table.alpha[k])
            @ se3.translation(table.d[k], 0, 0)
            @ se3.rotation("z", theta[k]) @ se3.translation(0, 0, r[k])
        )  # fmt: skip
        assert np.abs(got[k] - wanted).max() < 1e-14
    zero = rm.link_transforms(table, np.zeros(table.n))
    np.testing.assert_allclose(zero, constant_factors(table), rtol=0, atol=1e-15)


@pytest.mark.parametrize("degrees", [False, True])
@given(seed=seeds)
def test_classical_tables_become_the_same_robot(seed, degrees):
    """The product of Rot(z, theta + offset + q) Trans(z, d) Trans(x, a) Rot(x, alpha)."""
    rng = np.random.default_rng(seed)
    unit = 180 / np.pi if degrees else 1.0
    rows, wanted, q = [], np.eye(4), rng.normal(size=6)
    for i in range(6):
        sigma = int(rng.integers(2))
        theta, alpha = random_angle(rng), random_angle(rng)
        d, a = random_length(rng), random_length(rng)
        offset = rng.choice([0.0, rng.normal()])
        rows.append({
            "sigma": sigma, "theta": theta * unit, "alpha": alpha * unit, "d": d, "a": a,
            "offset": offset * (1.0 if sigma else unit), "name": f"axis_{i}",
        })  # fmt: skip
        turn, shift = (theta, d + offset + q[i]) if sigma else (theta + offset + q[i], d)
        wanted = (
            wanted @ se3.rotation("z", turn) @ se3.translation(0, 0, shift)
            @ se3.translation(a, 0, 0) @ se3.rotation("x", alpha)
        )  # fmt: skip
    table, tool = rm.DHTable.from_standard(rows, degrees=degrees)
    got = np.eye(4)
    for T in rm.link_transforms(table, q):
        got = got @ T
    assert np.abs(got @ tool - wanted).max() < 1e-13
    assert table.names[0] == "axis_0"
    assert np.array_equal(tool[:3, 3], [rows[-1]["a"], 0, 0])


# --- printing ------------------------------------------------------------------------------------


def test_trees_print_antecedents_branches_offsets_and_beta():
    table = rm.DHTable.from_rows([
        {"r": 0.2, "theta": np.pi / 2},
        {"sigma": 1, "theta": np.pi, "r": -0.1, "alpha": 0.5},
        {"antecedent": 1, "gamma": -np.pi / 3, "b": 0.25, "beta": 1e-3, "mu": 0},
        {"sigma": 2, "theta": -np.pi / 2, "r": 1e-12},
    ])  # fmt: skip
    assert str(table).splitlines()[1:5:3] == [
        "│ j │ a(j) │ σj │ μj │   γj │   bj │    βj │  αj │ dj │       θj │       rj │",
        "│ 2 │    1 │  1 │  1 │    0 │    0 │     0 │ 0.5 │  0 │        π │ r₂ - 0.1 │",
    ]


# --- being a value -------------------------------------------------------------------------------


def test_equality_and_hash_follow_the_numbers(rng):
    table = random_table(rng, f=5, tree=True, fixed=True)
    same = table.replace(d=table.d + 0.0)
    assert len({table, same}) == 1
    for column in (*ANGLES, *LENGTHS, "lower", "upper", "velocity", "effort"):
        changed = np.array(getattr(table, column))
        changed[0] = -9.0 if column == "lower" else 9.0
        assert table.replace(**{column: changed}) != table, column
    assert table.replace(names=[f"x{j}" for j in range(5)]) != table


# --- mistakes ------------------------------------------------------------------------------------

TABLES = [
    ({"antecedent": [1], "sigma": [0]}, "Row 1 stands on frame 1"),
    ({"antecedent": [0, 3, 2], "sigma": [0] * 3}, "Row 2 .* loop"),
    ({"antecedent": [0.5], "sigma": [0]}, "antecedent: expected whole numbers"),
    ({"antecedent": [0], "sigma": [3]}, "sigma is 0 .revolute."),
    ({"antecedent": [0], "sigma": [0, 1]}, "sigma: expected 1 numbers"),
    ({"antecedent": [0], "sigma": [0], "mu": [2]}, "mu: expected 1 .actuated."),
    ({"antecedent": [0], "sigma": [0], "d": [1, 2]}, r"d: expected shape \(1,\)"),
    ({"antecedent": [0], "sigma": [0], "r": [np.inf]}, "r: .* got inf"),
    ({"antecedent": [0], "sigma": [2], "lower": [0.0]}, "each of the 0 moving joints"),
    ({"antecedent": [0], "sigma": [0], "upper": [np.nan]}, "upper: NaN"),
    ({"antecedent": [0], "sigma": [0], "lower": [1], "upper": [0]}, "exchange them"),
    ({"antecedent": [0], "sigma": [0], "effort": [-1]}, "effort: limits are magn"),
    ({"antecedent": [0, 1], "sigma": [0, 0], "names": ["a", "a"]}, "'a' more than onc"),
    ({"antecedent": [0, 1], "sigma": [0, 0], "names": ["a"]}, "2 rows, got 1"),
    ({"antecedent": [0], "sigma": [0], "names": [""]}, "empty name"),
    ({"antecedent": [0], "sigma": [0], "names": 5}, "a list of names"),
    ({"antecedent": [0], "sigma": [0], "names": ["a\0b"]}, "control character"),
]
ROWS = [
    ([{}, {"alhpa": 1}], r"Row 2: unknown key 'alhpa'\. Did you mean 'al"),
    ([{"sigma": 0}, [1, 2]], "Row 2: expected a mapping .* got list"),
    ([], "at least one row"),
    ([{"d": [1, 2]}], "Row 1: d must be one number"),
]


def test_mistakes_are_named():
    for fields, words in TABLES:
        with pytest.raises(RobotModelsError, match=words):
            rm.DHTable(**fields)
    for rows, words in ROWS:
        for make in (rm.DHTable.from_rows, rm.DHTable.from_standard):
            with pytest.raises(RobotModelsError, match=words):
                make(rows)
