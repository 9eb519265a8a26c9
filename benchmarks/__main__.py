"""Everything that the project compares itself by, side by side with its peers, in one run.

    python -m benchmarks [--figaroh-python PATH] [--pybotics-python PATH] [--out FOLDER]
        [--quick] [--only ROW ...] [--rounds 15] [--budget 15] [--slow]

From a checkout. Peers of this interpreter: ``pip install '.[peers]'``. FIGAROH and pybotics live in
environments of their own, by the Python that the options name. What is absent is named and left
out. Everything runs on one thread.
"""

import argparse
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from benchmarks import one_thread  # noqa: F401, before NumPy
from benchmarks.foreign import Foreign
from benchmarks.kept import keep
from benchmarks.machine import load, machine
from benchmarks.side_by_side import calibration, models, motion, parameters, postures, report
from benchmarks.side_by_side.works import PACKAGES, Settings, Tool, measured, module

WORKS = {
    **models.WORKS, **parameters.WORKS, **postures.WORKS, **calibration.WORKS, **motion.WORKS,
}  # fmt: skip
FOREIGN = {Tool.FIGAROH: "figaroh_turns.py", Tool.PYBOTICS: "pybotics_turns.py"}


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--out", type=Path, help="folder to keep peers.json and peers.md in")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--budget", type=float, default=15.0, help="seconds for a line, about")
    parser.add_argument("--figaroh-python", default="", metavar="PATH")
    parser.add_argument("--pybotics-python", default="", metavar="PATH")
    parser.add_argument("--only", nargs="+", choices=WORKS, default=list(WORKS), metavar="ROW",
                        help=", ".join(WORKS))  # fmt: skip
    parser.add_argument("--quick", action="store_true", help="smaller batches, three rounds")
    parser.add_argument("--slow", action="store_true", help="ssik's preparation of a new robot")
    given = parser.parse_args()
    absent = [f"{t.value} ({name})" for t, (name, _) in PACKAGES.items() if module(t) is None]
    settings = Settings(given.rounds, given.budget, slow=given.slow)
    if given.quick:
        settings = replace(settings, rounds=3, budget=1.0, quick=True)
    interpreters = {"figaroh": given.figaroh_python, "pybotics": given.pybotics_python}
    with ExitStack() as stack:
        for tool, script in FOREIGN.items():
            python = interpreters[tool.value.lower()]
            why = f"--{tool.value.lower()}-python names no Python"
            if python:
                peer = stack.enter_context(Foreign(tool.value, python, script))
                why = peer.start()
                if why is None:
                    settings = replace(settings, **{tool.value.lower(): peer})
            if why is not None:
                absent.append(f"{tool.value} ({why})")
        for line in absent:
            print(f"left out: {line}")
        facts = machine([name for name, _ in PACKAGES.values()], interpreters)
        if given.quick:
            facts["run"] = "quick: smaller batches, three rounds"
        rows = []
        for name, works in WORKS.items():
            if name not in given.only:
                continue
            for done in measured(works(settings), settings):
                rows.append(done.as_json())
                ways = "; ".join(
                    f"{e['tool']} {report.cell(e)}" for e in rows[-1]["entries"]
                )  # fmt: skip
                print(f"{rows[-1]['work']} [{rows[-1]['unit']}]: {ways}", flush=True)
        facts["load at the end"] = load()
    print()
    text = report.markdown(facts, rows, absent)
    print(text)
    if given.out is not None:
        keep(given.out, "peers", text, {"machine": facts, "absent": absent, "rows": rows})


if __name__ == "__main__":
    main()
