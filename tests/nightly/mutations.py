"""Change one sign, index or factor of the numeric core at a time: a test must fail each time.

    python tests/nightly/mutations.py              # all of them; each run writes tests/mutations.md
    python tests/nightly/mutations.py --sample 5   # some, chosen at random: for every change
    python tests/nightly/mutations.py --only dry   # those whose room or fault has this word
    python tests/nightly/mutations.py --jobs 1     # one after the other; default: as processors
    python tests/nightly/mutations.py --places     # only look whether every text is still found

The list is `mutation_list.py`. Each fault is put into a copy of the package in a temporary folder,
one for each job, never into the checkout. Kernels run uncompiled there (``NUMBA_DISABLE_JIT``),
which is quick where tests are small and needs no compilation, except where the list says
``compiled``; hypothesis draws three examples (`uncompiled.py`). Tests are first run without a
fault: they must pass.
"""

import argparse
import itertools
import multiprocessing
import os
import queue
import random
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parent))
from mutation_list import MUTATIONS, Mutation

CHECKOUT = Path(__file__).resolve().parents[2]
# Importing what the package stands on takes longer than most tests here: it is done once.
FORKS = multiprocessing.get_context("forkserver")
STOOD_ON = ["numpy", "numba", "pinocchio", "hypothesis", "pytest", "scipy.linalg", "scipy.optimize"]
LONGEST = 600.0  # seconds; a fault may keep an iteration from ending
ALL_TESTS = ("-m", "")  # the nightly ones too
KILLED, SURVIVED, BROKEN = "killed", "SURVIVED", "NO RESULT"


class Outcome(NamedTuple):
    """What became of a mutation: by which test, and how long it took."""

    mutation: Mutation
    verdict: str
    by: str
    seconds: float


def texts_of(package: Path) -> dict[Path, str]:
    """What the files of the package say."""
    return {p.relative_to(package): p.read_text("utf-8") for p in sorted(package.rglob("*.py"))}


def place_of(texts: dict[Path, str], mutation: Mutation) -> tuple[Path, int]:
    """File and position of the text to be changed: the first one behind the place named."""
    found = [path for path, text in texts.items() if mutation.after in text]
    if len(found) != 1 or texts[found[0]].count(mutation.after) != 1:
        where = ", ".join(map(str, found)) or "no file"
        raise LookupError(f"{mutation.after!r} is to be there once, found in: {where}")
    text = texts[found[0]]
    at = text.find(mutation.old, text.index(mutation.after))
    if at < 0:
        raise LookupError(f"{mutation.old!r} does not follow {mutation.after!r} in {found[0]}")
    return found[0], at


def run(folder: Path, mutation: Mutation) -> tuple[int, str]:
    """Exit code of pytest and the first test that failed."""
    paths, _, words = mutation.tests.partition(" -k ")
    arguments = [
        "-x", "-q", "--no-header", "--tb=no", "-rfE", "-p", "no:cacheprovider",
        "-W", "ignore::pytest.PytestAssertRewriteWarning",
        *paths.split(), *(["-k", words] if words else []),
    ]  # fmt: skip
    report = folder / "report.txt"
    report.write_text("")
    if mutation.compiled:
        code = in_own_process(folder, arguments, report)
    else:
        plain = ["-p", "uncompiled", "-W", "ignore::RuntimeWarning"]  # zero may divide in kernels
        code = in_fork(folder, [*plain, *arguments], report)
    if code is None:
        return 1, f"no end within {LONGEST:.0f} s"
    text = report.read_text(encoding="utf-8", errors="replace")
    failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - |$)", text, flags=re.MULTILINE)
    return code, failed[1] if failed else (text.strip().splitlines() or ["no output"])[-1]


def in_own_process(folder: Path, arguments: list[str], report: Path) -> int | None:
    """Run pytest with the compiler, whose cache is the folder's own."""
    environment = os.environ | {
        "PYTHONPATH": str(folder),
        "NUMBA_CACHE_DIR": str(folder / "compiled"),
        "NUMBA_DISABLE_JIT": "0",
    }
    command = [sys.executable, "-m", "pytest", *ALL_TESTS, *arguments]
    with report.open("w") as out:
        try:
            done = subprocess.run(
                command, cwd=folder, env=environment, stdout=out, stderr=out, timeout=LONGEST
            )
        except subprocess.TimeoutExpired:
            return None
    return done.returncode


