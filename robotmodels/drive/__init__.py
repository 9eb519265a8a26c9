"""Drive chains: rotor inertia, friction and offset of the joints, and the transmission."""

from .kinds import DriveKind, Drives, DriveWord, check_all_or_none, drive_kinds
from .matrices import DriveMatrices, drive_matrices
from .parameters import DriveParameters
from .transmission import Transmission

__all__ = [
    "DriveKind",
    "DriveMatrices",
    "DriveParameters",
    "DriveWord",
    "Drives",
    "Transmission",
    "check_all_or_none",
    "drive_kinds",
    "drive_matrices",
]
