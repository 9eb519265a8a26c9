"""The usual names of singular positions of arms with a shoulder, an elbow and a wrist."""

from __future__ import annotations

from enum import Enum


class SingularityKind(Enum):
    """Where in an arm a singular position arises.

    The geometry on the zeros of the factor decides: SHOULDER where the wrist centre comes to the
    first axis (or into the plane through it that is parallel to the second axis), or two of the
    first three axes are aligned; ELBOW where the arm is stretched or folded (neighbouring parallel
    axes and the wrist centre, or three parallel axes, come into one plane, or two axes in the
    middle are aligned); WRIST where two of the last three axes are aligned or parallel. Where
    nothing of that happens, a factor in the variables of the last three (first three) of six or
    more joints alone is WRIST (SHOULDER), any other is OTHER.
    """

    SHOULDER = "shoulder"
    ELBOW = "elbow"
    WRIST = "wrist"
    OTHER = "other"
