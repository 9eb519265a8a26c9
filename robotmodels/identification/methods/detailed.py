"""Base of estimates that say more than parameters and deviations."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from .estimate import Estimate


class DetailedEstimate(Estimate):
    """An estimate with fields of its own, which are given by name.

    Copies and pickles are rebuilt by name, so that their arrays stay read-only.
    """

    __slots__ = ()

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (type(self), {f.name: getattr(self, f.name) for f in fields(self)})


def _rebuilt(kind: type, values: dict[str, Any]) -> Any:
    for value in values.values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return kind(**values)
