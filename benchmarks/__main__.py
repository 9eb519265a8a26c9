"""Everything that the project compares itself by, side by side with its peers, in one run.

    python -m benchmarks [--figaroh-python PATH] [--pybotics-python PATH] [--out FOLDER]
        [--quick] [--only ROW ...] [--rounds 15] [--budget 8] [--slow]

From a checkout. Peers of this interpreter: ``pip install '.[peers]'``. FIGAROH and pybotics live in
environments of their own, by the Python that the options name. What is absent is named and left
out. Everything runs on one thread. Without ``--quick`` it takes some minutes of a machine at rest:
calibration on 100 and 500 poses, base parameters and least squares of 1e5 samples (3 GB for
FIGAROH) and the memory of ours for 1e6 are in it. ``--slow`` takes some four minutes more.
"""

import argparse
from pathlib import Path

from benchmarks import one_thread  # noqa: F401, before NumPy

ROWS = {
    "models": ("pose", "jacobian", "single", "inverse_dynamics", "regressor"),
    "parameters": ("base_parameters", "least_squares"),
    "postures": ("postures", "postures_batch", "general_6r", "numeric"),
    "calibration": ("calibration",),
    "motion": ("jerk_limited",),
}
"""Words for ``--only``, by the file of `side_by_side` that has them."""


def main() -> None:
    """Read the command line, measure."""
    rows = [row for names in ROWS.values() for row in names]
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--out", type=Path, help="folder to keep peers.json and peers.md in")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--budget", type=float, default=8.0, help="seconds for a line, about")
    parser.add_argument("--figaroh-python", default="", metavar="PATH")
    parser.add_argument("--pybotics-python", default="", metavar="PATH")
    parser.add_argument("--only", nargs="+", choices=rows, default=rows, metavar="ROW",
                        help=", ".join(rows))  # fmt: skip
    parser.add_argument("--quick", action="store_true", help="smaller batches, three rounds")
    parser.add_argument("--slow", action="store_true", help="ssik's preparation of a new arm too")
    given = parser.parse_args()

    # A word that is wrong is told before the imports, which take seconds.
    from benchmarks.side_by_side.run import run
    from benchmarks.side_by_side.works import Settings

    settings = Settings(given.rounds, given.budget, slow=given.slow)
    if given.quick:
        settings = Settings(rounds=3, budget=1.0, slow=given.slow, quick=True)
    wanted = [(part, row) for part, names in ROWS.items() for row in names if row in given.only]
    run(wanted, settings, given.figaroh_python, given.pybotics_python, given.out)


if __name__ == "__main__":
    main()
