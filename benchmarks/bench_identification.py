"""Identification beside FIGAROH on the same logs and columns, and logs that grow.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.bench_identification [--rounds 5] [--out ...]
        [--figaroh-python PATH] [--quick]

Both tools are given the same positions, velocities, accelerations and torques (filtered by ours)
and the same columns: links, rotor inertias, viscous and dry friction, offsets; of the TX40 without
the coupling of its wrist. Both solve ordinary least squares on all rows. `as fit does it`: ours
from the raw positions with all that it does by default: checks, filter, decimation, weighted
least squares, deviations for correlated residuals, validation at the rate of the log. Every
contestant runs in a process of its own; figures are medians of the processor's time with the
clock's beside it, after a first run that compiles; memory is the highest resident memory of the
process, with what it was when the package had been imported and a short log identified.
Long logs are memory maps in files; pages of the files that are resident count and are told apart.
FIGAROH runs by the Python that the option names (`pip install figaroh` in an environment of its
own); without it its entries are left out and that is said. `--quick`: one round, no 1e7.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import robotmodels as rm
from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from robotmodels.identification import choose_processing, fit
from robotmodels.identification.signals import signals
from robotmodels.logs import Log

DT = 1e-3
NOISE = 1e-5, 0.05  # rad, N m
PIECE = 100_000
Row = dict[str, Any]
MODULE, ROOT = "benchmarks.bench_identification", Path(__file__).parents[1]


def robot(name: str) -> rm.RobotModel:
    """The robot whose columns both tools have."""
    model = rm.load(name)
    return model if model.transmission is None else model.with_transmission(None)


def simulate(folder: Path, name: str, count: int) -> None:
    """Positions and torques of a robot that moves, with noise, as memory maps."""
    model = robot(name)
    rng = np.random.default_rng(0)
    w = 2.0 * np.pi * 0.1 * np.arange(1, 6)
    A, B = 0.4 * rng.normal(size=(2, model.n, 5))
    out = [
        np.lib.format.open_memmap(folder / f"{k}.npy", "w+", np.float64, (count, model.n))
        for k in ("q", "tau")
    ]
    for start in range(0, count, PIECE):
        t = DT * np.arange(start, min(start + PIECE, count))
        s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
        q, v = s @ A.T + c @ B.T, (c * w) @ A.T - (s * w) @ B.T
        a = -(s * w**2) @ A.T - (c * w**2) @ B.T
        rows = slice(start, start + len(t))
        tau = rm.idm(model, q, v, a) + 3.0 * v + 2.0 * np.sign(v) + 0.5 * a
        out[0][rows] = q + NOISE[0] * rng.normal(size=q.shape)
        out[1][rows] = tau + NOISE[1] * rng.normal(size=q.shape)


def memory() -> tuple[float, float]:
    """Highest resident memory so far, and resident pages of files now, MB."""
    status = Path("/proc/self/status").read_text().splitlines()
    told = {line.split(":")[0]: line.split()[1] for line in status if line.endswith(" kB")}
    return int(told["VmHWM"]) / 1024.0, int(told["RssFile"]) / 1024.0


class AnonymousMemory:
    """Growth of the memory that is no page of a file while something is done, MB.

    Looked at every few milliseconds by a thread of its own: the system keeps no record of the most.
    """

    PERIOD = 0.005

    def __init__(self) -> None:
        self.first = self.most = 0.0
        self._over = threading.Event()
        self._watch = threading.Thread(target=self._look)

    @property
    def grown(self) -> float:
        """The most, above what there was in the beginning."""
        return self.most - self.first

    def __enter__(self) -> AnonymousMemory:
        self.first = self.most = self._now()
        self._watch.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._watch.join()

    def _look(self) -> None:
        while not self._over.wait(self.PERIOD):
            self.most = max(self.most, self._now())

    @staticmethod
    def _now() -> float:
        status = Path("/proc/self/status").read_text().splitlines()
        line = next(line for line in status if line.startswith("RssAnon"))
        return int(line.split()[1]) / 1024.0


def child(name: str, way: str, folder: Path, rounds: int) -> None:
    """One contestant of ours, in a process of its own."""
    model = robot(name)
    q, tau = (np.load(folder / f"{k}.npy", mmap_mode="r") for k in ("q", "tau"))
    dt = float((folder / "dt").read_text())
    v = a = None
    if way == "same":
        with np.load(folder / "job.npz") as job:
            q, v, a, tau = (job[k] for k in ("q", "v", "a", "tau"))

    def identify(log: Log) -> Any:
        if way == "same":
            chosen = choose_processing(log, decimation=1, dead_band=0.0, edges=0.0, filtered=False)
            return fit(model, log, "ols", processing=chosen, checked=False)
        return fit(model, log, processing={"decimation": 1 if way == "all rows" else None})

    few = slice(0, min(len(q), 20_000))
    identify(Log(dt, q[few], tau[few], *(None if x is None else x[few] for x in (v, a))))
    before, spent, found = memory()[0], [], None
    with AnonymousMemory() as anonymous:
        for _ in range(rounds):
            clock, processor = time.perf_counter(), time.process_time()
            found = identify(Log(dt, q, tau, v, a))
            spent.append((time.process_time() - processor, time.perf_counter() - clock))
    assert found is not None
    processor, clock = np.median(spent, axis=0).tolist()
    errors = found.validation.in_sample
    error = errors.filtered_rmse if way == "same" else errors.rmse
    print(json.dumps({
        "processor": processor, "clock": clock, "rank": len(found.names),
        "rmse": float(np.sqrt(np.mean(error**2))), "memory": memory()[0], "files": memory()[1],
        "before": before, "anonymous": anonymous.grown,
    }))  # fmt: skip


def run(command: list[str]) -> Row:
    """What a contestant says."""
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=3600, cwd=ROOT
    )
    said = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode or not said:
        return {"failed": (done.stderr.splitlines() or ["no answer"])[-1][:200]}
    return json.loads(said[-1])


def rows_of(
    work: str, name: str, folder: Path, rounds: int, peer: str, ways: list[str]
) -> list[Row]:
    """All contestants on one log."""
    out = []
    for way in ways:
        command = [sys.executable, "-W", "ignore", "-m", MODULE, "--child", name, way, str(folder)]
        out.append({"work": work, "name": NAMES[way], **run([*command, "--rounds", str(rounds)])})
        print(out[-1], flush=True)
    if peer:
        script = str(Path(__file__).parent / "identification_figaroh.py")
        files = [str(folder / "job.npz"), str(folder / "robot.urdf")]
        said = run([peer, "-W", "ignore", script, *files, str(min(rounds, 3))])
        if "skipped" in said:
            print(f"{said['skipped']}: its entries are left out.")
        else:
            out.append({"work": work, "name": "FIGAROH, all rows, OLS", **said})
            print(out[-1], flush=True)
    return out


NAMES = {
    "same": "robotmodels, all rows, OLS",
    "fit": "robotmodels, as fit does it",
    "all rows": "robotmodels, as fit does it without decimation",
}


def prepared(folder: Path, name: str, dt: float) -> None:
    """The signals that both tools are given, and the robot as URDF."""
    q, tau = (np.load(folder / f"{k}.npy") for k in ("q", "tau"))
    log = Log(dt, q, tau)
    found = signals(log, choose_processing(log, decimation=1))
    np.savez(folder / "job.npz", q=found.q, v=found.v, a=found.a, tau=found.tau)
    (folder / "dt").write_text(repr(dt))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # rotor inertias are no part of URDF, and not needed
        (folder / "robot.urdf").write_text(rm.to_urdf(robot(name)), encoding="utf-8")


def report(about: dict[str, str], rows: list[Row]) -> str:
    """The results as Markdown."""
    lines = [
        *head("Identification: measured side by side", about),
        "Processor's time and clock in s; `x`: ratio of the processor's time to the first of "
        "the same log. Memory in MB: the highest of the process, what it was before the log, and "
        "of the pages of files at the end (libraries and memory maps). RMSE over all joints, N m: "
        "of the rows that were fitted, for `as fit does it` of the raw torques.", "",
        "| log | contestant | s | clock | x | rank | RMSE | memory | before | files |",
        "|---" * 10 + "|",
    ]  # fmt: skip
    first: dict[str, float] = {}
    for r in rows:
        if "failed" in r:
            lines.append(f"| {r['work']} | {r['name']} | failed: {r['failed']} |" + " |" * 7)
            continue
        ratio = r["processor"] / first.setdefault(r["work"], r["processor"])
        files = f"{r['files']:.0f}" if "files" in r else ""
        lines.append(
            f"| {r['work']} | {r['name']} | {r['processor']:.2f} | {r['clock']:.2f} | {ratio:.2f} "
            f"| {r['rank']} | {r['rmse']:.4f} | {r['memory']:.0f} | {r['before']:.0f} | {files} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--figaroh-python", default="")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--child", nargs=3, default=None, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child is not None:
        name, way, place = given.child
        child(name, way, Path(place), given.rounds)
        return
    peer = given.figaroh_python
    if not peer:
        print("No Python with FIGAROH was named: its entries are left out.")
    about = machine(interpreters={"figaroh": peer})
    rounds = 1 if given.quick else given.rounds
    about["rounds"] = f"{rounds}, of FIGAROH {min(rounds, 3)}"
    rows: list[Row] = []

    def keep_all() -> None:
        keep(given.out, "identification", report(about, rows), {"machine": about, "rows": rows})

    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        data = rm.datasets.load_tx40()
        np.save(folder / "q.npy", data.log.q)
        np.save(folder / "tau.npy", data.log.tau)
        prepared(folder, "tx40", data.log.dt)
        work = f"TX40, real, {len(data.log)} x 6"
        rows += rows_of(work, "tx40", folder, rounds, peer, ["same", "fit", "all rows"])
        keep_all()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        simulate(folder, "rx90", 100_000)
        prepared(folder, "rx90", DT)
        ways = ["same", "fit", "all rows"]
        rows += rows_of("RX-90, simulated, 1e5 x 6", "rx90", folder, rounds, peer, ways)
        keep_all()
    for count in (1_000_000,) if given.quick else (1_000_000, 10_000_000):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            simulate(folder, "rx90", count)
            (folder / "dt").write_text(repr(DT))
            work = f"RX-90, simulated, {count:.0e} x 6, a memory map".replace("+0", "")
            rows += rows_of(work, "rx90", folder, 1, "", ["fit"])
            keep_all()
    print(report(about, rows))


if __name__ == "__main__":
    main()
