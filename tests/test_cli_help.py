"""The examples of every ``--help`` run as they are printed, and every option has an effect."""

import base64
import json
import re
import shlex
import tempfile
import webbrowser
from itertools import pairwise

import numpy as np
import pytest
import umsgpack

import robotmodels as rm
from robotmodels import se3
from robotmodels.cli import main
from robotmodels.cli.program import COMMANDS, parser_of
from robotmodels.cli.terminal import ExitStatus
from robotmodels.minimal_parameters import uniform_bodies

Q = np.array([0.3, 1.0, -1.8, 0.4, 0.8, -0.2])


def examples(command):
    """The commands in the help, with lines that go on joined."""
    _, own = parser_of(command)
    text = own.epilog.replace("\\\n", " ")
    return [shlex.split(line) for line in re.findall(r"^  robotmodels (.*)$", text, re.MULTILINE)]


def save(path, names, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=",".join(names), comments="")


def motion(seed, samples=1600, dt=0.005):
    """A motion of the planar arm with bodies and friction, and its torques with noise."""
    rng = np.random.default_rng(seed)
    arm = rm.load("planar_2r")
    arm = arm.with_inertia(uniform_bodies(arm, 6.0)).with_drive(
        rm.DriveParameters(*(np.full(2, x) for x in (0.4, 3.0, 2.0, 0.5)))
    )
    t = dt * np.arange(samples)[:, None]
    q = v = a = 0.0
    for k in (1, 2, 3):
        w, phase = 2.0 * np.pi * k * (0.15 + 0.05 * np.arange(2)), rng.uniform(0.0, 6.0, 2)
        q = q + 0.4 / k * np.sin(w * t + phase)
        v, a = v + 0.4 / k * w * np.cos(w * t + phase), a - 0.4 / k * w**2 * np.sin(w * t + phase)
    return q, rm.idm(arm, q, v, a) + 0.05 * rng.normal(size=q.shape)


def identify_files(folder):
    arm = rm.load("planar_2r")
    rm.write_urdf(arm, folder / "arm.urdf")
    rm.write_urdf(arm.with_inertia(uniform_bodies(arm, 9.0)), folder / "heavy.urdf")
    q, tau = motion(0)
    save(folder / "positions.csv", ["q1", "q2"], np.degrees(q))
    save(folder / "torques.csv", ["tau1", "tau2"], tau)
    np.savez(folder / "run.npz", q=q, tau=tau, t=0.005 * np.arange(len(q)))
    for k in (1, 2, 3):
        q, tau = motion(k)
        names = ["actual_q_0", "actual_q_1", "current_0", "current_1"]
        save(folder / f"run{k}.csv", names, q, tau / [13.3, 9.4])


def calibrate_files(folder):
    rng = np.random.default_rng(0)
    real = rm.load("rx90").with_tool(se3.translation(0.05, 0.03, 0.1))
    rm.write_urdf(rm.load("rx90"), folder / "arm.urdf")
    q = rng.uniform(-1.8, 1.8, (40, 6))
    T = rm.dgm(real, q)
    p = T[:, :3, 3] + 1e-4 * rng.normal(size=(40, 3))
    joints = real.table.joint_names
    names = [*joints, "x", "y", "z", "range"]
    save(folder / "tracker.csv", names, np.degrees(q), 1e3 * p, 1e3 * np.linalg.norm(p, axis=1))
    turns = rm.operational_coordinates(T, "quaternion")[:, 3:]
    names = [*joints, "x", "y", "z", "qw", "qx", "qy", "qz"]
    save(folder / "camera.csv", names, q, p, turns)
    for name, place in (("hole_0", [0.5, 0.1, 0.4]), ("hole_1", [0.6, 0.1, 0.4])):
        poses = [se3.from_rpy(rng.uniform(-1.0, 1.0, 3), place) for _ in range(25)]
        found = rm.igm(real, np.array(poses))
        save(folder / f"{name}.csv", joints, found.q[found.valid][::3])


