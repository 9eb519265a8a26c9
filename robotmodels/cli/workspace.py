"""``robotmodels workspace``: the workspace of a robot, with numbers of postures."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from ..performance import Workspace, cusps
from ..performance import workspace as reached
from .arguments import robot_of
from .igm import mask_of
from .output import Report

EXAMPLES = """\
examples:
  robotmodels workspace planar_2r --no-limits
  robotmodels workspace puma560 --resolution 120 --picture section.png
  robotmodels workspace planar_3r --kind primary --mask 1 1 0 0 0 0 --json"""
DESCRIPTION = """\
Workspace of a robot: area or volume by the number of postures, in a section where the first joint
turns freely, else in space. Lengths are in m."""
OPTIONS = """\
@robot
--kind [positions|primary|secondary =positions] positions in any orientation, in every one, or in
    some but not every one
--section [auto|plane|space =auto] half a plane through the first axis, or space (default: the plane
    where it represents the workspace)
@no_limits
--resolution CELLS [int] cells along each coordinate
@mask
--picture FILE [path] draw the section or two views (.png, .pdf, .svg), or write a page with the
    robot (.html)
@json"""
NOT_REACHED = "nothing is reached"


def run(arguments: argparse.Namespace) -> Report:
    """Run the command: compute, draw and print."""
    model = robot_of(arguments)
    found = reached(
        model, arguments.kind, arguments.section, not arguments.no_limits,
        resolution=arguments.resolution, mask=mask_of(arguments.mask),
    )  # fmt: skip
    if arguments.picture is not None:
        from ..viz import plot_workspace, show_workspace

        path = arguments.picture
        if path.suffix.lower() in (".html", ".htm"):
            show_workspace(found).save(path)
        else:
            plot_workspace(found).savefig(path)
    data = numbers_of(found)
    text = as_text(data)
    text += "" if arguments.picture is None else f"\nWritten: {arguments.picture}"
    return Report(text, data, bool(found.count.any()))


def numbers_of(w: Workspace) -> dict[str, Any]:
    """Areas, volumes and special points as JSON data."""
    counts = [int(n) for n in np.unique(w.count[w.count > 0])]
    planar, swept = w.coordinates != "space", w.coordinates != "plane"
    return {
        "robot": w.model.name,
        "kind": w.kind,
        "coordinates": w.coordinates,
        "cells": list(w.shape),
        "status": w.status.name,
        "reason": w.reason(),
        "area": w.area if planar else None,
        "volume": w.volume if swept else None,
        "by_postures": [
            {"postures": n}
            | {"area": w.area_of(n) if planar else None}
            | {"volume": w.volume_of(n) if swept else None}
            for n in counts
        ],
        "grid_error": w.grid_error if counts else None,
        "cusps": cusps(w.model).section if planar and counts else [],
    }


def as_text(data: dict[str, Any]) -> str:
    """Areas, volumes and special points as text."""
    lines = [
        f"Workspace of {data['robot']} ({data['kind']}, {data['coordinates']}): {data['reason']}"
    ]
    rows = [("all", data), *((str(part["postures"]), part) for part in data["by_postures"])]
    for name, part in rows if data["by_postures"] else ():
        values = [
            f"{word} {part[word]:.6g} {unit}"
            for word, unit in (("area", "m^2"), ("volume", "m^3"))
            if part[word] is not None
        ]
        lines.append(f"  {name:>3} posture{'s' if name != '1' else ' '}: {', '.join(values)}")
    if data["grid_error"] is not None:
        lines.append(f"Sums of cells are good to about {data['grid_error']:.2%}.")
    for u, v in np.asarray(data["cusps"]).reshape(-1, 2):
        lines.append(f"Cusp at {u:.6f}, {v:.6f} m.")
    return "\n".join(lines)
