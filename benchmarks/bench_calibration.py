"""Geometric calibration beside FIGAROH and pybotics, and on real data that were kept aside.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.bench_calibration [--rounds 7] [--out ...]
        [--figaroh-python PATH] [--pybotics-python PATH] [--quick]

Times: a UR10 with errors of 1 mm and 2 mrad in all placements, base and tool off, noise of 0.1 mm
and 0.1 mrad; FIGAROH is given the same rows. Figures are medians of the processor's time, with
the clock's beside it. Peers run in environments of their own (`pip install figaroh`, and
`pip install pybotics`, which wants numpy < 2), by the Python that the options name; without it
their entries are left out and that is said. Real data: see `calibration_data.py`; both tools keep
the same rows aside. Results are written after every part. `--quick` measures the smallest and the
largest set once, and of the real data panda_1 alone, without the ways whose prior is chosen by
cross-validation, and beside one way of FIGAROH's. With `--parts` the other parts, and the rows of
peers whose Python is not named, stay as they were kept; the head says at which commit and on which
machine each part was measured.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import robotmodels as rm
from benchmarks.calibration_data import (
    CAMERA_WAYS,
    PANDA_WAYS,
    camera_errors,
    camera_splits,
    panda,
    panda_errors,
)
from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from benchmarks.measure import Contestant, in_turns
from robotmodels.calibration import Pose, fit
from robotmodels.datasets import ur10_camera

SIZES = (30, 100, 200, 500)
GOALS = {30: 0.03, 100: 0.06, 200: 0.12, 500: 0.25}
NOISE = 1e-4  # m and rad
OURS = "robotmodels"
DEFAULT = "robotmodels, with 5 folds and a share aside"
Row = dict[str, Any]


def rolled(T: np.ndarray) -> list[float]:
    """Position, roll, pitch and yaw, as FIGAROH reads them."""
    return [*T[:3, 3].tolist(), *rm.se3.to_rpy(T[:3, :3])]


def simulated(count: int) -> tuple[rm.RobotModel, np.ndarray, np.ndarray]:
    """Nominal UR10, readings and noisy poses of one that is off in every placement."""
    rng = np.random.default_rng(1)
    model = ur10_camera().model
    n = model.n
    at = np.concatenate([[model.base], rm.link_transforms(model.table, np.zeros(n))])
    at[1], at[0] = at[0] @ at[1], np.eye(4)

    def off(length: float, angle: float) -> np.ndarray:
        return rm.se3.from_rpy(angle * rng.normal(size=3), length * rng.normal(size=3))

    links = [at[j] @ off(1e-3, 2e-3) for j in range(1, n + 1)]
    Z = off(0.05, 0.05)
    E = model.tool @ rm.se3.from_rpy([0.2, -0.1, 0.3], [0.05, -0.03, 0.12])
    q = rng.uniform(-2.5, 2.5, (count, n))
    poses = []
    for row in q:
        T = Z
        for link, angle in zip(links, row, strict=True):
            T = T @ link @ rm.se3.rotation("z", angle)
        T = T @ E
        T[:3, 3] += NOISE * rng.normal(size=3)
        T[:3, :3] = T[:3, :3] @ rm.se3.from_rpy(NOISE * rng.normal(size=3))[:3, :3]
        poses.append(T)
    return model, q, np.array(poses)


def speed_rows(sizes: tuple[int, ...], rounds: int, figaroh: str, pybotics: str) -> list[Row]:
    """Full calibration on simulated poses."""
    rows: list[Row] = []
    tasks = []
    for count in sizes:
        model, q, T = simulated(count)
        floor = NOISE * np.sqrt(3.0 * (1.0 - 30.0 / (6.0 * count)))
        told = [rolled(x) + y.tolist() for x, y in zip(T, q, strict=True)]
        tasks.append({
            "name": f"{count}", "rows": told, "level": "full_params", "method": "structural",
            "repeats": min(rounds, 3),
        })  # fmt: skip
        for name, options in ((OURS, {"folds": 0, "held_out": 0}), (DEFAULT, {})):
            found = fit(model, Pose(q, T), **options)
            took = in_turns(
                [Contestant(name, lambda o=options, m=model, x=q, y=T: fit(m, Pose(x, y), **o))],
                rounds,
            )[name]
            processor, clock = took.processor.median, took.clock.median
            rms = found.validation.in_sample.rms
            rows.append({
                "work": count, "name": name, "processor": processor, "clock": clock,
                "parameters": [len(found.names)], "position": rms["m"],
                "angle": rms["rad"], "floor": floor,
                "goal": GOALS[count] if name == OURS else None,
            })  # fmt: skip
        print(count, [f"{r['name']} {r['processor']:.4f} s" for r in rows[-2:]], flush=True)
    others = {
        "FIGAROH": peer(figaroh, "calibration_figaroh.py", tasks),
        "pybotics, distances of positions": peer(
            pybotics, "calibration_pybotics.py", [str(count) for count in sizes]
        ),
    }
    for name, answers in others.items():
        rows += [{**said, "work": int(said["name"]), "name": name} for said in answers]
    first = {r["work"]: r["processor"] for r in rows if r["name"] == OURS}
    for r in rows:
        r["ratio"] = r["processor"] / first[r["work"]]
    return sorted(rows, key=lambda r: r["work"])


def peer(python: str, script: str, tasks: list[Any]) -> list[dict[str, Any]]:
    """What a peer says to some tasks, in an environment of its own."""
    if not python:
        return []
    path = Path(__file__).parent / script
    with tempfile.TemporaryDirectory() as folder:
        arguments = tasks
        if tasks and isinstance(tasks[0], dict):
            job = Path(folder) / "job.json"
            job.write_text(json.dumps({"urdf": ur10_camera().urdf, "tasks": tasks}))
            arguments = [str(job)]
        done = subprocess.run(
            [python, "-W", "ignore", str(path), *arguments], capture_output=True, text=True,
            check=False, timeout=3600,
        )  # fmt: skip
    if done.returncode:
        print(f"{script} ended with an error: {done.stderr.splitlines()[-1:]}")
        return []
    said = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    for entry in said:
        if "skipped" in entry:
            print(f"{entry['skipped']}: its entries are left out.")
            return []
        print(script, {k: v for k, v in entry.items() if k != "parameters"}, flush=True)
    return said


def camera_rows(ways: tuple[str, ...], figaroh: str) -> list[Row]:
    """Errors on rows of the UR10's camera that were kept aside."""
    q, T = ur10_camera().measured
    splits = camera_splits(len(q))
    rows: list[Row] = []
    for way in ways:
        row: Row = {"name": f"robotmodels: {way}"}
        for scheme, parts in {"in sample": [], **splits}.items():
            position, angle, counts = camera_errors(way, parts)
            row[scheme] = (position, angle)
            row["parameters"] = sorted(set(counts) | set(row.get("parameters", ())))
        rows.append(row)
        print(row, flush=True)
    told = [rolled(x) + y.tolist() for x, y in zip(T, q, strict=True)]
    others = (
        ("full_params", "map"), ("full_params", "structural"), ("joint_offset", "structural"),
    )  # fmt: skip
    for level, method in others[:1] if len(ways) < len(CAMERA_WAYS) else others:
        base = {"rows": told, "level": level, "method": method}
        tasks: list[Any] = [{"name": "in sample", **base, "repeats": 1}]
        tasks += [
            {"name": scheme, **base, "parts": [part.tolist() for part in parts]}
            for scheme, parts in splits.items()
        ]
        said = peer(figaroh, "calibration_figaroh.py", tasks)
        if said:
            row = {"name": f"FIGAROH: {level}, {method}"}
            row |= {entry["name"]: (entry["position"], entry["angle"]) for entry in said}
            row["parameters"] = sorted({k for entry in said for k in entry["parameters"]})
            rows.append(row)
    return rows


