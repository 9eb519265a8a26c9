"""Arrays: array-likes in, checked float64 arrays out, one rule for batches, immutable values.

Leading axes are batch axes and broadcast against each other; the last axes are the core.
"""

from .batch import batch_rows, batch_shape, check_same_length
from .border import (
    LARGEST,
    Array,
    as_bounded,
    as_core,
    as_count,
    as_each,
    as_exact,
    as_flag,
    as_floats,
    as_mask,
    as_number,
    as_reals,
    as_vector,
)
from .values import Frozen, Rebuilt, Value, read_only, same_value, value_hash

__all__ = [
    "LARGEST",
    "Array",
    "Frozen",
    "Rebuilt",
    "Value",
    "as_bounded",
    "as_core",
    "as_count",
    "as_each",
    "as_exact",
    "as_flag",
    "as_floats",
    "as_mask",
    "as_number",
    "as_reals",
    "as_vector",
    "batch_rows",
    "batch_shape",
    "check_same_length",
    "read_only",
    "same_value",
    "value_hash",
]
