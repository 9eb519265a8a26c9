"""Infinite families of postures: the arm moves and the tool does not.

`settle` asks which postures belong to one (`_members`), walks those families as curves
(`family_curves`, in the compiled steps of `_directions` on those of `_correction`) and keeps the
members at the reference; `member_curves` walks them for the postures that a relation cuts out.
"""

from .member_curves import MemberCurve, curves_through
from .settle import Settled, double_roots, replaced, settle_families, singular_postures

__all__ = [
    "MemberCurve",
    "Settled",
    "curves_through",
    "double_roots",
    "replaced",
    "settle_families",
    "singular_postures",
]
