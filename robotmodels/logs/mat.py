"""MAT files as named arrays and texts; those in structures as "log.q"."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from math import prod
from typing import Any, BinaryIO

import numpy as np

from ..errors import MissingExtraError

_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes of a number, by the type of an element of numbers (MAT-file format 5, table 1-1)."""
_MATRIX, _COMPRESSED = 14, 15
_HEADS = ((6, 5, 1), (6, 6, 1), (6, 5, 16))
"""Types of flags, dimensions and name; the last two are those of other programs."""
_CELL, _STRUCT, _CHAR, _NUMBERS = 1, 2, 4, range(6, 16)
_DEEPEST, _LARGEST = 30, 2**31


def read_mat(file: BinaryIO) -> dict[str, Any]:
    """Variables of a MAT file of version 5 (with or without compression) or 7.3."""
    from scipy.io import loadmat

    def flat(values: dict[str, Any], head: str = "") -> Iterator[tuple[str, Any]]:
        for name, value in values.items():
            if isinstance(value, dict):
                yield from flat(value, f"{head}{name}.")
            elif not name.startswith("__"):
                yield head + name, value

    data = file.read(520)
    if b"MATLAB 7.3" in data[:128] and data[512:516] == b"\x89HDF":
        file.seek(0)
        return _version_7_3(file)
    data += file.read()
    if len(data) < 128 or data[126:128] not in (b"IM", b"MI"):
        raise ValueError("it has no head of version 5")
    order = "little" if data[126:128] == b"IM" else "big"
    names: list[str] = []
    for kind, part in _elements(memoryview(data)[128:], order):
        if kind == _COMPRESSED:
            inflate = zlib.decompressobj()
            part = memoryview(inflate.decompress(part, _LARGEST))
            ((kind, part),) = _elements(part, order)
        if kind != _MATRIX:
            raise ValueError(f"an element of type {kind} where a variable should be")
        if _is_readable(part, order, 0):
            names.append(bytes(list(_elements(part, order))[2][1]).decode("latin-1"))
    file.seek(0)
    return dict(flat(loadmat(file, simplify_cells=True, variable_names=names)))


def _elements(data: memoryview, order: Any) -> Iterator[tuple[int, memoryview]]:
    """Types and contents of the elements that follow each other in a block."""
    at = 0
    while at < len(data):
        word = int.from_bytes(data[at : at + 4], order)
        kind, size, start = word & 0xFFFF, word >> 16, at + 4
        if small := size > 0:
            stop = at + 8
        else:
            size, start = int.from_bytes(data[at + 4 : at + 8], order), at + 8
            stop = start + (size if kind == _COMPRESSED else -(-size // 8) * 8)
        if start + size > len(data) or (small and size > 4) or size % _SIZES.get(kind, 1):
            raise ValueError("an element that is longer than the file")
        yield kind, data[start : start + size]
        at = stop


def _is_readable(data: memoryview, order: Any, depth: int) -> bool:
    """Whether a variable has numbers, texts, structures or cells alone.

    Its types and lengths are checked on the way, because SciPy's reader relies on them.
    """
    if depth > _DEEPEST:
        raise ValueError("structures within structures without end")
    parts = list(_elements(data, order))
    if not parts:
        return True  # an empty cell
    head = tuple(kind for kind, _ in parts[:3])
    if head not in _HEADS or len(parts[0][1]) != 8:
        raise ValueError("a variable without flags, dimensions and name")
    flags = int.from_bytes(parts[0][1][:4], order)
    steps = range(0, len(parts[1][1]), 4)
    shape = [int.from_bytes(parts[1][1][k : k + 4], order, signed=True) for k in steps]
    count, what = prod(shape), flags & 0xFF
    rest = parts[3:]
    if what in (_CELL, _STRUCT):
        fields = 1
        if what == _STRUCT:
            if [kind for kind, _ in rest[:2]] != [5, 1] or len(rest[0][1]) != 4:
                raise ValueError("a structure without names of its fields")
            length = int.from_bytes(rest[0][1], order, signed=True)
            if length <= 0 or len(rest[1][1]) % length:
                raise ValueError("a structure whose names have no length")
            fields, rest = len(rest[1][1]) // length, rest[2:]
        if min(shape) < 0 or len(rest) != count * fields:
            raise ValueError("a structure or cell with another number of parts than it states")
        if any(kind != _MATRIX for kind, _ in rest):
            raise ValueError("a part of a structure that is no variable")
        return all(_is_readable(part, order, depth + 1) for _, part in rest)
    if what in _NUMBERS or what == _CHAR:
        lengths = [len(part) // _SIZES[kind] for kind, part in rest if kind in _SIZES]
        wanted = 1 + (what != _CHAR and flags >> 11 & 1)
        if min(shape) < 0 or len(lengths) != len(rest) or len(rest) != wanted:
            raise ValueError("an array without its numbers")
        if what != _CHAR and any(length != count for length in lengths):
            raise ValueError("an array with another number of entries than it states")
        return True
    return False


def _version_7_3(file: BinaryIO) -> dict[str, Any]:
    """Variables of a MAT file of version 7.3 (HDF5)."""
    try:
        import h5py
    except ImportError:
        raise MissingExtraError(
            "MAT files of version 7.3 need h5py: pip install 'robotmodels[logs]'; or save the file "
            "with save(file, '-v7')."
        ) from None
    found: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):
            kind = item.attrs.get("MATLAB_class", b"").decode()
            value = item[()]
            if kind == "char":
                found[name.replace("/", ".")] = "".join(map(chr, np.ravel(value)))
            elif value.dtype.kind in "fiub":
                found[name.replace("/", ".")] = value.T  # MATLAB stores columns first

    with h5py.File(file, "r") as stored:
        stored.visititems(visit)
    return found
