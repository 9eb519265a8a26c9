"""Base parameters: rules against numbers, torques kept, what the book prints."""

import pickle

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


KINDS = (True, False, ("Ia", "Fv", "Fc"), ("Ia",), ("Fv", "offset"), ())


def any_robot(rng):
    """Anything: trees, fixed frames, gamma and b, oblique axes, rotated bases, gravity or none."""
    f = int(rng.integers(1, 9))
    table = random_table(rng, f, bool(rng.random() < 0.4), fixed=bool(rng.random() < 0.3))
    # between parallel and not parallel there is a range that no rank can decide
    table = table.replace(beta=np.where(abs(table.beta) < 1e-2, 0.0, table.beta))
    base = None if rng.random() < 0.5 else random_pose(rng)
    gravity = rng.normal(size=3) if rng.random() < 0.3 else GRAVITIES[rng.integers(4)]
    return rm.RobotModel.from_table(table, base=base, gravity=gravity)


def right_angled_robot(rng):
    """Right angles and few lengths: parallel, perpendicular, collinear and meeting axes abound."""
    f = int(rng.integers(1, 8))
    tree = rng.random() < 0.4
    antecedent = [int(rng.integers(0, j + 1)) if tree else j for j in range(f)]
    sigma = rng.choice([0, 0, 1, 1, 2] if rng.random() < 0.3 else [0, 1], size=f)
    if (sigma == 2).all():
        sigma[0] = 0
    angles = rng.integers(-2, 3, (3, f)) * np.pi / 2 * (rng.random((3, f)) < 0.6)
    lengths = np.where(rng.random((3, f)) < 0.6, 0.0, rng.choice([0.3, 0.5], (3, f)))
    table = rm.DHTable(
        antecedent=antecedent, sigma=sigma, alpha=angles[0], theta=angles[1],
        gamma=angles[2] * tree, d=lengths[0], r=lengths[1], b=lengths[2] * tree,
    )  # fmt: skip
    return rm.RobotModel.from_table(table, gravity=GRAVITIES[rng.integers(4)])


def turned(base):
    """Sum of the angles of the axes that were taken as aligned: a bound of torque errors."""
    aligned = aligned_robot(base.model, base.angle)[0].chain.rotation
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


# --- what the book prints ------------------------------------------------------------------------


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
        symbols = {c: sympy.Symbol(c) for c in values}
        found = np.zeros_like(base.matrix)
        for formula, row in zip(base.formulas, found, strict=True):
            for term in formula.terms:
                text = {"": "1", "-": "-1"}.get(term.text, term.text).replace("^", "**")
                value = float(sympy.sympify(text, locals=symbols).evalf(subs=values))
                assert value == pytest.approx(term.coefficient, rel=1e-5, abs=1e-9)
                row[[base.parameter_names.index(name) for name in term.parameters]] = value
        assert np.allclose(found, base.matrix, rtol=1e-5, atol=1e-9)


# --- cases that other programs get wrong ---------------------------------------------------------


def test_counts_of_the_literature_and_coupled_motors():
    # the rotors of two parallel axes and the inertia they carry make the coupling term up
    coupled = rm.Transmission([[1.0, 0.0], [-1.0, 1.0]], Iam=[0.0, 0.1])
    planar = rm.load("planar_2r").with_transmission(coupled)
    for method in BaseMethod:
        assert len(base_parameters(rm.load("rx90"), method, drive=("Ia",))) == 40
        assert len(base_parameters(rm.load("erd:ur10"), method)) == 52
        assert "Iam2" not in base_parameters(planar, method).names
    assert base_parameters(rm.load("tx40")).names[-3:] == ("Iam6", "Fvm6", "Fcm6")


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
            for words in (f"kept with {kept:.1e}", f"left out with {other:.1e}", "(here 1e-11)"):
                assert words in notes[0]
        else:
            moved += kept < 1e-11 or other > 1e-11
            assert kept > 3e-13
            assert other < 3e-10
        if len(base) < 58:
            assert any(f"excites {len(base)} of the 58 base parameters" in n for n in base.notes)
    assert doubted
    assert moved


