"""Unimation PUMA 560, the arm whose inertia is best documented in the literature."""

from __future__ import annotations

from math import pi

import numpy as np

from ..drive import DriveParameters
from ..geometry import DHTable
from ..inertia import InertialParameters
from ..model import RobotModel
from .assembly import columns, symmetric


def puma560() -> RobotModel:
    """Unimation PUMA 560 with the inertial data and friction of the literature.

    Classical table (metres, radians), R_0 on the mounting face, 26.45 inch below the shoulder.
    Geometry, masses, centres of mass, inertia about them, rotor inertia, gear ratios and
    friction: Corke and Armstrong-Helouvry 1994 as in the model Puma560 of the Robotics Toolbox
    for Python 1.5.0, against which every model is tested; position limits from the same file,
    after Wang and Chen 1991. No velocity or torque limits are given there.

    Two links are no physical bodies, as published: link 1 has inertia about its axis only (its
    mass was never measured and has no effect), and the principal moments of link 3 miss the
    triangle inequality by 0.0075 kg m^2. Friction differs with the direction of motion in the
    source; here ``Fc`` is the mean and ``offset`` the half difference, which gives the same torque
    whenever a joint moves. Motor values are multiplied by the square of the gear ratio, Coulomb
    friction by its magnitude.

    Source: P. I. Corke and B. Armstrong-Helouvry, "A search for consensus among model parameters
    reported for the PUMA 560 robot", IEEE ICRA 1994, pp. 1608-1613. L.-C. T. Wang and C. C. Chen,
    "A combined optimization method for solving the inverse kinematics problem", IEEE Trans.
    Robotics and Automation 7(4), 1991.
    """
    rows = columns(
        d=(26.45 * 0.0254, 0, 0.15005, 0.4318, 0, 0),
        a=(0, 0.4318, 0.0203, 0, 0, 0),
        alpha=(90, 0, -90, 90, -90, 0),
        lower=(-160, -45, -225, -110, -100, -266),
        upper=(160, 225, 45, 170, 100, 266),
    )
    table, tool = DHTable.from_standard(rows, degrees=True)
    inertia = InertialParameters.from_standard(
        rows,
        mass=(0, 17.4, 4.8, 0.82, 0.34, 0.09),
        com=(
            (0, 0, 0),
            (-0.3638, 0.006, 0.2275),
            (-0.0203, -0.0141, 0.070),
            (0, 0.019, 0),
            (0, 0, 0),
            (0, 0, 0.032),
        ),
        inertia=symmetric((
            (0, 0, 0, 0.35, 0, 0),
            (0.13, 0, 0, 0.524, 0, 0.539),
            (0.066, 0, 0, 0.086, 0, 0.0125),
            (1.8e-3, 0, 0, 1.3e-3, 0, 1.8e-3),
            (0.3e-3, 0, 0, 0.4e-3, 0, 0.3e-3),
            (0.15e-3, 0, 0, 0.15e-3, 0, 0.04e-3),
        )),
        degrees=True,
    )  # fmt: skip
    gear = np.array([-62.6111, 107.815, -53.7063, 76.0364, 71.923, 76.686])
    rotor = np.array([200e-6, 200e-6, 200e-6, 33e-6, 33e-6, 33e-6])
    viscous = np.array([1.48e-3, 0.817e-3, 1.38e-3, 71.2e-6, 82.6e-6, 36.7e-6])
    forward = np.array([0.395, 0.126, 0.132, 11.2e-3, 9.26e-3, 3.96e-3])
    backward = np.array([0.435, 0.071, 0.105, 16.9e-3, 14.5e-3, 10.5e-3])
    drive = DriveParameters(
        Ia=gear**2 * rotor,
        Fv=gear**2 * viscous,
        Fc=np.abs(gear) * (forward + backward) / 2,
        offset=np.abs(gear) * (forward - backward) / 2,
    )
    postures = {
        "ready": (0, pi / 2, -pi / 2, 0, 0, 0),
        "stretched": (0, 0, -pi / 2, 0, 0, 0),
        "nominal": (0, pi / 4, -pi, 0, pi / 4, 0),
    }
    return RobotModel.from_table(
        table, inertia=inertia, drive=drive, tool=tool, name="puma560", configurations=postures
    )
