"""The command line: the output of each command, its exit status, and one table of bad use."""

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import robotmodels as rm
from robotmodels import se3
from robotmodels.cli import main
from robotmodels.cli import robots as robots_command
from robotmodels.cli.arguments import joined, numbers
from robotmodels.cli.option_words import in_options
from robotmodels.cli.output import print_json, progress
from robotmodels.cli.program import parser_of
from robotmodels.cli.terminal import ExitStatus
from robotmodels.errors import UrdfWarning
from robotmodels.minimal_parameters import uniform_bodies

COMMAND = [sys.executable, "-m", "robotmodels"]
POINT = ["--mask", "1", "1", "1", "0", "0", "0"]
Q = np.array([0.3, 1.0, -1.8, 0.4, 0.8, -0.2])


def outcome(capsys, *words):
    """Exit status, standard output and standard error of a command."""
    try:
        code = main([str(word) for word in words])
    except SystemExit as stop:
        code = stop.code
    return code, *capsys.readouterr()


@pytest.fixture
def run(capsys):
    return lambda *words: outcome(capsys, *words)


def solved(run, *words):
    """The JSON of a pose that is reached."""
    code, out, _ = run("igm", *words, "--json")
    assert code == 0
    return json.loads(out)


def save(path, names, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=",".join(names), comments="")


def motion(seed, samples, dt):
    """A planar arm with bodies and friction, a motion of it, and its torques with noise."""
    rng, arm = np.random.default_rng(seed), rm.load("planar_2r")
    arm = arm.with_inertia(uniform_bodies(arm, 6.0)).with_drive(
        rm.DriveParameters(*(np.full(2, x) for x in (0.4, 3.0, 2.0, 0.5)))
    )
    t, q = dt * np.arange(samples)[:, None], 0.0
    for k in (1, 2, 3):
        w, phase = 2.0 * np.pi * k * (0.15 + 0.05 * np.arange(2)), rng.uniform(0.0, 6.0, 2)
        wave = [np.sin(w * t + phase), w * np.cos(w * t + phase), -(w**2) * np.sin(w * t + phase)]
        q = q + 0.4 / k * np.array(wave)
    return arm, q[0], rm.idm(arm, *q) + 0.05 * rng.normal(size=q[0].shape)


@pytest.mark.parametrize(
    "words",
    [
        ["--q", "-1", "1e-3", "-2.5E+1"],
        ["--q=-1,1e-3,-2.5E+1"],
        ["--q", "-1, 1e-3", "-2.5E+1"],
        ["--q", "[-1,", "1e-3,", "-2.5E+1]"],
    ],
)
def test_numbers_may_be_negative_and_written_in_any_way(words):
    (word,) = joined(words, ["--q"])
    option, _, text = word.partition("=")
    assert option == "--q"
    assert numbers(text, 3, "--q").tolist() == [-1.0, 1e-3, -25.0]
    rest = ["rx90", "--rows", "0", "-10", "--q", "home", "1"]
    assert joined(rest, ["--q"]) == rest


# --- igm ------------------------------------------------------------------------------------------


def test_igm_prints_every_posture(run):
    code, out, err = run("igm", "rx90", "--q", *Q)
    assert (code, err) == (0, "")
    assert out.startswith("rx90: 8 postures. The pose is reached.\nmethod: ")
    rx90 = rm.load("rx90")
    found = rm.igm(rx90, rm.dgm(rx90, Q))
    rows = [line.split("│")[1:-1] for line in out.splitlines() if re.match(r"│ \d", line)]
    assert [row[1].strip() for row in rows] == found.branch.tolist()
    printed = np.array([[float(cell) for cell in row[2:8]] for row in rows])
    np.testing.assert_allclose(printed, found.q, atol=5.1e-7)


def of(name, q, **more):
    """Arguments of `igm` for the pose that a robot has at q."""
    return {"T": rm.dgm(rm.load(name), q), "position_tolerance": 1e-9} | more


