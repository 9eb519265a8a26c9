"""How fast friction stops a robot, which bounds the steps of an explicit integration.

Source: E. Hairer and G. Wanner, "Solving Ordinary Differential Equations II", section IV.2
(stability of explicit Runge-Kutta methods).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ...model import RobotModel
from .controller import inverse_masses

_STEP = 1.5
"""Step, in time constants of viscous friction; with dry friction across its width, which adds 1,
within the 2.78 for which fourth-order Runge-Kutta is stable."""
_STABLE = 2.78


@dataclass(frozen=True, slots=True, eq=False)
class Stiffness(Rebuilt):
    """Largest rates of friction over some postures, for the integration step. Read-only."""

    names: tuple[str, ...]
    viscous: float
    joint_viscous: Array
    dry: Array

    def __post_init__(self) -> None:
        for name in ("joint_viscous", "dry"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def width(self, step: float) -> Array:
        """Widths around rest that a joint does not cross in one step, rad/s or m/s, shape (n,)."""
        return step * self.dry

    def steps(self, dt: float, goal: Array) -> int:
        """Steps of a sample for stability, and for widths that do not exceed the goal, (n,)."""
        asked = [dt * self.viscous / _STEP]
        asked += [dt * d / g for d, g in zip(self.dry, goal, strict=True) if g > 0.0]
        # a width that was made for one step is to give one step
        return max(1, int(np.ceil(max(asked) * (1.0 - 1e-9))))

    def stable(self, step: float) -> bool:
        """Whether an integration with this step follows viscous friction."""
        return step * self.viscous < _STABLE

    def sentence(self, dt: float, steps: int, goal: Array) -> str:
        """What fewer steps than were asked for mean, and for which joint."""
        step = dt / steps
        if not self.stable(step):
            worst = int(self.joint_viscous.argmax())
            rate = self.joint_viscous[worst]
            return (
                f"{self.names[worst]} is stiff: its viscous friction stops it within "
                f"{1.0 / rate:.2g} s, too fast for the {steps} steps of a sample of {dt:.3g} s, so "
                "that the simulation is not stable; give substeps= of closed_loop, or take least "
                "squares."
            )
        parts = np.where(goal > 0.0, self.width(step) / np.where(goal > 0.0, goal, 1.0), 0.0)
        worst = int(parts.argmax())
        return (
            f"{self.names[worst]} is stiff: with {steps} steps of a sample its simulated dry "
            f"friction rises over {self.width(step)[worst]:.2g} rad/s or m/s around rest instead "
            f"of {goal[worst]:.2g}, and its equations in between are left out; give substeps= of "
            "closed_loop for more."
        )


def stiffness(robot: RobotModel, q: Array) -> Stiffness | None:
    """Largest rates of the drives' friction over some postures. Shapes: q (N, n)."""
    inverse = inverse_masses(robot, q)
    if inverse is None:
        return None
    names, drives = tuple(robot.table.joint_names), robot.drive_matrices
    if drives is None:
        return Stiffness(names, 0.0, np.zeros(robot.n), np.zeros(robot.n))
    give = np.diagonal(inverse, axis1=1, axis2=2).max(axis=0)
    viscous = float(np.abs(np.linalg.eigvals(inverse @ drives.viscous)).max(initial=0.0))
    dry = np.abs(drives.coulomb) * give
    if robot.transmission is not None:
        for k, m in enumerate(robot.transmission.coupled_motors):
            w = drives.coupling[k]
            dry[m - 1] += abs(drives.coupled_coulomb[k]) * float((inverse @ w @ w).max())
    return Stiffness(names, viscous, give * np.abs(np.diagonal(drives.viscous)), dry)


def least_width(robot: RobotModel, q: Array, step: float) -> Array:
    """Least regularisation velocity of dry friction for a given integration step.

    Shapes: q (N, n) -> (n,).
    """
    found = stiffness(robot, q)
    return np.zeros(robot.n) if found is None else found.width(step)
