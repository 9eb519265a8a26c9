"""How large a file says that it is once it is unpacked, before it is unpacked."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import Any

from ..errors import InvalidValueError

_ALWAYS = 2**30
"""Bytes that are unpacked from any file."""
_TIMES = 100
"""Sizes of the file that are unpacked from larger ones: samples of sensors repeat less."""


def most_unpacked(size: int) -> int:
    """Bytes that are unpacked at most from a file of a size, in bytes."""
    return max(_ALWAYS, _TIMES * size)


def check_unpacked(path: Path, unpacked: int) -> None:
    """Refuse a compressed file whose contents exceed the memory limit."""
    size = path.stat().st_size
    if unpacked > most_unpacked(size):
        raise InvalidValueError(
            f"{path}: {size} bytes would become {unpacked / 2**30:.3g} GB; samples of sensors are "
            "not so repetitive. If it is meant, write it without compression."
        )


def unpacked_npz(path: Path) -> int:
    """Bytes of the members of an NPZ file."""
    from numpy.lib import format as npy

    total = 0
    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            total += member.file_size
            with archive.open(member) as file:
                header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
                read = header.get(npy.read_magic(file))
                if read is None:
                    raise ValueError(f"{member.filename} is an array of another version")
                shape, _, dtype = read(file)
                if math.prod(shape) * dtype.itemsize > member.file_size:
                    raise ValueError(f"{member.filename} is shorter than its shape {shape}")
    return total


def unpacked_parquet(metadata: Any) -> int:
    """Bytes of the columns of a Parquet file as numbers."""
    return 8 * int(metadata.num_rows) * int(metadata.num_columns)
