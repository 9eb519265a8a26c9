"""Poses as 4x4 matrices: elementary motions, inverse, checks, MATLAB's order, orientations.

Book section 1.1, eq. [1.1]: the columns of a pose are s, n, a (the axes) and P.
"""

from .. import _docs
from .checks import ROTATION_TOLERANCE, as_pose, as_single_pose, nearest_pose
from .matlab import poses_from_matlab, poses_to_matlab
from .motions import from_rpy, inverse, rotation, skew, to_rpy, translation

__all__ = [
    "ROTATION_TOLERANCE",
    "as_pose",
    "as_single_pose",
    "from_rpy",
    "inverse",
    "nearest_pose",
    "poses_from_matlab",
    "poses_to_matlab",
    "rotation",
    "skew",
    "to_rpy",
    "translation",
]

_docs.document(__name__)