T = of("rx90", Q)["T"]
REF, WRIST, SLIDE = [-0.3, -0.7, 1.1], [0.3, 1.0, -1.8, 0.4, 0.0, -0.2], [0.2, 30.0, -45.0]
SLIDE_RAD = [0.2, *np.radians([30.0, -45.0])]
SEVEN = np.array([10.0, 30.0, -15.0, -80.0, 20.0, 40.0, 5.0])
SEVEN_WORDS = ["--q", *SEVEN, "--degrees", "--q-ref", *SEVEN]
PRINTED = [0, 0, -1, 0.1414, 0, 1, 0, -0.3, 1, 0, 0, 0.8414, 0, 0, 0, 1]  # pose A, four digits
XYZ = {"mask": [1, 1, 1, 0, 0, 0]}
LOCKED = of("iiwa14", np.radians(SEVEN), lock={2: np.radians(-15.0)}, q_ref=np.radians(SEVEN))
SOLVED = {
    "q": ("rx90", ["--q", *Q], of("rx90", Q)),
    "matrix": ("rx90", ["--matrix", *T.ravel(), "--degrees"], of("rx90", Q)),
    "rpy": (
        "rx90",
        ["--xyz", *T[:3, 3], "--rpy", *np.degrees(se3.to_rpy(T[:3, :3])), "--degrees"],
        of("rx90", Q),
    ),
    "mask": (
        "lab_trr",
        ["--q", *REF, *POINT, "--q-ref", *REF],
        of("lab_trr", REF, q_ref=REF, **XYZ),
    ),
    "word": (
        "lab_trr",
        ["--q", *REF, "--mask", "xyz", "--q-ref", *REF],
        of("lab_trr", REF, q_ref=REF, **XYZ),
    ),
    "slides": (
        "lab_trr",
        ["--q", *SLIDE, *POINT, "--degrees", "--q-ref", *SLIDE],
        of("lab_trr", SLIDE_RAD, q_ref=SLIDE_RAD, **XYZ),
    ),
    "tolerances": (
        "lab_trr",
        ["--matrix", *PRINTED, "--tolerance", "1e-4", "1e-6"],
        {
            "T": np.reshape(PRINTED, (4, 4)),
            "position_tolerance": 1e-4,
            "orientation_tolerance": 1e-6,
        },
    ),
    "singular": ("rx90", ["--q", *WRIST, "--q-ref", *WRIST], of("rx90", WRIST, q_ref=WRIST)),
    "limits": ("kr6_r900", ["--q", "zero", "--limits"], of("kr6_r900", np.zeros(6), limits=True)),
    "tool axes": (
        "rx90",
        ["--q", *Q, "--mask", 1, 1, 1, 1, 1, 0, "--mask-axes", "tool"],
        of("rx90", Q, mask=[1, 1, 1, 1, 1, 0], mask_axes="tool"),
    ),
    "arm angle": (
        "iiwa14",
        ["--q", *SEVEN, "--degrees", "--arm-angle", -20],
        of("iiwa14", np.radians(SEVEN), arm_angle=np.radians(-20.0)),
    ),
    "lock": ("iiwa14", [*SEVEN_WORDS, "--lock", "3=-15"], LOCKED),
    "lock by name": ("iiwa14", [*SEVEN_WORDS, "--lock", "joint_3=-15"], LOCKED),
}


@pytest.mark.parametrize("case", SOLVED)
def test_igm_gives_what_the_call_returns(run, case):
    name, words, call = SOLVED[case]
    model, degrees, result = rm.load(name), "--degrees" in words, solved(run, name, *words)
    found = rm.igm(model, **call)
    turns, names = model.table.sigma[model.table.joint_rows] == 0, np.array(model.table.joint_names)
    scale = np.where(turns, 180.0 / np.pi if degrees else 1.0, 1.0)
    rows, valid = result["postures"], found.valid
    assert len(rows) > 0
    np.testing.assert_allclose(result["pose"], call["T"], atol=1e-14)
    np.testing.assert_allclose([row["q"] for row in rows], found.q[valid] * scale, atol=1e-7)
    assert result["units"] == np.where(turns, "deg" if degrees else "rad", "m").tolist()
    for key in ("branch", "within_limits"):
        assert [row[key] for row in rows] == getattr(found, key)[valid].tolist()
    free = [names[some].tolist() for some in found.free_joints[valid]]
    assert [row["free_joints"] for row in rows] == free
    assert (result["reason"], result["method"]) == (found.reason(), found.method)
    text = run("igm", name, *words)[1]
    assert ("joint_4 took the reference;" in text) == (case == "singular")
    assert ("requested: x y z rx ry in tool axes" in text) == (case == "tool axes")


