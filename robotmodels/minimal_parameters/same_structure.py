"""Comparison of the structures that determine the base parameters of two robots."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..drive import Drives, drive_kinds
from ..geometry import PRISMATIC, REVOLUTE
from ..model import RobotModel
from .rules import reach

_SAME = 1e-9
"""Tolerance of constants, relative to 1 (directions) or to the robot's size."""


def structure_differences(model: RobotModel, other: RobotModel, drive: Drives) -> tuple[str, ...]:
    """Differences of two robots that change their base parameters."""
    if model is other:
        return ()
    a, b = model.chain, other.chain
    if not (np.array_equal(a.antecedent, b.antecedent) and np.array_equal(a.sigma, b.sigma)):
        return ("its frames or kinds of joints differ",)
    differences: list[str] = []
    near = _SAME * reach(model)
    for k in range(model.f):
        j, before, sigma = k + 1, int(a.antecedent[k]), int(a.sigma[k])
        R, S, P, Q = a.rotation[k], b.rotation[k], a.position[k], b.position[k]
        turned = R[:, 2] - S[:, 2] if sigma == REVOLUTE else R - S
        moved = P - Q
        if sigma == PRISMATIC:
            moved = moved - (moved @ R[:, 2]) * R[:, 2]
        if np.abs(turned).max() > _SAME:
            differences.append(f"axis {j} has another direction in frame {before}")
        elif before and np.abs(moved).max() > near:  # the pose of the base has no effect
            differences.append(f"axis {j} has another place in frame {before}")
    down, below = (np.asarray(m.gravity) @ m.chain.base_rotation for m in (model, other))
    if np.abs(down - below).max() > _SAME * max(1.0, float(np.abs(down).max())):
        differences.append(
            f"gravity in the base is {_shown(below)} instead of {_shown(down)} m/s^2"
        )
    if any(kind.coupling is not None for kind in drive_kinds(drive)):
        differences += _coupling_differences(model, other)
    return tuple(differences)


def _coupling_differences(model: RobotModel, other: RobotModel) -> list[str]:
    weights, others = (
        {}
        if m.transmission is None
        else {i: m.transmission.weights[i - 1] for i in m.transmission.coupled_motors}
        for m in (model, other)
    )
    if weights.keys() != others.keys():
        return ["other motors are coupled"]
    return [
        f"motor {i} is coupled in another way"
        for i in weights
        if np.abs(weights[i] - others[i]).max() > _SAME
    ]


def _shown(vector: Array) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in vector) + ")"
