"""Files beside the code, wherever the package is installed (in a zip archive too)."""

from __future__ import annotations

from importlib.resources import files
from importlib.resources.abc import Traversable

from .._arrays import Array, read_only


def folder(name: str) -> Traversable:
    """Folder of a data set."""
    return files("robotmodels.datasets") / name


def numbers(file: Traversable, header: int = 0) -> Array:
    """Numbers of a comma-separated file. Shapes: -> (rows, columns)."""
    lines = file.read_text(encoding="utf-8").splitlines()[header:]
    return read_only([[float(entry) for entry in line.split(",")] for line in lines if line])
