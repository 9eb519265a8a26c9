"""Coverage-guided fuzzing of everything that reads a file.

    python tests/nightly/fuzz.py TARGET --runs N [--seed K] [--corpus FOLDER]

Needs atheris (Apache-2.0, pip install atheris), which is no dependency of the package, in the
environment of the package. TARGET is one of those of tests/robustness/inputs.py, or all. Inputs are
made from good files by tests/robustness/mutations.py, and damaged further when they reach lines
that no other reached. A crash, a hang, a warning of NumPy or an answer that is not finite ends the
run with the input in the folder of the corpus; otherwise counts are printed.
"""

import argparse
import collections
import os
import random
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

# compiled kernels are left as they are: Numba compiles the byte code that atheris would change
READERS = [
    "robotmodels.urdf", "robotmodels.symoro", "robotmodels.logs", "robotmodels.csv_table",
    "robotmodels.calibration.read", "robotmodels.geometry", "robotmodels.khalil_frames",
]  # fmt: skip


def main() -> None:
    """Read the arguments and fuzz one target or, each in a process of its own, all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("target", help="one of those of tests/robustness/inputs.py, or all")
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--corpus", type=Path)
    arguments = parser.parse_args()

    import atheris

    with atheris.instrument_imports(include=READERS):
        from robustness import inputs

    corpus = arguments.corpus or Path(tempfile.mkdtemp(prefix="fuzz_"))
    if arguments.target != "all":
        fuzz(inputs.TARGETS[arguments.target], arguments.target, arguments, corpus)
        return
    failed = []
    for name, target in inputs.TARGETS.items():  # imported and instrumented once
        child = os.fork()
        if not child:
            fuzz(target, name, arguments, corpus / name)
            os._exit(1)
        if os.waitpid(child, 0)[1]:
            failed.append(name)
    sys.exit(f"found in: {', '.join(failed)}" if failed else 0)


def fuzz(target: Any, name: str, arguments: argparse.Namespace, corpus: Path) -> None:
    """Fuzz one target; the process ends with the last run."""
    import atheris
    from robustness import mutations

    seen: collections.Counter[str] = collections.Counter()
    start, slowest = time.process_time(), 0.0

    def mutated(data: bytes, size: int, seed: int) -> bytes:
        chance = random.Random(seed)
        # half of the inputs are damaged anew, half are those that were kept, damaged further
        if not data.strip() or chance.random() < 0.5:
            return target.damaged(chance)[:size]
        try:
            return _further(mutations, name, chance, data)[:size]
        except (ValueError, SyntaxError, IndexError):  # it is no tree of XML any more, say
            return mutations.bytes_of(chance, data)[:size]

    corpus.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:

        def once(data: bytes) -> None:
            nonlocal slowest
            before = time.process_time()
            # the options of the call are chosen by the input alone, so that it can be run again
            seen[target.judged(data, Path(folder), random.Random(data)).name] += 1
            slowest = max(slowest, time.process_time() - before)
            if sum(seen.values()) == arguments.runs:
                counts = ", ".join(f"{count} {kind.lower()}" for kind, count in seen.items())
                print(
                    f"{name}: {arguments.runs} inputs ({counts}), {time.process_time() - start:.0f}"
                    f" s of processor time, the slowest {slowest:.2f} s",
                    flush=True,
                )
                shutil.rmtree(folder)
                os._exit(0)

        for k in range(40):
            (corpus / f"seed_{k}").write_bytes(target.damaged(random.Random(k)))
        atheris.Setup(
            [sys.argv[0], str(corpus), f"-seed={arguments.seed}", "-timeout=10", "-verbosity=0",
             "-rss_limit_mb=4096", "-max_len=60000", f"-artifact_prefix={corpus}/found_"],
            once, custom_mutator=mutated, enable_python_coverage=True,
        )  # fmt: skip
        atheris.Fuzz()


def _further(mutations: Any, target: str, chance: random.Random, data: bytes) -> bytes:
    text = data.decode("utf-8", "replace")
    if target == "urdf":
        return mutations.urdf(chance, text).encode()
    if target == "par":
        return mutations.par(chance, text).encode("utf-8", "replace")
    if target in ("log_csv", "measurements"):
        return mutations.table(chance, text)
    return mutations.bytes_of(chance, data)


if __name__ == "__main__":
    main()
