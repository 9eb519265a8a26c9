"""``robotmodels view``: open a robot with joint sliders in the browser."""

from __future__ import annotations

import argparse
import os
import re
import sys
import tempfile
import webbrowser
from pathlib import Path

import numpy as np

from .arguments import posture, robot_of
from .output import Report

EXAMPLES = """\
examples:
  robotmodels view rx90
  robotmodels view erd:panda --q default
  robotmodels view erd:ur5 --q 0 -90 90 0 90 0 --degrees --out ur5.html
  robotmodels view arm.urdf --package-dir packages --no-open

The page needs neither a network nor this program any more."""
DESCRIPTION = """\
Draw a robot with a slider for each joint and the pose of its tool, write it as one HTML file and
open it in the browser."""
OPTIONS = """\
@robot
--q NUMBERS [] where the robot is at first: joint variables in rad and m, or the name of a
    configuration; default zero
--degrees [flag] revolute joints of --q in degrees
--skeleton [flag] rods and cylinders sized from the table instead of the URDF's shapes
--frames [flag] the axes and the names of all frames
--out FILE [path] page to write; default a new file in the folder for temporary files
--no-open [flag] only write the page
@json"""


def run(arguments: argparse.Namespace) -> Report:
    """Run the command: draw, save and open."""
    from ..viz import jog
    from ..viz.meshes import with_stand_ins

    model = robot_of(arguments)
    q = None if arguments.q is None else posture(arguments.q, model, "--q", arguments.degrees)
    model, missing = (model, ()) if arguments.skeleton else with_stand_ins(model)
    scene = jog(
        model, q, meshes=not arguments.skeleton, frames=arguments.frames, names=arguments.frames
    )
    path = scene.save(arguments.out or _temporary(model.name)).absolute()
    opened = not arguments.no_open and _open(path)
    start = scene.sliders.q if scene.sliders is not None else model.configurations["zero"]
    data = {
        "robot": model.name, "joints": model.table.joint_names, "q": start,
        "page": str(path), "opened": opened, "missing_meshes": missing,
    }  # fmt: skip
    text = np.array2string(start, precision=4, suppress_small=True, max_line_width=10_000)
    lines = [f"Scene of {model.name} at q = {text} written to {path}"]
    if missing:
        lines.append(f"Mesh files not found, a skeleton is drawn for them: {', '.join(missing)}. "
                     "Give their folder with --package-dir.")  # fmt: skip
    if not opened and not arguments.no_open:
        lines.append("There is no display or no browser here: open the page in one yourself.")
    return Report("\n".join(lines), data)


def _temporary(name: str) -> Path:
    """A new empty file."""
    stem = "robotmodels_" + re.sub(r"[^\w.-]", "_", name) + "_"
    with tempfile.NamedTemporaryFile(prefix=stem, suffix=".html", delete=False) as file:
        return Path(file.name)


def _open(path: Path) -> bool:
    """Open a page in a browser with windows, if there is one."""
    windows = not sys.platform.startswith(("linux", "freebsd")) or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    )
    try:
        # without a display Python would start a text browser in the terminal
        return windows and webbrowser.open(path.as_uri())
    except (webbrowser.Error, OSError):
        return False
