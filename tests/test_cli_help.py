"""The examples of every ``--help`` run as they are printed, and every option is read."""

import base64
import inspect
import json
import re
import shlex
import sys
import tempfile
import webbrowser

import numpy as np
import pytest
import umsgpack
from test_cli import motion, save

import robotmodels as rm
from robotmodels import se3
from robotmodels.cli import main
from robotmodels.cli.program import COMMANDS, parser_of
from robotmodels.cli.terminal import ExitStatus
from robotmodels.minimal_parameters import uniform_bodies


def examples(command):
    """The commands in the help, with lines that go on joined."""
    _, own = parser_of(command)
    text = own.epilog.replace("\\\n", " ")
    return [shlex.split(line) for line in re.findall(r"^  robotmodels (.*)$", text, re.MULTILINE)]


def identify_files(folder):
    arm = rm.load("planar_2r")
    rm.write_urdf(arm, folder / "arm.urdf")
    rm.write_urdf(arm.with_inertia(uniform_bodies(arm, 9.0)), folder / "heavy.urdf")
    _, q, tau = motion(0, 1600, 0.005)
    save(folder / "positions.csv", ["q1", "q2"], np.degrees(q))
    save(folder / "torques.csv", ["tau1", "tau2"], tau)
    np.savez(folder / "run.npz", q=q, tau=tau, t=0.005 * np.arange(len(q)))
    for k in (1, 2, 3):
        _, q, tau = motion(k, 1600, 0.005)
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


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_is_read(command):
    """By its name: an option that only the parser knows would be ignored without a word."""
    _, own = parser_of(command)
    modules = [sys.modules[f"robotmodels.cli.{name}"] for name in (command, "arguments", "output")]
    code = "".join(map(inspect.getsource, modules))
    code = re.sub(r'(OPTIONS|EXAMPLES) = r?""".*?"""', "", code, flags=re.DOTALL)
    options = {action.dest for action in own._actions} - {"help", "traceback"}
    unread = [x for x in options if not re.search(rf'arguments\.{x}\b|"{x}"', code)]
    assert unread == []


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
