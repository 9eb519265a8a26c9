"""How commands end when something is wrong: one line, a status, no traceback unasked."""

import io
import json
import os
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
from robotmodels.cli import main
from robotmodels.cli import robots as robots_command
from robotmodels.cli.output import print_json, progress
from robotmodels.cli.terminal import ExitStatus
from robotmodels.errors import UrdfWarning

COMMAND = [sys.executable, "-m", "robotmodels"]


@pytest.fixture
def run(capsys):
    def run(*words):
        code = main([str(word) for word in words])
        out, err = capsys.readouterr()
        return code, out, err

    return run


def failing(monkeypatch, error):
    def fail(arguments):
        raise error

    monkeypatch.setattr(robots_command, "run", fail)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "which command? There are demo, robots, info"),
        (["inf"], "no command 'inf'. Did you mean info"),
        (["info", "rx90", "--jsn"], "no option --jsn. Did you mean --json"),
        (["info", "rx90", "more"], "nothing takes 'more'"),
        (["igm", "rx90", "--deg", "--q", "zero"], "no option --deg. Did you mean --degrees"),
        (["igm", "rx90", "--q", "zeroo"], "Did you mean 'zero'?"),
        (["info", "missing.urdf"], "cannot read 'missing.urdf'"),
        (["excite", "--robot", "rx90", "--out", "taken.csv/new"], "is a file; give a folder"),
        (["excite", "--robot", "rx90", "--out", "new", "--rate", 0], "--rate: expected a finite"),
        (["excite", "--robot", "rx90", "--box", 1, 1, 1, 0, 0, 0], "--box: lower, upper"),
        (["identify", "--robot", "rx90", "--log", "taken.csv", "--delimiter", ""], "character"),
        (["identify", "--robot", "rx90", "--log", "taken.csv"], "taken.csv: the file is empty"),
        (["calibrate", "--robot", "rx90", "--measurements", "nowhere.csv", "--kind", "position"],
         "No such file or directory: nowhere.csv"),
        (["calibrate", "--robot", "rx90", "--measurements", "a.csv", "--kind", "place"],
         "--kind: invalid choice: 'place'"),
    ],
)  # fmt: skip
def test_wrong_input_is_one_line(run, words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken.csv").write_text("")
    code, out, err = run(*words)
    assert (code, out) == (ExitStatus.WRONG_INPUT, "")
    assert err.startswith("robotmodels: ")
    assert message in err
    assert err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["taken.csv"]


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


def test_a_bar_is_drawn_on_terminals_only_and_taken_away(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    with progress(SimpleNamespace(quiet=False), "fits") as bar:
        bar(0.0)
        bar(1.0)
    drawn = [line.rstrip() for line in stream.getvalue().split("\r")]
    assert "100 %" in drawn[-3]
    assert drawn[-2:] == ["", ""]
    for quiet, where in ((True, stream), (False, io.StringIO())):
        monkeypatch.setattr(sys, "stderr", where)
        with progress(SimpleNamespace(quiet=quiet), "fits") as bar:
            assert bar is None


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
        assert list(data) == [
            "robot", "table", "base", "tool", "tip", "gravity", "joints", "transmission", "links",
            "total_mass", "frames", "configurations", "notes",
        ]  # fmt: skip
        again = rm.DHTable.from_rows(data["table"])
        q = np.linspace(0.1, 0.7, model.n)
        np.testing.assert_array_equal(
            rm.link_transforms(again, q), rm.link_transforms(model.table, q)
        )
        lower = [joint["lower"] for joint in data["joints"]]
        assert lower == [v if np.isfinite(v) else None for v in model.lower.tolist()]
        assert (data["transmission"] is None) == (model.transmission is None)
        assert (data["tip"], data["frames"]) == (model.tip, list(model.frame_names))


def test_json_has_no_token_that_readers_refuse(capsys):
    print_json({"a": [np.nan, 1e300], "b": {}, "θ": np.array([[1, 2]]), "e": ExitStatus.BUG})
    expected = {"a": [None, 1e300], "b": {}, "θ": [[1, 2]], "e": "BUG"}
    assert strict(capsys.readouterr().out) == expected
