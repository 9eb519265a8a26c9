"""Files are written where they were asked for and nowhere else, and nothing uses the network."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.nightly

TESTS = Path(__file__).resolve().parent.parent

# Python tells a hook of what it opens, connects and starts; caches of compiled code aside
WATCHED = """
import os, sys, warnings
from pathlib import Path
ALLOWED = Path(os.environ["ALLOWED"]).resolve()
FOUND = []
CACHES = ("__pycache__", "/robotmodels-", ".cache/robotmodels", "/dev/null",
          "/proc/self/task")
def allowed(path):
    if isinstance(path, int) or path is None:
        return True
    where = Path(os.fsdecode(path))
    text = str(where if where.is_absolute() else Path.cwd() / where)
    return any(part in text for part in CACHES) or Path(text).resolve().is_relative_to(ALLOWED)
def hook(event, arguments):
    if event == "open":
        path, mode, flags = arguments
        writes = bool(flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND))
        if writes and not allowed(path):
            FOUND.append((event, str(path)))
    elif event in ("os.mkdir", "os.remove", "os.rmdir", "os.rename", "os.link", "os.symlink",
                   "os.truncate", "os.chmod", "shutil.rmtree", "shutil.move", "shutil.copyfile"):
        if not all(allowed(a) for a in arguments if isinstance(a, str | bytes)):
            FOUND.append((event, str(arguments)))
    elif event in ("socket.connect", "socket.bind", "socket.getaddrinfo", "socket.gethostbyname",
                   "socket.sendto", "urllib.Request", "http.client.connect", "subprocess.Popen",
                   "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.startfile",
                   "webbrowser.open", "ftplib.connect", "smtplib.connect"):
        FOUND.append((event, str(arguments)[:200]))
sys.addaudithook(hook)
os.chdir(ALLOWED)
"""
READ_AND_WRITE = """
sys.path.insert(0, os.environ["TESTS"])
import json
import numpy as np
import robotmodels as rm
from robotmodels import calibration, identification
from robustness import inputs
here = ALLOWED
warnings.simplefilter("ignore")
(here / "a.par").write_text(inputs.PAR)
(here / "a.urdf").write_text(inputs.URDF)
(here / "a.csv").write_text(inputs.LOG_CSV)
(here / "m.csv").write_text(inputs.MEASURED_CSV)
np.savez(here / "a.npz", **inputs.LOG)
from scipy.io import savemat
savemat(here / "a.mat", inputs.LOG)
import pyarrow as pa, pyarrow.parquet as pq
pq.write_table(pa.table({k: v.tolist() for k, v in inputs.LOG.items()}), here / "a.parquet")
before = sorted(p.name for p in here.iterdir())
rm.read_par(here / "a.par", inputs.PAR_VALUES)
model = rm.RobotModel.from_urdf(here / "a.urdf")
for name in ("a.csv", "a.npz", "a.mat", "a.parquet"):
    identification.read_log(here / name)
calibration.read_measurements(here / "m.csv", "position", inputs.planar())
assert sorted(p.name for p in here.iterdir()) == before, "a reader wrote a file"
rm.write_urdf(model, here / "b.urdf")
rm.viz.show(rm.load("rx90"), [0.0] * 6).save(here / "scene.html")
rng = np.random.default_rng(0)
arm = inputs.planar()
q = rng.uniform(-1.0, 1.0, (12, arm.n))
found = calibration.fit(
    arm, calibration.Position(q, rm.dgm(arm, q)[:, :3, 3]), parameters=("theta2",), base=False,
    tool=False,
)
calibration.write_result(found, here / "c.json")
new = sorted(set(p.name for p in here.iterdir()) - set(before) - {"tmp"})
assert new == ["b.urdf", "c.json", "scene.html"], new
"""
COMMANDS = """
import contextlib, io
from robotmodels.cli import main
before = sorted(p.name for p in ALLOWED.iterdir())
for command in (["robots"], ["info", "rx90"], ["demo", "--out", "shown"], ["--help"],
                ["view", "rx90", "--no-open", "--out", "arm.html"],
                ["igm", "rx90", "--q", "0", "0.3", "0.2", "0", "0.4", "0"]):
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        with contextlib.redirect_stderr(io.StringIO()):
            main(command)
after = sorted(p.name for p in ALLOWED.iterdir())
assert after == sorted([*before, "arm.html", "shown"]), f"written without a name: {after}"
"""
END = """
print(*sorted(set(FOUND)), sep="\\n")
sys.exit(bool(FOUND))
"""


def watched(code, folder):
    (folder / "tmp").mkdir()
    environment = {
        **os.environ, "ALLOWED": str(folder), "TESTS": str(TESTS), "TMPDIR": str(folder / "tmp"),
        "PYTHONPATH": str(TESTS.parent), "MPLBACKEND": "Agg", "MPLCONFIGDIR": str(folder / "tmp"),
    }  # fmt: skip
    return subprocess.run(
        [sys.executable, "-c", WATCHED + code + END], env=environment, capture_output=True,
        text=True, timeout=300.0, check=False,
    )  # fmt: skip


@pytest.mark.parametrize("code", [READ_AND_WRITE, COMMANDS], ids=["functions", "commands"])
def test_nothing_is_written_elsewhere_and_nothing_is_called(tmp_path, code):
    done = watched(code, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    "bad",
    [
        'open(ALLOWED.parent / "elsewhere.txt", "w").close()',
        "import socket; socket.getaddrinfo('localhost', 80)",
    ],
)
def test_the_watch_sees_what_it_is_for(tmp_path, bad):
    inner = tmp_path / "allowed"
    inner.mkdir()
    done = watched(bad, inner)
    assert done.returncode == 1
    assert done.stdout.startswith("(")
