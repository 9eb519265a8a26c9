"""Write the catalogue's URDF files: ``python -m robotmodels.robots.generate [folder]``."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

from ..errors import UrdfWarning
from ..model import write_urdf
from .catalogue import CATALOGUE, load


def generate(folder: str | Path) -> list[Path]:
    """Write one URDF file for each robot of the catalogue."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    with warnings.catch_warnings():
        # what a URDF cannot hold (rotor inertia, transmissions) is known here: `load` has it
        warnings.simplefilter("ignore", UrdfWarning)
        for name in CATALOGUE:
            path = folder / f"{name}.urdf"
            write_urdf(load(name), path)
            paths.append(path)
    return paths


if __name__ == "__main__":
    generate(*sys.argv[1:2] or ["urdf"])