def arm_files(name):
    return lambda folder: rm.write_urdf(rm.load(name), folder / "arm.urdf")


FILES = {
    "robots": lambda folder: None,
    "info": arm_files("rx90"),
    "igm": arm_files("rx90"),
    "view": arm_files("rx90"),
    "excite": arm_files("planar_2r"),
    "identify": identify_files,
    "calibrate": calibrate_files,
    "export": arm_files("rx90"),
}
"""What the examples of a command need; demo runs in test_cli.py, compile in test_compilation.py."""


@pytest.fixture
def run(capsys):
    def run(*words):
        code = main([str(word) for word in words])
        out, err = capsys.readouterr()
        return code, out, err

    return run


def test_every_command_has_examples_that_are_tried():
    assert {*FILES, "demo", "compile", "follow", "workspace"} == set(COMMANDS)
    assert all(examples(command) for command in COMMANDS)


@pytest.mark.parametrize("command", FILES)
@pytest.mark.nightly
def test_examples_run_as_printed(run, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(webbrowser, "open", lambda *where: False)
    FILES[command](tmp_path)
    for words in examples(command):
        assert words[0] == command
        code, out, err = run(*words)
        assert code == ExitStatus.DONE, (words, err)
        assert out.strip()
        if "--json" in words:
            json.loads(out, parse_constant=pytest.fail)
        if "--out" in words and command not in ("view", "export"):
            folder = tmp_path / words[words.index("--out") + 1]
            written = set(re.findall(r"^wrote \S+/(\S+)$", out, re.MULTILINE))
            assert written == {path.name for path in folder.iterdir()}
            assert len(written) == 4


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_examples(run, command):
    code, out, err = run(command, "--help")
    assert (code, err) == (0, "")
    assert "examples:\n  robotmodels " in out
    assert max(map(len, out.splitlines())) <= 100


def test_help_of_everything_has_every_command_and_status(run):
    code, out, _ = run("--help")
    assert code == 0
    assert all(f"\n    {name} " in out for name in COMMANDS)
    assert all(f"\n  {status.value} " in out for status in ExitStatus)
    assert run("--version") == (0, f"robotmodels {rm.__version__}\n", "")
    assert run("--version", "-v") == (0, f"{rm.show_versions()}\n", "")


# --- every option that is parsed changes something ------------------------------------------------

SAME = {"-h", "--help", "--traceback", "--quiet", "--json", "--out", "--mimic"}
"""They change how a command speaks, which other tests hold; mimic joints are tried at the end."""
BASE = {
    "info": ["info", "arm.urdf"],
    "igm": ["igm", "arm.urdf", "--q", *Q],
    "excite": ["excite", "--robot", "arm.urdf", "--starts", 1, "--random", 2, "--iterations", 2,
               "--harmonics", 2],
    "calibrate": ["calibrate", "--robot", "arm.urdf", "--measurements", "tracker.csv", "--kind",
                  "position", "--lengths", "mm", "--angles", "deg", "--folds", 0, "--held-out", 0,
                  "--parameters", "b7", "d7", "r7"],
    "identify": ["identify", "--robot", "arm.urdf", "--log", "run.npz"],
}  # fmt: skip
HALF_TURN = np.diag([1, -1, -1, 1]).ravel()
POSE = ["--xyz", 0.3, 0.2, 0.5, "--rpy", 0, 0, 0]
EFFECTS = {
    "info": {"--base-link": ["link_2"], "--tip-link": ["link_5"]},
    "igm": {
        "--base-link": ["link_2"], "--tip-link": ["link_5"], "--xyz": [0.4, 0.2, 0.5],
        "--rpy": [0, 1, 0], "--matrix": HALF_TURN, "--q": 0.5 * Q, "--degrees": [], "--q-ref": -Q,
        "--mask": [1, 1, 1, 0, 0, 0], "--mask-axes": ["tool"], "--lock": ["1=0.3"],
        "--arm-angle": [0.1], "--tolerance": [1e-30],
    },
    "excite": {
        "--robot": ["planar_3r"], "--base-link": ["link_1"], "--tip-link": ["link_1"],
        "--duration": [5], "--kind": ["spline"], "--harmonics": [3], "--points": [7],
        "--drive": ["Fv"], "--velocity": [0.3], "--acceleration": [0.3], "--torque-limits": [0.1],
        "--box": [0, -1, -1, 2.5, 1, 1], "--keep-out": [-3, -3, -1, -1, 3, 1],
        "--criterion": ["log-det"], "--sigma": [1, 5], "--starts": [2], "--random": [3],
        "--iterations": [3], "--seed": [1], "--rate": [100], "--format": ["npz"], "--degrees": [],
    },
    "calibrate": {
        "--robot": ["puma560"], "--base-link": ["link_2"], "--tip-link": ["link_5"],
        "--measurements": ["camera.csv"], "--kind": ["distance"], "--pattern": ["tr*"],
        "--lengths": ["m"], "--angles": ["rad"], "--joint-angles": ["rad"],
        "--orientation": ["quaternion"], "--joints": [1, 0, 2, 3, 4, 5],
        "--other-joints": [5, 4, 3, 2, 1, 0], "--columns": ["x", "z", "y"], "--label": ["x"],
        "--delimiter": [";"], "--frame": ["joint_4"], "--sigma": [1e-3],
        "--known-distance": ["a", "b", 1], "--parameters": ["b7", "d7"], "--known": ["b7"],
        "--known-lengths": ["b7"], "--fixed-base": [], "--fixed-tool": [], "--gains": [],
        "--eccentricity": [], "--compliance": ["joints"], "--loss": ["huber"],
        "--prior": [1e-3, 1e-3], "--folds": [3], "--held-out": [0.3], "--test": ["tracker.csv"],
    },
    "identify": {
        "--robot": ["planar_3r"], "--base-link": ["link_1"], "--tip-link": ["link_1"],
        "--log": ["run1.csv"], "--torques-from": ["torques.csv"], "--positions": ["tau"],
        "--torques": ["q"], "--velocities": ["q"], "--accelerations": ["q"], "--references": ["q"],
        "--time": ["q"], "--times": ["ms"], "--dt": [0.004], "--angles": ["deg"], "--gears": [2],
        "--motor-side": [], "--drive-gains": [2], "--signs": [-1], "--offsets": [0.5],
        "--delimiter": [";"], "--rows": [0, 1200], "--delay": [0.005], "--test": ["run.npz"],
        "--test-torques-from": ["torques.csv"], "--test-rows": [1000, 1500], "--test-share": [0.3],
        "--method": ["ols"], "--form": ["power"], "--drive": ["Fv", "Fc"], "--cutoff": [10],
        "--decimation": [7], "--dead-band": [0.1], "--edges": [0.5], "--no-check": [],
        "--consistent": [], "--prior": [7], "--kp": [90], "--kd": [9],
        "--workers": [0],
    },
}  # fmt: skip
"""A value other than the default; a refusal is an effect as well."""
NOT_HERE = {
    "igm": {"--package-dir", "--limits"},
    "identify": {"--package-dir", "--lengths"},
}
"""Meshes change no number, and nor do these arms' limits and slides, of which they have none:
`test_limits_drop_postures` and the tests of the readers hold them."""
WITH = {
    ("igm", "--xyz"): POSE,
    ("igm", "--rpy"): POSE,     ("igm", "--mask-axes"): ["--mask", 1, 1, 1, 1, 1, 0],
    ("excite", "--points"): ["--kind", "spline"], ("excite", "--rate"): ["--out", "new"],
    ("excite", "--format"): ["--out", "new"], ("excite", "--degrees"): ["--out", "new"],
    ("calibrate", "--pattern"): ["--measurements", "."],
    ("calibrate", "--orientation"): ["--measurements", "camera.csv", "--kind", "pose",
                                     "--angles", "rad", "--lengths", "m"],
    ("calibrate", "--other-joints"): ["--kind", "distance", "--columns", "range"],
    ("calibrate", "--fixed-base"): ["--parameters", "d0", "b7"],
    ("calibrate", "--gains"): ["--parameters", "gain1", "b7"],
    ("calibrate", "--eccentricity"): ["--parameters", "sine1", "b7"],
    ("calibrate", "--compliance"): ["--parameters", "compliance2", "b7"],
    ("calibrate", "--label"): ["--kind", "point-contact"],
    ("calibrate", "--prior"): ["--parameters", "theta2", "b7"],
    ("identify", "--delimiter"): ["--log", "run1.csv"],
    ("identify", "--no-check"): ["--log", "positions.csv", "--torques-from", "torques.csv",
                                 "--dt", 0.005],
    ("identify", "--test-rows"): ["--rows", 0, 1000], ("identify", "--consistent"): ["--prior", 5],
    ("identify", "--prior"): ["--consistent"],
}  # fmt: skip
"""What an option needs beside it; it is compared with this alone."""


@pytest.mark.parametrize("command", EFFECTS)
@pytest.mark.nightly
def test_every_option_has_an_effect(run, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    FILES[command](tmp_path)
    _, own = parser_of(command)
    left_out = SAME | NOT_HERE.get(command, {"--package-dir"})
    assert set(own.options()) - left_out == set(EFFECTS[command])
    known = {}

    def ends(words):
        key = tuple(map(str, words))
        if key not in known:
            code, out, err = run(*words, "--json")
            assert code != ExitStatus.BUG, err
            files = {path.name: path.read_bytes() for path in tmp_path.glob("new/trajectory.[cn]*")}
            known[key] = code, out, err, files
        return known[key]

    idle = []
    for option, values in EFFECTS[command].items():
        base = changed(BASE[command], WITH.get((command, option), []))
        if ends(base) == ends(changed(base, [option, *values])):
            idle.append(option)
    assert idle == []


def changed(words, options):
    """A command with other values of some options, and with new ones."""
    given = list(words)
    if {"--xyz", "--matrix"} & set(map(str, options)) and "--q" in given:
        given = given[: given.index("--q")]
    starts = [k for k, word in enumerate(options) if str(word).startswith("--")]
    for k, end in pairwise([*starts, len(options)]):
        option, values = options[k], options[k + 1 : end]
        if option not in given:
            given += [option, *values]
            continue
        first = given.index(option) + 1
        after = (j for j in range(first, len(given)) if str(given[j]).startswith("--"))
        given[first : next(after, len(given))] = values
    return given


MIMICS = """<robot name="two"><link name="base"/><link name="left"/><link name="right"/>
<joint name="a" type="continuous"><parent link="base"/><child link="left"/><axis xyz="0 0 1"/>
</joint>
<joint name="b" type="continuous"><parent link="base"/><child link="right"/><axis xyz="0 0 1"/>
<mimic joint="a" multiplier="-2" offset="0.1"/></joint></robot>"""


def test_mimic_joints_follow_where_it_is_asked_for(run, tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(MIMICS)

    def page(*options):
        scene = tmp_path / "two.html"
        code, out, err = run("view", path, *options, "--no-open", "--out", scene, "--json")
        assert (code, err) == (0, "")
        (text,) = re.findall(r'atob\("([^"]*)"\)', scene.read_text())
        joints = umsgpack.unpackb(base64.b64decode(text))["panel"]["joints"]
        return json.loads(out)["q"], sum(joint["leads"] for joint in joints)

    assert page() == ([0.0, 0.0], 2)
    assert page("--mimic") == ([0.0, 0.1], 1)
    code, _, err = run("info", "rx90", "--mimic")
    assert code == ExitStatus.WRONG_INPUT
    assert "--mimic are for URDF files" in err
