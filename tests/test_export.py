"""Flat code of models: the tape against the library, every language against the tape."""

import ctypes
import pickle
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
from identities.random_robots import random_model, random_rotation, random_state

import robotmodels as rm
from robotmodels import export
from robotmodels.errors import RobotModelsError
from robotmodels.export.inverse import _SOLVERS, Limits
from robotmodels.export.tape import Tape, function
from robotmodels.igm.paul import layout

KINDS = (
    "dgm", "jacobian", "idm", "mass_matrix", "bias", "gravity_torque", "torque_regressor",
    "base_regressor", "ddm",
)  # fmt: skip
FORCED = ("idm", "bias", "ddm")
ARMS = (
    "lab_rr", "lab_rrt", "lab_trr", "planar_2r", "planar_3r", "gantry", "rx90", "tx40", "puma560",
    "stanford_arm", "cobra_s600", "ur5", "kr6_r900", "irb6640", "xarm5",
)  # fmt: skip
TURNS = [0, *(pytest.param(k, marks=pytest.mark.nightly) for k in range(1, 30))]
CC = shutil.which("cc") or shutil.which("gcc")
needs_compiler = pytest.mark.skipif(CC is None, reason="no C compiler (cc, gcc) is on the path")


def random_robot(seed):
    """Serial or tree, revolute and prismatic, fixed frames, beta, base rotated, coupled motors."""
    rng = np.random.default_rng(seed)
    flags = dict(
        zip(("tree", "fixed", "drive", "transmission"), (rng.random(4) < 0.5).tolist(), strict=True)
    )
    return random_model(rng, f=int(rng.integers(1, 9)), tip="any", **flags), rng


def inputs_of(program, **given):
    """Inputs by name; parameters of the model."""
    named = zip(program.inputs, program.values, strict=True)
    return [given.get(port.name, np.array(values)) for port, values in named]


def library(model, kind, drive, q, v, a, wrench):
    """The same quantity by the package itself."""
    base = rm.base_parameters(model, drive=("Ia", "Fv", "Fc") if drive else False)
    return {
        "dgm": lambda: rm.dgm(model, q),
        "jacobian": lambda: rm.jacobian(model, q),
        "idm": lambda: rm.idm(model, q, v, a, wrench, drive=drive),
        "bias": lambda: rm.idm(model, q, v, 0 * a, wrench, drive=drive),
        "mass_matrix": lambda: rm.mass_matrix(model, q, drive=drive),
        "gravity_torque": lambda: rm.gravity_torque(model, q),
        "torque_regressor": lambda: rm.torque_regressor(model, q, v, a, drive=drive),
        "base_regressor": lambda: rm.torque_regressor(
            model, q, v, a, drive=base.drive, columns=base
        ),
        "ddm": lambda: rm.ddm(model, q, v, a, wrench, drive=drive),
    }[kind]()


def close(actual, expected, tolerance=1e-12):
    assert actual.shape == expected.shape
    size = max(1.0, np.abs(expected).max(initial=0.0))
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * size)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("turn", [*range(1, 6), *TURNS[:1], *TURNS[6:]])
@pytest.mark.parametrize("drive", [True, False])
def test_the_tape_is_the_library(turn, drive):
    model, rng = random_robot(turn)
    q, v, a = random_state(model, rng, 4)
    given = {"q": q, "v": v, "a": a, "tau": a, "wrench": rng.normal(size=(4, 6))}
    base = rm.base_parameters(model, drive=("Ia", "Fv", "Fc") if drive else False)
    of_base = rm.base_model(model, base, base.values(model))
    for kind in KINDS:
        dynamic = kind in ("idm", "mass_matrix", "bias", "gravity_torque", "ddm")
        for parameters in ("numbers", "symbols", "base") if dynamic else ("numbers",):
            robot = of_base if parameters == "base" else model
            expected = library(robot, kind, drive, q, v, a, given["wrench"])
            for geometry in ("numbers", "symbols"):
                program = export.program(
                    model, kind, parameters, geometry, drive=drive, wrench=kind in FORCED
                )
                actual = program(*inputs_of(program, **given))
                close(actual, expected, 1e-10 if kind == "ddm" else 1e-12)
    for frame in (0, model.f, *model.frame_names):
        close(export.program(model, "dgm", frame=frame)(q), rm.dgm(model, q, frame))
        J = export.program(model, "jacobian", frame=frame, geometry="symbols")
        close(J(*inputs_of(J, q=q)), rm.jacobian(model, q, frame))