def test_joints_bound_to_each_other(rng):
    model = rm.load("planar_3r")
    G = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    free = base_parameters(model, drive=True)
    base = base_parameters(model, "numeric", constraint=G, drive=True)
    assert len(base) < len(free)
    u, du, ddu = rng.normal(size=(3, 30, 2))
    W = np.einsum("ku,nkp->nup", G, torque_regressor(model, u @ G.T, du @ G.T, ddu @ G.T))
    assert np.allclose(base.reduce(W) @ base.matrix, W, atol=1e-9 * abs(W).max())
    mimic = rm.Transmission([[1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    for constraint, names in ((rm.Transmission(np.eye(3)), free.names), (mimic, base.names)):
        again = base_parameters(model, "numeric", constraint=constraint, drive=True)
        assert again.names == names
    assert "constrained: rank 2 of 3" in base.text
    mistake = base_parameters(rm.load("rx90"), "numeric", constraint=np.ones((6, 6)))
    assert "6 columns of the constraint depend on each other" in mistake.notes[0]
    assert "is singular, rank 2 of 3" in base_parameters(model.with_transmission(mimic)).text


@pytest.mark.parametrize("name", ["rx90", "cobra_s600", "gantry"])
def test_friction_models_are_columns_of_both_methods(name, rng):
    model = filled(rm.load(name), rng)
    n = model.n
    Fv, Fc, Fs, positive = rng.uniform(0.5, 2.0, (4, n))
    asymmetric = AsymmetricFriction(Fv, Fc, Fs, positive)
    stribeck = StribeckFriction(Fv, Fc, 2 + Fs, np.full(n, 1e-3))
    # of four asymmetric columns three are Fv, Fc and offset again
    cases = ((asymmetric, True, 1), (asymmetric, False, 4), (stribeck, False, 3))
    for friction, drive, more in cases:
        rules, _ = by_both(model, rng, drive=drive, friction=friction)
        assert len(rules) == len(base_parameters(model, drive=drive)) + more * n
    with pytest.raises(InvalidValueError, match=r"Fv columns already.*drive=\('Ia', 'offset'\)"):
        base_parameters(model, friction=stribeck, drive=True)


def test_notes_name_the_tolerance_to_use():
    model = rm.load("erd:bravo7_no_ee")
    exact = base_parameters(model, tolerance=1e-11, drive=True)
    assert "tolerance=1e-08 would align them" in exact.notes[0]
    meant = base_parameters(model, tolerance=1e-8, drive=True)
    assert len(meant) == 58 < len(exact)
    # what a great tolerance leaves out has an effect, and is not listed without one
    assert meant.neglected == ("MX1", "MY1", "MZ2")
    assert "Neglected, about 1e-08 of the largest torque or less: MX1, MY1, MZ2" in meant.text
    assert not {*meant.neglected} & {*meant.no_effect, *meant.alone, *meant.in_combination}


def test_values_have_names_and_units(rng):
    model = filled(rm.load("cobra_s600"), rng)
    base = base_parameters(model)
    table = base.value_table(model)
    assert list(table.values()) == base.values(model).tolist()
    rows = [line.strip("│").split("│") for line in str(table).splitlines() if line[0] == "│"]
    cells = {row[0].strip(): (row[1].strip(), row[2].strip()) for row in rows[1:]}
    assert cells["ZZ1R"] == (f"{table['ZZ1R']:.6g}", "kg m^2")
    assert [cells[k][1] for k in ("Fv1", "Fv3", "Fc1", "Fc3")] == ["N m s/rad", "N s/m", "N m", "N"]
    text = " ".join(str(base).split())
    assert "; Ia kg m^2, Fv N m s/rad, Fc and offset N m;" in text
    assert "; of prismatic joints Ia kg, Fv N s/m, Fc and offset N" in text
    again = pickle.loads(pickle.dumps(base.value_table(base.values(model))))
    assert dict(again) == dict(table)
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


def test_values_belong_to_the_robot(rng):
    arm, wrist = rm.load("rx90"), rm.load("tx40")
    base, coupled = base_parameters(arm), base_parameters(wrist)
    for one, other, words in (
        (base, rm.load("puma560"), "'puma560' has others: axis 3 has another"),
        (base, rm.load("planar_2r"), "frames or kinds of joints differ"),
        (base, arm.with_gravity([0.0, 0.0, 0.0]), "gravity in the base is"),
        (coupled, wrist.with_transmission(None), "other motors are coupled"),
    ):
        with pytest.raises(InvalidValueError, match=words):
            one.values(other)
        assert not one.belongs_to(other)
    with pytest.raises(ShapeError, match="a column for each"):
        base.reduce(np.ones((4, 60)))
    # bodies, drives and tool are values of its own, and no other robot
    assert base.belongs_to(filled(arm, rng).with_tool(random_pose(rng)))
    assert base_parameters(wrist, drive=False).belongs_to(wrist.with_transmission(None))


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
