"""Reading SYMORO's ``.par`` files: SYMORO+ (Windows) and OpenSYMORO spell them differently.

Facts about the format: keywords stand before ``= {entry, entry, ...}``, comments between ``(*``
and ``*)``. NL links and NJ joints make B = NJ - NL loops; the frames are NF = NL + 2 B, of which
NL + 1 to NJ are on the cut joints and the rest are their second, fixed frames. Geometric lists
have NF entries, dynamic ones NL, starting with row 1. ``G`` is the acceleration of gravity in
frame 0, ``Z`` the pose of frame 0 row by row. W. Khalil, A. Vijayalingam, B. Khomutenko, I.
Mukhanov, P. Lemoine and G. Ecorchard, "OpenSYMORO: an open-source software package for symbolic
modelling of robots", IEEE/ASME AIM 2014.
"""

from .. import _docs
from .read import read_par

__all__ = ["read_par"]

_docs.document(__name__)