def test_joints_that_mimic_others(rng):
    two = rm.Transmission([[1.0, 0.0, 0.0], [-0.5, 0.0, 0.0], [0.2, 0.0, 1.0]], [0.1, 0.2, -0.1])
    model = random_model(rng, f=3, prismatic=False, drive=True).with_transmission(two)
    q, v, tau = rng.normal(size=(3, 3))
    q, v = two.to_joint(q), two.matrix @ v
    program = export.program(model, "ddm")
    close(program(q, v, tau), rm.ddm(model, q, v, tau), 1e-10)
    assert "mimic" in program.code("c")


# --- operations ----------------------------------------------------------------------------------


def general_arm(n, seed=0):
    rng = np.random.default_rng(seed)
    columns = {name: rng.uniform(0.1, 1.0, n) for name in ("alpha", "d", "theta", "r")}
    table = rm.DHTable(antecedent=range(n), sigma=[0] * n, **columns)
    return rm.RobotModel.from_table(table, gravity=9.81 * random_rotation(rng)[0])


@pytest.mark.parametrize("n", [3, 6, 7, 9])
def test_operations_stay_below_the_bound_of_khalil_and_kleinfinger(n):
    count = export.program(general_arm(n), "idm", parameters="base", drive=False).count
    assert count.multiplications <= 92 * n - 127
    assert count.additions <= 81 * n - 117
    assert (count.functions, count.divisions) == (2 * n, 0)


def test_operations_beside_a_file_that_symoro_printed():
    """Racer 3, centrifugal, Coriolis and gravity torques: 306 products and 295 sums in SYMORO+."""
    angles = {"alpha": [0, -90, 0, -90, 90, -90], "theta": [0, -90, 0, 0, 0, 0]}
    lengths = {"d": [0, 0.05, 0.27, 0.05, 0, 0], "r": [0.365, 0, 0, 0.305, 0, 0]}
    columns = {**lengths, **{name: np.deg2rad(x) for name, x in angles.items()}}
    table = rm.DHTable(antecedent=range(6), sigma=[0] * 6, **columns)
    arm = rm.RobotModel.from_table(table)
    count = export.program(arm, "bias", "symbols", "symbols", drive=("Fv", "Fc")).count
    assert count.multiplications <= 306
    assert count.additions <= 295


def test_numbers_need_fewer_operations_than_symbols():
    model = rm.load("puma560")
    counts = [
        export.program(model, "idm", parameters=choice).count.multiplications
        for choice in ("numbers", "base", "symbols")
    ]
    assert counts == sorted(counts)
    assert counts[0] < 200  # the numbers are those of the base parameters
    assert export.program(model, "dgm").count.functions == 2 * model.n
    planar = export.program(rm.load("planar_2r"), "gravity_torque", "base", drive=False)
    assert planar.count.functions <= 4
    assert all("=" in line for line in planar.lines)
    # constants of angles are exact
    for theta, sine in ((30, 0.5), (45, 0.5**0.5), (-90, -1.0), (180, 0.0), (-120, -(0.75**0.5))):
        table = rm.DHTable.from_rows([{"sigma": 1, "alpha": theta}], degrees=True)
        assert export.program(rm.RobotModel.from_table(table), "dgm")([0.0])[2, 1] == sine


def test_the_tape_shares_and_folds():
    tape = Tape()
    x, y = (tape.scalar("input", 0, k) for k in range(2))
    assert (x * y).number == (y * x).number == -(x * -y).number
    assert (x + y).number == (y + x).number == -(-x - y).number
    assert (x - y).number == -(y - x).number
    assert function("sin", -x).number == -function("sin", x).number
    assert function("cos", -x).number == function("cos", x).number
    assert (2.0 * (-3.0 * x)).number == (-6.0 * x).number
    assert (x - x, 0.0 * x, 0.0 / y) == (0.0, 0.0, 0.0)
    assert (1.0 * x).number == (x + 0.0).number == x.number
    result = (x * y + 2.0) / (x - y)
    frozen = tape.frozen([[result, -x]])
    assert frozen.count() == (1, 2, 0, 1)


