"""The tree of frames: how many there are, their geometric parameters, and the base."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import ParFileError, RobotModelsError
from ..geometry import FIXED, PRISMATIC
from .keywords import GEOMETRY, INTEGERS
from .numbers import Numbers
from .statements import ParFile


def counts(file: ParFile, loops: bool = False) -> tuple[int, int, int]:
    """Number of links, of joints and of frames, on a fixed base; a tree unless `loops`."""
    links, joints, kind = file.integer("NL", 0), file.integer("NJ", 0), file.integer("Type", 0)
    f = file.integer("NF", max(links, 2 * joints - links))
    for keyword, what in (("is_floating", "floating"), ("is_mobile", "mobile")):
        if file.flag(keyword):
            raise file.error(
                f"a robot on a {what} base is not supported yet; set {keyword} = False, take entry "
                "0 out of the dynamic lists and read the arm on a fixed base.",
                file.line(keyword),
            )
    if joints > links and not loops:
        cut, second = range(links + 1, joints + 1), range(joints + 1, f + 1)
        raise file.error(
            f"{file.name!r} has closed loops: with NL = {links} links and NJ = {joints} joints, "
            f"they are cut at {_numbered('joint', cut)}"
            + (f" (second: {_numbered('frame', second)})" if second else "")
            + ". Read it with robotmodels.loops.read_par.",
            file.line("NJ"),
        )
    if kind == 2 and joints == links:
        raise file.error(
            f"Type = 2 says that {file.name!r} has closed loops, but NL = NJ = {links} cuts no "
            "joint; set Type = 1 if the file is the spanning tree.",
            file.line("Type"),
        )
    if links < 1 or joints < links or f < 2 * joints - links:
        raise file.error(
            f"NL = {links} links, NJ = {joints} joints and NF = {f} frames do not fit: a tree has "
            "as many of each, at least one, fixed frames (sigma 2) count as joints too, and each "
            "joint more than links cuts a loop and needs a second frame.",
            file.line("NL"),
        )
    return links, joints, f


def geometry(file: ParFile, numbers: Numbers, joints: int, f: int) -> dict[str, Any]:
    """Columns of the table, from its checked lists."""
    rows = {k: file.entries(k, f, f"NF = {f} frames") for k in (*INTEGERS, *GEOMETRY)}
    columns: dict[str, Any] = {
        _column(k): [numbers.integer(entry) for entry in rows[k]] for k in INTEGERS if rows[k]
    }
    numbers.check_complete()
    legal = {
        "ant": (range(f + 1), f"the number of a frame, 0 (the base) to {f}"),
        "sigma": ((0, PRISMATIC, FIXED), "0 (revolute), 1 (prismatic) or 2 (fixed)"),
        "mu": ((0, 1), "1 (actuated) or 0 (passive)"),
    }
    for key, (allowed, expected) in legal.items():
        for entry, value in zip(rows[key], columns.get(_column(key), ()), strict=True):
            if value not in allowed:
                raise ParFileError(f"{entry.place}: expected {expected}, got {value}.")
    if any(kind != FIXED for kind in columns["sigma"][joints:]):
        raise file.error(
            f"NF = {f} frames, but NJ = {joints} joints: only fixed frames (sigma 2) may come "
            "after the joints.",
            file.line("NF") or file.line("sigma"),
        )
    own = {0: "theta", PRISMATIC: "r"}
    offsets = {  # first, so that a variable elsewhere is known as one
        (key, j): numbers.offset(rows[key][j], j + 1)
        for j, kind in enumerate(columns["sigma"])
        if (key := own.get(kind, "")) and rows[key]
    }
    for key in GEOMETRY:
        if rows[key]:
            columns[key] = [
                offsets[key, j] if (key, j) in offsets else numbers.number(entry)
                for j, entry in enumerate(rows[key])
            ]
    columns["symbols"] = {
        (key, j): entry.text
        for key in GEOMETRY
        for j, entry in enumerate(rows[key], start=1)
        if (key, j - 1) not in offsets and entry.symbols and len(entry.text) <= 60
    }
    return columns


def _column(keyword: str) -> str:
    """Name of a geometric list in the table."""
    return "antecedent" if keyword == "ant" else keyword


def base_pose(file: ParFile, numbers: Numbers) -> Array:
    """Pose of frame 0 in the world."""
    entries = file.entries("Z", 16, "a 4x4 matrix row by row")
    if not entries:
        return np.eye(4)
    if any(set(numbers.free(entry)) for entry in entries):
        for entry in entries:
            numbers.number(entry)
        return np.eye(4)
    Z = np.array([numbers.number(entry) for entry in entries]).reshape(4, 4)
    try:
        return se3.as_single_pose(Z, "Z")
    except RobotModelsError as error:
        raise file.error(
            f"{error} Z holds the pose of frame 0 in the world, row by row.", file.line("Z")
        ) from None


def _numbered(what: str, numbers: range) -> str:
    listed = ", ".join(map(str, numbers))
    return f"{what} {listed}" if len(numbers) == 1 else f"{what}s {listed}"
