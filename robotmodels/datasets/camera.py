"""Poses of a camera on the wrist of a UR10, measured with images of a board."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .. import se3
from .._arrays import Array, Rebuilt, read_only
from ..model import RobotModel
from ._files import folder, numbers

_SOURCE = (
    "examples/ur10 of github.com/thanhndv212/figaroh-examples, commit c0b5c7f0fda1 "
    "(calibration.csv, simulation.csv, ur10_robot.urdf)"
)


class CameraPoses(NamedTuple):
    """Readings and the poses that were measured at them.

    Attributes
    ----------
    q : ndarray, shape (N, 6)
        Readings of the joints, rad.
    T : ndarray, shape (N, 4, 4)
        Poses of the camera in the room, metres.
    """

    q: Array
    T: Array


@dataclass(frozen=True, slots=True, eq=False)
class CameraCalibration(Rebuilt):
    """A robot, and poses of the camera that it carries.

    Parameters
    ----------
    urdf : str
        The nominal robot as URDF.
    measured, simulated : CameraPoses
        The real set, and one that the source simulated.
    source, licence : str
        Where the data come from, and their terms.
    """

    urdf: str
    measured: CameraPoses
    simulated: CameraPoses
    source: str
    licence: str

    @property
    def model(self) -> RobotModel:
        """The nominal robot, its tool at ``wrist_3_link``: the camera's place is not known."""
        return RobotModel.from_urdf(self.urdf, tip_link="wrist_3_link")


def ur10_camera() -> CameraCalibration:
    """A UR10 with a camera in its hand: 23 measured and 29 simulated poses.

    The pose T of the camera is ``Z T(q) E``: Z, the pose of the room's frame, is about 70 mm and 2
    degrees off, E, the pose of the camera on the wrist, is unknown; both are to be estimated. The
    source gives x, y, z and roll, pitch, yaw (URDF's, ``Rot(z) Rot(y) Rot(x)``), which are poses
    here; that this order is meant was found by fits. The measured value is the board's pose in
    the camera, so that errors of position and angle are correlated: a turn that is 0.1 degrees off
    is 0.8 mm at the camera, 0.45 m away.

    Returns
    -------
    CameraCalibration
        URDF, readings, poses.

    References
    ----------
    FIGAROH 1.0.2, whose example these are: 3.45 mm and 0.517 degrees with 16
    parameters, 2.97 mm and 0.337 degrees with 48, root mean square of the fitted rows.

    Examples
    --------
    >>> data = ur10_camera()
    >>> data.measured.T.shape, data.simulated.q.shape, data.model.n
    ((23, 4, 4), (29, 6), 6)
    """
    data = folder("ur10_camera")
    sets = []
    for name in ("calibration.csv", "simulation.csv"):
        rows = numbers(data / name, header=1)
        T = np.array([se3.from_rpy(row[3:6], row[:3]) for row in rows])
        sets.append(CameraPoses(read_only(rows[:, 6:]), read_only(T)))
    urdf = (data / "ur10.urdf").read_text(encoding="utf-8")
    return CameraCalibration(urdf, sets[0], sets[1], _SOURCE, "Apache-2.0")
