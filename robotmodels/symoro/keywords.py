"""The keywords of SYMORO's files, and which of them are lists."""

from __future__ import annotations

import re

from ..inertia import PARAMETERS

INTEGERS = ("ant", "sigma", "mu")
GEOMETRY = ("gamma", "b", "alpha", "d", "theta", "r")
DRIVES = ("IA", "FV", "FS")
DYNAMICS = (*PARAMETERS, *DRIVES)
WRENCHES = ("FX", "FY", "FZ", "CX", "CY", "CZ")
BASE_MOTION = ("W0", "WP0", "V0", "VP0")
_LISTS = (*INTEGERS, *GEOMETRY, *DYNAMICS, *WRENCHES, *BASE_MOTION, "G", "Z",
          "eta", "k", "QP", "QDP", "GAM")  # fmt: skip
SCALARS = ("NL", "NJ", "NF", "Type", "is_floating", "is_mobile")
REQUIRED = ("NL", "NJ", "ant", "sigma", "alpha", "d", "theta", "r")
# SYMORO+ writes Ant, Sigma, B, R, ...; no two keywords differ only in case
KEYWORDS = {keyword.lower(): keyword for keyword in (*_LISTS, *SCALARS)}

# XX3, and XXR3 or XX3R in files of base parameters: a name that stands for itself
STANDARD_NAME = re.compile(rf"({'|'.join(DYNAMICS)})(R?\d+|\d+R)")
