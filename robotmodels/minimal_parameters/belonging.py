"""Whether two robots have the same base parameters, each with values of its own."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..drive import Drives, drive_kinds
from ..geometry import PRISMATIC, REVOLUTE
from ..model import RobotModel
from .restraint import reach

_SAME = 1e-9
"""Difference of constants, relative to 1 (directions) or to the robot's size, that is rounding."""


def differences(model: RobotModel, other: RobotModel, drive: Drives) -> tuple[str, ...]:
    """Differences of two robots that change their base parameters."""
    if model is other:
        return ()
    a, b = model.chain, other.chain
    if not (np.array_equal(a.antecedent, b.antecedent) and np.array_equal(a.sigma, b.sigma)):
        return ("its frames or kinds of joints are others",)
    found: list[str] = []
    near = _SAME * reach(model)
    for k in range(model.f):
        j, before, sigma = k + 1, int(a.antecedent[k]), int(a.sigma[k])
        R, S, P, Q = a.rotation[k], b.rotation[k], a.position[k], b.position[k]
        turned = R[:, 2] - S[:, 2] if sigma == REVOLUTE else R - S
        moved = P - Q
        if sigma == PRISMATIC:
            moved = moved - (moved @ R[:, 2]) * R[:, 2]
        if np.abs(turned).max() > _SAME:
            found.append(f"axis {j} has another direction in frame {before}")
        elif before and np.abs(moved).max() > near:  # the base stands wherever it is
            found.append(f"axis {j} has another place in frame {before}")
    down, below = (np.asarray(m.gravity) @ m.chain.base_rotation for m in (model, other))
    if np.abs(down - below).max() > _SAME * max(1.0, float(np.abs(down).max())):
        found.append(f"gravity in the base is {_shown(below)} instead of {_shown(down)} m/s^2")
    if any(kind.coupling is not None for kind in drive_kinds(drive)):
        found += _coupling_differences(model, other)
    return tuple(found)


def _coupling_differences(model: RobotModel, other: RobotModel) -> list[str]:
    mine, theirs = (
        {} if m.transmission is None else {
            i: m.transmission.weights[i - 1] for i in m.transmission.coupled_motors
        }
        for m in (model, other)
    )  # fmt: skip
    if mine.keys() != theirs.keys():
        return ["other motors are coupled"]
    return [
        f"motor {i} is coupled in another way"
        for i in mine
        if np.abs(mine[i] - theirs[i]).max() > _SAME
    ]


def _shown(vector: Array) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in vector) + ")"
