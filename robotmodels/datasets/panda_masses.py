"""Masses of the Panda's links and of its hand, which the URDF of the double socket leaves out.

Source: C. Gaz, M. Cognetti, A. Oliva, P. Robuffo Giordano and A. De Luca, "Dynamic identification
of the Franka Emika Panda robot with retrieval of feasible parameters using penalty-based
optimization", IEEE Robotics and Automation Letters 4(4), 2019.
"""

from __future__ import annotations

from math import pi

import numpy as np

from .. import se3
from ..inertia import InertialParameters

# Repeated from the catalogue's Panda, which is a room beside; a test holds them equal.
_MASS = (4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522)
_COM = (
    (0.003875, 0.002081, -0.04762),
    (-0.003141, -0.02872, 0.003495),
    (0.027518, 0.039252, -0.066502),
    (-0.05317, 0.104419, 0.027454),
    (-0.011953, 0.041065, -0.038437),
    (0.060149, -0.014117, -0.010517),
    (0.010517, -0.004252, 0.061597),
)
_INERTIA = (  # XX, XY, XZ, YY, YZ, ZZ about the centres of mass
    (0.70337, -0.000139, 0.006772, 0.70661, 0.019169, 0.009117),
    (0.007962, -0.003925, 0.010254, 0.02811, 0.000704, 0.025995),
    (0.037242, -0.004761, -0.011396, 0.036155, -0.012805, 0.01083),
    (0.025853, 0.007796, -0.001332, 0.019552, 0.008641, 0.028323),
    (0.035549, -0.002117, -0.004037, 0.029474, 0.000229, 0.008627),
    (0.001964, 0.000109, -0.001158, 0.004354, 0.000341, 0.005433),
    (0.012516, -0.000428, -0.001196, 0.010027, -0.000741, 0.004815),
)
_HAND_MASS, _HAND_COM, _HAND_INERTIA = 0.73, (-0.01, 0.0, 0.03), (0.001, 0.0025, 0.0017)
_FLANGE, _HAND_TURN = 0.107, -pi / 4.0


def panda_masses() -> InertialParameters:
    """Inertial parameters of a Panda with its hand, in the frames of the double socket's URDF."""
    xx, xy, xz, yy, yz, zz = np.array(_INERTIA).T
    tensors = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), 2, 0)
    values = InertialParameters.from_com(_MASS, _COM, tensors).values.copy()
    hand = InertialParameters.from_com([_HAND_MASS], [_HAND_COM], [np.diag(_HAND_INERTIA)])
    there = se3.translation(0.0, 0.0, _FLANGE) @ se3.rotation("z", _HAND_TURN)
    values[6] += hand.moved(there[None]).values[0]
    return InertialParameters(values)
