"""Small real data sets that the package ships, each with its source, and a simulated example."""

from .. import _docs
from .camera import CameraCalibration, CameraPoses, ur10_camera
from .double_socket import DoubleSocket, panda_double_socket
from .example import example_log
from .tx40 import PublishedParameter, Tx40Log, load_tx40

__all__ = [
    "CameraCalibration",
    "CameraPoses",
    "DoubleSocket",
    "PublishedParameter",
    "Tx40Log",
    "example_log",
    "load_tx40",
    "panda_double_socket",
    "ur10_camera",
]

_docs.document(__name__)
