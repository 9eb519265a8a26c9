"""Base parameters: rules against numbers, torques kept, SYMORO's tables, what the book prints."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
import sympy
from identities.random_robots import random_bodies, random_drive, random_pose, random_table

import robotmodels as rm
from robotmodels.drive import DriveKind
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.friction import AsymmetricFriction, StribeckFriction
from robotmodels.minimal_parameters import BaseMethod, base_parameters
from robotmodels.minimal_parameters.alignment import aligned_robot
from robotmodels.minimal_parameters.formulas import constants_of
from robotmodels.minimal_parameters.numeric import TorqueColumns, residual_warning
from robotmodels.minimal_parameters.rules import reach
from robotmodels.regressors import parameter_names, parameter_vector, torque_regressor

GRAVITIES = ((0.0, 0.0, -9.81), (0.0, -9.81, 0.0), (-9.81, 0.0, 0.0), (0.0, 0.0, 0.0))
CATALOGUE = rm.robots()


def any_robot(rng):
    """Anything: trees, fixed frames, gamma and b, oblique axes, rotated bases, gravity or none."""
    f = int(rng.integers(1, 9))
    table = random_table(rng, f, tree=bool(rng.random() < 0.4), fixed=bool(rng.random() < 0.3))
    # between parallel and not parallel there is a range that no rank can decide
    beta = np.where(abs(table.beta) < 1e-2, 0.0, table.beta)
    base = None if rng.random() < 0.5 else random_pose(rng)
    gravity = rng.normal(size=3) if rng.random() < 0.3 else GRAVITIES[rng.integers(4)]
    columns = {c: getattr(table, c) for c in ("gamma", "b", "alpha", "d", "theta", "r")}
    table = rm.DHTable(antecedent=table.antecedent, sigma=table.sigma, beta=beta, **columns)
    return rm.RobotModel.from_table(table, base=base, gravity=gravity)


def right_angled_robot(rng):
    """Right angles and few lengths: parallel, perpendicular, collinear and meeting axes abound."""
    f = int(rng.integers(1, 8))
    tree = rng.random() < 0.4
    antecedent = [int(rng.integers(0, j + 1)) if tree else j for j in range(f)]
    sigma = rng.choice([0, 0, 1, 1, 2] if rng.random() < 0.3 else [0, 1], size=f)
    if (sigma == 2).all():
        sigma[0] = 0

    def angles():
        return rng.integers(-2, 3, size=f) * np.pi / 2 * (rng.random(f) < 0.6)

    def lengths():
        return np.where(rng.random(f) < 0.6, 0.0, rng.choice([0.3, 0.5], size=f))

    table = rm.DHTable(
        antecedent=antecedent, sigma=sigma, alpha=angles(), d=lengths(), theta=angles(),
        r=lengths(), gamma=angles() * tree, b=lengths() * tree,
    )  # fmt: skip
    return rm.RobotModel.from_table(table, gravity=GRAVITIES[rng.integers(4)])


def equal(one, other, tolerance=1e-10):
    """The same parameters, and the same torques of each standard parameter."""
    assert one.names == other.names
    assert one.no_effect == other.no_effect
    model = one.model
    sizes = TorqueColumns(model, one.drive, one.friction).sizes
    size = reach(model)
    slides = np.where(model.table.sigma[model.table.joint_rows] == 1, size, 1.0)
    q, v, a = np.random.default_rng(5).uniform(-1, 1, (3, 12, model.n)) * slides
    rate = np.sqrt(9.81 / size)
    motion = np.pi * q, rate * v, rate**2 * a
    W = torque_regressor(model, *motion, drive=one.drive, friction=one.friction)
    W = (W * slides[:, None]).reshape(-1, len(sizes)) * sizes
    length = np.sqrt((W * W).sum(axis=0))
    longest = length.max(initial=1e-300)
    apart = (one.matrix - other.matrix) * sizes / sizes[one.kept][:, None]
    columns = apart.any(axis=0)
    shown = np.sqrt(((W[:, one.kept] @ apart[:, columns]) ** 2).sum(axis=0))
    assert shown.max(initial=0.0) <= tolerance * longest
    # and the same numbers where the parameter acts
    acting = length[one.kept] > 1e-2 * longest
    assert abs(apart[acting]).max(initial=0.0) <= 100 * tolerance


def turned(base):
    """Sum of the angles of the axes that were taken as aligned: what torques may be off by."""
    aligned = aligned_robot(base.model, base.angle).model.chain.rotation
    return np.linalg.norm(aligned - base.model.chain.rotation, axis=(1, 2)).sum()


def keeps_torque(base, model, rng, drive=True, tolerance=1e-10):
    q, v, a = rng.uniform(-2, 2, (3, 20, model.n))
    W = torque_regressor(model, q, v, a, drive=drive)
    torque = W @ parameter_vector(model, drive)
    off = abs(base.reduce(W) @ base.values(model) - torque).max(initial=0.0)
    assert off <= (tolerance + 3 * turned(base)) * max(1e-300, abs(torque).max(initial=0.0))


def filled(model, rng):
    """Real bodies and drives on every joint."""
    model = model.with_inertia(random_bodies(rng, model.f))
    if model.transmission is None:
        model = model.with_drive(random_drive(rng, model.n))
    return model


@pytest.mark.parametrize("name", CATALOGUE)
def test_rules_and_numbers_agree_on_the_catalogue(name, rng):
    model = filled(rm.load(name), rng)
    # the great trees once; their links are the same with and without drives
    for drive in (True, False) if model.f < 40 else (True,):
        rules = base_parameters(model, drive=drive)
        numbers = base_parameters(model, "numeric", drive=drive)
        equal(rules, numbers)
        kept, dependent = numbers.gap
        assert dependent < (2e-11 if numbers.notes else 1e-13)
        assert kept > (1e-4 if numbers.notes else 0.01)  # no parameter that no log would show
        for base in (rules, numbers):
            keeps_torque(base, model, rng, drive)
            assert abs(base.matrix[base.matrix != 0]).min() > (1e-13 if base.notes else 1e-6)
    if rules.notes and model.f < 40:
        exact = base_parameters(model, drive=drive, tolerance=1e-11)
        assert turned(exact) < 1e-9
        keeps_torque(exact, model, rng, drive)


@pytest.mark.parametrize("build", [any_robot, right_angled_robot])
def test_rules_and_numbers_agree_on_random_robots(build):
    rng = np.random.default_rng(7)
    for k in range(150):
        model = build(rng)
        rules = base_parameters(model)
        equal(rules, base_parameters(model, "numeric"))
        if k % 5 == 0:
            model = filled(model, rng)
            for drive in (True, False):
                keeps_torque(base_parameters(model, drive=drive), model, rng, drive)


@pytest.mark.parametrize("length", [1e-3, 1e-5, 1e-9, 6e-17])
def test_tiny_lengths_are_no_unit_of_the_rank(length):
    """Lengths of rounding, or far below those that joints slide through, decide nothing."""
    rng, h = np.random.default_rng(2), np.pi / 2
    for rows in (
        [{"sigma": 0}, {"sigma": 0, "alpha": h, "d": length}, {"sigma": 1, "alpha": h}],
        [{"sigma": 1, "r": length}, {"sigma": 1, "alpha": h}, {"sigma": 1, "alpha": h}],
        [{"sigma": 1, "r": length}, {"sigma": 0, "alpha": h}],
        [{"sigma": 0}, {"sigma": 1, "alpha": h, "d": length}],
        [{"sigma": 1}, {"sigma": 0, "alpha": h, "d": length}, {"sigma": 1, "alpha": -h}],
        [{"sigma": 0, "r": length}, {"sigma": 0, "alpha": h}, {"sigma": 0, "alpha": -h}],
    ):
        model = filled(rm.RobotModel.from_table(table_of(*rows)), rng)
        friction = AsymmetricFriction(*rng.uniform(0.5, 2.0, (4, model.n)))
        for more in (None, friction):
            rules = base_parameters(model, friction=more, drive=True)
            numbers = base_parameters(model, "numeric", friction=more, drive=True)
            equal(rules, numbers)
            if length < 1e-9 and more is None:
                nothing = [{k: x for k, x in row.items() if k not in "dr"} for row in rows]
                exact = base_parameters(rm.RobotModel.from_table(table_of(*nothing)), drive=True)
                assert numbers.names == exact.names
        keeps_torque(base_parameters(model, "numeric", drive=True), model, rng, True)
        keeps_torque(base_parameters(model, drive=True), model, rng, True)


def slightly_off(rng):
    """Right angles and no lengths but for some that are tiny, from rounding to a hundredth."""
    model = right_angled_robot(rng)
    table, f = model.table, model.f
    off = 10.0 ** rng.uniform(-13.0, -2.0)

    def moved(column):
        return column + off * rng.normal(size=f) * (rng.random(f) < 0.4)

    table = table.replace(
        alpha=moved(table.alpha), beta=moved(table.beta), d=moved(table.d), r=moved(table.r)
    )
    return model.with_table(table)


def test_methods_agree_on_what_is_nearly_aligned():
    rng = np.random.default_rng(11)
    for _ in range(60):
        model = filled(slightly_off(rng), rng)
        rules, numbers = (
            base_parameters(model, drive=True),
            base_parameters(model, "numeric", drive=True),
        )
        assert rules.names == numbers.names
        exact = base_parameters(model, tolerance=1e-11, drive=True)
        numeric = base_parameters(model, "numeric", tolerance=1e-11, drive=True)
        assert exact.names == numeric.names
        assert turned(exact) < 1e-9
        for base in (rules, numbers, exact):
            keeps_torque(base, model, rng, tolerance=3e-10)
            assert not any("NOT TO BE USED" in note for note in base.notes)


def few_digits(model, rng, most):
    """Every angle between axes off by up to so many radians, and by a tenth of that at least."""
    table, f = model.table, model.f

    def off(column):
        return column + rng.choice([-1, 1], f) * most * rng.uniform(0.1, 1.0, f)

    theta = np.where(table.sigma == 0, table.theta, off(table.theta))
    return model.with_table(table.replace(alpha=off(table.alpha), theta=theta))


def test_axes_within_1e_5_rad_are_aligned_in_the_regrouping():
    rng = np.random.default_rng(12)
    apart = 0
    for _ in range(40):
        model = filled(right_angled_robot(rng), rng)
        rounded, far = few_digits(model, rng, 9e-6), few_digits(model, rng, 3e-4)
        for way in BaseMethod:
            meant, base = (
                base_parameters(model, way, drive=True),
                base_parameters(rounded, way, drive=True),
            )
            assert base.names == meant.names
            assert {*base.no_effect, *base.neglected} <= {*meant.no_effect}
            assert abs(base.matrix - meant.matrix).max(initial=0.0) < 1e-4
            assert base.model is rounded  # poses and torques keep the digits
            keeps_torque(base, rounded, rng)
            if base.notes:
                assert base.notes[0].startswith("Treated as aligned: ")
                assert (
                    f"aligned robot by up to {base.torque_error:.0e} of the largest"
                    in base.notes[1]
                )
                assert 0.0 < base.torque_error < 3 * turned(base)
            # not so beyond 1e-5 rad, and not if every digit is meant
            keeps_torque(base_parameters(far, way, drive=True), far, rng, tolerance=3e-10)
            exact = base_parameters(rounded, way, tolerance=1e-11, drive=True)
            assert turned(exact) < 1e-10
            apart += len(exact) > len(meant)
    assert apart > 20


def test_gravity_and_the_first_axis_are_aligned_in_any_base(rng):
    """Also where no angle of the table is a right one: a wall, a slope, a fixed frame between."""
    rows = [{"sigma": 2, "alpha": 0.7, "theta": 0.4}, {"sigma": 0, "alpha": 0.5, "d": 0.2}]
    rows += [{"sigma": 0, "alpha": 0.3, "beta": 0.2, "d": 0.4}]
    arm = filled(rm.RobotModel.from_table(table_of(*rows)), rng)
    first = rm.link_poses(arm, np.zeros(2))[1][:3, :3]
    for down in (first[:, 2], first[:, 1]):
        off = down + 5e-6 * first[:, 2 if down is first[:, 1] else 0]
        meant = base_parameters(arm.with_gravity(9.81 * down), drive=True)
        model = arm.with_gravity(9.81 * off / np.linalg.norm(off))
        for way in BaseMethod:
            base = base_parameters(model, way, drive=True)
            assert base.names == meant.names
            assert "axis 2 and gravity" in base.notes[0]
            assert "but for 5.0e-06 rad" in base.notes[0]
            keeps_torque(base, model, rng)


def test_a_slope_of_prismatic_joints_is_aligned(rng):
    """The third axis is aligned with the first and gravity, and not with the one before it."""
    eighth = np.pi / 4
    rows = [{"sigma": 1, "alpha": 2 * eighth}, {"sigma": 1, "alpha": eighth, "d": 0.3}]
    rows += [{"sigma": 1, "alpha": eighth}, {"sigma": 0, "alpha": 2 * eighth, "d": 0.1}]
    exact = filled(rm.RobotModel.from_table(table_of(*rows)), rng)
    rounded = exact.with_table(exact.table.replace(alpha=exact.table.alpha.round(4)))
    for way in BaseMethod:
        base = base_parameters(rounded, way, drive=True)
        assert base.names == base_parameters(exact, way, drive=True).names
        assert "axis 3 and gravity" in base.notes[0]
        assert "axis 3 and axis 1 perpendicular" in base.notes[0]
        assert "ZZ" in base.text
        keeps_torque(base, rounded, rng)


@pytest.mark.parametrize("gravity", [1e-12, 1e-10, 1e-3])
def test_hardly_any_gravity(gravity):
    for name in ("rx90", "gantry", "cobra_s600"):
        model = rm.load(name).with_gravity([0.0, 0.0, -gravity])
        assert base_parameters(model).names == base_parameters(model, "numeric").names


def test_torques_that_are_not_kept_are_told():
    base = base_parameters(rm.load("rx90"), "numeric")
    assert base.torque_error < 1e-14
    assert not base.notes
    assert (
        "NOT TO BE USED: these base parameters have torque errors of 2.0e-01"
        in residual_warning(0.2, 1e-11)[0]
    )


# --- what others print ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rx90", "scara", "two_arm_tree"])
def test_symoro(name):
    folder = Path(__file__).parent / "oracles"
    table = json.loads((folder / f"symoro_{name}.json").read_text(encoding="utf-8"))["table"]
    oracle = json.loads((folder / "symoro_base_parameters.json").read_text("utf-8"))[name]
    keys = [{"j": "number", "ant": "antecedent"}.get(k, k) for k in table["columns"]]
    rows = [dict(zip(keys, [x or 0.0 for x in values], strict=True)) for values in table["rows"]]
    for row in rows:
        del row["number"]
        row["antecedent"], row["sigma"] = int(row["antecedent"]), int(row["sigma"])
        row["mu"] = int(row["mu"])
    model = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
    for method in ("symbolic", "numeric"):
        base = base_parameters(model, method)
        own = {
            name: {k: v for k, v in parts.items() if not k.startswith("offset")}
            for name, parts in base.regrouping.items()
            if not name.startswith(("Fv", "Fc", "offset"))
        }
        theirs = {
            kept.replace("IA", "Ia"): {k.replace("IA", "Ia"): v for k, v in parts.items()}
            for kept, parts in oracle["grouping"].items()
        }
        assert len(own) == oracle["dimension"]
        assert own.keys() == theirs.keys()
        for kept, parts in own.items():
            assert parts == pytest.approx(theirs[kept], abs=1e-9)
        assert list(base.no_effect) == [n.replace("IA", "Ia") for n in oracle["no_effect"]]


def test_rx90_prints_as_the_book():
    base = base_parameters(rm.load("rx90"), drive=True)
    inertial = [n for n in base.names if not n.startswith(("Fv", "Fc", "offset"))]
    assert len(inertial) == 40
    assert len(base.no_effect) == 11
    assert "ZZ1R = ZZ1 + Ia1 + YY2 + YY3 + D3^2*(M3 + M4 + M5 + M6)" in base.text
    assert "XX3R = XX3 + YY4 - YY3 + 2*RL4*MZ4 + RL4^2*(M4 + M5 + M6)" in base.text
    assert "D3 = 0.45 m, RL4 = 0.45 m" in base.text
    assert r"ZZ_{1R} &= ZZ_{1} + \mathrm{Ia}_{1}" in base.latex
    assert "-  D" not in base.latex
    assert "Alone, as they are: XY2, YZ2" in base.text
    assert "Units: XX to ZZ kg m^2, MX to MZ kg m, M kg; Ia kg m^2, Fv N m s/rad" in base.text
    assert base._repr_markdown_().startswith("**rx90: 58 base parameters")
    assert max(map(len, base.text.splitlines())) <= 100


@pytest.mark.parametrize("build", [any_robot, right_angled_robot])
def test_formulas_have_the_values_of_the_numbers(build):
    rng = np.random.default_rng(3)
    for _ in range(6):
        base = base_parameters(build(rng))
        values = {c.text: c.value for c in constants_of(base.model)}
        for formula, row in zip(base.formulas, base.matrix, strict=True):
            found = np.zeros_like(row)
            for term in formula.terms:
                text = {"": "1", "-": "-1"}.get(term.text, term.text).replace("^", "**")
                value = float(sympy.sympify(text, locals=_symbols(values)).evalf(subs=values))
                assert value == pytest.approx(term.coefficient, rel=1e-5, abs=1e-9)
                for name in term.parameters:
                    found[base.parameter_names.index(name)] = value
            assert np.allclose(found, row, rtol=1e-5, atol=1e-9)


def _symbols(values):
    return {name: sympy.Symbol(name) for name in values}


# --- cases that other programs get wrong ---------------------------------------------------------


def table_of(*rows):
    return rm.DHTable.from_rows(rows)


def of_rows(*rows):
    return rm.RobotModel.from_table(table_of(*rows))


def test_prismatic_and_horizontal_first_axes():
    """Cases that other programs get wrong, and a robot without joints."""
    quarter = np.pi / 2
    base = base_parameters(of_rows({"sigma": 0}, {"sigma": 1, "d": 0.3}), drive=False)
    assert dict(base.regrouping["ZZ1"]) == pytest.approx({"ZZ1": 1, "ZZ2": 1, "MX2": 0.6})
    assert base.names == ("ZZ1", "M2")
    for theta, kept in ((0.0, ("MX2", "MZ2")), (quarter, ("MY2", "MZ2"))):
        model = of_rows({"sigma": 0}, {"sigma": 1, "alpha": quarter, "theta": theta})
        base = base_parameters(model, drive=False)
        assert tuple(n for n in base.names if n.startswith("M") and n != "M2") == kept
    base = base_parameters(of_rows({"sigma": 0, "alpha": quarter}, {"sigma": 0, "d": 0.4}))
    assert "Ia1" in base.regrouping["ZZ1"]
    assert "Ia2" in base.names
    for method in ("symbolic", "numeric"):
        assert len(base_parameters(of_rows({"sigma": 2, "d": 0.2}), method)) == 0


def test_coupled_motors():
    assert base_parameters(rm.load("tx40")).names[-3:] == ("Iam6", "Fvm6", "Fcm6")
    # the rotors of two parallel axes and the inertia they carry make the coupling term up
    coupled = rm.Transmission([[1.0, 0.0], [-1.0, 1.0]], Iam=[0.0, 0.1])
    for method in ("symbolic", "numeric"):
        base = base_parameters(rm.load("planar_2r").with_transmission(coupled), method)
        assert "Iam2" not in base.names


def test_gravity_loaded_prismatic_joint_keeps_its_mass_and_rotor():
    for method in ("symbolic", "numeric"):
        base = base_parameters(rm.RobotModel.from_table(table_of({"sigma": 1})), method, drive=True)
        assert base.names == ("M1", "Ia1", "Fv1", "Fc1")
        assert base.regrouping["M1"]["offset1"] == pytest.approx(
            1 / 9.81
        )  # tau = M (a + g) + offset


def test_counts_of_the_literature():
    """Rotors alone for the RX-90, rotors and friction for the UR10, by words and by members."""
    rx90 = rm.load("rx90")
    for method in ("symbolic", "numeric"):
        rotors = base_parameters(rx90, method, drive=("Ia",))
        assert len(rotors) == 40
        assert len(rotors.no_effect) == 11
        assert rotors.text.startswith("rx90: 40 base parameters of 66 standard ones")
        assert "Ia kg m^2" in rotors.text
        assert "Fv" not in rotors.text
        ur10 = base_parameters(rm.load("erd:ur10"), method, drive=("Ia", "Fv", DriveKind.FC))
        assert len(ur10) == 52
    assert rotors.drive == (DriveKind.IA,)


@pytest.mark.parametrize(
    "kinds", [("Ia",), ("offset",), ("Fv", "offset"), ("Ia", "offset"), ("Ia", "Fv", "Fc"), ()]
)
def test_methods_agree_on_any_kinds(kinds, rng):
    robots = [rm.load(name) for name in ("gantry", "cobra_s600", "tx40", "stanford_arm")]
    robots += [right_angled_robot(rng) for _ in range(8)]
    for model in robots:
        model = filled(model, rng)
        rules = base_parameters(model, drive=kinds)
        equal(rules, base_parameters(model, "numeric", drive=kinds))
        keeps_torque(rules, model, rng, kinds)
        assert pickle.loads(pickle.dumps(rules)).drive == rules.drive
        # and by recursion, with the model's own terms of the kinds that are left out
        q, v, a = rng.uniform(-1, 1, (3, 5, model.n))
        torque = rm.idm_from_base(model, rules, rules.values(model), q, v, a)
        expected = rm.idm(model, q, v, a)
        assert abs(torque - expected).max() <= 1e-11 * max(1.0, abs(expected).max())


# --- the numeric method on motion and with constraints -------------------------------------------


def test_motion_that_shows_less_keeps_less(rng):
    model = rm.load("rx90")
    q, v, a = rng.normal(size=(3, 400, 6))
    still = np.array([1, 1, 1, 0, 0, 0.0])
    whole = base_parameters(model, "numeric", motion=(q, v, a), drive=True)
    assert whole.names == base_parameters(model, drive=True).names
    part = base_parameters(model, "numeric", motion=(q * still, v * still, a * still), drive=True)
    assert len(part) < len(whole)
    W = torque_regressor(model, q * still, v * still, a * still)
    again = part.reduce(W) @ part.matrix
    assert np.allclose(again, W, atol=1e-8 * abs(W).max())


def small_log(rng, amplitude, samples=400):
    """Motion about one posture of the RX-90."""
    q, v, a = amplitude * rng.normal(size=(3, samples, 6))
    return q + rng.normal(size=6), v, a


def test_a_log_without_a_clear_gap_says_so():
    """In small motions parameters fade: the line goes to a gap, or is said to be in none."""
    model, rng = rm.load("rx90"), np.random.default_rng(0)
    moved = doubted = 0
    for amplitude in 10.0 ** np.linspace(-5.0, -3.0, 9):
        base = base_parameters(model, "numeric", motion=small_log(rng, amplitude), drive=True)
        kept, other = base.gap
        assert kept > other  # what is reported is what decided
        if kept < 100 * other:
            doubted += 1
            (note,) = (n for n in base.notes if n.startswith("No clear gap"))
            assert f"kept with {kept:.1e}" in note
            assert f"left out with {other:.1e}" in note
            assert "tolerance= (here 1e-11)" in note
            assert "richer motion" in note
            doubtful = note.split("Uncertain: ")[1].split(". Use a richer")[0].split(" and ")[0]
            assert {*doubtful.split(", ")} <= {*base.parameter_names}
            assert note[:40] in base.text
        else:
            assert not any(n.startswith("No clear gap") for n in base.notes)
            moved += kept < 1e-11 or other > 1e-11
            assert kept > 3e-13
            assert other < 3e-10
        if len(base) < 58:
            assert any(f"excites {len(base)} of the 58 base parameters" in n for n in base.notes)
    assert doubted
    assert moved
    still = np.full((20, 6), 0.3), np.zeros((20, 6)), np.zeros((20, 6))
    base = base_parameters(model, "numeric", motion=still, drive=True)
    assert "This motion excites 6 of the 58 base parameters; not kept: ZZ1," in base.notes[0]


def test_joints_bound_to_each_other(rng):
    model = rm.load("planar_3r")
    model = model.with_inertia(random_bodies(rng, 3)).with_drive(random_drive(rng, 3))
    G = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    base = base_parameters(model, "numeric", constraint=G, drive=True)
    assert len(base) < len(base_parameters(model, drive=True))
    u, du, ddu = rng.normal(size=(3, 30, 2))
    W = torque_regressor(model, u @ G.T, du @ G.T, ddu @ G.T)
    torque = np.einsum("ku,nkp->nup", G, W)
    assert np.allclose(base.reduce(torque) @ base.matrix, torque, atol=1e-9 * abs(W).max())
    same = base_parameters(model, "numeric", constraint=rm.Transmission(np.eye(3)), drive=True)
    assert same.names == base_parameters(model, drive=True).names


@pytest.mark.parametrize("name", ["rx90", "cobra_s600", "gantry", "stanford_arm", "erd:so101"])
def test_friction_models_are_columns_of_both_methods(name, rng):
    model = filled(rm.load(name), rng)
    n = model.n

    def positive():
        return rng.uniform(0.5, 2.0, n)

    asymmetric = AsymmetricFriction(positive(), positive(), positive(), positive())
    stribeck = StribeckFriction(positive(), positive(), 2 + positive(), np.full(n, 1e-3))
    q, v, a = rng.uniform(-2, 2, (3, 40, n))
    v[::2] *= 1e-3
    for friction, drive, more in (
        (asymmetric, True, 1),
        (asymmetric, False, 4),
        (stribeck, False, 3),
    ):
        rules = base_parameters(model, drive=drive, friction=friction)
        numbers = base_parameters(model, "numeric", drive=drive, friction=friction)
        equal(rules, numbers)
        # of four asymmetric columns three are Fv, Fc and offset again
        assert len(rules) == len(base_parameters(model, drive=drive)) + more * n
        W = torque_regressor(model, q, v, a, drive=drive, friction=friction)
        torque = rm.idm(model, q, v, a, drive=drive, friction=friction)
        for base in (rules, numbers):
            found = base.reduce(W) @ base.values(model)
            part = 1e-10 + 3 * turned(base)
            assert abs(found - torque).max() <= part * abs(torque).max()
    assert "Fs1" in rules.names
    assert pickle.loads(pickle.dumps(rules)).names == rules.names
    with pytest.raises(InvalidValueError, match=r"Fv columns already.*drive=\('Ia', 'offset'\)"):
        base_parameters(model, friction=stribeck, drive=True)
    with pytest.raises(InvalidValueError, match="expected a friction model"):
        base_parameters(model, friction=3.0, drive=True)


def test_notes_tell_the_tolerance_to_use():
    model = rm.load("erd:bravo7_no_ee")
    exact = base_parameters(model, tolerance=1e-11, drive=True)
    assert "tolerance=1e-08 would align them" in exact.notes[0]
    meant = base_parameters(model, tolerance=1e-8, drive=True)
    assert len(meant) == 58 < len(exact)
    assert "Treated as aligned" in meant.text
    # what a great tolerance leaves out has an effect, and is not said to have none
    assert meant.neglected == ("MX1", "MY1", "MZ2")
    assert "Neglected, about 1e-08 of the largest torque or less: MX1, MY1, MZ2" in meant.text
    assert r"MX_{1}" in meant.latex.split("Neglected")[1]
    assert not {*meant.neglected} & {*meant.no_effect, *meant.alone, *meant.in_combination}
    assert (
        base_parameters(model, "numeric", tolerance=1e-8, drive=True).neglected == meant.neglected
    )
    assert base_parameters(model, drive=True).neglected == meant.neglected
    assert base_parameters(model, drive=True).names == meant.names
    assert not base_parameters(rm.load("rx90"), tolerance=1e-4, drive=True).neglected
    for base in (exact, meant):
        assert max(map(len, base.text.splitlines())) <= 100


def test_values_have_names_and_units(rng):
    model = filled(rm.load("cobra_s600"), rng)
    base = base_parameters(model)
    table = base.value_table(model)
    assert list(table) == list(base.names)
    assert list(table.values()) == base.values(model).tolist()
    assert table["ZZ1R"] == table["ZZ1"]
    rows = [line.strip("│").split("│") for line in str(table).splitlines() if line[0] == "│"]
    cells = {row[0].strip(): (row[1].strip(), row[2].strip()) for row in rows[1:]}
    assert cells["ZZ1R"] == (f"{table['ZZ1']:.6g}", "kg m^2")
    assert [cells[k][1] for k in ("Fv1", "Fv3", "Fc1", "Fc3")] == ["N m s/rad", "N s/m", "N m", "N"]
    assert cells["M3R"][1] == "kg"
    said = " ".join(str(base).split())
    assert "; Ia kg m^2, Fv N m s/rad, Fc N m;" in said
    assert "; of prismatic joints Ia kg, Fv N s/m, Fc N " in said + " "
    again = base.value_table(base.values(model))
    assert dict(again) == dict(table)
    assert not pickle.loads(pickle.dumps(again)).numbers.flags.writeable
    with pytest.raises(ShapeError, match="values"):
        base.value_table([1.0, 2.0])
    with pytest.raises(KeyError, match=r"No base parameter 'ZZZ1'.* mean ZZ1"):
        table["ZZZ1"]


def test_constraints_are_told():
    model = rm.load("planar_3r")
    mimic = rm.Transmission([[1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    base = base_parameters(model, "numeric", constraint=mimic)
    assert "constrained: rank 2 of 3" in base.text
    assert "wrong" not in base.text
    assert base.names == base_parameters(model, "numeric", constraint=mimic.matrix[:, :2]).names
    mistake = base_parameters(rm.load("rx90"), "numeric", constraint=np.ones((6, 6)))
    assert "rank 1 of 6, so that the torques are those of one free variable." in mistake.text
    assert "6 columns of the constraint depend on each other" in mistake.notes[0]
    assert len(mistake) < 40
    assert not base_parameters(model, "numeric", constraint=np.eye(3)).notes
    own = base_parameters(model.with_transmission(mimic))
    assert "is singular, rank 2 of 3" in own.text


# --- the result ----------------------------------------------------------------------------------


def test_null_space_is_unseen(rng):
    model = rm.load("stanford_arm")
    base = base_parameters(model, drive=True)
    W = torque_regressor(model, *rng.normal(size=(3, 50, 6)))
    assert base.null_space.shape == (84, 84 - len(base))
    assert abs(W @ base.null_space).max() < 1e-11
    assert abs(base.matrix @ base.null_space).max() < 1e-14
    names = {*base.no_effect, *base.alone, *base.in_combination}
    assert names == set(parameter_names(model))
    assert "XY4" in base.alone
    assert {"YY5", "ZZ4"} <= set(base.in_combination)


def test_result_is_a_value():
    base = base_parameters(rm.load("cobra_s600"), drive=True)
    again = pickle.loads(pickle.dumps(base))
    assert again.names == base.names
    assert again.text == base.text
    assert not again.matrix.flags.writeable
    with pytest.raises(TypeError):
        base.regrouping["ZZ1"]["ZZ1"] = 2.0
    assert repr(base) == "<BaseParameters of 'cobra_s600': 22 of 56, 27 without effect, symbolic>"


def test_values_belong_to_the_robot(rng):
    arm = rm.load("rx90")
    base = base_parameters(arm)
    with pytest.raises(InvalidValueError, match=r"'puma560' has others: axis 3 has another place"):
        base.values(rm.load("puma560"))
    with pytest.raises(InvalidValueError, match="frames or kinds of joints differ"):
        base.values(rm.load("planar_2r"))
    with pytest.raises(InvalidValueError, match="gravity in the base is"):
        base.values(arm.with_gravity([0.0, 0.0, 0.0]))
    with pytest.raises(ShapeError, match="a column for each"):
        base.reduce(np.ones((4, 60)))
    # bodies, drives and tool are values of its own, and no other robot
    for other in (filled(arm, rng), arm.with_tool(random_pose(rng))):
        assert base.belongs_to(other)
        base.check(other)
    assert not base.belongs_to(rm.load("ur5"))
    wrist = rm.load("tx40")
    assert base_parameters(wrist, drive=False).belongs_to(wrist.with_transmission(None))
    with pytest.raises(InvalidValueError, match="other motors are coupled"):
        base_parameters(wrist).check(wrist.with_transmission(None))


def test_mistakes_are_named():
    model = rm.load("planar_2r")
    with pytest.raises(InvalidValueError, match=r"'symbolic', 'numeric', or a member.*'khalil'"):
        base_parameters(model, "khalil")
    with pytest.raises(InvalidValueError, match="constraint: the symbolic method"):
        base_parameters(model, constraint=np.eye(2))
    with pytest.raises(InvalidValueError, match="log is empty"):
        base_parameters(model, "numeric", motion=(np.zeros((0, 2)),) * 3)
    with pytest.raises(InvalidValueError, match="three arrays"):
        base_parameters(model, "numeric", motion=np.zeros((5, 2)))
    for tolerance in (0.0, 0.9, "a", [1e-9]):
        with pytest.raises(InvalidValueError, match="tolerance"):
            base_parameters(model, "numeric", tolerance=tolerance)
    with pytest.raises(
        InvalidValueError, match="drive: expected one of 'ia', 'fv', 'fc', 'offset'"
    ):
        base_parameters(model, drive=("rotor",))
    with pytest.raises(ShapeError, match=r"constraint: expected shape \(2, u\)"):
        base_parameters(model, "numeric", constraint=np.eye(3))
    with pytest.raises(InvalidValueError, match="no joint moves"):
        base_parameters(model, "numeric", constraint=np.zeros((2, 1)))
