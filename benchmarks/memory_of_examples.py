"""Memory and time of every example: the README's, the command line's demos, the notebooks.

Each runs in a process of its own, twice: the first time kernels may be compiled and files are read
for the first time, the second is counted. What the README's examples have in common is counted
with each: example 6 goes on with the arm of example 2. Memory is the resident set of the largest
process of an example at its peak, `ru_maxrss`; a notebook's is that of its kernel.

Run from a checkout: ``python -m benchmarks.memory_of_examples``.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine

CHECKOUT = Path(__file__).resolve().parent.parent
README = CHECKOUT / "README.md"
UNIT = 1024.0 if sys.platform.startswith("linux") else 1024.0**2  # ru_maxrss: kB, elsewhere bytes

# A process begins with the peak of the one that started it: a small one starts the examples.
LAUNCH = """
import os, sys, time
start = time.perf_counter()
child = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ, file_actions=[
    (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)
])
_, status, usage = os.wait4(child, 0)
print(usage.ru_maxrss, usage.ru_utime + usage.ru_stime, time.perf_counter() - start)
sys.exit(os.waitstatus_to_exitcode(status))
"""
RUN_BLOCKS = """
import doctest, sys
blocks = open(sys.argv[1], encoding="utf-8").read().split("\\0")
names, runner = {}, doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
for block in blocks:
    test = doctest.DocTestParser().get_doctest(block, names, "example", None, 0)
    runner.run(test, clear_globs=False)
    names = test.globs
sys.exit(runner.summarize(verbose=False).failed > 0)
"""
RUN_NOTEBOOK = """
import sys
import nbformat
from nbclient import NotebookClient
notebook = nbformat.read(sys.argv[1], as_version=4)
NotebookClient(notebook, timeout=1200, kernel_name="python3").execute()
"""


@dataclass(frozen=True)
class Example:
    """What is run, by which arguments of the interpreter."""

    name: str
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class Spent:
    """What an example took."""

    name: str
    peak_mb: float
    processor_s: float
    clock_s: float


def main() -> None:
    """Measure what is asked for, print the table and keep it."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--only", default="", metavar="WORD", help="those with this word")
    arguments = parser.parse_args()
    about = machine(("matplotlib", "sympy", "meshcat", "ipykernel"))
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for example in examples(Path(folder)):
            if arguments.only not in example.name:
                continue
            spent(example, Path(folder))
            rows.append(spent(example, Path(folder)))
            row = rows[-1]
            print(f"{row.name}: {row.peak_mb:.0f} MB, {row.processor_s:.1f} s", flush=True)
    numbers = {"machine": about, "rows": [asdict(row) for row in rows]}
    keep(arguments.out, "memory", report(rows, about), numbers)


def examples(folder: Path) -> Iterator[Example]:
    """Yield all that is run; scripts and blocks are written into the folder."""
    yield Example("an interpreter alone", ("-c", "pass"))
    yield Example("import numpy, pinocchio", ("-c", "import numpy, pinocchio"))
    yield Example("import robotmodels", ("-c", "import robotmodels"))
    (folder / "blocks.py").write_text(RUN_BLOCKS)
    (folder / "notebook.py").write_text(RUN_NOTEBOOK)
    text = README.read_text(encoding="utf-8")
    section = text.partition("## Six examples")[2]
    found = re.findall(r"^([^\n]+):\n\n```pycon\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)
    for number, (title, block) in enumerate(found, start=1):
        blocks = [b for _, b in found[: number - 1] if needed(b, block)]
        path = folder / f"example_{number}.txt"
        path.write_text("\0".join([*blocks, block]), encoding="utf-8")
        yield Example(f"README {number}: {title}", (str(folder / "blocks.py"), str(path)))
    for words in ("demo", "demo --real", "robots", "info rx90"):
        yield Example(f"robotmodels {words}", ("-m", "robotmodels", *words.split()))
    for path in sorted((CHECKOUT / "notebooks").glob("*.ipynb")):
        yield Example(f"notebook {path.stem}", (str(folder / "notebook.py"), str(path)))


def needed(before: str, block: str) -> bool:
    """Whether a block gives a name that another uses: an import, or an assignment."""
    lines = [line[4:] for line in before.splitlines() if line.startswith((">>> ", "... "))]
    given = re.findall(r"^(?:import .* as |from .* import |import )(\w+)$", "\n".join(lines), re.M)
    given += re.findall(r"^(\w+) = ", "\n".join(lines), re.MULTILINE)
    own = re.findall(r"^>>> (\w+) = ", block, re.MULTILINE)
    return any(re.search(rf"\b{name}\b", block) for name in given if name not in own)


def spent(example: Example, folder: Path) -> Spent:
    """Run one example; its peak, processor time and time."""
    with tempfile.TemporaryDirectory(dir=folder) as work:
        environment = os.environ | {
            "PYTHONPATH": str(CHECKOUT),
            "MPLBACKEND": "Agg",
            "PYTHONWARNINGS": "ignore",
        }
        done = subprocess.run(
            [sys.executable, "-I", "-S", "-c", LAUNCH, sys.executable, *example.arguments],
            cwd=work,
            env=environment,
            capture_output=True,
            text=True,
        )
    if done.returncode:
        sys.exit(f"{example.name} failed:\n{done.stderr}")
    peak, processor, clock = map(float, done.stdout.split())
    return Spent(example.name, peak / UNIT, processor, clock)


def report(rows: list[Spent], about: dict[str, str]) -> str:
    """The table."""
    lines = head("Memory of the examples", about)
    lines += [
        "Peak resident memory of the largest process of each example, kernels compiled before; the",
        "processor's seconds are those of all its processes.",
        "",
        "| example | peak, MB | processor, s |",
        "|---|---:|---:|",
    ]
    lines += [f"| {row.name} | {row.peak_mb:.0f} | {row.processor_s:.1f} |" for row in rows]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
