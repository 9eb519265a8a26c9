"""Check that a wheel is small and holds the package, its type marker and URDF files, no more."""

import subprocess
import sys
import zipfile
from pathlib import Path

LARGEST = 3_000_000
"""Bytes of a wheel."""


def main(wheel: Path, checkout: Path) -> None:
    """Compare the wheel's files with those that git knows in the checkout."""
    listing = subprocess.run(
        ["git", "-C", str(checkout), "ls-files", "robotmodels", "urdf"],
        check=True,
        capture_output=True,
        text=True,
    )
    expected = set()
    urdfs = 0
    for name in listing.stdout.splitlines():
        if name.startswith("robotmodels/"):
            expected.add(name)
        elif name.endswith(".urdf"):
            expected.add("robotmodels/_" + name)
            urdfs += 1
    if not urdfs:
        sys.exit("the checkout has no urdf/*.urdf")
    present = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    if missing := sorted(expected - present):
        sys.exit(f"missing from {wheel.name}: {', '.join(missing)}")
    if extra := sorted(present - expected):
        sys.exit(f"{wheel.name} holds files that are not in the checkout: {', '.join(extra)}")
    size = wheel.stat().st_size
    if size > LARGEST:
        sys.exit(f"{wheel.name} has {size} bytes; at most {LARGEST} are wanted")
    print(f"{wheel.name}: {size / 1e6:.2f} MB, {len(present)} files, {urdfs} of them URDF")


main(Path(sys.argv[1]), Path(sys.argv[2]))
