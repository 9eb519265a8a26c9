"""Simulated log of a planar arm, for the examples of the documentation."""

from __future__ import annotations

import numpy as np

from ..dynamics import idm
from ..logs import Log
from ..minimal_parameters import uniform_bodies
from ..model import RobotModel
from ..robots import load


def example_log(samples: int = 4000) -> tuple[RobotModel, Log]:
    """A planar arm with two joints and a log of its motion, simulated without noise.

    Parameters
    ----------
    samples : int
        At 200 Hz.

    Returns
    -------
    model : RobotModel
        Two links of 5 kg in all under gravity, with viscous friction of 2 N m s/rad.
    log : Log
        Positions and torques of both joints.

    Examples
    --------
    >>> model, log = example_log()
    >>> model.n, len(log)
    (2, 4000)
    """
    arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    t, w = 0.005 * np.arange(samples)[:, None], np.array([2.0, 3.1])
    q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    return arm, Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
