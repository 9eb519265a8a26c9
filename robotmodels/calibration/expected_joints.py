"""Text on the joints that readings must contain."""

from __future__ import annotations

from ..model import RobotModel


def expected_joints_text(model: RobotModel) -> str:
    """Sentence on the expected joints; empty if all move the tool."""
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
        "move the tool. Read the robot with tip_link='LINK' to leave them out."
    )