# --- languages -----------------------------------------------------------------------------------


def compiled(program, folder):
    """The function of the C code, called with arrays, as a list of outputs."""
    source, library = folder / "code.c", folder / f"{program.name}.so"
    export.write(program, source)
    flags = ["-O2", "-Wall", "-Wextra", "-Werror", "-std=c99", "-pedantic", "-shared", "-fPIC"]
    subprocess.run([CC, *flags, "-o", library, source, "-lm"], check=True)
    function = getattr(ctypes.CDLL(str(library)), program.name)

    def call(*inputs):
        arrays = [np.ascontiguousarray(x, np.float64) for x in inputs]
        outputs = [np.full(port.shape, 7.0) for port in program.outputs]
        function(*(x.ctypes.data_as(ctypes.c_void_p) for x in (*arrays, *outputs)))
        return tuple(outputs)

    return call


def executed(program, language):
    """The one public function of the Python code."""
    space = {}
    exec(program.code(language), space)
    public = [name for name, x in space.items() if callable(x) and name[0] != "_"]
    assert public == [program.name]
    return space[program.name]


def in_casadi(program):
    """The graph of the CasADi code, called with arrays, as a list of outputs."""
    casadi = pytest.importorskip("casadi")
    shapes = [port.shape if len(port.shape) == 2 else (*port.shape, 1) for port in program.inputs]
    symbols = [casadi.SX.sym(p.name, *s) for p, s in zip(program.inputs, shapes, strict=True)]
    results = outputs(executed(program, "casadi")(*symbols))
    graph = casadi.Function("f", symbols, list(results))
    return lambda *x: tuple(
        np.array(y).reshape(port.shape)
        for port, y in zip(program.outputs, graph.call([casadi.DM(a) for a in x]), strict=True)
    )


def programs(turn):
    """Every model with inputs; random robots, other options in each turn."""
    for k, kind in enumerate((*KINDS, "igm")):
        model, rng = random_robot(20 + k + 10 * turn)
        model = rm.load(("rx90", *ARMS)[turn % len(ARMS)]) if kind == "igm" else model
        options = {"wrench": True} if kind in FORCED else {}
        if kind in ("idm", "mass_matrix", "ddm"):
            options["parameters"] = ("numbers", "symbols", "base")[(k + turn) % 3]
        options |= {"geometry": "symbols"} if (k + turn) % 2 and kind != "igm" else {}
        q, v, a = random_state(model, rng, 3)
        given = {"q": q, "v": v, "a": a, "tau": a, "wrench": rng.normal(size=(3, 6))}
        try:
            program = export.program(model, kind, **options)
        except rm.errors.SingularMassMatrixError:
            continue
        yield program, inputs_of(program, T=rm.dgm(model, q), **given)


def one(inputs, program, k):
    """Sample k of inputs that may be batches."""
    pairs = zip(inputs, program.inputs, strict=True)
    return [x[k] if x.ndim > len(port.shape) else x for x, port in pairs]


def outputs(result):
    return result if isinstance(result, tuple) else (result,)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("language", ["c", "python", "numpy", "casadi"])
