"""MAT files of versions 5 to 7, every length in them checked.

SciPy's reader ends the process on some damaged files, which no caller can catch. Read here is what
logs are made of: arrays of numbers, texts, structures of one element and cells; all else in a file
is left out.

Source: The MathWorks, "MAT-File Format", 2019, chapter 1: level 5.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidValueError
from .sizes import most_unpacked

_HEAD = 128
_DEEPEST = 16
_MATRIX, _COMPRESSED = 14, 15
_STORED = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
_LETTERS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_CELL, _STRUCTURE, _CHARACTERS = 1, 2, 4
_NUMBERS = {
    6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8",
}  # fmt: skip
_COMPLEX = 0x800


def read_mat(path: Path) -> dict[str, Any]:
    """Variables of a MAT file."""
    data = path.read_bytes()
    if data.startswith(b"MATLAB 7.3") or data[1:4] == b"HDF":
        raise InvalidValueError(
            f"{path}: this is a MAT file of version 7.3 (HDF5), which is not read here; in MATLAB "
            "save it with save(file, '-v7'), or write CSV or Parquet."
        )
    if len(data) < _HEAD or data[126:128] not in (b"IM", b"MI"):
        raise InvalidValueError(
            f"{path}: this is no MAT file of version 5 to 7; in MATLAB save it with save(file, "
            "'-v7'), or write CSV or Parquet."
        )
    order = "<" if data[126:128] == b"IM" else ">"
    found: dict[str, Any] = {}
    try:
        for element in _elements(data[_HEAD:], order, most_unpacked(len(data))):
            if element.kind == _MATRIX:
                _matrix(element.data, order, "", found, 0)
    except (_DamagedError, ValueError, OverflowError, struct.error, zlib.error) as error:
        raise InvalidValueError(
            f"{path}: this MAT file is damaged ({error}); write it again."
        ) from None
    return found


class _DamagedError(Exception):
    """Lengths that contradict each other."""


@dataclass(frozen=True, slots=True)
class _Element:
    """A data element: its type and its bytes."""

    kind: int
    data: memoryview


def _elements(data: bytes | memoryview, order: str, most: int) -> Iterator[_Element]:
    """Data elements one after the other; those that are compressed are unpacked, ``most`` bytes."""
    data = memoryview(data)
    at = 0
    while at < len(data):
        if len(data) - at < 8:
            if any(data[at:]):
                raise _DamagedError("it ends within a tag")
            return
        kind, size = struct.unpack_from(f"{order}II", data, at)
        if kind >> 16:  # up to four bytes within the tag
            kind, size, start, at = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise _DamagedError(f"{size} bytes in a tag of four")
        else:
            start = at + 8
            at = start + size + (0 if kind == _COMPRESSED else -size % 8)
        if start + size > len(data):
            raise _DamagedError(f"an element of {size} bytes where {len(data) - start} are left")
        part = data[start : start + size]
        if kind != _COMPRESSED:
            yield _Element(kind, part)
            continue
        if not most:
            raise _DamagedError("compressed data within compressed data")
        whole = _unpacked(part, order, most)
        most -= len(whole)
        yield from _elements(whole, order, 0)


def _unpacked(part: memoryview, order: str, most: int) -> bytes:
    """One element that was compressed, which says in its tag how long it is."""
    unpacker = zlib.decompressobj()
    tag = unpacker.decompress(part, 8)
    if len(tag) < 8:
        raise _DamagedError("compressed data without a tag")
    said = struct.unpack(f"{order}II", tag)[1]
    if said > most:
        raise _DamagedError(f"its {len(part)} bytes become more than {most}")
    inside = unpacker.decompress(unpacker.unconsumed_tail, said + 8)
    if len(inside) < said or not (unpacker.eof or unpacker.decompress(b"", 1) == b""):
        raise _DamagedError("compressed data of another length than is said")
    return tag + inside


def _matrix(data: memoryview, order: str, name: str, found: dict[str, Any], depth: int) -> Any:
    """Put an array under its name and return it; None for what is not read."""
    if not len(data):
        return np.zeros((0, 0))
    if depth > _DEEPEST:
        raise _DamagedError(f"structures {_DEEPEST} deep")
    parts = _elements(data, order, 0)
    flags = _integers(_next(parts), order)
    if not len(flags):
        raise _DamagedError("an array without its class")
    kind = int(flags[0]) & 0xFF
    if kind not in (_CELL, _STRUCTURE, _CHARACTERS, *_NUMBERS):
        return None  # tables, strings of two quotes, functions, sparse matrices: of another layout
    shape = tuple(map(int, _integers(_next(parts), order)))
    if len(shape) < 2 or any(size < 0 for size in shape):
        raise _DamagedError(f"an array of shape {shape}")
    own = bytes(_next(parts).data).decode("latin-1")
    name = f"{name}.{own}" if name and own else name or own
    count = math.prod(shape)
    value: Any = None
    if kind in _NUMBERS:
        value = _numbers(_next(parts), order, _NUMBERS[kind], count)
        if int(flags[0]) & _COMPLEX:
            value = value + 1j * _numbers(_next(parts), order, _NUMBERS[kind], count)
        value = value.reshape(shape, order="F")
    elif kind == _CHARACTERS:
        value = _texts(_next(parts), order, shape)
    elif kind == _STRUCTURE and count == 1:
        _fields(parts, order, name, found, depth)
        return None
    elif kind == _CELL:
        inside = [_matrix(p.data, order, "", {}, depth + 1) for p in parts if p.kind == _MATRIX]
        if len(inside) != count:
            raise _DamagedError(f"{len(inside)} cells for a shape {shape}")
        value = np.array([_cell(each) for each in inside], dtype=object)
    if value is not None and name:
        found[name] = value
    return value


def _fields(
    parts: Iterator[_Element], order: str, name: str, found: dict[str, Any], depth: int
) -> None:
    width = _integers(_next(parts), order)
    letters = bytes(_next(parts).data)
    if len(width) != 1 or width[0] < 1 or len(letters) % int(width[0]):
        raise _DamagedError("names of fields of another length than is said")
    step = int(width[0])
    for k in range(0, len(letters), step):
        field = letters[k : k + step].split(b"\0", 1)[0].decode("latin-1")
        part = _next(parts)
        if part.kind != _MATRIX:
            raise _DamagedError(f"the field {field} has no array")
        _matrix(part.data, order, f"{name}.{field}", found, depth + 1)


def _next(parts: Iterator[_Element]) -> _Element:
    part = next(parts, None)
    if part is None:
        raise _DamagedError("an array that is cut off")
    return part


def _stored(part: _Element, order: str) -> np.ndarray:
    if part.kind not in _STORED:
        raise _DamagedError(f"numbers of a type {part.kind} that does not exist")
    dtype = np.dtype(order + _STORED[part.kind])
    if len(part.data) % dtype.itemsize:
        raise _DamagedError(f"{len(part.data)} bytes of numbers of {dtype.itemsize} bytes")
    return np.frombuffer(part.data, dtype)


def _integers(part: _Element, order: str) -> np.ndarray:
    values = _stored(part, order)
    if values.dtype.kind not in "iu":
        raise _DamagedError("sizes that are no whole numbers")
    return values


def _numbers(part: _Element, order: str, kind: str, count: int) -> np.ndarray:
    # what fits into fewer bytes is stored in fewer, whatever the class of the array
    values = _stored(part, order)
    if len(values) != count:
        raise _DamagedError(f"{len(values)} numbers for an array of {count}")
    return values.astype(np.dtype(kind))


def _texts(part: _Element, order: str, shape: tuple[int, ...]) -> np.ndarray:
    """Rows of letters, which stand column by column in the file."""
    if part.kind not in _LETTERS:
        raise _DamagedError(f"letters of a type {part.kind}")
    encoding = _LETTERS[part.kind]
    if encoding in ("utf-16", "utf-32"):
        encoding += "-le" if order == "<" else "-be"
    letters = bytes(part.data).decode(encoding, "replace")
    rows = shape[0]
    if rows <= 1:
        return np.array([letters])
    return np.array([letters[k::rows] for k in range(min(rows, len(letters)))])


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return ", ".join(map(str, value.reshape(-1)[:1000]))
