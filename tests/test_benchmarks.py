"""Benchmarks run without any peer and can fail; the pages have the tables of their results."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import robotmodels as rm
from benchmarks import works
from benchmarks.__main__ import ROOMS
from benchmarks.bench_igm import agreement
from benchmarks.measure import Contestant, Spent, in_turns
from benchmarks.peers.igm import Peer

pytestmark = pytest.mark.nightly

ROOT = Path(__file__).parents[1]
WITHOUT_PEERS = """
import runpy, sys
from benchmarks import one_thread
from benchmarks.works import PACKAGES
for name in PACKAGES.values():
    sys.modules[name] = None  # the import fails
sys.argv = ["benchmarks", "--quick", "--only", "pose", "jacobian", "--out", sys.argv[1]]
runpy.run_module("benchmarks", run_name="__main__")
"""


def run(*words):
    return subprocess.run([sys.executable, *words], capture_output=True, text=True, cwd=ROOT)


def test_one_command_runs_without_any_peer(tmp_path):
    done = run("-c", WITHOUT_PEERS, str(tmp_path))
    assert done.returncode == 0, done.stderr
    kept = json.loads((tmp_path / "peers.json").read_text())
    assert {*works.PACKAGES} <= {*kept["absent"]}
    assert len(kept["rows"]) == 4
    for row in kept["rows"]:
        assert row["ways"][0]["name"] == works.OURS
        for w in row["ways"]:
            assert 0.0 < w["least"] <= w["median"] <= w["most"]
            assert w["rounds"] == 3
        assert (row["ratio"] is None) is (len(row["ways"]) == 1)
    assert {"cpu", "python", "numpy", "load"} <= set(kept["machine"])
    assert (tmp_path / "peers.md").read_text() in done.stdout


@pytest.mark.parametrize("room", ROOMS)
def test_works_of_a_room_are_made(room):
    """Of each function the first work, and what is ours in it."""
    settings = works.Settings(rounds=1, budget=0.0, quick=True)
    for make in works.works_of(room).values():
        if make.__name__ not in ("planned", "excitation", "maps"):  # seconds each
            ours = next(make(settings)).contestants[0]
            assert ours.name == works.OURS
            ours.run()


def test_contestants_take_turns():
    order = []
    field = [
        Contestant("a", lambda: order.append("a")),
        Contestant("b", lambda: order.append("b"), said=lambda _: "a note"),
        Contestant("once", lambda: order.append("once"), rounds=1),
    ]
    found = in_turns(field, 4)
    assert "".join(x[0] for x in order) == "ab" + "abo" + "ababab"
    assert {name: t.rounds for name, t in found.items()} == {"a": 4, "b": 4, "once": 1}
    with pytest.raises(ValueError, match="one name"):
        in_turns([field[0], field[0]], 3)


@pytest.mark.parametrize(("limit", "met"), [(2.1, True), (1.9, False)])
def test_goals_and_ratios(limit, met):
    ways = [
        Contestant(works.OURS, lambda: Spent(2e-6, 2e-6)),
        Contestant("RTB", lambda: Spent(5e-6, 5e-6)),
        Contestant("EAIK", lambda: Spent(3e-6, 3e-6)),
        Contestant("a part", lambda: Spent(1e-6, 1e-6), whole=False),
    ]
    work = works.Work("some work", "us", ways, [works.at_most(limit, "us")])
    row = work.measured(works.Settings(rounds=3))
    goal = f"<= {limit:g} us, {'met' if met else 'not met'}"
    told = "RTB 5.00; EAIK 3.00; (a part 1.00)"
    assert works.cells(row) == ["some work", "2.00 us", told, "1.50", goal]
    assert f"| some work | 2.00 us | {told} | 1.50 | {goal} |" in works.markdown({}, [row], [])


def test_answers_that_differ_end_the_run():
    ours = np.array([[1.0, 20.0], [3.0, 4.0]])
    assert works.same("pose", ours, ours + 1e-12)(None) == "equal to 5e-14"
    for other in (ours + 1e-4, ours * np.nan):
        with pytest.raises(works.DisagreementError, match="pose"):
            works.same("pose", ours, other)
    arm = rm.load("ur5e")
    T = rm.dgm(arm, np.random.default_rng(0).uniform(-2.0, 2.0, (5, 6)))
    peer = Peer("some", lambda x: x, lambda x: x, lambda q: rm.dgm(arm, q))
    rows = [found.q[found.valid] for found in (rm.igm(arm, x) for x in T)]
    total = sum(map(len, rows))
    assert agreement(arm, T, peer, rows) == f"{total} postures of 5 poses, as ours"
    astray = [np.vstack([rows[0], np.zeros(6)]), *rows[1:]]
    assert "1 that miss the pose" in agreement(arm, T, peer, astray)
    with pytest.raises(works.DisagreementError, match="1 of ours are not among them"):
        agreement(arm, T, peer, [rows[0][:-1], *rows[1:]])


def test_pages_are_what_the_results_give():
    done = run("benchmarks/readme_tables.py", "--check")
    assert done.returncode == 0, done.stderr


# --- ratios --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ratios():
    spec = importlib.util.spec_from_file_location("ratios", ROOT / ".ci" / "ratios.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["ratios"] = module  # where its classes look themselves up
    spec.loader.exec_module(module)
    yield module
    del sys.modules["ratios"]


def test_ratio_that_is_kept_is_near_and_slowed_work_fails():
    name = "idm, batch"
    good = run(".ci/ratios.py", "--only", name)
    assert good.returncode == 0, good.stdout + good.stderr
    slow = run(".ci/ratios.py", "--only", name, "--slowed", name)
    assert slow.returncode == 1, slow.stdout
    assert f"slower than it was, beside its yardstick: {name}" in slow.stderr