def test_languages(language, turn, tmp_path):
    if language == "c" and CC is None:
        pytest.skip("no C compiler (cc, gcc) is on the path")
    for program, inputs in programs(turn):
        if language == "c":
            call = compiled(program, tmp_path)
            assert not any(x in program.code("c") for x in ("static", "alloc", "#define"))
        elif language == "casadi":
            call = in_casadi(program)
        else:
            call = executed(program, language)
        tolerance = 1e-10 if program.kind == "ddm" else 1e-12
        rows = zip(*outputs(program(*inputs)), strict=True)
        for k, expected in enumerate(rows):
            sample = one(inputs, program, k)
            sample = [x.tolist() for x in sample] if language == "python" else sample
            for actual, wanted in zip(outputs(call(*sample)), expected, strict=True):
                assert np.shape(actual) == np.shape(wanted)
                size = np.abs(wanted).max(initial=1.0, where=np.isfinite(wanted))
                np.testing.assert_allclose(actual, wanted, rtol=0, atol=tolerance * size)
        if language == "numpy":
            batch = outputs(call(*inputs))
            for x, y in zip(outputs(call(*one(inputs, program, 2))), batch, strict=True):
                np.testing.assert_array_equal(x, y[2])
            none = outputs(call(*(x[:0] if x.ndim > 1 else x for x in inputs)))
            assert all(x.shape[0] == 0 for x in none)


def test_matlab_and_casadi_as_text_and_programs_as_values():
    rx90, panda = rm.load("rx90"), rm.load("panda")
    program = export.program(rx90, "idm", parameters="symbols")
    copy = pickle.loads(pickle.dumps(program))
    assert (copy, copy.code("c")) == (program, program.code("c"))
    assert len(repr(program).splitlines()) <= 6
    rest = np.zeros(6)
    assert program(np.zeros((0, 6)), rest, rest, program.values[-1]).shape == (0, 6)
    for model, kind, limit in ((rx90, "idm", 0.5), (panda, "base_regressor", 3.0)):
        start = time.process_time()
        export.program(model, kind).code("c")
        assert time.process_time() - start < limit
    code = export.program(rm.load("rx90"), "igm").code("matlab")
    assert "function [q, valid, status] = rx90_igm(T)" in code
    assert "T(1, 4)" in code
    assert "q = reshape(q, 6, 8).';" in code
    assert "function z = select_" in code
    lines = export.program(rm.load("rx90"), "idm").code("matlab").splitlines()
    assert all(line.startswith("%") for line in lines[:5])
    assert sum(line.startswith("function") for line in lines) == 1
    smooth = export.program(rm.load("tx40"), "idm").code("casadi")
    assert "smooth=0.0" in smooth
    assert "tanh" in smooth


# --- inverse geometric model ---------------------------------------------------------------------


def same_postures(q, valid, found):
    """Whether rows are the postures that the package finds, in any order."""
    for rows, there, others, known in zip(q, valid, found.q, found.valid, strict=True):
        away = np.abs((rows[there == 1, None] - others[None, known] + np.pi) % (2 * np.pi) - np.pi)
        assert away.max(axis=-1).min(axis=0, initial=np.inf).max(initial=0.0) < 1e-8
        assert np.isnan(rows[there == 0]).all()


def oblique(rows):
    """An arm of rows of alpha, d, r, theta in degrees, and sigma."""
    names = ("alpha", "d", "r", "theta", "sigma")
    table = rm.DHTable.from_rows([dict(zip(names, row, strict=True)) for row in rows], degrees=True)
    return rm.RobotModel.from_table(table, name="oblique")


OTHERS = {
    # a slide between two oblique axes and a spherical wrist: its plan begins with a quartic
    "skew": oblique([
        (0, 0, 0, 30, 0), (56, 0.3, 0.2, 17, 1), (79, 0, 0, 90, 0), (90, 0, 0.4, 0, 0),
        (-90, 0, 0, 30, 0), (90, 0, 0.4, 90, 0),
    ]),
    # a polynomial of a length, and a length and an angle at once
    "polynomial": oblique([
        (0, 0, 0, 0, 1), (-90, 0, 0.2, 0, 0), (90, 0.3, 0, 30, 0), (-90, 0.5, 0.2, 0, 0),
        (0, 0.5, 0, 0, 0), (0, 0.3, 0, 0, 1),
    ]),
    "length and angle": oblique([
        (-90, 0, 0, 30, 1), (40, 0.5, 0.2, 90, 0), (0, 0.5, 0.4, 30, 0), (40, 0, 0.2, 90, 1),
        (0, 0, 0, 30, 0), (90, 0, 0, 30, 0),
    ]),
}  # fmt: skip