def in_fork(folder: Path, arguments: list[str], report: Path) -> int | None:
    """Run pytest in a fork of a process that has imported all but this package."""
    child = FORKS.Process(target=run_pytest, args=(str(folder), arguments, str(report)))
    child.start()
    child.join(LONGEST)
    if child.is_alive():
        child.kill()
        child.join()
        return None
    return child.exitcode


def run_pytest(folder: str, arguments: list[str], report: str) -> None:
    """In the fork: the package is that of the folder."""
    out = os.open(report, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(out, 1)
    os.dup2(out, 2)
    os.chdir(folder)
    sys.path[:0] = [folder, str(Path(__file__).parent)]
    import pytest

    import robotmodels

    if not robotmodels.__file__.startswith(folder):
        os._exit(99)
    code = pytest.main([*ALL_TESTS, *arguments])
    sys.stdout.flush()
    os._exit(int(code))


def copied(folder: Path) -> None:
    """The package, the tests and their settings."""
    leave = shutil.ignore_patterns("__pycache__")
    for name in ("robotmodels", "tests", "urdf"):
        shutil.copytree(CHECKOUT / name, folder / name, ignore=leave)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(CHECKOUT / name, folder / name)


class Trial:
    """The faults, tried one in each folder at a time; the tests without a fault come first."""

    def __init__(self, folders: list[Path], chosen: list[Mutation]) -> None:
        self.texts = texts_of(folders[0] / "robotmodels")
        self.chosen = chosen
        self.jobs = len(folders)
        self.free: queue.SimpleQueue[Path] = queue.SimpleQueue()
        for folder in folders:
            self.free.put(folder)
        self.waiting = {(m.tests, m.compiled): threading.Lock() for m in chosen}
        self.sound: dict[tuple[str, bool], str] = {}
        # byte code is taken again where the second and the size are the same
        self.stamps = itertools.count(int(time.time()), 2)

    def outcomes(self) -> list[Outcome]:
        """What became of the faults, in the order of the list."""
        # tests that no other fault is waiting for come first, so that jobs do not wait either
        seen: Counter[tuple[str, bool]] = Counter()
        turns = []
        for place, mutation in enumerate(self.chosen):
            turns.append((seen[mutation.tests, mutation.compiled], place))
            seen[mutation.tests, mutation.compiled] += 1
        order = [place for _, place in sorted(turns)]
        with ThreadPoolExecutor(self.jobs) as pool:
            found = dict(zip(order, pool.map(self.one, order), strict=True))
        return [found[place] for place in range(len(order))]

    def one(self, place: int) -> Outcome:
        """Try one fault in a folder that is free."""
        mutation = self.chosen[place]
        folder = self.free.get()
        start = time.monotonic()
        try:
            wrong = self.without_fault(folder, mutation)
            verdict, by = (BROKEN, wrong) if wrong else self.with_fault(folder, mutation)
        finally:
            self.free.put(folder)
        taken = time.monotonic() - start
        print(f"{verdict:9} {taken:5.0f} s  {mutation.room}: {mutation.fault}  [{by}]", flush=True)
        return Outcome(mutation, verdict, by, taken)

    def without_fault(self, folder: Path, mutation: Mutation) -> str:
        """Why the tests of a fault say nothing; empty if they pass without it."""
        key = mutation.tests, mutation.compiled
        with self.waiting[key]:
            if key not in self.sound:
                code, first = run(folder, mutation)
                self.sound[key] = "" if code == 0 else f"fails without a fault: {first}"
        return self.sound[key]

    def with_fault(self, folder: Path, mutation: Mutation) -> tuple[str, str]:
        """Put the fault in, run its tests, take it out."""
        name, at = place_of(self.texts, mutation)
        path, text = folder / "robotmodels" / name, self.texts[name]
        code, by = 0, ""
        for content in (text[:at] + mutation.new + text[at + len(mutation.old) :], text):
            path.write_text(content, encoding="utf-8")
            stamp = next(self.stamps)
            os.utime(path, (stamp, stamp))
            if content is not text:
                code, by = run(folder, mutation)
        return {0: SURVIVED, 1: KILLED}.get(code, BROKEN), by


def table_of(path: Path) -> dict[tuple[str, str], tuple[str, str]]:
    """What earlier runs wrote: by room and fault, the outcome and the test."""
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    cells = [re.split(r"(?<!\\) \| ", line[2:-2]) for line in lines if line.startswith("| ")]
    return {(room, fault): (verdict, by) for room, fault, verdict, by in cells[1:]}


def page(outcomes: list[Outcome], earlier: dict[tuple[str, str], tuple[str, str]]) -> str:
    """All faults of the list as a table: these outcomes, those of earlier runs for the others."""
    rows = {(m.room, m.fault): ("not tried", "none") for m in MUTATIONS}
    rows |= {key: row for key, row in earlier.items() if key in rows}
    for o in outcomes:
        by = f"`{o.by.removeprefix('tests/')}`" if o.verdict == KILLED else "none"
        rows[o.mutation.room, o.mutation.fault] = o.verdict, by.replace("|", "\\|")
    rooms = Counter(room.split(":")[0] for room, _ in rows)
    killed = sum(verdict == KILLED for verdict, _ in rows.values())
    counts = ", ".join(f"{room} {count}" for room, count in sorted(rooms.items()))
    lines = [
        "# Faults that were tried",
        "",
        "One sign, index, factor or term of the numeric core is changed at a time; a test must",
        "fail. Each run of `python tests/nightly/mutations.py` writes the rows of the faults it",
        "tried; the changes, text by text, stand in the lists beside that file.",
        "",
        f"{len(rows)} faults, {killed} found.",
        "",
        *textwrap.wrap(f"By room: {counts}.", 100),
        "",
        "| room | fault | outcome | first test that fails |",
        "|---|---|---|---|",
        *(f"| {room} | {fault} | {verdict} | {by} |"
          for (room, fault), (verdict, by) in rows.items()),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def main() -> int:
    """Read the arguments, try the chosen mutations, tell; 1 if any was not found."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--sample", type=int, metavar="N", help="only N, chosen at random")
    parser.add_argument("--seed", type=int, help="of the choice; default: another one each time")
    parser.add_argument("--only", metavar="WORD", help="only those with this word")
    jobs = os.cpu_count() or 1
    parser.add_argument("--jobs", type=int, default=jobs, metavar="N", help=f"default: {jobs}")
    parser.add_argument("--places", action="store_true", help="only look for the texts")
    table = CHECKOUT / "tests" / "mutations.md"
    parser.add_argument("--write", type=Path, default=table, metavar="FILE", help="the table")
    given = parser.parse_args()
    word = given.only or ""
    chosen = [m for m in MUTATIONS if word in f"{m.room} {m.fault} {m.tests}"]
    texts = texts_of(CHECKOUT / "robotmodels")
    lost = []
    for mutation in chosen:
        try:
            place_of(texts, mutation)
        except LookupError as error:
            lost.append(f"{mutation.room}, {mutation.fault}: {error}")
    if lost:
        print("\n".join(lost), "repair tests/nightly/mutation_list.py", sep="\n")
        return 1
    if given.places:
        print(f"{len(chosen)} texts are found")
        return 0
    if given.sample is not None:
        seed = random.randrange(10**6) if given.seed is None else given.seed
        print(f"--seed {seed}")
        chosen = random.Random(seed).sample(chosen, min(given.sample, len(chosen)))
    os.environ |= {
        "LONGEST": "300",
        "NUMBA_DISABLE_JIT": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "MPLBACKEND": "Agg",
    }
    FORKS.set_forkserver_preload(STOOD_ON)
    with tempfile.TemporaryDirectory() as temporary:
        folders = [Path(temporary, str(job)) for job in range(max(1, given.jobs))]
        for folder in folders:
            copied(folder)
        outcomes = Trial(folders, chosen).outcomes()
    given.write.write_text(page(outcomes, table_of(given.write)), encoding="utf-8")
    bad = [o for o in outcomes if o.verdict != KILLED]
    print(f"{len(outcomes) - len(bad)} of {len(outcomes)} faults were found")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
