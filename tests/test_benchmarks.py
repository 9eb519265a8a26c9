"""Benchmarks run without any peer and can fail; the pages have the tables of their results."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import robotmodels as rm
from benchmarks import machine, readme_tables, works
from benchmarks.__main__ import ROOMS, main
from benchmarks.bench_igm import agreement
from benchmarks.measure import Contestant, Spent, in_turns
from benchmarks.peers.igm import Peer

pytestmark = pytest.mark.nightly

ROOT = Path(__file__).parents[1]


def run(*words, cwd=ROOT):
    command = [sys.executable, *words]
    compiled = {k: v for k, v in os.environ.items() if k != "NUMBA_DISABLE_JIT"}
    return subprocess.run(
        command, capture_output=True, text=True, cwd=cwd, check=False, env=compiled
    )  # fmt: skip


# --- the one command -----------------------------------------------------------------------------

WITHOUT_PEERS = """
import sys
from benchmarks import one_thread
from benchmarks.works import PACKAGES
for name in PACKAGES.values():
    sys.modules[name] = None  # the import fails
import runpy
sys.argv = ["benchmarks", "--quick", "--only", "pose", "jacobian", "--out", sys.argv[1]]
runpy.run_module("benchmarks", run_name="__main__")
"""


def test_one_command_runs_without_any_peer(tmp_path):
    done = run("-c", WITHOUT_PEERS, str(tmp_path))
    assert done.returncode == 0, done.stderr
    kept = json.loads((tmp_path / "peers.json").read_text())
    assert {*works.PACKAGES} <= {*kept["absent"]}
    assert len(kept["absent"]) == len(works.PACKAGES) + 2
    assert len(kept["rows"]) == 4
    for row in kept["rows"]:
        assert row["ways"][0]["name"] == works.OURS
        for w in row["ways"]:
            assert 0.0 < w["least"] <= w["median"] <= w["most"]
            assert w["rounds"] == 3
        assert (row["ratio"] is None) is (len(row["ways"]) == 1)
        assert all(goal["met"] in (True, False) for goal in row["goals"])
    facts = kept["machine"]
    assert {"cpu", "python", "numpy", "load"} <= set(facts)
    assert facts["run"].startswith("quick")
    assert (tmp_path / "peers.md").read_text() in done.stdout


def test_unknown_works_and_busy_machines_are_refused(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--only", "pozes"])
    with pytest.raises(SystemExit) as refused:
        main()
    assert refused.value.code == 2
    told = capsys.readouterr().err
    assert "'pozes'" in told
    assert "inverse_dynamics" in told
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--only", "pose"])
    monkeypatch.setattr(os, "getloadavg", lambda: (5.0, 0.0, 0.0), raising=False)
    with pytest.raises(SystemExit, match=r"load 5\.0"):
        main()


@pytest.mark.parametrize("room", ROOMS)
def test_works_of_a_room_are_made(room):
    """Of each function the first work, and what is ours in it."""
    settings = works.Settings(rounds=1, budget=0.0, quick=True)
    for make in works.works_of(room).values():
        if make.__name__ in ("planned", "excitation", "maps"):
            continue  # seconds each
        work = next(make(settings))
        assert work.contestants[0].name == works.OURS
        work.contestants[0].run()


# --- measuring -----------------------------------------------------------------------------------


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
    assert found["b"].note == "a note"


def test_time_of_another_process_is_taken_as_it_says():
    told = iter([9.0, 4.0, 6.0, 5.0])
    slow = Contestant("slow", lambda: Spent(next(told), 8.0, "far away"), count=2)
    found = in_turns([slow], 3)["slow"]
    assert (found.processor.median, found.processor.least, found.processor.most) == (2.5, 2.0, 3.0)
    assert found.clock.median == 4.0
    assert found.note == "far away"


def test_rounds_end_with_the_budget_but_not_before_three():
    assert in_turns([Contestant("a", lambda: None)], 50, budget=0.0)["a"].rounds == 3


def test_two_of_one_name_are_refused():
    with pytest.raises(ValueError, match="one name"):
        in_turns([Contestant("a", lambda: None), Contestant("a", lambda: None)], 3)


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
    assert row["goals"] == [{"text": f"<= {limit:g} us", "met": met}]
    assert [round(w["median"], 9) for w in row["ways"]] == [2.0, 5.0, 3.0, 1.0]
    assert row["ratio"] == pytest.approx(1.5)
    told = "RTB 5.00; EAIK 3.00; (a part 1.00)"
    goal = f"<= {limit:g} us, {'met' if met else 'not met'}"
    assert works.cells(row) == ["some work", "2.00 us", told, "1.50", goal]
    facts = {"cpu": "some", "python": "3"}
    assert f"| some work | 2.00 us | {told} | 1.50 | {goal} |" in works.markdown(facts, [row], [])


@pytest.mark.parametrize(("others", "warned"), [(0.9, False), (1.1, True)])
def test_a_busy_machine_is_warned_of(others, warned, monkeypatch):
    monkeypatch.setattr(os, "getloadavg", lambda: (others, 0.0, 0.0), raising=False)
    assert bool(machine.too_busy()) is warned


# --- both sides computed the same ----------------------------------------------------------------


def test_arrays_that_differ_end_the_run():
    ours = np.array([[1.0, 20.0], [3.0, 4.0]])
    assert works.same("pose", ours, ours + 1e-12)(None) == "equal to 5e-14"
    with pytest.raises(works.DisagreementError, match=r"pose differs from ours by 5\.0e-06"):
        works.same("pose", ours, ours + 1e-4)
    with pytest.raises(works.DisagreementError, match="differs"):
        works.same("pose", ours, ours * np.nan)
    with pytest.raises(works.DisagreementError, match="shape"):
        works.same("pose", ours, ours[:1])


def test_postures_that_differ_end_the_run():
    arm = rm.load("ur5e")
    T = rm.dgm(arm, np.random.default_rng(0).uniform(-2.0, 2.0, (5, 6)))
    all_of = [rm.igm(arm, x) for x in T]
    rows = [found.q[found.valid] for found in all_of]
    peer = Peer("some", lambda x: x, lambda x: x, lambda q: rm.dgm(arm, q))
    total = sum(map(len, rows))
    assert agreement(arm, T, peer, rows) == f"{total} postures of 5 poses, as ours"
    turned = [q + 2.0 * np.pi for q in rows]
    assert f"{total} postures" in agreement(arm, T, peer, turned)
    astray = [np.vstack([rows[0], np.zeros(6)]), *rows[1:]]
    assert "1 that miss the pose" in agreement(arm, T, peer, astray)
    fewer = [rows[0][:-1], *rows[1:]]
    with pytest.raises(works.DisagreementError, match="1 of ours are not among them"):
        agreement(arm, T, peer, fewer)
    one = Peer("RTB ikine_a, 1 posture", peer.solve, peer.postures, peer.direct)
    assert "5 postures" in agreement(arm, T, one, [q[:1] for q in rows])
    with pytest.raises(works.DisagreementError, match="0 postures"):
        agreement(arm, T, one, [np.empty((0, 6))] * 5)


# --- tables of the pages ------------------------------------------------------------------------


def test_readme_is_what_the_results_give():
    done = run("benchmarks/readme_tables.py", "--check")
    assert done.returncode == 0, done.stderr


def test_tables_are_put_between_their_lines(tmp_path):
    (tmp_path / "docs").mkdir()
    pages = tmp_path / "README.md", tmp_path / "docs/benchmarks.md"
    for page in pages:
        page.write_text(f"before\n{readme_tables.BEGIN}\nold\n{readme_tables.END}\nafter\n")
    assert run("benchmarks/readme_tables.py", "--check", "--root", str(tmp_path)).returncode == 1
    assert "old" in pages[0].read_text()
    assert run("benchmarks/readme_tables.py", "--root", str(tmp_path)).returncode == 0
    for page, made in zip(pages, (readme_tables.short(), readme_tables.tables()), strict=True):
        begin, end = readme_tables.BEGIN, readme_tables.END
        assert page.read_text() == f"before\n{begin}\n{made}\n{end}\nafter\n"
    assert run("benchmarks/readme_tables.py", "--check", "--root", str(tmp_path)).returncode == 0
    with pytest.raises(ValueError, match="lacks the lines"):
        readme_tables.replaced("nothing here", "tables")


# --- ratios --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ratios():
    spec = importlib.util.spec_from_file_location("ratios", ROOT / ".ci" / "ratios.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["ratios"] = module  # where its classes look themselves up
    spec.loader.exec_module(module)
    yield module
    del sys.modules["ratios"]


def spent(seconds):
    return lambda: Spent(seconds, seconds)


def test_ratio_that_is_unusual_is_the_median_of_five(ratios):
    pair = ratios.Pair("some", "a yardstick", spent(3.0), spent(2.0))
    assert pair.ratio() == 1.5
    assert ratios.checked(pair, ratios.Kept(1.5, 0.1)) == (1.5, 1)
    assert ratios.checked(pair, ratios.Kept(1.0, 0.1)) == (1.5, ratios.ATTEMPTS)
    assert ratios.checked(pair, ratios.Kept(2.1, 0.1)) == (1.5, ratios.ATTEMPTS)
    counted = ratios.Pair("some", "a yardstick", spent(3.0), spent(2.0), (10, 1))
    assert counted.ratio() == pytest.approx(0.15)

    def busy(*attempts):
        # a run before the rounds, and the rounds, of each attempt
        took = iter([x for x in attempts for _ in range(1 + ratios.ROUNDS)])
        return ratios.Pair(
            "some", "a yardstick", lambda: Spent((s := next(took)), s), spent(2.0)
        )  # fmt: skip

    kept = ratios.Kept(1.0, 0.1)
    assert ratios.checked(busy(9.0, 2.0, 2.2, 8.0, 2.0), kept) == (1.1, 5)
    # one lucky attempt does not hide what is slow
    found, attempts = ratios.checked(busy(4.0, 2.0, 4.0, 4.2, 4.0), kept)
    assert (found, attempts) == (2.0, 5)
    assert kept.slower(found)


def test_margin_follows_the_spread(ratios):
    quiet, wild = ratios.Kept(2.0, 0.02), ratios.Kept(2.0, 0.125)
    assert quiet.margin == ratios.LEAST
    assert wild.margin == pytest.approx(np.exp(0.375))
    assert not wild.slower(2.90)
    assert wild.slower(2.92)
    assert wild.faster(1.49)
    assert not wild.faster(1.51)
    # the rates are those of the rule, tried on random attempts
    rng = np.random.default_rng(0)
    for times in (1.0, 1.45, 2.0):
        r = 2.0 * times * np.exp(0.125 * rng.normal(size=(20_000, 5)))
        called = (r[:, 0] > wild.margin * 2.0) & (np.median(r, axis=1) > wild.margin * 2.0)
        assert called.mean() == pytest.approx(wild.alarm(times), abs=0.01)
    assert wild.alarm() < 1e-6
    assert wild.alarm(2.0) > 0.99


def test_what_is_kept_hardly_ever_raises_a_false_alarm(ratios):
    told = json.loads(ratios.FILE.read_text())["pairs"]
    kept = [ratios.Kept(**known) for known in told.values()]
    assert len(kept) > 20
    assert sum(known.alarm() for known in kept) < 1e-3
    assert min(known.alarm(2.0) for known in kept) > 0.8


def test_ratio_that_is_kept_is_near_and_slowed_work_fails():
    name = "idm, batch"
    good = run(".ci/ratios.py", "--only", name)
    assert good.returncode == 0, good.stdout + good.stderr
    slow = run(".ci/ratios.py", "--only", name, "--slowed", name)
    assert slow.returncode == 1, slow.stdout
    assert f"slower than it was, beside its yardstick: {name}" in slow.stderr
    assert "median of 5" in slow.stdout