@pytest.mark.sampled(6)
@pytest.mark.parametrize("name", [*ARMS, *OTHERS])
def test_all_postures(name):
    model = OTHERS[name] if name in OTHERS else rm.load(name)
    model = model.with_base(rm.se3.translation(0.1, 0.2, 0.3) @ rm.se3.rotation("x", 0.7))
    rng = np.random.default_rng(1)
    T = rm.dgm(
        model, rng.uniform(np.maximum(model.lower, -3), np.minimum(model.upper, 3), (50, model.n))
    )
    q, valid, status = export.program(model, "igm")(T)
    found = rm.igm(model, T)
    np.testing.assert_array_equal(valid.sum(axis=-1), found.count)
    np.testing.assert_array_equal(status, found.status)
    turns = model.table.sigma[model.table.joint_rows] == 0
    assert np.nanmax(np.abs(q[..., turns]), initial=0.0) <= np.pi
    same_postures(q, valid, found)
    assert np.abs(rm.dgm(model, q[valid == 1]) - np.repeat(T, found.count, axis=0)).max() < 1e-12


def test_singular_poses_have_a_status():
    model, rng = rm.load("rx90"), np.random.default_rng(0)
    program = export.program(model, "igm")
    statuses = []
    for fifth in (0.0, 1e-8, 0.5):
        q = rng.uniform(-1, 1, 6)
        q[4] = fifth
        rows, valid, status = program(rm.dgm(model, q))
        assert valid.sum() == rm.igm(model, rm.dgm(model, q)).count
        statuses.append(int(status))
    assert statuses == [
        rm.IGMStatus.REACHED_FAMILY, rm.IGMStatus.INCOMPLETE, rm.IGMStatus.REACHED
    ]  # fmt: skip
    far = np.eye(4)
    far[0, 3] = 9.0
    rows, valid, status = program(far)
    assert (np.isnan(rows).all(), valid.sum(), status) == (True, 0, rm.IGMStatus.NOT_CONVERGED)
    assert "The pose is reached by an infinite family" in program.code("c")
    straight = rm.load("ur5")  # a family, and postures may be missing
    pose = rm.dgm(straight, np.zeros(6))
    assert export.program(straight, "igm")(pose)[2] == rm.IGMStatus.REACHED_FAMILY


# --- names, files, refusals ----------------------------------------------------------------------


