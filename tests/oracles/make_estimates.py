"""Freeze the estimates of today, or compare what is computed now with what is frozen.

    OPENBLAS_NUM_THREADS=1 python tests/oracles/make_estimates.py [PART ...] [--check] [--quick]

Without ``--check`` the files `frozen_<part>.json` are written anew; with it nothing is written, the
largest difference of every case is printed, as a part of its bound, and the exit status is 1 where
one is beyond. The part "study" takes some ten minutes, the others two together; ``--quick``
compares only the cases of `test_frozen_estimates.py`.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1]))

import frozen_estimates as fe


def write(part: str, cases: dict) -> None:
    """A file with a line for each case."""
    source = f"robotmodels itself: python tests/oracles/make_estimates.py {part}"
    lines = [f"{json.dumps(name)}: {json.dumps(case)}" for name, case in cases.items()]
    text = f'{{"source": {json.dumps(source)}, "cases": {{\n' + ",\n".join(lines) + "\n}}\n"
    (fe.FOLDER / f"frozen_{part}.json").write_text(text, encoding="utf-8")


def main() -> None:
    """Compute the cases of the parts, one after another."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(fe.CASES)}; default all")
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    parser.add_argument("--quick", action="store_true", help="with --check: the cases of the tests")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(fe.CASES):
        parser.error(f"parts: expected some of {', '.join(fe.CASES)}, got {' '.join(unknown)}.")
    if options.quick and not options.check:
        parser.error("--quick: a file holds all cases; use it with --check.")
    beyond = 0
    for part in options.parts or fe.CASES:
        cases = {}
        for name in (fe.QUICK if options.quick else fe.CASES)[part]:
            cases[name] = fe.plain(fe.COMPUTED[part](name))
            if not options.check:
                print(part, name, flush=True)
                continue
            found = fe.differences(name, cases[name], fe.frozen(part, name))
            worst = max(found, key=found.__getitem__)
            print(f"{part} {name}: {found[worst]:.2g} of its bound, {worst}", flush=True)
            beyond += found[worst] > 1.0
        if not options.check:
            write(part, cases)
        if part == "study" and not options.quick:
            print("now   ", fe.summary(cases))
            print("frozen", fe.summary(fe.read("frozen_study")["cases"]))
    print(f"{beyond} cases beyond their bounds" if options.check else "written")
    raise SystemExit(1 if beyond else 0)


if __name__ == "__main__":
    main()
