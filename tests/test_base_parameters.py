"""Base parameters: rules against numbers, torques kept, SYMORO's tables, what the book prints."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
import sympy
from identities.random_robots import random_bodies, random_drive, random_pose, random_table

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.friction import AsymmetricFriction, StribeckFriction
from robotmodels.minimal_parameters import BaseMethod, base_parameters
from robotmodels.minimal_parameters.alignment import aligned_robot
from robotmodels.minimal_parameters.formulas import constants_of
from robotmodels.minimal_parameters.numeric import TorqueColumns, residual_warning
from robotmodels.minimal_parameters.rules import reach
from robotmodels.regressors import parameter_names, torque_regressor

GRAVITIES = ((0.0, 0.0, -9.81), (0.0, -9.81, 0.0), (-9.81, 0.0, 0.0), (0.0, 0.0, 0.0))
CATALOGUE = [name for name in rm.robots() if rm.load(name).f < 30]  # frozen ones have all


KINDS = (True, False, ("Ia", "Fv", "Fc"), ("Ia",), ("Fv", "offset"), ())


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


def turned(base):
    """Sum of the angles of the axes that were taken as aligned: a bound of torque errors."""
    aligned = aligned_robot(base.model, base.angle).model.chain.rotation
    return np.linalg.norm(aligned - base.model.chain.rotation, axis=(1, 2)).sum()


def by_both(model, rng, within=1e-10, **options):
    """Base parameters by both methods: the same names, and the torques of each parameter."""
    options = {"drive": True, **options}
    both = [base_parameters(model, way, **options) for way in BaseMethod]
    assert both[0].names == both[1].names
    assert both[0].no_effect == both[1].no_effect
    size, drive, friction = reach(model), both[0].drive, both[0].friction
    slides = np.where(model.table.sigma[model.table.joint_rows] == 1, size, 1.0)
    q, v, a = rng.uniform(-1, 1, (3, 12, model.n)) * slides
    rate = np.sqrt(9.81 / size)
    W = torque_regressor(model, np.pi * q, rate * v, rate**2 * a, drive=drive, friction=friction)
    sizes = TorqueColumns(model, drive, friction).sizes
    W = (W * slides[:, None]).reshape(-1, len(sizes)) * sizes
    for base in both:
        again = base.reduce(W) @ (base.matrix * sizes / sizes[base.kept][:, None])
        lengths = np.linalg.norm(W, axis=0).max(initial=1e-300)
        off = np.linalg.norm(again - W, axis=0).max(initial=0.0)
        assert off <= (within + 3 * turned(base)) * lengths
    return both


def filled(model, rng):
    """Physical bodies and drives on every joint."""
    model = model.with_inertia(random_bodies(rng, model.f))
    if model.transmission is None:
        model = model.with_drive(random_drive(rng, model.n))
    return model


def of_rows(*rows):
    return rm.RobotModel.from_table(rm.DHTable.from_rows(rows))


@pytest.mark.parametrize("name", CATALOGUE)
@pytest.mark.nightly
def test_rules_and_numbers_agree_on_the_catalogue(name, rng):
    rules, numbers = by_both(rm.load(name), rng)
    kept, dependent = numbers.gap
    assert dependent < (2e-11 if numbers.notes else 1e-13)
    assert kept > (1e-4 if numbers.notes else 0.01)  # no parameter that no log would show
    if rules.notes:
        exact, _ = by_both(rm.load(name), rng, tolerance=1e-11)
        assert turned(exact) < 1e-9


@pytest.mark.parametrize("build", [any_robot, right_angled_robot])
def test_rules_and_numbers_agree_on_random_robots(build):
    rng = np.random.default_rng(7)
    for k in range(100):
        model = build(rng)
        rules, _ = by_both(model, rng, drive=KINDS[k % len(KINDS)])
        if k % 5 == 0:
            model = filled(model, rng)
            q, v, a = rng.uniform(-2, 2, (3, 5, model.n))
            torque = rm.idm(model, q, v, a)
            again = rm.idm_from_base(model, rules, rules.values(model), q, v, a)
            assert abs(again - torque).max(initial=0) <= 1e-10 * abs(torque).max(initial=1e-300)


def moved(model, rng, angles, lengths=0.0, share=1.0):
    """A robot with some angles and lengths off by these amounts, and by a tenth at least."""
    table, f = model.table, model.f

    def off(column, most):
        change = rng.choice([-1, 1], f) * most * rng.uniform(0.1, 1.0, f)
        return column + change * (rng.random(f) < share)

    theta = np.where(table.sigma == 0, table.theta, off(table.theta, angles))
    lengths = {"d": off(table.d, lengths), "r": off(table.r, lengths)}
    return model.with_table(table.replace(alpha=off(table.alpha, angles), theta=theta, **lengths))


def test_methods_agree_on_what_is_nearly_aligned():
    """Angles and lengths from rounding to a hundredth decide nothing about the torques."""
    rng = np.random.default_rng(11)
    for _ in range(40):
        off = 10.0 ** rng.uniform(-13.0, -2.0)
        model = moved(right_angled_robot(rng), rng, off, off, 0.4)
        for tolerance in (None, 1e-11):
            for base in by_both(model, rng, within=3e-10, tolerance=tolerance):
                assert not any("NOT TO BE USED" in note for note in base.notes)
        assert turned(base) < 1e-9


@pytest.mark.nightly
def test_axes_within_1e_5_rad_are_aligned_in_the_regrouping():
    rng = np.random.default_rng(12)
    apart = 0
    for _ in range(20):
        model = right_angled_robot(rng)
        rounded = moved(model, rng, 9e-6)
        for meant, base in zip(by_both(model, rng), by_both(rounded, rng), strict=True):
            assert base.names == meant.names
            assert {*base.no_effect, *base.neglected} <= {*meant.no_effect}
            assert abs(base.matrix - meant.matrix).max(initial=0.0) < 1e-4
            assert base.model is rounded  # poses and torques keep the digits
            if base.notes:
                assert base.notes[0].startswith("Treated as aligned: ")
                assert f"robot by up to {base.torque_error:.0e} of the largest" in base.notes[1]
                assert 0.0 < base.torque_error < 3 * turned(base)
        # not so beyond 1e-5 rad, and not if every digit is meant
        by_both(moved(model, rng, 3e-4), rng, within=3e-10)
        exact, _ = by_both(rounded, rng, tolerance=1e-11, within=3e-10)
        assert turned(exact) < 1e-10
        apart += len(exact) > len(meant)
    assert apart > 5


def test_gravity_and_the_first_axis_are_aligned_in_any_base(rng):
    """Also where no angle of the table is a right one: a wall, a slope, a fixed frame between."""
    rows = [{"sigma": 2, "alpha": 0.7, "theta": 0.4}, {"sigma": 0, "alpha": 0.5, "d": 0.2}]
    arm = of_rows(*rows, {"sigma": 0, "alpha": 0.3, "beta": 0.2, "d": 0.4})
    first = rm.link_poses(arm, np.zeros(2))[1][:3, :3]
    for down, across in ((first[:, 2], first[:, 0]), (first[:, 1], first[:, 2])):
        off = down + 5e-6 * across
        meant = base_parameters(arm.with_gravity(9.81 * down), drive=True)
        for base in by_both(arm.with_gravity(9.81 * off / np.linalg.norm(off)), rng):
            assert base.names == meant.names
            assert "axis 2 and gravity" in base.notes[0]
            assert "but for 5.0e-06 rad" in base.notes[0]


def test_a_slope_of_prismatic_joints_is_aligned(rng):
    """The third axis is aligned with the first and gravity, and not with the one before it."""
    eighth = np.pi / 4
    rows = [{"sigma": 1, "alpha": 2 * eighth}, {"sigma": 1, "alpha": eighth, "d": 0.3}]
    rows += [{"sigma": 1, "alpha": eighth}, {"sigma": 0, "alpha": 2 * eighth, "d": 0.1}]
    exact = of_rows(*rows)
    rounded = exact.with_table(exact.table.replace(alpha=exact.table.alpha.round(4)))
    for base in by_both(rounded, rng):
        assert base.names == base_parameters(exact, drive=True).names
        assert "axis 3 and gravity" in base.notes[0]
        assert "axis 3 and axis 1 perpendicular" in base.notes[0]


def test_torque_errors_are_noted():
    base = base_parameters(rm.load("rx90"), "numeric")
    assert base.torque_error < 1e-14
    assert not base.notes
    words = "NOT TO BE USED: these base parameters have torque errors of 2.0e-01"
    assert words in residual_warning(0.2, 1e-11)[0]


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
    for line in (
        "ZZ1R = ZZ1 + Ia1 + YY2 + YY3 + D3^2*(M3 + M4 + M5 + M6)",
        "XX3R = XX3 + YY4 - YY3 + 2*RL4*MZ4 + RL4^2*(M4 + M5 + M6)",
        "D3 = 0.45 m, RL4 = 0.45 m",
        "Alone, as they are: XY2, YZ2",
        "Units: XX to ZZ kg m^2, MX to MZ kg m, M kg; Ia kg m^2, Fv N m s/rad",
    ):
        assert line in base.text
    assert r"ZZ_{1R} &= ZZ_{1} + \mathrm{Ia}_{1}" in base.latex
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
                value = float(
                    sympy.sympify(text, locals={c: sympy.Symbol(c) for c in values}).evalf(
                        subs=values
                    )
                )
                assert value == pytest.approx(term.coefficient, rel=1e-5, abs=1e-9)
                for name in term.parameters:
                    found[base.parameter_names.index(name)] = value
            assert np.allclose(found, row, rtol=1e-5, atol=1e-9)


# --- cases that other programs get wrong ---------------------------------------------------------


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


def test_counts_of_the_literature_and_coupled_motors():
    for method in BaseMethod:  # counts of the literature
        assert len(base_parameters(rm.load("rx90"), method, drive=("Ia",))) == 40
        assert len(base_parameters(rm.load("erd:ur10"), method)) == 52
    assert base_parameters(rm.load("tx40")).names[-3:] == ("Iam6", "Fvm6", "Fcm6")
    # the rotors of two parallel axes and the inertia they carry make the coupling term up
    coupled = rm.Transmission([[1.0, 0.0], [-1.0, 1.0]], Iam=[0.0, 0.1])
    for method in BaseMethod:
        base = base_parameters(rm.load("planar_2r").with_transmission(coupled), method)
        assert "Iam2" not in base.names


def test_gravity_loaded_prismatic_joint_keeps_its_mass_and_rotor():
    """The torque is M (a + g) + Ia a + offset."""
    for method in BaseMethod:
        base = base_parameters(of_rows({"sigma": 1}), method, drive=True)
        assert base.names == ("M1", "Ia1", "Fv1", "Fc1")
        assert base.regrouping["M1"]["offset1"] == pytest.approx(1 / 9.81)


# --- the numeric method on motion and with constraints -------------------------------------------


def test_a_log_without_a_clear_gap_is_noted():
    """In small motions parameters fade: the tolerance moves to a gap, or a note names them."""
    model, rng = rm.load("rx90"), np.random.default_rng(0)
    moved = doubted = 0
    for amplitude in 10.0 ** np.linspace(-5.0, -3.0, 9):
        q, v, a = amplitude * rng.normal(size=(3, 400, 6))
        motion = q + rng.normal(size=6), v, a
        base = base_parameters(model, "numeric", motion=motion, drive=True)
        kept, other = base.gap
        assert kept > other
        notes = [n for n in base.notes if n.startswith("No clear gap")]
        assert bool(notes) == (kept < 100 * other)
        if notes:
            doubted += 1
            assert f"kept with {kept:.1e}" in notes[0]
            assert f"left out with {other:.1e}" in notes[0]
            assert "Use a richer motion, or state the zero tolerance= (here 1e-11)" in notes[0]
            names = notes[0].split("Uncertain: ")[1].split(". Use a richer")[0].split(" and ")[0]
            assert {*names.split(", ")} <= {*base.parameter_names}
        else:
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
    G = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    base = base_parameters(model, "numeric", constraint=G, drive=True)
    assert len(base) < len(base_parameters(model, drive=True))
    u, du, ddu = rng.normal(size=(3, 30, 2))
    W = np.einsum("ku,nkp->nup", G, torque_regressor(model, u @ G.T, du @ G.T, ddu @ G.T))
    assert np.allclose(base.reduce(W) @ base.matrix, W, atol=1e-9 * abs(W).max())
    same = base_parameters(model, "numeric", constraint=rm.Transmission(np.eye(3)), drive=True)
    assert same.names == base_parameters(model, drive=True).names
    mimic = rm.Transmission([[1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    again = base_parameters(model, "numeric", constraint=mimic, drive=True)
    assert again.names == base.names
    assert "constrained: rank 2 of 3" in base.text
    mistake = base_parameters(rm.load("rx90"), "numeric", constraint=np.ones((6, 6)))
    assert "rank 1 of 6, torques of 1 free variables." in mistake.text
    assert "6 columns of the constraint depend on each other" in mistake.notes[0]
    assert "is singular, rank 2 of 3" in base_parameters(model.with_transmission(mimic)).text


@pytest.mark.parametrize("name", ["rx90", "cobra_s600", "gantry", "erd:so101"])
def test_friction_models_are_columns_of_both_methods(name, rng):
    model = filled(rm.load(name), rng)
    n = model.n
    Fv, Fc, Fs, positive = rng.uniform(0.5, 2.0, (4, n))
    asymmetric = AsymmetricFriction(Fv, Fc, Fs, positive)
    stribeck = StribeckFriction(Fv, Fc, 2 + Fs, np.full(n, 1e-3))
    # of four asymmetric columns three are Fv, Fc and offset again
    for friction, drive, more in (
        (asymmetric, True, 1), (asymmetric, False, 4), (stribeck, False, 3),
    ):  # fmt: skip
        rules, _ = by_both(model, rng, drive=drive, friction=friction)
        assert len(rules) == len(base_parameters(model, drive=drive)) + more * n
    q, v, a = rng.uniform(-2, 2, (3, 40, n))
    torque = rm.idm(model, q, v, a, drive=False, friction=stribeck)
    W = torque_regressor(model, q, v, a, drive=False, friction=stribeck)
    off = abs(rules.reduce(W) @ rules.values(model) - torque).max()
    assert off <= (1e-10 + 3 * turned(rules)) * abs(torque).max()
    with pytest.raises(InvalidValueError, match=r"Fv columns already.*drive=\('Ia', 'offset'\)"):
        base_parameters(model, friction=stribeck, drive=True)


def test_notes_name_the_tolerance_to_use():
    model = rm.load("erd:bravo7_no_ee")
    exact = base_parameters(model, tolerance=1e-11, drive=True)
    assert "tolerance=1e-08 would align them" in exact.notes[0]
    meant = base_parameters(model, tolerance=1e-8, drive=True)
    assert len(meant) == 58 < len(exact)
    assert "Treated as aligned" in meant.text
    # what a great tolerance leaves out has an effect, and is not listed without one
    assert meant.neglected == ("MX1", "MY1", "MZ2")
    assert "Neglected, about 1e-08 of the largest torque or less: MX1, MY1, MZ2" in meant.text
    assert r"MX_{1}" in meant.latex.split("Neglected")[1]
    assert not {*meant.neglected} & {*meant.no_effect, *meant.alone, *meant.in_combination}
    for base in (base_parameters(model, "numeric", tolerance=1e-8, drive=True),
                 base_parameters(model, drive=True)):  # fmt: skip
        assert (base.names, base.neglected) == (meant.names, meant.neglected)


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
    text = " ".join(str(base).split())
    assert "; Ia kg m^2, Fv N m s/rad, Fc and offset N m;" in text
    assert "; of prismatic joints Ia kg, Fv N s/m, Fc and offset N" in text
    again = pickle.loads(pickle.dumps(base.value_table(base.values(model))))
    assert dict(again) == dict(table)
    assert not again.numbers.flags.writeable
    with pytest.raises(ShapeError, match="values"):
        base.value_table([1.0, 2.0])
    with pytest.raises(KeyError, match=r"No base parameter 'ZZZ1'.* mean ZZ1"):
        table["ZZZ1"]


# --- the result ----------------------------------------------------------------------------------


def test_null_space_has_no_torque(rng):
    base = base_parameters(rm.load("stanford_arm"), drive=True)
    W = torque_regressor(base.model, *rng.normal(size=(3, 50, 6)))
    assert base.null_space.shape == (84, 84 - len(base))
    assert abs(W @ base.null_space).max() < 1e-11
    assert abs(base.matrix @ base.null_space).max() < 1e-14
    names = {*base.no_effect, *base.alone, *base.in_combination}
    assert names == set(parameter_names(base.model))
    assert "XY4" in base.alone
    assert {"YY5", "ZZ4"} <= set(base.in_combination)


def test_values_belong_to_the_robot(rng):
    arm = rm.load("rx90")
    base = base_parameters(arm)
    with pytest.raises(InvalidValueError, match=r"'puma560' has others: axis 3 has another"):
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
    for error, words, given in (
        (InvalidValueError, r"'symbolic', 'numeric', or a member.*'khalil'", {"method": "khalil"}),
        (InvalidValueError, "symbolic method", {"method": "symbolic", "constraint": np.eye(2)}),
        (InvalidValueError, "log is empty", {"motion": (np.zeros((0, 2)),) * 3}),
        (InvalidValueError, "three arrays", {"motion": np.zeros((5, 2))}),
        (InvalidValueError, "tolerance", {"tolerance": 0.0}),
        (InvalidValueError, "drive: expected one of 'ia', 'fv'", {"drive": ("rotor",)}),
        (ShapeError, r"constraint: expected shape \(2, u\)", {"constraint": np.eye(3)}),
        (InvalidValueError, "no joint moves", {"constraint": np.zeros((2, 1))}),
        (InvalidValueError, "expected a friction model", {"friction": 3.0}),
    ):
        with pytest.raises(error, match=words):
            base_parameters(rm.load("planar_2r"), **{"method": "numeric", **given})