def test_a_pose_that_is_not_reached_says_why(run):
    words = ("igm", "rx90", "--xyz", 2, 0, 0, "--rpy", 0, 0, 0)
    code, out, err = run(*words)
    assert (code, err) == (1, "")
    assert out.startswith("rx90: 0 postures. The position is out of reach: too far.")
    assert "closest posture: joint_1 " in out
    code, out, _ = run(*words, "--json")
    result = json.loads(out)
    assert code == 1
    assert (result["reached"], result["status"], result["postures"]) == (False, "TOO_FAR", [])
    T = rm.dgm(rm.load("rx90"), result["closest"])
    np.testing.assert_allclose(T[:3, 3], [0.9, 0, 0], atol=1e-3)


# --- view and demo --------------------------------------------------------------------------------


def test_view_takes_numbers_names_and_degrees(run, tmp_path):
    page = tmp_path / "arm.html"
    for words, q in (
        (["planar_2r", "--q", "-0.5,1e-1"], "[-0.5  0.1]"),
        (["planar_2r", "--q", 90, 0, "--degrees"], "[1.5708 0.    ]"),
        (["lab_trr", "--q", "pose_a"], "[-0.3    -0.7854 -0.7854]"),
    ):
        code, out, _ = run("view", *words, "--out", page)
        assert (code, page.stat().st_size > 500_000) == (0, True)
        assert f"q = {q}" in out


def test_demo_draws_the_eight_postures(run, tmp_path):
    code, out, _ = run("demo", "--out", tmp_path)
    assert code == 0
    pages = {path.name for path in tmp_path.glob("*.html")}
    assert pages == {"arms.html", "rx90-postures.html", "ur5-postures.html"}
    for name in ("rx90", "ur5"):
        text = (tmp_path / f"{name}-postures.html").read_text(encoding="utf-8")
        assert re.findall(r"</span>(\d): shoulder", text) == list("12345678")
        assert f"{name}: 8 postures. The pose is reached." in out
    assert "ZZ1R = ZZ1 + Ia1 + YY2 + YY3 + D3^2*(M3 + M4 + M5 + M6)" in out
    assert "By the columns of the regressor: the same parameters" in out
    lost = [float(number) for number in re.findall(r"its postures to (\S+) rad", out)]
    assert len(lost) == 2
    assert max(lost) < 1e-6


@pytest.mark.nightly  # `.ci/run` runs the demonstration from the wheel
def test_demo_identifies_the_real_robot(run, tmp_path, monkeypatch):
    pages = []  # drawing them takes longer than all the rest, and has tests of its own
    monkeypatch.setattr(rm.viz, "identification_html", lambda *what: pages.append(what))
    code, out, _ = run("demo", "--real", "--out", tmp_path)
    assert code == 0
    (result, page, test, robot) = pages[0]
    assert (len(result.names), len(test)) == (61, 15750)
    assert page == tmp_path / "report.html"
    assert robot.inertia.is_physical.all()
    assert re.search(r"  ZZ1 +1\.24\d\d \+- 0\.0\d+ +1\.2421 \+- 0\.0137", out)
    assert "60 of 60 are within two of our standard errors." in out
    ours, best = (
        np.array(re.search(f"  {word} +((?: +[0-9.]+)+)", out)[1].split(), float)
        for word in ("here", "published, best")
    )
    assert ours.shape == (6,)
    assert (ours < best).all()
    again = rm.RobotModel.from_urdf(tmp_path / "identified.urdf")
    assert again.inertia.is_physical.all()
    assert len(json.loads((tmp_path / "result.json").read_text())["parameters"]) == 61


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("chapter", "words"),
    [
        (2, "All assembly modes are listed"), (3, "4 cusps. A path between two postures"),
        (4, "The motion is the quickest along the path"), (5, "The last error (rad)"),
        (6, "Largest error"), (7, "Clamped frequencies (rad/s)"),
    ],
)  # fmt: skip
def test_demo_shows_the_chapters_of_the_book(run, tmp_path, chapter, words):
    code, out, _ = run("demo", "--chapter", chapter, "--out", tmp_path)
    assert code == 0
    assert words in out
    assert (tmp_path / f"chapter_{chapter}.png").stat().st_size > 10_000


