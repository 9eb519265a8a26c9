"""Small real data sets that the package ships, each with its source and its licence."""

from .camera import CameraCalibration, CameraPoses, ur10_camera
from .double_socket import DoubleSocket, panda_double_socket

__all__ = [
    "CameraCalibration",
    "CameraPoses",
    "DoubleSocket",
    "panda_double_socket",
    "ur10_camera",
]
