"""Drive chains: rotor inertia, friction and offset of the joints, and the transmission."""

from .. import _docs
from .matrices import DriveMatrices as DriveMatrices
from .matrices import drive_matrices as drive_matrices
from .parameters import DriveKind, DriveParameters
from .parameters import Drives as Drives
from .parameters import DriveWord as DriveWord
from .parameters import check_all_or_none as check_all_or_none
from .parameters import drive_kinds as drive_kinds
from .transmission import Transmission

__all__ = ["DriveKind", "DriveParameters", "Transmission"]

_docs.document(__name__)