# --- calibrate and identify -----------------------------------------------------------------------


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Files of measurements and of logs, of robots that are known."""
    folder, rng, dt = tmp_path_factory.mktemp("files"), np.random.default_rng(0), 0.002
    # positions of an RX-90 with a tool, in mm and degrees; postures that touch three points
    tool = rm.load("rx90").with_tool(se3.translation(0.05, 0.03, 0.1))
    joints, q = tool.table.joint_names, rng.uniform(-1.8, 1.8, (40, 6))
    p = rm.dgm(tool, q)[:, :3, 3] + 1e-4 * rng.normal(size=(40, 3))
    save(folder / "tracker.csv", [*joints, "x", "y", "z"], np.degrees(q), 1e3 * p)
    for name, place in {"a": [0.5, 0.1, 0.4], "b": [0.6, 0.1, 0.4], "c": [0.3, -0.4, 0.5]}.items():
        turns = [se3.from_rpy(rng.uniform(-1.0, 1.0, 3), place) for _ in range(25)]
        found = rm.igm(tool, np.array(turns))
        save(folder / f"{name}.csv", joints, found.q[found.valid][::3])
    # a log of two joints in degrees, torques in a file of their own, velocities of another scale
    real, q, tau = motion(0, 8000, dt)
    save(folder / "q.csv", ["q1", "q2"], np.degrees(q))
    save(folder / "tau.csv", ["tau1", "tau2"], tau)
    save(folder / "late.csv", ["tau1", "tau2"], np.roll(tau, 100, axis=0))
    rates = 2.0 * np.gradient(np.degrees(q), dt, axis=0)
    save(folder / "both.csv", ["q1", "q2", "dq1", "dq2"], np.degrees(q), rates)
    (folder / "empty.csv").write_text("")
    return folder, tool, real


@pytest.fixture
def inside(files, monkeypatch):
    monkeypatch.chdir(files[0])
    return files


TRACKER = ["calibrate", "--robot", "rx90", "--measurements", "tracker.csv", "--kind", "position"]
POINTS = ["calibrate", "--robot", "rx90", "--kind", "point-contact", "--measurements", "a.csv",
          "b.csv", "--parameters", "b7", "d7", "r7", "d3", "r4", "--folds", 0]  # fmt: skip
LOG = ["identify", "--robot", "planar_2r", "--log", "q.csv", "--torques-from", "tau.csv", "--dt",
       "2e-3", "--angles", "deg"]  # fmt: skip
MM = [*TRACKER, "--lengths", "mm", "--angles", "deg"]
BOTH = [word.replace("q.csv", "both.csv") for word in LOG]


def test_calibrate_writes_a_report_and_a_robot(run, inside, tmp_path):
    words = [*MM, "--parameters", "b7", "d7", "r7"]
    folder = tmp_path / "new" / "report"
    code, out, _ = run(*words, "--out", folder)
    assert code == 0
    assert "The fit has converged" in out
    names = {"report.txt", "report.html", "result.json", "calibrated.urdf"}
    assert {path.name for path in folder.iterdir()} == names
    robot = rm.RobotModel.from_urdf(folder / "calibrated.urdf")
    assert np.linalg.norm((rm.dgm(robot, Q) - rm.dgm(inside[1], Q))[:3, 3]) < 2e-4
    code, out, err = run(*words, "--json")
    assert (code, err) == (0, "")
    assert json.loads(out) == json.loads((folder / "result.json").read_text())
    assert run(*words)[:2] == (0, (folder / "report.txt").read_text())


def test_calibrate_takes_known_distances_and_files_that_only_test(run, inside):
    more = ["--known-distance", "a", "b", 0.1, "--test", "c.csv", "--json"]
    code, out, _ = run(*POINTS, *more)
    data = json.loads(out)
    assert code == 0
    np.testing.assert_allclose(np.array(data["tool"])[:3, 3], [0.05, 0.03, 0.1], atol=1e-6)
    assert data["errors"]["held_out"]["m"]["rms"] < 1e-6


def test_identify_writes_a_report_and_a_robot(run, inside, tmp_path):
    real, out_folder = inside[2], tmp_path / "new" / "report"
    words = [*LOG, "--test-share", "0.25", "--prior", "5"]
    code, out, err = run(*words, "--workers", "2", "--out", out_folder)
    assert code == 0
    assert "The parameters generalise" in " ".join(out.split())
    assert "A URDF has no place for" in err
    names = {"report.txt", "report.html", "result.json", "identified.urdf"}
    assert {path.name for path in out_folder.iterdir()} == names
    data = json.loads((out_folder / "result.json").read_text())
    base = rm.base_parameters(real, drive=True)
    expected = dict(zip(base.names, base.values(real), strict=True))
    for one in data["parameters"]:
        assert abs(one["value"] - expected[one["name"]]) < 5.0 * one["standard_error"] + 1e-3
    assert data["data"]["samples"] == 6000
    assert data["errors"]["held_out"]["samples"] == 2000 - 2 * data["processing"]["edges"]
    robot = rm.RobotModel.from_urdf(out_folder / "identified.urdf")
    q, v, a = np.random.default_rng(1).uniform(-0.5, 0.5, (3, 20, 2))
    # a URDF has no rotor inertia; what rotor 1 and the links share is the prior's choice
    standard = data["consistent"]["standard"]
    rotors = np.array([standard["Ia1"], standard["Ia2"]]) * a
    missed = rm.idm(robot, q, v, a, drive=False) + rotors
    missed -= rm.idm(real, q, v, a, drive=False) + 0.4 * a
    assert np.abs(missed).max() < 0.05
    # one process gives the same bits, and JSON what the file has
    code, out, _ = run(*words, "--consistent", "--json")
    assert (code, json.loads(out)) == (0, data)


def test_identify_takes_choices_and_files_that_only_test(run, inside):
    words = [*LOG, "--test", "q.csv", "--test-torques-from", "tau.csv", "--rows", "0", "4000",
             "--method", "ols", "--cutoff", "30", "--decimation", "10", "--dead-band", "0.05",
             "--edges", "0.2", "--drive", "Fv", "Fc", "--delay", "0.004", "--json"]  # fmt: skip
    code, out, _ = run(*words)
    data = json.loads(out)
    assert code == 0
    assert (data["method"]["name"], data["method"]["drive"]) == ("ols", ["Fv", "Fc"])
    chosen = data["processing"]
    assert (chosen["cutoff"], chosen["decimation"], chosen["edges"]) == (30.0, 10, 100)
    assert chosen["dead_band"] == [0.05] * 2
    assert (data["data"]["delay"], data["data"]["samples"]) == (0.004, 4000)
    assert data["errors"]["held_out"]["samples"] == 7998 - 200
    values = []
    for given in ([*BOTH, "--velocities", "none"], LOG):
        code, out, _ = run(*given, "--json")
        assert code == 0
        values.append([one["value"] for one in json.loads(out)["parameters"]])
    np.testing.assert_allclose(values[0], values[1], rtol=1e-9)


def test_the_default_of_an_option_has_its_type():
    own = parser_of("identify")[1]
    assert own.get_default("workers") == 1
    assert own.get_default("drive") == ["Ia", "Fv", "Fc", "offset"]
    assert parser_of("excite")[1].get_default("duration") == 10.0
    assert parser_of("calibrate")[1].get_default("known") == []


def test_choices_are_those_of_the_package():
    """The commands list them without importing the rooms that define them."""
    from robotmodels.calibration.parameters import Compliance
    from robotmodels.estimation.losses import Loss
    from robotmodels.identification import method_names
    from robotmodels.identification.forms import EquationForm

    options = {
        f"{command} {name}": action
        for command in ("identify", "calibrate")
        for action in parser_of(command)[1]._actions
        for name in action.option_strings
    }
    listed = options["identify --method"].help.partition(": ")[2].split(", such as")[0]
    assert set(listed.split(", ")) == set(method_names.METHODS)
    for option, kind in (
        ("identify --form", EquationForm), ("calibrate --loss", Loss),
        ("calibrate --compliance", Compliance),
    ):  # fmt: skip
        assert set(options[option].choices) == {member.name.lower() for member in kind}


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ("say angles='deg', or", "say --angles deg, or"),
        ("(checked=False uses the log unchanged.)", "(--no-check uses the log unchanged.)"),
        ("say dt=, the period, and time=False to", "say --dt, the period, and --time none to"),
        ("signs= and drive_gains= of read_log.", "--signs and --drive-gains."),
        ("times='ms', 'us' or 'ns' if", "--times ms, us or ns if"),
        ("largest_gap= to split, b2=3", "largest_gap= to split, b2=3"),
    ],
)
def test_messages_speak_of_options(message, words):
    _, own = parser_of("identify")
    assert in_options(message, own.options()) == words


# --- what is wrong -------------------------------------------------------------------------------

EXCITE = ["excite", "--robot", "rx90"]
MIRRORED = (np.eye(4) * [1, 1, -1, 1]).ravel()
BAD = [
    ([], "which command? There are demo, robots, info"),
    (["inf"], "no command 'inf'. Did you mean info"),
    (["info", "rx90", "--jsn"], "no option --jsn. Did you mean --json"),
    (["info", "rx90", "more"], "nothing takes 'more'"),
    (["info", "rx90", "--mimic"], "--mimic are for URDF files"),
    (["info", "missing.urdf"], "cannot read 'missing.urdf'"),
    (["view", "planar_2r", "--q", 1, 2, 3, "--out", "arm.html"], "--q: expected 2 numbers"),
    (["igm", "rx90", "--deg", "--q", "zero"], "no option --deg. Did you mean --degrees"),
    (["igm", "rx90", "--q", "zeroo"], "Did you mean 'zero'?"),
    (["igm", "rx90", "--q", "zero", "--xyz", 1, 2, 3], "got --xyz and --q"),
    (["igm", "rx90", "--xyz", 1, 2], "--xyz: expected 3 finite numbers, got '1,2'"),
    (["igm", "rx90", "--xyz", 1, 2, 3, "--mask", 1, 1, 1, 1, 0, 0], "the orientation is missing"),
    (["igm", "rx90", "--matrix", *MIRRORED], "det R = -1"),
    (["igm", "rx90", "--q", 1, 2], "expected 6 numbers, or the name of a configuration"),
    (["igm", "rx90", "--q", "zero", "--lock", "0=1"], "number from 1 to 6"),
    (["igm", "rx90", "--q", "zero", "--lock", "1=0", "--lock", "joint_1=0"], "each joint once"),
    (["igm", "rx90", "--mask-axes", "joint"], "--mask-axes: invalid choice"),
    ([*EXCITE, "--out", "empty.csv/new"], "is a file; give a folder"),
    ([*EXCITE, "--rate", 500], "--rate: describes the file of --out"),
    ([*EXCITE, "--out", "new", "--rate", 0], "--rate: expected a finite"),
    ([*EXCITE, "--box", 1, 1, 1, 0, 0, 0], "--box: lower, upper"),
    (TRACKER[:-1], "--kind: expected one argument"),
    ([*TRACKER[:-1], "place"], "--kind: invalid choice: 'place'"),
    ([*TRACKER, "--lengths", "mm"], "look like degrees. Use --angles deg"),
    ([*TRACKER, "--angles", "deg"], "look like millimetres. Use --lengths mm"),
    ([*MM, "--columns", "x", "y", "w"], "no column 'w'"),
    ([*MM, "--parameters", "d9"], "'d9' is not a parameter"),
    ([*MM, "--sigma", "-1"], "--sigma: expected positive"),
    ([*MM, "--prior", "1"], "--prior: expected 2 finite"),
    ([*MM, "--measurements", "missing.csv"], "No such file or directory: missing.csv"),
    (POINTS, "contain no length"),
    ([*POINTS, "--known-distance", "a", "b", "zero"], "expected 1 finite number"),
    ([*LOG, "--log", "empty.csv"], "empty.csv: the file is empty"),
    ([*LOG, "--log", "missing.csv"], "missing.csv: there is no such file"),
    ([*LOG, "--delimiter", ""], "character"),
    ([*LOG, "--test-share", "2"], "expected a share between 0 and 1"),
    ([*LOG, "--test-share", "0.2", "--test-rows", "0", "10"], "give one of them"),
    ([*LOG, "--motor-side"], "no transmission"),
    ([*LOG, "--gears", "1", "2", "3"], "--gears: expected 1 or 2 finite numbers"),
    ([*LOG, "--prior", "rx90"], "has 6 links, the robot 2"),
    ([*LOG, "--consistent"], "has no masses"),
    ([*LOG, "--rows", "0", "-10", "--test-rows", "7000", "8000"], "rows that do not overlap"),
    ([*LOG, "--angles", "rad"], "with --gears or --motor-side if they are motor angles"),
    ([*LOG, "--delay", "0.2", "--rows", "0", "8000"], "7900 rows"),
    ([*LOG, "--torques-from", "late.csv", "--delay", "auto"], "--delay auto: The torques fit best"),
    (BOTH, "leave them out (--velocities none)"),
]


@pytest.mark.parametrize(("words", "message"), BAD)
def test_wrong_input_is_one_line(run, inside, words, message):
    before = set(inside[0].iterdir())
    code, out, err = run(*words)
    assert (code, out, err.count("\n")) == (ExitStatus.WRONG_INPUT, "", 1)
    assert err.startswith("robotmodels: ")
    assert message in err
    assert set(inside[0].iterdir()) == before


def failing(monkeypatch, error):
    def fail(arguments):
        raise error

    monkeypatch.setattr(robots_command, "run", fail)


def test_a_bug_is_said_in_one_line_and_told_when_asked_for(run, monkeypatch):
    failing(monkeypatch, ZeroDivisionError("by nothing"))
    code, out, err = run("robots")
    assert (code, out, err.count("\n")) == (ExitStatus.BUG, "", 1)
    assert "this is a bug: ZeroDivisionError: by nothing" in err
    code, _, err = run("robots", "--traceback")
    assert code == ExitStatus.BUG
    assert err.startswith("Traceback (most recent call last):")
    assert "in fail" in err


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (KeyboardInterrupt(), ExitStatus.INTERRUPTED, "interrupted."),
        (MemoryError(), ExitStatus.WRONG_INPUT, "there is not enough memory for this."),
        (OSError(28, "No space left on device", "a.csv"), 2, "No space left on device: a.csv"),
        (rm.errors.MissingExtraError("a needs b; run: pip install b"), 2,
         "a needs b; run: pip install b"),
        (rm.errors.UrdfError("first line\n  second line"), 2, "first line second line"),
    ],
)  # fmt: skip
def test_what_stops_a_command_is_said(run, monkeypatch, error, code, line):
    failing(monkeypatch, error)
    assert run("robots") == (code, "", f"robotmodels: {line}\n")


def test_warnings_of_the_package_are_lines(run, monkeypatch):
    def warn(arguments):
        warnings.warn("a tool\nis missing", UrdfWarning, stacklevel=2)

    monkeypatch.setattr(robots_command, "run", warn)
    assert run("robots") == (0, "", "robotmodels: warning: a tool is missing\n")


def heed_interrupts():
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_interrupt_of_a_process():
    words = ["excite", "--robot", "rx90", "--starts", "50", "--random", "2000"]
    # who runs the tests in the background ignores interrupts, and their children would too
    child = subprocess.Popen([*COMMAND, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                             text=True, preexec_fn=heed_interrupts)  # fmt: skip
    maps = Path(f"/proc/{child.pid}/maps")
    until = time.monotonic() + 60.0
    # once Pinocchio is there the door is open, and the command is at work or about to be
    while "pinocchio" not in maps.read_text() and time.monotonic() < until:
        time.sleep(0.02)
    time.sleep(2.0)
    child.send_signal(signal.SIGINT)
    out, err = child.communicate(timeout=60)
    assert (child.returncode, out, err) == (130, "", "robotmodels: interrupted.\n")


def test_pipes_that_close_and_terminals_without_unicode():
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    words = " ".join(COMMAND)
    shell = f"{words} info ur5 > info.txt && {words} info ur5 --json && {words} robots | head -1"
    done = subprocess.run(
        ["bash", "-c", f"cd $(mktemp -d) && {shell}; echo ${{PIPESTATUS[0]}}; cat info.txt"],
        capture_output=True, env=environment, check=True,
    )  # fmt: skip
    assert done.stderr == b""
    text = done.stdout.decode("ascii")
    data, _, rest = text.partition("\n}\n")
    assert json.loads(data + "\n}")["robot"] == "ur5"
    assert rest.startswith("lab_rr ")
    assert rest.splitlines()[1] == "0"
    assert "pi/2" in rest
    assert "| j | sj |" in rest


# --- progress and JSON ----------------------------------------------------------------------------


@pytest.mark.parametrize(("quiet", "terminal"), [(False, True), (True, True), (False, False)])
def test_a_bar_is_drawn_on_terminals_only_and_taken_away(monkeypatch, quiet, terminal):
    stream = io.StringIO()
    stream.isatty = lambda: terminal
    monkeypatch.setattr(sys, "stderr", stream)
    with progress(SimpleNamespace(quiet=quiet), "fits") as bar:
        assert (bar is not None) == (terminal and not quiet)
        if bar is not None:
            bar(1.0)
    drawn = [line.rstrip() for line in stream.getvalue().split("\r")]
    assert drawn[-2:] == ["", ""] if drawn[:-1] else bar is None
    assert ("100 %" in stream.getvalue()) == (bar is not None)


def strict(text):
    return json.loads(text, parse_constant=pytest.fail)


def test_json_of_robots_and_info(run):
    code, out, _ = run("robots", "--json")
    assert code == 0
    assert tuple(one["name"] for one in strict(out)) == rm.robots()
    for name in ("rx90", "tx40", "lab_trr", "erd:ur5"):
        model = rm.load(name)
        code, out, _ = run("info", name, "--json")
        data = strict(out)
        assert code == 0
        q = np.linspace(0.1, 0.7, model.n)
        again = rm.link_transforms(rm.DHTable.from_rows(data["table"]), q)
        np.testing.assert_array_equal(again, rm.link_transforms(model.table, q))
        lower = [joint["lower"] for joint in data["joints"]]
        assert lower == [v if np.isfinite(v) else None for v in model.lower.tolist()]
        assert (data["transmission"] is None) == (model.transmission is None)
        assert (data["tip"], data["frames"]) == (model.tip, list(model.frame_names))


def test_json_has_no_token_that_readers_refuse(capsys):
    print_json({"a": [np.nan, 1e300], "b": {}, "θ": np.array([[1, 2]]), "e": ExitStatus.BUG})
    expected = {"a": [None, 1e300], "b": {}, "θ": [[1, 2]], "e": "BUG"}
    assert strict(capsys.readouterr().out) == expected


def test_angles_that_look_like_degrees_are_warned_of(run):
    pose = ("igm", "rx90", "--xyz", 0.3, 0.2, 0.5, "--rpy", 0, 90, 45)
    assert "for degrees add --degrees" in run(*pose)[2]
    assert run(*pose, "--degrees")[2] == ""
