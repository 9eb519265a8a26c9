"""Everything that the project compares itself by, beside its peers, in one run.

    python -m benchmarks [--out FOLDER] [--quick] [--only WORK ...] [--busy]
        [--figaroh-python PATH] [--pybotics-python PATH] [--rounds 15] [--budget 8]

From a checkout. Peers of this interpreter: ``pip install '.[peers]'``; FIGAROH and pybotics need
environments of their own. Absent peers are named and left out. One thread. A machine on which
other work runs is refused, with its load, unless ``--busy`` or ``--quick`` is given.
"""

import argparse
import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from benchmarks import one_thread  # noqa: F401, before NumPy

ROOMS = (
    "models", "igm", "identification", "calibration", "trajectories", "performance", "export",
    "loops", "parallel", "control", "visual_servoing", "flexible",
)  # fmt: skip


def main() -> None:
    """Read the command line, measure, print and keep."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--out", type=Path, help="folder to keep peers.json and peers.md in")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--budget", type=float, default=8.0, help="seconds for a line, about")
    parser.add_argument("--figaroh-python", default="", metavar="PATH")
    parser.add_argument("--pybotics-python", default="", metavar="PATH")
    parser.add_argument("--only", nargs="+", default=[], metavar="WORK", help="rooms or works")
    parser.add_argument("--quick", action="store_true", help="smaller batches, three rounds")
    parser.add_argument("--busy", action="store_true", help="measure beside other work")
    given = parser.parse_args()

    from benchmarks import works
    from benchmarks.machine import load, machine, too_busy
    from benchmarks.peers.process import Foreign

    chosen = {(room, name): make for room in ROOMS for name, make in works.works_of(room).items()}
    known = {*ROOMS, *(name for _, name in chosen)}
    if unknown := sorted(set(given.only) - known):
        parser.error(f"--only: {unknown} not among {', '.join(sorted(known))}")
    if given.only:
        chosen = {k: make for k, make in chosen.items() if set(k) & set(given.only)}
    settings = works.Settings(given.rounds, given.budget)
    if given.quick:
        settings = works.Settings(rounds=3, budget=1.0, quick=True)
    warning = too_busy()
    if warning and not (given.busy or given.quick):
        sys.exit(f"not measured: {warning}; --busy measures all the same")
    absent = [package for package in works.PACKAGES if works.module(package) is None]
    pythons = {"figaroh": given.figaroh_python, "pybotics": given.pybotics_python}
    with ExitStack() as stack:
        for word, python in pythons.items():
            why: str | None = f"--{word}-python names no Python"
            if python:
                peer = stack.enter_context(Foreign(word, python, f"{word}.py"))
                why = peer.start()
                if why is None:
                    settings = replace(settings, **{word: peer})
            if why is not None:
                absent.append(f"{word} ({why})")
        facts = machine(list(works.PACKAGES), pythons)
        facts["run"] = "quick: smaller batches, three rounds" if given.quick else "full"
        if warning:
            facts["warning"] = warning
        rows = []
        for make in chosen.values():
            for work in make(settings):
                rows.append(work.measured(settings))
                print(" | ".join(works.cells(rows[-1])), flush=True)
        facts["load at the end"] = load()
    text = works.markdown(facts, rows, absent)
    print(f"\n{text}")
    if given.out is not None:
        works.keep(given.out, "peers", text, {"machine": facts, "absent": absent, "rows": rows})


if __name__ == "__main__":
    main()