def panda_rows(ways: tuple[str, ...], robots: tuple[str, ...]) -> list[Row]:
    """Errors at places of the double socket that were kept aside."""
    rows: list[Row] = []
    for robot in robots:
        places = sorted(panda(robot)[0].places)
        jobs = [([p for p in places if p != out], [out]) for out in places]
        if robot == "panda_1":
            jobs.insert(0, (["front"], [p for p in places if p != "front"]))
        for way in ways:
            for train, test in jobs:
                before, after, elsewhere = panda_errors(robot, way, train, test)
                rows.append({
                    "robot": robot, "way": way, "train": train, "before": before,
                    "after": after, "elsewhere": elsewhere,
                })  # fmt: skip
            print(robot, way, [r["elsewhere"] for r in rows[-len(jobs) :]], flush=True)
    return rows


def commit() -> str:
    """The last commit of the package that is measured."""
    said = subprocess.run(
        ["git", "log", "-1", "--format=%h", "--", str(Path(rm.__file__).parent)],
        capture_output=True, text=True, check=False, cwd=Path(__file__).parent,
    )  # fmt: skip
    return said.stdout.strip() or "unknown"


def report(about: dict[str, str], speed: list[Row], camera: list[Row], sockets: list[Row]) -> str:
    """The results as Markdown."""
    lines = [
        *head("Geometric calibration: measured side by side", about),
        "## UR10, simulated poses", "",
        "Processor's time and clock in s, medians; `x`: ratio to the plain fit of ours. Position "
        "and angle: root mean square of the fitted rows; floor: what noise alone leaves of the "
        "position with 30 parameters.", "",
        "| poses | contestant | s | clock | x | parameters | position, mm | floor | angle, mrad | "
        "goal, s | met |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for r in speed:
        goal = r.get("goal")
        met = "" if goal is None else ("yes" if r["processor"] <= goal else "no")
        kept = f"{r['parameters'][0]}" + (f" of rank {r['rank']}" if "rank" in r else "")
        floor = f"{1e3 * r['floor']:.4f}" if "floor" in r else ""
        angle = f"{1e3 * r['angle']:.4f}" if "angle" in r else ""
        lines.append(
            f"| {r['work']} | {r['name']} | {r['processor']:.4f} | {r['clock']:.4f} | "
            f"{r['ratio']:.1f} | {kept} | {1e3 * r['position']:.4f} | {floor} | {angle} | "
            f"{'' if goal is None else goal} | {met} |"
        )
    schemes = ["in sample", "5 folds, 0", "5 folds, 1", "5 folds, 2", "leave one out"]
    lines += [
        "", "## UR10 with a camera, 23 real poses", "",
        "Root mean square of position, mm / angle, degrees; all but the first column of rows that "
        "were kept aside, the same ones for both tools.", "",
        "| fit | parameters | " + " | ".join(schemes) + " |", "|---" * 7 + "|",
    ]  # fmt: skip
    for r in camera:
        told = [f"{1e3 * r[s][0]:.3f} / {np.degrees(r[s][1]):.3f}" for s in schemes]
        kept = " to ".join(f"{k}" for k in sorted({r["parameters"][0], r["parameters"][-1]}))
        lines.append(f"| {r['name']} | {kept} | " + " | ".join(told) + " |")
    lines += [
        "", "## Panda in the double socket", "",
        "Mean distance of the ball from its socket, mm: with the nominal arm and after calibration "
        "where it was trained (base and tool fitted in both), and at places kept aside, whose "
        "sockets alone are fitted, without their distance.", "",
        "| robot | fit | trained on | before | after | kept aside |", "|---" * 6 + "|",
    ]  # fmt: skip
    for r in sockets:
        aside = ", ".join(f"{place} {1e3 * e:.3f}" for place, e in r["elsewhere"].items())
        few = r["train"] if len(r["train"]) < 3 else [f"the other {len(r['train'])}"]
        lines.append(
            f"| {r['robot']} | {r['way']} | {', '.join(few)} | {1e3 * r['before']:.2f} | "
            f"{1e3 * r['after']:.3f} | {aside} |"
        )
    for robot in dict.fromkeys(r["robot"] for r in sockets):
        lines += ["", f"Mean of the places of {robot}, each left out in turn:", ""]
        for way in dict.fromkeys(r["way"] for r in sockets):
            each = [
                next(iter(r["elsewhere"].values()))
                for r in sockets
                if (r["robot"], r["way"]) == (robot, way) and len(r["elsewhere"]) == 1
            ]
            lines.append(f"- {way}: {1e3 * np.mean(each):.3f} mm")
    return "\n".join(lines) + "\n"


PARTS = ["speed", "double_socket", "camera"]


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--figaroh-python", default="")
    parser.add_argument("--pybotics-python", default="")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument(
        "--parts", nargs="+", choices=PARTS, default=PARTS,
        help="what to measure; the rest stays as it was kept",
    )  # fmt: skip
    given = parser.parse_args()
    figaroh, pybotics = given.figaroh_python, given.pybotics_python
    for name, python in (("FIGAROH", figaroh), ("pybotics", pybotics)):
        if not python:
            print(f"No Python with {name} was named: its entries are left out.")
    quick = given.quick
    about = machine(interpreters={"figaroh": figaroh, "pybotics": pybotics})
    if quick:
        about["run"] = "quick: not all that the script measures"
    sizes = (SIZES[0], SIZES[-1]) if quick else SIZES
    ways = [w for w in CAMERA_WAYS if not (quick and "cross-validation" in w)]
    robots = ("panda_1",) if quick else ("panda_1", "panda_2")
    speed: list[Row] = []
    camera: list[Row] = []
    sockets: list[Row] = []

    def keep_all() -> None:
        kept = {"machine": about, "speed": speed, "camera": camera, "double_socket": sockets}
        keep(given.out, "calibration", report(about, speed, camera, sockets), kept)

    old = json.loads((given.out / "calibration.json").read_text()) if given.parts != PARTS else {}
    for rows, part in ((speed, "speed"), (camera, "camera"), (sockets, "double_socket")):
        if part not in given.parts:
            rows += old[part]
            about[part] = old["machine"].get(part, "measured earlier")
        else:
            about[part] = f"package of commit {commit()}, {about['cpu']}, load {about['load']}"
    peers = ("FIGAROH", figaroh), ("pybotics", pybotics)
    unnamed = tuple(name for name, python in peers if old and not python)
    if unnamed:
        about |= {name.lower(): old["machine"].get(name.lower(), "left out") for name in unnamed}
        about["rows of peers"] = (
            f"{', '.join(unnamed)}: measured earlier; their ratios are to ours of that run"
        )
    if "speed" in given.parts:
        speed += speed_rows(sizes, 1 if quick else given.rounds, figaroh, pybotics)
        speed += [r for r in old.get("speed", []) if str(r["name"]).startswith(unnamed)]
        speed.sort(key=lambda r: r["work"])
        keep_all()
    if "double_socket" in given.parts:
        for robot in robots:
            sockets += panda_rows(tuple(PANDA_WAYS), (robot,))
            keep_all()
    if "camera" in given.parts:
        camera += camera_rows(tuple(ways), figaroh)
        camera += [r for r in old.get("camera", []) if str(r["name"]).startswith(unnamed)]
        keep_all()
    print(report(about, speed, camera, sockets))


if __name__ == "__main__":
    main()
