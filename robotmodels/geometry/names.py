"""Names of frames, each its own and none that a URDF could not hold; symbols of constants."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ..errors import ShapeError, TableError
from .joint_kinds import FIXED

NOT_XML = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""Characters that XML does not keep, and control characters that a terminal obeys."""


def default_names(sigma: NDArray[np.int64]) -> tuple[str, ...]:
    """``joint_j``, or ``frame_j`` where nothing moves."""
    return tuple(f"{'frame' if s == FIXED else 'joint'}_{j}" for j, s in enumerate(sigma, start=1))


def checked_names(names: Sequence[str], f: int) -> tuple[str, ...]:
    """The names of f frames; raises for names that cannot be used."""
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise TableError(f"names: expected a list of names, one for each row, got {names!r:.80}.")
    labels = tuple(map(str, names))
    if len(labels) != f:
        raise ShapeError(f"names: expected one name for each of the {f} rows, got {len(labels)}.")
    repeated = sorted(name for name, count in Counter(labels).items() if count > 1)
    if repeated:
        listed = ", ".join(f"{name!r:.80}" for name in repeated[:5])
        raise TableError(f"names: each frame needs a name of its own, got {listed} more than once.")
    if not all(labels):
        raise TableError("names: a frame has an empty name.")
    for name in labels:
        if NOT_XML.search(name):
            raise TableError(
                f"names: {name!r:.80} holds a control character; a URDF cannot hold it."
            )
    return labels


def checked_symbols(
    symbols: Mapping[tuple[str, int], str] | None, f: int
) -> Mapping[tuple[str, int], str]:
    """Names of geometric constants by column and row number, read-only."""
    if symbols is None:
        return _NO_SYMBOLS
    if not isinstance(symbols, Mapping):
        raise TableError(
            f"symbols: expected a mapping such as {{('d', 3): 'L1'}}, got {type(symbols).__name__}."
        )
    checked = {}
    for key, name in symbols.items():
        column, row = key if isinstance(key, tuple) and len(key) == 2 else (None, None)
        if column not in _SYMBOLIC or not isinstance(row, int) or not 1 <= row <= f:
            raise TableError(
                f"symbols: expected a column ({', '.join(_SYMBOLIC)}) and a row from 1 to {f}, got "
                f"{key!r:.80}."
            )
        if not isinstance(name, str) or not _SYMBOL.fullmatch(name):
            raise TableError(f"symbols: expected the name or formula of {key}, got {name!r:.80}.")
        checked[column, row] = name
    return MappingProxyType(checked)


_SYMBOLIC = ("gamma", "b", "beta", "alpha", "d", "theta", "r")
_SYMBOL = re.compile(r"[-+(]*(?:[\d.]+[*/])?[-+(]*[A-Za-z_][\w+*/(). -]{0,59}")
_NO_SYMBOLS: Mapping[tuple[str, int], str] = MappingProxyType({})
_DEFAULT = {
    "gamma": "G", "b": "BL", "beta": "B", "alpha": "A", "d": "D", "theta": "TH", "r": "RL",
}  # fmt: skip
_IN_USE = re.compile(r"[CSUr]\d.*|theta\d+|[snax][xyz]|P[xyz]|[EISZ]|pi")


def constant_names(symbols: Mapping[tuple[str, int], str]) -> dict[str, str]:
    """A table's own names of constants by the usual ones of formulas.

    Parameters
    ----------
    symbols : mapping of (str, int) to str
        ``DHTable.symbols``.

    Returns
    -------
    dict of str to str
        Such as ``{"D3": "L1"}``: names that are identifiers, denote one constant each and are
        not used by formulas otherwise.

    Examples
    --------
    >>> constant_names({("d", 3): "L1", ("r", 2): "L1+L2"})
    {'D3': 'L1'}
    """
    names = list(symbols.values())
    return {
        f"{_DEFAULT[column]}{j}": name
        for (column, j), name in symbols.items()
        if name.isidentifier() and names.count(name) == 1 and not _IN_USE.fullmatch(name)
    }
