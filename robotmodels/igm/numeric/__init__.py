"""The iterative inverse of any chain, masks included: `igm_numeric` and its compiled steps."""

from .inverse import igm_numeric

__all__ = ["igm_numeric"]
