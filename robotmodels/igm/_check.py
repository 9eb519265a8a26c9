"""Names of `kernels` for files that are not moved yet."""

from .kernels.chain import forward, jacobian, wrapped
from .kernels.chain import pose_error as missing
from .kernels.newton import MERGE, refined

__all__ = ["EXACT", "MERGE", "forward", "jacobian", "missing", "refined", "wrapped"]

EXACT = 2e-13