@pytest.mark.nightly
def test_the_same_bytes_in_two_processes():
    script = (
        "import sys, robotmodels as rm; from robotmodels import export; m = rm.load('tx40');"
        "sys.stdout.write(''.join(export.program(m, k, **o).code(l) for k, o, l in"
        " (('idm', {'parameters': 'base'}, 'c'), ('igm', {}, 'numpy'), ('ddm', {}, 'casadi'))))"
    )
    texts = [
        subprocess.run(
            [sys.executable, "-c", script], capture_output=True, check=True,
            env={**__import__("os").environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    ]  # fmt: skip
    assert texts[0] == texts[1]
    assert len(texts[0]) > 10_000


@needs_compiler
@pytest.mark.parametrize(
    ("symbols", "elements"),
    [
        ({("d", 1): "L1", ("d", 2): "RL9"}, ("L1", "RL9", "RL2")),
        ({("d", 1): "double", ("d", 2): "sin"}, ("double_", "sin_", "RL2")),
        ({("d", 1): "q", ("d", 2): "_x", ("r", 2): "C1"}, ("q_", "x", "C1_")),
        ({("d", 1): "L1+L2", ("d", 2): "L", ("r", 2): "L"}, ("D1", "D2", "RL2")),
        ({("d", 1): "a_", ("d", 2): "a"}, ("a_", "a__", "RL2")),
        ({("d", 2): "D1"}, ("D1", "D1_", "RL2")),
    ],
)
def test_names_that_collide_or_are_keywords(symbols, elements, tmp_path):
    table = rm.DHTable(
        antecedent=[0, 1], sigma=[0, 0], d=[0.2, 0.3], r=[0.0, 0.1], names=("double", "for"),
        symbols=symbols,
    )  # fmt: skip
    model = rm.RobotModel.from_table(table, name="int main() /* \u202e */")
    program = export.program(model, "dgm", geometry="symbols")
    assert program.elements[-1] == elements
    call = compiled(program, tmp_path)
    np.testing.assert_allclose(
        call([0.1, 0.2], program.values[-1])[0], rm.dgm(model, [0.1, 0.2]), atol=1e-15
    )
    for name, element in zip(symbols.values(), elements, strict=False):
        assert name == element or f"{name} is written {element}" in program.code("c")
    assert program.code("c").isascii()
    assert program.name == "int_main_dgm"


def test_what_is_refused(tmp_path):
    program = export.program(rm.load("rx90"), "dgm")
    rx90 = rm.load("rx90")
    for call, words in (
        (lambda: export.program(rx90, "imd"), "'idm'"),
        (lambda: export.program(rx90, "dgm", parameters="base"), "only .idm."),
        (lambda: export.program(rx90, "igm", geometry="symbols"), "no geometry='symbols'"),
        (lambda: export.program(rm.load("crx10ia"), "igm"), "elimination"),
        (lambda: export.program(rm.load("ur5"), "ddm", drive=False), "inertia"),
        (lambda: export.program(rx90, "idm", wrench="no"), "wrench: expected True or False"),
        (lambda: program.code("fortran"), "'matlab'"),
        (lambda: program(np.zeros(6), np.zeros(6)), "takes 1"),
        (lambda: export.write(program, tmp_path / "no" / "folder.c"), "cannot write"),
        (lambda: export.write(program, tmp_path / "code.txt"), "language"),
    ):
        with pytest.raises(RobotModelsError, match=words):
            call()


@pytest.mark.parametrize("code", list(_SOLVERS))
def test_types_of_equations_are_solved(code):
    """Coefficients made of a solution: each solver finds it."""
    rng = np.random.default_rng(code)
    for _ in range(50):
        a, b, r = rng.uniform(-3.0, 3.0, 3)
        k = rng.normal(size=6)
        C, S, c, s = np.cos(a), np.sin(a), np.cos(b), np.sin(b)
        first, turned = k[0] * C + k[1] * S, k[2] * C + k[3] * S
        g, expected = {
            layout.ANGLE: ([2.0 * S, 2.0 * C], [a]),
            layout.OPPOSITE_ANGLES: ([-2.0 * S, -2.0 * C], [a]),
            layout.ONE_EQUATION: ([k[1], k[0], first], [a]),
            layout.TWO_EQUATIONS: ([k[1], k[0], first, k[3], k[2], turned], [a]),
            layout.TWO_ANGLES: (
                [*k[:4], k[0] * c + k[1] * s - turned, k[0] * s - k[1] * c - k[2] * S + k[3] * C,
                 1.0], [a, b]
            ),
            layout.LENGTH: ([k[0], k[0] * r], [r]),
            layout.LENGTH_TIMES_ANGLE: ([k[0], k[0] * r * S, k[1], k[1] * r * C], [r, a]),
            layout.LENGTH_AND_ANGLE: (
                [k[0], k[0] * S - k[1] * r, k[1], k[2], k[2] * C - k[3] * r, k[3]], [r, a]
            ),
            layout.POLYNOMIAL: ([-np.polyval([*k[3::-1], 0.0], r), *k[:4]], [r]),
            layout.QUARTIC: (
                [-(first + k[2] * np.cos(2 * a) + k[3] * np.sin(2 * a)), *k[:4]], [a]
            ),
        }[code]  # fmt: skip
        found = _SOLVERS[code](
            [float(x) for x in (*g, *(0.0,) * 7)][:7], Limits(1e-13, 1e-4, (0, 0))
        )
        rows = [[u[0] for u in solution.unknowns] for solution in found if solution.valid]
        away = np.abs(np.array(rows) - expected)
        slides = np.arange(len(expected)) == (0 if code >= layout.LENGTH else -1)
        away = np.where(slides, away, np.minimum(away, 2 * np.pi - away))
        assert away.max(axis=-1).min() < 1e-8
