"""Compiled functions: compiled when first called, kept on the disk, harmless to results."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest
from numba.core import event

from robotmodels.cli.program import main
from robotmodels.errors import RobotModelsWarning
from robotmodels.kernels import _cache, _compile, prepare

pytestmark = pytest.mark.nightly

CALL = """
import warnings
import numpy as np
import robotmodels as rm
with warnings.catch_warnings(record=True) as found:
    warnings.simplefilter("always")
    model = rm.load("rx90")
    q = np.linspace(-1.0, 1.0, 12).reshape(2, 6)
    T = rm.dgm(model, q)
    assert np.abs(T[0] - rm.dgm(model, q[0])).max() < 1e-12
    K = rm.kinetic_energy(model, q, q)
print(len([w for w in found if "Compiled functions are not cached" in str(w.message)]))
"""


def call(**environment):
    """Number of warnings about the cache in a process that compiles some kernels."""
    outcome = subprocess.run(
        [sys.executable, "-c", CALL], capture_output=True, text=True, check=False,
        env={k: v for k, v in (os.environ | environment).items() if v is not None},
    )  # fmt: skip
    assert outcome.returncode == 0, outcome.stderr
    return int(outcome.stdout)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of compiled functions of its own."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    _cache.cache_folder.cache_clear()
    _cache._warn.cache_clear()
    yield tmp_path
    _cache.cache_folder.cache_clear()
    _cache._warn.cache_clear()


def doubled(x, y):
    for i in range(len(x)):
        y[i] = 2.0 * x[i]


def kernel():
    """A kernel that is not compiled yet."""
    return _compile.compiled(_compile.NOTHING(_compile.VECTOR, _compile.OUT1))(doubled)


def test_kernels_are_compiled_at_the_first_call_for_their_declared_types(folder):
    first = kernel()
    assert not first.signatures
    x, y = np.arange(3.0), np.empty(3)
    first(x, y)
    assert y.tolist() == [0.0, 2.0, 4.0]
    x.flags.writeable = False
    first(x, y)
    assert len(first.signatures) == 1
    for refused in (np.arange(3), np.zeros((3, 3)), np.zeros(6)[::2]):
        for called in (first, kernel()):
            with pytest.raises(TypeError):
                called(refused, y)
    with pytest.raises(TypeError):
        kernel()(y, x)  # an output that is read-only
    second = kernel()
    second(x, y)
    assert not second.stats.cache_misses
    assert second.stats.cache_hits


@pytest.mark.skipif(not hasattr(os, "fork"), reason="Windows has no fork: no child to block")
def test_a_child_of_a_process_that_compiles_is_not_blocked(folder):
    code = """
import os, threading, time, warnings
import numpy as np
import robotmodels as rm
import robotmodels.kernels.mass, robotmodels.kernels.torques
warnings.simplefilter("ignore")  # of threads and forks
model = rm.load("rx90")
q = np.zeros((2, 6))
thread = threading.Thread(target=rm.coriolis_matrix, args=(model, q, q))
thread.start()
time.sleep(0.3)
child = os.fork()
if child == 0:
    rm.kinetic_energy(model, q, q)
    os._exit(0)
thread.join()
assert os.waitpid(child, 0)[1] == 0
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_damaged_files_are_compiled_anew(tmp_path):
    assert call(NUMBA_CACHE_DIR=str(tmp_path)) == 0
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(files) > 5
    for k, path in enumerate(files):
        data = bytearray(path.read_bytes())
        data[-len(data) // 3] ^= 0xFF
        path.write_bytes([bytes(data), bytes(data[: len(data) // 2]), b""][k % 3])
    assert call(NUMBA_CACHE_DIR=str(tmp_path)) == 0
    assert all(path.stat().st_size > 1000 for path in files)


@pytest.mark.parametrize("root", ["file/below", "not_mine"])
def test_without_a_folder_there_is_one_warning(tmp_path, root):
    (tmp_path / "file").write_text("no folder")
    if root == "not_mine":
        place = tmp_path / root / f"robotmodels-{_cache._fingerprint()}"
        place.mkdir(parents=True)
        place.chmod(0o777)
    assert call(NUMBA_CACHE_DIR=str(tmp_path / root)) == 1
    assert not list((tmp_path / root).rglob("robotmodels.*"))


def test_a_full_disk_costs_one_warning(folder, monkeypatch):
    def full(path, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(_cache.Path, "write_bytes", full)
    x, y = np.arange(3.0), np.empty(3)
    with pytest.warns(RobotModelsWarning, match="not cached.*No space"):
        kernel()(x, y)
    kernel()(x, y)  # warnings are errors here: the second one is silent
    assert y[2] == 4.0
    assert not [path for path in folder.rglob("*") if path.is_file()]


def test_an_edited_source_has_a_folder_of_its_own(tmp_path, monkeypatch):
    before = _cache._fingerprint()
    assert before == _cache._fingerprint()
    read = _cache._read
    edited = _cache.kernel_files()[-1]
    monkeypatch.setattr(_cache, "_read", lambda path: read(path) + b"\n" * (path == edited))
    assert _cache._fingerprint() != before


def test_an_interrupt_while_compiling_harms_nothing(folder):
    class Interrupt(event.Listener):
        def on_start(self, event):
            raise KeyboardInterrupt

        def on_end(self, event):
            pass

    interrupted, listener = kernel(), Interrupt()
    x, y = np.arange(3.0), np.empty(3)
    event.register("numba:compile", listener)
    try:
        with pytest.raises(KeyboardInterrupt):
            interrupted(x, y)
    finally:
        event.unregister("numba:compile", listener)
    interrupted(x, y)
    assert y[2] == 4.0


def test_the_command_compiles_in_advance(capsys, monkeypatch, tmp_path):
    names = prepare.kernel_modules()
    assert "robotmodels.kernels.poses" in names
    assert "robotmodels.igm.paul._kernel" in names
    monkeypatch.setattr(prepare, "kernel_modules", lambda: ["robotmodels.kernels.torques"])
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert main(["compile", "--processes", "2"]) == 0
    assert re.match(
        r"2 functions are ready, after \d+ s\. They are kept in ", capsys.readouterr().out
    )
    for name in ("joint_torques", "energies"):
        assert list(tmp_path.rglob(f"robotmodels.kernels.torques.{name}-*"))
    assert main(["compile", "--processes", "0"]) == 2
    assert "expected 1 or more" in capsys.readouterr().err
