"""Tasks of a redundant robot: what is asked of its joint velocities beside the main twist.

A task is a value with two methods, `Task.level` and `Task.acceleration_level`, that give its rows
at configurations. Seed book section 1.3.2.4.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from numpy.typing import ArrayLike

from ...model import RobotModel
from .levels import Level


@runtime_checkable
class Task(Protocol):
    """Anything that gives rows of a level; its rates broadcast against the configurations.

    Examples
    --------
    >>> from robotmodels.kinematics.inverse.joint_task import JointTask
    >>> isinstance(JointTask(0.0, joints=(0,)), Task)
    True
    """

    def level(self, model: RobotModel, q: ArrayLike) -> Level:
        """Rows that ask for velocities.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q : array_like, shape (..., n)
            Joint variables, rad or m.

        Returns
        -------
        Level
            N rows, the product of the leading axes of q.
        """
        ...

    def acceleration_level(self, model: RobotModel, q: ArrayLike, v: ArrayLike) -> Level:
        """Rows that ask for accelerations: the rates are those, and the drift is ``dJ/dt v``.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q, v : array_like, shape (..., n)
            Joint variables (rad or m) and velocities; the leading axes are the same.

        Returns
        -------
        Level
            N rows, the product of the leading axes of q.
        """
        ...
