"""Robots of Franka Emika (now Franka Robotics): the Panda."""

from __future__ import annotations

from math import pi

from .. import se3
from ..geometry import DHTable
from ..inertia import InertialParameters
from ..model import RobotModel
from .assembly import columns, symmetric


def panda() -> RobotModel:
    """Franka Emika Panda, without hand.

    Khalil-Kleinfinger table (Franka prints the same one, which it calls Craig's convention), in
    metres and radians; the tool is the flange. Geometry: ``panda.urdf`` of example-robot-data
    5.0.0, equal to the model Panda of the Robotics Toolbox for Python 1.5.0. Position, velocity
    and torque limits: ``panda/joint_limits.yaml`` of frankaemika/franka_ros (commit b2a62ff).
    Masses, centres of mass and inertia: ``common/inertial.yaml``, same place, from the
    identification by Gaz et al. 2019; Franka publishes none. The posture ``ready`` is the state
    ``default`` of ``panda.srdf`` of example-robot-data without its rounding.

    Source: C. Gaz, M. Cognetti, A. Oliva, P. Robuffo Giordano and A. De Luca, "Dynamic
    identification of the Franka Emika Panda robot with retrieval of feasible parameters using
    penalty-based optimization", IEEE Robotics and Automation Letters 4(4), 2019.
    """
    table = DHTable.from_rows(
        columns(
            name=tuple(f"panda_joint{j}" for j in range(1, 8)),
            sigma=(0,) * 7,
            alpha=(0, -pi / 2, pi / 2, pi / 2, -pi / 2, pi / 2, pi / 2),
            d=(0, 0, 0, 0.0825, -0.0825, 0, 0.088),
            theta=(0,) * 7,
            r=(0.333, 0, 0.316, 0, 0.384, 0, 0),
            lower=(-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973),
            upper=(2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973),
            velocity=(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
            effort=(87, 87, 87, 87, 12, 12, 12),
        )
    )
    inertia = InertialParameters.from_com(
        mass=(4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522),
        com=(
            (0.003875, 0.002081, -0.04762),
            (-0.003141, -0.02872, 0.003495),
            (0.027518, 0.039252, -0.066502),
            (-0.05317, 0.104419, 0.027454),
            (-0.011953, 0.041065, -0.038437),
            (0.060149, -0.014117, -0.010517),
            (0.010517, -0.004252, 0.061597),
        ),
        inertia=symmetric((
            (0.70337, -0.000139, 0.006772, 0.70661, 0.019169, 0.009117),
            (0.007962, -0.003925, 0.010254, 0.02811, 0.000704, 0.025995),
            (0.037242, -0.004761, -0.011396, 0.036155, -0.012805, 0.01083),
            (0.025853, 0.007796, -0.001332, 0.019552, 0.008641, 0.028323),
            (0.035549, -0.002117, -0.004037, 0.029474, 0.000229, 0.008627),
            (0.001964, 0.000109, -0.001158, 0.004354, 0.000341, 0.005433),
            (0.012516, -0.000428, -0.001196, 0.010027, -0.000741, 0.004815),
        )),
    )  # fmt: skip
    ready = (0, -pi / 4, 0, -3 * pi / 4, 0, pi / 2, pi / 4)
    return RobotModel.from_table(
        table,
        inertia=inertia,
        tool=se3.translation(0, 0, 0.107),
        name="panda",
        configurations={"ready": ready},
    )
