"""Joints whose readings are asked for, where some of them do not move the tool."""

from __future__ import annotations

from ..model import RobotModel


def joints_that_count(model: RobotModel) -> str:
    """Which joints count, and how fingers and other branches are left out; empty if all count."""
    moving = set(model.twin.frame(None).path.tolist())
    names = model.table.joint_names
    idle = [
        name
        for name, row in zip(names, model.table.joint_rows, strict=True)
        if row + 1 not in moving
    ]
    if not idle:
        return ""
    return (
        f" All {model.n} joints of the model count: {', '.join(names)}. {', '.join(idle)} do not "
        "move the tool; read the robot with tip_link=... (--tip-link) to leave them out."
    )
