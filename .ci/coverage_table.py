"""Write tests/coverage.md from what coverage.py has counted: room by room, and what is least seen.

    python .ci/coverage_table.py report.json tests/coverage.md

`.ci/coverage` calls it.
"""

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

LEAST_SEEN = 12
COUNTS = ("num_statements", "missing_lines", "num_branches", "missing_branches")


def share(counts: Counter[str]) -> float:
    """Percent of the statements and branches that ran."""
    whole = counts["num_statements"] + counts["num_branches"]
    missed = counts["missing_lines"] + counts["missing_branches"]
    return 100.0 * (1.0 - missed / whole) if whole else 100.0


def row(name: str, counts: Counter[str]) -> str:
    """A line of a table."""
    return f"| {name} | {' | '.join(str(counts[key]) for key in COUNTS)} | {share(counts):.1f} |"


def main(report: str, target: str) -> None:
    """Read the report and write the tables."""
    data = json.loads(Path(report).read_text("utf-8"))
    files = {
        Path(name): Counter({key: each["summary"][key] for key in COUNTS})
        for name, each in data["files"].items()
    }
    rooms: dict[str, Counter[str]] = {}
    for path, counts in files.items():
        room = path.parts[1] if len(path.parts) > 2 else "files beside the rooms"
        rooms.setdefault(room, Counter()).update(counts)
    total = sum(files.values(), Counter())
    worst = sorted(files, key=lambda path: share(files[path]))[:LEAST_SEEN]
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    head = ["| | statements | not run | branches | not taken | % |", "|---|---|---|---|---|---|"]
    lines = [
        "# Coverage",
        "",
        "Statements and branches of the package that its tests run, kernels as plain Python in a",
        f"second leg. Written by `bash .ci/coverage`: coverage.py {data['meta']['version']}, "
        f"{data['meta']['timestamp'][:10]}, commit {commit}.",
        "",
        *head,
        *(row(name, rooms[name]) for name in sorted(rooms)),
        row("**all**", total),
        "",
        f"The {LEAST_SEEN} files of which least is seen:",
        "",
        *head,
        *(row(f"`{path.as_posix()}`", files[path]) for path in worst),
        "",
    ]
    Path(target).write_text("\n".join(lines), "utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
